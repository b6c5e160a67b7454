"""Claims about the tractor's law (32): Theorems 1 and 2, and V'."""

from __future__ import annotations

import numpy as np

from ttwmr_mj.studies.reproduce.claims.judging import (
    GONE,
    NEVER_RISES,
    Judgement,
    claim,
    tractor_follows,
    verdict_of,
)
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.runs import OMITTED, PUBLISHED, SPRUNG_OMITTED, SPRUNG_PUBLISHED


@claim("theorem-1", OMITTED, ("phase-plane",))
def _theorem_1(evidence: Evidence) -> Judgement:
    study = evidence.study("phase-plane")
    left = np.array(study["left_v_share"])
    repaired = max(evidence.lyapunov(run).end_share for run in OMITTED)
    converged = int((left <= GONE).sum())
    return Judgement(
        verdict_of(converged == left.size, repaired <= GONE),
        {
            "starts": float(left.size),
            "starts_with_v_gone": float(converged),
            "longest_time_to_e2_zero_s": max(study["end_time_s"]),
            "median_v_left_share": float(np.median(left)),
            "omitted_v_left_share": repaired,
        },
    )


@claim("v-decreases", (*PUBLISHED, *OMITTED))
def _v_decreases(evidence: Evidence) -> Judgement:
    logs = {run: evidence.lyapunov(run) for run in (*PUBLISHED, *OMITTED)}
    printed = max(logs[run].rise_share for run in PUBLISHED)
    omitted = max(logs[run].rise_share for run in OMITTED)
    return Judgement(
        verdict_of(printed <= NEVER_RISES, omitted <= NEVER_RISES),
        {
            "published_highest_rise_of_v": printed,
            "omitted_highest_rise_of_v": omitted,
            "published_rising_samples_share": max(logs[r].rising_share for r in PUBLISHED),
            "omitted_rising_samples_share": max(logs[r].rising_share for r in OMITTED),
        },
    )


@claim("theorem-2", (*SPRUNG_PUBLISHED, *SPRUNG_OMITTED))
def _theorem_2(evidence: Evidence) -> Judgement:
    return tractor_follows(evidence, SPRUNG_PUBLISHED, SPRUNG_OMITTED)


THEOREM_CLAIMS = (_theorem_1, _v_decreases, _theorem_2)
