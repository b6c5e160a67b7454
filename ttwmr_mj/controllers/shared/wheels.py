"""From accelerations of P to wheel speeds: Eq. 27-28 and 8-9, made safe at standstill.

The article inverts v1 = u̇1·cos θ1 − u1·u2·sin θ1, v2 = u̇1·sin θ1 + u1·u2·cos θ1 (Eq. 27-28) for
(u̇1, u2), which divides by u1, and the robot starts at rest. Over one period T the same map reads:
the velocity P shall have at the period's end is w = u1·(cos θ1, sin θ1) + T·v; its length is the
next u1, and turning towards it takes u2 = Δ/T, with Δ the angle from the heading to w. As T → 0 it
is Eq. 27-28; at standstill it turns the robot on the spot, no faster than the servos can brake. The
robot never reverses: where w points backward it stops and turns.
"""

import numpy as np

from ttwmr_mj.config import column, each
from ttwmr_mj.controllers.base import Command
from ttwmr_mj.dynamics.kinematics import wheels_from_twist, workspace_rate
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA1, BoolArray, FloatArray, RobotState

NEAR_STANDSTILL_M_S = 0.01  # |u1| below which u2 = (v·n)/u1 would amplify by over 100 s/m
MIX = np.array([[1.0, 1.0], [1.0, -1.0]])  # (drive, spin) @ MIX = (right, left)
CUT_RAD_S = 1e-9  # a wish cut by less than this is rounding, not saturation


class AccelerationToWheels:
    """The map from (v1, v2) to wheel speeds, with u1, the commanded speed of P, as its state.

    The first sample takes u1 and the wheel speeds from the estimate: a robot may start in motion.
    What exceeds the servo's limits is clipped and flagged: turning has priority over driving, and
    u1 goes on from what was really commanded, so that nothing winds up.
    """

    def __init__(self, robot: RobotParameters, sampling_time_s: float, nsim: int) -> None:
        """Take a robot, or those of every simulation (`config.stacked`)."""
        self._radius = robot.tractor.wheel_radius_m
        self._half_track = robot.half_track_m
        self._limit = robot.servo.speed_limit_rad_s
        self._period = sampling_time_s
        self._reach = robot.servo.acceleration_limit_rad_s2 * sampling_time_s
        turn_acceleration = robot.servo.acceleration_limit_rad_s2 * self._radius / self._half_track
        self._braking = 2.0 * turn_acceleration
        self._wheels: FloatArray = np.zeros((nsim, 2))
        self._speed: FloatArray = np.zeros(nsim)
        self._robot = robot
        # inside, wheels turn as if they were equal
        self._equal = each(_equalising, robot)
        self._first = True

    def command(self, acceleration_m_s2: FloatArray, estimate: RobotState) -> Command:
        """Wheel speeds that give P the acceleration (nsim, 2), world frame, over one period."""
        if self._first:
            twist = workspace_rate(estimate.q, estimate.q_rate)[..., :2]
            self._speed = twist[:, 0]
            self._wheels = wheels_from_twist(twist, self._robot) / self._equal
            self._first = False
        heading = estimate.q[:, THETA1]
        cos, sin = np.cos(heading), np.sin(heading)
        east, north = acceleration_m_s2[:, 0], acceleration_m_s2[:, 1]
        # w in the tractor's frame: ahead and to the left
        ahead = self._speed + self._period * (cos * east + sin * north)
        left = self._period * (cos * north - sin * east)
        delta = np.arctan2(left, ahead)
        angle = np.abs(delta)
        # no faster than can be stopped where Δ ends; inactive for small ones
        rate = np.minimum(angle / self._period, np.sqrt(self._braking * angle))
        # drive by what of w will lie ahead at the period's end: all of it, mostly
        forward = np.hypot(ahead, left) * np.maximum(np.cos(angle - rate * self._period), 0.0)
        wish = np.empty_like(self._wheels)
        wish[:, 0] = forward / self._radius
        wish[:, 1] = np.copysign(rate, delta) * (self._half_track / self._radius)
        wheels = self._within_limits(wish)
        near_singular = np.minimum(self._speed, ahead) < NEAR_STANDSTILL_M_S
        saturated = np.abs(wheels - wish @ MIX).max(axis=1) > CUT_RAD_S
        self._wheels = wheels
        self._speed = (0.5 * self._radius) * (wheels[:, 0] + wheels[:, 1])  # Eq. 8
        wheels = wheels * self._equal
        return Command(wheels, saturated=saturated, near_singular=np.asarray(near_singular))

    def follow(self, who: BoolArray, wheels: FloatArray) -> None:
        """Go on from other wheel speeds (nsim, 2) where they (nsim,) were commanded instead."""
        wheels = np.where(who[:, None], wheels / self._equal, self._wheels)
        self._wheels = wheels
        self._speed = (0.5 * self._radius) * (wheels[:, 0] + wheels[:, 1])  # Eq. 8

    def _within_limits(self, wish: FloatArray) -> FloatArray:
        """(nsim, 2) wheel speeds for a wish (drive, spin), cut to the servo's range and reach."""
        allowed = np.empty_like(wish)
        allowed[:, 1] = np.minimum(np.maximum(wish[:, 1], -self._limit), self._limit)
        allowed[:, 0] = np.minimum(wish[:, 0], self._limit - np.abs(allowed[:, 1]))
        reach = column(self._reach)
        low, high = self._wheels - reach, self._wheels + reach
        return np.asarray(np.minimum(np.maximum(allowed @ MIX, low), high))


def _equalising(robot: RobotParameters) -> FloatArray:
    """(2,) what wheels (right, left) turn for each turn of a wheel of mean radius."""
    return robot.tractor.wheel_radius_m / np.array(robot.tractor.wheel_radii_m)
