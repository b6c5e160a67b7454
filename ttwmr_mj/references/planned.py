"""References found by trajectory optimisation (`ttwmr_mj.planning`), shipped as tables of knots."""

import io
import math
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator
from scipy.interpolate import BSpline, make_interp_spline

from ttwmr_mj.dynamics.flatness import centre_derivatives
from ttwmr_mj.dynamics.train import constants
from ttwmr_mj.errors import Fault, cut
from ttwmr_mj.files import placed
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.references.shared.reference import Reference
from ttwmr_mj.references.shared.time_law import ORDERS
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

ENDS = ("as it began", "at rest")
DEGREE = 7  # of the spline through the knots: six continuous derivatives
LARGEST = 1e6  # m, rad or s
SHORTEST_S = 1e-3  # between knots
LENGTH_TOLERANCE_M = 1e-4  # of lengths below; a wrong swing length moves F by the difference
# m or rad between first and last row of a round: four decimals of both leave as much of an angle,
# and a robot of 0.1 m/s is as far on in SHORTEST_S, so that one row that is missing is noticed
CLOSED = 1e-4
# of a plan's top speeds, in its first and last step: as planned it is below 0.01, with every
# fourth row of that 0.03; of what does not move at all, m/s or rad/s that rounding may leave
AT_REST, STANDING = 0.05, 1e-3
ONE_LENGTH, LENGTHS = "swing_length_m", "lengths_m"  # header entries of one trailer, of several
PLANS = "`ttwmr plan` writes such files; shipped plans have no ending"


def shipped_plans() -> list[str]:
    """Names of the plans in this package."""
    folder = files("ttwmr_mj.references") / "data"
    return sorted(entry.name[:-4] for entry in folder.iterdir() if entry.name.endswith(".csv"))


def columns(trailers: int) -> tuple[str, ...]:
    """Of a plan's table."""
    return "time_s", "x_m", "y_m", *(f"theta{i}_rad" for i in range(1, trailers + 2))


def motion_lengths(robot: RobotParameters) -> FloatArray:
    """(n²,) A_ij/b_i of `dynamics.train` [m], on which alone depends how free trailers move.

    Of one trailer that is k, its swing length.
    """
    train = constants(robot)
    return np.ravel(train.size_kg_m2 / train.moment_kg_m[:, None])


def lengths_entry(robot: RobotParameters) -> str:
    """What a plan's header says of the robot it is for."""
    if len(robot.trailers) == 1:
        return f"{ONE_LENGTH}: {robot.swing_length_m!r}"
    return f"{LENGTHS}: {' '.join(f'{length:.9g}' for length in motion_lengths(robot))}"


@dataclass(frozen=True, slots=True)
class Knots:
    """P and all angles at knots."""

    time_s: FloatArray  # (n,) rising from zero
    q: FloatArray  # (n, 3 + trailers) x, y, θ1, θ2, … there, angles unwrapped
    lengths_m: FloatArray  # `motion_lengths` of the robot it was made for
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
        lines = source.read_text(encoding="utf-8-sig").splitlines()
        notes = dict(
            line[2:].split(": ", 1) for line in lines if line.startswith("# ") and ": " in line
        )
        given = notes.get(LENGTHS, notes.get(ONE_LENGTH))
        if given is None or "ends" not in notes:
            raise ValueError(f"it lacks the header entry {'ends' if given else ONE_LENGTH}")
        lengths = np.array([float(length) for length in given.split()])
        count = math.isqrt(lengths.size)
        if count == 0 or count**2 != lengths.size or not np.isfinite(lengths).all():
            raise ValueError(f"its header entry {LENGTHS} is not n² lengths of n trailers")
        names = columns(count)
        if notes["ends"] not in ENDS:
            raise ValueError(f"its header entry ends is {notes['ends']!r}, not {' or '.join(ENDS)}")
        rows = [line for line in lines if not line.startswith("#")]
        if len(rows) < 2:
            raise ValueError("it has no table")
        if (called := _header(rows[0])) != names:
            got = cut(", ".join(called))
            raise ValueError(f"its columns are called {got}, and must be {', '.join(names)}")
        table = np.loadtxt(io.StringIO("\n".join(rows[1:])), delimiter=",")
        if table.ndim != 2 or table.shape[1] != len(names) or len(table) <= DEGREE:
            raise ValueError(f"its table is not at least {DEGREE + 1} rows of {', '.join(names)}")
        if not (np.abs(table) <= LARGEST).all():
            raise ValueError(f"its numbers are not all finite and below {LARGEST:g}")
        if table[0, 0] != 0.0 or not (np.diff(table[:, 0]) >= SHORTEST_S).all():
            raise ValueError(f"its times do not increase from 0 by {SHORTEST_S:g} s or more")
        plan = cls(table[:, 0], table[:, 1:], lengths, notes["ends"] == ENDS[0])
        if fault := plan._open_round() if plan.periodic else plan._moving_end():
            raise ValueError(f"its header says that it ends {notes['ends']}, and {fault}")
        return plan

    @property
    def duration_s(self) -> float:
        """Of the plan, or of one round."""
        return float(self.time_s[-1])

    def orders(self, time_s: FloatArray) -> FloatArray:
        """(ORDERS, n, 3 + trailers) x, y, θ1, θ2, … and their derivatives at times (n,)."""
        spline = self._spline()
        within = time_s if self.periodic else np.minimum(time_s, self.duration_s)
        orders = np.stack([spline(within, order) for order in range(ORDERS)])
        if self.periodic:
            orders[0] += self._turn_rate_rad_s * time_s[:, None]
            orders[1] += self._turn_rate_rad_s
        else:
            orders[1:, time_s > self.duration_s] = 0.0
        return orders

    def _open_round(self) -> str:
        """What of a round does not end as it began, in words; empty: nothing."""
        apart = np.abs(self.q[-1] - self.q[0] - self._turn_rate_rad_s * self.duration_s)
        worst = int(apart.argmax())
        if apart[worst] <= CLOSED:
            return ""
        name, _, unit = columns(self.q.shape[1] - 3)[1 + worst].rpartition("_")
        away = f"{apart[worst]:.3g} {unit} away from that of its first"
        return f"{name} of its last row is {away}: {_cut_or_not_rad(unit)}"

    def _moving_end(self) -> str:
        """What of a way from rest to rest moves at an end, in words; empty: nothing."""
        rates = np.abs(np.diff(self.q, axis=0) / np.diff(self.time_s)[:, None])
        of_p, of_angles = np.hypot(rates[:, 0], rates[:, 1]), rates[:, 2:].max(axis=1)
        for what, unit, rate in (("P moves", "m/s", of_p), ("an angle turns", "rad/s", of_angles)):
            allowed = max(AT_REST * rate.max(), STANDING)
            for step, end in ((-1, "last"), (0, "first")):
                if rate[step] > allowed:
                    moving = f"{what} at {rate[step]:.3g} {unit} in its {end} step"
                    return f"{moving}, and must rest at both ends: {_cut_or_not_rad(unit)}"
        return ""

    @property
    def _turn_rate_rad_s(self) -> FloatArray:
        """(3 + trailers,) that of angles which a round adds whole turns to, over all of it."""
        turns = np.rint((self.q[-1] - self.q[0]) / (2.0 * np.pi))
        turns[:2] = 0.0
        return np.asarray(2.0 * np.pi * turns / self.duration_s)

    def _spline(self) -> BSpline:
        """(3 + trailers,) x, y, θ1, θ2, … over time, without whole turns."""
        if not self.periodic:
            at_rest = [(order, np.zeros(self.q.shape[1])) for order in (1, 2, 3)]
            return make_interp_spline(self.time_s, self.q, k=DEGREE, bc_type=(at_rest, at_rest))
        q = self.q - self._turn_rate_rad_s * (self.time_s - self.time_s[0])[:, None]
        closed = np.concatenate([q[:-1], q[:1]])  # equal but for rounding: it insists
        spline = make_interp_spline(self.time_s, closed, k=DEGREE, bc_type="periodic")
        spline.extrapolate = "periodic"
        return spline


def _cut_or_not_rad(unit: str) -> str:
    """What may be wrong with a table whose end is not as it should be."""
    angles = ", or its angles may be in degrees or jump by a turn" if "rad" in unit else ""
    return f"the file may be cut off{angles}"


def _header(line: str) -> tuple[str, ...]:
    """The names in a table's first row, whatever program wrote them."""
    return tuple(name.strip(" \t\"'") for name in line.split(","))


class Planned(Reference):
    """Plan found by trajectory optimisation: P and all angles.

    Given at knots, a spline in between.

    A plan that ends where it began, in motion, goes round and round; one that ends at rest holds
    its last pose.
    """

    leads_trains: ClassVar[bool] = True
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
        return self._other_robot(plan, robot)

    def _other_robot(self, plan: Knots, robot: RobotParameters) -> list[Fault]:
        key, got, count = ("plan",), repr(self.plan), plan.q.shape[1] - 3
        lengths = motion_lengths(robot)
        hint = "restore robot.trailers, or make a plan for this robot: `ttwmr plan`"
        if count != len(robot.trailers):
            problem = f"was made for {count} trailer{'s'[: count - 1]}, not {len(robot.trailers)}"
        elif np.abs(plan.lengths_m - lengths).max() <= LENGTH_TOLERANCE_M:
            return []
        elif count == 1:
            problem = (
                f"was made for a trailer with l + J2/(m2·l) = {plan.lengths_m[0]:g} m; this one "
                f"has {lengths[0]:g} m"
            )
            hint = (
                "restore robot.trailer, or plan anew with the same --set: `ttwmr plan "
                "waypoints.csv --scenario ...`, which takes the robot of a scenario"
            )
        else:
            problem = (
                "was made for trailers of other lengths, masses or hitches: A_ij/b_i differ by "
                f"up to {np.abs(plan.lengths_m - lengths).max():.3g} m"
            )
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
            flat_derivatives=centre_derivatives(position, theta[..., 1:], robot)[:, None],
        )
