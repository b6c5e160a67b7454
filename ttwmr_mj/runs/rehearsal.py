"""A scenario's law without a run: read, or loaded and started with a dry task."""

from pathlib import Path

from ttwmr_mj.controllers.base import Task
from ttwmr_mj.controllers.custom import CustomOptions
from ttwmr_mj.controllers.shared.own.source import inspected
from ttwmr_mj.deadline import described_within, limited
from ttwmr_mj.errors import Fault, InputError, Overrun
from ttwmr_mj.runs import build
from ttwmr_mj.runs.law.laws import more_time, start_limit_s
from ttwmr_mj.scenario.motion import believed_reference
from ttwmr_mj.scenario.schema import Scenario


def rehearsed(scenario: Scenario, folder: Path, *, load: bool) -> list[Fault]:
    """What is wrong with a law of the user's; of those of this package nothing.

    Args:
        scenario: whose law it is.
        folder: of its file.
        load: import the law and start it: runs the user's code. Else its file is read.
    """
    options = scenario.controller
    if not isinstance(options, CustomOptions):
        return []
    if not load:
        return inspected(options.target, options.options, folder / (options.folder or ""))
    limit_s = given_s = scenario.control.controller_start_limit_s
    try:
        law, task = build.make_controller(scenario, folder), _dry_task(scenario)
        limit_s = start_limit_s(limit_s, task)
        with limited(limit_s):
            law.start(task)
    except InputError as error:
        return list(error.faults)
    except KeyboardInterrupt:
        raise
    except Overrun:
        problem = f"controller.start() timed out after {limit_s:g} s"
        return [Fault(key=("controller", "target"), problem=problem, hint=more_time(given_s))]
    except BaseException as error:  # a user's law may raise anything
        problem = f"controller.start() raised {described_within(limit_s, error)}"
        return [Fault(key=("controller", "target"), got=repr(options.target), problem=problem)]
    return []


def _dry_task(scenario: Scenario) -> Task:
    """The task of a run of it."""
    return Task(
        scenario.believed_robot,
        believed_reference(scenario),
        scenario.control.sampling_time_s,
        1,
        build.generator(scenario.seed, "controller"),
        scenario.believed_ground,
        scenario.believed_command_latency_s,
    )
