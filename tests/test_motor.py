"""A servo as a motor: its closed forms, its firmware, and the plant that has it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ttwmr_mj.composite import wheel_inertia
from ttwmr_mj.dynamics.motor import Drive, Firmware, gear_friction
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.robot import RobotParameters, Servo
from ttwmr_mj.robot.motor import Motor
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.state import RobotState

OPEN_LOOP = {"speed_gain_v_s_rad": 0.0, "speed_integral_gain_v_rad": 0.0}
PLAIN = {"pwm_steps": 0, "dead_band_v": 0.0, "encoder_counts_per_turn": 0, "command_delay_s": 0.0}
STEP_RAMP = {"acceleration_limit_rad_s2": 1e5}
PERIOD = 66  # physics steps


def robot_with(servo: dict | None = None, **motor: object) -> RobotParameters:
    return RobotParameters(servo=Servo.model_validate({"motor": motor, **(servo or {})}))


def motor_of(robot: RobotParameters) -> Motor:
    assert robot.servo.motor is not None
    return robot.servo.motor


def straight_speeds(robot: RobotParameters, set_speed: float, periods: int) -> np.ndarray:
    """(periods × steps,) speed of a wheel, from rest straight ahead with the trailer behind."""
    plant = ContactPlant(robot, ContactOptions())
    plant.reset(RobotState.at_rest(0.0, 0.0, 0.0, 0.0))
    plant.keep_physics_rate()
    for _ in range(periods):
        plant.advance(np.full((1, 2), set_speed), PERIOD)
    return plant.physics_rate_states()[2][0, :, 0]


def told(firmware: Firmware, *, angle: float = 0.0, speed: float = 0.0) -> Firmware:
    firmware.reset(np.full((1, 2), angle), np.full((1, 2), speed), np.full((1, 2), speed))
    return firmware


# --- the motor -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("preset", "rev_per_min", "stall_n_m", "stall_a"),
    [("lab", 59, 1.62, 1.5), ("fast", 470, 0.2, 1.4)],
)
def test_the_presets_are_their_data_sheets(
    preset: str, rev_per_min: float, stall_n_m: float, stall_a: float
) -> None:
    motor = motor_of(robot_with({"preset": preset}))
    assert motor.preset == preset  # the servo's, where the motor names none
    drive, full = Drive.of(Servo(motor=motor)), np.array(motor.supply_voltage_v)
    # the constants are rounded to three digits
    net = drive.torque(full, np.array(0.0)) - motor.gear_friction_n_m
    assert float(net) == pytest.approx(stall_n_m, rel=2e-3)
    assert motor.supply_voltage_v / motor.resistance_ohm == pytest.approx(stall_a, rel=2e-3)
    speed = np.array(rev_per_min * 2 * math.pi / 60)
    left = drive.torque(full, speed) - gear_friction(speed, motor, 0.01)
    assert float(left) == pytest.approx(0.0, abs=2e-3 * stall_n_m)


def test_an_ideal_gear_runs_up_to_where_the_back_emf_is_the_voltage() -> None:
    motor = Motor(gear_ratio=100.0, back_emf_v_s_rad=0.01, supply_voltage_v=6.0)
    drive = Drive.of(Servo(motor=motor))
    assert float(drive.torque(np.array(6.0), np.array(6.0))) == 0.0  # 6 V / (100 · 0.01 V·s/rad)
    assert drive.input_limit == 6.0


def test_the_current_limit_cuts_the_torque_on_both_sides() -> None:
    motor = Motor(current_limit_a=0.5)
    drive, speeds = Drive.of(Servo(motor=motor)), np.linspace(-20.0, 20.0, 81)
    torque = drive.torque(np.full(81, 12.0), speeds)
    limit = motor.gear_efficiency * motor.gear_ratio * motor.torque_constant_n_m_a * 0.5
    assert torque.max() == pytest.approx(limit, rel=1e-15)
    assert torque.min() == pytest.approx(-limit, rel=1e-15)
    # between the limits the current is (V − N·K_e·ω)/R
    speed = 5.5  # 12 V − 10.2 V of back-EMF leave 0.23 A
    current = (12.0 - motor.gear_ratio * motor.back_emf_v_s_rad * speed) / motor.resistance_ohm
    assert float(drive.torque(np.array(12.0), np.array(speed))) == pytest.approx(
        limit * current / 0.5, rel=1e-14
    )
    assert motor.stall_torque_n_m == pytest.approx(limit, rel=1e-15)


def test_electrical_power_is_heat_and_mechanical_power_where_the_gear_loses_none() -> None:
    motor = Motor(gear_efficiency=1.0)
    speed, voltage = np.linspace(-6.0, 6.0, 13), np.linspace(-11.0, 12.0, 13)
    current = (voltage - motor.volts_per_speed * speed) / motor.resistance_ohm
    inside = np.abs(current) < motor.current_limit_a
    assert inside.sum() > 5
    mechanical = Drive.of(Servo(motor=motor)).torque(voltage, speed) * speed
    electrical = voltage * current - motor.resistance_ohm * current**2
    np.testing.assert_allclose(mechanical[inside], electrical[inside], rtol=0, atol=1e-13)


def test_gear_friction_opposes_the_motion() -> None:
    motor = Motor(gear_friction_n_m=0.05, gear_damping_n_m_s_rad=0.01)
    torque = gear_friction(np.array([-4.0, 0.0, 4.0]), motor, 0.1)
    np.testing.assert_allclose(torque, [-0.09, 0.0, 0.09], atol=1e-15)


# --- the firmware ----------------------------------------------------------------------------


def test_a_set_speed_is_fed_forward_and_corrected_by_p_and_i() -> None:
    gains = {"speed_gain_v_s_rad": 0.5, "speed_integral_gain_v_rad": 40.0}
    motor = Motor(**PLAIN, **gains, feedforward_share=0.9)
    firmware, still, goal = told(Firmware(motor)), np.zeros((1, 2)), np.array([[2.0, -1.0]])
    for loop in range(1, 4):
        voltage = firmware.speed_voltage(still, goal)
        expected = (0.9 * motor.volts_per_speed + 0.5 + 40.0 * loop * motor.loop_period_s) * goal
        np.testing.assert_allclose(voltage, expected, rtol=1e-14)


def test_the_encoder_counts_and_the_window_divides() -> None:
    """A speed is a whole number of counts in a window: one is 2π/(counts · window)."""
    gains = {"speed_gain_v_s_rad": 1.0, "speed_integral_gain_v_rad": 0.0, "feedforward_share": 0.0}
    motor = Motor(**{**PLAIN, "encoder_counts_per_turn": 200}, **gains)
    firmware, still = told(Firmware(motor)), np.zeros((1, 2))
    count = 2 * math.pi / 200
    one = count / motor.encoder_window_s
    angles = np.array([[0.49, -0.51], [0.51, -1.49], [1.49, -1.51]]) * count
    measured = [-firmware.speed_voltage(angle[None], still)[0] for angle in angles]
    np.testing.assert_allclose(measured, one * np.array([[0, -1], [1, -1], [1, -2]]), rtol=1e-14)
    for _ in range(round(motor.encoder_window_s / motor.loop_period_s)):
        last = firmware.speed_voltage(angles[2][None], still)
    np.testing.assert_array_equal(last, still)  # a window later it stands


def test_a_firmware_that_starts_in_motion_measures_that_motion() -> None:
    motor = Motor(**PLAIN)
    firmware = told(Firmware(motor), angle=1.0, speed=3.0)
    voltage = firmware.speed_voltage(np.full((1, 2), 1.0), np.full((1, 2), 3.0))
    np.testing.assert_allclose(voltage, 3.0 * motor.volts_per_speed, rtol=1e-14)


@pytest.mark.parametrize("loops", [0, 1, 7])
def test_a_command_arrives_after_its_delay(loops: int) -> None:
    motor = Motor(**{**PLAIN, "command_delay_s": loops * 0.001}, **OPEN_LOOP)
    firmware, still = told(Firmware(motor)), np.zeros((1, 2))
    voltages = [firmware.speed_voltage(still, np.full((1, 2), 2.0))[0, 0] for _ in range(9)]
    expected = [0.0] * loops + [2.0 * motor.volts_per_speed] * (9 - loops)
    np.testing.assert_allclose(voltages, expected, rtol=1e-14)


def test_pulse_widths_come_in_steps_and_small_voltages_not_at_all() -> None:
    motor = Motor(**{**PLAIN, "pwm_steps": 12, "dead_band_v": 2.5}, **OPEN_LOOP)
    firmware, still = told(Firmware(motor)), np.zeros((1, 2))

    def driven(wish_v: float) -> float:
        goal = np.array([[wish_v, -wish_v]]) / motor.volts_per_speed
        right, left = firmware.speed_voltage(still, goal)[0]
        assert left == -right
        return float(right)

    assert [driven(v) for v in (2.4, 2.6, 3.4, 3.6, 99.0)] == [0.0, 3.0, 3.0, 4.0, 12.0]


def test_the_integral_does_not_wind_up_against_the_supply() -> None:
    motor = Motor(**PLAIN)
    firmware, still = told(Firmware(motor)), np.zeros((1, 2))
    for _ in range(1000):  # as if held fast for a second
        assert firmware.speed_voltage(still, np.full((1, 2), 6.0))[0, 0] <= 12.0
    # by then P, I and what is fed forward fill the supply; without the stop I alone had 240 V
    assert firmware.speed_voltage(still, np.full((1, 2), -6.0))[0, 0] < -9.0


def test_a_wanted_torque_becomes_the_voltage_that_gives_it() -> None:
    motor = Motor(**PLAIN)
    firmware, wanted = told(Firmware(motor), speed=2.0), np.array([[0.3, -0.4]])
    voltage = firmware.torque_voltage(np.zeros((1, 2)), wanted)
    given = Drive.of(Servo(motor=motor)).torque(voltage, np.full((1, 2), 2.0))
    np.testing.assert_allclose(given, wanted, rtol=1e-13)


# --- the plant -------------------------------------------------------------------------------


def test_a_step_of_voltage_spins_the_wheels_up_with_the_motors_time_constant() -> None:
    """J·ω̇ = g·(V − N·K_e·ω) − T_c − b·ω, with J that of wheel, rotor and half the robot."""
    robot = robot_with({**STEP_RAMP, "preset": "fast"}, **PLAIN, **OPEN_LOOP)
    motor, tractor, set_speed = motor_of(robot), robot.tractor, 20.0
    speeds = straight_speeds(robot, set_speed, 15)
    half = 0.5 * (tractor.mass_kg + robot.trailer.mass_kg) * tractor.wheel_radius_m**2
    inertia = half + wheel_inertia(robot)[0] + robot.servo.reflected_inertia_kg_m2
    gain = motor.torque_per_ampere / motor.resistance_ohm
    damping = gain * motor.volts_per_speed + motor.gear_damping_n_m_s_rad
    voltage = motor.volts_per_speed * set_speed
    final = (gain * voltage - motor.gear_friction_n_m) / damping
    time = 0.0005 * np.arange(1, len(speeds) + 1)
    expected = final * (1.0 - np.exp(-time * damping / inertia))
    assert inertia / damping == pytest.approx(0.154, rel=0.01)  # the run lasts 3.2 of them
    # tyres creep, and the balls' spin adds a thousandth of inertia
    np.testing.assert_allclose(speeds, expected, rtol=0, atol=2e-3 * final)


def test_the_speed_loop_removes_what_friction_takes() -> None:
    robot = robot_with({}, **PLAIN)
    open_loop, closed = robot_with({}, **PLAIN, **OPEN_LOOP), straight_speeds(robot, 3.0, 30)
    motor = motor_of(robot)
    damping = motor.torque_per_ampere * motor.volts_per_speed / motor.resistance_ohm
    droop = (motor.gear_friction_n_m + motor.gear_damping_n_m_s_rad * 3.0) / (
        damping + motor.gear_damping_n_m_s_rad
    )
    assert 3.0 - straight_speeds(open_loop, 3.0, 30)[-1] == pytest.approx(droop, rel=2e-3)
    assert abs(closed[-1] - 3.0) < 1e-3 * droop


def test_dry_gear_friction_holds_the_robot_against_a_small_voltage() -> None:
    small = 0.9 * 0.05 / (1.113 / 8.0) / 1.849  # set speed whose torque is nine tenths of it
    robot = robot_with({}, **PLAIN, **OPEN_LOOP, gear_friction_n_m=0.05)
    # MuJoCo's friction is a stiff creep
    assert abs(straight_speeds(robot, small, 10)[-1]) < 1e-3
    assert straight_speeds(robot, 1.3 * small, 10)[-1] > 0.03


def test_a_batch_of_motors_is_its_single_runs() -> None:
    robot, rng = robot_with({}), np.random.default_rng(3)
    commands = rng.uniform(-5, 5, (8, 3, 2))
    plant = ContactPlant(robot, ContactOptions(), nsim=3)
    plant.reset(RobotState.at_rest(0.0, 0.0, 0.3, 0.1, nsim=3))
    for command in commands:
        plant.advance(command, PERIOD)
    for i in range(3):
        alone = ContactPlant(robot, ContactOptions())
        alone.reset(RobotState.at_rest(0.0, 0.0, 0.3, 0.1))
        for command in commands:
            alone.advance(command[i : i + 1], PERIOD)
        assert np.array_equal(alone.joint_positions()[0], plant.joint_positions()[i])


def test_swapping_the_wheels_mirrors_the_motion_exactly() -> None:
    robot, mirror = robot_with({}), [1, -1, -1, -1]
    # the wheel declared first is the left one: the same numbers reach it
    track, spacing = -robot.tractor.track_width_m, -robot.casters.trailer_half_spacing_m
    tractor = robot.tractor.model_copy(update={"track_width_m": track})
    casters = robot.casters.model_copy(update={"trailer_half_spacing_m": spacing})
    swapped = robot.model_copy(update={"tractor": tractor, "casters": casters})
    start = RobotState.at_rest(0.1, 0.2, 0.3, 0.1)
    ends = []
    for built, q in ((robot, start.q), (swapped, start.q * mirror)):
        plant = ContactPlant(built, ContactOptions())
        plant.reset(RobotState(q=q, q_rate=start.q_rate))
        for _ in range(10):
            plant.advance(np.array([[3.0, -1.0]]), PERIOD)
        ends.append(plant.state().q)
    assert ends[0][0, 2] > 0.4
    np.testing.assert_array_equal(ends[1], ends[0] * mirror)


# --- in a scenario ---------------------------------------------------------------------------


def test_only_contact_physics_counts_in_the_firmware_s_loops() -> None:
    """The analytic plant's wheels obey, whatever the motor."""
    sets = ["robot.servo.motor={loop_period_s = 0.0007}", "plant.kind=analytic"]
    assert load_scenario("lab_circle", sets).robot.servo.motor is not None


def test_another_motor_can_be_believed() -> None:
    sets = ["robot.servo.motor={}", "belief.robot.servo.motor.resistance_ohm=9.0"]
    scenario = load_scenario("inverted_trailer", sets)
    true, believed = motor_of(scenario.robot), motor_of(scenario.believed_robot)
    assert true.preset == "fast"
    assert believed == true.model_copy(update={"resistance_ohm": 9.0})
