"""Whether wheels go together with their commands, their servos and the robot that they carry."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ttwmr_mj.dynamics.kinematics import wheels_from_twist, workspace_rate
from ttwmr_mj.dynamics.servo import ramp
from ttwmr_mj.results.trajectory import Trajectory, wheel_names
from ttwmr_mj.robot import Servo
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.scenario.stored.continuity import told
from ttwmr_mj.state import BoolArray, FloatArray

# A servo turns a wheel no faster than it may, the ground no faster than it passes by; where a robot
# is thrown over, its chassis turns around its wheels, too.
FASTER, TUMBLING_RAD_S = 2.0, 20.0
# How far wheels on the ground may be from rolling, beside the slip that is told: a slope takes half
# of their speed at most, roughness 40 mm/s at times, 2 mm/s in half of the rows.
STEEP, ROUGH_M_S = 0.5, 0.01


def wrong_wheels(rows: Trajectory, scenario: Scenario, tolerance: float) -> Iterator[str]:
    """Where wheel speeds cannot be, in words: column, time, what it is and what is expected.

    Args:
        rows: (n, 1) that were reached, finite.
        scenario: that they are of.
        tolerance: of speeds that are the same [rad/s, and of their own size].
    """
    robot, control, time_s = scenario.robot, scenario.control, rows.time_s
    command, speed = rows.wheel_command_rad_s[:, 0], rows.wheel_speed_rad_s[:, 0]
    names, limit = wheel_names("rad_s"), np.full_like(speed, robot.servo.speed_limit_rad_s)
    twist = workspace_rate(rows.q[:, 0], rows.q_rate[:, 0])[:, :2]
    rolling = wheels_from_twist(twist, robot)
    if not control.torque_input:  # there speeds are but logged, and torques spin wheels at will
        untold = (np.abs(command) > (1.0 + tolerance) * limit) & ~rows.saturated
        if asked := told(wheel_names("cmd_rad_s"), time_s, command, limit, untold):
            yield f"{asked} is its servo's limit, though its column saturated is 0"
        fastest = _no_load_rad_s(robot.servo) + np.abs(rolling).max(initial=0.0)
        most = np.full_like(speed, FASTER * fastest + TUMBLING_RAD_S)
        if turned := told(names, time_s, speed, most, np.abs(speed) > most):
            yield f"{turned} is more than its servo and its motion allow"
    if rolled := told(names, time_s, speed, rolling, _strayed(rows, rolling, scenario, tolerance)):
        yield f"{rolled} where its wheel rolls as its body moves"
    late = control.command_latency_s or control.command_jitter_s or control.command_drop_probability
    if scenario.plant.kind == "analytic" and not (control.torque_input or late):
        led = speed.copy()
        period_s = np.array([control.sampling_time_s])
        led[1:] = ramp(speed[:-1], command[:-1], robot.servo, period_s)[:, 0]
        if obeyed := told(names, time_s, speed, led, _differ(speed, led, tolerance)):
            yield f"{obeyed} by its servo's commands"


def _strayed(
    rows: Trajectory, rolling: FloatArray, scenario: Scenario, tolerance: float
) -> BoolArray:
    """(n, 2) whose speed is not that of rolling, nor of sliding as it is told."""
    speed = rows.wheel_speed_rad_s[:, 0]
    if scenario.plant.kind == "analytic":
        # the extended model's wheels have another radius
        rolls = scenario.plant.analytic.extended is None
        return _differ(speed, rolling, tolerance) & rolls
    standing, slip_m_s = rows.wheels_on_floor == speed.shape[1], rows.wheel_slip_m_s
    radius_m = scenario.robot.tractor.wheel_radius_m
    most_m_s = slip_m_s.max(initial=0.0) + ROUGH_M_S + STEEP * radius_m * np.abs(speed)
    off = standing & (radius_m * np.abs(speed - rolling) > most_m_s)
    return np.asarray(off & (2 * off.any(axis=1).sum() > len(off)))


def _differ(one: FloatArray, other: FloatArray, tolerance: float) -> BoolArray:
    return np.asarray(np.abs(one - other) > tolerance * (1.0 + np.abs(other)))


def _no_load_rad_s(servo: Servo) -> float:
    """What it reaches without load: a motor that winds up may exceed the servo's limit."""
    motor, limit = servo.motor, servo.speed_limit_rad_s
    return max(limit, motor.supply_voltage_v / motor.volts_per_speed) if motor else limit
