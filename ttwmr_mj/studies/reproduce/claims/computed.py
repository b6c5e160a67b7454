"""Values that are computed from results, not only read: by the names claims and figures use."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from ttwmr_mj.studies.reproduce.claims import friction
from ttwmr_mj.studies.reproduce.claims.limits import GONE, NEAR_CONSTANT
from ttwmr_mj.studies.reproduce.claims.measures import Number
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.ideal.step_size import DURATION_S, GRIP_M_S2
from ttwmr_mj.studies.reproduce.ideal.studies import STEP_STUDIES, STUDIES
from ttwmr_mj.studies.reproduce.runs import RUNS, matching

Values = dict[str, float]


def starts_gone(evidence: Evidence) -> Values:
    """From how many starts V vanishes under the printed law."""
    left = np.array(evidence.study("phase-plane")["left_v_share"])
    return {"starts_with_v_gone": float((left <= GONE).sum())}


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
    """How constant ρ·D is in the solutions with constant ρ."""
    cases = [c for c in evidence.study("continuous")["cases"] if c["gamma"] == "constant"]
    sizes = [np.array(case["rho_d"]) for case in cases]
    near = [float(np.mean(np.abs(size - 1.0) <= NEAR_CONSTANT)) for size in sizes]
    return {
        "share_of_time_near_constant_min": min(near),
        "share_of_time_near_constant_max": max(near),
        "rho_d_largest": max(float(np.abs(size).max()) for size in sizes),
        "rho_d_at_the_end": max(abs(float(size[-1])) for size in sizes),
    }


def decades(evidence: Evidence) -> Values:
    """How long law (32) without singular terms takes for each tenfold decrease of the error."""
    reached = np.array(evidence.study("continuous")["decade_times_s"])
    lasted = np.diff(reached)
    return {
        "first_decade_s": float(reached[0]),
        "shortest_decade_s": float(lasted.min()),
        "longest_decade_s": float(lasted.max()),
        "largest_ratio_of_decades": float((lasted[1:] / lasted[:-1]).max()),
    }


def pole(evidence: Evidence) -> Values:
    """Where all poles of Eq. 65 are; undefined if that is not proved."""
    proved = evidence.study("proofs")["eq-65"]["proved"]
    return {"pole_1_s": -4.0 if proved else math.nan}


def apart(evidence: Evidence) -> Values:
    """How far contact physics and the analytic model are apart under the same law."""
    seen, model = (evidence.trajectory(run).q for run in ("lab-pid-without", "lab-analytic"))
    distance = np.hypot(*(seen - model)[:, 0, :2].T)
    return {"contact_minus_model_rms_m": float(np.sqrt(np.mean(distance**2)))}


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
    "starts_gone": starts_gone,
    "exact_solutions": partial(solutions, gamma="exact"),
    "constant_solutions": partial(solutions, gamma="constant"),
    "both_gammas": both_gammas,
    "rho_d": rho_d,
    "decades": decades,
    "pole": pole,
    "apart": apart,
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
