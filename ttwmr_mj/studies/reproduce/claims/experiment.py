"""Claims about the experiment (Figs. 11-19): they wait for a camera in the loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ttwmr_mj.studies.reproduce.claims.judging import (
    AGREES_M,
    TRACTOR_ERROR,
    TRAILER_ERROR,
    Claim,
    Judgement,
    claim,
    mm,
    robot_follows,
    verdict_of,
)
from ttwmr_mj.studies.reproduce.evidence import Evidence, second_half
from ttwmr_mj.studies.reproduce.runs import DISTURBED


def _needs_camera(evidence: Evidence, judged: Judgement, *runs: str) -> Judgement:
    """The rule's answer if a camera was in the loop, else what is missing and what there is."""
    if evidence.sees_with_camera(*runs):
        return judged
    words = (
        "Not judged: no camera was in the loop. On the true state the rule would say "
        f"“{judged.verdict}”. {judged.finding}"
    )
    return replace(judged, verdict="evidence missing", finding=words)


def _follow(evidence: Evidence, published: str, changed: str) -> Judgement:
    """Whether tractor and trailer both follow, in the published run or in the changed one."""
    errors = {
        f"{name}_{metric}": evidence.value(run, metric)
        for name, run in (("published", published), ("without_correction", changed))
        for metric in (TRACTOR_ERROR, TRAILER_ERROR)
    }
    follows = robot_follows(evidence, changed)
    hitch = float(np.mean(second_half(evidence.hitch_angle(changed))))
    friction = evidence.robot(changed).hitch.coulomb_friction_n_m
    trailer = (
        f"the hitch's friction of {friction:g} N·m carries the trailer along"
        if follows
        else f"friction of {friction:g} N·m does not carry the trailer along closely enough, its "
        f"hitch is at {hitch:.2f} rad on average (0: straight behind, π/2: outward)"
    )
    shown = [mm(error) for error in errors.values()]
    return Judgement(
        verdict_of(robot_follows(evidence, published), follows),
        {**errors, "without_correction_mean_hitch_angle_rad": hitch},
        f"Law (70) leaves tractor and trailer {shown[0]} and {shown[1]} off. Law (32) without "
        "singular terms and without any correction leaves "
        f"{shown[2]} and {shown[3]}: {trailer}.",
    )


def _follow_claim(name: str, runs: tuple[str, ...]) -> Claim:
    """A claim that the robot follows, judged with a camera in the loop."""
    return claim(name, runs)(
        lambda evidence: _needs_camera(evidence, _follow(evidence, *runs), *runs)
    )


@claim("experiment-agrees", ("lab-pid-without", "lab-analytic"))
def _agrees(evidence: Evidence) -> Judgement:
    seen, model = evidence.trajectory("lab-pid-without"), evidence.trajectory("lab-analytic")
    apart = np.hypot(*(seen.q - model.q)[:, 0, :2].T)
    rms = float(np.sqrt(np.mean(apart**2)))
    judged = Judgement(
        verdict_of(False, rms <= AGREES_M),
        {"contact_minus_model_rms_m": rms},
        "Under law (70) neither follows the reference, so there is no agreement to speak of. Under "
        f"law (32) without singular terms, contact physics and model are {mm(rms)} rms apart.",
    )
    return _needs_camera(evidence, judged, "lab-pid-without")


EXPERIMENT_CLAIMS = (
    _follow_claim("figs-11-16", ("lab-pid", "lab-pid-without")),
    _follow_claim("fig-19", ("eight-pid", "eight-pid-without")),
    _follow_claim("robust", DISTURBED),
    _agrees,
)
