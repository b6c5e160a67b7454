"""Finding out on line what acts on the trailer: slope, rolling resistance, hitch friction.

An extended Kalman filter over what is measured of the trailer and what may act on it,

    z = (θ2, θ̇2, w, g_x, g_y, c, dry, viscous),

w the unexplained θ̈2 that the observer has anyway, the rest as in `dynamics.floor.influence`. Each
of these numbers enters θ̈2 linearly, with a factor that the motion gives: −n/k for gravity, v̂·n/k
for rolling resistance, the hitch rate for viscous friction, its smoothed sign for dry friction.
What the motion does not excite is not found: on a circle the hitch does not turn, so its friction
stays as uncertain as before (and does nothing); gravity turns once a round in the trailer's frame,
which tells it from all that turns with the trailer. `std` says how sure the filter is of each
number.

The covariance is propagated once a period along the newest state, whatever the measurement's age: a
few periods more or less change the factors by a few per cent.
"""

from typing import Literal

import numpy as np

from ttwmr_mj.dynamics.flatness import dot, trailer_axes, velocity_behind
from ttwmr_mj.dynamics.floor.influence import DRAG, DRY, GRAVITY, INFLUENCES, VISCOUS, held_back
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import BoolArray, FloatArray

Learnable = Literal[
    "slope", "rolling_resistance", "dry_friction", "viscous_friction", "latency", "wheel_radius"
]
# What this filter finds; `dynamics.latency` finds latency, and `observer` slip, hence the wheels'.
PLACES: dict[Learnable, slice] = {
    "slope": GRAVITY,
    "rolling_resistance": slice(DRAG, DRAG + 1),
    "dry_friction": slice(DRY, DRY + 1),
    "viscous_friction": slice(VISCOUS, VISCOUS + 1),
}
# How far from what is believed each may be: 1.2° of slope (both axes), δ = 1e-4 m, 1e-3 N·m and
# 1e-3 N·m·s with Table I's trailer.
PRIOR_STD = np.array([0.2, 0.2, 0.12, 0.14, 0.14])
FORGETTING_1_S = 0.01  # share of the prior's variance that comes back in a second: floors change
# How fast the unexplained θ̈2 may change while others are learned, per √s: six times as fast as
# without, or forces would have to explain what they cannot (friction that sticks, a length that is
# wrong). Of 16 unkind worlds by camera tvlqr followed 15 at 0.15 and all at 0.3 and 0.5, at medians
# of 4.1, 4.3 and 5.0 mm, while w was not forgotten.
UNEXPLAINED_WALK_RAD_S2 = 0.3
# Time in which it is forgotten where rolling resistance is learned. On a circle the two look alike:
# if w lasted, resistance and its opposite in w would drift apart, to 2e-4 m, and tvlqr with a motor
# of the "fast" kind and noise be 5 to 37 mm off; at 0.15, 0.3 and 0.6 s it is 1 to 4 mm off.
UNEXPLAINED_TIME_S = 0.3
# Share of a commanded change that a motor may have missed after one period; of 1.0 rad/s rms in
# the first two seconds of a run, 0.33 rad/s rms are missing or too much. The trailer feels it.
MOTOR_MISSES = 0.3
KNOWN = 3  # θ2, θ̇2 and w come before what is learned


class Learner:
    """The filter's covariance and gains, for a batch.

    Attributes:
        places: (5,) which influences are learned.
        fade: share of the unexplained θ̈2 that is left after one period.
    """

    def __init__(
        self,
        learn: tuple[Learnable, ...],
        robot: RobotParameters,
        period_s: float,
        nsim: int,
        process_std: tuple[float, float, float],
        measurement_std: tuple[float, float],
        smoothing_rad_s: float,
    ) -> None:
        """Nothing is known yet but the priors.

        Args:
            learn: what to find out; what others find is left to them.
            robot: geometry of the trailer.
            period_s: T.
            nsim: simulations.
            process_std: what a period adds to θ2, θ̇2 and w.
            measurement_std: of θ2 and θ̇2.
            smoothing_rad_s: hitch rate above which dry friction counts as nearly full.
        """
        self._robot, self._period, self._smoothing_rad_s = robot, period_s, smoothing_rad_s
        self.places: BoolArray = np.zeros(INFLUENCES, dtype=np.bool_)
        for name in PLACES.keys() & set(learn):
            self.places[PLACES[name]] = True
        prior = np.where(self.places, PRIOR_STD, 0.0)
        lasting_s = UNEXPLAINED_TIME_S if self.places[DRAG] else np.inf
        self.fade = float(np.exp(-period_s / lasting_s))
        r, k = robot.tractor.wheel_radius_m, robot.swing_length_m
        self._missed = (0.0 if robot.servo.motor is None else MOTOR_MISSES) * r / k
        first = np.diag(np.square([*measurement_std, process_std[2] / np.sqrt(period_s), *prior]))
        self._first, self._covariance = first, np.tile(first, (nsim, 1, 1))
        walk = np.square(prior) * FORGETTING_1_S * period_s
        self._process = np.diag([*np.square(process_std), *walk])
        self._most = np.square(prior)
        self._noise = np.diag(np.square(measurement_std))

    def predict(
        self,
        body: FloatArray,
        velocity: FloatArray,
        hitch_rate: FloatArray,
        change_rad_s: FloatArray,
    ) -> None:
        """One period passes.

        Args:
            body: (nsim, 5) x, y, θ1, θ2, θ̇2.
            velocity: (nsim, 2) of P.
            hitch_rate: (nsim,) θ̇2 − θ̇1.
            change_rad_s: (nsim,) of the wheels' speeds that is commanded, the larger one.
        """
        T = self._period
        A = np.tile(np.eye(KNOWN + INFLUENCES), (len(body), 1, 1))
        A[:, 0, 1] = A[:, 1, 2] = T
        A[:, 0, 2] = 0.5 * T * T
        A[:, 2, 2] = self.fade
        factors = self._factors(body, velocity, hitch_rate)
        A[:, 1, KNOWN:], A[:, 0, KNOWN:] = T * factors, 0.5 * T * T * factors
        P = A @ self._covariance @ np.swapaxes(A, 1, 2) + self._process
        P[:, 1, 1] += np.square(self._missed * change_rad_s)
        learned = np.arange(KNOWN, KNOWN + INFLUENCES)
        # no less sure than at the start
        excess = np.sqrt(np.maximum(P[:, learned, learned] / np.maximum(self._most, 1e-300), 1.0))
        P[:, learned] /= excess[..., None]
        P[:, :, learned] /= excess[:, None]
        self._covariance = P

    def restart(self, who: BoolArray) -> None:
        """Nothing is known any more of some simulations (nsim,)."""
        self._covariance = np.where(who[:, None, None], self._first, self._covariance)

    def gain(self, due: BoolArray) -> FloatArray:
        """(nsim, 8, 2) on the innovations of θ2 and θ̇2; those that are due become surer."""
        P = self._covariance
        seen = P[:, :2]
        K = np.swapaxes(np.linalg.solve(seen[:, :, :2] + self._noise, seen), 1, 2)
        after = P - K @ seen
        after = 0.5 * (after + np.swapaxes(after, 1, 2))
        self._covariance = np.where(due[:, None, None], after, P)
        return np.asarray(K)

    def std(self) -> FloatArray:
        """(nsim, 5) standard deviation of each influence; 0 for what is not learned."""
        variance = np.diagonal(self._covariance, axis1=1, axis2=2)[:, KNOWN:]
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))

    def _factors(
        self, body: FloatArray, velocity: FloatArray, hitch_rate: FloatArray
    ) -> FloatArray:
        """(nsim, 5) derivative of θ̈2 by each influence."""
        k, theta2 = self._robot.swing_length_m, body[:, 3]
        t, n = trailer_axes(theta2)
        com = velocity_behind(velocity, theta2, body[:, 4], self._robot.trailer.com_offset_m)
        factors = np.empty((len(body), INFLUENCES))
        factors[:, GRAVITY] = -trailer_axes(theta2 - self._robot.lean_rad)[1] / k
        along, across, one = dot(com, t), dot(com, n), np.ones(len(body))
        factors[:, DRAG] = held_back(one, along, across, body[:, 4], self._robot) / k
        factors[:, DRY] = -hitch_rate / np.hypot(hitch_rate, self._smoothing_rad_s)
        factors[:, VISCOUS] = -hitch_rate
        return factors
