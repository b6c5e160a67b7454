"""What a reviewer sees on opening a run: the robot on the left, its errors on the right."""

from collections.abc import Iterable, Mapping

import numpy as np
import rerun.blueprint as rrb

from ttwmr_mj.recording import layout
from ttwmr_mj.recording.layout import Range
from ttwmr_mj.recording.plots import PLOTS, STATES, signal_path
from ttwmr_mj.recording.scene.robot import driven_paths
from ttwmr_mj.recording.scene.target import miss_paths
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.state import FloatArray

OVERHEAD_ASPECT = 1.2  # width per height of the view from above
TABS = {  # title → plots
    "Errors": ("position_error", "angle_error", "estimate_error"),
    "Motion": ("x", "y", "theta1", "theta2", "tractor_error", "trailer_error"),
    "Wheels": ("wheel_speed", "hitch_angle"),
    "Estimation": ("estimate_angle_error", "measurement_age"),
}
COLUMNS = {"Motion": 2}  # of plots; one in the other tabs
STATES_TAB = "Wheels"  # below whose plots the states are


def blueprint(
    name: str,
    reference: ReferencePath | None,
    floor_m: FloatArray,
    *,
    camera: bool = False,
    paced: bool = False,
    looks_scale: float = 1.0,
    signals: Iterable[str] = (),
    ranges: Mapping[str, Range] | None = None,
    times_s: Range | None = None,
) -> rrb.Blueprint:
    """The layout.

    Args:
        name: of the run, over its text panel.
        reference: decides which errors exist and get a plot.
        floor_m: (2, 2) lower and upper corner of the floor, to be seen whole from above.
        camera: show the camera's picture and how well the robot is known.
        paced: show where the run fell behind the clock.
        looks_scale: size of the robot relative to Table I's.
        signals: names of what the control law logs, each with a plot in a tab of their own.
        ranges: plot → its smallest and largest value, where they are known.
        times_s: the first and the last time of the run, once they are known.
    """
    none = _empty_plots(reference, camera)
    tabs: list[rrb.Container | rrb.View] = []
    for title, plots in TABS.items():
        shown = [plot for plot in plots if plot not in none]
        views: list[rrb.View] = [_plot(plot, (ranges or {}).get(plot), times_s) for plot in shown]
        if title == STATES_TAB:
            states = (*STATES, *["tracker"] * camera, *["pace"] * paced)
            views.append(layout.states_view(", ".join(states), states, times_s))
        if views:
            tabs.append(rrb.Grid(*views, grid_columns=COLUMNS.get(title, 1), name=title))
    if names := tuple(signals):
        plots_of = (
            layout.plot_view(
                signal_path(s), s, values=(ranges or {}).get(signal_path(s)), times_s=times_s
            )
            for s in names
        )
        tabs.append(rrb.Grid(*plots_of, grid_columns=1 if len(names) < 4 else 2, name="Signals"))
    tabs.append(layout.report_view("Numbers", layout.DETAILS))
    robot = _robot(name, floor_m, looks_scale, camera=camera)
    return layout.page(rrb.Horizontal(robot, rrb.Tabs(*tabs, active_tab=0), column_shares=[3, 2]))


def _robot(name: str, floor_m: FloatArray, looks_scale: float, *, camera: bool) -> rrb.Vertical:
    """The robot from behind; below it from above or in the camera's picture, and the report."""
    robot = layout.scene_view("Robot", layout.following_eye(looks_scale), driven_paths())
    report = layout.report_view(name)
    beside = (
        layout.picture_view("Camera")
        if camera
        else layout.scene_view("From above", _overhead_eye(floor_m), driven_paths(), miss_paths())
    )
    below = rrb.Horizontal(beside, report)
    return rrb.Vertical(robot, layout.key_view(), below, row_shares=[12, 1, 8])


def _plot(name: str, values: Range | None, times_s: Range | None) -> rrb.TimeSeriesView:
    plot = PLOTS[name]
    return layout.plot_view(
        f"plots/{name}", plot.title, plot.legend, values=values, times_s=times_s
    )


def _empty_plots(reference: ReferencePath | None, camera: bool) -> set[str]:
    none = set() if camera else {"estimate_error", *TABS["Estimation"]}
    if reference is None:
        return none | {"position_error", "tractor_error", "trailer_error", "angle_error"}
    return none | ({"trailer_error"} if np.isnan(reference.theta2_rad[:, 0]).all() else set())


def _overhead_eye(floor_m: FloatArray) -> rrb.EyeControls3D:
    """Straight down on the middle of the floor, x right and y up."""
    x, y = floor_m.mean(axis=0)
    width, depth = np.diff(floor_m, axis=0)[0]
    height = max(depth, width / OVERHEAD_ASPECT)  # the eye sees 1.07 m per metre of its height
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=(x, y - 1e-3 * height, height),
        look_target=(x, y, 0.0),
        eye_up=(0.0, 1.0, 0.0),
    )
