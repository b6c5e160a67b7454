"""What a control law is: options in a scenario, started with the task, called for wheel speeds."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
from pydantic import ConfigDict

from ttwmr_mj.config import requires_kind
from ttwmr_mj.dynamics.floor.ground import Ground
from ttwmr_mj.errors import Fault
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.references.shared.reference import Reference, faults_only, kind_of
from ttwmr_mj.registry import Registry, guarded, is_foreign
from ttwmr_mj.robot import Config, RobotParameters
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import ArrayFields, BoolArray, FloatArray


@dataclass(frozen=True, slots=True)
class Task:
    """What a controller may know before the run.

    Attributes:
        robot: all parameters of the robot that the controller assumes.
        reference: sampled at k·sampling_time_s, with samples beyond the end of the run to look
            ahead; None in open-loop experiments.
        sampling_time_s: the control period T.
        nsim: simulations in the batch.
        rng: the controller's own random numbers, of the scenario's seed. Simulations of different
            scenarios have none in common: a law that drives several and asks for some ends, and
            each is run alone.
        ground: the floor, as the controller is told it.
        command_latency_s: how long a command takes to the servos, as the controller is told it.
    """

    robot: RobotParameters
    reference: ReferencePath | None
    sampling_time_s: float
    nsim: int
    rng: np.random.Generator
    ground: Ground = field(default_factory=Ground)
    command_latency_s: float = 0.0

    @property
    def path(self) -> ReferencePath:
        """The reference, for laws that need one; the options' `faults` say when it is missing."""
        assert self.reference is not None, "this law needs a reference"
        return self.reference

    @property
    def ahead(self) -> int:
        """Whole periods that a command takes, the nearest number."""
        return round(self.command_latency_s / self.sampling_time_s)

    @property
    def path_ahead(self) -> ReferencePath:
        """The reference at the times at which the commands of samples 0, 1, … arrive."""
        return self.path.after(self.ahead)


@dataclass(frozen=True, slots=True, eq=False)
class Command(ArrayFields):
    """Wheel speeds for the coming period, and what the law wants to be logged with them.

    Attributes:
        wheel_speed_rad_s: (nsim, 2) (ω_r, ω_l).
        saturated: (nsim,) the desired speeds or torques were limited to the servo's range. What
            drives the robot and is at its limit or beyond it is recorded as saturated in any case.
        near_singular: (nsim,) the map to wheel speeds was near its singularity, standstill.
        signals: name with its unit → (nsim,); the same names at every sample. They become columns
            of trajectory.parquet, plots of the recording and a figure.
        wheel_torque_n_m: (nsim, 2) torques (right, left), where these drive the robot
            (`control.inner_loop`); None: the servos make the wheel speeds.
    """

    wheel_speed_rad_s: FloatArray
    saturated: BoolArray
    near_singular: BoolArray
    signals: Mapping[str, FloatArray] = field(default_factory=dict)
    wheel_torque_n_m: FloatArray | None = None


class Controller(ABC):
    """A control law. Subclass it, and name the subclass in a scenario as `module:Class`."""

    @abstractmethod
    def start(self, task: Task) -> None:
        """Prepare for a run and forget the last one."""

    @abstractmethod
    def command(self, k: int, estimate: Estimate) -> Command:
        """Wheel speeds from sample k (time k·T) until the next."""

    @staticmethod
    def plain(
        wheel_speed_rad_s: FloatArray, signals: Mapping[str, FloatArray] | None = None
    ) -> Command:
        """A command without flags of the law's own, for laws that speak in wheel speeds."""
        clear = np.zeros(len(wheel_speed_rad_s), dtype=np.bool_)
        return Command(wheel_speed_rad_s, clear, clear, signals or {})


class ControllerOptions(Config):
    """Options of one law. A subclass declares `kind: Literal["its_name"] = "its_name"`.

    Attributes:
        law: what is made of the options; or override `make`.
        needs_reference: whether there must be something to follow.
        tows_trains: whether the law can drive a tractor with more than one trailer.
        takes_stacks: whether one law can drive simulations that differ in numbers of options,
            robot, ground and reference: it is then made of stacked ones (`config.Stack`). Others
            are started for each set of such numbers, and drive all simulations that share it.
            Neither draws from `Task.rng`.
    """

    model_config = ConfigDict(json_schema_extra=requires_kind)
    kind: str
    law: ClassVar[type[Law[Any]]]
    needs_reference: ClassVar[bool] = True
    takes_stacks: ClassVar[bool] = False
    tows_trains: ClassVar[bool] = False

    @property
    def of_others(self) -> bool:
        """Whether the law is not of this package, and may do anything."""
        return is_foreign(type(self))

    @property
    def alone(self) -> bool:
        """Whether it shares no batch: one of others' does only if it says that it can."""
        return self.of_others and not self.takes_stacks

    def make(self, folder: Path) -> Controller:
        """The law with these options, not yet started; `folder` is that of the scenario."""
        del folder
        return self.law(self)

    def faults(self, reference: Reference, path: ReferencePath | None) -> list[Fault]:
        """What the law needs of the reference and does not find; keys from the scenario's root.

        Both `ttwmr validate` and the run call this, and `start` relies on it.

        Args:
            reference: the scenario's.
            path: its motion; None where there is nothing to follow.
        """
        if path is None:
            if not self.needs_reference:
                return []
            problem = f"controller.kind = {self.kind!r} needs a reference"
            return [Fault(key=("reference", "kind"), got=repr(reference.kind), problem=problem)]
        return self.path_faults(reference, path)

    def path_faults(self, reference: Reference, path: ReferencePath) -> list[Fault]:
        """The same for a reference that there is."""
        del reference, path
        return []


OptionsT = TypeVar("OptionsT", bound=ControllerOptions)


class Law(Controller, Generic[OptionsT]):
    """A control law that is made of its options alone."""

    def __init__(self, options: OptionsT) -> None:
        self._options = options


def law_faults(
    options: ControllerOptions, reference: Reference, path: ReferencePath | None
) -> list[Fault]:
    """`options.faults`, of whatever package it is."""
    with guarded(type(options), "controller.kind", "faults()"):
        return faults_only(options.faults(reference, path))


def undefined_theta2(reference: Reference, problem: str, hint: str) -> Fault:
    """A fault of `path_faults`: θ2 is undefined where the law needs it."""
    key = "theta2" if "theta2" in type(reference).model_fields else "kind"
    got = repr(getattr(reference, key))
    return Fault(
        key=("reference", key), got=got, problem=f"which leaves θ2 undefined {problem}", hint=hint
    )


def _lacks(cls: type[ControllerOptions]) -> str:
    """What makes no law."""
    made = cls.make is not ControllerOptions.make
    law = getattr(cls, "law", None)
    if made or (isinstance(law, type) and issubclass(law, Law)):
        return ""
    return "it has neither `law`, a class that derives from Law, nor `make`"


CONTROLLERS: Registry[ControllerOptions] = Registry(
    "ttwmr_mj.controllers", ControllerOptions, kind_of, "ttwmr_mj.controllers", _lacks
)
