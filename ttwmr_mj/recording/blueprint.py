"""What a reviewer sees on opening a run: the robot on the left, the plots on the right."""

from collections.abc import Iterable

import numpy as np
import rerun.blueprint as rrb

from ttwmr_mj.recording import layout
from ttwmr_mj.recording.plots import PLOTS, SENSING, signal_path
from ttwmr_mj.recording.scene import driven_paths
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.state import FloatArray

OVERHEAD_ASPECT = 1.2  # width per height of the view from above


def blueprint(
    name: str,
    reference: ReferencePath | None,
    floor_m: FloatArray,
    *,
    camera: bool = False,
    signals: Iterable[str] = (),
) -> rrb.Blueprint:
    """The layout.

    Args:
        name: of the run, over its text panel.
        reference: decides which errors exist and get a plot.
        floor_m: (2, 2) lower and upper corner of the floor, to be seen whole from above.
        camera: show the camera's picture and how well the robot is known.
        signals: names of what the control law logs, each with a plot in a tab of their own.
    """
    apart = {*SENSING, *_empty_plots(reference)}
    tabs = [_tab("Motion", [_plot(plot) for plot in PLOTS if plot not in apart])]
    if camera:
        tabs.append(_tab("Estimation", [_plot(plot) for plot in (*SENSING, "theta1", "theta2")]))
    if signals:
        tabs.append(_tab("Signals", [layout.plot_view(signal_path(s), s) for s in signals]))
    return layout.page(
        rrb.Horizontal(
            _robot(name, floor_m, camera=camera), rrb.Tabs(*tabs) if len(tabs) > 1 else tabs[0]
        )
    )


def _robot(name: str, floor_m: FloatArray, *, camera: bool) -> rrb.Vertical:
    """The robot from behind; below it from above or in the camera's picture, and the report."""
    robot = layout.scene_view("Robot", layout.following_eye(), driven_paths())
    report = layout.report_view(name)
    if camera:
        below = rrb.Horizontal(layout.picture_view("Camera"), report, column_shares=[5, 3])
        return rrb.Vertical(robot, below, row_shares=[1, 1])
    above = layout.scene_view("From above", _overhead_eye(floor_m), driven_paths())
    return rrb.Vertical(robot, rrb.Horizontal(above, report), row_shares=[3, 2])


def _tab(name: str, plots: list[rrb.TimeSeriesView]) -> rrb.Grid:
    """Plots, and the flags below them."""
    flags = layout.states_view("limits and tracker")
    return rrb.Grid(*plots, flags, grid_columns=2, name=name)


def _plot(name: str) -> rrb.TimeSeriesView:
    return layout.plot_view(f"plots/{name}", PLOTS[name].title, PLOTS[name].legend)


def _empty_plots(reference: ReferencePath | None) -> set[str]:
    if reference is None:
        return {"tractor_error", "trailer_error", "angle_error"}
    return {"trailer_error"} if np.isnan(reference.theta2_rad[:, 0]).all() else set()


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
