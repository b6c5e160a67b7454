"""`ttwmr video`: a run as a film."""

from pathlib import Path
from typing import Literal

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.shared import NewFiles, Quiet
from ttwmr_mj.errors import RunError


class VideoCommand(NewFiles, Quiet, name="video"):
    """Make a video of a run from its files; needs no display."""

    run: Path = argument("the run folder")
    out: Path = option(
        "the video, by its ending .mp4, .webm or .gif", Path("run.mp4"), name="-o", metavar="FILE"
    )
    view: Literal["both", "chase", "overhead"] = option(
        "from behind the robot, from above, or both", "both"
    )
    speed: float = option("simulated seconds per second of the video", 1.0, metavar="FACTOR")
    start: float = option("simulated time of the first frame", 0.0, metavar="SECONDS")
    stop: float | None = option(
        "of the last frame; default, and at the latest: the run's end", metavar="SECONDS"
    )

    def __call__(self) -> int:
        from ttwmr_mj.recording.video.film import make_video
        from ttwmr_mj.runs.process.progress import progress_bar

        self.refuse_to_replace("-o", self.out)
        with progress_bar(self.out.name, 100.0, "%", self.quiet) as progress:
            lacks = make_video(
                self.run,
                self.out,
                view=self.view,
                speed=self.speed,
                start_s=self.start,
                stop_s=self.stop,
                progress=None if progress is None else lambda share: progress(100.0 * share),
            )
        print(self.out if self.quiet else f"written to {self.out}")
        if lacks:
            raise RunError(lacks)
        return 0
