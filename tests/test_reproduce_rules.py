"""The reproduction's runs, figures and claims name what exists; rules turn with the evidence."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.studies.reproduce.claims.claims import CLAIMS
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.figures.drawings import DRAWERS
from ttwmr_mj.studies.reproduce.figures.figures import FIGURES
from ttwmr_mj.studies.reproduce.friction import STANDS_RAD, balances
from ttwmr_mj.studies.reproduce.ideal.studies import STUDIES
from ttwmr_mj.studies.reproduce.runs import RUNS, choices


def test_every_run_is_a_valid_scenario_of_its_name() -> None:
    for name, spec in RUNS.items():
        scenario = spec.scenario()
        assert scenario.name == name
        assert scenario.control.sampling_time_s == 0.033


def test_figures_and_claims_name_what_exists() -> None:
    for part in (*FIGURES.values(), *CLAIMS.values()):
        assert set(part.runs) <= set(RUNS), part.name
        assert set(part.studies) <= set(STUDIES), part.name
    assert {figure.kind for figure in FIGURES.values()} == set(DRAWERS)
    article = {f"fig{n}" for n in (*range(3, 9), *range(11, 20))}
    assert article <= set(FIGURES)
    for claim in CLAIMS.values():
        assert claim.rule.count("olds if") >= 1
        assert re.search(r"Eq\.|Fig|Theorem|Section", claim.source)
    assert f"one of {len(choices())} combinations" in CLAIMS["figs-7-8"].rule
    assert "P is within 10 mm and the trailer's COM within 20 mm" in CLAIMS["figs-7-8"].rule


def test_evidence_knows_which_runs_see_with_a_camera(tmp_path: Path) -> None:
    evidence = Evidence(tmp_path)
    assert evidence.sees_with_camera("lab-pid", "eight-pid")
    assert not evidence.sees_with_camera("lab-pid", "lab-analytic")


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
