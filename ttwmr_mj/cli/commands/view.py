"""`ttwmr view`: a recording in the viewer."""

from contextlib import suppress
from pathlib import Path

from ttwmr_mj.cli.engine import Subcommand, argument, option
from ttwmr_mj.errors import RunError


class View(Subcommand, name="view"):
    """Open a recording in the Rerun viewer."""

    recording: Path | None = argument(
        "a run folder or an .rrd file; default: the newest under results/"
    )
    web: bool = option("serve it to a browser on this machine, until Ctrl-C")

    def __call__(self) -> int:
        from ttwmr_mj.recording.stream.viewer import find_recording, open_window, web_viewer

        if not self.web:
            return open_window(self.recording)
        from ttwmr_mj.recording.stream.live import LiveView

        recording = find_recording(self.recording)
        with LiveView(web_viewer()) as served, suppress(KeyboardInterrupt):
            served.follow(recording)
            print(f"{recording} is at {served.viewer.page} until Ctrl-C", flush=True)
            served.finish()
            served.wait()
            raise RunError(f"the viewer ended: {served.fault or 'it was closed'}")
        return 0
