"""The one timeline of a recording."""

from __future__ import annotations

import numpy as np
import rerun as rr

from ttwmr_mj.state import FloatArray

TIMELINE = "sim_time"


def time_column(time_s: FloatArray) -> rr.TimeColumn:
    """Simulated times (n,) in whole nanoseconds; rerun would truncate float seconds."""
    return rr.TimeColumn(TIMELINE, duration=np.rint(1e9 * time_s).astype("timedelta64[ns]"))
