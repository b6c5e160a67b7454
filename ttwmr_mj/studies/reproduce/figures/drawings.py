"""The figures of the reproduction."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ttwmr_mj.figures.canvas import canvas, legend_below, panel_grid, save, time_axes
from ttwmr_mj.figures.style import BAND, GREEN, ORANGE, REFERENCE, SKY, TRACTOR, TRAILER, VERMILION
from ttwmr_mj.results.curves import trailer_com
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.reproduce.claims import friction
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.figures.figures import FigureSpec
from ttwmr_mj.studies.reproduce.ideal.step_size import STEPS_S

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = (TRACTOR, VERMILION, GREEN, TRAILER, ORANGE, SKY)
WIDTH_IN = 7.2
MOST_ROWS = 900  # of a curve in the file: more than a screen has columns


def draw(wanted: FigureSpec, evidence: Evidence, folder: Path) -> Path:
    """Draw one figure as NAME.svg, whole or not at all; the same results give the same bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    with canvas((WIDTH_IN, 3.2)) as figure:
        DRAWERS[wanted.kind](figure, wanted, evidence)
        return save(figure, folder / f"{wanted.name}.svg")


def _thin(values: FloatArray) -> FloatArray:
    return values[:: max(1, len(values) // MOST_ROWS)]


def _draw_paths(body: str) -> Callable[..., None]:
    """Each run in axes of its own, at one scale: laps that differ would hide each other."""
    colour = TRACTOR if body == "tractor" else TRAILER

    def path(q: FloatArray, robot: Any) -> FloatArray:
        return q[:, :2] if body == "tractor" else trailer_com(q, robot)

    def drawer(figure: Figure, wanted: FigureSpec, evidence: Evidence) -> None:
        shown = [(panel.title, *run) for panel in wanted.panels for run in panel.runs]
        columns = 2 if len(shown) <= 4 else 3 if len(shown) <= 6 else 4
        grid = panel_grid(figure, len(shown), columns, "x [m]")
        for axes, (law, run, label) in zip(grid.flat, shown, strict=False):
            trajectory, robot = evidence.trajectory(run), evidence.robot(run)
            reference = path(trajectory.ref_q[:, 0], robot)
            axes.plot(*_thin(reference).T, **BAND, label="reference")
            line = _thin(path(trajectory.q[:, 0], robot))
            half = len(line) // 2
            axes.plot(
                *line[: half + 1].T, color=colour, linewidth=0.8, alpha=0.5, label="first half"
            )
            axes.plot(*line[half:].T, color=colour, linewidth=1.3, label="second half")
            axes.plot(*line[0], "o", color=colour, markeredgecolor="white", markersize=5)
            axes.set_aspect("equal")
            axes.set_title(f"{law},\n{label}")
        for axes in grid[:, 0]:
            axes.set_ylabel("y [m]")
        width, height = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
        row_in = 0.5 + WIDTH_IN / columns * height / width
        figure.set_size_inches(WIDTH_IN, 0.6 + len(grid) * row_in)
        legend_below(figure, axes=grid[0, 0])

    return drawer


def _draw_over_time(column: str, label: str) -> Callable[..., None]:
    """A column of trajectory.parquet with its reference, or a wheel's speed with its limits."""

    def drawer(figure: Figure, wanted: FigureSpec, evidence: Evidence) -> None:
        axes, is_wheel = time_axes(figure, label), column.startswith("wheel")
        width = 1.0 if is_wheel else None
        for (run, name), colour in zip(wanted.panels[0].runs, COLOURS, strict=False):
            columns = evidence.trajectory(run).to_columns()
            axes.plot(columns["time_s"], columns[column], color=colour, label=name, linewidth=width)
        if is_wheel:
            limit = evidence.robot(run).servo.speed_limit_rad_s
            axes.axhline(limit, **REFERENCE, label="servo's limit")
            axes.axhline(-limit, **REFERENCE)
        else:
            axes.plot(columns["time_s"], columns[f"ref_{column}"], **BAND, label="reference")
        legend_below(figure, axes=axes)

    return drawer


def _draw_phase_plane(figure: Figure, wanted: FigureSpec, evidence: Evidence) -> None:
    del wanted
    study = evidence.study("phase-plane")
    figure.set_size_inches(WIDTH_IN, 3.9)
    axes = figure.subplots()
    e1, e2 = np.meshgrid(np.linspace(-0.6, 0.6, 80), np.linspace(-0.601, 0.6, 80))
    slope = -study["alpha2"] * e2 - study["alpha1"] / study["alpha2"] * (e1 + e1**2 / e2)
    axes.streamplot(e1, e2, e2, slope, color="#CCCCCC", linewidth=0.6, arrowsize=0.6, density=1.1)
    for path in study["paths"]:
        axes.plot(*path, color=TRACTOR, linewidth=1.1)
        axes.plot(path[0][-1], path[1][-1], "o", color=VERMILION, markersize=4, zorder=3)
    ray = study["invariant_ray_1_s"]
    axes.plot([0.6 / ray, -0.6 / ray], [0.6, -0.6], **REFERENCE, label=f"e2 = {ray:.2f}·e1")
    axes.plot([], [], color=TRACTOR, label="solutions of law (32) as printed")
    axes.plot([], [], "o", color=VERMILION, markersize=4, label="where they end: e2 = 0")
    axes.set(xlabel="e1 [m]", ylabel="e2 [m/s]", xlim=(-0.6, 0.6), ylim=(-0.6, 0.6))
    legend_below(figure, axes=axes)


def _draw_step_size(figure: Figure, wanted: FigureSpec, evidence: Evidence) -> None:
    figure.set_size_inches(WIDTH_IN, 5.0)
    grid = figure.subplots(2, 3, sharex=True, sharey=True)
    shades = np.linspace(0.15, 1.0, len(STEPS_S))
    for axes, name in zip(grid.flat, wanted.numbers.studies, strict=True):
        study = evidence.study(name)
        for run, shade in zip(study["runs"], shades, strict=True):
            error = np.clip(run["error_m"], 1e-3, 1e3)
            curve = axes.semilogy(run["time_s"], error, color=TRACTOR, alpha=shade, linewidth=0.9)
            curve[0].set_label(_step(run["step_s"]))
        axes.set_title(study["law"].replace(", ", ",\n", 1))
        axes.set(ylim=(1e-2, 30.0))
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    for axes in grid[:, 0]:
        axes.set_ylabel("|P − P_d| [m]")
    legend_below(figure, columns=4, axes=grid[0, 0])


def _step(step_s: float) -> str:
    return f"{1e3 * step_s:g} ms" if step_s >= 1e-3 else f"{1e6 * step_s:.0f} µs"


def _draw_continuous(figure: Figure, wanted: FigureSpec, evidence: Evidence) -> None:
    del wanted
    left, right = figure.subplots(1, 2)
    cases = evidence.study("continuous")["cases"]
    labels = dict.fromkeys((case["circle"], case["theta2"]) for case in cases)
    colours = dict(zip(labels, COLOURS, strict=False))
    for case in cases:
        colour = colours[case["circle"], case["theta2"]]
        if case["gamma"] == "exact":
            left.plot(case["end_time_s"], case["v_share"][-1], "x", color=colour)
            continue
        label = f"{case['circle']}, {case['theta2']}"
        left.plot(case["time_s"], case["v_share"], color=colour, label=label)
        right.plot(case["time_s"], case["e5_rad"], color=colour, linewidth=1.0)
    left.set(xlabel="time [s]", ylabel="V / V(0)", xlim=(-0.5, 20.0))
    right.set(xlabel="time [s]", ylabel="e5 = θ2 − θ2d [rad]")
    legend_below(figure, columns=2, axes=left)


def _draw_lyapunov(figure: Figure, wanted: FigureSpec, evidence: Evidence) -> None:
    axes = time_axes(figure, "V / V(0)")
    for (run, name), colour in zip(wanted.panels[0].runs, COLOURS, strict=True):
        time_s, v = evidence.lyapunov(run)
        share = np.maximum(v / v[0], 1e-12)
        axes.semilogy(_thin(time_s), _thin(share), color=colour, linewidth=1.0, label=name)
    legend_below(figure, axes=axes)


def _draw_friction(figure: Figure, wanted: FigureSpec, evidence: Evidence) -> None:
    del wanted
    left, right = figure.subplots(1, 2)
    rows, load = friction.balances(evidence)[:-1], friction.largest_load_n_m(evidence)
    torque = np.geomspace(2e-5, 2e-3, 200)
    band = np.arccos(np.minimum(torque / load, 1.0))
    left.fill_between(1e3 * torque, band, np.pi - band, color="#DDDDDD", label="friction can hold")
    friction_mn_m = [1e3 * max(row.friction_n_m, 2e-5) for row in rows]
    angles = [row.hitch_angle_rad for row in rows]
    swings = [0.5 * row.swing_rad for row in rows]
    points = {"fmt": "o", "color": TRAILER, "markersize": 4, "capsize": 2}
    found = "contact physics, mean and range"
    left.errorbar(friction_mn_m, angles, swings, label=found, **points)
    left.axvline(1e3 * load, **REFERENCE)
    left.set(
        xscale="log",
        xlim=(1.5e-2, 2.0),
        xlabel="dry friction T [mN·m] (0 drawn at the left)",
        ylabel="hitch angle [rad]",
        ylim=(-0.3, 3.8),
    )
    right.loglog(friction_mn_m, [1e3 * row.trailer_error_m for row in rows], "o-", color=TRAILER)
    right.axvline(1e3 * load, **REFERENCE, label="m2·l·R·ω²")
    right.set(
        xlabel="dry friction T [mN·m]",
        ylabel="trailer, from straight behind [mm]",
        xlim=(1.5e-2, 2.0),
    )
    legend_below(figure)


DRAWERS: dict[str, Callable[[Figure, FigureSpec, Evidence], None]] = {
    "tractor_paths": _draw_paths("tractor"),
    "trailer_paths": _draw_paths("trailer"),
    "x": _draw_over_time("x_m", "x of P [m]"),
    "y": _draw_over_time("y_m", "y of P [m]"),
    "theta1": _draw_over_time("theta1_rad", "θ1 [rad]"),
    "theta2": _draw_over_time("theta2_rad", "θ2 [rad]"),
    "wheel_right": _draw_over_time("wheel_right_rad_s", "right wheel [rad/s]"),
    "wheel_left": _draw_over_time("wheel_left_rad_s", "left wheel [rad/s]"),
    "phase_plane": _draw_phase_plane,
    "step_size": _draw_step_size,
    "continuous": _draw_continuous,
    "lyapunov": _draw_lyapunov,
    "friction": _draw_friction,
}
