"""Every figure of the report: what it shows, and what the article reports of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ttwmr_mj.studies.reproduce import friction
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
class Figure:
    """One figure.

    Attributes:
        name: as in `--only`.
        title: its heading.
        reported: what the article says it shows.
        found: what our runs show.
        kind: how it is drawn, a key of `reproduce_figures.DRAWERS`.
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


_FIGURES = (
    Figure(
        "fig3",
        "Fig. 3. Tractor's path, law (32)",
        "The tractor follows the circle.",
        captions.errors(captions.TRACTOR, LAW_32),
        "tractor_paths",
        LAW_32,
    ),
    Figure(
        "fig4",
        "Fig. 4. Trailer's path, law (32)",
        "The trailer oscillates about its reference.",
        captions.swing,
        "trailer_paths",
        LAW_32,
    ),
    Figure(
        "fig5",
        "Fig. 5. Tractor's path with spring and damper at P",
        "The tractor follows the circle.",
        captions.errors(captions.TRACTOR, SPRUNG),
        "tractor_paths",
        SPRUNG,
    ),
    Figure(
        "fig6",
        "Fig. 6. Trailer's path with spring and damper at P",
        "The oscillation is gone and the system completely controlled.",
        captions.sprung,
        "trailer_paths",
        SPRUNG,
    ),
    Figure(
        "fig7",
        "Fig. 7. Tractor's path under the Lyapunov-PID laws, simulated",
        "The tractor tracks.",
        captions.errors(captions.TRACTOR, PID),
        "tractor_paths",
        PID,
    ),
    Figure(
        "fig8",
        "Fig. 8. Trailer's path under the Lyapunov-PID laws, simulated",
        "The trailer tracks.",
        captions.errors(captions.TRAILER, PID),
        "trailer_paths",
        PID,
    ),
    Figure(
        "fig11",
        "Fig. 11. Tractor's path in the laboratory",
        "The tractor tracks.",
        captions.errors(captions.TRACTOR, LAB),
        "tractor_paths",
        LAB,
    ),
    Figure(
        "fig12",
        "Fig. 12. Trailer's path in the laboratory",
        "The trailer tracks.",
        captions.errors(captions.TRAILER, LAB),
        "trailer_paths",
        LAB,
    ),
    Figure(
        "fig13", "Fig. 13. x of the tractor", "x tracks.", captions.axis_errors(0), "x", LAB_IN_ONE
    ),
    Figure(
        "fig14", "Fig. 14. y of the tractor", "y tracks.", captions.axis_errors(1), "y", LAB_IN_ONE
    ),
    Figure(
        "fig15",
        "Fig. 15. θ1, the tractor's orientation",
        "θ1 tracks.",
        captions.angle_errors("steady_theta1_rmse_rad", "rad"),
        "theta1",
        LAB_IN_ONE,
    ),
    Figure(
        "fig16",
        "Fig. 16. θ2, the trailer's orientation",
        "θ2 tracks.",
        captions.angle_errors("steady_theta2_rmse_rad", "rad"),
        "theta2",
        LAB_IN_ONE,
    ),
    Figure(
        "fig17",
        "Fig. 17. Speed of the right wheel",
        "The actuators' effort is very low.",
        captions.wheels,
        "wheel_right",
        LAB_IN_ONE,
    ),
    Figure(
        "fig18",
        "Fig. 18. Speed of the left wheel",
        "The actuators' effort is very low.",
        captions.wheels,
        "wheel_left",
        LAB_IN_ONE,
    ),
    Figure(
        "fig19",
        "Fig. 19. Trailer's path on an eight",
        "The trailer tracks an eight.",
        captions.errors(captions.TRAILER, EIGHT),
        "trailer_paths",
        EIGHT,
    ),
    Figure(
        "phase-plane",
        "Law (32) in the phase plane (e1, e2)",
        "Theorem 1: every error goes to zero.",
        captions.phase_plane,
        "phase_plane",
        studies=("phase-plane",),
    ),
    Figure(
        "step-size",
        "The published laws on Eq. 31, from 33 ms down to 10 µs",
        "The laws are derived in continuous time and run at 33 ms.",
        captions.step_size,
        "step_size",
        studies=tuple(STEP_STUDIES),
    ),
    Figure(
        "continuous",
        "Laws (47) and (70) in continuous time",
        "Theorem 3: asymptotic stability.",
        captions.continuous,
        "continuous",
        studies=("continuous",),
    ),
    Figure(
        "lyapunov",
        "V(t) along the runs",
        "V' is negative definite (Eq. 36, 46, 52).",
        captions.lyapunov,
        "lyapunov",
        (Panel("", LYAPUNOV_RUNS),),
    ),
    Figure(
        "friction",
        "What would make the trailer follow: friction in the hitch",
        "The trailer tracks in the experiment; its hitch's friction is not mentioned.",
        friction.found,
        "friction",
        (Panel("", tuple((run, "") for run in friction.SWEEP)),),
    ),
)

FIGURES: dict[str, Figure] = {figure.name: figure for figure in _FIGURES}
