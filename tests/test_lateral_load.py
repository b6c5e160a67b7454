"""A trailer whose load is off its axis: it swings about another line, in every model."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from pydantic import ValidationError

from ttwmr_mj.dynamics import hybrid, kinematics, kinetics
from ttwmr_mj.dynamics.extended.one_trailer import ExtendedModel
from ttwmr_mj.dynamics.extended.parameters import ExtendedParameters
from ttwmr_mj.dynamics.flatness import centre_derivatives, motion_from_flat
from ttwmr_mj.dynamics.floor.balls import ball_loads
from ttwmr_mj.dynamics.floor.ground import GRAVITY_M_S2, Ground
from ttwmr_mj.dynamics.sampled.one_trailer import SampledModel
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.contact_readings import read_contacts
from ttwmr_mj.plants.extended import ExtendedPlant
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.results.curves import centre_of_oscillation, trailer_com
from ttwmr_mj.robot import Casters, Hitch, RobotParameters, Trailer
from ttwmr_mj.state import FloatArray, RobotState

ASIDE = 0.02
LOADED = RobotParameters(trailer=Trailer(com_lateral_m=ASIDE), casters=Casters(mass_kg=1e-5))
TRAILER = LOADED.trailer
RNG = np.random.default_rng(5)
Q, XI = RNG.uniform(-3, 3, (10, 4)), RNG.uniform(-2, 2, (10, 3))


def com(q: FloatArray) -> FloatArray:
    """(..., 2) P − l·t + e·n, in so many words."""
    cos, sin = np.cos(q[..., 3]), np.sin(q[..., 3])
    back = -TRAILER.com_offset_m
    return q[..., :2] + np.stack([back * cos - ASIDE * sin, back * sin + ASIDE * cos], axis=-1)


def test_the_com_is_where_it_is_said_and_f_behind_it() -> None:
    np.testing.assert_allclose(trailer_com(Q, LOADED), com(Q), atol=1e-14)
    distance = np.hypot(TRAILER.com_offset_m, ASIDE)
    assert pytest.approx(distance, rel=1e-14) == TRAILER.com_distance_m
    k = LOADED.swing_inertia_kg_m2 / (TRAILER.mass_kg * distance)
    expected = Q[:, :2] + k / distance * (com(Q) - Q[:, :2])
    np.testing.assert_allclose(centre_of_oscillation(Q, LOADED), expected, atol=1e-14)


def test_kinetic_energy_is_that_of_two_bodies() -> None:
    q_rate, step = kinematics.q_rate(Q, XI), 1e-6
    ours = kinetics.kinetic_energy(Q, q_rate, LOADED)
    moved = (com(Q + step * q_rate) - com(Q - step * q_rate)) / (2 * step)
    tractor = LOADED.tractor
    nose = XI[:, 0] ** 2 + (tractor.com_offset_m * XI[:, 1]) ** 2  # ahead and across
    twice = tractor.mass_kg * nose + tractor.yaw_inertia_kg_m2 * XI[:, 1] ** 2
    twice += TRAILER.mass_kg * (moved**2).sum(axis=1) + TRAILER.yaw_inertia_kg_m2 * XI[:, 2] ** 2
    np.testing.assert_allclose(ours, 0.5 * twice, rtol=1e-8)


def test_power_is_the_rate_of_the_energy_on_a_slope() -> None:
    """Which the mass matrix, the bias and gravity must agree on."""
    pull, step = Ground(slope_rad=0.2, downhill_rad=1.0).gravity_m_s2, 1e-5
    force, q_rate = RNG.normal(size=(10, 2)), kinematics.q_rate(Q, XI)
    xi = kinetics.forward_acceleration(Q, XI, force, 0.0, LOADED, pull)

    def energy(time_s: float) -> FloatArray:
        rate, q = XI + time_s * xi, Q + time_s * q_rate
        kinetic = kinetics.kinetic_energy(q, kinematics.q_rate(q, rate), LOADED)
        return kinetic - TRAILER.mass_kg * com(q) @ pull

    power = (energy(step) - energy(-step)) / (2 * step)
    tractor = LOADED.tractor
    nose = q_rate[:, :2] + tractor.com_offset_m * XI[:, 1:2] * np.stack(
        [-np.sin(Q[:, 2]), np.cos(Q[:, 2])], axis=-1
    )
    expected = (force * XI[:, :2]).sum(axis=1) + tractor.mass_kg * nose @ pull
    np.testing.assert_allclose(power, expected, rtol=1e-5, atol=1e-5)
    v = hybrid.acceleration_from_twist(Q[:, 2], XI[:, :2], xi[:, 0]) - pull
    np.testing.assert_allclose(hybrid.trailer_acceleration(Q[:, 3], v, LOADED), xi[:, 2], rtol=1e-9)


def test_the_compiled_trailer_weighs_what_it_should() -> None:
    plant = ContactPlant(LOADED, ContactOptions())
    data = mujoco.MjData(plant.model)
    mujoco.mj_forward(plant.model, data)
    trailer = plant.model.body("trailer").id
    assert plant.model.body_subtreemass[trailer] == pytest.approx(TRAILER.mass_kg, rel=1e-12)
    place = data.subtree_com[trailer] - data.xpos[trailer]
    assert place[:2] == pytest.approx([-TRAILER.com_offset_m, ASIDE], abs=1e-12)
    # yaw inertia about the hitch, as its joint feels it
    dof = plant.model.joint("hitch").dofadr[0]
    unit = np.zeros(plant.model.nv)
    unit[dof] = 1.0
    torque = np.zeros(plant.model.nv)
    mujoco.mj_mulM(plant.model, data, torque, unit)
    assert torque[dof] == pytest.approx(LOADED.swing_inertia_kg_m2, rel=1e-6)


def test_it_hangs_downhill_with_its_load_below_its_hitch() -> None:
    ground = Ground(slope_rad=0.1, downhill_rad=0.4)
    robot = LOADED.model_copy(update={"hitch": Hitch(damping_n_m_s_rad=0.02)})
    hanging = 0.4 - np.pi + TRAILER.lean_rad
    for plant in (
        ContactPlant(robot, ContactOptions(), ground=ground),
        AnalyticPlant(robot, 1, 0.0005, 0.005, ground=ground),
    ):
        plant.reset(RobotState.at_rest(0.0, 0.0, 0.0, hanging + 0.3))
        plant.advance(np.zeros((1, 2)), 20_000)
        # after 10 s of a swing that is damped within one; the standing tractor creeps by 0.4 mm
        assert plant.state().q[0, 3] == pytest.approx(hanging, abs=1e-4)


def test_its_balls_carry_their_shares_from_the_start() -> None:
    plant = ContactPlant(LOADED, ContactOptions())
    plant.reset(RobotState.at_rest(0, 0, 0.3, 0.1))
    loads = ball_loads(LOADED, GRAVITY_M_S2)
    assert loads[2] - loads[1] == pytest.approx(TRAILER.mass_kg * GRAVITY_M_S2 * ASIDE / 0.05)
    first = read_contacts(plant.contact_readings()).force_n[0, 3:, 2]
    plant.advance(np.zeros((1, 2)), 200)
    later = read_contacts(plant.contact_readings()).force_n[0, 3:, 2]
    np.testing.assert_allclose(first, later, rtol=5e-4)
    # less apart than on a trailer of its own: the stiff hitch hands part of the tilt to the tractor
    assert 0.0 < later[1] - later[0] < loads[2] - loads[1]


def test_models_agree_behind_a_moving_tractor() -> None:
    expected = ExtendedModel.of(LOADED, ExtendedParameters.expected(LOADED))
    centred = RobotParameters(casters=Casters(mass_kg=1e-5))
    plants = (
        ContactPlant(LOADED, ContactOptions()),
        AnalyticPlant(LOADED, 1, 0.0005, 0.011),
        ExtendedPlant(expected, 1, 0.0005, 0.011),
        AnalyticPlant(centred, 1, 0.0005, 0.011),
    )
    angles = []
    for plant in plants:
        plant.reset(RobotState.at_rest(0.0, 0.0, 0.0, 0.8))
        for _ in range(60):
            plant.advance(np.array([[4.0, 2.0]]), 66)
        angles.append(plant.state().q[0, 3])
    body, wheels = np.array([[0.0, 0.0, 0.0, 0.8, 0.0]]), np.zeros((1, 2))
    model = SampledModel(LOADED, 0.033, substep_s=1e-3)
    for _ in range(60):
        body, wheels = model.advance(body, wheels, np.array([[4.0, 2.0]]))
    contact, plain, extended, without = angles
    assert abs(plain - without) > 0.05
    # as for a centred load (test_balls)
    assert plain == pytest.approx(contact, abs=5e-4)
    assert extended == pytest.approx(contact, abs=5e-4)
    assert body[0, 3] == pytest.approx(plain, abs=1e-5)


def test_the_flat_output_is_that_of_the_load() -> None:
    """F'' points along the line through the COM, and the motion comes back from F."""
    flat = np.zeros((1, 5, 2))
    phase = 0.7 + 0.5 * np.pi * np.arange(5)
    flat[0] = 0.6 * np.stack([np.cos(phase), np.sin(phase)], axis=-1)  # 1 rad/s
    motion = motion_from_flat(flat, -1.0, LOADED)
    q = np.array([[*motion.position[0, 0], motion.theta1[0, 0], motion.theta2[0, 0]]])
    np.testing.assert_allclose(centre_of_oscillation(q, LOADED), flat[:, 0], atol=1e-14)
    back = centre_derivatives(motion.position, motion.theta2[..., None], LOADED)
    np.testing.assert_allclose(back, flat[:, :3], atol=1e-12)
    swing = hybrid.trailer_acceleration(motion.theta2[:, 0], motion.position[:, 2], LOADED)
    np.testing.assert_allclose(swing, motion.theta2[:, 2], atol=1e-12)


@pytest.mark.parametrize("aside", [0.051, -0.06])
def test_a_load_beyond_a_ball_is_refused(aside: float) -> None:
    with pytest.raises(ValidationError, match=r"between -0\.05 and 0\.05"):
        RobotParameters(trailer=Trailer(com_lateral_m=aside))
