"""The hybrid model (Eq. 24-29) as a plant: wheels obey their servo exactly, the trailers swing.

The tractor never slips. Between the kinks of its wheel speeds the heading is an exact quadratic, P
an integral of known functions (three-point Gauss), and only the hitches' angles are a differential
equation (`plants.swing` of one trailer, `plants.train_swing` of several).
"""

import numpy as np

from ttwmr_mj.config import rows_of
from ttwmr_mj.dynamics.floor.ground import LEVEL, Ground
from ttwmr_mj.dynamics.kinematics import (
    q_rate,
    rolling,
    twist_from_wheels,
    wheel_geometry,
    wheels_from_twist,
    workspace_rate,
)
from ttwmr_mj.dynamics.servo import Stretches
from ttwmr_mj.errors import InputError, at_most
from ttwmr_mj.plants.base import ModelPlant
from ttwmr_mj.plants.swing import Forcing, HitchSwing
from ttwmr_mj.plants.train_swing import TrainSwing
from ttwmr_mj.robot import Hitch, RobotParameters
from ttwmr_mj.state import BoolArray, FloatArray, RobotState, hitch_angles

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)
# On [0, 1], shaped to broadcast over (node, interval, simulation).
GAUSS_NODES = (0.5 + 0.5 * _NODES)[:, None, None]
GAUSS_WEIGHTS = (0.5 * _WEIGHTS)[:, None, None]


class AnalyticPlant(ModelPlant):
    """A batch of robots that follow the hybrid model, each under its own command.

    A simulation's numbers do not depend on the batch it runs in, and mirrored commands give
    exactly mirrored motion. The step's error is of fourth order, of second at every stick or slip
    of a dry hitch.

    The hitch angles φ are the stored coordinates: θ2 = θ1 + φ, so a locked hitch turns rigidly.
    """

    def __init__(
        self,
        robot: RobotParameters,
        nsim: int,
        time_step_s: float,
        max_integration_step_s: float,
        *,
        ground: Ground = LEVEL,
        published_spring: bool = False,
    ) -> None:
        """Build the plant, at rest at the origin; the other arguments are those of its base.

        Robot and ground may be those of every simulation (`config.stacked`), of one trailer each.

        The ground pulls at the trailers where it slopes. A published spring has its torque and the
        damper's divided by k, as printed in Eq. 41, and not by J2 + m2·l².

        Raises:
            InputError: the integration would be unstable for these hitches, or Eq. 41 is asked for
                with several trailers.
        """
        self._robot = robot
        self._slope = ground if np.any(ground.slope_rad) else None
        self._swing = _swing(robot, ground, max_integration_step_s, published_spring)
        longest_s = self._swing.longest_step_s
        if max_integration_step_s > longest_s:
            hitches = rows_of(robot, nsim)[0].hitches
            stiffest = max(hitches, key=lambda h: (h.stiffness_n_m_rad, h.damping_n_m_s_rad))
            raise _unstable(max_integration_step_s, longest_s, stiffest)
        timing = time_step_s, max_integration_step_s
        super().__init__(robot.servo, nsim, *timing, trailers=len(robot.trailers))

    def reset(self, initial: RobotState) -> None:
        """Take over pose and motion; a sideways velocity of P is dropped (Eq. 3)."""
        self._x, self._y, self._theta1 = initial.q[:, :3].T.copy()
        rate = workspace_rate(initial.q, initial.q_rate)
        hitch_rate = np.diff(rate[:, 1:], axis=-1)
        self._hitch = np.stack([hitch_angles(initial.q).T, hitch_rate.T])
        self._setpoint = wheels_from_twist(rate[:, :2], self._robot)

    def state(self) -> RobotState:
        """The state now, as fresh arrays."""
        twist = twist_from_wheels(self._setpoint, self._robot)
        theta = self._theta1 + np.add.accumulate(self._hitch[0])
        rate = twist[:, 1] + np.add.accumulate(self._hitch[1])
        q = np.vstack([self._x, self._y, self._theta1, theta]).T.copy()
        return RobotState(q=q, q_rate=q_rate(q, np.column_stack([twist, rate.T])))

    def failed(self) -> BoolArray:
        """(nsim,) simulations with a state that is not finite."""
        sums = self._x + self._y + self._theta1 + self._hitch.sum(axis=(0, 1))
        return np.asarray(~np.isfinite(sums + self._setpoint.sum(axis=-1)))

    def follow(self, stretches: Stretches, end_rad_s: FloatArray) -> None:
        """See the base class."""
        duration, wheels = stretches.duration_s, wheel_geometry(self._robot)
        u1, u2 = rolling(stretches.speed_rad_s, *wheels)  # (stretch, nsim), linear in time
        u1_rate, u2_rate = rolling(stretches.rate_rad_s2, *wheels)
        # the tractor turns and P moves (Eq. 10)
        turns = duration * (u2 + 0.5 * u2_rate * duration)
        # accumulate, unlike sum, adds in the same order whatever the batch size.
        headings = np.add.accumulate(np.concatenate([self._theta1[None], turns]))
        time = GAUSS_NODES * duration
        theta1 = headings[:-1] + time * (u2 + 0.5 * u2_rate * time)
        travel = GAUSS_WEIGHTS * duration * (u1 + u1_rate * time)
        self._x = self._x + _total(travel * np.cos(theta1))
        self._y = self._y + _total(travel * np.sin(theta1))
        self._theta1 = headings[-1]
        # the trailers swing, stretch after stretch
        time = np.array([0.0, 0.5, 1.0])[:, None, None] * duration
        twist = np.stack([u1 + time * u1_rate, u2 + time * u2_rate])
        left = twist[0] * twist[1]
        ahead = u1_rate[None]
        if self._slope is not None:
            pull = self._slope.pull(headings[:-1] + time * (u2 + 0.5 * u2_rate * time))
            ahead, left = ahead - pull.ahead, left - pull.left
        left, ahead = left / self._swing.length_m, ahead / self._swing.length_m
        for k in range(len(duration)):
            twisted = twist[:, :, k] if self._swing.needs_twist else None
            forcing = Forcing(duration[k], ahead[:, k], left[:, k], -u2_rate[k], twisted)
            self._hitch = self._swing.step(self._hitch, forcing)
        self._setpoint = end_rad_s


def _swing(
    robot: RobotParameters, ground: Ground, step_s: float, published_spring: bool
) -> HitchSwing | TrainSwing:
    if len(robot.trailers) == 1:
        return HitchSwing(robot, ground, step_s, published_spring=published_spring)
    if published_spring:
        raise InputError.at(
            "plant.analytic.published_spring",
            "Eq. 41 is printed for one trailer",
            allowed="false for several",
        )
    return TrainSwing(robot, ground, step_s)


def _unstable(step_s: float, longest_s: float, hitch: Hitch) -> InputError:
    return InputError.at(
        "plant.analytic.max_step_s",
        "the hitch's spring and damper (robot.hitch.stiffness_n_m_rad = "
        f"{hitch.stiffness_n_m_rad:g}, robot.hitch.damping_n_m_s_rad = "
        f"{hitch.damping_n_m_s_rad:g}) are too stiff for it",
        got=f"{step_s:g}",
        allowed=at_most(longest_s),
        hint="lower it, or the spring's and damper's constants",
    )


def _total(parts: FloatArray) -> FloatArray:
    """Sum (nsim,) over nodes and intervals (node, interval, nsim), in a fixed order."""
    return np.asarray(np.add.accumulate(parts.reshape(-1, parts.shape[-1]))[-1])
