"""Steps of the extended model: one stretch of time made, and known commands cut into stretches.

Classical Runge-Kutta over stretches that end where a setpoint arrives. Dry friction acts as an
impulse before and after each step, and a hitch that it stops is held: second order in the step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.dynamics.extended import ExtendedModel
from ttwmr_mj.dynamics.integrate import runge_kutta
from ttwmr_mj.dynamics.kinematics import rolling_wheels, workspace_rate
from ttwmr_mj.dynamics.servo import Stretches, cut, limit_speed
from ttwmr_mj.robot import Servo
from ttwmr_mj.state import THETA1, THETA2, FloatArray, RobotState


def step(model: ExtendedModel, state: FloatArray, stretch: Stretches) -> FloatArray:
    """The state (5, nsim) after one Runge-Kutta step over a stretch of each simulation."""
    duration_s, start, rate, lead_s = stretch
    change = duration_s[:, None] * rate

    def slope(share: float, now: FloatArray) -> FloatArray:
        return model.rate(now, start + share * change, rate, lead_s)

    if not model.dry:
        return runge_kutta(slope, state, duration_s)
    before, state = state, state.copy()
    turn = model.twist(start)[1]
    state[-1] = model.rub(state[-1], turn, 0.5 * duration_s)
    held = state[-1] == turn
    state = runge_kutta(slope, state, duration_s)
    turn = model.twist(start + change)[1]
    # a hitch that was held needed none of its friction before the step
    state[-1] = model.rub(state[-1], turn, np.where(held, 1.0, 0.5) * duration_s)
    held &= state[-1] == turn
    rigid = state[THETA1] + before[THETA2] - before[THETA1]
    state[THETA2] = np.where(held, rigid, state[THETA2])
    return state


def cut_all(
    setpoint_rad_s: FloatArray,
    command_rad_s: FloatArray,
    servo: Servo,
    period_s: float,
    longest_s: float,
    physics_step_s: float,
) -> tuple[Stretches, NDArray[np.intp]]:
    """Commands that are held for a period each, as stretches.

    Args:
        setpoint_rad_s: (nsim, 2) at the start.
        command_rad_s: (periods, 2) one after the other.
        servo: its limits apply.
        period_s: of every one.
        longest_s: of a stretch.
        physics_step_s: as of `servo.cut`.

    Returns:
        All stretches, and how many of them have passed at the end of each period (periods,).
    """
    nsim, goal = len(setpoint_rad_s), limit_speed(command_rad_s, servo)
    start = np.empty((len(goal), nsim, 2))
    now, reach = setpoint_rad_s, servo.acceleration_limit_rad_s2 * period_s
    for k, wish in enumerate(goal):
        start[k] = now
        now = now + np.clip(wish - now, -reach, reach)
    # every period is a simulation of its own
    each = np.repeat(goal, nsim, axis=0)
    parts = cut(start.reshape(-1, 2), each, servo, period_s, longest_s, physics_step_s)
    split = (
        part.reshape(len(part), len(goal), nsim, *part.shape[2:]).swapaxes(0, 1) for part in parts
    )
    periods = Stretches(*split)
    used = np.asarray(periods.duration_s.any(axis=2))
    return periods.where(used), np.cumsum(used.sum(axis=1))


def rolling_setpoint(model: ExtendedModel, initial: RobotState) -> FloatArray:
    """(nsim, 2) setpoints that drive as the initial state moves, with the model's parameters."""
    twist = workspace_rate(initial.q, initial.q_rate)[:, :2]
    return rolling_wheels(twist, model.values["wheel_radius_m"], model.values["track_width_m"])
