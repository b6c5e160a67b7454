from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ttwmr_mj.dynamics import hitch, hybrid, kinematics, servo
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.robot import Hitch, RobotParameters, Servo
from ttwmr_mj.state import FloatArray, RobotState

PERIOD, STEP = 0.033, 0.011
FREE = RobotParameters()
SPRUNG = RobotParameters(hitch=Hitch(stiffness_n_m_rad=0.5, damping_n_m_s_rad=0.02))
FRICTION = 1e-3  # [N·m]
DRY = RobotParameters(hitch=Hitch(coulomb_friction_n_m=FRICTION))
LAB_TWIST = np.array([0.43 / 8, 1 / 8])
TILTED = RobotState.at_rest(0.6, -0.3, 0.35, 0.9)

Command = Callable[[int], FloatArray]


def follow(plant: AnalyticPlant, command: Command, periods: int) -> FloatArray:
    """q (periods, nsim, 4) after every period."""
    visited = []
    for period in range(periods):
        plant.advance(command(period), 1)
        visited.append(plant.state().q)
    return np.array(visited)


def jerky(period: int) -> FloatArray:
    """Some beyond the servo's speed limit; wheels are ramping nearly all the time."""
    phase = 0.7 * period
    return np.array([[5.0 * np.sin(phase) + 2.0, 9.0 * np.cos(1.3 * phase)]])


def gentle(period: int) -> FloatArray:
    """Steps that both wheels finish within the period, at different times."""
    return np.array([[2.0 + 0.5 * np.sin(period), 1.5 + 0.7 * np.cos(2.0 * period)]])


def lab_circle(_: int) -> FloatArray:
    return kinematics.wheels_from_twist(LAB_TWIST[None], FREE)


def slope(
    time_s: float,
    y: FloatArray,
    robot: RobotParameters,
    start: FloatArray,
    command: FloatArray,
    wheel_rate: FloatArray,
) -> FloatArray:
    """Time derivative of y = (x, y, θ1, θ2, θ̇2), put together from the tested models."""
    wheels = servo.ramp(start, command, robot.servo, np.array([time_s]))[0, 0]
    twist = kinematics.twist_from_wheels(wheels, robot)
    surge = kinematics.twist_from_wheels(wheel_rate, robot)[0]
    torque = hitch.spring_damper_torque(y[3] - y[2], y[4] - twist[1], robot.hitch)
    v = hybrid.acceleration_from_twist(y[2], twist, surge)
    theta2_acceleration = hybrid.trailer_acceleration(y[3], v, robot, torque)
    q_rate = kinematics.q_rate(y[:4], np.array([*twist, y[4]]))
    return np.array([*q_rate, theta2_acceleration])


def exact(
    robot: RobotParameters, initial: RobotState, command: Command, periods: int
) -> FloatArray:
    """q (periods, 4) by an adaptive eighth-order solver that is restarted at every kink."""
    limits, start, visited = robot.servo, np.zeros((1, 2)), []
    y = np.append(initial.q[0], 0.0)
    for period in range(periods):
        change = (servo.limit_speed(command(period), limits) - start)[0]
        kinks = np.abs(change) / limits.acceleration_limit_rad_s2
        edges = np.unique(np.clip([0.0, *kinks, PERIOD], 0.0, PERIOD))
        for begin, end in pairwise(edges):
            ramping = 0.5 * (begin + end) < kinks
            wheel_rate = np.where(ramping, np.sign(change), 0.0) * limits.acceleration_limit_rad_s2
            extra = (robot, start, command(period), wheel_rate)
            solution = solve_ivp(
                slope, (begin, end), y, args=extra, method="DOP853", rtol=1e-12, atol=1e-14
            )
            y = solution.y[:, -1]
        start = servo.ramp(start, command(period), limits, np.array([PERIOD]))[:, 0]
        visited.append(y[:4])
    return np.array(visited)


@pytest.mark.parametrize(
    ("robot", "command", "tolerance"),
    [
        # Fourth order: 90 steps of 11 ms that each err by about (rate·step)^5/120. The rate is
        # 3 rad/s while both wheels ramp (u̇1/k = 8 rad/s²) and 8 rad/s for the spring.
        (FREE, lab_circle, 1e-8),
        (FREE, jerky, 1e-8),
        (FREE, gentle, 1e-8),
        (SPRUNG, gentle, 1e-6),
    ],
)
def test_agrees_with_an_adaptive_solver_through_ramps_and_kinks(
    robot: RobotParameters, command: Command, tolerance: float
) -> None:
    plant = AnalyticPlant(robot, 1, PERIOD, STEP)
    plant.reset(TILTED)
    ours = follow(plant, command, 30)[:, 0]
    reference = exact(robot, TILTED, command, 30)
    # θ1 is exact and P a Gauss integral of sixth order.
    np.testing.assert_allclose(ours[:, :3], reference[:, :3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(ours[:, 3], reference[:, 3], rtol=0, atol=tolerance)


def test_converges_with_fourth_order() -> None:
    reference = exact(SPRUNG, TILTED, jerky, 20)[:, 3]
    errors = []
    for step in (PERIOD / 2, PERIOD / 4, PERIOD / 8):
        plant = AnalyticPlant(SPRUNG, 1, PERIOD, step)
        plant.reset(TILTED)
        errors.append(np.abs(follow(plant, jerky, 20)[:, 0, 3] - reference).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    # Measured 3.98 twice; a step across a kink would make it two.
    np.testing.assert_allclose(orders, 4.0, atol=0.15)


def test_one_long_advance_equals_many_short_ones() -> None:
    command = np.array([[3.0, 1.0]])
    one, many = AnalyticPlant(FREE, 1, 0.001, 0.001), AnalyticPlant(FREE, 1, 0.001, 0.001)
    one.advance(command, 99)
    for _ in range(33):
        many.advance(command, 3)
    # The same steps up to where the kinks fall among them: roundoff.
    np.testing.assert_allclose(one.state().q, many.state().q, atol=1e-12)
    np.testing.assert_allclose(one.wheel_speed_rad_s(), command, rtol=1e-15)


def test_wheels_follow_the_servo_governor_exactly() -> None:
    plant = AnalyticPlant(FREE, 1, PERIOD, STEP)
    setpoint = np.zeros((1, 2))
    for period in range(40):
        plant.advance(jerky(period), 1)
        setpoint = servo.ramp(setpoint, jerky(period), FREE.servo, np.array([PERIOD]))[:, 0]
        np.testing.assert_array_equal(plant.wheel_speed_rad_s(), setpoint)
    assert np.abs(setpoint).max() <= FREE.servo.speed_limit_rad_s


def test_state_rates_are_the_derivatives_of_the_state() -> None:
    plant = AnalyticPlant(SPRUNG, 1, 1e-4, 1e-4)
    plant.reset(TILTED)
    plant.advance(lab_circle(0), 400)
    before = plant.state()
    plant.advance(lab_circle(0), 1)
    after = plant.state()
    middle_rate = 0.5 * (before.q_rate + after.q_rate)
    # Trapezoidal rule over 0.1 ms: 1e-8·(third derivative, below 100)/12.
    np.testing.assert_allclose((after.q - before.q) / 1e-4, middle_rate, atol=1e-7)


def test_reset_takes_over_motion_and_drops_side_slip() -> None:
    plant = AnalyticPlant(FREE, 1, PERIOD, STEP)
    q = np.array([[0.1, 0.2, 0.7, -0.4]])
    rolling = kinematics.q_rate(q, np.array([[0.1, 0.3, -0.5]]))
    slipping = rolling + 0.2 * np.array([[np.sin(0.7), -np.cos(0.7), 0.0, 0.0]])
    plant.reset(RobotState(q=q, q_rate=slipping))
    # hitch angle and wheel speeds are what is stored, so equality is up to roundoff.
    np.testing.assert_allclose(plant.state().q, q, rtol=1e-15)
    np.testing.assert_allclose(plant.state().q_rate, rolling, rtol=1e-14)


def test_rest_stays_at_rest_exactly() -> None:
    plant = AnalyticPlant(FREE, 1, PERIOD, STEP)
    plant.reset(TILTED)
    initial = plant.state().q
    visited = follow(plant, lambda _: np.zeros((1, 2)), 50)
    np.testing.assert_array_equal(visited, np.broadcast_to(initial, visited.shape))


def test_aligned_straight_line_stays_straight_exactly() -> None:
    plant = AnalyticPlant(FREE, 1, PERIOD, STEP)
    visited = follow(plant, lambda n: np.full((1, 2), 3.0 if n < 50 else -6.0), 100)
    np.testing.assert_array_equal(visited[..., 1:], 0.0)
    assert np.ptp(visited[..., 0]) > 0.1


def test_batch_row_equals_single_run_bitwise() -> None:
    hitch_parameters = Hitch(
        stiffness_n_m_rad=0.1, damping_n_m_s_rad=1e-3, coulomb_friction_n_m=2e-3
    )
    robot = RobotParameters(hitch=hitch_parameters)
    nsim = 37  # not a multiple of any vector width
    rng = np.random.default_rng(4)
    commands = rng.uniform(-7.0, 7.0, (12, nsim, 2))
    commands[3:6] = commands[2]  # some time to arrive, and to be skipped in single runs
    commands[6:, ::3] = 0.0
    initial = RobotState(q=rng.uniform(-2, 2, (nsim, 4)), q_rate=np.zeros((nsim, 4)))
    batch = AnalyticPlant(robot, nsim, PERIOD, STEP)
    batch.reset(initial)
    together = follow(batch, lambda n: commands[n], 12)
    for row in range(nsim):
        single = AnalyticPlant(robot, 1, PERIOD, STEP)
        single.reset(RobotState(q=initial.q[row : row + 1], q_rate=initial.q_rate[row : row + 1]))
        alone = follow(single, lambda n, row=row: commands[n, row : row + 1], 12)
        np.testing.assert_array_equal(together[:, row], alone[:, 0])


@pytest.mark.parametrize("robot", [FREE, SPRUNG, DRY])
def test_swapped_wheels_give_exactly_mirrored_motion(robot: RobotParameters) -> None:
    mirror = np.array([1.0, -1.0, -1.0, -1.0])
    runs = []
    for swap, sign in ((slice(None), np.ones(4)), (slice(None, None, -1), mirror)):
        plant = AnalyticPlant(robot, 1, PERIOD, STEP)
        plant.reset(RobotState(q=TILTED.q * sign, q_rate=TILTED.q_rate))
        runs.append(follow(plant, lambda n, swap=swap: jerky(n)[:, swap], 60) * sign)
    # Bitwise: every operation in the plant is odd or even in the mirrored quantities.
    np.testing.assert_array_equal(runs[0], runs[1])


def test_damped_trailer_settles_radially_outward_in_both_senses() -> None:
    robot = RobotParameters(hitch=Hitch(damping_n_m_s_rad=5e-3), servo=Servo(preset="fast"))
    twist = np.array([[0.6, 1.0], [0.6, -1.0]])
    plant = AnalyticPlant(robot, 2, PERIOD, STEP)
    command = kinematics.wheels_from_twist(twist, robot)
    for _ in range(2200):
        plant.advance(command, 1)
    # Swings decay with 2·(J2 + m2·l²)/c = 2.9 s: 1e-10 after 72 s.
    np.testing.assert_allclose(
        plant.state().hitch_angle_rad, [0.5 * np.pi, -0.5 * np.pi], atol=1e-8
    )


def test_dry_hitch_turns_rigidly_below_its_friction() -> None:
    """On the lab circle the trailer needs 3e-4 N·m to stay out of its equilibrium."""
    plant = AnalyticPlant(DRY, 1, PERIOD, STEP)
    # Started in motion: the servo's full acceleration would break the hitch loose.
    xi_rate = np.array([[*LAB_TWIST, LAB_TWIST[1]]])
    plant.reset(RobotState(q=TILTED.q, q_rate=kinematics.q_rate(TILTED.q, xi_rate)))
    locked = plant.state().hitch_angle_rad
    for _ in range(600):
        plant.advance(lab_circle(0), 1)
        state = plant.state()
        assert state.q_rate[0, 3] == state.q_rate[0, 2]
    # The stored hitch angle is constant; reading it as θ2 − θ1 rounds, at θ of up to 4.
    np.testing.assert_allclose(state.hitch_angle_rad, locked, rtol=0, atol=1e-15)
    assert state.q[0, 2] > 2.5


def test_released_dry_hitch_slides_to_rest_and_sticks_there() -> None:
    q, q_rate = np.zeros((1, 4)), np.array([[0.0, 0.0, 0.0, 0.5]])
    plant = AnalyticPlant(DRY, 1, PERIOD, STEP)
    plant.reset(RobotState(q=q, q_rate=q_rate))
    deceleration = FRICTION / DRY.swing_inertia_kg_m2
    stop_s = 0.5 / deceleration
    visited = follow(plant, lambda _: np.zeros((1, 2)), int(stop_s / PERIOD) + 30)[:, 0, 3]
    # Constant deceleration: both Runge-Kutta and the search for the stop are exact.
    assert visited[-1] == pytest.approx(0.5**2 / (2 * deceleration), rel=1e-12)
    np.testing.assert_array_equal(visited[-28:], visited[-1])


@pytest.mark.parametrize("friction", [0.002, 0.02, 0.05])
def test_sticking_and_sliding_converge_with_second_order(friction: float) -> None:
    """A hitch that breaks loose, stops and turns round many times under jerky commands."""
    robot = RobotParameters(hitch=Hitch(coulomb_friction_n_m=friction))

    def angles(step: float) -> FloatArray:
        plant = AnalyticPlant(robot, 1, PERIOD, step)
        plant.reset(TILTED)
        return follow(plant, jerky, 20)[:, 0, 3]

    fine = angles(PERIOD / 256)
    for step in (PERIOD, PERIOD / 4, PERIOD / 16):
        # Where within a step events fall is chance, so a bound instead of an order: 1 rad/s²
        # where the hitch is driven with up to 8.
        assert np.abs(angles(step) - fine).max() < step**2


def test_dry_hitch_breaks_loose_when_the_load_exceeds_its_friction() -> None:
    # Standing across, the trailer's load is (J2 + m2·l²)·u̇1/k = m2·l·u̇1; a servo step is 1.3 m/s².
    surge = FREE.servo.acceleration_limit_rad_s2 * FREE.tractor.wheel_radius_m
    load = FREE.trailer.mass_kg * FREE.trailer.com_offset_m * surge
    angles = []
    for limit in (0.99 * load, 1.01 * load):
        robot = RobotParameters(hitch=Hitch(coulomb_friction_n_m=limit))
        plant = AnalyticPlant(robot, 1, PERIOD, STEP)
        plant.reset(RobotState.at_rest(0.0, 0.0, 0.0, 0.5 * np.pi))
        plant.advance(np.array([[6.0, 6.0]]), 1)
        angles.append(float(plant.state().hitch_angle_rad[0]))
    assert angles[0] < 0.5 * np.pi
    assert angles[1] == 0.5 * np.pi


@pytest.mark.parametrize(("published", "step", "accepted"), [
    (True, 0.0021, False),
    (True, 0.002, True),
    (False, 2e-4, False),
    (False, 9e-5, True),
])  # fmt: skip
def test_steps_beyond_the_stability_limit_are_rejected(
    published: bool, step: float, accepted: bool
) -> None:
    # Table II's spring, 200: eigenvalues −1267 1/s as printed, −27248 1/s as a torque.
    robot = RobotParameters(hitch=Hitch(stiffness_n_m_rad=200.0, damping_n_m_s_rad=200.0))

    def build() -> AnalyticPlant:
        return AnalyticPlant(robot, 1, PERIOD, step, published_spring=published)

    if not accepted:
        with pytest.raises(InputError) as error:
            build()
        for part in ("plant.analytic.max_step_s", f"{step:g}", "robot.hitch.stiffness_n_m_rad"):
            assert part in str(error.value)
        return
    plant = build()
    plant.reset(TILTED)
    visited = follow(plant, gentle, 10)
    assert np.abs(visited[:, 0, 3] - visited[:, 0, 2]).max() <= 0.55  # never beyond its start


def test_published_spring_acts_as_a_weaker_torque() -> None:
    m2_l = FREE.trailer.mass_kg * FREE.trailer.com_offset_m
    printed = RobotParameters(hitch=Hitch(stiffness_n_m_rad=5.0, damping_n_m_s_rad=0.5))
    torque = RobotParameters(
        hitch=Hitch(stiffness_n_m_rad=5.0 * m2_l, damping_n_m_s_rad=0.5 * m2_l)
    )
    runs = []
    for robot, published in ((printed, True), (torque, False)):
        plant = AnalyticPlant(robot, 1, PERIOD, STEP, published_spring=published)
        plant.reset(TILTED)
        runs.append(follow(plant, gentle, 30))
    np.testing.assert_allclose(runs[0], runs[1], atol=1e-12)


def test_failure_is_reported_per_simulation() -> None:
    plant = AnalyticPlant(FREE, 3, PERIOD, STEP)
    command = np.tile(lab_circle(0), (3, 1))
    command[1, 0] = np.nan
    plant.advance(command, 1)
    np.testing.assert_array_equal(plant.failed(), [False, True, False])
    single = AnalyticPlant(FREE, 1, PERIOD, STEP)
    single.advance(lab_circle(0), 1)
    np.testing.assert_array_equal(plant.state().q[[0, 2]], single.state().q.repeat(2, axis=0))


def test_returned_arrays_are_copies() -> None:
    plant = AnalyticPlant(FREE, 1, PERIOD, STEP)
    plant.advance(lab_circle(0), 1)
    before = plant.state().q.copy()
    plant.state().q[:] = 7.0
    plant.wheel_speed_rad_s()[:] = 7.0
    np.testing.assert_array_equal(plant.state().q, before)
