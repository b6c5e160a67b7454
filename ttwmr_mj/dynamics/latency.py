"""How late measurements are, beyond what is told: from how the robot answers to commands.

A measurement that is d older than it says shows a motion that was commanded d earlier. For several
d the measured change of heading and of path between one measurement and the next is compared with
what the wheels were commanded to do meanwhile; the d whose squared differences are smallest, over
the last seconds, is taken. What stays the same for long (slip, a wheel radius that is off) is taken
off the differences first. A constant command answers nothing: then the latency stays as told. A
command that is late looks the same as a measurement that is: only the sum shows.
"""

import numpy as np

from ttwmr_mj.dynamics.kinematics import twist_from_wheels
from ttwmr_mj.dynamics.servo import limit_speed, ramp_and_angle
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA1, BoolArray, FloatArray, wrap

CANDIDATES = np.arange(-1.5, 3.75, 0.5)  # extra latencies, in periods
MEMORY_S = 8.0  # differences fade in this time
BIAS_S = 0.7  # and what is taken off them follows in this
SURE = 12.0  # by how much a latency must explain better than the one believed: odds of e^6
BEFORE = 5  # periods before the first command, in which the wheels turn as at the start
ROWS = 64  # periods of commands that are kept, about two seconds


class LatencyFinder:
    """Scores latencies, for a batch of robots. Call `measured` and `commanded` once per period.

    Attributes:
        extra_s: (nsim,) how much later measurements are than told, as far as is known.
        changed: (nsim,) whose last measurement overthrew what had been believed, by a
            quarter of a period or more.
    """

    def __init__(
        self, robot: RobotParameters, period_s: float, nsim: int, std: tuple[float, float]
    ) -> None:
        """Nothing is known: measurements are as late as told.

        Args:
            robot: what the wheels do is computed with it.
            period_s: T.
            nsim: robots.
            std: noise of a measured position [m] and angle [rad].
        """
        self._robot, self._period = robot, period_s
        self.extra_s: FloatArray = np.zeros(nsim)
        self.changed: BoolArray = np.zeros(nsim, dtype=np.bool_)
        self._any: BoolArray = np.zeros(nsim, dtype=np.bool_)  # measurements so far
        self._found: BoolArray = np.zeros(nsim, dtype=np.bool_)
        self._moved = np.zeros((ROWS, nsim, 2))  # path and heading commanded since the start
        self._k = BEFORE
        self._last_q: FloatArray = np.full((nsim, THETA1 + 1), np.nan)
        self._last_stamp = np.full(nsim, np.nan)
        self._bias = np.zeros((CANDIDATES.size, nsim, 2))
        self._score = np.zeros((CANDIDATES.size, nsim))
        self._variance = 2.0 * np.square(std)
        self._setpoint: FloatArray = np.zeros((nsim, 2))

    @property
    def periods(self) -> int:
        """Of commands that have been noted."""
        return self._k - BEFORE

    def roll(self, wheel_speed_rad_s: FloatArray) -> None:
        """Say that the wheels (nsim, 2) are turning already, and have been; for a start in motion.

        Without it they have stood.
        """
        self._setpoint = wheel_speed_rad_s
        step = self._period * twist_from_wheels(wheel_speed_rad_s, self._robot)
        self._moved[: BEFORE + 1] = np.arange(BEFORE + 1.0)[:, None, None] * step

    def commanded(self, wheel_speed_rad_s: FloatArray) -> None:
        """Take note of the command (nsim, 2) for the coming period."""
        servo = self._robot.servo
        change = limit_speed(wheel_speed_rad_s, servo) - self._setpoint
        moved, angle = ramp_and_angle(change, servo, self._period)
        step = twist_from_wheels(self._period * self._setpoint + angle, self._robot)
        self._setpoint = self._setpoint + moved
        self._moved[(self._k + 1) % ROWS] = self._moved[self._k % ROWS] + step
        self._k += 1

    def measured(self, stamp_s: FloatArray, q: FloatArray, due: BoolArray) -> None:
        """Compare a measurement with the last one.

        Args:
            stamp_s: (nsim,) its time, as told.
            q: (nsim, 3 or more) x, y, θ1, …
            due: (nsim,) who has measured.
        """
        # a sum of periods is whole but for rounding
        stamp = np.round(stamp_s / self._period, 6) + BEFORE
        move = self._move(q)
        usable = due & np.isfinite(move).all(axis=1) & (stamp > self._last_stamp)
        first, last = (at - CANDIDATES[:, None] for at in (self._last_stamp, stamp))
        known = (first >= max(self._k - ROWS + 1, 0)) & (last <= self._k) & usable
        miss = move - (self._at(last) - self._at(first))
        off = np.where(known[..., None], miss - self._bias, 0.0)
        self._bias += self._period / BIAS_S * off
        self._score *= np.where(usable, 1.0 - self._period / MEMORY_S, 1.0)
        cost = (off**2 / self._variance).sum(axis=-1)
        # who cannot be compared yet, or comes from the future, is no better than the worst
        worst = np.where(known, cost, 0.0).max(axis=0)
        self._score += np.where(known, cost, worst) * usable
        # the first stands in for those that are on their way: its own time is unknown
        later = due & self._any
        self._any |= due
        self._last_q[later], self._last_stamp[later] = q[later, : THETA1 + 1], stamp[later]
        self._decide(stamp, usable)

    def _move(self, q: FloatArray) -> FloatArray:
        """(nsim, 2) path and turn since the last measurement."""
        turn = wrap(q[:, THETA1] - self._last_q[:, THETA1])
        middle = self._last_q[:, THETA1] + 0.5 * turn
        x, y = (q[:, :2] - self._last_q[:, :2]).T
        return np.stack([x * np.cos(middle) + y * np.sin(middle), turn], axis=1)

    def _at(self, period: FloatArray) -> FloatArray:
        """(candidates, nsim, 2) what was commanded up to times in periods; between them, linear."""
        lowest = max(self._k - ROWS + 1, 0)
        period = np.clip(np.nan_to_num(period), lowest, self._k)
        whole = np.minimum(np.floor(period).astype(np.int64), max(self._k - 1, lowest))
        each = np.arange(period.shape[1])
        before, after = (self._moved[(whole + i) % ROWS, each] for i in (0, 1))
        share = (period - whole)[..., None]
        return np.asarray((1.0 - share) * before + share * after)

    def _decide(self, stamp: FloatArray, news: BoolArray) -> None:
        """Choose among the candidates, for those of whom there is news."""
        score, each = self._score, np.arange(self._score.shape[1])
        best, step = score.argmin(axis=0), CANDIDATES[1] - CANDIDATES[0]
        now = self.extra_s / self._period
        believed = np.abs(CANDIDATES[:, None] - now).argmin(axis=0)
        # the parabola through the best and its neighbours, where all could be compared
        inner = np.clip(best, 1, CANDIDATES.size - 2)
        left, middle, right = (score[inner + i, each] for i in (-1, 0, 1))
        bend, slope = left - 2.0 * middle + right, 0.5 * (right - left)
        shift = np.clip(-slope / np.where(bend > 0.0, bend, np.inf), -1.0, 1.0)
        whole = (inner != best) | (stamp - CANDIDATES[inner - 1] > self._k)
        shift = np.where(whole, 0.0, shift)
        # how much better that is than the latency believed
        away = (now - CANDIDATES[best]) / step
        near = ~whole & (np.abs(away) < 1.0)
        cost = score[best, each] + shift * (slope + 0.5 * bend * shift)
        costs_now = np.where(
            near, middle + away * (slope + 0.5 * bend * away), score[believed, each]
        )
        sure = news & (costs_now - cost > SURE)
        self._found |= sure
        refined = sure | (news & self._found & (best == believed))
        found = (CANDIDATES[best] + shift * step) * self._period
        self.changed = sure & (np.abs(found - self.extra_s) > 0.25 * self._period)
        self.extra_s = np.where(refined, found, self.extra_s)
