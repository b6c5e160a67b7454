"""Runs into folders of their own, those that can share a batch computed in one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from ttwmr_mj.files import clear
from ttwmr_mj.runs.batch import batch_key, run_batch
from ttwmr_mj.runs.execute import run_scenario
from ttwmr_mj.runs.files.folder import write_manifest, write_resolved
from ttwmr_mj.runs.metrics import metrics_of, write_result
from ttwmr_mj.scenario.schema import Scenario


class Placed(NamedTuple):
    """A run and where its files go."""

    scenario: Scenario
    folder: Path
    command_line: tuple[str, ...]  # for the manifest
    beside: Path  # where a custom controller is looked for first


def numbers_only(scenario: Scenario) -> bool:
    """Whether a run leaves nothing but what a batch knows of it: trajectory and metrics."""
    out = scenario.output
    drawn = out.recording or out.figures or out.paper_plots
    return not (drawn or out.physics_rate or out.save_frames)


def shareable(scenario: Scenario) -> bool:
    """Whether a run can be in a batch with others, and leave its files from there."""
    alone = scenario.sensing.kind == "camera" or scenario.controller.alone
    return numbers_only(scenario) and not alone


def run_into_folders(runs: Sequence[Placed]) -> None:
    """Run scenarios, each into a folder that is emptied first.

    The files are those of `runs.execute.run_scenario`, bit for bit, but for the times that things
    took: a run of a batch has its share of them.

    Args:
        runs: either one, or several that are `shareable`.

    Raises:
        InputError: one of them cannot be built, or its law cannot start; which, is not said.
        KeyboardInterrupt: they were interrupted, or a law raised it.
    """
    runs = [run._replace(folder=run.folder.absolute()) for run in runs]
    for run in runs:
        clear(run.folder)  # of half a run, or one of something else
    if len(runs) == 1 and not shareable(runs[0].scenario):
        scenario, folder, words, beside = runs[0]
        done = run_scenario(scenario, folder, scenario_folder=beside, command_line=list(words))
        if done.outcome.status == "interrupted":
            raise KeyboardInterrupt
        return
    for scenario, folder, words, beside in runs:
        write_resolved(folder, scenario, beside)
        write_manifest(folder, scenario, list(words))
    results = run_batch([run.scenario for run in runs], runs[0].beside, nthread=1)
    for (scenario, folder, _, _), result in zip(runs, results, strict=True):
        took_s = sum(result.wall_time_s.values())
        write_result(folder, result.trajectory, metrics_of(result, scenario, took_s))


def batches(runs: Sequence[Placed], most: int) -> list[tuple[Placed, ...]]:
    """Runs as they are computed together, at most so many at once, each batch's side by side."""
    groups: dict[object, list[Placed]] = {}
    for run in runs:
        key = (batch_key(run.scenario), run.beside) if shareable(run.scenario) else id(run)
        groups.setdefault(key, []).append(run)
    return [
        tuple(group[start : start + most])
        for group in groups.values()
        for start in range(0, len(group), most)
    ]
