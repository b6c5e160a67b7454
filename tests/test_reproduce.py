"""The reproduction: its theory agrees with the controllers, its rules with what they say."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ttwmr_mj.controllers import lyapunov_pid
from ttwmr_mj.controllers.lyapunov import LyapunovOptions, law
from ttwmr_mj.controllers.lyapunov_pid import LyapunovPidOptions
from ttwmr_mj.errors import InputError
from ttwmr_mj.results.lyapunov_log import lyapunov_log
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.run.experiment import Outcome
from ttwmr_mj.studies.reproduce import execute, runs
from ttwmr_mj.studies.reproduce.claims.claims import CLAIMS
from ttwmr_mj.studies.reproduce.claims.judging import Judgement, verdict_of
from ttwmr_mj.studies.reproduce.errata import ERRATA
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.figures.drawings import DRAWERS
from ttwmr_mj.studies.reproduce.figures.figures import FIGURES
from ttwmr_mj.studies.reproduce.ideal import phase_plane
from ttwmr_mj.studies.reproduce.ideal.loop import IdealLoop, sampled, solve
from ttwmr_mj.studies.reproduce.ideal.studies import STUDIES
from ttwmr_mj.studies.reproduce.proofs import proofs
from ttwmr_mj.studies.reproduce.runs import PRINTED_AS_TORQUE, RUNS, RunSpec
from ttwmr_mj.studies.reproduce.study import reproduce

LAWS = [
    LyapunovOptions(kind="lyapunov"),
    LyapunovOptions(kind="lyapunov", singular_terms="regularized"),
    LyapunovOptions(kind="lyapunov", singular_terms="published"),
    LyapunovPidOptions(kind="lyapunov_pid"),
    LyapunovPidOptions(kind="lyapunov_pid", gamma="exact", alpha4=7.0),
    LyapunovPidOptions(kind="lyapunov_pid", gamma="regularized", gamma_limit=3.0),
]


@pytest.mark.parametrize("options", LAWS, ids=str)
def test_the_law_on_floats_is_the_controllers_law(options: LyapunovOptions) -> None:
    loop, rng = IdealLoop(options, 0.43, 0.125, 0.35), np.random.default_rng(4)
    for _ in range(50):
        time_s, z = rng.uniform(0, 60), tuple(rng.uniform(-1, 1, 7))
        angle = 0.125 * time_s + 0.35
        radial = np.array([math.cos(angle), math.sin(angle)])
        e1, e2, e3, e4 = loop.errors(time_s, z)
        e, e_rate = np.array([e1, e3]), np.array([e2, e4])
        v = law(e, e_rate, -0.43 * 0.125**2 * radial, options)
        if isinstance(options, LyapunovPidOptions):
            theta2 = np.array(z[4])
            e5 = (z[4] - angle - 0.5 * np.pi + np.pi) % (2 * np.pi) - np.pi
            wanted = lyapunov_pid.pid_acceleration(e5, z[5] - 0.125, z[6], 0.0, options)
            excess = lyapunov_pid.sideways(v, theta2) - RobotParameters().swing_length_m * wanted
            d = lyapunov_pid.denominator(e_rate, theta2, options)
            turn, _ = lyapunov_pid.gamma(np.asarray(excess), d, options)
            v = lyapunov_pid.corrected(v, e_rate, turn, options)
        command = loop.command(time_s, z)
        assert [command.v1, command.v2] == pytest.approx(v, rel=1e-9, abs=1e-9)


def test_sampling_finer_leads_to_the_differential_equation() -> None:
    loop = IdealLoop(LAWS[0], 1.0, 0.5)
    start = loop.at_rest(0.6, -0.3)
    exact = solve(loop, start, 3.0).z[-1]
    misses = [np.abs(sampled(loop, start, 3.0, h).z[-1] - exact)[:4].max() for h in (1e-2, 1e-3)]
    assert misses[1] / misses[0] == pytest.approx(0.1, rel=0.2)  # a held command: first order


def test_an_ideal_loop_without_error_keeps_it_so() -> None:
    loop = IdealLoop(LAWS[0], 1.0, 0.5)
    on_the_circle = (1.0, 0.0, 0.0, 0.5, 0.5 * math.pi, 0.5, 0.0)
    end = solve(loop, on_the_circle, 5.0)
    assert np.hypot(*np.array(loop.errors(5.0, end.z[-1]))[[0, 2]]) < 1e-7
    assert loop.lyapunov(0.0, on_the_circle) == pytest.approx(0.0, abs=1e-30)


def test_all_paths_of_the_printed_law_end_on_e2_zero_but_for_one_ray() -> None:
    study, axis = phase_plane.study(), phase_plane.Axis()
    assert max(study["end_time_s"]) < 1.0
    # e2 falls to zero like a square root of time: the last step that floats can take is this far
    assert all(abs(path[1][-1]) < 1e-7 for path in study["paths"])
    assert min(abs(e1) for e1 in study["left_e1_m"]) > 0.01
    assert axis.slope(axis.invariant_ray()) == pytest.approx(0.0, abs=1e-9)
    assert all(axis.slope(u) < 0.0 for u in np.geomspace(1e-6, 1e6, 100))
    assert all(axis.slope(-u) > 0.0 for u in np.geomspace(1e-6, 9.7, 100))


def test_the_printed_law_stands_still_where_it_first_stops_at_every_small_step() -> None:
    loop = IdealLoop(LAWS[2], 1.0, 0.5, limit_m_s2=9.0)
    start = loop.at_rest(0.6, -0.3)
    ends = []
    for step in (1e-3, 1e-4):
        path = sampled(loop, start, 2.0, step)
        ends.append(math.hypot(*loop.errors(path.time_s[-1], tuple(path.z[-1]))[::2]))
    assert ends[0] == pytest.approx(ends[1], rel=5e-3)
    assert ends[0] > 0.4


def test_exact_gamma_ends_within_a_fraction_of_a_second() -> None:
    loop = IdealLoop(LyapunovPidOptions(kind="lyapunov_pid", gamma="exact"), 1.0, 0.5)
    path = solve(loop, loop.at_rest(0.6, -0.3), 5.0, until=lambda t, z: loop.command(t, z).d)
    assert path.end == "singular"
    assert path.time_s[-1] < 0.2


@pytest.mark.parametrize("name", list(proofs.PROOFS))
def test_the_errata_are_proved(name: str) -> None:
    pytest.importorskip("sympy")
    assert proofs.PROOFS[name]().proved


def test_every_erratum_names_a_proof_and_every_error_has_an_erratum() -> None:
    assert {erratum.proof for erratum in ERRATA} <= set(proofs.PROOFS)
    where = " ".join(erratum.where for erratum in ERRATA)
    for equation in (23, 32, 41, 48, 58, 68):
        assert f"Eq. {equation}" in where


def test_200_as_printed_is_this_torque() -> None:
    trailer = RobotParameters().trailer
    torque = 200.0 * trailer.mass_kg * trailer.com_offset_m
    assert torque == pytest.approx(PRINTED_AS_TORQUE, abs=5e-4)


def test_v_along_a_trajectory_by_hand() -> None:
    rows = Trajectory.empty(np.array([0.0, 0.5]), 1)
    for name in ("q", "q_rate", "ref_q", "ref_q_rate"):
        getattr(rows, name)[:] = 0.0
    rows.q[0, 0, :2] = 0.2, -0.1
    rows.q_rate[0, 0, :2] = 0.3, 0.4
    log = lyapunov_log(rows, LAWS[0])
    v = 0.5 * (25 * 0.04 + 10 * 0.09 + 25 * 0.01 + 10 * 0.16)
    assert log.v == pytest.approx([v, 0.0])
    assert log.v_rate == pytest.approx([-2 * v, -2 * v])
    assert log.v_rate_claimed[0] == pytest.approx(-25 * 0.04 - 9.0 - 25 * 0.01 - 16.0)
    assert log.rise_share == 0.0


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


@pytest.fixture
def short_run(monkeypatch: pytest.MonkeyPatch) -> str:
    spec = RunSpec("short", "lab_circle", ("plant.kind=analytic", "duration_s=0.5"), False)
    monkeypatch.setitem(runs.RUNS, "short", spec)
    return "short"


def test_a_finished_run_is_used_again_and_only_then(
    short_run: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = execute.run_folder(tmp_path, short_run)
    assert not execute.run_is_done(tmp_path, short_run)
    execute.do_run(tmp_path, short_run)
    assert execute.run_is_done(tmp_path, short_run)
    assert (folder / "lyapunov.parquet").is_file()

    with monkeypatch.context() as other:  # another scenario under the same name
        changed = RunSpec("short", "lab_circle", ("plant.kind=analytic", "duration_s=0.6"), False)
        other.setitem(runs.RUNS, "short", changed)
        assert not execute.run_is_done(tmp_path, short_run)
    with monkeypatch.context() as other:  # other code
        other.setattr(execute, "code_of_runs", lambda: "other")
        assert not execute.run_is_done(tmp_path, short_run)
    assert execute.run_is_done(tmp_path, short_run)

    (folder / execute.DONE_FILE).unlink()  # as a kill leaves it
    assert not execute.run_is_done(tmp_path, short_run)
    (folder / "leftover").touch()
    execute.do_run(tmp_path, short_run)
    assert not (folder / "leftover").exists()


def test_an_interrupted_run_is_not_finished(
    short_run: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> SimpleNamespace:
        return SimpleNamespace(outcome=Outcome("interrupted", "stopped by the user", 0.1))

    monkeypatch.setattr("ttwmr_mj.run.execute.run_scenario", interrupted)
    with pytest.raises(KeyboardInterrupt):
        execute.do_run(tmp_path, short_run)
    assert not execute.run_is_done(tmp_path, short_run)


def test_one_figure_alone(tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = reproduce(out, ["phase-plane"], quiet=True)
    assert done.report == out / "report-phase-plane.html"
    page = done.report.read_text("utf-8")
    assert "data:image/svg+xml;base64," in page
    assert not re.findall(r"(?:src|href)=\"(?:https?:)?//", page)  # nothing from elsewhere
    assert [p.name for p in (out / "figures").iterdir()] == ["phase-plane.svg"]
    assert not (out / "claims.json").exists()
    result = execute.study_file(out, "phase-plane")
    before = result.stat().st_mtime_ns
    drawing = (out / "figures" / "phase-plane.svg").read_bytes()
    reproduce(out, ["phase-plane"], quiet=True)
    assert result.stat().st_mtime_ns == before
    assert (out / "figures" / "phase-plane.svg").read_bytes() == drawing


def test_an_unknown_figure_is_refused_with_a_hint(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="did you mean 'fig7'"):
        reproduce(tmp_path, ["fig77"], quiet=True)


def test_a_folder_with_something_else_in_it_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(InputError, match=r"holds something else \(thesis.tex\)"):
        reproduce(tmp_path, ["phase-plane"], quiet=True)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_importing_the_study_imports_no_matplotlib_sympy_or_mujoco() -> None:
    code = (
        "import sys, ttwmr_mj.studies.reproduce.study;"
        "import ttwmr_mj.studies.reproduce.figures.drawings;"
        "sys.exit(any(m in sys.modules for m in ('matplotlib', 'sympy', 'mujoco', 'jinja2')))"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Judgement]]:
    out = tmp_path_factory.mktemp("reproduce")
    done = reproduce(out, quiet=True)
    assert done.failures == {}
    return out, done.judgements


@pytest.mark.slow
def test_the_verdicts_of_the_whole_reproduction(whole: tuple[Path, dict[str, Judgement]]) -> None:
    verdicts = {name: judgement.verdict for name, judgement in whole[1].items()}
    assert set(verdicts) == set(CLAIMS)
    for name in ("theorem-1", "v-decreases", "theorem-2", "fig-3", "low-effort"):
        assert verdicts[name] == "holds with changes", name
    for name in ("theorem-3", "law-70", "rho-is-constant", "figs-7-8", "finite-time"):
        assert verdicts[name] == "fails", name
    for name in ("fig-4", "fig-6", "poles"):
        assert verdicts[name] == "holds", name


@pytest.mark.slow
def test_the_report_stands_alone_and_its_links_lead_somewhere(
    whole: tuple[Path, dict[str, Judgement]],
) -> None:
    out, judgements = whole
    page = (out / "report.html").read_text("utf-8")
    for name in FIGURES:
        assert f'<figure id="{name}">' in page
    assert "NOT PROVED" not in page
    links = re.findall(r'(?:href|src)="([^"]+)"', page)
    for link in links:
        assert link.startswith(("#", "data:")) or (out / link).exists(), link
    claims = json.loads((out / "claims.json").read_text("utf-8"))["claims"]
    assert [claim["name"] for claim in claims] == list(judgements)
    for claim in claims:
        assert claim["verdict"] == judgements[claim["name"]].verdict
        assert claim["rule"]
        for run in claim["runs"]:
            assert (out / run["folder"] / "metrics.json").is_file()


@pytest.mark.slow
def test_friction_holds_what_the_torque_balance_says(
    whole: tuple[Path, dict[str, Judgement]],
) -> None:
    from ttwmr_mj.studies.reproduce import friction

    evidence = Evidence(whole[0])
    rows, load = friction.balances(evidence), friction.largest_load_n_m(evidence)
    dry = rows[:-1]
    assert all(row.balanced for row in dry if row.stands)
    for row in dry:
        if row.friction_n_m > 1.05 * load:
            assert abs(row.hitch_angle_rad) < 0.01
    assert abs(dry[0].hitch_angle_rad) > 0.3  # free
    assert rows[-1].hitch_angle_rad == pytest.approx(0.5 * math.pi, abs=0.1)  # viscous
