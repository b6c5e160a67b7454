"""Motions of trains: by flatness, on circles, and of the analytic plants."""

from itertools import product

import numpy as np
import pytest
from trains import train

from ttwmr_mj.dynamics.circling import circling, circling_behind
from ttwmr_mj.dynamics.flatness import is_flat, motion_from_flat
from ttwmr_mj.dynamics.floor.ground import Ground
from ttwmr_mj.dynamics.kinematics import wheels_from_twist
from ttwmr_mj.dynamics.train import trailer_accelerations
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.plants.kinetic import KineticPlant
from ttwmr_mj.plants.train_swing import TrainSwing
from ttwmr_mj.robot import Casters, Hitch, RobotParameters, Trailer
from ttwmr_mj.state import FloatArray, RobotState

PERIOD, STEP = 0.033, 0.011
SIDES = [sides for n in (1, 2, 3) for sides in product((True, False), repeat=n)]


def ellipse(orders: int) -> FloatArray:
    """F (5, orders, 2) and its derivatives, at times of one lap."""
    phase = np.arange(5)[:, None] + 0.5 * np.pi * np.arange(orders)
    rates = 0.9 ** np.arange(orders)
    return np.stack([0.7 * rates * np.cos(phase), 0.5 * rates * np.sin(phase)], axis=-1)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_flat_motions_solve_the_equations_of_motion(count: int) -> None:
    robot, pull = train(count, reach_m=None), np.zeros((5, 4 + 2 * count, 2))
    pull[:, 0] = [0.06, -0.05]  # a slope of half a degree
    assert is_flat(robot)
    for signs in product((1.0, -1.0), repeat=count):
        motion = motion_from_flat(ellipse(6 + 2 * count), signs, robot, pull)
        assert motion.position.shape == (5, 6, 2)
        theta = np.stack([angle[:, :3] for angle in motion.trailers], axis=-1)
        v = motion.position[:, 2] - pull[:, 0]
        swing = trailer_accelerations(theta[:, 0], theta[:, 1], v, robot)
        # rounding, through up to eight derivatives of size 0.7
        np.testing.assert_allclose(theta[:, 2], swing, rtol=0, atol=1e-9)


def test_elsewhere_trains_are_not_flat() -> None:
    robot = train(2, reach_m=Trailer().swing_length_m + 0.05)
    assert not is_flat(robot)
    motion = motion_from_flat(ellipse(10), (1.0, 1.0), robot)
    theta = np.stack([angle[:, :3] for angle in motion.trailers], axis=-1)
    swing = trailer_accelerations(theta[:, 0], theta[:, 1], motion.position[:, 2], robot)
    assert np.abs(theta[:, 2] - swing).max() > 0.05


@pytest.mark.parametrize("sides", SIDES)
def test_every_combination_of_sides_turns_with_the_circle(sides: tuple[bool, ...]) -> None:
    robot = train(len(sides))
    turning = circling(robot, sides, 0.6)
    inward = np.array([-0.6 * 1.3**2, 0.0])
    rate = np.full(len(sides), 1.3)
    swing = trailer_accelerations(turning.trailer_rad, rate, inward, robot)
    np.testing.assert_allclose(swing, 0.0, atol=1e-13)
    back = circling_behind(robot, sides, turning.centre_m[0])
    assert back.radius_m == pytest.approx(0.6, abs=1e-15)
    fastest = turning.poles(robot, 1.0).real.max()
    # all outside: on the imaginary axis, where rounding under the root is its square root
    assert fastest < 1e-6 if all(sides) else fastest > 1.9


@pytest.mark.parametrize(
    ("sides", "pole_1_s"),
    [((False,), 1.95), ((False, False), 2.82), ((False,) * 3, 2.69), ((True, False, False), 4.57)],
)
def test_poles_of_trains_inside(sides: tuple[bool, ...], pole_1_s: float) -> None:
    poles = circling(train(len(sides)), sides, 0.6).poles(train(len(sides)), 1.0)
    assert poles.real.max() == pytest.approx(pole_1_s, abs=0.006)


def test_loads_off_the_axis_turn_with_the_circle_too() -> None:
    leaning = Trailer(com_lateral_m=0.02, next_hitch_offset_m=0.2)
    robot = RobotParameters(trailers=(leaning, leaning), hitches=(Hitch(), Hitch()))
    theta = circling(robot, (False, True), 0.5).trailer_rad
    swing = trailer_accelerations(theta, np.ones(2), np.array([-0.5, 0.0]), robot)
    np.testing.assert_allclose(swing, 0.0, atol=1e-12)
    assert np.abs(theta - [0.0, np.pi]).max() > 0.02


def jerky(period: int) -> FloatArray:
    return np.array([[5.0 * np.sin(0.7 * period) + 2.0, 4.0 * np.cos(0.9 * period)]])


def drive(plant: AnalyticPlant | KineticPlant, command, periods: int = 30) -> FloatArray:
    """q (periods, nsim, 3 + n)."""
    return np.array([(plant.advance(command(i), 1), plant.state().q)[1] for i in range(periods)])


@pytest.mark.parametrize(
    ("hitch", "tolerance"),
    [
        ({}, 1e-13),  # the same steps with the same equations, put together otherwise
        ({"stiffness_n_m_rad": 0.5, "damping_n_m_s_rad": 0.02}, 1e-13),
        # each finds its stops in a way of its own, to second order of the step
        ({"coulomb_friction_n_m": 1e-3}, 1e-4),
    ],
)
def test_a_train_of_one_swings_as_one_trailer(hitch: dict[str, float], tolerance: float) -> None:
    robot = RobotParameters(hitch=Hitch(**hitch), casters=Casters(rolling_resistance_m=1e-4))
    ground = Ground(slope_rad=0.02)
    ways = [AnalyticPlant(robot, 1, PERIOD, STEP, ground=ground) for _ in range(2)]
    ways[1]._swing = TrainSwing(robot, ground, STEP)
    for plant in ways:
        plant.reset(RobotState.at_rest(0.0, 0.0, 0.3, 0.9))
    one, other = (drive(plant, jerky) for plant in ways)
    np.testing.assert_allclose(other, one, rtol=0, atol=tolerance)


def test_steps_are_of_fourth_order_and_rows_and_mirrors_the_same() -> None:
    robot = train(3, stiffness_n_m_rad=0.05, damping_n_m_s_rad=1e-3)
    start = RobotState.at_rest(0.1, 0.0, 0.3, [0.9, -0.4, 0.2])
    ends = []
    for step in (PERIOD / 2, PERIOD / 4, PERIOD / 32):
        plant = AnalyticPlant(robot, 1, PERIOD, step)
        plant.reset(start)
        ends.append(drive(plant, jerky)[-1, 0, 3:])
    errors = [np.abs(end - ends[-1]).max() for end in ends[:2]]
    assert np.log2(errors[0] / errors[1]) > 3.5
    q = np.vstack([start.q, -start.q, start.q])
    q[:, 0] = start.q[0, 0]
    plant = AnalyticPlant(robot, 3, PERIOD, PERIOD / 2)
    plant.reset(RobotState(q=q, q_rate=np.zeros_like(q)))
    both = drive(plant, lambda i: np.vstack([jerky(i), jerky(i)[:, ::-1], jerky(i + 1)]))[-1]
    np.testing.assert_array_equal(both[0, 3:], ends[0])
    np.testing.assert_array_equal(both[0, 1:], -both[1, 1:])


def test_a_hitch_that_sticks_does_not_turn_and_the_others_do() -> None:
    free, stuck = Hitch(), Hitch(coulomb_friction_n_m=0.05)
    towing = Trailer(next_hitch_offset_m=0.23)
    robot = RobotParameters(trailers=(towing, Trailer()), hitches=(free, stuck))
    plant = AnalyticPlant(robot, 1, PERIOD, STEP)
    plant.reset(RobotState.at_rest(0.0, 0.0, 0.0, [0.5, 0.9]))
    path = drive(plant, jerky)[:, 0]
    np.testing.assert_allclose(path[:, 4] - path[:, 3], 0.4, rtol=0, atol=1e-15)
    # the two are one rigid trailer then
    m, d = towing.mass_kg, 0.23
    com = np.array([-0.141, 0.0]), np.array([-d - 0.141 * np.cos(0.4), -0.141 * np.sin(0.4)])
    middle = 0.5 * (com[0] + com[1])
    inertia = 2 * (towing.yaw_inertia_kg_m2 + m * ((com[0] - middle) ** 2).sum())
    rigid = Trailer(
        mass_kg=2 * m, yaw_inertia_kg_m2=inertia, com_offset_m=-middle[0], com_lateral_m=middle[1]
    )
    casters = Casters(trailer_half_spacing_m=0.1)
    alone = AnalyticPlant(RobotParameters(trailer=rigid, casters=casters), 1, PERIOD, STEP)
    alone.reset(RobotState.at_rest(0.0, 0.0, 0.0, 0.5))
    np.testing.assert_allclose(path[:, 3], drive(alone, jerky)[:, 0, 3], rtol=0, atol=1e-12)


def test_friction_takes_the_energy_of_trailers_behind_a_tractor_at_rest() -> None:
    robot = train(3, coulomb_friction_n_m=0.2)
    plant = AnalyticPlant(robot, 1, PERIOD, STEP)
    q = np.array([[0.0, 0.0, 0.0, 0.4, -0.3, 0.8]])
    plant.reset(RobotState(q=q, q_rate=np.array([[0.0, 0.0, 0.0, 2.0, -1.0, 3.0]])))
    path = drive(plant, lambda _: np.zeros((1, 2)), 100)[:, 0]
    np.testing.assert_array_equal(path[-1], path[-2])
    assert np.abs(path[-1, 3:] - q[0, 3:]).max() > 0.1


def test_a_train_stays_outside_its_circle_on_both_analytic_plants() -> None:
    robot = train(2)
    turning = circling(robot, (True, True), 0.6)
    q = np.array([[0.6, 0.0, 0.5 * np.pi, *turning.trailer_rad]])
    rate = np.array([[0.0, 0.6, 1.0, 1.0, 1.0]])
    wheels = wheels_from_twist(np.array([[0.6, 1.0]]), robot)
    fast = robot.model_copy(
        update={"servo": robot.servo.model_copy(update={"speed_limit_rad_s": 40.0})}
    )
    plant = AnalyticPlant(fast, 1, PERIOD, STEP)
    plant.reset(RobotState(q=q, q_rate=rate))
    path = drive(plant, lambda _: wheels, 60)[:, 0]
    np.testing.assert_allclose(path[:, 3] - path[:, 2], np.pi / 2, rtol=0, atol=1e-9)
    np.testing.assert_allclose(path[:, 4] - path[:, 2], np.pi / 2, rtol=0, atol=1e-9)
    # torques that keep P's speed keep the circle: what Eq. 23 asks of (f, τ)
    free = KineticPlant(fast, 1, PERIOD, STEP)
    free.reset(RobotState(q=q, q_rate=rate))
    nose = robot.tractor.mass_kg * robot.tractor.com_offset_m
    drive_n, spin = -nose, nose * 0.6
    torque = 0.026 * np.array([[0.5 * drive_n + spin / 0.119, 0.5 * drive_n - spin / 0.119]])
    moved = drive(free, lambda _: torque, 30)[:, 0]
    np.testing.assert_allclose(moved, path[:30], rtol=0, atol=1e-6)


def test_what_trains_cannot_have_is_refused() -> None:
    with pytest.raises(InputError, match="published_spring"):
        AnalyticPlant(train(2), 1, PERIOD, STEP, published_spring=True)
    with pytest.raises(InputError, match="max_step_s"):
        AnalyticPlant(train(2, stiffness_n_m_rad=400.0), 1, PERIOD, STEP)
