"""A run read back from its folder, and refused where its files cannot be of one run."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from ttwmr_mj.errors import Fault, InputError, apart
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.results.metrics_file import read_metrics
from ttwmr_mj.results.row_stream import read_run, rows_file
from ttwmr_mj.results.trajectory import FOOTING, Trajectory, q_names
from ttwmr_mj.scenario.limits import ESCAPE
from ttwmr_mj.scenario.motion import initial_state, sample_reference
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.scenario.stored.continuity import broken_motion
from ttwmr_mj.scenario.stored.estimates import wrong_estimates
from ttwmr_mj.scenario.stored.resolved import read_resolved
from ttwmr_mj.scenario.stored.wheels import wrong_wheels
from ttwmr_mj.state import FloatArray

# m, rad, and of both in a second: other processors and libraries round otherwise, by some 1e-12,
# and no motion that differs by less is judged otherwise
SAME = 1e-6
LARGEST = 1e9  # rad/s and the like; a law's answer may be as large
COUNTS = ("wheels_on_floor", "labels_found")
TOGETHER = (FOOTING, ("labels_found",))  # NaN in all rows where nothing tells them
HINT = "the file is damaged, or of another run; run the scenario again"


@dataclass(frozen=True, slots=True)
class StoredRun:
    """What a run folder holds of a run, whichever command made it.

    Attributes:
        scenario: that was run.
        rows: as a batch of one; of a run that was killed, those that were written.
        reference: that it is judged by; None without one.
        metrics: what metrics.json says; None where it is missing or damaged.
    """

    scenario: Scenario
    rows: Trajectory
    reference: ReferencePath | None
    metrics: dict[str, Any] | None

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read a run folder.

        Raises:
            InputError: it is none, its scenario is not whole, or its rows cannot be read or be of
                it; with the file's name.
        """
        scenario = read_resolved(folder / "scenario.resolved.toml")
        metrics = None
        with suppress(InputError):
            metrics = read_metrics(folder / "metrics.json")
        run = cls(scenario, read_run(folder), sample_reference(scenario), metrics)
        if (problem := next(run._problems(), None)) is not None:
            fault = Fault(problem=problem, hint=HINT)
            raise InputError(fault, file=str(rows_file(folder)))
        return run

    @property
    def _end_s(self) -> float:
        """When it ended, as far as is known."""
        if self.metrics:
            return float(self.metrics["end_time_s"])
        # where others of its batch went on, its rows hold no estimates from its end on
        told = np.flatnonzero(np.isfinite(self.rows.est_q).all(axis=(1, 2)))
        last = int(told[-1]) if told.size else -1
        return float(self.rows.time_s[min(last + 1, len(self.rows) - 1)])

    @property
    def _reached(self) -> int:
        """Rows before the run ended; in one that failed the last may be anything."""
        if self.metrics is not None and self.metrics["status"] == "ok":
            return len(self.rows)
        half_s = 0.5 * self.scenario.control.sampling_time_s
        return int(np.sum(self.rows.time_s < self._end_s - half_s))

    def _problems(self) -> Iterator[str]:
        """Why the rows cannot be of the scenario; each holds only where those before do not."""
        driven, given = self.rows.q.shape[-1] - 3, len(self.scenario.robot.trailers)
        if driven != given:
            trailers = "1 trailer" if driven == 1 else f"{driven} trailers"
            yield f"is of a robot with {trailers}, and its scenario has {given}"
        yield from self._wrong_times()
        yield from self._wrong_reference()
        yield from self._wrong_values()
        reached = self.rows.rows(0, self._reached)
        start = initial_state(self.scenario, self.reference)
        yield from broken_motion(reached, self.scenario, start, SAME)
        yield from wrong_estimates(reached, self.scenario, SAME)
        yield from wrong_wheels(reached, self.scenario, SAME)

    def _wrong_times(self) -> Iterator[str]:
        """Rows are one per control period, from 0 to where the run ended."""
        time_s, period_s = self.rows.time_s, self.scenario.control.sampling_time_s
        count, whole = len(time_s), self.scenario.periods + 1
        if count > whole:
            yield f"has {count} rows, and a run of its scenario has {whole}"
        expected_s = period_s * np.arange(count)
        if (wrong := np.abs(time_s - expected_s) > SAME * period_s).any():
            k = int(wrong.argmax())
            there, given = apart(time_s[k], expected_s[k])
            yield f"has a row at {there} s where its scenario has one at {given} s"
        if self.metrics is None:
            return
        # driven by hand and stopped at once, a run has one row and a scenario of one period
        stopped = (count, whole, self._end_s) == (1, 2, 0.0)
        if self.metrics["status"] == "ok" and count < whole and not stopped:
            yield f"has {count} of {whole} rows, though metrics.json says that the run was finished"
        beyond_s = self._end_s - time_s[-1]
        if beyond_s > 0.5 * period_s or (self.metrics["status"] == "ok" and -beyond_s > period_s):
            last, end = apart(time_s[-1], self._end_s)
            yield f"ends at {last} s, though metrics.json says that the run went on until {end} s"

    def _wrong_reference(self) -> Iterator[str]:
        """It was written beside the rows, and is sampled again."""
        rows, path, count = self.rows, self.reference, len(self.rows)
        if path is None:
            if not np.isnan(rows.ref_q).all():
                yield "has a reference, and its scenario has none"
            return
        pairs = (rows.ref_q, path.q), (rows.ref_q_rate, path.q_rate)
        for stored, sampled in pairs:
            same = _equal(stored, sampled[:count]).all(axis=(1, 2))
            if not same.all():
                first_s = rows.time_s[same.argmin()]
                yield f"its reference is not that of its scenario, from {first_s:g} s on"

    def _wrong_values(self) -> Iterator[str]:
        """In rows that were reached."""
        rows, reached = self.rows, self._reached
        columns = rows.to_columns()
        unknown = set(rows.signals)
        for names in TOGETHER:
            if all(np.isnan(columns[name][:reached]).all() for name in names):
                unknown.update(names)
        for name, values in columns.items():
            least, most = _range(name, rows.q.shape[-1])
            sound = (least <= values[:reached]) & (values[:reached] <= most)
            if name in COUNTS:
                sound &= values[:reached] == np.rint(values[:reached])
            if name == "measurement_age_s":  # infinite until there is a first measurement
                sound |= values[:reached] == np.inf
            if not sound.all() and name not in unknown and not name.startswith("ref_"):
                k = int(sound.argmin())
                yield f"its column {name} is {values[k]:g} at {rows.time_s[k]:g} s"


def _range(name: str, width: int) -> tuple[float, float]:
    """Least and largest number of a column."""
    if name in (*q_names(width), "height_m"):
        return -ESCAPE, ESCAPE
    if name in COUNTS:
        return 0, 2 if name == "wheels_on_floor" else 2 * (width - 2)  # two labels on each body
    return {
        "measurement_age_s": (-SAME, LARGEST),
        "tilt_rad": (0.0, np.pi),
        "wheel_slip_m_s": (0.0, LARGEST),
    }.get(name, (-LARGEST, LARGEST))


def _equal(one: FloatArray, other: FloatArray) -> Any:
    """Where numbers are the same or both undefined."""
    return (np.abs(one - other) <= SAME) | (np.isnan(one) & np.isnan(other))
