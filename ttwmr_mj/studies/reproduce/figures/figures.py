"""Every figure of the report: what it shows, and what the article reports of it."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib import resources

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

Found = Callable[[Evidence], str]
FRICTION = (Panel("", tuple((run, "") for run in friction.SWEEP)),)


@dataclass(frozen=True, slots=True)
class FigureSpec:
    """One figure.

    Attributes:
        name: as in `--only`.
        kind: how it is drawn, a key of `drawings.DRAWERS`.
        found: what our runs show.
        panels: the runs.
        studies: the studies it needs.
        title: its heading (figures.toml).
        reported: what the article says it shows (figures.toml).
    """

    name: str
    kind: str
    found: Found
    panels: tuple[Panel, ...]
    studies: tuple[str, ...]
    title: str
    reported: str

    @property
    def runs(self) -> tuple[str, ...]:
        """Names of all runs in it, each once."""
        return tuple(dict.fromkeys(name for panel in self.panels for name, _ in panel.runs))

    @property
    def of_experiment(self) -> bool:
        """Whether the article shows its experiment here, which had a camera in the loop."""
        return any(name.startswith(("lab-", "eight-")) for name in self.runs)


def _figures() -> Iterator[tuple[str, str, Found, tuple[Panel, ...], tuple[str, ...]]]:
    """Name, kind, what was found, panels and studies of every figure, in the report's order."""
    tractor, trailer = (
        partial(captions.errors, metric) for metric in (TRACTOR_ERROR, TRAILER_ERROR)
    )
    yield "fig3", "tractor_paths", tractor(LAW_32), LAW_32, ()
    yield "fig4", "trailer_paths", captions.free_trailer, LAW_32, ()
    yield "fig5", "tractor_paths", tractor(SPRUNG), SPRUNG, ()
    yield "fig6", "trailer_paths", captions.sprung_trailer, SPRUNG, ()
    yield "fig7", "tractor_paths", tractor(PID), PID, ()
    yield "fig8", "trailer_paths", trailer(PID), PID, ()
    yield "fig11", "tractor_paths", tractor(LAB), LAB, ()
    yield "fig12", "trailer_paths", trailer(LAB), LAB, ()
    yield "fig13", "x", captions.axis_errors(0), LAB_IN_ONE, ()
    yield "fig14", "y", captions.axis_errors(1), LAB_IN_ONE, ()
    yield "fig15", "theta1", captions.angle_errors("steady_theta1_rmse_rad"), LAB_IN_ONE, ()
    yield "fig16", "theta2", captions.angle_errors("steady_theta2_rmse_rad"), LAB_IN_ONE, ()
    yield "fig17", "wheel_right", captions.wheels, LAB_IN_ONE, ()
    yield "fig18", "wheel_left", captions.wheels, LAB_IN_ONE, ()
    yield "fig19", "trailer_paths", trailer(EIGHT), EIGHT, ()
    yield "phase-plane", "phase_plane", captions.phase_plane, (), ("phase-plane",)
    yield "step-size", "step_size", captions.step_size, (), tuple(STEP_STUDIES)
    yield "continuous", "continuous", captions.continuous, (), ("continuous",)
    yield "lyapunov", "lyapunov", captions.lyapunov, (Panel("", LYAPUNOV_RUNS),), ()
    yield "friction", "friction", friction.found, FRICTION, ()


def _read() -> dict[str, FigureSpec]:
    text = (resources.files(__package__) / "figures.toml").read_text(encoding="utf-8")
    words = tomllib.loads(text)
    return {
        name: FigureSpec(name, kind, found, panels, studies, **words[name])
        for name, kind, found, panels, studies in _figures()
    }


FIGURES = _read()
