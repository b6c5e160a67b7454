"""Balls that resist, by rolling resistance or by friction in their sockets, in every model."""

from __future__ import annotations

import numpy as np
import pytest

from ttwmr_mj.dynamics.extended.one_trailer import ExtendedModel
from ttwmr_mj.dynamics.extended.parameters import ExtendedParameters
from ttwmr_mj.dynamics.floor.ground import GRAVITY_M_S2, LEVEL, Ground
from ttwmr_mj.dynamics.floor.influence import DRAG, influence_of
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.plants.base import Plant
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.extended import ExtendedPlant
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.robot import Casters, Hitch, RobotParameters
from ttwmr_mj.state import RobotState

LEVER, SOCKET = 1e-4, 1.5e-4  # m, N·m
TINY = 1e-5  # kg: the balls' own inertia is not asked about
ROLLING = RobotParameters(casters=Casters(mass_kg=TINY, rolling_resistance_m=LEVER))
RUBBING = RobotParameters(casters=Casters(mass_kg=TINY, socket_friction_n_m=SOCKET))
STEP = 0.0005


def plant_of(kind: str, robot: RobotParameters, ground: Ground = LEVEL) -> Plant:
    if kind == "contact":
        return ContactPlant(robot, ContactOptions(), ground=ground)
    if kind == "analytic":
        return AnalyticPlant(robot, 1, STEP, 0.011, ground=ground)
    model = ExtendedModel.of(robot, ExtendedParameters.expected(robot), ground)
    return ExtendedPlant(model, 1, STEP, 0.002)


def slowing(robot: RobotParameters, ground: Ground = LEVEL) -> float:
    """[rad/s²] of a trailer that swings beside a standing tractor: two forces on one lever."""
    casters, trailer = robot.casters, robot.trailer
    load = 0.5 * trailer.mass_kg * ground.normal_gravity_m_s2
    force = (casters.rolling_resistance_m * load + casters.socket_friction_n_m) / casters.radius_m
    lever = np.hypot(trailer.com_offset_m, casters.trailer_half_spacing_m)
    return float(2.0 * force * lever / robot.swing_inertia_kg_m2)


@pytest.mark.parametrize("robot", [ROLLING, RUBBING], ids=["rolling", "socket"])
@pytest.mark.parametrize(
    ("kind", "tolerance"),
    # the models fade below 1 mm/s, of 150; on contact the tiny balls and runners add their inertia
    [("analytic", 1e-4), ("extended", 1e-4), ("contact", 1e-3)],
)
def test_beside_a_standing_tractor_the_trailer_slows_down_evenly(
    kind: str, tolerance: float, robot: RobotParameters
) -> None:
    plant = plant_of(kind, robot)
    start = RobotState.at_rest(0.1, 0.2, 0.3, 0.4)
    rate, time_s = 1.0, 0.5
    plant.reset(RobotState(start.q, np.array([[0.0, 0.0, 0.0, rate]])))
    plant.advance(np.zeros((1, 2)), round(time_s / STEP))
    lost = rate - plant.state().q_rate[0, 3]
    assert lost == pytest.approx(slowing(robot) * time_s, rel=tolerance)
    # and comes to rest, where it stays
    plant.advance(np.zeros((1, 2)), round((rate / slowing(robot) - time_s) * 1.1 / STEP))
    angle = plant.state().q[0, 3]
    assert abs(plant.state().q_rate[0, 3]) < 1e-3
    assert angle - 0.4 == pytest.approx(rate**2 / (2.0 * slowing(robot)), rel=tolerance + 1e-3)


def test_a_socket_does_what_rolling_resistance_of_the_same_torque_does() -> None:
    load = 0.5 * ROLLING.trailer.mass_kg * GRAVITY_M_S2
    same = RobotParameters(casters=Casters(mass_kg=TINY, socket_friction_n_m=LEVER * load))
    states = []
    for robot in (ROLLING, same):
        plant = plant_of("analytic", robot)
        plant.reset(RobotState.at_rest(0, 0, 0.0, 1.0))
        plant.advance(np.array([[3.0, 1.0]]), 2000)
        states.append(plant.state().q)
    np.testing.assert_allclose(states[0], states[1], atol=1e-12)
    np.testing.assert_allclose(influence_of(ROLLING, LEVEL), influence_of(same, LEVEL), rtol=1e-12)


def test_a_slope_takes_load_off_rolling_but_not_off_sockets() -> None:
    steep = Ground(slope_rad=0.3)
    share = influence_of(ROLLING, steep)[DRAG] / influence_of(ROLLING, LEVEL)[DRAG]
    assert share == pytest.approx(np.cos(0.3))
    assert influence_of(RUBBING, steep)[DRAG] == influence_of(RUBBING, LEVEL)[DRAG]


@pytest.mark.parametrize("robot", [ROLLING, RUBBING], ids=["rolling", "socket"])
@pytest.mark.parametrize("hitch", [Hitch(), Hitch(coulomb_friction_n_m=3e-4)], ids=["free", "dry"])
def test_models_agree_behind_a_moving_tractor(robot: RobotParameters, hitch: Hitch) -> None:
    robot = robot.model_copy(update={"hitch": hitch})
    free = RobotParameters(hitch=hitch, casters=Casters(mass_kg=TINY))
    angles = []
    for kind, driven in (
        ("contact", robot),
        ("analytic", robot),
        ("extended", robot),
        ("contact", free),
    ):
        plant = plant_of(kind, driven)
        plant.reset(RobotState.at_rest(0.0, 0.0, 0.0, 0.8))
        for _ in range(60):
            plant.advance(np.array([[4.0, 2.0]]), 66)
        angles.append(plant.state().q[0, 3])
    contact, plain, extended, without = angles
    # timestep and contacts give 3e-4 rad, whatever the balls do
    assert abs(contact - without) > 0.025
    assert plain == pytest.approx(contact, abs=5e-4)
    assert extended == pytest.approx(contact, abs=5e-4)


def test_a_trailer_at_rest_does_not_chatter() -> None:
    """Balls that could stop it in a tenth of a step: it creeps to rest, one way."""
    robot = RobotParameters(casters=Casters(rolling_resistance_m=5e-3))
    plant = plant_of("analytic", robot)
    plant.reset(RobotState(np.zeros((1, 4)), np.array([[0.0, 0.0, 0.0, 0.5]])))
    rates = []
    for _ in range(100):
        plant.advance(np.zeros((1, 2)), 22)
        rates.append(plant.state().q_rate[0, 3])
    assert np.all(np.diff(rates) <= 0.0)
    assert 0.0 <= rates[-1] < 1e-9
