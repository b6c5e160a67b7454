"""A servo's motor: what a voltage does to its wheel, and the firmware that chooses the voltage.

At the wheel, with the gear's ratio N and efficiency η,

    torque = η·N·K_t·i − friction,    i = (V − N·K_e·ω)/R, held within the current limit.

That is linear in V and ω with a limit, which is what MuJoCo's actuators are (`Drive`). The firmware
works in the time of its own loop (`Firmware`): it counts the encoder, and sets

    V = N·K_e·(feedforward·ω_set) + P·(ω_set − ω) + I·∫(ω_set − ω),

or, where a torque is wanted, the voltage that gives it, V = R·torque/(η·N·K_t) + N·K_e·ω; both
within the supply, in steps of the pulse width, and none within the dead band. η is that of a
driving gear, at all times: a motor that brakes would brake somewhat better.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from ttwmr_mj.robot import Servo
from ttwmr_mj.robot.motor import Motor
from ttwmr_mj.state import FloatArray


class Drive(NamedTuple):
    """Torque on a wheel = gain·(input − back·ω), within limits.

    The input is the set speed of an ideal servo [rad/s], a voltage [V] or a torque [N·m].
    """

    gain: float  # N·m per unit of input
    back: float  # units of input per rad/s of the wheel
    limit_n_m: float
    input_limit: float

    @classmethod
    def of(cls, servo: Servo, *, torque_input: bool = False) -> Drive:
        """What drives a wheel; a torque input is a voltage where there is a motor."""
        if (motor := servo.motor) is not None:
            per_ampere = motor.torque_per_ampere
            gain, limit = per_ampere / motor.resistance_ohm, per_ampere * motor.current_limit_a
            return cls(gain, motor.volts_per_speed, limit, motor.supply_voltage_v)
        stall = servo.stall_torque_n_m
        if torque_input:
            return cls(1.0, 0.0, stall, stall)
        return cls(servo.velocity_gain_n_m_s_rad, 1.0, stall, servo.speed_limit_rad_s)

    def torque(self, given: FloatArray, speed_rad_s: FloatArray) -> FloatArray:
        """Torque [N·m] under an input at a speed, elementwise; gear friction not taken off."""
        torque = self.gain * (given - self.back * speed_rad_s)
        return np.asarray(np.clip(torque, -self.limit_n_m, self.limit_n_m))


class Firmware:
    """The firmware of both servos, for a batch; called once in a loop period.

    Attributes:
        period_s: of its loop.
    """

    def __init__(self, motor: Motor) -> None:
        self._motor = motor
        self.period_s = motor.loop_period_s
        self._window = round(motor.encoder_window_s / motor.loop_period_s)
        self._delay = round(motor.command_delay_s / motor.loop_period_s)

    def reset(self, angle_rad: FloatArray, speed_rad_s: FloatArray, given: FloatArray) -> None:
        """Start with wheels (nsim, 2) at angles, as if they had long run at these speeds.

        Args:
            angle_rad: of the wheels.
            speed_rad_s: of the wheels.
            given: what has long been asked for, a set speed [rad/s] or a torque [N·m].
        """
        before = np.arange(self._window, 0, -1)[:, None, None] * self._motor.loop_period_s
        angles = angle_rad - before * speed_rad_s
        self._counts = deque(self.counted(angles), maxlen=self._window)
        self._waiting = deque([given] * self._delay)
        self._integral: FloatArray = np.zeros_like(angle_rad)

    def speed_voltage(self, angle_rad: FloatArray, set_speed_rad_s: FloatArray) -> FloatArray:
        """Voltages (nsim, 2) for the coming loop period, by the speed loop.

        Args:
            angle_rad: (nsim, 2) of the wheels now.
            set_speed_rad_s: (nsim, 2), which the delay holds back.
        """
        motor, wanted = self._motor, self._delayed(set_speed_rad_s)
        error = wanted - self._measured(angle_rad)
        integral = self._integral + motor.loop_period_s * error
        ahead = motor.feedforward_share * motor.volts_per_speed * wanted
        ahead = ahead + motor.speed_gain_v_s_rad * error
        wish = ahead + motor.speed_integral_gain_v_rad * integral
        # no integral further into the stops
        stuck = (np.abs(wish) > motor.supply_voltage_v) & (wish * error > 0.0)
        self._integral = np.where(stuck, self._integral, integral)
        return self._driven(ahead + motor.speed_integral_gain_v_rad * self._integral)

    def torque_voltage(self, angle_rad: FloatArray, torque_n_m: FloatArray) -> FloatArray:
        """Voltages (nsim, 2) that give torques (nsim, 2), gear friction not taken off."""
        motor, wanted = self._motor, self._delayed(torque_n_m)
        current = wanted / motor.torque_per_ampere
        back = motor.volts_per_speed * self._measured(angle_rad)
        return self._driven(motor.resistance_ohm * current + back)

    def counted(self, angle_rad: FloatArray) -> FloatArray:
        """Angles [rad] in whole counts, to the nearest: forward is as backward."""
        counts = self._motor.encoder_counts_per_turn
        if not counts:
            return angle_rad
        return np.asarray(np.rint(angle_rad * (counts / (2.0 * np.pi))) * (2.0 * np.pi / counts))

    def _delayed(self, given: FloatArray) -> FloatArray:
        self._waiting.append(given)
        return self._waiting.popleft()

    def _measured(self, angle_rad: FloatArray) -> FloatArray:
        """Mean speed over the window that ends now, as the encoder has it."""
        now = self.counted(angle_rad)
        moved = now - self._counts[0]
        self._counts.append(now)  # the oldest falls out
        return np.asarray(moved / self._motor.encoder_window_s)

    def _driven(self, wish_v: FloatArray) -> FloatArray:
        """What the drive makes of a wanted voltage."""
        motor = self._motor
        voltage = np.clip(wish_v, -motor.supply_voltage_v, motor.supply_voltage_v)
        if steps := motor.pwm_steps:
            step_v = motor.supply_voltage_v / steps
            voltage = np.rint(voltage / step_v) * step_v
        return np.where(np.abs(voltage) < motor.dead_band_v, 0.0, voltage)


def gear_friction(speed_rad_s: FloatArray, motor: Motor, fading_rad_s: float) -> FloatArray:
    """Torque [N·m] that the gear's friction takes at wheel speeds, any shape.

    The dry part fades below a speed, where its direction is uncertain.
    """
    dry = motor.gear_friction_n_m * np.tanh(speed_rad_s / fading_rad_s)
    return np.asarray(dry + motor.gear_damping_n_m_s_rad * speed_rad_s)
