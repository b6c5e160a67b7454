"""What a reviewer sees on opening a recording: the robot on the left, the plots on the right."""

from __future__ import annotations

import numpy as np
import rerun.blueprint as rrb
from rerun import TimeRange, TimeRangeBoundary

from ttwmr_mj.recording.plots import LYAPUNOV, PLOTS, SENSING
from ttwmr_mj.recording.scene import P_MARKER, TRACTOR_PATH, TRAILER_PATH
from ttwmr_mj.recording.timeline import TIMELINE
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.state import FloatArray

REPORT = "report"
PICTURE = "camera/picture"  # where `camera_view` puts the frames
# By default, plots of more than a minute show a window that travels with the time cursor.
WHOLE_RUN = rrb.TimeAxis(
    view_range=TimeRange(start=TimeRangeBoundary.infinite(), end=TimeRangeBoundary.infinite())
)
FOLLOWING_EYE_M = (-0.36, -0.36, 0.34)  # from P, seen over its right shoulder when it drives to +y
OVERHEAD_ASPECT = 1.2  # width per height of the view from above


def blueprint(
    name: str,
    reference: ReferencePath | None,
    floor_m: FloatArray,
    *,
    camera: bool = False,
    lyapunov: bool = False,
) -> rrb.Blueprint:
    """The layout.

    Args:
        name: of the run, over its text panel.
        reference: decides which errors exist and get a plot.
        floor_m: (2, 2) lower and upper corner of the floor, to be seen whole from above.
        camera: show the camera's picture and how well the robot is known.
        lyapunov: show V and V′ in a tab of their own.
    """
    apart = {*SENSING, *LYAPUNOV, *_empty_plots(reference)}
    text = rrb.TextDocumentView(origin=REPORT, name=name)
    tabs = [_grid("Motion", [plot for plot in PLOTS if plot not in apart])]
    if camera:
        picture = rrb.Spatial2DView(origin=PICTURE, name="Camera", background=(24, 26, 30))
        below = rrb.Horizontal(picture, text, column_shares=[5, 3])
        tabs.append(_grid("Estimation", [*SENSING, "theta1", "theta2"]))
    else:
        above = _scene("From above", _overhead_eye(floor_m))
        below = rrb.Horizontal(above, text)
    if lyapunov:
        tabs.append(_grid("Lyapunov", [*LYAPUNOV, "tractor_error", "wheel_speed"]))
    left = rrb.Vertical(
        _scene("Robot", _following_eye()), below, row_shares=[1, 1] if camera else [3, 2]
    )
    return rrb.Blueprint(
        rrb.Horizontal(left, rrb.Tabs(*tabs) if len(tabs) > 1 else tabs[0]),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def _grid(name: str, plots: list[str]) -> rrb.Grid:
    """Plots over the whole run, and the flags."""
    views = (
        rrb.TimeSeriesView(
            origin=f"plots/{plot}",
            name=PLOTS[plot].title,
            plot_legend=rrb.PlotLegend(PLOTS[plot].legend, visible=PLOTS[plot].legend is not None),
            axis_x=WHOLE_RUN,
        )
        for plot in plots
    )
    flags = rrb.StateTimelineView(origin="flags", name="limits and tracker", time_view=WHOLE_RUN)
    return rrb.Grid(*views, flags, grid_columns=2, name=name)


def _empty_plots(reference: ReferencePath | None) -> set[str]:
    if reference is None:
        return {"tractor_error", "trailer_error", "angle_error"}
    return {"trailer_error"} if np.isnan(reference.theta2_rad[:, 0]).all() else set()


def _scene(name: str, eye: rrb.EyeControls3D) -> rrb.Spatial3DView:
    """A view of the world in which the driven paths grow up to the time cursor."""
    so_far = rrb.VisibleTimeRanges(
        rrb.VisibleTimeRange(
            TIMELINE,
            start=TimeRangeBoundary.infinite(),
            end=TimeRangeBoundary.cursor_relative(seconds=0.0),
        )
    )
    return rrb.Spatial3DView(
        origin="world",
        name=name,
        eye_controls=eye,
        background=(24, 26, 30),
        line_grid=False,
        overrides={TRACTOR_PATH: so_far, TRAILER_PATH: so_far},
    )


def _following_eye() -> rrb.EyeControls3D:
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=FOLLOWING_EYE_M,
        look_target=(0.0, 0.0, 0.0),
        eye_up=(0.0, 0.0, 1.0),
        tracking_entity=f"/{P_MARKER}",  # must have a shape of its own, a bare transform is ignored
    )


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
