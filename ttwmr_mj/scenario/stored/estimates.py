"""Whether the law was told what its sensing can tell: the true state of an earlier row, noisy."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ttwmr_mj.results.trajectory import Trajectory, q_names, rate_names
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.scenario.stored.continuity import told
from ttwmr_mj.sensing import TruthSensing, noise_std
from ttwmr_mj.state import THETA2, FloatArray

FARTHEST = 10.0  # standard deviations: white noise goes no farther in 1e22 numbers


def wrong_estimates(rows: Trajectory, scenario: Scenario, tolerance: float) -> Iterator[str]:
    """Where estimates cannot be, in words: column, time, what it is and what is expected.

    Args:
        rows: (n, 1) that were reached, finite.
        scenario: that they are of. What a camera tells is not looked at: how far it sees is not
            among the files of a run.
        tolerance: of numbers that are the same [m, rad, and of both in a second].
    """
    if scenario.sensing.kind == "camera" or not len(rows):
        return
    true = np.hstack([rows.q[:, 0], rows.q_rate[:, 0]])
    seen = np.hstack([rows.est_q[:, 0], rows.est_q_rate[:, 0]])
    least, most = _told_of(true, rows.measurement_age_s[:, 0], scenario, scenario.sensing)
    width = rows.q.shape[-1]
    measured_as = [*range(4), *[THETA2] * (width - 4)]
    noise = FARTHEST * noise_std(scenario.sensing)[:, measured_as].ravel()
    nearest = np.clip(seen, least - noise, most + noise)
    names = [*q_names(width), *rate_names(width)]
    off = np.abs(seen - nearest) > tolerance
    if saw := told([f"est_{name}" for name in names], rows.time_s, seen, nearest, off):
        yield f"{saw} is the nearest that its scenario's sensing can tell"
    valid = rows.est_valid.astype(float)
    if blinded := told(["est_valid"], rows.time_s, valid, np.ones_like(valid), valid < 1.0):
        yield f"{blinded} in all runs without a camera"


def _told_of(
    true: FloatArray, age_s: FloatArray, scenario: Scenario, sensing: TruthSensing
) -> tuple[FloatArray, FloatArray]:
    """(n, columns) least and largest of each number in the rows that may have been measured.

    A measurement is older than its stamp tells by what its receiver does not know: the clock's
    offset, latency that is not believed in, and jitter. A stamp of the future counts as now.
    """
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    period_s, latency_s = scenario.control.sampling_time_s, scenario.belief.latency_s
    latency, jitter = (round(s / period_s) for s in (sensing.latency_s, sensing.latency_jitter_s))
    untold = latency - (latency if latency_s is None else latency_s / period_s)
    late = untold + sensing.clock_offset_s / period_s
    among = min(jitter + int(np.ceil(max(late, 0.0))), len(true))  # rows before the latest
    k = np.arange(len(true))
    oldest = k - np.rint(np.clip(age_s / period_s + late + jitter, 0.0, len(true)))
    latest = np.clip(oldest + among, 0, k).astype(int)
    window = {"size": among + 1, "axis": 0, "origin": among // 2, "mode": "nearest"}
    return minimum_filter1d(true, **window)[latest], maximum_filter1d(true, **window)[latest]
