"""Every figure of the report: what it shows, and what the article reports of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ttwmr_mj.studies.reproduce import friction
from ttwmr_mj.studies.reproduce.claims.judging import TRACTOR_ERROR, TRAILER_ERROR
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.figures import captions
from ttwmr_mj.studies.reproduce.figures.panels import (
    EIGHT,
    LAB,
    LAB_IN_ONE,
    LAW_32,
    LYAPUNOV_RUNS,
    PID,
    SPRUNG,
    Panel,
)
from ttwmr_mj.studies.reproduce.ideal.studies import STEP_STUDIES


@dataclass(frozen=True, slots=True)
class FigureSpec:
    """One figure.

    Attributes:
        name: as in `--only`.
        title: its heading.
        reported: what the article says it shows.
        found: what our runs show.
        kind: how it is drawn, a key of `drawings.DRAWERS`.
        panels: the runs.
        studies: the studies it needs.
    """

    name: str
    title: str
    reported: str
    found: Callable[[Evidence], str]
    kind: str
    panels: tuple[Panel, ...] = ()
    studies: tuple[str, ...] = ()

    @property
    def runs(self) -> tuple[str, ...]:
        """Names of all runs in it, each once."""
        return tuple(dict.fromkeys(name for panel in self.panels for name, _ in panel.runs))

    @property
    def of_experiment(self) -> bool:
        """Whether the article shows its experiment here, which had a camera in the loop."""
        return any(name.startswith(("lab-", "eight-")) for name in self.runs)


def _path_figure(
    number: int, body: str, where: str, reported: str, panels: tuple[Panel, ...]
) -> FigureSpec:
    """A path in the plane of the tractor or the trailer."""
    metric = TRACTOR_ERROR if body == "tractor" else TRAILER_ERROR
    return FigureSpec(
        f"fig{number}",
        f"Fig. {number}. {body.capitalize()}'s path{where}",
        reported,
        captions.PATHS.get(number, captions.errors(metric, panels)),
        f"{body}_paths",
        panels,
    )


def _lab_figure(
    number: int, title: str, kind: str, reported: str, found: Callable[[Evidence], str]
) -> FigureSpec:
    """One quantity of the laboratory's circle over time."""
    return FigureSpec(f"fig{number}", f"Fig. {number}. {title}", reported, found, kind, LAB_IN_ONE)


_SIMULATED, _ON_SPRING = " under the Lyapunov-PID laws, simulated", " with spring and damper at P"
_EFFORT = "The actuators' effort is very low."
_FIGURES = (
    _path_figure(3, "tractor", ", law (32)", "The tractor follows the circle.", LAW_32),
    _path_figure(4, "trailer", ", law (32)", "The trailer oscillates about its reference.", LAW_32),
    _path_figure(5, "tractor", _ON_SPRING, "The tractor follows the circle.", SPRUNG),
    _path_figure(
        6,
        "trailer",
        _ON_SPRING,
        "The oscillation is gone and the system completely controlled.",
        SPRUNG,
    ),
    _path_figure(7, "tractor", _SIMULATED, "The tractor tracks.", PID),
    _path_figure(8, "trailer", _SIMULATED, "The trailer tracks.", PID),
    _path_figure(11, "tractor", " in the laboratory", "The tractor tracks.", LAB),
    _path_figure(12, "trailer", " in the laboratory", "The trailer tracks.", LAB),
    _lab_figure(13, "x of the tractor", "x", "x tracks.", captions.axis_errors(0)),
    _lab_figure(14, "y of the tractor", "y", "y tracks.", captions.axis_errors(1)),
    _lab_figure(
        15,
        "θ1, the tractor's orientation",
        "theta1",
        "θ1 tracks.",
        captions.angle_errors("steady_theta1_rmse_rad"),
    ),
    _lab_figure(
        16,
        "θ2, the trailer's orientation",
        "theta2",
        "θ2 tracks.",
        captions.angle_errors("steady_theta2_rmse_rad"),
    ),
    _lab_figure(17, "Speed of the right wheel", "wheel_right", _EFFORT, captions.wheels),
    _lab_figure(18, "Speed of the left wheel", "wheel_left", _EFFORT, captions.wheels),
    _path_figure(19, "trailer", " on an eight", "The trailer tracks an eight.", EIGHT),
    FigureSpec(
        "phase-plane",
        "Law (32) in the phase plane (e1, e2)",
        "Theorem 1: every error goes to zero.",
        captions.phase_plane,
        "phase_plane",
        studies=("phase-plane",),
    ),
    FigureSpec(
        "step-size",
        "The published laws on Eq. 31, from 33 ms down to 10 µs",
        "The laws are derived in continuous time and run at 33 ms.",
        captions.step_size,
        "step_size",
        studies=tuple(STEP_STUDIES),
    ),
    FigureSpec(
        "continuous",
        "Laws (47) and (70) in continuous time",
        "Theorem 3: asymptotic stability.",
        captions.continuous,
        "continuous",
        studies=("continuous",),
    ),
    FigureSpec(
        "lyapunov",
        "V(t) along the runs",
        "V' is negative definite (Eq. 36, 46, 52).",
        captions.lyapunov,
        "lyapunov",
        (Panel("", LYAPUNOV_RUNS),),
    ),
    FigureSpec(
        "friction",
        "What would make the trailer follow: friction in the hitch",
        "The trailer tracks in the experiment; its hitch's friction is not mentioned.",
        friction.found,
        "friction",
        (Panel("", tuple((run, "") for run in friction.SWEEP)),),
    ),
)

FIGURES: dict[str, FigureSpec] = {figure.name: figure for figure in _FIGURES}
