"""Recordings of runs for the Rerun viewer; the only package that imports rerun.

`RunRecorder` is loaded on first use, because rerun takes half a second to import.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ttwmr_mj.recording.run_recorder import RunRecorder

__all__ = ["RunRecorder"]


def __getattr__(name: str) -> Any:
    if name != "RunRecorder":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from ttwmr_mj.recording.run_recorder import RunRecorder

    return RunRecorder
