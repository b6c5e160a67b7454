"""The figures of a comparison."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ttwmr_mj.figures.canvas import Draw, legend_below, stacked, write_figures
from ttwmr_mj.figures.style import (
    GREY,
    HITCH,
    INK,
    LEFT,
    PATHS_SIZE_IN,
    REFERENCE,
    RIGHT,
    TRACTOR,
    TRAILER,
)
from ttwmr_mj.results.curves import trailer_com
from ttwmr_mj.studies.compare.text import NAMES, SYMBOLS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ttwmr_mj.studies.compare.attribution import Attribution, Contribution
    from ttwmr_mj.studies.compare.convergence import Convergence
    from ttwmr_mj.studies.compare.fit.fit import Fit
    from ttwmr_mj.studies.compare.pair import Pair

SIZE_IN = (5.6, 3.4)
TALL_SIZE_IN = (5.6, 4.6)
WORTHWHILE = 5.0  # a fit should make deviations smaller by at least this factor (README's table)
NOTHING = 5e-4  # share of the total that is shown as 0.0 %


def write_compare_figures(
    pair: Pair,
    folder: Path,
    title: str,
    attribution: Attribution | None = None,
    convergence: Convergence | None = None,
    fit: Fit | None = None,
) -> list[Path]:
    """Draw what was found, NAME.png and NAME.svg each; the same results give the same bytes.

    Args:
        pair: the two runs: paths, deviation, slip, residuals.
        folder: where the files go; made if missing.
        title: of every figure.
        attribution: drawn as bars, if given.
        convergence: deviations over the step, if given.
        fit: by how much deviations fell, if given.
    """
    drawings: dict[str, Draw] = {
        "paths": partial(_draw_paths, pair=pair),
        "deviation": partial(_draw_deviation, pair=pair),
        "slip": partial(_draw_slip, pair=pair),
        "residuals": partial(_draw_residuals, pair=pair),
    }
    if attribution is not None:
        drawings["attribution"] = partial(_draw_attribution, attribution=attribution)
    if convergence is not None:
        drawings["convergence"] = partial(_draw_convergence, convergence=convergence)
    if fit is not None:
        drawings["fit"] = partial(_draw_fit, fit=fit)
    return write_figures(drawings, folder, title, SIZE_IN)


def _draw_paths(figure: Figure, pair: Pair) -> None:
    figure.set_size_inches(PATHS_SIZE_IN)
    axes = figure.subplots()
    robot = pair.contact.robot
    contact, analytic = pair.contact.trajectory.q[:, 0], pair.analytic.q[:, 0]
    axes.plot(*contact[:, :2].T, color=TRACTOR, label="P, contact physics")
    axes.plot(*trailer_com(contact, robot).T, color=TRAILER, label="COM of the trailer")
    axes.plot(*analytic[:, :2].T, **REFERENCE, label="analytic model")
    axes.plot(*trailer_com(analytic, robot).T, **REFERENCE)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    legend_below(figure)


def _draw_deviation(figure: Figure, pair: Pair) -> None:
    figure.set_size_inches(TALL_SIZE_IN)
    deviation = pair.deviation
    upper, lower = figure.subplots(2, sharex=True)
    for values, name, colour in (
        (deviation.position_m, "distance", TRACTOR),
        (deviation.along_m, "ahead", HITCH),
        (deviation.aside_m, "aside", TRAILER),
    ):
        upper.plot(deviation.time_s, 1e3 * values, color=colour, label=name)
    for values, name, colour in (
        (deviation.q[:, 2], "θ1", TRACTOR),
        (deviation.q[:, 3], "θ2", TRAILER),
        (deviation.hitch_angle_rad, "hitch", HITCH),
    ):
        lower.plot(deviation.time_s, 1e3 * values, color=colour, label=name)
    upper.set_ylabel("P, contact −\nanalytic [mm]")
    lower.set(ylabel="angles [mrad]", xlabel="time [s]")
    _beside(upper, lower)


def _draw_slip(figure: Figure, pair: Pair) -> None:
    figure.set_size_inches(TALL_SIZE_IN)
    residuals = pair.residuals
    upper, lower = figure.subplots(2, sharex=True)
    for axes, slip, where in (
        (upper, residuals.slip_along_m_s, "along"),
        (lower, residuals.slip_aside_m_s, "aside"),
    ):
        for wheel, (name, colour) in enumerate((("right", RIGHT), ("left", LEFT))):
            # one curve may hide the other, as both wheels slip aside together
            width = 3.0 if wheel == 0 else 1.0
            axes.plot(
                residuals.time_s, 1e3 * slip[:, wheel], color=colour, linewidth=width, label=name
            )
        axes.set_ylabel(f"wheel slip\n{where} [mm/s]")
    lower.set_xlabel("time [s]")
    _beside(upper, lower)


def _draw_residuals(figure: Figure, pair: Pair) -> None:
    figure.set_size_inches(TALL_SIZE_IN)
    residuals = pair.residuals
    panels = [
        ("Eq. 3: side slip\nof P [mm/s]", 1e3 * residuals.lateral_speed_m_s, TRACTOR),
        ("Eq. 17: torque\nmissing [µN·m]", 1e6 * residuals.trailer_torque_n_m, TRAILER),
        ("energy\nlost [mJ]", 1e3 * residuals.energy_lost_j, HITCH),
    ]
    stacked(figure, residuals.time_s, panels)


def _draw_attribution(figure: Figure, attribution: Attribution) -> None:
    figure.set_size_inches(7.2, 3.4)
    for axes, (quantity, unit) in zip(
        figure.subplots(1, 2, sharey=True), (("position", "mm"), ("theta2", "mrad")), strict=True
    ):
        rows = attribution.tables[quantity][::-1]
        colours = [_bar_colour(row.name) for row in rows]
        bars = axes.barh(
            [NAMES[row.name] for row in rows],
            # a negative nothing would put its label on the names
            [0.0 if _is_nothing(row) else 1e3 * row.size for row in rows],
            color=colours,
        )
        shares = [None if row.share is None else 100.0 * row.share for row in rows]
        labels = ["" if share is None else f"{round(share, 1) + 0.0:.1f} %" for share in shares]
        axes.bar_label(bars, labels, padding=3, fontsize=7.5)
        axes.axvline(0.0, color=INK, linewidth=0.8)
        axes.set_title(f"rms deviation of {SYMBOLS[quantity]} [{unit}]")
        axes.margins(x=0.3)
        axes.locator_params(axis="x", nbins=4)
        axes.grid(axis="y", visible=False)


def _is_nothing(row: Contribution) -> bool:
    return row.share is not None and abs(row.share) < NOTHING


def _bar_colour(name: str) -> str:
    return {"total": INK, "rest": GREY, "higher_interactions": GREY}.get(name, TRACTOR)


def _draw_convergence(figure: Figure, convergence: Convergence) -> None:
    axes = figure.subplots()
    steps = 1e3 * convergence.timestep_s
    for name, label, colour in (
        ("position_deviation_max_m", "P [mm]", TRACTOR),
        ("theta1_deviation_max_rad", "θ1 [mrad]", HITCH),
        ("theta2_deviation_max_rad", "θ2 [mrad]", TRAILER),
    ):
        order = convergence.orders[name]
        label = label if order is None else f"{label}: order {order:.2f}"
        axes.loglog(steps, 1e3 * convergence.deviations[name], "o-", color=colour, label=label)
    axes.set_xticks(steps, [f"{step:g}" for step in steps])
    axes.minorticks_off()
    axes.set(
        xlabel="physics step [ms]; contacts, balls and servo are refined with it",
        ylabel="largest deviation",
    )
    legend_below(figure)


def _draw_fit(figure: Figure, fit: Fit) -> None:
    axes = figure.subplots()
    names = {
        "position_deviation_rms_m": "P, rms",
        "position_deviation_max_m": "P, largest",
        "theta1_deviation_rms_rad": "θ1, rms",
        "theta2_deviation_rms_rad": "θ2, rms",
        "theta2_deviation_max_rad": "θ2, largest",
    }
    place = np.arange(len(names))
    for offset, gain, colour, when in (
        (-0.2, fit.training, GREY, "fitted on"),
        (0.2, fit.validation, TRACTOR, "validated on"),
    ):
        factors = [gain.factor[name] for name in names]
        bars = axes.bar(
            place + offset, factors, 0.38, color=colour, label=f"{when} {gain.scenario}"
        )
        axes.bar_label(bars, [f"{factor:.0f}" for factor in factors], fontsize=7.5)
    worthwhile = f"{WORTHWHILE:g} ×: worth having"
    axes.axhline(WORTHWHILE, label=worthwhile, **REFERENCE | {"linewidth": 0.8})
    axes.set_yscale("log")
    axes.set_xticks(place, list(names.values()))
    axes.set_ylabel("deviation of the plain model per\ndeviation of the fitted one")
    axes.grid(axis="x", visible=False)
    legend_below(figure)


def _beside(*rows: Axes) -> None:
    """Names to the right of the axes, where they hide nothing."""
    for axes in rows:
        axes.margins(x=0.01)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    rows[0].figure.align_ylabels()
