"""From how far off a controller still catches the robot: the basin of attraction, by simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ttwmr_mj.errors import InputError
from ttwmr_mj.results.curves import Curves
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.motion import initial_state
from ttwmr_mj.scenario.schema import OnReference, Scenario
from ttwmr_mj.state import BoolArray, FloatArray, RobotState

CAUGHT_M = 0.01  # the last trailer's centre of oscillation ends this close to its reference
CAUGHT_SHARE = 0.2  # and stays so over this last share of the run


class Direction(NamedTuple):
    """What one metre or radian of an offset changes of a start on the reference."""

    left: float = 0.0  # P, along the reference's left normal
    turned: tuple[float, ...] = ()  # trailers' angles, front to back; none of those beyond


TO_THE_LEFT = Direction(left=1.0)
THETA2 = Direction(turned=(1.0,))


@dataclass(frozen=True, slots=True)
class Basin:
    """Which starts are caught.

    Attributes:
        across: (n,) offsets [m] or [rad] in one direction.
        up: (m,) offsets [m] or [rad] in another.
        caught_after_s: (n, m) time from which the last trailer's centre of oscillation stays
            within CAUGHT_M of its reference; NaN where the run does not end so.
        simulated: (n, m) starts that were simulated; the others lie between starts that all were
            caught, or all were not, and have their mean.
    """

    across: FloatArray
    up: FloatArray
    caught_after_s: FloatArray
    simulated: BoolArray

    @property
    def caught(self) -> BoolArray:
        """(n, m) whether the run from there ends on the reference."""
        return np.isfinite(self.caught_after_s)

    @property
    def share(self) -> float:
        """Share of the starts on the grid that are caught."""
        return float(self.caught.mean())


def map_basin(
    scenario: Scenario,
    across: FloatArray,
    up: FloatArray,
    coarsest: int = 1,
    directions: tuple[Direction, Direction] = (TO_THE_LEFT, THETA2),
) -> Basin:
    """Run the scenario from the offsets of a grid, finer where the basin's edge is.

    Every `coarsest`-th offset is simulated first, in one batch. Then the stride is halved until it
    is one: a new start is simulated if the starts around it differ in being caught, else it takes
    their mean. What is smaller than the coarsest cells may be missed.

    Args:
        scenario: starts on its reference; its own offsets are left out.
        across: (n,) offsets in the first direction.
        up: (m,) offsets in the second.
        coarsest: a power of two; n − 1 and m − 1 are multiples of it. 1 simulates every start.
        directions: what the offsets change.

    Raises:
        InputError: the grid does not fit the stride.
    """
    shape = (len(across), len(up))
    if coarsest < 1 or coarsest & (coarsest - 1) or any((size - 1) % coarsest for size in shape):
        raise InputError.at(
            "coarsest",
            got=f"{coarsest} for {shape[0]} x {shape[1]} starts",
            allowed="a power of two that divides one less than either number",
        )
    after, known = np.full(shape, np.nan), np.zeros(shape, dtype=np.bool_)
    simulated = known.copy()
    stride = coarsest
    while stride >= 1:
        new = np.argwhere(_every(stride, shape) & ~known)
        if known.any():
            around = after[tuple(_corners(new, 2 * stride))]  # (4, count)
            caught = np.isfinite(around)
            same = caught.all(axis=0) | ~caught.any(axis=0)
            after[tuple(new[same].T)] = around[:, same].mean(axis=0)
            new = new[~same]
        if len(new):
            i, j = new.T
            after[i, j] = _caught_after(scenario, [across[i], up[j]], directions)
            simulated[i, j] = True
        known |= _every(stride, shape)
        stride //= 2
    return Basin(across, up, after, simulated)


def _every(stride: int, shape: tuple[int, int]) -> BoolArray:
    """(n, m) the starts of a grid of that stride."""
    i, j = np.indices(shape)
    return np.asarray((i % stride == 0) & (j % stride == 0))


def _corners(places: np.ndarray, stride: int) -> np.ndarray:
    """(2, 4, count) starts of the coarser grid around each of places (count, 2)."""
    low = places // stride * stride
    high = -(-places // stride) * stride
    i, j = np.stack([low, high]).transpose(2, 0, 1)
    return np.stack([np.stack([i[0], i[0], i[1], i[1]]), np.stack([j[0], j[1], j[0], j[1]])])


def _caught_after(
    scenario: Scenario, offsets: Sequence[FloatArray], directions: Sequence[Direction]
) -> FloatArray:
    """(count,) time from which runs with these offsets (count,) stay caught, all in one batch."""
    count = len(offsets[0])
    on_reference = scenario.model_copy(update={"initial": OnReference(kind="on_reference")})
    experiment = Experiment(on_reference, nsim=count)
    start = initial_state(on_reference, experiment.reference, count)
    q, heading = start.q.copy(), start.q[:, 2]
    for offset, (left, turned) in zip(offsets, directions, strict=True):
        q[:, 0] -= left * offset * np.sin(heading)
        q[:, 1] += left * offset * np.cos(heading)
        q[:, 3 : 3 + len(turned)] += offset[:, None] * turned
    result = experiment.run(initial=RobotState(q=q, q_rate=start.q_rate))
    trajectory = result.trajectory
    miss_m = Curves.of(trajectory, scenario.robot).oscillation_error_m
    outside = ~(miss_m < CAUGHT_M)  # NaN is outside, too
    last = len(trajectory) - 1 - np.argmax(outside[::-1], axis=0)  # sample outside, if any is
    first_inside = np.where(outside.any(axis=0), last + 1, 0)
    ended_well = np.array([outcome.status == "ok" for outcome in result.outcomes])
    caught = ended_well & (first_inside <= (1.0 - CAUGHT_SHARE) * len(trajectory))
    period = scenario.control.sampling_time_s
    return np.where(caught, period * first_inside, np.nan)
