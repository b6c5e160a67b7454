"""The reproduction's runs, figures and claims name what exists; rules turn with the evidence."""

from __future__ import annotations

import re
from pathlib import Path

from ttwmr_mj.studies.reproduce.claims.claims import CLAIMS
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.figures.drawings import DRAWERS
from ttwmr_mj.studies.reproduce.figures.figures import FIGURES
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
