"""`ttwmr run`: a scenario becomes a run folder."""

from typing import TYPE_CHECKING

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.shared import SCENARIO, NewFolder, Overrides, command_line
from ttwmr_mj.errors import RunError

if TYPE_CHECKING:
    from ttwmr_mj.runs import execute


class RunCommand(Overrides, NewFolder, name="run"):
    """Run a scenario and leave a run folder."""

    scenario: str = argument(SCENARIO)
    save_frames: bool = option("keep the camera's frames, with COCO keypoint annotations")

    def __call__(self) -> int:
        from ttwmr_mj.runs.execute import run_scenario
        from ttwmr_mj.runs.progress import progress_bar
        from ttwmr_mj.scenario.file import find_scenario

        wishes = ["output.save_frames=true"] if self.save_frames else []
        scenario = self.load(self.scenario, *wishes)
        folder = self.open_folder(scenario.name, scenario.seed)
        with progress_bar(scenario.name, scenario.duration_s, "s", self.quiet) as progress:
            done = run_scenario(
                scenario,
                folder,
                scenario_folder=find_scenario(self.scenario).parent,
                command_line=command_line(),
                progress=progress,
            )
        if done.outcome.status != "ok":
            if self.debug and done.outcome.cause:
                raise done.outcome.cause
            raise RunError(
                f"{scenario.name} {done.outcome.status} at {done.outcome.time_s:.3f} s: "
                f"{done.outcome.reason}; what was recorded is in {folder}"
            )
        if not self.quiet:
            _print_run(done)
        return 0


def _print_run(run: "execute.Run") -> None:
    from ttwmr_mj.runs.report import results

    rows = results(run.metrics) | {"real-time factor": f"{run.metrics['real_time_factor']:.3g}"}
    for label, value in rows.items():
        print(f"{label:38s} {value}")
    print(f"\nrun folder: {run.folder}\nlook at it: ttwmr view {run.folder}")
