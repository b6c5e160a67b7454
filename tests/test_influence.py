"""What acts on the trailer: forces one by one, and the sampled model under them."""

from __future__ import annotations

import numpy as np
import pytest

from ttwmr_mj.dynamics import kinematics
from ttwmr_mj.dynamics.floor.ground import GRAVITY_M_S2, Ground
from ttwmr_mj.dynamics.floor.influence import DRAG, DRY, GRAVITY, VISCOUS, held_back, influence_of
from ttwmr_mj.dynamics.sampled.one_trailer import SampledModel
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.robot import Casters, Hitch, RobotParameters
from ttwmr_mj.state import FloatArray, RobotState

PERIOD = 0.033
BARE = RobotParameters()
SLOPE = Ground(slope_rad=0.02, downhill_rad=0.7)
RNG = np.random.default_rng(3)


def robot_of(dry: float = 0.0) -> RobotParameters:
    hitch = Hitch(damping_n_m_s_rad=2e-3, coulomb_friction_n_m=dry)
    return RobotParameters(hitch=hitch, casters=Casters(rolling_resistance_m=1e-4))


def test_the_five_numbers_of_a_robot_that_is_known() -> None:
    robot = robot_of(dry=1e-3)
    found, inertia = influence_of(robot, SLOPE), robot.swing_inertia_kg_m2
    downhill = GRAVITY_M_S2 * np.sin(0.02) * np.array([np.cos(0.7), np.sin(0.7)])
    np.testing.assert_allclose(found[GRAVITY], downhill, rtol=1e-12)
    drag = 1e-4 / robot.casters.radius_m * GRAVITY_M_S2 * np.cos(0.02)
    assert found[DRAG] == pytest.approx(drag, rel=1e-12)
    assert found[DRY] == pytest.approx(1e-3 / inertia, rel=1e-12)
    assert found[VISCOUS] == pytest.approx(2e-3 / inertia, rel=1e-12)
    socket = RobotParameters(casters=Casters(socket_friction_n_m=2e-4))
    both = 2.0 * 2e-4 / socket.casters.radius_m / socket.trailer.mass_kg
    assert influence_of(socket, Ground())[DRAG] == pytest.approx(both, rel=1e-12)


def test_held_back_is_the_torque_of_two_balls_about_p() -> None:
    """Each force against its ball's velocity, its torque about P by the cross product."""
    along, across, turn = RNG.uniform(-1.0, 1.0, (3, 20))
    drag, trailer = 0.3, BARE.trailer
    torque = np.zeros(20)
    for side in (-1.0, 1.0):
        x, y = -trailer.com_offset_m, side * BARE.casters.trailer_half_spacing_m
        # of the ball, from the COM's: ω × r with r = (0, y)
        velocity = np.array([along - y * turn, across])
        force = -0.5 * drag * trailer.mass_kg * velocity / np.hypot(*velocity)
        torque += x * force[1] - y * force[0]
    expected = BARE.swing_length_m * torque / BARE.swing_inertia_kg_m2
    ours = held_back(np.array(drag), along, across, turn, BARE)
    # 1 mm/s of fading against speeds of decimetres: (1e-3/0.1)²/2
    np.testing.assert_allclose(ours, expected, atol=1e-4 * drag)
    # mirrored, it is the other way round
    mirrored = held_back(np.array(drag), along, -across, -turn, BARE)
    np.testing.assert_allclose(mirrored, -ours, rtol=1e-12)


def test_balls_hold_back_a_swing_and_a_slide_but_not_a_straight_pull() -> None:
    drag, none = np.array(0.3), np.zeros(1)
    assert held_back(drag, np.ones(1), none, none, BARE) == pytest.approx([0.0], abs=1e-15)
    # a COM that slides to the right is pushed to the left, and P holds the other end: θ2 falls
    assert held_back(drag, none, -np.ones(1), none, BARE)[0] == pytest.approx(-drag, rel=1e-5)
    swing = held_back(drag, none, -BARE.trailer.com_offset_m * np.ones(1), np.ones(1), BARE)
    assert swing[0] < 0.0


def turning(period: int) -> FloatArray:
    return np.array([[3.0 + np.sin(0.9 * period), 1.0 - np.cos(1.7 * period)]])


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("dry", [0.0, 2e-3])
def test_the_sampled_model_goes_where_the_fine_plant_goes(dry: float, known: bool) -> None:
    """Known with the robot and its floor, or told from outside to a model that knows nothing."""
    robot = robot_of(dry)
    model = SampledModel(robot if known else BARE, PERIOD, 1e-3, ground=SLOPE if known else None)
    told = None if known else influence_of(robot, SLOPE)[None]
    q = np.array([[0.0, 0.0, 0.3, 1.2]])
    start = RobotState(q, kinematics.q_rate(q, np.array([[0.05, 1.0, 0.2]])))
    plant = AnalyticPlant(robot, 1, PERIOD, PERIOD / 128, ground=SLOPE)
    plant.reset(start)
    body = np.column_stack([q, [0.2]])
    wheels = kinematics.wheels_from_twist(np.array([[0.05, 1.0]]), robot)
    for period in range(40):
        plant.advance(turning(period), 1)
        body, wheels = model.advance(body, wheels, turning(period), influence=told)
    # second order in 1 ms; sticking is found to one substep
    np.testing.assert_allclose(body[0, :4], plant.state().q[0], atol=1e-3 if dry else 3e-5)


def test_a_row_of_a_batch_is_the_row_alone() -> None:
    """Where others slope, are resisted or rub, who is free is not even rounded differently."""
    influence = np.diag([0.1, -0.1, 0.2, 0.3, 0.4])
    influence = np.concatenate([influence, np.zeros((1, 5)), np.full((1, 5), 0.1)])
    body, wheels = RNG.normal(size=(7, 5)), RNG.normal(size=(7, 2))
    command = wheels + RNG.normal(size=(7, 2))
    for smoothing in (0.0, 0.05):
        model = SampledModel(BARE, PERIOD, smoothing_rad_s=smoothing)
        together, _ = model.advance(body, wheels, command, influence=influence)
        for i in range(7):
            row = slice(i, i + 1)
            alone, _ = model.advance(body[row], wheels[row], command[row], influence=influence[row])
            np.testing.assert_array_equal(together[row], alone)
