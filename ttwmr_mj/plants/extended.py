"""The extended model as a plant: `dynamics.extended` integrated under wheel commands."""

from __future__ import annotations

import itertools
import math

import numpy as np

from ttwmr_mj.dynamics.extended import ExtendedModel
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.servo import limit_speed
from ttwmr_mj.state import BoolArray, FloatArray, RobotState


class ExtendedPlant:
    """A batch of robots that follow the extended model; each may have its own parameters.

    Classical Runge-Kutta with steps that end where a setpoint arrives. Dry friction acts as an
    impulse before and after each step, and a hitch that it stops is held: second order in the step.

    Attributes:
        nsim: simulations in the batch.
        time_step_s: the step in which commands are held.
    """

    def __init__(
        self, model: ExtendedModel, nsim: int, time_step_s: float, max_integration_step_s: float
    ) -> None:
        """Build the plant, at rest at the origin.

        Args:
            model: the equations and their parameters.
            nsim: simulations in the batch.
            time_step_s: duration of one step of `advance`. Each step is driven at the setpoint of
                its end, as MuJoCo does, so the wheels lead a ramp by half a step.
            max_integration_step_s: upper bound of the Runge-Kutta step.
        """
        self.nsim = nsim
        self.time_step_s = time_step_s
        self._model = model
        self._max_step_s = max_integration_step_s
        self._friction = model.values["hitch_coulomb_friction_n_m"] / model.swing_inertia_kg_m2
        self._dry = bool(np.any(np.asarray(self._friction) > 0.0))
        self.reset(RobotState.at_rest(0.0, 0.0, 0.0, 0.0, nsim))

    def reset(self, initial: RobotState) -> None:
        """Take over pose and motion; the setpoints are those that drive like that."""
        self._q, self._swing_rate = np.array(initial.q), np.array(initial.q_rate[:, 3])
        heading = initial.q[:, 2]
        forward = initial.q_rate[:, 0] * np.cos(heading) + initial.q_rate[:, 1] * np.sin(heading)
        values = self._model.values
        radius = np.broadcast_to(values["wheel_radius_m"], self.nsim)
        turn = 0.5 * values["track_width_m"] * initial.q_rate[:, 2]
        self._setpoint = np.stack([forward + turn, forward - turn], axis=-1) / radius[:, None]
        self._setpoint_rate = np.zeros((self.nsim, 2))
        self._lead_s: FloatArray = np.zeros((self.nsim, 2))

    def state(self) -> RobotState:
        """The state now, as fresh arrays."""
        rates = self._rates(self._q, self._swing_rate, self._setpoint, self._setpoint_rate)[0]
        return RobotState(q=self._q.copy(), q_rate=rates)

    def wheel_speed_rad_s(self) -> FloatArray:
        """(nsim, 2) setpoints of the wheels (right, left)."""
        return np.array(self._setpoint)

    def push(self, forces_n: dict[str, FloatArray]) -> None:
        """Refused as by the analytic plant.

        Raises:
            InputError: always, if there is a force.
        """
        if forces_n:
            raise InputError("plant.pushes: only plant.kind = 'contact' can be pushed")

    def joint_positions(self) -> FloatArray:
        """(nsim, 0): the model has no joints."""
        return np.empty((self.nsim, 0))

    def contact_readings(self) -> FloatArray:
        """(nsim, 0, 15): the model has no contacts."""
        return np.empty((self.nsim, 0, 15))

    def failed(self) -> BoolArray:
        """(nsim,) simulations with a state that is not finite."""
        return np.asarray(~np.isfinite(self._q.sum(axis=1) + self._swing_rate))

    def fault(self, index: int) -> str:
        """What broke in one failed simulation."""
        return f"the state is not finite: {self._q[index].tolist()}"

    def advance(self, wheel_command_rad_s: FloatArray, steps: int) -> None:
        """Hold commanded wheel speeds for a number of steps; the servo's limits apply."""
        servo, step = self._model.robot.servo, self.time_step_s
        duration = steps * step
        change = limit_speed(wheel_command_rad_s, servo) - self._setpoint
        arrival = np.minimum(np.abs(change) / servo.acceleration_limit_rad_s2, duration)
        last = step * np.floor(arrival / step * (1.0 + 1e-12))  # the step it arrives in begins
        count = max(1, math.ceil(duration / self._max_step_s - 1e-9))
        grid = duration / count * np.arange(count + 1, dtype=np.float64)
        edges = np.vstack([np.tile(grid[:, None], self.nsim), arrival.T, last.T])
        edges.sort(axis=0)
        for start, end in itertools.pairwise(edges):
            if not np.any(end > start):
                continue
            # a ramp leads by half a step, what is left of it by half of that
            lead = 0.5 * np.where(start[:, None] < last, step, arrival - last)
            self._step(wheel_command_rad_s, end - start, lead)

    def _step(self, command_rad_s: FloatArray, step_s: FloatArray, lead_s: FloatArray) -> None:
        """One Runge-Kutta step of (nsim,) durations, in which no setpoint changes its rate."""
        start, step = self._setpoint, step_s[:, None]
        servo = self._model.robot.servo
        reach = servo.acceleration_limit_rad_s2 * step
        target = limit_speed(command_rad_s, servo)
        change = np.minimum(np.maximum(target - start, -reach), reach)
        rate = change / np.where(step > 0.0, step, np.inf)
        self._lead_s = lead_s
        turn = self._model.twist(start)[1]
        q, swing = self._q, self._rub(self._swing_rate, turn, 0.5 * step_s)
        held = self._dry & (swing == turn)
        slopes = [self._rates(q, swing, start, rate)]
        for part in (0.5, 0.5, 1.0):
            q_rate, swing_rate = slopes[-1]
            now = q + part * step * q_rate, swing + part * step_s * swing_rate
            slopes.append(self._rates(*now, start + part * change, rate))
        for weight, (q_rate, swing_rate) in zip((1.0, 2.0, 2.0, 1.0), slopes, strict=True):
            q, swing = q + weight / 6.0 * step * q_rate, swing + weight / 6.0 * step_s * swing_rate
        turn = self._model.twist(start + change)[1]
        # a hitch that was held needed none of its friction before the step
        self._swing_rate = self._rub(swing, turn, np.where(held, 1.0, 0.5) * step_s)
        held &= self._swing_rate == turn
        q[:, 3] = np.where(held, q[:, 2] + self._q[:, 3] - self._q[:, 2], q[:, 3])
        self._q, self._setpoint, self._setpoint_rate = q, start + change, rate

    def _rates(
        self, q: FloatArray, swing_rate: FloatArray, wheels: FloatArray, wheels_rate: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Rates of q (nsim, 4) and of the swing rate (nsim,)."""
        motion = self._model.motion(
            wheels, wheels_rate, q[:, 3] - q[:, 2], swing_rate, self._lead_s
        )
        cos, sin = np.cos(q[:, 2]), np.sin(q[:, 2])
        forward, left = motion.forward_m_s, motion.left_m_s
        x_rate, y_rate = cos * forward - sin * left, sin * forward + cos * left
        theta2_rate = swing_rate + motion.kick_rad_s
        q_rate = np.stack([x_rate, y_rate, motion.turn_rad_s, theta2_rate], axis=-1)
        return q_rate, motion.swing_rad_s2

    def _rub(self, swing_rate: FloatArray, turn: FloatArray, time_s: FloatArray) -> FloatArray:
        """The swing rate after the dry friction of a while: nearer to θ̇1, never beyond."""
        if not self._dry:
            return swing_rate
        rate = swing_rate - turn
        left = np.maximum(np.abs(rate) - self._friction * time_s, 0.0)
        return np.asarray(np.where(left > 0.0, turn + np.copysign(left, rate), turn))
