"""Values that are computed from results, not only read: by the names claims and figures use."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ttwmr_mj.controllers.lyapunov_pid import LyapunovPidOptions
from ttwmr_mj.studies.reproduce.claims import friction
from ttwmr_mj.studies.reproduce.claims.limits import LIMITS
from ttwmr_mj.studies.reproduce.claims.measures import Number, worse_error_m
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.ideal.continuous import largest_ratio
from ttwmr_mj.studies.reproduce.ideal.step_size import DURATION_S, GRIP_M_S2
from ttwmr_mj.studies.reproduce.ideal.studies import STEP_STUDIES, STUDIES
from ttwmr_mj.studies.reproduce.runs import RUNS, matching

Values = dict[str, float]


def solutions(evidence: Evidence, gamma: str) -> Values:
    """How long the solutions in continuous time last under one form of γ, and what they leave."""
    cases = [c for c in evidence.study("continuous")["cases"] if c["gamma"] == gamma]
    lived = [case["end_time_s"] for case in cases]
    left = [case["v_share"][-1] for case in cases]
    return {
        "shortest_solution_s": min(lived),
        "longest_solution_s": max(lived),
        "smallest_v_left_share": min(left),
        "largest_v_left_share": max(left),
        "largest_e5_left_rad": max(abs(case["e5_rad"][-1]) for case in cases),
        "smallest_error_left_m": min(case["error_m"][-1] for case in cases),
    }


def both_gammas(evidence: Evidence) -> Values:
    """How long the solutions with γ exact last, and what constant ρ leaves of V."""
    exact, constant = (solutions(evidence, gamma) for gamma in ("exact", "constant"))
    return {
        "shortest_exact_s": exact["shortest_solution_s"],
        "longest_exact_s": exact["longest_solution_s"],
        "smallest_constant_v_share": constant["smallest_v_left_share"],
        "largest_constant_v_share": constant["largest_v_left_share"],
    }


def rho_d(evidence: Evidence) -> Values:
    """How constant ρ·D is in the solutions with constant ρ, most of the time and at its worst."""
    cases = [c for c in evidence.study("continuous")["cases"] if c["gamma"] == "constant"]
    sizes = [np.array(case["rho_d"]) for case in cases]
    near = [float(np.mean(np.abs(size - 1.0) <= LIMITS["NEAR_CONSTANT"])) for size in sizes]
    furthest = [
        float(np.quantile(np.abs(size - 1.0), LIMITS["MOSTLY"], method="inverted_cdf"))
        for size in sizes
    ]
    return {
        "furthest_from_constant_min": min(furthest),
        "furthest_from_constant_max": max(furthest),
        "share_of_time_near_constant_min": min(near),
        "share_of_time_near_constant_max": max(near),
        "rho_d_largest": max(float(np.abs(size).max()) for size in sizes),
        "rho_d_at_the_end": max(abs(float(size[-1])) for size in sizes),
    }


def decades(evidence: Evidence) -> Values:
    """How long law (32) without singular terms takes for each tenfold decrease of the error."""
    reached = evidence.study("continuous")["decade_times_s"]
    lasted = np.diff(reached)
    return {
        "first_decade_s": float(reached[0]),
        "shortest_decade_s": float(lasted.min()),
        "longest_decade_s": float(lasted.max()),
        "largest_ratio_of_decades": largest_ratio(reached),
    }


def pole(evidence: Evidence) -> Values:
    """The poles of Eq. 65 with Table II's gains: their mean, and how far they are spread."""
    del evidence
    table = LyapunovPidOptions(kind="lyapunov_pid")
    poles = np.roots([1.0, table.k_d, table.k_p, table.k_i])
    mean = float(poles.mean().real)
    return {"pole_1_s": mean, "spread_of_poles_share": float(np.abs(poles / mean - 1.0).max())}


def apart(evidence: Evidence) -> Values:
    """How far contact physics and the analytic model are apart under the same law."""
    pairs = {
        "published": ("lab-pid", "lab-analytic-pid"),
        "without_correction": ("lab-pid-without", "lab-analytic"),
    }
    return {f"{law}_apart_m": _apart(evidence, *runs) for law, runs in pairs.items()}


def _apart(evidence: Evidence, *runs: str) -> float:
    """Rms distance of P between two runs, as long as both last; infinite if one broke off."""
    seen, model = (evidence.trajectory(run).q[:, 0, :2] for run in runs)
    if len(seen) != len(model):
        return math.inf
    return float(np.sqrt(np.mean(np.hypot(*(seen - model).T) ** 2)))


# with Table II's gains
TABLE_70, TABLE_32 = "pid-constant-aligned-analytic", "pid-without-analytic"


def gains(evidence: Evidence, gain: str) -> Values:
    """What one of the tractor's gains does to the steady error, from half to double."""

    def told(law: str, errors: list[float]) -> Values:
        half, table, double = errors
        names = (f"{law}_half_m", f"{law}_m", f"{law}_double_m", f"{law}_worse_with_gain")
        return dict(zip(names, (*errors, _worse(half, table, double)), strict=True))

    runs_70 = (f"gains70-{gain}-half", TABLE_70, f"gains70-{gain}-double")
    runs_32 = (f"gains-{gain}-half", TABLE_32, f"gains-{gain}-double")
    tractor = [evidence.value(run, "steady_tractor_rmse_m") for run in runs_32]
    return told("published", [worse_error_m(evidence, run) for run in runs_70]) | told(
        "omitted", tractor
    )


def gains_pid(evidence: Evidence) -> Values:
    """What the gains of γ do to the steady error under law (70), gain by gain."""
    errors = {
        gain: [
            worse_error_m(evidence, run)
            for run in (f"gains70-{gain}-half", TABLE_70, f"gains70-{gain}-double")
        ]
        for gain in ("k_p", "k_i", "k_d", "rho")
    }
    worse = [_worse(*row) for row in errors.values()]
    every = [error for row in errors.values() for error in row]
    return {
        "published_m": worse_error_m(evidence, TABLE_70),
        "most_worse_with_gain": max(worse),
        "least_worse_with_gain": min(worse),
        "gains_that_help": float(sum(ratio < LIMITS["BETTER"] for ratio in worse)),
        "least_m": min(every),
        "most_m": max(every),
    }


def _worse(half: float, table: float, double: float) -> float:
    """The larger ratio of the error with a gain to that with half of it; below 1 it helps."""
    with np.errstate(invalid="ignore"):
        ratios = np.divide((table, double), (half, table))
    return float(np.nan_to_num(ratios, nan=math.inf).max())  # ∞/∞: nothing is known to help


def small_steps(evidence: Evidence) -> Values:
    """What is left at the end, at steps that should be small enough."""
    numbers = {"duration_s": DURATION_S, "grip_m_s2": GRIP_M_S2}
    laws = {
        "limited": "law (32) as printed, limited",
        "printed": "law (32) as printed",
        "rho": "law (70), constant ρ, limited",
    }
    studies = {law: name for name, law in STEP_STUDIES.items()}
    for name, law in laws.items():
        runs = evidence.study(studies[law])["runs"]
        ends = [run["final_error_m"] for run in runs if run["step_s"] <= 1e-4]
        numbers |= {f"{name}_least_m": min(ends), f"{name}_most_m": max(ends)}
    return numbers


COMPUTED: dict[str, Callable[[Evidence], Values]] = {
    "exact_solutions": partial(solutions, gamma="exact"),
    "constant_solutions": partial(solutions, gamma="constant"),
    "both_gammas": both_gammas,
    "rho_d": rho_d,
    "decades": decades,
    "pole": pole,
    "apart": apart,
    "gains_alpha1": partial(gains, gain="alpha1"),
    "gains_alpha2": partial(gains, gain="alpha2"),
    "gains_pid": gains_pid,
    "small_steps": small_steps,
    "friction": friction.numbers,
}


@dataclass(frozen=True, slots=True)
class Numbers:
    """The numbers of a claim or a figure, and what they come from."""

    computed: Callable[[Evidence], Values] | None  # of COMPUTED, if any is
    read: dict[str, Number]  # name → number
    needed: tuple[str, ...]  # names of runs and studies

    @classmethod
    def of(cls, entry: dict[str, Any], shown: tuple[str, ...] = ()) -> Numbers:
        """Those of an entry of a data file, beside runs that are shown anyway."""
        read = {name: Number.parse(text) for name, text in entry.get("numbers", {}).items()}
        needed = dict.fromkeys(shown)
        needed |= dict.fromkeys(name for number in read.values() for name in number.of)
        needed |= dict.fromkeys(matching(entry.get("needs", []), [*RUNS, *STUDIES]))
        computed = COMPUTED[entry["computed"]] if "computed" in entry else None
        return cls(computed, read, tuple(needed))

    @property
    def runs(self) -> tuple[str, ...]:
        """The runs it needs."""
        return tuple(name for name in self.needed if name in RUNS)

    @property
    def studies(self) -> tuple[str, ...]:
        """The studies it needs."""
        return tuple(name for name in self.needed if name in STUDIES)

    def values(self, evidence: Evidence) -> Values:
        """Name → value."""
        computed = self.computed(evidence) if self.computed else {}
        return computed | {name: number.value(evidence) for name, number in self.read.items()}
