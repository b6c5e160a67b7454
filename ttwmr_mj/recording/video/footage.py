"""What a video shows, at its frames' times: read from the files of a run."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ttwmr_mj.errors import InputError, at_least, described
from ttwmr_mj.results.curves import Curves, trailer_com
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.scenario.limits import ESCAPE
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.scenario.stored.run import StoredRun
from ttwmr_mj.state import FloatArray

MOST_FRAMES = 200_000  # two hours of video
FORCES = "/world/contact_forces"  # in the recording, of the run's every row


@dataclass(frozen=True, slots=True)
class Footage:
    """A run as a video shows it.

    Attributes:
        scenario: what was run.
        rows: its trajectory, a row per control sample.
        curves: what follows from it.
        time_s: (n,) simulated times of the frames.
        wheel_angle_rad: (n, 2) of the frames, right and left.
        arrows_m: (n, contacts, 2, 3) origins and vectors of the contact forces' arrows; no
            contacts where none were recorded.
        lacks: what could not be read, in words; empty: nothing.
    """

    scenario: Scenario
    rows: Trajectory
    curves: Curves
    time_s: FloatArray
    wheel_angle_rad: FloatArray
    arrows_m: FloatArray
    lacks: str = ""

    @classmethod
    def of(
        cls, folder: Path, fps: float, speed: float, start_s: float, stop_s: float | None
    ) -> Footage:
        """Read a run folder.

        Args:
            folder: of `ttwmr run` or `ttwmr drive`.
            fps: frames per second of the video.
            speed: simulated seconds per second of the video.
            start_s: simulated time of the first frame.
            stop_s: at most of the last one; None: the run's end.

        Raises:
            InputError: it is no run folder, or the run has no such times.
        """
        if not any(folder.glob("trajectory.*")):
            raise InputError(f"{folder}: no run folder, it has no trajectory.parquet")
        if not 0.0 < speed < float("inf"):
            raise InputError.at("--speed", got=f"{speed:g}", allowed="more than 0")
        if not 0.0 <= start_s < float("inf"):
            raise InputError.at("--start", got=f"{start_s:g}", allowed="0 or more")
        run = StoredRun.read(folder)
        scenario, rows = run.scenario, run.rows
        alive = (np.abs(rows.q[:, 0]) <= ESCAPE).all(axis=1)  # where a run ends it may be far away
        rows = rows if alive.all() else rows.rows(0, int(alive.argmin()))
        last_s = float(rows.time_s[-1]) if len(rows) else 0.0
        stop_s = last_s if stop_s is None else min(stop_s, last_s)
        if not start_s < stop_s:
            problem = f"nothing between {start_s:g} s and {stop_s:g} s, the run has {last_s:g} s"
            raise InputError(problem, file=str(folder))
        if (count := (stop_s - start_s) * fps / speed) > MOST_FRAMES:
            least = (stop_s - start_s) * fps / MOST_FRAMES
            problem = f"makes {count:.3g} pictures of {stop_s - start_s:g} s"
            allowed = f"{at_least(least)}, for {MOST_FRAMES:,} pictures"
            raise InputError.at("--speed", problem, got=f"{speed:g}", allowed=allowed)
        time_s = start_s + np.arange(0.0, stop_s - start_s + 1e-9, speed / fps)
        steps = np.diff(rows.time_s, prepend=rows.time_s[0])[:, None]
        turned = np.cumsum(rows.wheel_speed_rad_s[:, 0] * steps, axis=0)
        arrows_m, lacks = _arrows(folder / "run.rrd", time_s)
        return cls(
            scenario,
            rows,
            Curves.of(rows, scenario.robot),
            time_s,
            _at(time_s, rows.time_s, turned),
            arrows_m,
            lacks,
        )

    def at(self, values: FloatArray) -> FloatArray:
        """Values (rows, ...) of the run, at the frames (n, ...)."""
        flat = values.reshape(len(self.rows), -1)
        return _at(self.time_s, self.rows.time_s, flat).reshape(-1, *values.shape[1:])

    @property
    def q(self) -> FloatArray:
        """(n, 3 + trailers) where the robot is at the frames."""
        return self.at(self.rows.q[:, 0])

    def paths_m(self) -> dict[str, FloatArray]:
        """Name → (rows, 2) path on the floor; NaN where there is none."""
        rows, robot = self.rows, self.scenario.robot
        return {
            "reference": rows.ref_q[:, 0, :2],
            "trailer reference": trailer_com(rows.ref_q[:, 0], robot),
            "tractor": rows.q[:, 0, :2],
            "trailer": trailer_com(rows.q[:, 0], robot),
        }


def _at(time_s: FloatArray, known_s: FloatArray, values: FloatArray) -> FloatArray:
    """Values (rows, m) at other times, interpolated; (n, m)."""
    return np.column_stack([np.interp(time_s, known_s, column) for column in values.T])


def _arrows(recording: Path, time_s: FloatArray) -> tuple[FloatArray, str]:
    """The arrows of the forces; none, and why, where the recording is damaged."""
    try:
        with warnings.catch_warnings(action="ignore"):  # that a file has no table of contents
            return _read_arrows(recording, time_s), ""
    except Exception as error:  # whatever Rerun's reader makes of a file that is cut off
        why = described(error).splitlines()[0]
        return np.zeros((len(time_s), 0, 2, 3)), f"no forces, {recording} is damaged: {why}"


def _read_arrows(recording: Path, time_s: FloatArray) -> FloatArray:
    """The arrows (n, contacts, 2, 3) of the rows just before the frames."""
    none = np.zeros((len(time_s), 0, 2, 3))
    if not recording.is_file():
        return none
    from rerun.chunk import RrdReader

    known_s, arrows = [], []
    for chunk in RrdReader(str(recording)).stream().filter(content=FORCES).to_chunks():
        batch = chunk.to_record_batch()
        if "Arrows3D:vectors" not in batch.schema.names:
            continue
        known_s += [1e-9 * t for t in batch.column("sim_time").cast("int64").to_pylist()]
        ends = (batch.column(f"Arrows3D:{part}").to_pylist() for part in ("origins", "vectors"))
        arrows += [np.stack(pair, axis=1) for pair in zip(*map(list, ends), strict=True)]
    if not arrows:
        return none
    order = np.argsort(known_s)
    before = np.searchsorted(np.array(known_s)[order], time_s + 1e-6, side="right") - 1
    return np.asarray(np.array(arrows, dtype=np.float64)[order][np.maximum(before, 0)])
