"""The reproduction at work: runs made once, drawn, judged, reported."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from ttwmr_mj.errors import InputError, MachineError
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.studies.pool.jobs import Failed, Job
from ttwmr_mj.studies.reproduce import execute, runs, study
from ttwmr_mj.studies.reproduce.claims import friction
from ttwmr_mj.studies.reproduce.claims.claims import CLAIMS, Judgement
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.figures.figures import FIGURES
from ttwmr_mj.studies.reproduce.runs import RUNS, RunSpec
from ttwmr_mj.studies.reproduce.study import reproduce


@pytest.fixture
def short_run(monkeypatch: pytest.MonkeyPatch) -> str:
    spec = RunSpec("short", "lab_circle", ("plant.kind=analytic", "duration_s=0.5"), False)
    monkeypatch.setitem(runs.RUNS, "short", spec)
    return "short"


def test_a_finished_run_is_used_again_and_only_then(
    short_run: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing() -> list[str]:
        return [task.job.name for task in execute.missing_tasks(tmp_path, [short_run], [])]

    folder = execute.run_folder(tmp_path, short_run)
    tasks = execute.missing_tasks(tmp_path, [short_run], [])
    assert execute.execute(tasks) == []
    assert missing() == []
    assert "lyapunov_v" in Trajectory.read(folder / "trajectory.parquet").signals

    with monkeypatch.context() as other:  # another scenario under the same name
        changed = RunSpec("short", "lab_circle", ("plant.kind=analytic", "duration_s=0.6"), False)
        other.setitem(runs.RUNS, "short", changed)
        assert missing() == [short_run]
    assert missing() == []

    (folder / "made_of.json").unlink()  # as a kill leaves it
    assert missing() == [short_run]
    (folder / "leftover").touch()
    execute.execute(tasks)
    assert not (folder / "leftover").exists()


def test_what_cannot_be_run_is_named_and_the_rest_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = ('controller={kind="custom", target="nowhere:Law"}', "duration_s=0.5")
    monkeypatch.setitem(runs.RUNS, "lab-pid", RunSpec("lab-pid", "lab_circle", broken, False))
    whole = RunSpec("lab-pid-without", "lab_circle", ("duration_s=0.5",), False)
    monkeypatch.setitem(runs.RUNS, "lab-pid-without", whole)
    done = reproduce(tmp_path / "out", ["fig15"], quiet=True)
    assert list(done.failures) == ["lab-pid"]
    assert "importing nowhere raised" in done.failures["lab-pid"]
    assert done.runs_failed
    page = done.report.read_text("utf-8")
    assert "Not run: lab-pid." in page
    assert "<td>not run</td>" in page
    assert "<td>lost: P " in page  # half a second is too short for the offset of the start


@pytest.mark.parametrize(
    ("name", "error", "failed"),
    [
        ("continuous", MachineError("no such library"), False),
        ("continuous", None, True),  # it broke
        ("lab-pid", MachineError("no such library"), True),
    ],
)
def test_only_a_study_without_its_library_is_no_failure(
    name: str,
    error: MachineError | None,
    failed: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    event = Failed(Job(name, print), "no such library", error)
    monkeypatch.setattr(study, "execute", lambda *_: [event])
    figure = "continuous" if name == "continuous" else "fig15"
    shown = FIGURES[figure]
    only = replace(shown.numbers, needed=(name,))  # no other is there
    monkeypatch.setitem(FIGURES, figure, replace(shown, numbers=only))
    done = reproduce(tmp_path / "out", [figure], quiet=True)
    assert done.failures == {name: "no such library"}
    assert done.runs_failed == failed


@pytest.mark.slow
def test_one_figure_alone(tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = reproduce(out, ["phase-plane"], quiet=True)
    assert done.report == out / "report-phase-plane.html"
    page = done.report.read_text("utf-8")
    assert page.count('<svg class="drawing"') == 1
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
    with pytest.raises(InputError, match=r"holds other files \(thesis.tex\)"):
        reproduce(tmp_path, ["phase-plane"], quiet=True)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_importing_the_study_imports_no_matplotlib_sympy_or_mujoco() -> None:
    code = (
        "import sys, ttwmr_mj.studies.reproduce.study;"
        "import ttwmr_mj.studies.reproduce.figures.drawings;"
        "print({'matplotlib', 'sympy', 'mujoco', 'jinja2'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("set()\n", "")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, dict[str, Judgement]]]:
    """Every run and study; without the camera, which takes half the time and has its own tests.

    Runs are a fifth shorter than the article's, and settle all the same. One run is recorded, so
    that the report has a recording to link to.
    """
    with pytest.MonkeyPatch.context() as patch:
        for name, spec in RUNS.items():
            blind = [told for told in spec.overrides if not told.startswith("sensing.")]
            short = (*blind, *(() if name.startswith("friction-") else ("duration_s=40.0",)))
            recorded = name == "law32-omitted-analytic"
            patch.setitem(RUNS, name, replace(spec, overrides=short, recording=recorded))
        out = tmp_path_factory.mktemp("reproduce")
        done = reproduce(out, quiet=True)
        assert done.failures == {}
        assert not done.runs_failed
        yield out, done.judgements


@pytest.mark.slow
def test_the_verdicts_of_the_whole_reproduction(whole: tuple[Path, dict[str, Judgement]]) -> None:
    verdicts = {name: judgement.verdict for name, judgement in whole[1].items()}
    assert set(verdicts) == set(CLAIMS)
    for name in ("theorem-1", "v-decreases", "theorem-2", "fig-3", "low-effort"):
        assert verdicts[name] == "holds with changes", name
    for name in ("theorem-3", "law-70", "rho-is-constant", "figs-7-8", "finite-time"):
        assert verdicts[name] == "fails", name
    for name in ("fig-4", "fig-6", "higher-position-gains", "robust", "experiment-agrees"):
        assert verdicts[name] == "holds with changes", name
    for name in ("virtual-spring", "higher-velocity-gains", "higher-pid-gains"):
        assert verdicts[name] == "fails", name
    assert verdicts["poles"] == "holds"
    assert verdicts["figs-11-16"] == "undecided"  # a hitch without friction lets the trailer go


@pytest.mark.slow
def test_the_report_stands_alone_and_its_links_lead_somewhere(
    whole: tuple[Path, dict[str, Judgement]],
) -> None:
    out, judgements = whole
    page = (out / "report.html").read_text("utf-8")
    for name in FIGURES:
        assert page.count(f'<figure id="{name}">') == 1
    for name, claim in CLAIMS.items():  # a figure stands with what it shows
        section = page.split(f'<h3 id="claim-{name}">')[1].split('<h3 id="claim-')[0]
        assert all(f'<figure id="{figure}">' in section for figure in claim.figures), name
    assert "NOT PROVED" not in page
    assert "runs/law32-omitted-analytic/run.rrd" in page
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
    evidence = Evidence(whole[0])
    rows, load = friction.balances(evidence), friction.largest_load_n_m(evidence)
    dry = rows[:-1]
    assert all(row.balanced for row in dry if row.stands)
    for row in dry:
        if row.friction_n_m > 1.05 * load:
            assert abs(row.hitch_angle_rad) < 0.01
    assert abs(dry[0].hitch_angle_rad) > 0.3  # free
    assert rows[-1].hitch_angle_rad == pytest.approx(0.5 * math.pi, abs=0.1)  # viscous
