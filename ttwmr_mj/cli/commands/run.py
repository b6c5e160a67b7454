"""`ttwmr run`: a scenario becomes a run folder."""

from typing import TYPE_CHECKING

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.last_resort import give_streams_back
from ttwmr_mj.cli.shared import (
    SCENARIO,
    Live,
    NewFolder,
    Overrides,
    command_line,
    ended_early,
    warn,
    where_it_is,
)
from ttwmr_mj.cli.supervisor import supervise
from ttwmr_mj.errors import InputError, RunError, printable

if TYPE_CHECKING:
    from ttwmr_mj.runs import execute
    from ttwmr_mj.scenario.schema import Scenario


class RunCommand(Overrides, NewFolder, Live, name="run"):
    """Run a scenario and leave a run folder."""

    scenario: str = argument(SCENARIO)
    require: str | None = option(
        "exit with 1 unless the run gets this verdict, such as followed", metavar="VERDICT"
    )
    save_frames: bool = option("keep the camera's frames, with COCO keypoint annotations")
    paper_plots: bool = option("also draw the article's plots, one quantity each, into figures/")

    def __call__(self) -> int:
        from ttwmr_mj.runs.execute import run_scenario
        from ttwmr_mj.runs.judgement.foresight import foretold
        from ttwmr_mj.runs.process.progress import progress_bar
        from ttwmr_mj.scenario.file import find_scenario

        self._check_requirement()
        wished = {"save_frames": self.save_frames, "paper_plots": self.paper_plots}
        wishes = [f"output.{name}=true" for name, wish in wished.items() if wish]
        scenario = self.load(self.scenario, *wishes)
        results = self.results(scenario.name, scenario.seed)
        supervise(scenario, results / "metrics.json")
        if not self.quiet:
            warn(foretold(scenario))
        pace, beside = self.make_pace(), find_scenario(self.scenario).parent
        self.check_recording(scenario)
        opened = self.new_folder(results)
        with opened as folder, self.live_view() as live:
            with progress_bar(scenario.name, scenario.duration_s, "s", self.quiet) as progress:
                done = run_scenario(
                    scenario,
                    folder,
                    scenario_folder=beside,
                    command_line=command_line(),
                    progress=progress,
                    live=live,
                    pace=pace,
                )
            return self._tell(scenario, done)

    def _tell(self, scenario: "Scenario", done: "execute.Run") -> int:
        """Say how it ended."""
        give_streams_back()
        met = done.metrics["verdict"] == self.require
        if done.outcome.status != "ok" and not met:
            if self.debug and done.outcome.cause:
                raise done.outcome.cause
            raise ended_early(scenario.name, done)
        print(done.folder) if self.quiet else _print_run(done)
        if self.require and not met:
            from ttwmr_mj.runs.report import verdict_line

            raise RunError(
                f"{scenario.name} was required to be {self.require!r} and is not: "
                f"{verdict_line(done.metrics)}"
            )
        return 0

    def _check_requirement(self) -> None:
        from ttwmr_mj.results.verdict import VERDICTS

        if self.require and self.require not in VERDICTS:
            allowed = ", ".join(VERDICTS)
            raise InputError.at("--require", got=repr(self.require), allowed=allowed)


def _print_run(run: "execute.Run") -> None:
    from ttwmr_mj.runs.report import headline, results_table, verdict_line

    print(
        "\n".join(filter(None, [printable(verdict_line(run.metrics)), headline(run.metrics)]))
        + "\n"
    )
    print(results_table(run.metrics))
    factor = run.metrics["real_time_factor"]
    speed = "undefined" if factor is None else f"{factor:.3g} ×"
    label = "real-time factor, waits left out" if run.pace else "real-time factor"
    print(f"{label:33s} {speed:>12s}  real_time_factor")
    if run.pace:
        print(run.pace)
    print(f"\n{where_it_is('run folder', run.folder)}")
