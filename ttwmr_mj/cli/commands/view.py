"""`ttwmr view`: a recording in the viewer."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ttwmr_mj.cli.engine import Subcommand, argument


@dataclass(frozen=True, kw_only=True)
class View(Subcommand, name="view"):
    """Open a recording in the Rerun viewer."""

    recording: Path | None = argument(
        "a run folder or an .rrd file; default: the newest under results/", None
    )

    def call(self) -> int:
        """Wait until the viewer is closed, and return its exit code."""
        from ttwmr_mj.recording.viewer import open_viewer

        return open_viewer(self.recording)
