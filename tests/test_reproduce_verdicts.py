"""Verdicts: every rule turns where its limit says, on evidence that is made up."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.studies.reproduce.claims.claims import CLAIMS
from ttwmr_mj.studies.reproduce.claims.judging import Judgement, finite, mm, verdict_of
from ttwmr_mj.studies.reproduce.evidence import Evidence, second_half
from ttwmr_mj.studies.reproduce.runs import OMITTED, PUBLISHED, SPRUNG_OMITTED, SPRUNG_PUBLISHED

MORE = 1.0 + 1e-9  # just beyond a limit


class Told(Evidence):
    """Evidence that is told what it holds; a run that it is not told of did badly."""

    def __init__(
        self,
        studies: dict[str, Any] | None = None,
        values: dict[str, float] | None = None,
        *,
        camera: bool = False,
        swings: dict[str, float] | None = None,
        logs: dict[str, Any] | None = None,
        trajectories: dict[str, Trajectory] | None = None,
    ) -> None:
        super().__init__(Path("nowhere"))
        self.study = (studies or {}).__getitem__
        self.lyapunov = (logs or {}).__getitem__
        self.trajectory = (trajectories or {}).__getitem__
        self._values, self._swings, self._camera = values or {}, swings or {}, camera

    def value(self, run: str, metric: str) -> float:
        return self._values.get(f"{run} {metric}", self._values.get(run, math.inf))

    def hitch_angle(self, run: str) -> np.ndarray:
        return np.array([9.0, 9.0, 0.0, self._swings.get(run, math.nan)])

    def sees_with_camera(self, *names: str) -> bool:
        del names
        return self._camera


def judged(name: str, *told: Any, **more: Any) -> Judgement:
    return CLAIMS[name].judgement(Told(*told, **more))


def verdicts(name: str, key: str, *cases: dict[str, Any]) -> list[str]:
    return [judged(name, **{key: case}).verdict for case in cases]


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
        return claim.judgement(Told(continuous(end, v_left), values)).verdict

    assert verdict("time", 0.01, {}) == "holds"
    assert verdict("time", 0.01 * MORE, {}) == "fails"
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
    found = CLAIMS["figs-11-16"].judgement(evidence)
    assert found.verdict == "evidence missing"
    assert "no GL here" in found.finding


def test_undefined_numbers_are_null() -> None:
    found = CLAIMS["fig-19"].judgement(Told({}, {}, camera=True))
    assert found.numbers["published_steady_tractor_rmse_m"] is None
    json.dumps(found.numbers, allow_nan=False)


def test_the_order_of_verdicts() -> None:
    assert verdict_of(True, False) == "holds"
    assert verdict_of(False, True) == "holds with changes"
    assert verdict_of(False, False) == "fails"


@pytest.mark.parametrize(
    ("name", "printed", "changed"),
    [("fig-3", PUBLISHED, OMITTED), ("theorem-2", SPRUNG_PUBLISHED, SPRUNG_OMITTED)],
)
def test_the_tractor_follows_within_10_mm_on_both_plants(
    name: str, printed: tuple[str, ...], changed: tuple[str, ...]
) -> None:
    good, far = dict.fromkeys(printed, 0.010), dict.fromkeys(changed, 0.010)
    one_off = {**good, printed[1]: 0.010 * MORE}
    assert verdicts(name, "values", good, far, one_off, {}) == [
        "holds",
        "holds with changes",
        "fails",
        "fails",
    ]
    found = judged(name, values={**good, changed[0]: 0.3, changed[1]: 0.2})
    assert list(found.numbers.values()) == [0.010, 0.3]
    assert "10 mm" in found.finding
    assert "300 mm" in found.finding


def test_the_hitch_swings_or_is_still() -> None:
    printed = dict.fromkeys(PUBLISHED, 0.2)
    assert verdicts(
        "fig-4",
        "swings",
        {**printed, **dict.fromkeys(OMITTED, 0.1)},
        {**dict.fromkeys(PUBLISHED, 0.1), **dict.fromkeys(OMITTED, 0.2)},
        {**printed, PUBLISHED[0]: 0.2 / MORE, **dict.fromkeys(OMITTED, 0.1)},
    ) == ["holds", "holds with changes", "fails"]
    still = dict.fromkeys((*SPRUNG_OMITTED, "spring-divided-contact"), 0.02)
    loose = dict.fromkeys(SPRUNG_PUBLISHED, 0.02 * MORE)
    assert verdicts(
        "fig-6",
        "swings",
        {**loose, **still, **dict.fromkeys(SPRUNG_PUBLISHED, 0.02)},
        {**loose, **still},
        {**loose, **still, "spring-divided-contact": 0.02 * MORE},
    ) == ["holds", "holds with changes", "fails"]


def log(end: float = 0.0, rise: float = 0.0, rising: float = 0.0) -> SimpleNamespace:
    return SimpleNamespace(end_share=end, rise_share=rise, rising_share=rising)


def test_v_is_gone_or_never_rises() -> None:
    def theorem_1(left: list[float], repaired: float) -> Judgement:
        study = {"phase-plane": {"left_v_share": left, "end_time_s": [0.1, 0.4]}}
        return judged("theorem-1", study, logs={OMITTED[0]: log(0.0), OMITTED[1]: log(repaired)})

    assert theorem_1([0.01, 0.0], 1.0).verdict == "holds"
    assert theorem_1([0.01, 0.02], 0.01).verdict == "holds with changes"
    assert theorem_1([0.01, 0.02], 0.01 * MORE).verdict == "fails"
    numbers = theorem_1([0.01, 0.02, 0.6], 0.5).numbers
    assert list(numbers.values()) == [3.0, 1.0, 0.4, 0.02, 0.5]

    def v_decreases(printed: float, omitted: float) -> Judgement:
        logs = dict.fromkeys((*PUBLISHED, *OMITTED), log())
        logs |= {PUBLISHED[1]: log(rise=printed, rising=0.3)}
        logs |= {OMITTED[1]: log(rise=omitted, rising=0.2)}
        return judged("v-decreases", logs=logs)

    assert v_decreases(0.01, 1.0).verdict == "holds"
    assert v_decreases(0.5, 0.01).verdict == "holds with changes"
    assert v_decreases(0.5, 0.01 * MORE).verdict == "fails"
    assert list(v_decreases(0.5, 0.1).numbers.values()) == [0.5, 0.1, 0.3, 0.2]


def test_one_choice_that_works_is_enough_and_all_printed_runs_are_needed() -> None:
    claim = CLAIMS["figs-7-8"]
    printed = {run: 0.010 for run in claim.runs if run.startswith("pid-") and "without" not in run}
    (choice, *_) = (run for run in claim.runs if run.startswith("choice-"))
    assert len(printed) == 8
    trailer_off = {f"{choice} steady_trailer_rmse_m": 0.020 * MORE}
    tractor_off = {f"{choice} steady_tractor_rmse_m": 0.010 * MORE}
    works = {choice: 0.010, f"{choice} steady_trailer_rmse_m": 0.020}
    assert verdicts(
        "figs-7-8", "values", printed, works, {**works, **trailer_off}, {**works, **tractor_off}
    ) == ["holds", "holds with changes", "fails", "fails"]
    (*others, _) = printed
    assert judged("figs-7-8", values=dict.fromkeys(others, 0.010)).verdict == "fails"
    numbers = judged("figs-7-8", values=works).numbers
    assert (numbers["choices_tried"], numbers["choices_that_work"]) == (18.0, 1.0)
    assert numbers["choices_best_steady_trailer_rmse_m"] == 0.020


def test_the_virtual_spring_and_the_poles() -> None:
    def virtual(swing: float, error: float) -> Judgement:
        run = "virtual-spring-analytic"
        return judged(
            "virtual-spring",
            {"proofs": {"eq-58": {"proved": True}}},
            {run: error},
            swings={run: swing, "spring-printed-omitted-analytic": 0.001},
            logs={run: log(0.7)},
        )

    assert virtual(0.02, 0.010).verdict == "holds"
    assert virtual(0.02 * MORE, 0.010).verdict == "fails"
    assert virtual(0.02, 0.010 * MORE).verdict == "fails"
    assert virtual(0.02, 0.010).numbers["virtual_spring_v_left_share"] == 0.7
    for proved, verdict in ((True, "holds"), (False, "fails")):
        assert judged("poles", {"proofs": {"eq-65": {"proved": proved}}}).verdict == verdict


def test_rho_must_be_near_one_nearly_always() -> None:
    def rho(*cases: list[float]) -> Judgement:
        found = [{"gamma": "constant", "rho_d": case} for case in cases]
        return judged("rho-is-constant", {"continuous": {"cases": found}})

    near, not_quite = [0.5, 1.5] * 9 + [3.0, -0.1], [0.5, 1.5] * 8 + [1.0, 3.0, 3.0, -0.1]
    assert rho(near, near).verdict == "holds"
    assert rho(near, not_quite).verdict == "holds with changes"
    assert rho(not_quite, not_quite).verdict == "fails"
    assert list(rho(near, not_quite).numbers.values()) == pytest.approx([0.85, 0.9, 3.0, 0.1])


def test_finite_time_means_decades_that_halve() -> None:
    def decades(*times: float) -> Judgement:
        return judged("finite-time", {"continuous": {"decade_times_s": list(times)}})

    assert decades(8.0, 12.0, 14.0, 15.0).verdict == "holds with changes"
    assert decades(8.0, 12.0, 14.0, 15.1).verdict == "fails"
    assert list(decades(8.0, 12.0, 14.0).numbers.values()) == [8.0, 2.0, 4.0]


def test_higher_gains_must_be_better_each_time() -> None:
    runs = CLAIMS["higher-gains"].runs
    for errors, verdict in (((3, 2, 1), "holds"), ((3, 3, 1), "fails"), ((3, 2, 2), "fails")):
        assert (
            judged("higher-gains", values=dict(zip(runs, errors, strict=True))).verdict == verdict
        )


def test_effort_is_held_against_what_the_circle_needs() -> None:
    """On the circle of radius R at rate ω the wheels turn at (R·ω ± b·ω)/r."""
    scenario = Told().scenario("lab-pid")
    robot = scenario.robot
    rate, half_track = 0.125, robot.half_track_m
    both = (0.43 * rate + rate * half_track * np.array([1.0, -1.0])) / robot.tractor.wheel_radius_m

    def driven(scale: float) -> Trajectory:
        rows = Trajectory.empty(np.arange(10.0), 1)
        rows.wheel_command_rad_s[:] = scale * both
        rows.wheel_command_rad_s[:5] = 99.0  # the start does not count
        rows.saturated[:] = False
        rows.saturated[7] = True
        return rows

    def effort(published: float, changed: float) -> Judgement:
        runs = {"lab-pid": driven(published), "lab-pid-without": driven(changed)}
        return judged("low-effort", trajectories=runs)

    limit = math.sqrt(1.2)
    assert effort(limit / MORE, 9.0).verdict == "holds"
    assert effort(limit * MORE, limit / MORE).verdict == "holds with changes"
    assert effort(2.0, 3.0).verdict == "fails"
    assert list(effort(2.0, 3.0).numbers.values()) == pytest.approx([4.0, 0.2, 9.0])


def test_experiment_and_model_agree_within_a_centimetre() -> None:
    def at(x: float, y: float) -> Trajectory:
        rows = Trajectory.empty(np.arange(4.0), 1)
        rows.q[:] = 0.0
        rows.q[:, 0, :2] = x, y
        return rows

    def agrees(x: float, y: float) -> Judgement:
        runs = {"lab-pid-without": at(x, y), "lab-analytic": at(0.0, 0.0)}
        return judged("experiment-agrees", camera=True, trajectories=runs)

    assert agrees(0.006, 0.00799).verdict == "holds with changes"
    assert agrees(0.006, 0.00801).verdict == "fails"
    assert agrees(3.0, 4.0).numbers["contact_minus_model_rms_m"] == pytest.approx(5.0)


def test_numbers_for_reading_and_for_json() -> None:
    assert [mm(x) for x in (0.01234, -0.5, 1.0, math.inf)] == [
        "12.3 mm",
        "-500 mm",
        "1 m",
        "undefined",
    ]
    assert [finite(x) for x in (1.5, None, math.nan, math.inf)] == [1.5, None, None, None]


def test_a_run_is_read_back(tmp_path: Path) -> None:
    folder = tmp_path / "runs" / "gains-half"
    folder.mkdir(parents=True)
    evidence = Evidence(tmp_path)
    (folder / "metrics.json").write_text('{"status": "ok", "a": 0.5, "b": null}')
    assert evidence.value("gains-half", "a") == 0.5
    assert evidence.value("gains-half", "b") == math.inf
    (folder / "metrics.json").write_text('{"status": "diverged", "a": 0.5}')
    assert Evidence(tmp_path).value("gains-half", "a") == math.inf
    assert evidence.recording("gains-half") is None
    (folder / "run.rrd").touch()
    assert evidence.recording("gains-half") == "runs/gains-half/run.rrd"
    patched = Evidence(tmp_path)
    patched.scenario = lambda _: SimpleNamespace(controller=SimpleNamespace(kind="mpc"))
    with pytest.raises(TypeError, match="no Lyapunov function"):
        patched.lyapunov("gains-half")
    assert list(second_half(np.arange(5))) == [2, 3, 4]
    assert Told(swings={"a": 0.3}).hitch_swing("a") == 0.3
    assert Told(values={"a": 1.0, "b": 2.0}).worst(("a", "b"), "any") == 2.0
