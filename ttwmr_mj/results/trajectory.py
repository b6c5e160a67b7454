"""What happened in a run: one row per control sample, kept as arrays and as Parquet."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from functools import cache
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ttwmr_mj.errors import InputError, MachineError, of_system, require_whole
from ttwmr_mj.files import named
from ttwmr_mj.results.parquet import read_parquet, write_parquet
from ttwmr_mj.state import ArrayFields, BoolArray, FloatArray, RobotState

if TYPE_CHECKING:
    import pyarrow as pa

PER_SAMPLE: dict[str, float | bool] = {  # arrays (n, nsim), each one column → its blank value
    "est_valid": True,
    "measurement_age_s": 0.0,
    "labels_found": np.nan,
    "saturated": False,
    "near_singular": False,
}
# arrays (n, nsim) that older files lack, each one column; NaN on the analytic plants
FOOTING = ("tilt_rad", "height_m", "wheels_on_floor", "wheel_slip_m_s")
# where torques drive the robot: what the law asks of the right and of the left wheel
TORQUE_SIGNALS = ("wheel_torque_right_n_m", "wheel_torque_left_n_m")
MOST = 1e100  # of any number but a law's signals: squares and sums of such are still numbers
PIECE_ROWS = 4_096  # written at a time: an hour in one table takes 80 MB
WIDEST = 2 + 99  # width of q: files of trains may have angles of two digits


def q_names(width: int) -> tuple[str, ...]:
    """Column names of q (..., width): x_m, y_m, theta1_rad, theta2_rad and so on."""
    return ("x_m", "y_m", *(f"theta{i}_rad" for i in range(1, width - 1)))


def rate_names(width: int) -> tuple[str, ...]:
    """Column names of q's rates (..., width): x_rate_m_s to theta2_rate_rad_s and so on."""
    return ("x_rate_m_s", "y_rate_m_s", *(f"theta{i}_rate_rad_s" for i in range(1, width - 1)))


def wheel_names(unit: str) -> tuple[str, ...]:
    """Column names of wheel speeds (..., 2), right and left."""
    return f"wheel_right_{unit}", f"wheel_left_{unit}"


def column_table(width: int) -> dict[str, tuple[str, ...]]:
    """Array of a Trajectory → its column names, in the order of trajectory.parquet.

    Args:
        width: of q, 3 + trailers.
    """
    table = {}
    for prefix in ("", "ref_", "est_"):
        table[f"{prefix}q"] = tuple(prefix + name for name in q_names(width))
        table[f"{prefix}q_rate"] = tuple(prefix + name for name in rate_names(width))
    table["wheel_command_rad_s"] = wheel_names("cmd_rad_s")
    table["wheel_speed_rad_s"] = wheel_names("rad_s")
    return table | {name: (name,) for name in (*PER_SAMPLE, *FOOTING)}


def column_names(width: int) -> tuple[str, ...]:
    """Of trajectory.parquet, without the signals."""
    return ("time_s", *chain.from_iterable(column_table(width).values()))


def is_column_of_a_train(name: str) -> bool:
    """Whether the trajectory of any train has such a column, so that no signal may."""
    return name in _of_all_trains()


@cache
def _of_all_trains() -> frozenset[str]:
    return frozenset(column_names(WIDEST))


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory(ArrayFields):
    """A batch of runs, sampled at the control period; row k is what was true at time_s[k].

    World frame, SI units, angles unwrapped; the columns of q are x, y of P, θ1, θ2 (Eq. 2)
    and the angles of further trailers: width = 3 + trailers.

    Attributes:
        time_s: (n,).
        q, q_rate: (n, nsim, width) the plant's truth.
        ref_q, ref_q_rate: (n, nsim, width) the reference, NaN where it defines none.
        est_q, est_q_rate: (n, nsim, width) what the controller saw.
        wheel_command_rad_s: (n, nsim, 2) commanded from this sample on (right, left).
        wheel_speed_rad_s: (n, nsim, 2) true wheel speeds (right, left).
        est_valid: (n, nsim) False where the sensor reported its estimate as invalid.
        measurement_age_s: (n, nsim) age of the newest measurement in what the controller saw.
        labels_found: (n, nsim) labels the camera found; NaN without a camera.
        saturated: (n, nsim) the command was cut to the servo's range, or at its limit.
        near_singular: (n, nsim) the map from accelerations to wheels was near its singularity.
        tilt_rad, height_m, wheels_on_floor, wheel_slip_m_s: (n, nsim) as of `plants.footing`.
        joint_positions: (n, nsim, nq) MuJoCo's generalized positions; nq = 0 on the analytic plant.
        contact_readings: (n, nsim, 3 + 2·trailers, 15) contact sensors, read by
            `plants.contact_readings`; no contacts (n, nsim, 0, 15) on the analytic plant.
        signals: name with unit → (n, nsim) what the law logs beside its commands.
    """

    time_s: FloatArray
    q: FloatArray
    q_rate: FloatArray
    ref_q: FloatArray
    ref_q_rate: FloatArray
    est_q: FloatArray
    est_q_rate: FloatArray
    wheel_command_rad_s: FloatArray
    wheel_speed_rad_s: FloatArray
    est_valid: BoolArray
    measurement_age_s: FloatArray
    labels_found: FloatArray
    saturated: BoolArray
    near_singular: BoolArray
    tilt_rad: FloatArray
    height_m: FloatArray
    wheels_on_floor: FloatArray
    wheel_slip_m_s: FloatArray
    joint_positions: FloatArray
    contact_readings: FloatArray
    signals: dict[str, FloatArray] = field(default_factory=dict)

    def __len__(self) -> int:
        return int(self.time_s.shape[0])

    @property
    def nsim(self) -> int:
        """Number of simulations."""
        return int(self.q.shape[1])

    @classmethod
    def empty(
        cls, time_s: FloatArray, nsim: int, nq: int = 0, ncontact: int = 0, *, trailers: int = 1
    ) -> Trajectory:
        """Rows for the given times, to be filled in place by the experiment."""
        n = time_s.shape[0]
        blank: dict[str, Any] = {
            name: _blank(n, nsim, len(columns))
            for name, columns in column_table(3 + trailers).items()
        }
        blank |= {name: _blank(n, nsim, value=value) for name, value in PER_SAMPLE.items()}
        blank |= {name: _blank(n, nsim) for name in FOOTING}
        return cls(
            time_s=time_s,
            **blank,
            joint_positions=_blank(n, nsim, nq, value=0.0),
            contact_readings=_blank(n, nsim, ncontact, 15, value=0.0),
        )

    def add_signals(self, names: Iterable[str]) -> None:
        """Blank rows for what a law logs."""
        for name in names:
            self.signals[name] = _blank(len(self), self.nsim)

    @classmethod
    def read(cls, path: Path | str) -> Trajectory:
        """Read a trajectory.parquet, as a batch of one.

        Raises:
            InputError: the file is missing, is no Parquet file, or lacks a column.
        """
        path = named("path", path)
        try:
            table = read_parquet(path)
        except (OSError, ValueError) as error:
            reason = of_system(error) if isinstance(error, OSError) else str(error)
            raise InputError(f"cannot be read as a trajectory: {reason}", file=str(path)) from error
        return cls.of_table(table, str(path))

    @classmethod
    def of_table(cls, table: pa.Table, file: str) -> Trajectory:
        """The trajectory that `to_table` made a table of.

        Args:
            table: of one simulation, `sound`.
            file: where it is from, for the error.

        Raises:
            InputError: it lacks a column or has no rows, a column holds no numbers, too few, too
                large ones or, of yes and no, others than 0 and 1, or its times do not increase.
        """
        names = table.column_names
        # laws of older versions may have a signal that is called theta3_rad
        angles = [re.fullmatch(r"(?:ref|est)_theta(\d{1,2})_rad", name) for name in names]
        width = 2 + max([2, *(int(angle[1]) for angle in angles if angle)])
        known = column_names(width)
        if missing := [n for n in known if n not in {*names, *FOOTING}]:
            cut = [*missing[:5], *(["and others"] if missing[5:] else [])]
            raise InputError(f"not a trajectory: it lacks {', '.join(cut)}", file=file)
        columns = {name: _numbers(table[name], name, file) for name in names}
        if not table.num_rows:
            raise InputError("not a trajectory: it has no rows", file=file)
        rising = np.diff(columns["time_s"][:, 0], prepend=-np.inf) > 0.0
        if not rising.all() or not np.isfinite(columns["time_s"]).all():
            raise InputError("not a trajectory: its times do not increase", file=file)
        for name in filter(columns.__contains__, known):
            beyond = np.isfinite(columns[name]) & (np.abs(columns[name]) > MOST)
            if beyond.any():
                problem = f"its column {name} holds {columns[name][beyond][0]:g}"
                raise InputError(f"not a trajectory: {problem}", file=file)
        unknown = np.full((table.num_rows, 1), np.nan)
        columns |= {name: unknown for name in FOOTING if name not in columns}
        rows: dict[str, Any] = {
            name: np.stack([columns[column] for column in names], axis=-1)
            for name, names in column_table(width).items()
        }
        for name, blank in PER_SAMPLE.items():
            if isinstance(blank, bool) and not np.isin(columns[name], (0.0, 1.0)).all():
                raise InputError(f"not a trajectory: its column {name} is not 0 or 1", file=file)
            rows[name] = columns[name].astype(type(blank))
        rows |= {name: columns[name] for name in FOOTING}
        signals = {name: values for name, values in columns.items() if name not in known}
        empty = cls.empty(columns["time_s"][:, 0], nsim=1, trailers=width - 3)
        return replace(empty, **rows, signals=signals)

    def rows(self, start: int, stop: int) -> Trajectory:
        """Views of rows start to stop."""
        return replace(self._part(np.s_[start:stop]), time_s=self.time_s[start:stop])

    def simulation(self, index: int | None = None) -> Trajectory:
        """Views of one simulation, as a batch of one.

        Args:
            index: which, from 0; may be left out where there is only one.

        Raises:
            InputError: there is no such simulation, or there are several and none is named.
        """
        problem = f"the trajectory has {self.nsim} simulations"
        given = 0 if index is None and self.nsim == 1 else index
        one = require_whole("simulation", given, 0, self.nsim - 1, problem)
        return self._part(np.s_[:, one : one + 1])

    def _part(self, part: Any) -> Trajectory:
        """Views of a part of every array, signals included, but of the times."""
        names = [f.name for f in fields(self) if f.name not in ("time_s", "signals")]
        cut: dict[str, Any] = {name: getattr(self, name)[part] for name in names}
        return replace(self, **cut, signals={name: a[part] for name, a in self.signals.items()})

    def to_columns(self, simulation: int | None = None) -> dict[str, FloatArray]:
        """Column name → (n,) values of one simulation; names carry the units.

        Args:
            simulation: which, from 0; may be left out where there is only one.

        Raises:
            InputError: there is no such simulation, or there are several and none is named.
        """
        one = self.simulation(simulation)
        columns: dict[str, FloatArray] = {"time_s": self.time_s}
        for name, names in column_table(self.q.shape[-1]).items():
            values = getattr(one, name).astype(np.float64, copy=False)
            columns |= zip(names, values.reshape(len(self), len(names)).T, strict=True)
        return columns | {name: values[:, 0] for name, values in one.signals.items()}

    def to_table(self, simulation: int | None = None) -> pa.Table:
        """One simulation as an Arrow table; arguments and errors as `to_columns`."""
        return _table(self.to_columns(simulation))

    def write(self, path: Path | str, simulation: int | None = None) -> None:
        """One simulation as Parquet; arguments and errors as `to_columns`.

        Raises:
            OSError: the file cannot be written; an old one stays as it was.
        """
        path, one = named("path", path), self.simulation(simulation)
        starts = range(0, max(len(one), 1), PIECE_ROWS)
        write_parquet((one.rows(k, k + PIECE_ROWS).to_table() for k in starts), path)

    def to_pandas(self, simulation: int | None = None) -> Any:
        """One simulation as a pandas DataFrame; arguments and errors as `to_columns`.

        Raises:
            MachineError: pandas is not installed.
        """
        try:
            import pandas as pd
        except ImportError as error:
            raise MachineError("to_pandas needs pandas: pip install pandas") from error
        return pd.DataFrame(self.to_columns(simulation))


def _blank(n: int, nsim: int, *shape: int, value: float | bool = np.nan) -> Any:
    """(n, nsim, ...) of one value, every simulation by itself in memory, as if it were alone."""
    return np.full((nsim, n, *shape), value).swapaxes(0, 1)


def _table(columns: dict[str, FloatArray]) -> pa.Table:
    import pyarrow as pa

    return pa.table({name: np.ascontiguousarray(values) for name, values in columns.items()})


def physics_rate_table(
    time_s: FloatArray, state: RobotState, wheel_speed_rad_s: FloatArray
) -> pa.Table:
    """One simulation's state at every physics step, with the same column names.

    Args:
        time_s: (n,) times.
        state: q and rates (n, width).
        wheel_speed_rad_s: (n, 2).
    """
    width = state.q.shape[-1]
    names = ("time_s", *q_names(width), *rate_names(width), *wheel_names("rad_s"))
    values = np.column_stack([time_s, state.q, state.q_rate, wheel_speed_rad_s])
    return _table(dict(zip(names, values.T, strict=True)))


def _numbers(column: Any, name: str, file: str) -> Any:
    """(n, 1) of a column."""
    import pyarrow as pa

    kind = column.type
    flags = pa.types.is_boolean(kind)
    problem = f"not a trajectory: its column {name[:100]}"
    if not (flags or pa.types.is_floating(kind) or pa.types.is_integer(kind)):
        raise InputError(f"{problem} holds no numbers, but {str(kind)[:100]}", file=file)
    if column.null_count:
        gap = column.is_null().to_numpy().argmax()
        without = f"is empty in {column.null_count} of {len(column)} rows"
        raise InputError(f"{problem} {without}, the first of them row {gap}, from 0", file=file)
    return (column if flags else column.cast(pa.float64())).to_numpy()[:, None]
