"""Handing over to model predictive control, far from the reference, and taking back near it.

A law about its reference is local. Its region is told by what the time-varying LQR about the
reference (`tvlqr`) expects the way back to cost, V = ½·δxᵀP_k·δx: a Lyapunov function of that loop,
so that near the reference its level sets are regions that one does not leave again. Outside
V ≤ LEAVE the plans of `receding_horizon` drive, with the law's own observer and with the same
disturbances; the law takes back inside V ≤ TAKE_BACK, or where V stays between the two, as it does
with a force on the trailer that nobody knows of. The levels are far apart, so that it does not
change hands at every sample. Each simulation decides for itself.

Nothing is proven of either level: the limits of the servos are not in V, and the plans, which know
them, have no proof far off (`mpc`). V tells well, though: of 24 pushes of 0.5 N on a trailer inside
the circle, the gains of `tvlqr` alone recover from all that leave V ≤ 100, and lose all that leave
it at 117 or more. What the plans recover from: docs/theory/controllers.md, "Pushes at every phase".
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.controllers.shared.estimation.friction import HitchFriction
from ttwmr_mj.controllers.shared.estimation.observer import Observed
from ttwmr_mj.controllers.shared.optimal.gauss_newton import DISTURBANCE_TIME_S, decay
from ttwmr_mj.controllers.shared.optimal.receding_horizon import (
    PREDICTION_SUBSTEP_S,
    RecedingHorizon,
)
from ttwmr_mj.controllers.shared.optimal.tracking_problem import TrackingProblem, TrackingWeights
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import BoolArray, FloatArray

# Chosen on pushes of 0.5 N at the odd phases of `benchmarks/pushes.py`, trailer inside; all twelve
# end on the reference. Lost by verdict, `tvlqr` and `flatness`: 2 and 1; with (400, 40): 1 and 2.
LEAVE, TAKE_BACK = 200.0, 20.0  # a start 50 mm and 0.2 rad off has at most 165
BETTER, PATIENCE_S = 0.8, 1.0  # a cost that has not fallen to this share for so long is as it stays
SAMPLES = 30  # of the horizon, a second, as `mpc` has it (with its weights, 20: one stays off)
STEPS = 2  # of Gauss-Newton in a period; 3 catch no more
# Not those of `mpc`, with which 4 are lost: θ2 counts for more, and commands change more gently.
WEIGHTS = TrackingWeights(position_scale_m=0.03, angle_scale_rad=0.1, change_scale_rad_s=0.3)

RecoveryKind = Annotated[
    Literal["auto", "own", "mpc"],
    Field(
        description="who leads back from far off the reference: the law's own means, or model "
        "predictive control, until the error is small again; auto: mpc, and own with several "
        "trailers, for which there are no such plans"
    ),
]


class Recovery:
    """Who of a batch is led back by plans, and their commands."""

    def __init__(
        self,
        robot: RobotParameters,
        friction: HitchFriction,
        period_s: float,
        nsim: int,
        learns: bool,
    ) -> None:
        """All simulations start in the hands of their law.

        Args:
            robot: as believed.
            friction: of the hitch, as believed.
            period_s: T.
            nsim: simulations.
            learns: whether disturbances include what acts on the trailer.
        """
        smooth = friction.planning(period_s, PREDICTION_SUBSTEP_S)
        problem = TrackingProblem(robot, smooth, WEIGHTS, learns=learns)
        self._horizon = RecedingHorizon(problem, SAMPLES, STEPS)
        self._decay = decay(DISTURBANCE_TIME_S, period_s, problem.lasting)
        self._period_s = period_s
        self._led: BoolArray = np.zeros(nsim, dtype=np.bool_)
        self._least: FloatArray = np.zeros(nsim)  # cost since the hand-over,
        self._since: FloatArray = np.zeros(nsim)  # and for how long it has not fallen [s]

    def plan(self, path: ReferencePath, planned: FloatArray, passes: int = 0) -> None:
        """Take the reference; arguments as of `RecedingHorizon.plan`."""
        self._horizon.plan(path, planned, self._decay, passes)

    def command(
        self, k: int, now: Observed, disturbance: FloatArray
    ) -> tuple[BoolArray, FloatArray]:
        """Who is led back, (nsim,), and wheel speeds (m, 2) for those, m of them.

        To be called at each sample: who is led back now depends on how it went so far.

        Args:
            k: sample since the plan's start.
            now: of all simulations.
            disturbance: (nsim, width) which lasts.
        """
        led = self._decide(k, now)
        return led, self._horizon.command(k, now, disturbance, led)

    def _decide(self, k: int, now: Observed) -> BoolArray:
        """(nsim,) who is led back at sample k."""
        cost = self._horizon.cost_to_go(k, now)
        better = ~self._led | (cost < BETTER * self._least)
        self._least = np.where(better, cost, self._least)
        self._since = np.where(better, 0.0, self._since + self._period_s)
        # what the plans do not know may keep the cost up for good: the law does no worse there
        stays = self._led & (cost > TAKE_BACK) & (self._since < PATIENCE_S)
        self._led = (cost > LEAVE) | stays
        return self._led
