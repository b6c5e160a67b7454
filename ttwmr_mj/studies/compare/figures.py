"""The figures of a comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ttwmr_mj.figures.canvas import Draw, legend_below, stacked, write_figures
from ttwmr_mj.figures.scales import plain_log
from ttwmr_mj.figures.style import (
    BAND,
    GREEN,
    GREY,
    HITCH,
    INK,
    LEFT,
    PATHS_SIZE_IN,
    REFERENCE,
    RIGHT,
    SKY,
    TRACTOR,
    TRAILER,
    VERMILION,
)
from ttwmr_mj.results.curves import trailer_com
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.compare.explain.attribution import TRAILERS, unit_of
from ttwmr_mj.studies.compare.text import NAMES, percent, symbols_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ttwmr_mj.studies.compare.explain.attribution import Attribution, Contribution
    from ttwmr_mj.studies.compare.explain.convergence import Convergence
    from ttwmr_mj.studies.compare.fit.fit import Fit
    from ttwmr_mj.studies.compare.pair import Pair

SIZE_IN = (5.6, 3.4)
TALL_SIZE_IN = (5.6, 4.6)
WORTHWHILE = 5.0  # a fit should make deviations smaller by at least this factor (README's table)
NOTHING = 5e-4  # share of the total that is shown as 0.0 %
STACK_COLOURS = {
    "servo": TRACTOR,
    "contact_compliance": VERMILION,
    "wheel_width": GREEN,
    "caster_inertia": HITCH,
    "rolling_resistance": SKY,
    "hitch_friction": TRAILER,
    "timestep": "#7A2E00",
    "higher_interactions": "#AAAAAA",
    "rest": GREY,
}
TRAILER_COLOURS = (TRAILER, TRACTOR, GREEN, SKY, VERMILION)
TITLES = {
    "paths": "paths",
    "deviation": "contact physics less analytic model",
    "slip": "slip of the wheels over the floor",
    "residuals": "what the equations leave over",
    "attribution": "what the deviation is made of",
    "contributions": "what the deviation is made of, over time",
    "convergence": "the physics step refined",
    "fit": "gain of the fitted model",
}
BAR_COLOURS = {"total": INK, "rest": GREY, "higher_interactions": GREY}


def write_compare_figures(
    pair: Pair,
    folder: Path,
    title: str,
    attribution: Attribution | None = None,
    convergence: Convergence | None = None,
    fit: Fit | None = None,
) -> list[Path]:
    """Draw what was found, NAME.png and NAME.svg each; the same results give the same bytes.

    Of the pair, paths, deviation, slip and residuals; the studies where they are given. The folder
    is made if missing, and every figure has the title.
    """
    drawings: dict[str, Draw] = {
        "paths": partial(_draw_paths, pair=pair),
        "deviation": partial(_draw_deviation, pair=pair),
        "slip": partial(_draw_slip, pair=pair),
        "residuals": partial(_draw_residuals, pair=pair),
    }
    if attribution is not None:
        drawings["attribution"] = partial(_draw_attribution, attribution=attribution)
        drawings["contributions"] = partial(_draw_contributions, attribution=attribution)
    if convergence is not None:
        drawings["convergence"] = partial(_draw_convergence, convergence=convergence)
    if fit is not None:
        drawings["fit"] = partial(_draw_fit, fit=fit)
    files: list[Path] = []
    for name, draw in drawings.items():
        files += write_figures({name: draw}, folder, f"{title}: {TITLES[name]}", SIZE_IN)
    return files


def _draw_paths(figure: Figure, pair: Pair) -> None:
    figure.set_size_inches(PATHS_SIZE_IN)
    axes = figure.subplots()
    robot = pair.contact.robot
    contact, analytic = pair.contact.trajectory.q[:, 0], pair.analytic.q[:, 0]
    axes.plot(*analytic[:, :2].T, **BAND, label="analytic model")
    axes.plot(*trailer_com(analytic, robot).T, **BAND)
    axes.plot(*contact[:, :2].T, color=TRACTOR, label="P, contact physics")
    axes.plot(*trailer_com(contact, robot).T, color=TRAILER, label="COM of the trailer")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    legend_below(figure)


def _draw_deviation(figure: Figure, pair: Pair) -> None:
    deviation = pair.deviation
    panels: dict[str, tuple[dict[str, FloatArray], tuple[str, ...]]] = {
        "P, contact −\nanalytic [mm]": (deviation.position_curves, (TRACTOR, HITCH, TRAILER)),
        "angles [mrad]": (deviation.angle_curves, (TRACTOR, TRAILER, HITCH)),
    }
    if (more := len(deviation.angle_curves) - 3) > 0:  # of a train: all angles, no hitch
        angles = {name: curve for name, curve in deviation.angle_curves.items() if name != "hitch"}
        colours = (TRACTOR, TRAILER, GREEN, VERMILION, SKY, GREY)[: 2 + more]
        panels["angles [mrad]"] = (angles, colours)
    _over_time(figure, deviation.time_s, panels, (1.5,) * 6, 1e3)


def _draw_slip(figure: Figure, pair: Pair) -> None:
    slip = {"along": pair.residuals.slip_along_m_s, "aside": pair.residuals.slip_aside_m_s}
    panels = {
        f"wheel slip\n{where} [µm/s]": ({"right": v[:, 0], "left": v[:, 1]}, (RIGHT, LEFT))
        for where, v in slip.items()
    }
    # one curve may hide the other, as both wheels slip aside together
    _over_time(figure, pair.residuals.time_s, panels, (3.0, 1.0), 1e6)


def _over_time(
    figure: Figure,
    time_s: FloatArray,
    panels: Mapping[str, tuple[dict[str, FloatArray], Sequence[str]]],
    widths: Sequence[float],
    scale: float,
) -> None:
    """Named curves, scaled, one panel below the other: label → curves and colours."""
    figure.set_size_inches(TALL_SIZE_IN)
    rows = figure.subplots(len(panels), sharex=True)
    for axes, (label, (curves, colours)) in zip(rows, panels.items(), strict=True):
        for (name, values), colour, width in zip(curves.items(), colours, widths, strict=False):
            axes.plot(time_s, scale * values, color=colour, linewidth=width, label=name)
        axes.set_ylabel(label)
        axes.margins(x=0.01)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))  # where it hides nothing
    rows[-1].set_xlabel("time [s]")
    figure.align_ylabels()


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
    symbols = symbols_of(attribution.tables)
    lines = -(-len(symbols) // 2)
    figure.set_size_inches(7.2, 3.4 * lines)
    places = figure.subplots(lines, 2, sharey=True).ravel()
    for unused in places[len(symbols) :]:
        unused.set_axis_off()
    for axes, (quantity, symbol) in zip(places, symbols.items(), strict=False):
        rows = attribution.tables[quantity][::-1]
        bars = axes.barh(
            [NAMES[row.name] for row in rows],
            # a negative nothing would put its label on the names
            [0.0 if _is_nothing(row) else 1e3 * row.size for row in rows],
            color=[BAR_COLOURS.get(row.name, TRACTOR) for row in rows],
        )
        axes.bar_label(bars, [percent(row.share) for row in rows], padding=3, fontsize=7.5)
        axes.axvline(0.0, color=INK, linewidth=0.8)
        axes.set_title(f"rms deviation of {symbol} [m{unit_of(quantity)}]")
        axes.margins(x=0.3)
        axes.locator_params(axis="x", nbins=4)
        axes.grid(axis="y", visible=False)


def _is_nothing(row: Contribution) -> bool:
    return row.share is not None and abs(row.share) < NOTHING


def _draw_contributions(figure: Figure, attribution: Attribution) -> None:
    """What each effect adds at every instant, stacked: above zero, or below if it takes away."""
    symbols = symbols_of(attribution.curves)
    figure.set_size_inches(7.2, 1.2 + 1.7 * len(symbols))
    rows = figure.subplots(len(symbols), sharex=True, squeeze=False)[:, 0]
    time_s = attribution.time_s
    for axes, (quantity, symbol) in zip(rows, symbols.items(), strict=True):
        curves = {name: 1e3 * values for name, values in attribution.curves[quantity].items()}
        total = curves.pop("total")
        above, below = np.zeros_like(total), np.zeros_like(total)
        for name, values in curves.items():
            colour = STACK_COLOURS[name]
            for base, part in ((above, values.clip(0.0)), (below, values.clip(max=0.0))):
                axes.fill_between(time_s, base, base + part, color=colour, linewidth=0)
                base += part
            axes.fill_between([], [], color=colour, label=NAMES[name])
        axes.plot(time_s, total, color=INK, linewidth=1.2, label="what was measured")
        axes.axhline(0.0, color=INK, linewidth=0.6)
        axes.set_ylabel(f"deviation of {symbol}\n[m{unit_of(quantity)}]")
        axes.margins(x=0.01)
    rows[-1].set_xlabel("time [s]")
    figure.align_ylabels()
    legend_below(figure, columns=3, axes=rows[0])


def _draw_convergence(figure: Figure, convergence: Convergence) -> None:
    figure.set_size_inches(7.2, 3.2)
    steps = 1e3 * convergence.timestep_s
    kinds = {
        "P [mm]": (("position_deviation_max_m", "P", TRACTOR),),
        "angles [mrad]": (
            ("theta1_deviation_max_rad", "θ1", HITCH),
            *(
                (key, symbol, colour)
                for colour, (name, symbol) in zip(TRAILER_COLOURS, TRAILERS.items(), strict=True)
                if (key := f"{name}_deviation_max_rad") in convergence.deviations
            ),
        ),
    }
    for axes, (kind, lines) in zip(figure.subplots(1, 2), kinds.items(), strict=True):
        for name, label, colour in lines:
            order = convergence.orders[name]
            label = label if order is None else f"{label}: order {order:.2f}"
            axes.loglog(steps, 1e3 * convergence.deviations[name], "o-", color=colour, label=label)
        axes.set_xticks(steps, [f"{step:g}" for step in steps])
        axes.minorticks_off()
        plain_log(axes.yaxis, axes.get_ylim())
        axes.set(xlabel="physics step [ms]", ylabel=f"largest deviation of {kind}")
        axes.legend()


def _draw_fit(figure: Figure, fit: Fit) -> None:
    axes = figure.subplots()
    names = ["P, rms", "P, largest", "θ1, rms"]  # as in fit.MEASURES
    trailers = range(2, 2 + (len(fit.training.plain) - len(names)) // 2)
    names += [f"θ{i}, {what}" for i in trailers for what in ("rms", "largest")]
    place = np.arange(len(names))
    for offset, gain, colour, when in (
        (-0.2, fit.training, GREY, "fitted on"),
        (0.2, fit.validation, TRACTOR, "validated on"),
    ):
        factors, label = list(gain.factor.values()), f"{when} {gain.scenario}"
        bars = axes.bar(place + offset, factors, 0.38, color=colour, label=label)
        axes.bar_label(bars, [f"{factor:.0f}" for factor in factors], fontsize=7.5)
    worthwhile = f"{WORTHWHILE:g} ×: worth having"
    axes.axhline(WORTHWHILE, label=worthwhile, **REFERENCE | {"linewidth": 0.8})
    axes.set_yscale("log")
    axes.set_xticks(place, names)
    axes.set_ylabel("deviation of the plain model per\ndeviation of the fitted one")
    axes.grid(axis="x", visible=False)
    legend_below(figure)
