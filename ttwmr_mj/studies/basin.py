"""From how far off a controller still catches the robot: the basin of attraction, by simulation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ttwmr_mj import build
from ttwmr_mj.experiment import Experiment
from ttwmr_mj.metrics import point_behind
from ttwmr_mj.scenario import OnReference, Scenario
from ttwmr_mj.state import BoolArray, FloatArray, RobotState

CAUGHT_M = 0.01  # the trailer's centre of oscillation ends this close to its reference
CAUGHT_SHARE = 0.2  # and stays so over this last share of the run


@dataclass(frozen=True, slots=True)
class Basin:
    """Which starts are caught.

    Attributes:
        position_offset_m: (n,) offsets of P, outward from the reference's centre of motion (along
            the reference's left normal, negative: right).
        theta2_offset_rad: (m,) offsets of θ2.
        caught: (n, m) whether the run from there ends on the reference.
        error_m: (n, m) largest error over the last share of the run.
    """

    position_offset_m: FloatArray
    theta2_offset_rad: FloatArray
    caught: BoolArray
    error_m: FloatArray

    @property
    def share(self) -> float:
        """Share of the starts on the grid that are caught."""
        return float(self.caught.mean())


def map_basin(
    scenario: Scenario, position_offset_m: FloatArray, theta2_offset_rad: FloatArray
) -> Basin:
    """Run the scenario from every offset of a grid, all in one batch.

    Args:
        scenario: starts on its reference; its own offsets are left out.
        position_offset_m: (n,) offsets of P along the reference's left normal.
        theta2_offset_rad: (m,) offsets of θ2.
    """
    grid = np.stack(np.meshgrid(position_offset_m, theta2_offset_rad, indexing="ij"), axis=-1)
    offsets = grid.reshape(-1, 2)
    on_reference = scenario.model_copy(update={"initial": OnReference(kind="on_reference")})
    experiment = Experiment(on_reference, nsim=len(offsets))
    start = build.initial_state(on_reference, experiment.reference, len(offsets))
    q = start.q.copy()
    heading = q[:, 2]
    q[:, 0] -= offsets[:, 0] * np.sin(heading)
    q[:, 1] += offsets[:, 0] * np.cos(heading)
    q[:, 3] += offsets[:, 1]
    result = experiment.run(initial=RobotState(q=q, q_rate=start.q_rate))
    trajectory, swing = result.trajectory, scenario.robot.swing_length_m
    last = int(len(trajectory) * (1 - CAUGHT_SHARE))
    miss = point_behind(trajectory.q[last:], swing) - point_behind(trajectory.ref_q[last:], swing)
    error = np.hypot(miss[..., 0], miss[..., 1]).max(axis=0)
    ended_well = np.array([outcome.status == "ok" for outcome in result.outcomes])
    shape = grid.shape[:2]
    caught = ended_well & (error < CAUGHT_M)
    return Basin(position_offset_m, theta2_offset_rad, caught.reshape(shape), error.reshape(shape))
