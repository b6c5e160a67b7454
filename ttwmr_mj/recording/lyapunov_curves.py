"""V and V′ along a run, as its plots show them while it goes on."""

from __future__ import annotations

import numpy as np

from ttwmr_mj.controllers.lyapunov import LyapunovOptions
from ttwmr_mj.recording.plots import Values
from ttwmr_mj.results.lyapunov_log import lyapunov_function
from ttwmr_mj.results.trajectory import Trajectory


class LyapunovCurves:
    """Turns rows into the values of the plots `lyapunov` and `lyapunov_rate`.

    V falls by many decades, so it is shown as log₁₀ V/V(0), and V′ as V′/V: the measured one from
    sample to sample, the claimed one by Eq. 36 and 46. Where the measured one is above zero, V
    grows.
    """

    def __init__(self, options: LyapunovOptions) -> None:
        self._options = options
        self._start: float | None = None
        self._before = np.nan, np.nan  # time and V of the last row

    def of(self, rows: Trajectory) -> Values:
        """The values of the next rows, oldest first."""
        v, claimed = lyapunov_function(rows, self._options)
        self._start = self._start or float(v[0])
        time_s = np.append(self._before[0], rows.time_s)
        known = np.append(self._before[1], v)
        self._before = float(time_s[-1]), float(known[-1])
        with np.errstate(divide="ignore", invalid="ignore"):  # V = 0 on the reference
            fall = np.log10(v / self._start)
            measured = np.diff(known) / np.diff(time_s) / known[:-1]
            promised = claimed / v
        return {
            "lyapunov": {"true": fall[:, None]},
            "lyapunov_rate": {"true": measured[:, None], "claimed": promised[:, None]},
        }
