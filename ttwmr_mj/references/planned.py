"""References found by trajectory optimisation (`ttwmr_mj.planning`), shipped as tables of knots."""

from __future__ import annotations

import io
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from pathlib import Path

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from ttwmr_mj.dynamics.flatness import centre_derivatives
from ttwmr_mj.errors import InputError
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.references.shared.time_law import ORDERS
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

COLUMNS = ("time_s", "x_m", "y_m", "theta1_rad", "theta2_rad")
ENDS = ("as it began", "at rest")
DEGREE = 7  # of the spline through the knots: six continuous derivatives
AT_REST = [(order, np.zeros(4)) for order in (1, 2, 3)]
LENGTH_TOLERANCE_M = 1e-4  # of the swing length; a wrong one moves F by the difference


def shipped_plans() -> list[str]:
    """Names of the plans in this package."""
    folder = files("ttwmr_mj.references") / "data"
    return sorted(entry.name[:-4] for entry in folder.iterdir() if entry.name.endswith(".csv"))


@dataclass(frozen=True, kw_only=True)
class Planned:
    """A plan: P and both angles at knots, a spline in between.

    A plan that ends where it began, in motion, goes round and round; one that ends at rest holds
    its last pose.

    Attributes:
        plan: its name among the shipped ones, or a file ending in .csv.
        robot: must have the swing length the plan was made for.

    Raises:
        InputError: there is no such plan, it is damaged, or it was made for another robot.
    """

    plan: str
    robot: RobotParameters

    def __post_init__(self) -> None:
        found = Path(self.plan).is_file() if self.plan.endswith(".csv") else None
        if not (self.plan in shipped_plans() if found is None else found):
            raise InputError(
                f"reference.plan: got {self.plan!r}; allowed: {', '.join(shipped_plans())}, or a "
                "file of python -m ttwmr_mj.planning"
            )
        try:
            length, ends = float(self._notes["swing_length_m"]), self._notes["ends"]
            table = self._table
        except (KeyError, ValueError) as error:  # a note is missing, or no number is one
            raise InputError(self._damaged()) from error
        whole = table.ndim == 2 and table.shape[1] == len(COLUMNS) and len(table) > DEGREE
        sound = whole and np.isfinite(table).all() and (np.diff(table[:, 0]) > 0.0).all()
        if not (sound and ends in ENDS):
            raise InputError(self._damaged())
        if abs(length - self.robot.swing_length_m) > LENGTH_TOLERANCE_M:
            raise InputError(
                f"reference.plan: {self.plan} was made for a trailer with l + J2/(m2·l) = "
                f"{length:g} m, got {self.robot.swing_length_m:g} m: restore robot.trailer, or "
                "make a plan for this robot with ttwmr_mj.planning"
            )

    def _damaged(self) -> str:
        return (
            f"reference.plan: {self.plan} is no plan; allowed: a file of python -m "
            "ttwmr_mj.planning, with its notes (# swing_length_m, # ends) and the columns "
            f"{', '.join(COLUMNS)} of finite numbers, times rising"
        )

    @property
    def duration_s(self) -> float:
        """Of the plan, or of one round."""
        return float(self._table[-1, 0])

    def sample(self, time_s: FloatArray) -> ReferencePath:
        """The reference at times (n,) [s], with a batch axis of one."""
        time_s = np.asarray(time_s, dtype=np.float64)
        within = time_s if self._periodic else np.minimum(time_s, self.duration_s)
        orders = np.stack([self._spline(within, order) for order in range(ORDERS)])
        if not self._periodic:
            orders[1:, time_s > self.duration_s] = 0.0
        position = np.moveaxis(orders[..., :2], 0, 1)
        theta = np.moveaxis(orders[..., 2:], 0, 1)
        return ReferencePath(
            time_s=time_s,
            derivatives=position[:, None],
            theta=theta[:, None, 0],
            theta_rate=theta[:, None, 1],
            theta_acceleration=theta[:, None, 2],
            flat_derivatives=centre_derivatives(position, theta[..., 1], self.robot)[:, None],
        )

    @cached_property
    def _text(self) -> str:
        if self.plan.endswith(".csv"):
            return Path(self.plan).read_text(encoding="utf-8")
        shipped = files("ttwmr_mj.references") / "data" / f"{self.plan}.csv"
        return shipped.read_text(encoding="utf-8")

    @cached_property
    def _notes(self) -> dict[str, str]:
        """The `# key: value` lines above the table."""
        lines = (line[2:] for line in self._text.splitlines() if line.startswith("# "))
        return dict(line.split(": ", 1) for line in lines if ": " in line)

    @cached_property
    def _table(self) -> FloatArray:
        """(n, 5) the columns of COLUMNS."""
        rows = [line for line in self._text.splitlines() if not line.startswith("#")]
        return np.loadtxt(io.StringIO("\n".join(rows[1:])), delimiter=",")

    @property
    def _periodic(self) -> bool:
        return self._notes["ends"] == ENDS[0]

    @cached_property
    def _spline(self) -> BSpline:
        time, values = self._table[:, 0], self._table[:, 1:]
        if not self._periodic:
            return make_interp_spline(time, values, k=DEGREE, bc_type=(AT_REST, AT_REST))
        values[-1] = values[0]  # equal but for rounding; the spline insists
        spline = make_interp_spline(time, values, k=DEGREE, bc_type="periodic")
        spline.extrapolate = "periodic"
        return spline
