"""Both robots of a comparison in one scene, and how far they are apart below it."""

import copy
from pathlib import Path

import mujoco
import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint import Corner2D

from ttwmr_mj.plants.mjcf import build_model
from ttwmr_mj.recording import layout, style
from ttwmr_mj.recording.floor import floor_corners
from ttwmr_mj.recording.rrd_file import RrdFile
from ttwmr_mj.recording.scene import Scene, driven_paths
from ttwmr_mj.recording.series import Series, SeriesLog, time_column
from ttwmr_mj.results.curves import Curves
from ttwmr_mj.runs.build import sample_reference
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.compare.pair import Pair

GHOST = "world/analytic"  # the analytic model's robot
GHOST_RGBA = (0.35, 0.78, 0.51, 0.25)
GHOST_MARGIN_M = 0.0015  # the ghost is a shell around the robot, else the two flicker through
MISS = "world/deviation"
MISS_LONGEST_M = 0.15  # the largest deviation of the run is drawn this long
MISS_HEIGHT_M = 0.08  # above the robot's deck

# plot → title, curves
PLOTS: dict[str, tuple[str, Series]] = {
    "position": (
        "P, contact − analytic [mm]",
        Series(("distance", "ahead", "aside"), (style.TRACTOR, style.REFERENCE, style.ESTIMATE)),
    ),
    "angles": (
        "angles, contact − analytic [mrad]",
        Series(("θ1", "θ2", "hitch"), (style.TRACTOR, style.TRAILER, style.REFERENCE)),
    ),
    "slip": (
        "slip of the wheels [mm/s]",
        Series(
            ("right, aside", "left, aside", "right, along", "left, along"),
            (style.RIGHT, style.LEFT, style.COMMAND_RIGHT, style.COMMAND_LEFT),
        ),
    ),
    "residuals": (
        "energy lost [mJ], trailer's torque missing [10 µN·m]",
        Series(("energy", "torque (Eq. 17)"), (style.REFERENCE, style.TRAILER)),
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
    name = pair.contact.scenario.name
    with _Recorder(path, f"{name}, compared", _blueprint(name)) as recorder:
        recorder.write(pair, summary_markdown)


class _Recorder(RrdFile):
    """Writes a comparison at once."""

    def write(self, pair: Pair, summary_markdown: str) -> None:
        """Report, both robots, deviations."""
        self._report(summary_markdown)
        scenario, robot, rows = pair.contact.scenario, pair.contact.robot, pair.contact.trajectory
        model = build_model(robot, scenario.plant.contact)
        reference = sample_reference(scenario)
        real = Scene(self._stream, model, robot, reference, floor_corners(reference))
        real.append(rows, Curves.of(rows, robot))
        ghost = Scene(self._stream, _ghost_of(model), robot, root=GHOST)
        ghost.append(pair.analytic, Curves.of(pair.analytic, robot))
        _log_miss(self._stream, pair, time_column(rows.time_s))
        series = SeriesLog(self._stream)
        for name, values in _values(pair).items():
            series.append(f"plots/{name}/true", PLOTS[name][1], rows.time_s, values)


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


def _values(pair: Pair) -> dict[str, FloatArray]:
    """Plot → values (n, curves)."""
    deviation, residuals = pair.deviation, pair.residuals
    slip = residuals.slip_aside_m_s[:, :2], residuals.slip_along_m_s[:, :2]
    lost = 1e3 * residuals.energy_lost_j, 1e5 * residuals.trailer_torque_n_m
    return {
        "position": 1e3 * np.column_stack(list(deviation.position_curves.values())),
        "angles": 1e3 * np.column_stack(list(deviation.angle_curves.values())),
        "slip": 1e3 * np.hstack(slip),
        "residuals": np.column_stack(lost),
    }


def _blueprint(name: str) -> rrb.Blueprint:
    """The scene and the report on top, the deviations below."""
    scene = layout.scene_view(
        "Both robots; the analytic one is translucent",
        layout.following_eye(),
        (*driven_paths(), *driven_paths(GHOST)),
    )
    above = rrb.Horizontal(scene, layout.report_view(name), column_shares=[3, 2])
    plots = (
        layout.plot_view(f"plots/{plot}", title, Corner2D.RightBottom)
        for plot, (title, _) in PLOTS.items()
    )
    below = rrb.Grid(*plots, grid_columns=2)
    return layout.page(rrb.Vertical(above, below, row_shares=[3, 2]))
