"""What every reference is: options of a scenario that know the motion they describe."""

from abc import ABC, abstractmethod
from typing import Annotated, ClassVar, get_args

import numpy as np
from pydantic import Field

from ttwmr_mj.errors import Fault
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.registry import Registry
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


def sampled_path(reference: Reference, time_s: FloatArray, robot: RobotParameters) -> ReferencePath:
    """`sample`, of a reference that there must be."""
    path = reference.sample(np.asarray(time_s, dtype=np.float64), robot)
    assert path is not None, "this kind of reference has no motion"
    return path


REFERENCES: Registry[Reference] = Registry(
    "ttwmr_mj.references",
    Reference,  # type: ignore[type-abstract]  # only ever compared with
    kind_of,
    "ttwmr_mj.references",
)
