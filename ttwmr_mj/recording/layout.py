"""Pieces of a recording's layout that the run's and the studies' blueprints are put together of."""

from collections.abc import Iterable

import rerun.blueprint as rrb

from ttwmr_mj.recording import style
from ttwmr_mj.recording.scene import P_MARKER
from ttwmr_mj.recording.series import TIMELINE

REPORT = "report"
PICTURE = "camera/picture"  # where `camera_view` puts the frames
START, END = rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.infinite()
# By default, plots of more than a minute show a window that travels with the time cursor.
WHOLE_RUN = rrb.TimeAxis(view_range=rrb.TimeRange(start=START, end=END))
FOLLOWING_EYE_M = (-0.36, -0.36, 0.34)  # from P, seen over its right shoulder when it drives to +y


def page(content: rrb.Container) -> rrb.Blueprint:
    """A layout without the viewer's panels, but for the time cursor."""
    return rrb.Blueprint(
        content,
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        rrb.SelectionPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def plot_view(path: str, title: str, legend: rrb.Corner2D | None = None) -> rrb.TimeSeriesView:
    """Curves over the whole run; without a corner for the legend there is none."""
    shown = rrb.PlotLegend(legend, visible=legend is not None)
    return rrb.TimeSeriesView(origin=path, name=title, plot_legend=shown, axis_x=WHOLE_RUN)


def states_view(title: str) -> rrb.StateTimelineView:
    """The states under flags/ over the whole run."""
    return rrb.StateTimelineView(origin="flags", name=title, time_view=WHOLE_RUN)


def report_view(title: str) -> rrb.TextDocumentView:
    """The text panel."""
    return rrb.TextDocumentView(origin=REPORT, name=title)


def picture_view(title: str) -> rrb.Spatial2DView:
    """The camera's picture and what is drawn into it."""
    return rrb.Spatial2DView(origin=PICTURE, name=title, background=style.BACKGROUND)


def scene_view(title: str, eye: rrb.EyeControls3D, driven: Iterable[str]) -> rrb.Spatial3DView:
    """The world; the driven paths in it grow up to the time cursor."""
    now = rrb.TimeRangeBoundary.cursor_relative(seconds=0.0)
    so_far = rrb.VisibleTimeRanges(rrb.VisibleTimeRange(TIMELINE, start=START, end=now))
    return rrb.Spatial3DView(
        origin="world",
        name=title,
        eye_controls=eye,
        background=style.BACKGROUND,
        line_grid=False,
        overrides=dict.fromkeys(driven, so_far),
    )


def following_eye() -> rrb.EyeControls3D:
    """An eye that travels with P."""
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=FOLLOWING_EYE_M,
        look_target=(0.0, 0.0, 0.0),
        eye_up=(0.0, 0.0, 1.0),
        tracking_entity=f"/{P_MARKER}",  # must have a shape of its own, a bare transform is ignored
    )
