"""No reference: open-loop experiments."""

from typing import ClassVar, Literal

from ttwmr_mj.references.shared.reference import Reference
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray


class Nothing(Reference):
    """Nothing to follow: open-loop experiments."""

    leads_trains: ClassVar[bool] = True
    kind: Literal["none"] = "none"

    def sample(self, time_s: FloatArray, robot: RobotParameters) -> None:
        """There is no motion."""
        del time_s, robot
