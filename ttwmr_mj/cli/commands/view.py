"""`ttwmr view`: a recording in the viewer."""

from pathlib import Path

from ttwmr_mj.cli.engine import Subcommand, argument


class View(Subcommand, name="view"):
    """Open a recording in the Rerun viewer."""

    recording: Path | None = argument(
        "a run folder or an .rrd file; default: the newest under results/"
    )

    def __call__(self) -> int:
        from ttwmr_mj.recording.viewer import open_viewer

        return open_viewer(self.recording)
