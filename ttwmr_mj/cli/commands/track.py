"""`ttwmr track`: the robot's poses from pictures."""

from pathlib import Path

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.shared import Live, NewFolder, where_it_is
from ttwmr_mj.errors import InputError


class TrackCommand(NewFolder, Live, name="track"):
    """Track the robot through a video, a folder of pictures or a camera's stream."""

    source: str = argument(
        "a video file, a folder of pictures such as the frames/ of a run with --save-frames, "
        "or a camera's index"
    )
    calibration: Path = option(
        "the camera's calibration, as ttwmr calibrate writes it", metavar="YAML"
    )
    scenario: str = option("scenario whose robot is in the video", "lab_circle")
    frames: int | None = option("stop after N frames", metavar="N", least=1)

    def __call__(self) -> int:
        from ttwmr_mj.runs.process.progress import progress_bar
        from ttwmr_mj.scenario.file import load_scenario
        from ttwmr_mj.studies.track.track import track

        robot, source = load_scenario(self.scenario).robot, Path(self.source).absolute()
        if self.force and self.out and source.is_relative_to(self.out.absolute()):
            problem = f"--force would replace what is in {self.out}, this too"
            raise InputError.at("SOURCE", problem, got=self.source, hint="give another --out")
        pace = self.make_pace()
        opened = self.new_folder(self.results("track", Path(self.source).stem))
        with opened as folder, self.live_view() as live:
            with progress_bar("tracking", self.frames, "frames", self.quiet) as progress:
                done = track(
                    self.source,
                    self.calibration,
                    folder,
                    robot,
                    max_frames=self.frames,
                    progress=progress,
                    live=live,
                    pace=pace,
                )
            if self.quiet:
                print(done.folder)
            else:
                print(f"{done.frames} frames, robot tracked in {done.tracked}")
                if not done.tracked:
                    print(
                        "no robot: are the pictures in colour, and --calibration and --scenario "
                        "those of them?"
                    )
                print(where_it_is("written to", done.folder))
        return 0
