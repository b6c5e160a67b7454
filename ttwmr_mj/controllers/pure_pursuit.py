"""Pure pursuit: drive on the arc that leads to a point of the reference a little ahead in time.

The arc from P, tangent to the heading, through a point (a, b) of the tractor's frame, ahead and to
the left, has the curvature κ = 2b/(a² + b²). The speed is that of the reference at the target
point, plus a term in the distance along the heading to where the reference is now:

    u1 = |v_aim| + g·d,    u2 = κ·u1.

On a line and on a circle the reference itself is that arc, so it is an exact equilibrium; where the
curvature changes, P cuts corners by what the preview sees of it. Nothing here looks at the trailer,
and no stability is claimed.
"""

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from ttwmr_mj.controllers.base import Command, ControllerOptions, Law, Task
from ttwmr_mj.dynamics.kinematics import to_body, wheels_from_twist
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import THETA1

NEAR_AIM_M = 1e-6  # an aim that close has no direction: straight on


class PurePursuit(Law["PurePursuitOptions"]):
    """The law above; wheel speeds are cut to the servo's range, both by the same share."""

    def start(self, task: Task) -> None:
        """Take the reference."""
        self._robot, self._path = task.robot, task.path
        preview = np.rint(np.divide(self._options.preview_s, task.sampling_time_s))
        self._ahead = np.maximum(1, preview.astype(np.int64))  # one for all, or (nsim,)
        self._each = np.arange(task.nsim) if task.path.derivatives.shape[1] > 1 else 0
        self._limit = task.robot.servo.speed_limit_rad_s

    def command(self, k: int, estimate: Estimate) -> Command:
        """One sample of the law."""
        q, path = estimate.state.q, self._path
        aim = np.minimum(k + self._ahead, len(path.time_s) - 1)
        a, b = to_body(q[:, THETA1], *(path.position_m[aim, self._each] - q[:, :2]).T)
        late, _ = to_body(q[:, THETA1], *(path.position_m[k] - q[:, :2]).T)
        speed = np.hypot(*path.velocity_m_s[aim, self._each].T) + self._options.gain_1_s * late
        curvature = 2.0 * b / np.maximum(a**2 + b**2, NEAR_AIM_M**2)
        wish = wheels_from_twist(np.stack([speed, curvature * speed], axis=-1), self._robot)
        excess = np.maximum(np.abs(wish).max(axis=1) / self._limit, 1.0)
        return Command(
            wish / excess[:, None],
            saturated=np.asarray(excess > 1.0),
            near_singular=np.zeros(len(wish), dtype=np.bool_),
        )


class PurePursuitOptions(ControllerOptions):
    """Drives towards a point ahead on the reference; ignores the trailer."""

    law = PurePursuit
    takes_stacks: ClassVar[bool] = True
    tows_trains: ClassVar[bool] = True
    kind: Literal["pure_pursuit"] = "pure_pursuit"
    preview_s: float = Field(
        default=0.5,
        ge=1e-12,
        le=2,
        description="how far ahead on the reference, in time, the target point is; typically "
        "0.3 to 1",
    )
    gain_1_s: float = Field(
        default=1.0,
        ge=0,
        le=100,
        description="g: speed per distance along the heading; typically 1",
    )
