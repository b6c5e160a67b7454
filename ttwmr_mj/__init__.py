"""ttwmr-mj: a MuJoCo testbed for a tractor towing a spherical-wheeled trailer.

The names in `__all__` are what a script or a notebook needs; each is loaded on first use.
"""

from importlib import import_module

TYPE_CHECKING = False  # as in typing, whose import takes longer than all else before a command
if TYPE_CHECKING:
    from ttwmr_mj.api import compare, run, simulate
    from ttwmr_mj.controllers.base import Command, Controller, Task
    from ttwmr_mj.dynamics.kinematics import twist_from_wheels, wheels_from_twist
    from ttwmr_mj.errors import InputError, MachineError, RunError, TtwmrError
    from ttwmr_mj.results.metrics import score
    from ttwmr_mj.results.trajectory import Trajectory
    from ttwmr_mj.results.verdict import Verdict, judge
    from ttwmr_mj.robot import RobotParameters
    from ttwmr_mj.runs.batch import run_batch
    from ttwmr_mj.runs.experiment import Result
    from ttwmr_mj.scenario.file import check_scenario, load_scenario
    from ttwmr_mj.scenario.schema import Scenario
    from ttwmr_mj.sensing import Estimate
    from ttwmr_mj.state import wrap

__all__ = [
    "Command",
    "Controller",
    "Estimate",
    "InputError",
    "MachineError",
    "Result",
    "RobotParameters",
    "RunError",
    "Scenario",
    "Task",
    "Trajectory",
    "TtwmrError",
    "Verdict",
    "check_scenario",
    "compare",
    "judge",
    "load_scenario",
    "run",
    "run_batch",
    "score",
    "simulate",
    "twist_from_wheels",
    "wheels_from_twist",
    "wrap",
]

_HOMES = {
    "api": ("compare", "run", "simulate"),
    "controllers.base": ("Command", "Controller", "Task"),
    "dynamics.kinematics": ("twist_from_wheels", "wheels_from_twist"),
    "errors": ("InputError", "MachineError", "RunError", "TtwmrError"),
    "results.metrics": ("score",),
    "results.trajectory": ("Trajectory",),
    "results.verdict": ("Verdict", "judge"),
    "robot": ("RobotParameters",),
    "runs.batch": ("run_batch",),
    "runs.experiment": ("Result",),
    "scenario.file": ("check_scenario", "load_scenario"),
    "scenario.schema": ("Scenario",),
    "sensing": ("Estimate",),
    "state": ("wrap",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> object:
    """A name of the public API, or the version, loaded when first asked for."""
    if name == "__version__":  # reading it takes as long as `ttwmr --help` has
        from importlib.metadata import version

        return version("ttwmr-mj")
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """The public API."""
    return sorted([*__all__, "__version__"])
