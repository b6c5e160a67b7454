"""Pieces of a recording's layout that the run's and the studies' blueprints are put together of."""

from collections.abc import Iterable

import numpy as np
import rerun.blueprint as rrb

from ttwmr_mj.recording import style
from ttwmr_mj.recording.scene.key import KEY, KEY_SIZE
from ttwmr_mj.recording.scene.robot import P_MARKER
from ttwmr_mj.recording.series import TIMELINE

REPORT = "report"
DETAILS = "details"
PICTURE = "camera/picture"  # where `camera_view` puts the frames
START, END = rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.infinite()
# By default, plots of more than a minute show a window that travels with the time cursor.
WHOLE_RUN = rrb.TimeAxis(view_range=rrb.TimeRange(start=START, end=END))
# from P of Table I's robot, which is seen over its right shoulder when it drives to +y
FOLLOWING_EYE_M = (-0.32, -0.35, 0.34)
Range = tuple[float, float]
EDGE = 0.04  # share of an axis kept free at both ends, where the viewer would cut a tick's label

LEGEND_SHARE = 0.5  # room over the curves for a legend, relative to what they take


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


def plot_view(
    path: str,
    title: str,
    legend: rrb.Corner2D | None = None,
    *,
    values: Range | None = None,
    times_s: Range | None = None,
) -> rrb.TimeSeriesView:
    """Curves over the whole run.

    Args:
        path: of the entities.
        title: what is plotted, with its unit.
        legend: its corner; None shows none.
        values: the smallest and the largest; None leaves the axis to the viewer, which cuts the
            labels of ticks at its ends.
        times_s: the first and the last; None as for values.
    """
    return rrb.TimeSeriesView(
        origin=path,
        name=title,
        plot_legend=rrb.PlotLegend(legend, visible=legend is not None),
        axis_x=_time_axis(times_s),
        axis_y=None if values is None else rrb.ScalarAxis(range=roomy(_under(legend, values))),
    )


def _under(legend: rrb.Corner2D | None, values: Range) -> Range:
    """The range with room for a legend at the top."""
    low, high = values
    return values if legend is None else (low, high + LEGEND_SHARE * (high - low))


def roomy(values: Range) -> Range:
    """A little more than from the smallest to the largest value, its ends between two ticks."""
    low, high = values
    span = high - low
    if not span > 1e-9 * max(abs(low), abs(high), 1e-9):
        half = 0.5 * abs(low) or 1.0
        return low - half, high + half
    # the viewer's ticks are powers of ten apart
    tick = 10.0 ** (np.floor(np.log10(span)) - 1.0)
    bottom = (np.floor((low - EDGE * span) / tick - 0.5) + 0.5) * tick
    top = (np.ceil((high + EDGE * span) / tick - 0.5) + 0.5) * tick
    return float(bottom), float(top)


def _time_axis(times_s: Range | None) -> rrb.TimeAxis:
    if times_s is None:
        return WHOLE_RUN
    first, last = times_s
    room = EDGE * (last - first)
    return rrb.TimeAxis(
        view_range=rrb.TimeRange(
            start=rrb.TimeRangeBoundary.absolute(seconds=first - room),
            end=rrb.TimeRangeBoundary.absolute(seconds=last + room),
        )
    )


def states_view(
    title: str, names: Iterable[str], times_s: Range | None = None
) -> rrb.StateTimelineView:
    """These states over the whole run; the viewer writes their entities over the lanes."""
    contents = [f"/{name}" for name in names]
    return rrb.StateTimelineView(
        origin="/", contents=contents, name=title, time_view=_time_axis(times_s)
    )


def report_view(title: str, path: str = REPORT) -> rrb.TextDocumentView:
    """A text panel."""
    return rrb.TextDocumentView(origin=path, name=title)


def key_view() -> rrb.Spatial2DView:
    """The strip that says what the colours mean."""
    width, height = KEY_SIZE
    return rrb.Spatial2DView(
        origin=KEY,
        name="key",
        titlebar=False,
        background=style.BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=[0.0, width], y_range=[0.0, height]),
    )


def picture_view(title: str) -> rrb.Spatial2DView:
    """The camera's picture and what is drawn into it."""
    return rrb.Spatial2DView(origin=PICTURE, name=title, background=style.BACKGROUND)


def scene_view(
    title: str, eye: rrb.EyeControls3D, driven: Iterable[str], hidden: Iterable[str] = ()
) -> rrb.Spatial3DView:
    """The world but for what is hidden; the driven paths in it grow up to the time cursor."""
    now = rrb.TimeRangeBoundary.cursor_relative(seconds=0.0)
    so_far = rrb.VisibleTimeRanges(rrb.VisibleTimeRange(TIMELINE, start=START, end=now))
    return rrb.Spatial3DView(
        origin="world",
        contents=["$origin/**", *(f"- /{path}/**" for path in hidden)],
        name=title,
        eye_controls=eye,
        background=style.SKY,
        line_grid=False,
        overrides=dict.fromkeys(driven, so_far),
    )


def following_eye(looks_scale: float = 1.0) -> rrb.EyeControls3D:
    """An eye that travels with P, so far from it that a robot of any size is seen whole."""
    x, y, z = FOLLOWING_EYE_M
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=(looks_scale * x, looks_scale * y, looks_scale * z),
        look_target=(0.0, 0.0, 0.0),
        eye_up=(0.0, 0.0, 1.0),
        tracking_entity=f"/{P_MARKER}",  # must have a shape of its own, a bare transform is ignored
    )
