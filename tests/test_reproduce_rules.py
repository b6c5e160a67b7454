"""The reproduction's runs, figures and claims name what exists; rules turn with the evidence."""

from __future__ import annotations

import inspect
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.studies.reproduce.claims import computed
from ttwmr_mj.studies.reproduce.claims.claims import CLAIMS
from ttwmr_mj.studies.reproduce.claims.computed import COMPUTED
from ttwmr_mj.studies.reproduce.claims.friction import STANDS_RAD, balances
from ttwmr_mj.studies.reproduce.claims.limits import LIMITS
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.figures.drawings import DRAWERS
from ttwmr_mj.studies.reproduce.figures.figures import FIGURES
from ttwmr_mj.studies.reproduce.ideal.studies import STUDIES
from ttwmr_mj.studies.reproduce.runs import RUNS, matching


def test_every_run_is_a_valid_scenario_of_its_name() -> None:
    for name, spec in RUNS.items():
        scenario = spec.scenario()
        assert scenario.name == name
        assert scenario.control.sampling_time_s == 0.033


def test_what_is_shown_and_judged_uses_every_run_study_and_computation() -> None:
    """Reading the data files has refused names that do not exist; here none is left over."""
    judged = [numbers for claim in CLAIMS.values() for numbers in claim.cases.values()]
    parts = [*judged, *(figure.numbers for figure in FIGURES.values())]
    assert {run for part in parts for run in part.runs} == set(RUNS)
    assert {study for part in parts for study in part.studies} == set(STUDIES)
    assert {part.computed for part in parts} == {None, *COMPUTED.values()}
    assert {figure.kind for figure in FIGURES.values()} == set(DRAWERS)
    article = {f"fig{n}" for n in (*range(3, 9), *range(11, 20))}
    assert article <= set(FIGURES)
    for claim in CLAIMS.values():
        assert claim.rule.count("olds if") >= 1
        assert re.search(r"Eq\.|Fig|Theorem|Section", claim.source)
    choices = matching(["choice-*"], RUNS)
    assert f"one of {len(choices)} combinations" in CLAIMS["figs-7-8"].rule
    assert "P is within 10 mm and the trailer's COM within 20 mm" in CLAIMS["figs-7-8"].rule


def test_every_limit_is_some_rules() -> None:
    named = {part.limit for claim in CLAIMS.values() for part in claim.decides.comparisons}
    named |= set(re.findall(r'LIMITS\["(\w+)"\]', inspect.getsource(computed)))
    assert named - {"0"} == set(LIMITS)


def test_runs_are_found_by_pattern_in_order_and_once() -> None:
    names = ["b-1", "a-1", "a-2", "c"]
    assert matching(["c", "a-*", "a-2"], names) == ("c", "a-1", "a-2")
    with pytest.raises(KeyError, match=r"d-\*"):
        matching(["a-*", "d-*"], names)


def test_the_experiment_is_run_with_a_camera() -> None:
    experiment = {f"fig{n}" for n in range(11, 20)}
    runs = {run for name in experiment for run in FIGURES[name].numbers.runs}
    assert runs == {"lab-pid", "lab-pid-without", "eight-pid", "eight-pid-without"}
    frictions = {}
    for name in ("figs-11-16", "fig-19", "low-effort"):
        for assumed, numbers in CLAIMS[name].cases.items():
            friction = frictions.setdefault(assumed, set())
            for run in numbers.runs:
                scenario = RUNS[run].scenario()
                assert (scenario.sensing.kind, scenario.plant.kind) == ("camera", "contact")
                assert scenario.robot.hitch.damping_n_m_s_rad == 0.0
                friction.add(scenario.robot.hitch.coulomb_friction_n_m)
    assert frictions == {"1 mN·m": {1e-3}, "none": {0.0}, "0.5 mN·m": {5e-4}, "1.5 mN·m": {1.5e-3}}


def test_runs_are_what_their_names_say() -> None:
    def scenario(run: str) -> Any:
        return RUNS[run].scenario()

    for plant in ("analytic", "contact"):
        assert scenario(f"law32-omitted-{plant}").plant.kind == plant
        assert scenario(f"law32-published-{plant}").controller.singular_terms == "published"
    limited = scenario("choice-regularized-limit-10-outward")
    assert (limited.controller.gamma, limited.controller.gamma_limit) == ("regularized", 10.0)
    assert (limited.reference.theta2, limited.plant.kind) == ("outward", "analytic")
    for run in RUNS:
        if found := re.fullmatch(r"(?:friction-start|friction|.*-without)-(\d+)-unm", run):
            torque = scenario(run).robot.hitch.coulomb_friction_n_m
            assert torque == pytest.approx(1e-6 * float(found[1]), rel=1e-12)  # the same decimals
    assert not RUNS["friction-viscous"].recording
    assert RUNS["lab-pid"].recording


TOGETHER = {"alpha1": ("alpha1", "alpha3"), "alpha2": ("alpha2", "alpha4")}
ALPHAS = ("alpha1", "alpha2", "alpha3", "alpha4")


def test_one_gain_is_halved_or_doubled_at_a_time() -> None:
    for run in RUNS:
        if not (found := re.fullmatch(r"gains(70)?-(?:(\w+)-)?(half|double)", run)):
            continue
        law70, gain, scale = found.groups()
        base = "pid-constant-aligned-analytic" if law70 else "pid-without-analytic"
        told, table = (RUNS[name].scenario().model_dump() for name in (run, base))
        factor = 0.5 if scale == "half" else 2.0
        for name in TOGETHER.get(gain, (gain,)) if gain else ALPHAS:
            table["controller"][name] *= factor
        del told["name"], table["name"], told["output"], table["output"]
        assert told == table, run


def test_the_law_is_not_told_of_the_world_it_is_put_into() -> None:
    kind = RUNS["lab-pid-without"].scenario().robot
    for run in matching(["robust-*"], RUNS):
        scenario = RUNS[run].scenario()
        assert scenario.robot != kind
        believed = scenario.believed_robot
        assert believed.tractor == kind.tractor
        assert believed.trailer == kind.trailer
        assert believed.servo == kind.servo


def test_the_hitch_angle_is_the_trailers_against_the_tractors(tmp_path: Path) -> None:
    """At rest over the last quarter only; the load is m2·l·R·ω²·cos φ."""
    rows = Trajectory.empty(np.arange(8.0), 1)
    rows.q[:, 0, 2] = 1.0
    rows.q[:, 0, 3] = [9.0, 9.0, 9.0, 9.0, 9.0, 9.0, 1.5, 1.5 + STANDS_RAD]
    evidence = Evidence(tmp_path)
    evidence.trajectory = lambda _: rows
    evidence.metrics = lambda _: {"status": "ok", "steady_trailer_rmse_m": 0.01}
    balance = next(b for b in balances(evidence) if b.friction_n_m == 3e-4)
    angle = 0.5 + STANDS_RAD / 2
    assert balance.hitch_angle_rad == pytest.approx(angle)
    assert balance.swing_rad == pytest.approx(STANDS_RAD)
    assert balance.load_n_m == pytest.approx(0.33 * 0.141 * 0.43 * 0.125**2 * np.cos(angle))
    assert replace(balance, swing_rad=STANDS_RAD).stands
    assert not replace(balance, swing_rad=1.1 * STANDS_RAD).stands
    for load, balanced in ((3e-4, True), (-3e-4, True), (3.1e-4, False), (-3.1e-4, False)):
        assert replace(balance, load_n_m=load).balanced == balanced
