"""References found by trajectory optimisation (`ttwmr_mj.planning`), shipped as tables of knots."""

import io
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Literal, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator
from scipy.interpolate import BSpline, make_interp_spline

from ttwmr_mj.dynamics.flatness import centre_derivatives
from ttwmr_mj.errors import Fault
from ttwmr_mj.files import placed
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.references.shared.reference import Reference
from ttwmr_mj.references.shared.time_law import ORDERS
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

COLUMNS = ("time_s", "x_m", "y_m", "theta1_rad", "theta2_rad")
ENDS = ("as it began", "at rest")
DEGREE = 7  # of the spline through the knots: six continuous derivatives
AT_REST = [(order, np.zeros(4)) for order in (1, 2, 3)]
LENGTH_TOLERANCE_M = 1e-4  # of the swing length; a wrong one moves F by the difference
PLANS = "`ttwmr plan` writes such files; shipped plans have no ending"


def shipped_plans() -> list[str]:
    """Names of the plans in this package."""
    folder = files("ttwmr_mj.references") / "data"
    return sorted(entry.name[:-4] for entry in folder.iterdir() if entry.name.endswith(".csv"))


@dataclass(frozen=True, slots=True)
class Knots:
    """P and both angles at knots."""

    time_s: FloatArray  # (n,) rising from zero
    q: FloatArray  # (n, 4) x, y, θ1, θ2 there, angles unwrapped
    swing_length_m: float  # of the trailer it was made for
    periodic: bool  # it ends where it began, in motion, and goes round; else it ends at rest

    @classmethod
    def read(cls, name: str) -> Self:
        """Read a shipped plan, or a file ending in .csv.

        Raises:
            ValueError: it is not a valid plan; says why.
            OSError: it cannot be read.
        """
        shipped = files("ttwmr_mj.references") / "data" / f"{name}.csv"
        source = Path(name) if name.endswith(".csv") else shipped
        lines = source.read_text(encoding="utf-8").splitlines()
        notes = dict(
            line[2:].split(": ", 1) for line in lines if line.startswith("# ") and ": " in line
        )
        for note in ("swing_length_m", "ends"):
            if note not in notes:
                raise ValueError(f"it lacks the header entry {note}")
        if notes["ends"] not in ENDS:
            raise ValueError(f"its header entry ends is {notes['ends']!r}, not {' or '.join(ENDS)}")
        rows = [line for line in lines if not line.startswith("#")]
        table = np.loadtxt(io.StringIO("\n".join(rows[1:])), delimiter=",")
        if table.ndim != 2 or table.shape[1] != len(COLUMNS) or len(table) <= DEGREE:
            raise ValueError(f"its table is not at least {DEGREE + 1} rows of {', '.join(COLUMNS)}")
        if not (np.isfinite(table).all() and (np.diff(table[:, 0]) > 0.0).all()):
            raise ValueError("its numbers are not all finite, or its times do not increase")
        length = float(notes["swing_length_m"])
        return cls(table[:, 0], table[:, 1:], length, notes["ends"] == ENDS[0])

    @property
    def duration_s(self) -> float:
        """Of the plan, or of one round."""
        return float(self.time_s[-1])

    def orders(self, time_s: FloatArray) -> FloatArray:
        """(ORDERS, n, 4) x, y, θ1, θ2 and their derivatives at times (n,)."""
        spline = self._spline()
        within = time_s if self.periodic else np.minimum(time_s, self.duration_s)
        orders = np.stack([spline(within, order) for order in range(ORDERS)])
        if self.periodic:
            orders[0] += self._turn_rate_rad_s * time_s[:, None]
            orders[1] += self._turn_rate_rad_s
        else:
            orders[1:, time_s > self.duration_s] = 0.0
        return orders

    @property
    def _turn_rate_rad_s(self) -> FloatArray:
        """(4,) that of angles which a round adds whole turns to, over all of it."""
        turns = np.rint((self.q[-1] - self.q[0]) / (2.0 * np.pi)) * [0.0, 0.0, 1.0, 1.0]
        return np.asarray(2.0 * np.pi * turns / self.duration_s)

    def _spline(self) -> BSpline:
        """(4,) x, y, θ1, θ2 over time, without whole turns."""
        if not self.periodic:
            return make_interp_spline(self.time_s, self.q, k=DEGREE, bc_type=(AT_REST, AT_REST))
        q = self.q - self._turn_rate_rad_s * (self.time_s - self.time_s[0])[:, None]
        closed = np.concatenate([q[:-1], q[:1]])  # equal but for rounding: it insists
        spline = make_interp_spline(self.time_s, closed, k=DEGREE, bc_type="periodic")
        spline.extrapolate = "periodic"
        return spline


class Planned(Reference):
    """Plan found by trajectory optimisation: P and both angles.

    Given at knots, a spline in between.

    A plan that ends where it began, in motion, goes round and round; one that ends at rest holds
    its last pose.
    """

    kind: Literal["planned"] = "planned"
    plan: str = Field(
        description="a shipped plan (figure_eight, rest_to_rest, …), or a .csv file written "
        "by `ttwmr plan`"
    )

    @field_validator("plan")
    @classmethod
    def _beside_the_scenario(cls, given: str, info: ValidationInfo) -> str:
        return placed(given, info, PLANS) if given.endswith(".csv") else given

    def faults(self, robot: RobotParameters) -> list[Fault]:
        """No such plan, a damaged one, or one for another robot."""
        key, got = ("plan",), repr(self.plan)
        if not self.plan.endswith(".csv") and self.plan not in shipped_plans():
            allowed = f"{', '.join(shipped_plans())}, or a .csv file of `ttwmr plan`"
            return [Fault(key=key, got=got, allowed=allowed)]
        try:
            plan = Knots.read(self.plan)
        except (ValueError, OSError) as error:
            return [Fault(key=key, got=got, problem=f"is not a valid plan: {error}", hint=PLANS)]
        if abs(plan.swing_length_m - robot.swing_length_m) <= LENGTH_TOLERANCE_M:
            return []
        problem = (
            f"was made for a trailer with l + J2/(m2·l) = {plan.swing_length_m:g} m; this one has "
            f"{robot.swing_length_m:g} m"
        )
        own = f"robot.trailer.com_offset_m={robot.trailer.com_offset_m:g}"
        hint = f"restore robot.trailer, or plan anew: `ttwmr plan waypoints.csv --set {own}`"
        return [Fault(key=key, got=got, problem=problem, hint=hint)]

    def sample(self, time_s: FloatArray, robot: RobotParameters) -> ReferencePath:
        """The reference at times (n,) [s], with a batch axis of one."""
        time_s = np.asarray(time_s, dtype=np.float64)
        orders = Knots.read(self.plan).orders(time_s)
        position = np.moveaxis(orders[..., :2], 0, 1)
        theta = np.moveaxis(orders[..., 2:], 0, 1)
        return ReferencePath(
            time_s=time_s,
            derivatives=position[:, None],
            theta=theta[:, None, 0],
            theta_rate=theta[:, None, 1],
            theta_acceleration=theta[:, None, 2],
            flat_derivatives=centre_derivatives(position, theta[..., 1], robot)[:, None],
        )
