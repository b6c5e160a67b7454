"""What every reference is: options of a scenario that know the motion they describe."""

from abc import ABC, abstractmethod
from typing import Annotated, ClassVar, get_args

import numpy as np
from pydantic import ConfigDict, Field

from ttwmr_mj.config import requires_kind
from ttwmr_mj.errors import Fault
from ttwmr_mj.references.shared.path import ReferencePath, require_motion
from ttwmr_mj.registry import Registry, guarded, is_foreign
from ttwmr_mj.robot import Config, RobotParameters
from ttwmr_mj.state import FloatArray

# TOML has arrays where Python has tuples; their elements stay strict
Place = Annotated[float, Field(ge=-1e6, le=1e6)]
Point = Annotated[tuple[Place, Place], Field(strict=False)]
Length = Annotated[float, Field(ge=1e-6, le=100)]
Angle = Annotated[float, Field(ge=-100.0, le=100.0)]
TIMES = ("period_s", "ramp_s", "stop_s")
Rate = Annotated[
    float, Field(ge=-50, le=50, description="rate, positive counter-clockwise; typically 0.1 to 1")
]


class Reference(Config, ABC):
    """One kind of reference. A subclass declares `kind: Literal["its_name"] = "its_name"`.

    Attributes:
        leads_trains: whether it has the motion of more than one trailer.
    """

    model_config = ConfigDict(json_schema_extra=requires_kind)
    leads_trains: ClassVar[bool] = False
    kind: str

    def faults(self, robot: RobotParameters) -> list[Fault]:
        """What is wrong with these options, together or for this robot; keys within them."""
        del robot
        return []

    def paced(self, pace: float) -> dict[str, float]:
        """Those options with which it is the same way in 1/pace of the time; none: not by options.

        Its rates and speeds are multiplied, its times divided by it.
        """
        given = {name: getattr(self, name) for name in type(self).model_fields}
        faster = {n: v * pace for n, v in given.items() if n.endswith(("rate_rad_s", "speed_m_s"))}
        times = {n: v / pace for n, v in given.items() if n in TIMES and v}
        return faster | times

    @abstractmethod
    def sample(self, time_s: FloatArray, robot: RobotParameters) -> ReferencePath | None:
        """The motion at times (n,) [s], with a batch axis of one; None: nothing to follow.

        Args:
            time_s: rising, and closer than half a turn: angles are unwrapped from one to the next.
            robot: whose trailer shall follow; references without faults for it only.
        """


def kind_of(cls: type[Config]) -> str | None:
    """The name that `kind` is declared to be; None: the class is no kind of its own."""
    names = get_args(cls.model_fields["kind"].annotation)
    return names[0] if names else None


def reference_faults(reference: Reference, robot: RobotParameters) -> list[Fault]:
    """`reference.faults`, of whatever package it is."""
    with guarded(type(reference), "reference.kind", "faults()"):
        return faults_only(reference.faults(robot))


def faults_only(told: object) -> list[Fault]:
    """What code of another package tells as faults.

    Raises:
        TypeError: it is something else.
    """
    if not isinstance(told, list) or not all(isinstance(one, Fault) for one in told):
        raise TypeError("it must return a list of ttwmr_mj.errors.Fault")
    return told


def sampled(
    reference: Reference, time_s: FloatArray, robot: RobotParameters
) -> ReferencePath | None:
    """`reference.sample`, of whatever package it is.

    Raises:
        InputError: another package's raised something, or gave no such motion.
    """
    cls = type(reference)
    if not is_foreign(cls):
        return reference.sample(time_s, robot)
    with guarded(cls, "reference.kind", "sample()"):
        path, again = (reference.sample(time_s.copy(), robot) for _ in range(2))
        if path is None:
            return None
        require_motion(path, time_s, len(robot.trailers))
        if again is None or not path.equals(again):
            raise ValueError("two calls with the same times must return the same motion")
        return path


def sampled_path(reference: Reference, time_s: FloatArray, robot: RobotParameters) -> ReferencePath:
    """`sample`, of a reference that there must be."""
    path = sampled(reference, np.asarray(time_s, dtype=np.float64), robot)
    assert path is not None, "this kind of reference has no motion"
    return path


REFERENCES: Registry[Reference] = Registry(
    "ttwmr_mj.references",
    Reference,  # type: ignore[type-abstract]  # only ever compared with
    kind_of,
    "ttwmr_mj.references",
)
