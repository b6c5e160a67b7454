"""Both robots of a comparison in one scene, and how far they are apart below it."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any, cast
from uuid import uuid4

import mujoco
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings

from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.mjcf import build_model
from ttwmr_mj.recording import style
from ttwmr_mj.recording.blueprint import FOLLOWING_EYE_M, REPORT, WHOLE_RUN
from ttwmr_mj.recording.scene import P_MARKER, TRACTOR_PATH, TRAILER_PATH, Scene, floor_corners
from ttwmr_mj.recording.timeline import TIMELINE, time_column
from ttwmr_mj.results.curves import Curves
from ttwmr_mj.run.build import sample_reference
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.compare.pair import Pair

GHOST = "world/analytic"  # the analytic model's robot
GHOST_RGBA = (0.35, 0.78, 0.51, 0.25)
GHOST_MARGIN_M = 0.0015  # the ghost is a shell around the robot, else the two flicker through
DRIVEN = [
    root + path.removeprefix("world")
    for root in ("world", GHOST)
    for path in (TRACTOR_PATH, TRAILER_PATH)
]
MISS = "world/deviation"
MISS_LONGEST_M = 0.15  # the largest deviation of the run is drawn this long
MISS_HEIGHT_M = 0.08

Lines = tuple[tuple[str, style.Colour], ...]
PLOTS: dict[str, tuple[str, Lines]] = {
    "position": (
        "P, contact − analytic [mm]",
        (("distance", style.TRACTOR), ("ahead", style.REFERENCE), ("aside", style.ESTIMATE)),
    ),
    "angles": (
        "angles, contact − analytic [mrad]",
        (("θ1", style.TRACTOR), ("θ2", style.TRAILER), ("hitch", style.REFERENCE)),
    ),
    "slip": (
        "slip of the wheels [mm/s]",
        (
            ("right, aside", style.RIGHT),
            ("left, aside", style.LEFT),
            ("right, along", style.COMMAND_RIGHT),
            ("left, along", style.COMMAND_LEFT),
        ),
    ),
    "residuals": (
        "energy lost [mJ], trailer's torque missing [10 µN·m]",
        (("energy", style.REFERENCE), ("torque (Eq. 17)", style.TRAILER)),
    ),
}


def record_comparison(pair: Pair, path: Path, summary_markdown: str) -> None:
    """Write the recording.

    Args:
        pair: the two runs; the analytic one is drawn translucent.
        path: the .rrd file, overwritten.
        summary_markdown: for the text panel.

    Raises:
        InputError: the file cannot be created.
    """
    rr.set_strict_mode(True)  # else wrong calls only warn
    scenario = pair.contact.scenario
    reference = sample_reference(scenario)
    floor_m = floor_corners(reference)
    stream = rr.RecordingStream("ttwmr", recording_id=uuid4(), send_properties=False)
    stream.set_log_time_enabled(False)
    try:
        stream.save(path, default_blueprint=_blueprint(scenario.name))
    except RuntimeError as error:
        raise InputError(f"{path}: cannot be written as a recording: {error}") from error
    try:
        stream.send_recording_name(f"{scenario.name}, compared")
        document = rr.TextDocument(summary_markdown, media_type=rr.MediaType.MARKDOWN)
        stream.log(REPORT, document, static=True)
        model = build_model(pair.contact.robot, scenario.plant.contact)
        robot = pair.contact.robot
        rows = pair.contact.trajectory
        now = time_column(rows.time_s)
        real = Scene(stream, model, robot, reference, floor_m)
        real.append(now, rows, Curves.of(rows, robot))
        elsewhere = cast(rr.RecordingStream, _Elsewhere(stream, GHOST))
        ghost = Scene(elsewhere, _ghost_of(model), robot, None, floor_m)
        ghost.append(now, pair.analytic, Curves.of(pair.analytic, robot))
        _log_miss(stream, pair, now)
        _log_plots(stream, pair, now)
    finally:
        stream.disconnect()
        # the stream's threads outlive it otherwise
        rerun_bindings.flush_and_cleanup_orphaned_recordings()


class _Elsewhere:
    """A stream that puts a scene's world under another path, without a floor of its own."""

    def __init__(self, stream: rr.RecordingStream, path: str) -> None:
        self._stream, self._path = stream, path

    def log(self, path: str, *shapes: Any, **options: Any) -> None:
        """As the stream's."""
        if path != "world" and not path.startswith("world/floor"):
            self._stream.log(self._under(path), *shapes, **options)

    def send_columns(self, path: str, *columns: Any) -> None:
        """As the stream's."""
        self._stream.send_columns(self._under(path), *columns)

    def _under(self, path: str) -> str:
        return self._path + path.removeprefix("world")


def _ghost_of(model: mujoco.MjModel) -> mujoco.MjModel:
    """The same robot, a little fatter, translucent and of one colour."""
    ghost = copy.copy(model)
    ghost.geom_size[:] += GHOST_MARGIN_M
    ghost.geom_aabb[:, 3:] += GHOST_MARGIN_M
    ghost.mat_rgba[:] = ghost.geom_rgba[:] = GHOST_RGBA
    return ghost


def _log_miss(stream: rr.RecordingStream, pair: Pair, now: rr.TimeColumn) -> None:
    """An arrow from the analytic P towards the contact robot's, enlarged for the eye."""
    miss = pair.deviation.q[:, :2]
    largest = float(pair.deviation.position_m.max())
    factor = MISS_LONGEST_M / largest if largest > 0.0 else 1.0
    height = np.full(len(miss), MISS_HEIGHT_M)
    stream.log(MISS, rr.Arrows3D.from_fields(colors=[style.ALERT], radii=[0.003]), static=True)
    columns = rr.Arrows3D.columns(
        origins=np.column_stack([pair.analytic.q[:, 0, :2], height]),
        vectors=np.column_stack([factor * miss, np.zeros(len(miss))]),
        labels=[f"deviation × {factor:.0f}"] * len(miss),
    )
    stream.send_columns(MISS, [now], columns)


def _log_plots(stream: rr.RecordingStream, pair: Pair, now: rr.TimeColumn) -> None:
    deviation, residuals = pair.deviation, pair.residuals
    aside, along = residuals.slip_aside_m_s, residuals.slip_along_m_s
    values: dict[str, FloatArray] = {
        "position": 1e3
        * np.column_stack([deviation.position_m, deviation.along_m, deviation.aside_m]),
        "angles": 1e3 * np.column_stack([deviation.q[:, 2:], deviation.hitch_angle_rad]),
        "slip": 1e3 * np.column_stack([aside[:, :2], along[:, :2]]),
        "residuals": np.column_stack(
            [1e3 * residuals.energy_lost_j, 1e5 * residuals.trailer_torque_n_m]
        ),
    }
    for name, (_, lines) in PLOTS.items():
        looks = rr.SeriesLines(names=[n for n, _ in lines], colors=[c for _, c in lines])
        stream.log(f"plots/{name}/true", looks, static=True)
        stream.send_columns(f"plots/{name}/true", [now], rr.Scalars.columns(scalars=values[name]))


def _blueprint(name: str) -> rrb.Blueprint:
    """The scene and the report on top, the deviations below."""
    plots = (
        rrb.TimeSeriesView(origin=f"plots/{plot}", name=title, axis_x=WHOLE_RUN)
        for plot, (title, _) in PLOTS.items()
    )
    so_far = rrb.VisibleTimeRanges(
        rrb.VisibleTimeRange(
            TIMELINE,
            start=rrb.TimeRangeBoundary.infinite(),
            end=rrb.TimeRangeBoundary.cursor_relative(seconds=0.0),
        )
    )
    eye = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=FOLLOWING_EYE_M,
        look_target=(0.0, 0.0, 0.0),
        eye_up=(0.0, 0.0, 1.0),
        tracking_entity=f"/{P_MARKER}",
    )
    above = rrb.Horizontal(
        rrb.Spatial3DView(
            origin="world",
            name="Both robots; the analytic one is translucent",
            eye_controls=eye,
            background=(24, 26, 30),
            line_grid=False,
            overrides=dict.fromkeys(DRIVEN, so_far),
        ),
        rrb.TextDocumentView(origin=REPORT, name=name),
        column_shares=[3, 2],
    )
    return rrb.Blueprint(
        rrb.Vertical(above, rrb.Grid(*plots, grid_columns=2), row_shares=[3, 2]),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )
