"""What we found in each figure, in words with numbers from the runs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ttwmr_mj.studies.reproduce.claims.judging import TRAILER_ERROR, mm
from ttwmr_mj.studies.reproduce.evidence import Evidence, second_half
from ttwmr_mj.studies.reproduce.figures.panels import LAW_32, LYAPUNOV_RUNS, SPRUNG, Panel
from ttwmr_mj.studies.reproduce.ideal.step_size import DURATION_S, GRIP_M_S2
from ttwmr_mj.studies.reproduce.ideal.studies import STEP_STUDIES


def errors(metric: str, panels: tuple[Panel, ...]) -> Callable[[Evidence], str]:
    """A sentence with one error per run."""

    def found(evidence: Evidence) -> str:
        parts = [
            f"{panel.title or 'runs'}: "
            + ", ".join(f"{mm(evidence.value(run, metric))} ({label})" for run, label in panel.runs)
            for panel in panels
        ]
        return "Steady rms error, second half. " + "; ".join(parts) + "."

    return found


def free_trailer(evidence: Evidence) -> str:
    """Fig. 4: the free trailer."""
    free = evidence.hitch_swing("law32-omitted-contact")
    return (
        f"It swings by {free:.2f} rad peak to peak for as long as we look, about the outward "
        "direction. "
        + errors(TRAILER_ERROR, LAW_32)(evidence)
        + " (Against a trailer straight behind "
        "the tractor; the article does not say what its reference is.)"
    )


def sprung_trailer(evidence: Evidence) -> str:
    """Fig. 6: the trailer on its spring."""
    still = evidence.hitch_swing("spring-printed-omitted-contact")
    return f"It follows, its hitch moving by {still:.1g} rad. " + errors(TRAILER_ERROR, SPRUNG)(
        evidence
    )


def angle_errors(metric: str) -> Callable[[Evidence], str]:
    """Figs. 15-16: an angle's error with and without the correction."""

    def found(evidence: Evidence) -> str:
        bad, good = evidence.value("lab-pid", metric), evidence.value("lab-pid-without", metric)
        return f"Steady rms error {bad:.2g} rad under law (70), {good:.2g} rad without it."

    return found


def axis_errors(column: int) -> Callable[[Evidence], str]:
    """Figs. 13-14: a coordinate's error with and without the correction."""

    def found(evidence: Evidence) -> str:
        errors = []
        for run in ("lab-pid", "lab-pid-without"):
            trajectory = evidence.trajectory(run)
            miss = second_half(trajectory.q - trajectory.ref_q)[:, 0, column]
            errors.append(mm(float(np.sqrt(np.mean(miss**2)))))
        return f"Steady rms error {errors[0]} under law (70), {errors[1]} without it."

    return found


def wheels(evidence: Evidence) -> str:
    """Figs. 17-18: how often a wheel is at its limit."""
    cut = evidence.value("lab-pid", "saturated_share")
    calm = evidence.trajectory("lab-pid-without")
    last = float(calm.time_s[calm.saturated[:, 0]].max(initial=0.0))
    return (
        f"Law (70) has a wheel at its limit in {100 * cut:.0f} % of the samples; law (32) without "
        f"e²/ė only in the start, for the last time after {last:.1f} s."
    )


def phase_plane(evidence: Evidence) -> str:
    """Where solutions of law (32) end."""
    study = evidence.study("phase-plane")
    return (
        f"24 starts, each followed until e2 = 0 (dots): all arrive within "
        f"{max(study['end_time_s']):.2f} s, with e1 ≠ 0. Only the ray e2 = "
        f"{study['invariant_ray_1_s']:.3g}·e1 leads to the origin. On e2 = 0 the law has no value "
        "and pushes back from both sides: the error stops."
    )


def step_size(evidence: Evidence) -> str:
    """What is left at the end, at steps that should be small enough."""
    ends = {}
    for name, law in STEP_STUDIES.items():
        runs = evidence.study(name)["runs"]
        ends[law] = [r["final_error_m"] for r in runs if r["step_s"] <= 1e-4]
    limited = ends["law (32) as printed, limited"]
    printed = ends["law (32) as printed"]
    rho = ends["law (70), constant ρ, limited"]
    return (
        f"After {DURATION_S:g} s, steps of 0.1 ms and less: the printed law (32), cut to "
        f"{GRIP_M_S2:g} m/s², leaves {mm(min(limited))} to {mm(max(limited))}: it stands still "
        "where e2 first vanishes, and finer steps confirm it. Uncut it depends on the step "
        f"({mm(min(printed))} to {mm(max(printed))}), as e²/ė throws P about. Law (70) leaves "
        f"{mm(min(rho))} to {mm(max(rho))}. No step is small enough to make the published laws "
        "converge, so sampling is not to blame."
    )


def lyapunov(evidence: Evidence) -> str:
    """How far V rises."""
    worst = max(evidence.lyapunov(run).rise_share for run, _ in LYAPUNOV_RUNS)
    model, contact = (
        evidence.lyapunov(f"law32-omitted-{plant}").end_share for plant in ("analytic", "contact")
    )
    return (
        "Logged by every law, with V' measured and V' of Eq. 36, in the columns lyapunov_* of "
        "trajectory.parquet. Under the "
        f"published laws V rises again, by up to {worst:.1f} times its start. Law (32) without "
        f"e²/ė brings it down to {model:.0e} of its start on the model and {contact:.0e} on "
        "contact physics, in 50 s."
    )


def continuous(evidence: Evidence) -> str:
    """When solutions with γ exact end, and what constant ρ leaves."""
    cases = evidence.study("continuous")["cases"]
    exact = [1e3 * case["end_time_s"] for case in cases if case["gamma"] == "exact"]
    left = [100 * case["v_share"][-1] for case in cases if case["gamma"] == "constant"]
    return (
        f"With γ exact (crosses) the solution ends after {min(exact):.0f} to {max(exact):.0f} ms. "
        f"With constant ρ it goes on, and {min(left):.0f} to {max(left):.0f} % of V are left after "
        "20 s."
    )
