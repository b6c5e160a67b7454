"""Many different scenarios at a time, each with the result that it has alone."""

from collections import defaultdict
from collections.abc import Hashable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ttwmr_mj.config import batch_shape
from ttwmr_mj.errors import require, require_whole
from ttwmr_mj.files import named
from ttwmr_mj.runs.closed_loop.loop import Loop
from ttwmr_mj.runs.experiment import Experiment, Result
from ttwmr_mj.runs.simulations import Simulations
from ttwmr_mj.scenario.given import require_scenario
from ttwmr_mj.scenario.schema import Scenario

MOST_THREADS = 1024


def batch_key(scenario: Scenario) -> Hashable:
    """Equal for scenarios that can share a batch: those that differ in numbers only.

    Numbers of robot, ground, belief, controller, reference, start, pushes, noise and latency may
    differ, and seeds, names and limits of acceptance; where some are zero, in all. A camera and a
    law that runs `alone` are for one simulation: nothing has the key of a scenario with these.
    """
    if scenario.sensing.kind == "camera" or scenario.controller.alone:
        return object()
    plant = scenario.plant
    parts = (scenario.robot, scenario.believed_robot, scenario.ground, scenario.believed_ground)
    pushes = [(push.on, push.trailer) for push in plant.pushes]
    return (
        scenario.duration_s,
        scenario.control,
        scenario.reference.kind,
        scenario.belief.latency_s is None,
        *map(batch_shape, (*parts, scenario.controller, scenario.sensing)),
        *map(batch_shape, (plant.kind, plant.contact, plant.analytic)),
        *pushes,
    )


def run_batch(
    scenarios: Iterable[Scenario], folder: Path | str | None = None, nthread: int = 0
) -> list[Result]:
    """Run scenarios, those that can share a batch in one.

    Args:
        scenarios: what to run.
        folder: where a custom controller is looked for first.
        nthread: threads of contact physics; 0: one per processor.

    Returns:
        a result of one simulation for each, in order, with the same bits as
        `Experiment(scenario).run()` has, whatever the others are; without joints and contacts, and
        with its share of the times that the batch took. They are views of the batch's arrays,
        0.3 kB per control period and run: keep what is needed of them, not them.

    Raises:
        InputError: one of them cannot be built, or its law cannot start.
        KeyboardInterrupt: nothing is left of a batch that was interrupted.
    """
    if isinstance(scenarios, Iterable) and not isinstance(scenarios, str | Scenario):
        scenarios = [*scenarios]
    require(list, "scenarios", scenarios, hint="of what load_scenario gives")
    beside = Path() if folder is None else named("folder", folder)
    nthread = require_whole("nthread", nthread, 0, MOST_THREADS)
    scenarios = [require_scenario(one, f"scenarios[{i}]") for i, one in enumerate(scenarios)]
    who = defaultdict[Hashable, list[int]](list)
    for i, scenario in enumerate(scenarios):
        who[batch_key(scenario)].append(i)
    results: dict[int, Result] = {}
    for group in who.values():
        together = [scenarios[i] for i in group]
        results |= zip(group, _run_together(together, beside, nthread), strict=True)
    return [results[i] for i in range(len(scenarios))]


def _run_together(scenarios: list[Scenario], folder: Path, nthread: int) -> list[Result]:
    simulations = Simulations(scenarios, folder, nthread=nthread)
    loop = simulations.run(drawable=False)
    if any(end.status == "interrupted" for end in loop.ends.values()):
        raise KeyboardInterrupt
    # a law that breaks with several simulations does not say whose fault it is
    return [
        Experiment(scenario, folder).run() if i in loop.together else _result(simulations, loop, i)
        for i, scenario in enumerate(scenarios)
    ]


def _result(simulations: Simulations, loop: Loop, index: int) -> Result:
    scenario, length = simulations.scenarios[index], loop.lengths[index]
    rows = loop.rows.simulation(index).rows(0, length)
    if np.isnan(rows.wheel_command_rad_s[0]).all():  # it ended before its law logged anything
        rows = replace(rows, signals={})
    return Result(
        scenario=scenario,
        trajectory=rows,
        outcomes=(loop.ends[index],),
        wall_time_s={part: s / simulations.nsim for part, s in loop.watch.parts.items()},
        control_time_s=np.array(loop.control_time_s[:length]) / simulations.nsim,
        demands=simulations.demands[index],
    )
