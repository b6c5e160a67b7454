"""Time limits of jobs in the reasons that are stored: what timed out may do with more time."""

from __future__ import annotations

import re

TIMED_OUT = "timed out after "


def reason_after(limit_s: float) -> str:
    """Why a job failed that was killed at its limit."""
    return f"{TIMED_OUT}{limit_s:g} s"


def has_more_time(reason: str, limit_s: float) -> bool:
    """Whether this is the reason of a job that was killed at a smaller limit than this one."""
    found = re.fullmatch(rf"{TIMED_OUT}(\d[\d.e+-]*) s", reason)
    return found is not None and float(found[1]) < float(f"{limit_s:g}")  # as it would be stored
