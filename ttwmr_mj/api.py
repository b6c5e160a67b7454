"""What a script or a notebook calls: simulate, run, compare. The package's root offers them."""

from pathlib import Path

from ttwmr_mj.controllers.base import Controller
from ttwmr_mj.errors import require, require_whole
from ttwmr_mj.files import named
from ttwmr_mj.runs.execute import Run, run_scenario
from ttwmr_mj.runs.experiment import Experiment, Result
from ttwmr_mj.runs.files.folder import results_folder
from ttwmr_mj.runs.files.new_folder import new_folder
from ttwmr_mj.scenario.given import require_scenario
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.compare.pair import run_pair as compare

MOST_SIMULATIONS = 100_000  # of one batch: more do not fit into memory

__all__ = ["compare", "run", "simulate"]


def simulate(
    scenario: Scenario,
    nsim: int = 1,
    *,
    controller: Controller | None = None,
    scenario_folder: Path | str | None = None,
) -> Result:
    """Run a scenario in memory; nothing is written.

    In the main thread the limits on a law's time take the signal SIGALRM; a timer that the script
    has set (`signal.alarm`, `signal.setitimer`) rings when the run is over, or later if it is due
    later.

    Args:
        scenario: what to run.
        nsim: simulations in the batch; the first is as if alone, the others differ from it by what
            the scenario leaves to chance: noise, latency and losses of sensing, jitter and losses
            of commands, directions and times of pushes. A law of your own drives all of them, and
            what it draws from `task.rng` it draws for all.
        controller: a law of your own, which drives instead of the scenario's.
        scenario_folder: where a custom controller is looked for first; None: here.

    Raises:
        InputError: the scenario cannot be built, or an argument is of another kind.
    """
    scenario = require_scenario(scenario)
    nsim = require_whole("nsim", nsim, 1, MOST_SIMULATIONS)
    require(Controller | None, "controller", controller, hint="give an instance of it")
    return Experiment(scenario, _folder(scenario_folder), nsim, controller).run()


def run(
    scenario: Scenario,
    out: Path | str | None = None,
    *,
    force: bool = False,
    scenario_folder: Path | str | None = None,
) -> Run:
    """Run a scenario and leave a run folder, as `ttwmr run` does.

    Args:
        scenario: what to run.
        out: the run folder; None: a new one under results/.
        force: replace the run in the folder, if there is one.
        scenario_folder: where a custom controller is looked for first; None: here.

    Raises:
        InputError: the scenario cannot be built, or the folder is not empty or in use.
    """
    scenario = require_scenario(scenario)
    require(bool, "force", force)
    folder = results_folder(scenario.name, scenario.seed) if out is None else named("out", out)
    with new_folder(folder, force, "out"):
        return run_scenario(scenario, folder, scenario_folder=_folder(scenario_folder))


def _folder(given: Path | str | None) -> Path | None:
    return None if given is None else named("scenario_folder", given)
