"""What happened in a run: one row per control sample, kept as arrays and as Parquet."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ttwmr_mj.errors import InputError, MachineError
from ttwmr_mj.state import BoolArray, FloatArray, RobotState

if TYPE_CHECKING:
    import pyarrow as pa

WHEEL_NAMES = ("wheel_right", "wheel_left")
WHEELS = {"_cmd_rad_s": "wheel_command_rad_s", "_rad_s": "wheel_speed_rad_s"}
FLAGS = ("est_valid", "measurement_age_s", "labels_found", "saturated", "near_singular")


def q_names(width: int) -> tuple[str, ...]:
    """Column names of q (..., width): x_m, y_m, theta1_rad, theta2_rad and so on."""
    return ("x_m", "y_m", *(f"theta{i}_rad" for i in range(1, width - 1)))


def rate_names(width: int) -> tuple[str, ...]:
    """Column names of q's rates (..., width): x_rate_m_s to theta2_rate_rad_s and so on."""
    return ("x_rate_m_s", "y_rate_m_s", *(f"theta{i}_rate_rad_s" for i in range(1, width - 1)))


@dataclass(frozen=True, slots=True)
class Trajectory:
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
        est_valid: (n, nsim) False where the sensor was blind and said so.
        measurement_age_s: (n, nsim) age of the newest measurement in what the controller saw.
        labels_found: (n, nsim) labels the camera found; NaN without a camera.
        saturated: (n, nsim) the command had to be cut to the servo's range.
        near_singular: (n, nsim) the map from accelerations to wheels was near its singularity.
        joint_positions: (n, nsim, nq) MuJoCo's generalized positions; nq = 0 on the analytic plant.
        contact_readings: (n, nsim, 5, 15) contact sensors, see `plants.contact.read_contacts`;
            no contacts (n, nsim, 0, 15) on the analytic plant.
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
        n, width = time_s.shape[0], 3 + trailers

        def unknown(width: int) -> FloatArray:
            return np.full((n, nsim, width), np.nan)

        return cls(
            time_s=time_s,
            q=unknown(width),
            q_rate=unknown(width),
            ref_q=unknown(width),
            ref_q_rate=unknown(width),
            est_q=unknown(width),
            est_q_rate=unknown(width),
            wheel_command_rad_s=unknown(2),
            wheel_speed_rad_s=unknown(2),
            est_valid=np.ones((n, nsim), dtype=np.bool_),
            measurement_age_s=np.zeros((n, nsim)),
            labels_found=np.full((n, nsim), np.nan),
            saturated=np.zeros((n, nsim), dtype=np.bool_),
            near_singular=np.zeros((n, nsim), dtype=np.bool_),
            joint_positions=np.zeros((n, nsim, nq)),
            contact_readings=np.zeros((n, nsim, ncontact, 15)),
        )

    def rows(self, start: int, stop: int) -> Trajectory:
        """Views of rows start to stop."""
        cut: dict[str, Any] = {name: a[start:stop] for name, a in self._arrays().items()}
        signals = {name: a[start:stop] for name, a in self.signals.items()}
        return replace(self, time_s=self.time_s[start:stop], **cut, signals=signals)

    def simulation(self, index: int) -> Trajectory:
        """Views of one simulation, as a batch of one."""
        one = slice(index, index + 1)
        cut: dict[str, Any] = {name: a[:, one] for name, a in self._arrays().items()}
        return replace(self, **cut, signals={name: a[:, one] for name, a in self.signals.items()})

    def _arrays(self) -> dict[str, FloatArray]:
        """Every array with an axis of simulations, but the signals."""
        names = (f.name for f in fields(self) if f.name not in ("time_s", "signals"))
        return {name: getattr(self, name) for name in names}

    @property
    def column_names(self) -> tuple[str, ...]:
        """Of the table, without the signals."""
        blank = Trajectory.empty(self.time_s[:0], 1, trailers=self.q.shape[-1] - 3)
        return tuple(blank.to_columns(0))

    def to_columns(self, simulation: int | None = None) -> dict[str, FloatArray]:
        """Column name → (n,) values of one simulation; names carry the units.

        Args:
            simulation: which; may be left out where there is one.

        Raises:
            InputError: there are several and none is named.
        """
        if simulation is None and self.nsim != 1:
            raise InputError(
                f"the trajectory has {self.nsim} simulations: say which one, simulation=0 to "
                f"{self.nsim - 1}"
            )
        one = {name: values[:, simulation or 0] for name, values in self._arrays().items()}
        columns: dict[str, FloatArray] = {"time_s": self.time_s}
        for prefix in ("", "ref_", "est_"):
            columns |= _state_columns(one[prefix + "q"], one[prefix + "q_rate"], prefix)
        for suffix, name in WHEELS.items():
            columns |= {wheel + suffix: one[name][:, i] for i, wheel in enumerate(WHEEL_NAMES)}
        columns |= {name: one[name].astype(np.float64) for name in FLAGS}
        return columns | {name: a[:, simulation or 0] for name, a in self.signals.items()}

    def to_table(self, simulation: int | None = None) -> pa.Table:
        """One simulation as an Arrow table; arguments and errors as `to_columns`."""
        return _table(self.to_columns(simulation))

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


def _table(columns: dict[str, FloatArray]) -> pa.Table:
    import pyarrow as pa

    return pa.table({name: np.ascontiguousarray(values) for name, values in columns.items()})


def _state_columns(q: FloatArray, q_rate: FloatArray, prefix: str = "") -> dict[str, FloatArray]:
    """Column name → (n,) values, for a state (n, width) and its rates."""
    width = q.shape[-1]
    names, values = (*q_names(width), *rate_names(width)), np.hstack([q, q_rate])
    return {prefix + name: values[:, i] for i, name in enumerate(names)}


def physics_rate_table(
    time_s: FloatArray, state: RobotState, wheel_speed_rad_s: FloatArray
) -> pa.Table:
    """One simulation's state at every physics step, with the same column names.

    Args:
        time_s: (n,) times.
        state: q and rates (n, width).
        wheel_speed_rad_s: (n, 2).
    """
    columns = {"time_s": time_s} | _state_columns(state.q, state.q_rate)
    columns |= {n + "_rad_s": wheel_speed_rad_s[:, i] for i, n in enumerate(WHEEL_NAMES)}
    return _table(columns)


def read_parquet(path: Path) -> Trajectory:
    """Read a trajectory.parquet, as a batch of one.

    Raises:
        InputError: the file is missing, is no Parquet file, or lacks a column.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowInvalid) as error:
        raise InputError(f"cannot be read as a trajectory: {error}", file=str(path)) from error
    angles = [re.fullmatch(r"theta(\d+)_rad", name) for name in table.column_names]
    width = 2 + max([2, *(int(angle[1]) for angle in angles if angle)])

    def columns(names: tuple[str, ...], prefix: str = "") -> FloatArray:
        wanted = [prefix + name for name in names]
        missing = [name for name in wanted if name not in table.column_names]
        if missing:
            raise InputError(
                f"no trajectory.parquet: it lacks {', '.join(missing)}", file=str(path)
            )
        return np.stack([table[name].to_numpy() for name in wanted], axis=-1)[:, None]

    time_s = columns(("time_s",))[:, 0, 0]
    rows = replace(
        Trajectory.empty(time_s, nsim=1, trailers=width - 3),
        q=columns(q_names(width)),
        q_rate=columns(rate_names(width)),
        ref_q=columns(q_names(width), "ref_"),
        ref_q_rate=columns(rate_names(width), "ref_"),
        est_q=columns(q_names(width), "est_"),
        est_q_rate=columns(rate_names(width), "est_"),
        wheel_command_rad_s=columns(tuple(name + "_cmd_rad_s" for name in WHEEL_NAMES)),
        wheel_speed_rad_s=columns(tuple(name + "_rad_s" for name in WHEEL_NAMES)),
        est_valid=columns(("est_valid",))[..., 0] > 0,
        measurement_age_s=columns(("measurement_age_s",))[..., 0],
        labels_found=columns(("labels_found",))[..., 0],
        saturated=columns(("saturated",))[..., 0] > 0,
        near_singular=columns(("near_singular",))[..., 0] > 0,
    )
    signals = [name for name in table.column_names if name not in rows.column_names]
    return replace(rows, signals={name: columns((name,))[..., 0] for name in signals})
