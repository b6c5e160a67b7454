"""`ttwmr compare`: contact physics against the analytic model."""

from pathlib import Path
from typing import Literal

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.last_resort import give_streams_back
from ttwmr_mj.cli.shared import SCENARIO, Live, NewFolder, Overrides, command_line, where_it_is
from ttwmr_mj.cli.supervisor import supervise
from ttwmr_mj.errors import InputError, RunError


class Compare(Overrides, NewFolder, Live, name="compare"):
    """Compare contact physics with the analytic model and explain it."""

    scenario: str = argument(SCENARIO)
    mode: Literal["open_loop", "closed_loop"] = option(
        "one command history for both plants, or each under its own controller", "open_loop"
    )
    real_wheels: bool = option(
        "in open loop, drive the analytic model with the actual wheel speeds, so that only slip "
        "is left"
    )
    no_attribution: bool = option("report deviations without attributing them to effects; fast")
    converge: bool = option("refine the contact physics and report the convergence")
    fit: bool = option("fit an extended analytic model")
    validate_on: str | None = option(
        "scenario to validate the fit on; default: a shipped one", metavar="SCENARIO"
    )
    tolerance: Path | None = option(
        "TOML file of largest allowed values; exit code 1 if one is exceeded", metavar="FILE"
    )

    def __call__(self) -> int:
        from ttwmr_mj.runs.process.progress import progress_bar
        from ttwmr_mj.scenario.file import find_scenario
        from ttwmr_mj.studies.compare import Options, compare_scenario, plain

        scenario = self.load(self.scenario)
        results = self.results(f"{scenario.name}-compared", scenario.seed)
        supervise(scenario, results / "compare.json")
        options = Options(
            mode=self.mode,
            real_wheels=self.real_wheels,
            attribute=not self.no_attribution,
            converge=self.converge,
            fit=self.fit,
            validate_on=self.validate_on,
            tolerance=self.tolerance,
            recording=scenario.output.recording,
            figures=scenario.output.figures,
        )
        if self.live is not None and self.real_wheels:
            problem = "with --real-wheels the analytic motion is found for the whole run at once"
            raise InputError.at("--live", problem, hint="leave one of them out")
        pace, beside = self.make_pace(), find_scenario(self.scenario).parent
        self.check_recording(scenario)
        opened = self.new_folder(results)
        with opened as folder, self.live_view() as live:
            with progress_bar(scenario.name, 1.0, "", self.quiet) as progress:
                done = compare_scenario(
                    scenario,
                    folder,
                    options,
                    scenario_folder=beside,
                    command_line=command_line(),
                    progress=progress,
                    live=live,
                    pace=pace,
                )
            give_streams_back()
            text = f"{plain(done.report)}\n\n{where_it_is('folder', folder)}"
            print(folder if self.quiet else text)
        if done.breaches:
            lines = "\n".join(f"  {breach}" for breach in done.breaches)
            raise RunError(f"{scenario.name} exceeds {self.tolerance}; see {folder}\n{lines}")
        return 0
