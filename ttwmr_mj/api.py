"""What a script or a notebook calls: simulate, run, compare. The package's root offers them."""

from pathlib import Path

from ttwmr_mj.controllers.base import Controller
from ttwmr_mj.runs.execute import Run, run_scenario
from ttwmr_mj.runs.experiment import Experiment, Result
from ttwmr_mj.runs.folder import results_folder
from ttwmr_mj.runs.new_folder import new_folder
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.compare.pair import run_pair as compare

__all__ = ["compare", "run", "simulate"]


def simulate(
    scenario: Scenario,
    nsim: int = 1,
    *,
    controller: Controller | None = None,
    scenario_folder: Path | None = None,
) -> Result:
    """Run a scenario in memory; nothing is written.

    Args:
        scenario: what to run.
        nsim: simulations in the batch; they differ by their sensors' noise only.
        controller: a law of your own, which drives instead of the scenario's.
        scenario_folder: where a custom controller is looked for first; None: here.

    Raises:
        InputError: the scenario cannot be built.
    """
    return Experiment(scenario, scenario_folder, nsim, controller).run()


def run(
    scenario: Scenario,
    out: Path | None = None,
    *,
    force: bool = False,
    scenario_folder: Path | None = None,
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
    folder = out or results_folder(scenario.name, scenario.seed)
    with new_folder(folder, force):
        return run_scenario(scenario, folder, scenario_folder=scenario_folder)
