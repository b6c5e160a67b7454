"""Both robots of a comparison in one scene, and how far they are apart below it."""

import copy
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint import Corner2D

from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.recording import layout, style
from ttwmr_mj.recording.layout import Range
from ttwmr_mj.recording.scene import key
from ttwmr_mj.recording.scene.floor import floor_corners, lift
from ttwmr_mj.recording.scene.key import Entry, draw_key
from ttwmr_mj.recording.scene.robot import Scene, driven_paths, force_scale_m_n
from ttwmr_mj.recording.scene.target import TEXT_HEIGHT_M, distance
from ttwmr_mj.recording.series import Series, SeriesLog, time_column, widened
from ttwmr_mj.recording.stream.live import LiveView
from ttwmr_mj.recording.stream.rrd_file import RrdFile
from ttwmr_mj.results.curves import Curves
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.scenario.motion import sample_reference
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.compare.measures.deviation import Deviation
from ttwmr_mj.studies.compare.pair import Pair
from ttwmr_mj.studies.compare.text import ENERGY_LOST

GHOST = "world/analytic"  # the analytic model's robot
GHOST_RGBA = (0.35, 0.78, 0.51, 0.25)
GHOST_MARGIN_M = 0.0015  # the ghost is a shell around the robot, else the two flicker through
MISS = "world/deviation"
MISS_LONGEST_M = 0.15  # of Table I's robot: the largest deviation of the run is drawn this long
MISS_HEIGHT_M = 0.11  # above the robot's deck

# tab → plot → title, curves
TABS: dict[str, dict[str, tuple[str, Series]]] = {
    "Deviation": {
        "position": (
            "P, contact − analytic [mm]",
            Series(
                ("distance", "ahead", "to the left"), (style.ALERT, style.TRACTOR, style.ESTIMATE)
            ),
        ),
        "angles": (
            "angles, contact − analytic [mrad]",
            Series(("θ1", "θ2", "hitch"), (style.TRACTOR, style.TRAILER, style.REFERENCE)),
        ),
    },
    "Slip": {
        "slip_aside": (
            "slip of the wheels to the side [mm/s]",
            Series(("right", "left"), (style.RIGHT, style.LEFT)),
        ),
        "slip_along": (
            "slip of the wheels along [mm/s]",
            Series(("right", "left"), (style.RIGHT, style.LEFT)),
        ),
    },
    "Residuals": {
        "energy": (f"{ENERGY_LOST} [mJ]", Series(("energy",), (style.REFERENCE,))),
        "torque": (
            "torque missing in the trailer's equation (Eq. 17) [µN·m]",
            Series(("torque",), (style.TRAILER,)),
        ),
    },
}


def record_comparison(
    pair: Pair, path: Path, result_markdown: str, details_markdown: str = ""
) -> None:
    """Write the recording.

    Args:
        pair: the two runs; the analytic one is drawn translucent.
        path: the .rrd file, overwritten.
        result_markdown: for the text panel.
        details_markdown: the numbers, for a tab of their own.

    Raises:
        InputError: the file cannot be created.
    """
    with ComparisonRecorder(path, pair.contact.scenario) as recorder:
        recorder.append(pair.contact.trajectory, pair.analytic)
        recorder.finish(pair, result_markdown, details_markdown)


class ComparisonRecorder(RrdFile):
    """Writes a comparison, both robots while they run; a context manager.

    Args:
        path: the .rrd file, overwritten.
        scenario: what is compared.
        live: shows it while it is written.

    Raises:
        InputError: the file cannot be created.
    """

    def __init__(self, path: Path, scenario: Scenario, live: LiveView | None = None) -> None:
        super().__init__(path, f"{scenario.name}, compared", _blueprint(scenario), live)
        self._scenario, self._robot = scenario, scenario.robot
        model = build_model(self._robot, scenario.plant.contact)
        floor_m = floor_corners(sample_reference(scenario))
        # without the reference's places: here the two robots are each other's reference
        self._real = Scene(self._stream, model, self._robot, None, floor_m)
        self._ghost = Scene(self._stream, _ghost_of(model), self._robot, root=GHOST)
        self._series = SeriesLog(self._stream)

    def append(self, contact: Trajectory, analytic: Trajectory) -> None:
        """Record the next rows of both plants, at the same times."""
        self._check_open()
        self._real.append(contact, Curves.of(contact, self._robot))
        self._ghost.append(analytic, Curves.of(analytic, self._robot))
        self._plot(contact.time_s, _deviations(Deviation.between(contact, analytic)))
        self.flush()

    def finish(self, pair: Pair, result_markdown: str, details_markdown: str) -> None:
        """Record what can be told only of whole runs, and the reports."""
        self._check_open()
        self._report(result_markdown)
        self._report(details_markdown, layout.DETAILS)
        time_s = pair.contact.trajectory.time_s
        _log_miss(self._stream, pair, time_column(time_s))
        self._plot(time_s, _residuals(pair))
        draw_key(self._stream, _key(pair))
        self._show(_blueprint(self._scenario, pair))

    def _plot(self, time_s: FloatArray, values: dict[str, FloatArray]) -> None:
        for plots in TABS.values():
            for name, (_, looks) in plots.items():
                if name in values:
                    self._series.append(f"plots/{name}/true", looks, time_s, values[name])


def _ghost_of(model: mujoco.MjModel) -> mujoco.MjModel:
    """The same robot, a little fatter, translucent and of one colour."""
    ghost = copy.copy(model)
    ghost.geom_size[:] += GHOST_MARGIN_M
    ghost.geom_aabb[:, 3:] += GHOST_MARGIN_M
    ghost.mat_rgba[:] = ghost.geom_rgba[:] = GHOST_RGBA
    return ghost


def _log_miss(stream: rr.RecordingStream, pair: Pair, now: rr.TimeColumn) -> None:
    """An arrow from the analytic P towards the contact robot's, enlarged for the eye."""
    start, scale = pair.analytic.q[:, 0, :2], _scale(pair)
    miss = _factor(pair) * pair.deviation.q[:, :2]
    arrow = rr.Arrows3D.from_fields(colors=[style.ALERT], radii=[scale * 0.003])
    text = rr.Points3D.from_fields(
        colors=[style.INK], radii=rr.Radius.ui_points([0.0]), show_labels=True
    )
    stream.log(MISS, arrow, static=True)
    stream.log(f"{MISS}/text", text, static=True)
    arrows = rr.Arrows3D.columns(
        origins=lift(start, scale * MISS_HEIGHT_M), vectors=lift(miss, 0.0)
    )
    stream.send_columns(MISS, [now], arrows)
    words = [f"P {distance(apart)} apart" for apart in pair.deviation.position_m]
    texts = rr.Points3D.columns(positions=lift(start, scale * TEXT_HEIGHT_M), labels=words)
    stream.send_columns(f"{MISS}/text", [now], texts)


def _factor(pair: Pair) -> float:
    """By which deviations are enlarged in the scene."""
    largest = float(pair.deviation.position_m.max())
    return _scale(pair) * MISS_LONGEST_M / largest if largest > 0.0 else 1.0


def _scale(pair: Pair) -> float:
    return pair.contact.scenario.robot.looks_scale


def _key(pair: Pair) -> list[Entry]:
    return [
        key.TRACTOR,
        key.TRAILER,
        ("analytic robot", style.ESTIMATE, 3.5),
        (f"deviation of P × {float(f'{_factor(pair):.2g}'):,.10g}", style.ALERT, 1.6),
        (f"force, {1e3 * force_scale_m_n(pair.contact.scenario.robot):g} mm/N", style.FORCE, 1.6),
    ]


def _deviations(deviation: Deviation) -> dict[str, FloatArray]:
    """Plot → values (n, curves)."""
    return {
        "position": 1e3 * np.column_stack(list(deviation.position_curves.values())),
        "angles": 1e3 * np.column_stack(list(deviation.angle_curves.values())),
    }


def _residuals(pair: Pair) -> dict[str, FloatArray]:
    """Plot → values (n, curves)."""
    residuals = pair.residuals
    return {
        "slip_aside": 1e3 * residuals.slip_aside_m_s[:, :2],
        "slip_along": 1e3 * residuals.slip_along_m_s[:, :2],
        "energy": 1e3 * residuals.energy_lost_j[:, None],
        "torque": 1e6 * residuals.trailer_torque_n_m[:, None],
    }


def _blueprint(scenario: Scenario, pair: Pair | None = None) -> rrb.Blueprint:
    """The robots and the report on the left, what deviates on the right.

    Args:
        scenario: what is compared.
        pair: the two runs, once they are over: plots reach as far as their values.
    """
    scene = layout.scene_view(
        "Both robots; the analytic one is translucent",
        layout.following_eye(scenario.robot.looks_scale),
        (*driven_paths(), *driven_paths(GHOST)),
    )
    robots = rrb.Vertical(
        scene, layout.key_view(), layout.report_view(scenario.name), row_shares=[12, 1, 7]
    )
    values: dict[str, FloatArray] = {}
    times_s = None
    if pair is not None:
        values = _deviations(pair.deviation) | _residuals(pair)
        time_s = pair.contact.trajectory.time_s
        times_s = float(time_s[0]), float(time_s[-1])
    tabs: list[rrb.Container | rrb.View] = [
        rrb.Grid(*_plots(plots, values, times_s), grid_columns=1, name=tab)
        for tab, plots in TABS.items()
    ]
    tabs.append(layout.report_view("Numbers", layout.DETAILS))
    return layout.page(rrb.Horizontal(robots, rrb.Tabs(*tabs, active_tab=0), column_shares=[3, 2]))


def _plots(
    plots: dict[str, tuple[str, Series]], values: dict[str, FloatArray], times_s: Range | None
) -> Iterator[rrb.TimeSeriesView]:
    for plot, (title, looks) in plots.items():
        legend = Corner2D.RightTop if len(looks.names) > 1 else None
        known = plot in values and np.isfinite(values[plot]).any()
        reach = widened(None, values[plot]) if known else None
        yield layout.plot_view(f"plots/{plot}", title, legend, values=reach, times_s=times_s)
