"""The reproduction's runs, figures and claims name what exists; rules turn with the evidence."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ttwmr_mj.studies.reproduce.claims.claims import CLAIMS
from ttwmr_mj.studies.reproduce.claims.judging import verdict_of
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


class Told(Evidence):
    """Evidence that is told what it holds."""

    def __init__(self, studies: dict[str, Any], values: dict[str, float], camera: bool) -> None:
        super().__init__(Path("nowhere"))
        self.study = studies.__getitem__
        self._values, self._camera = values, camera

    def value(self, run: str, metric: str) -> float:
        return self._values.get(f"{run} {metric}", self._values.get(run, math.inf))

    def hitch_angle(self, run: str) -> np.ndarray:
        del run
        return np.zeros(4)

    def sees_with_camera(self, *names: str) -> bool:
        del names
        return self._camera


def continuous(end: str, v_left: float) -> dict[str, Any]:
    case = {
        "end": end,
        "end_time_s": 20.0,
        "v_share": [1.0, v_left],
        "e5_rad": [0.0],
        "error_m": [v_left],
        "rho_d": [1.0],
    }
    return {"continuous": {"cases": [case | {"gamma": g} for g in ("exact", "constant")]}}


@pytest.mark.parametrize("name", ["theorem-3", "law-70"])
def test_stability_rules_turn_with_the_evidence(name: str) -> None:
    claim = CLAIMS[name]
    good = dict.fromkeys(claim.runs, 0.001)

    def verdict(end: str, v_left: float, values: dict[str, float]) -> str:
        return claim.judgement(Told(continuous(end, v_left), values, camera=False)).verdict

    assert verdict("time", 0.001, {}) == "holds"
    assert verdict("singular", 0.9, good) == "holds with changes"
    assert verdict("singular", 0.9, {}) == "fails"
    assert verdict("time", 0.9, {}) == "fails"


def test_the_experiment_is_judged_by_its_rule_only_with_a_camera() -> None:
    claim = CLAIMS["figs-11-16"]
    values = {"lab-pid": 0.3, "lab-pid-without": 0.001}
    without = claim.judgement(Told({}, values, camera=False))
    assert without.verdict == "evidence missing"
    assert "holds with changes" in without.finding
    assert without.numbers["published_steady_tractor_rmse_m"] == 0.3
    assert claim.judgement(Told({}, values, camera=True)).verdict == "holds with changes"
    both = dict.fromkeys(values, 0.001)
    assert claim.judgement(Told({}, both, camera=True)).verdict == "holds"
    assert claim.judgement(Told({}, {}, camera=True)).verdict == "fails"


def test_a_run_that_could_not_be_done_is_missing_evidence_and_says_why() -> None:
    evidence = Told({}, {}, camera=True)
    evidence.failures = {"lab-pid": "no GL here"}
    judged = CLAIMS["figs-11-16"].judgement(evidence)
    assert judged.verdict == "evidence missing"
    assert "no GL here" in judged.finding


def test_undefined_numbers_are_null() -> None:
    judged = CLAIMS["fig-19"].judgement(Told({}, {}, camera=True))
    assert judged.numbers["published_steady_tractor_rmse_m"] is None
    json.dumps(judged.numbers, allow_nan=False)


def test_the_order_of_verdicts() -> None:
    assert verdict_of(True, False) == "holds"
    assert verdict_of(False, True) == "holds with changes"
    assert verdict_of(False, False) == "fails"
