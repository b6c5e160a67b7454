"""Steps of the extended model: known commands cut into stretches of time, and one stretch made.

Classical Runge-Kutta over stretches that end where a setpoint arrives. Dry friction acts as an
impulse before and after each step, and a hitch that it stops is held: second order in the step.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.dynamics.extended import ExtendedModel
from ttwmr_mj.dynamics.servo import limit_speed
from ttwmr_mj.robot import Servo
from ttwmr_mj.state import FloatArray, RobotState


class Stretch(NamedTuple):
    """Robots in one stretch of time each, in which no setpoint changes its rate.

    Cut from many periods, the arrays have one more leading axis for the successive stretches.
    """

    duration_s: FloatArray  # (nsim,); nothing changes in zero
    setpoint_rad_s: FloatArray  # (nsim, 2) at the start
    change_rad_s: FloatArray  # (nsim, 2) until the end
    lead_s: FloatArray  # (nsim, 2) how far the wheels are ahead of their setpoints

    @property
    def rate_rad_s2(self) -> FloatArray:
        """(nsim, 2) rates of the setpoints."""
        duration = self.duration_s[..., None]
        return np.asarray(self.change_rad_s / np.where(duration > 0.0, duration, np.inf))


class Clock(NamedTuple):
    """How time is cut: steps in which a command is held, and the longest step of Runge-Kutta."""

    time_step_s: float
    max_integration_step_s: float


def cut(
    setpoint_rad_s: FloatArray,
    command_rad_s: FloatArray,
    duration_s: float,
    clock: Clock,
    servo: Servo,
) -> tuple[Stretch, NDArray[np.intp]]:
    """Commands that are held for a while each, as stretches.

    Args:
        setpoint_rad_s: (nsim, 2) at the start.
        command_rad_s: (periods, nsim or 1, 2) one after the other.
        duration_s: of every one.
        clock: where else to cut.
        servo: its limits apply.

    Returns:
        All stretches, and how many of them have passed at the end of each period (periods,).
    """
    limit, step, goal = (
        servo.acceleration_limit_rad_s2,
        clock.time_step_s,
        limit_speed(command_rad_s, servo),
    )
    start = np.empty((len(goal), *setpoint_rad_s.shape))
    now = setpoint_rad_s
    for k, wish in enumerate(goal):
        start[k] = now
        now = now + np.clip(wish - now, -limit * duration_s, limit * duration_s)
    change = goal - start
    arrival = np.minimum(np.abs(change) / limit, duration_s)
    last = step * np.floor(arrival / step * (1.0 + 1e-12))  # the step it arrives in begins
    count = max(1, math.ceil(duration_s / clock.max_integration_step_s - 1e-9))
    grid = duration_s / count * np.arange(count + 1, dtype=np.float64)
    grid = np.broadcast_to(grid[:, None], (len(goal), count + 1, len(now)))
    edges = np.concatenate([grid, arrival.swapaxes(1, 2), last.swapaxes(1, 2)], axis=1)
    edges.sort(axis=1)
    begin, end = edges[:, :-1], edges[:, 1:]
    used = (end > begin).any(axis=2)
    first, then = (
        start[:, None] + np.clip(change[:, None], -limit * t[..., None], limit * t[..., None])
        for t in (begin, end)
    )
    # a ramp leads by half a step, what is left of it by half of that
    lead = 0.5 * np.where(begin[..., None] < last[:, None], step, (arrival - last)[:, None])
    stretches = Stretch((end - begin)[used], first[used], (then - first)[used], lead[used])
    return stretches, np.cumsum(used.sum(axis=1))


def step(
    model: ExtendedModel, q: FloatArray, swing_rate: FloatArray, stretch: Stretch
) -> tuple[FloatArray, FloatArray]:
    """The q (nsim, 4) and swing rate (nsim,) after one Runge-Kutta step over a stretch each."""
    start, change, rate = stretch.setpoint_rad_s, stretch.change_rad_s, stretch.rate_rad_s2
    step_s = stretch.duration_s
    turn = model.twist(start)[1]
    before, swing = q, _rub(model, swing_rate, turn, 0.5 * step_s)
    held = _dry(model) & (swing == turn)
    slopes = [rates(model, q, swing, start, rate, stretch.lead_s)]
    for part in (0.5, 0.5, 1.0):
        q_rate, acceleration = slopes[-1]
        now = q + part * step_s[:, None] * q_rate, swing + part * step_s * acceleration
        slopes.append(rates(model, *now, start + part * change, rate, stretch.lead_s))
    for weight, (q_rate, acceleration) in zip((1.0, 2.0, 2.0, 1.0), slopes, strict=True):
        q = q + weight / 6.0 * step_s[:, None] * q_rate
        swing = swing + weight / 6.0 * step_s * acceleration
    turn = model.twist(start + change)[1]
    # a hitch that was held needed none of its friction before the step
    swing = _rub(model, swing, turn, np.where(held, 1.0, 0.5) * step_s)
    held &= swing == turn
    q[:, 3] = np.where(held, q[:, 2] + before[:, 3] - before[:, 2], q[:, 3])
    return q, swing


def rates(
    model: ExtendedModel,
    q: FloatArray,
    swing_rate: FloatArray,
    wheels: FloatArray,
    wheels_rate: FloatArray,
    lead_s: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Rates of q (nsim, 4) and of the swing rate (nsim,)."""
    motion = model.motion(wheels, wheels_rate, q[:, 3] - q[:, 2], swing_rate, lead_s)
    cos, sin = np.cos(q[:, 2]), np.sin(q[:, 2])
    forward, left = motion.forward_m_s, motion.left_m_s
    x_rate, y_rate = cos * forward - sin * left, sin * forward + cos * left
    theta2_rate = swing_rate + motion.kick_rad_s
    q_rate = np.stack([x_rate, y_rate, motion.turn_rad_s, theta2_rate], axis=-1)
    return q_rate, motion.swing_rad_s2


def _dry(model: ExtendedModel) -> bool:
    return bool(np.any(np.asarray(model.values["hitch_coulomb_friction_n_m"]) > 0.0))


def _rub(
    model: ExtendedModel, swing_rate: FloatArray, turn: FloatArray, time_s: FloatArray
) -> FloatArray:
    """The swing rate after the dry friction of a while: nearer to θ̇1, never beyond."""
    if not _dry(model):
        return swing_rate
    friction = model.values["hitch_coulomb_friction_n_m"] / model.swing_inertia_kg_m2
    rate = swing_rate - turn
    left = np.maximum(np.abs(rate) - friction * time_s, 0.0)
    return np.asarray(np.where(left > 0.0, turn + np.copysign(left, rate), turn))


def rolling_setpoint(model: ExtendedModel, initial: RobotState) -> FloatArray:
    """(nsim, 2) setpoints that drive as the initial state moves, with the model's parameters."""
    heading = initial.q[:, 2]
    forward = initial.q_rate[:, 0] * np.cos(heading) + initial.q_rate[:, 1] * np.sin(heading)
    radius = np.broadcast_to(model.values["wheel_radius_m"], heading.shape)
    turn = 0.5 * model.values["track_width_m"] * initial.q_rate[:, 2]
    return np.asarray(np.stack([forward + turn, forward - turn], axis=-1) / radius[:, None])
