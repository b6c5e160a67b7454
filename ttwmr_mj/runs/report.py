"""A run in words: what was run and how it ended, for the terminal and the recording."""

from typing import Any

from ttwmr_mj.errors import in_markdown
from ttwmr_mj.results.verdict import VERDICTS
from ttwmr_mj.scenario.schema import Scenario

# what a run is measured by: where the trailer goes if the reference says where, else where P goes
HEADLINES = {
    "steady_centre_of_oscillation_rmse_m": "trailer's F, rms error, 2nd half",
    "steady_tractor_rmse_m": "P, rms error, 2nd half",
}
RESULT_ROWS = (
    ("steady_centre_of_oscillation_rmse_m", "trailer's F, rms error, 2nd half", 1e3, "mm"),
    ("tractor_rmse_m", "P, rms error", 1e3, "mm"),
    ("steady_tractor_rmse_m", "P, rms error, 2nd half", 1e3, "mm"),
    ("tractor_final_error_m", "P, error at the last sample", 1e3, "mm"),
    ("steady_trailer_rmse_m", "trailer COM, rms error, 2nd half", 1e3, "mm"),
    ("steady_theta1_rmse_rad", "θ1, rms error, 2nd half", 1e3, "mrad"),
    ("steady_theta2_rmse_rad", "θ2, rms error, 2nd half", 1e3, "mrad"),
    ("settling_time_s", "settled (1 cm) after", 1.0, "s"),
    ("wheel_speed_max_rad_s", "fastest wheel", 1.0, "rad/s"),
    ("control_effort", "control effort, ∫ ω_r² + ω_l² dt", 1.0, "rad²/s"),
    ("saturated_share", "saturated samples", 100.0, "%"),
    ("near_singular_share", "samples near the singularity", 100.0, "%"),
    ("control_overruns", "commands slower than the period", 1.0, ""),
    ("control_slowest_s", "slowest command, wall time", 1e3, "ms"),
)


def summary(scenario: Scenario) -> str:
    """What is run, for the recording's text panel."""
    rows = {
        "plant": scenario.plant.kind,
        "controller": scenario.controller.kind,
        "reference": scenario.reference.kind,
        "start": scenario.initial.kind,
        "servo": scenario.robot.servo.preset,
        "control period": f"{scenario.control.sampling_time_s * 1e3:g} ms",
        "duration": f"{scenario.duration_s:g} s",
        "seed": str(scenario.seed),
    }
    return f"# {scenario.name}\n\n{in_markdown(scenario.description)}\n\n{_table('setting', rows)}"


def results(metrics: dict[str, Any]) -> dict[str, str]:
    """What the numbers are → three digits and the unit, or the word undefined."""
    return {
        label: "undefined"
        if metrics[key] is None
        else f"{_three_digits(metrics[key] * scale)} {unit}".rstrip()
        for key, label, scale, unit in RESULT_ROWS
    }


def _three_digits(value: float) -> str:
    """Without an exponent where that is shorter."""
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"


def results_table(metrics: dict[str, Any]) -> str:
    """The same with their names in metrics.json, for a terminal of 80 columns."""
    told = results(metrics)
    lines = (f"{label:33s} {told[label]:>12s}  {key}" for key, label, *_ in RESULT_ROWS)
    return "\n".join(lines)


def verdict_line(metrics: dict[str, Any]) -> str:
    """The verdict with the number and the limit that decided."""
    return f"{VERDICTS[metrics['verdict']][0]}: {metrics['verdict_reason']}"


def headline(metrics: dict[str, Any]) -> str:
    """The metric of the task, under its name in metrics.json; empty where there is none."""
    name = _headline_name(metrics)
    return "" if name is None else f"{name} = {metrics[name]:.3g}"


def headline_words(metrics: dict[str, Any]) -> str:
    """The metric of the task for a person, such as "27 mm trailer, rms error"; empty as above."""
    name = _headline_name(metrics)
    return "" if name is None else f"{1e3 * metrics[name]:.3g} mm: {HEADLINES[name]}"


def _headline_name(metrics: dict[str, Any]) -> str | None:
    return next((name for name in HEADLINES if metrics[name] is not None), None)


def what_ran(scenario: Scenario) -> str:
    """Plant, law, sensing and seed in a line."""
    seen = {"truth": "sees the truth", "camera": "sees by camera"}[scenario.sensing.kind]
    return f"{scenario.plant.kind} · {scenario.controller.kind} · {seen} · seed {scenario.seed}"


def result_text(scenario: Scenario, metrics: dict[str, Any], pace: str = "") -> str:
    """How it ended and what it was, for the recording's text panel.

    Args:
        scenario: what was run.
        metrics: as in metrics.json.
        pace: how the pace was kept, if there was one to keep.
    """
    verdict, number = VERDICTS[metrics["verdict"]][0], headline_words(metrics)
    lines = [
        f"# {verdict[0].upper()}{verdict[1:]}",
        f"## {number}" if number else "",
        in_markdown(metrics["verdict_reason"]),
        in_markdown(scenario.description),
        what_ran(scenario),
        pace,
    ]
    return "\n\n".join(filter(None, lines))


def figure_title(scenario: Scenario, metrics: dict[str, Any]) -> list[str]:
    """Name and verdict, what ran, and the headline, for the run's figure."""
    verdict = VERDICTS[metrics["verdict"]][0]
    lines = [f"{scenario.name}: {verdict}", what_ran(scenario), headline_words(metrics)]
    return list(filter(None, lines))


def details_text(metrics: dict[str, Any]) -> str:
    """The numbers of a run, for the recording."""
    lines = (
        f"**{in_markdown(verdict_line(metrics))}**",
        headline(metrics),
        _table("result", results(metrics)),
    )
    return "\n\n".join(filter(None, lines))


def _table(title: str, rows: dict[str, str]) -> str:
    lines = "\n".join(f"| {key} | {value} |" for key, value in rows.items())
    return f"| {title} | value |\n|---|---|\n{lines}\n"
