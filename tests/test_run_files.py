"""What a run leaves beside its trajectory: manifest, metrics, the words of its report."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

import ttwmr_mj as tt
from ttwmr_mj.cli.main import main
from ttwmr_mj.results.metrics import METRICS
from ttwmr_mj.results.metrics_file import read_metrics
from ttwmr_mj.runs.files import folder as folders
from ttwmr_mj.runs.files.folder import git_commit, results_folder
from ttwmr_mj.runs.report import (
    HEADLINES,
    RESULT_ROWS,
    details_text,
    figure_title,
    headline,
    headline_words,
    result_text,
    results,
    summary,
)

QUIET = ["plant.kind=analytic", "output.recording=false", "output.figures=false"]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[tt.Scenario, Path, dict[str, float]]:
    scenario = tt.load_scenario("lab_circle", [*QUIET, "duration_s=1.0"], seed=7)
    out = tmp_path_factory.mktemp("files") / "out"
    done = tt.run(scenario, out)
    return scenario, out, done.wall_time_s


def test_the_manifest_says_what_made_the_folder(
    run: tuple[tt.Scenario, Path, dict[str, float]],
) -> None:
    manifest = json.loads((run[1] / "manifest.json").read_text())
    assert (
        list(manifest)
        == (
            "schema_version scenario seed pushes plant command_line created_utc ttwmr_mj python "
            "platform libraries gl_backend git_commit"
        ).split()
    )
    assert manifest["schema_version"] == 1
    assert (manifest["scenario"], manifest["seed"]) == ("lab_circle", 7)
    assert (manifest["plant"], manifest["command_line"]) == ("analytic", [])
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\+00:00", manifest["created_utc"])
    assert manifest["ttwmr_mj"] == tt.__version__
    assert {"mujoco", "numpy", "rerun-sdk", "opencv-python-headless", "pydantic", "pyarrow"} == set(
        manifest["libraries"]
    )
    assert manifest["libraries"]["numpy"] == np.__version__
    assert manifest["gl_backend"] is None
    assert manifest["git_commit"] == git_commit()


def test_the_resolved_scenario_runs_as_it_is(
    run: tuple[tt.Scenario, Path, dict[str, float]],
) -> None:
    scenario, out, _ = run
    assert tt.load_scenario(str(out / "scenario.resolved.toml")) == scenario


def test_metrics_add_up(run: tuple[tt.Scenario, Path, dict[str, float]]) -> None:
    scenario, out, wall_time_s = run
    metrics = json.loads((out / "metrics.json").read_text())
    rows = tt.Trajectory.read(out / "trajectory.parquet")
    (numbers,) = tt.score(rows, scenario.robot)
    assert {name: metrics[name] for name in METRICS} == numbers
    assert (metrics["status"], metrics["reason"]) == ("ok", "")
    assert metrics["end_time_s"] == scenario.periods * 0.033
    before = ("setup", "plant", "sensing", "controller", "loop", "recording")
    assert set(wall_time_s) == {*before, "files", "figures"}
    assert min(wall_time_s.values()) >= 0.0
    assert metrics["wall_time_s"] == pytest.approx(sum(wall_time_s[part] for part in before))
    factor = metrics["end_time_s"] / metrics["wall_time_s"]
    assert metrics["real_time_factor"] == pytest.approx(factor)
    each_us = 1e6 * wall_time_s["controller"] / len(rows)
    assert metrics["control_time_per_sample_us"] == pytest.approx(each_us)
    assert 1e-6 * each_us <= metrics["control_slowest_s"] <= wall_time_s["controller"]
    assert metrics["control_overruns"] <= len(rows)


def test_a_clock_that_stands_still_gives_no_real_time_factor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("ttwmr_mj.runs.closed_loop.stopwatch.perf_counter", lambda: 7.0)
    lean = ["duration_s=0.1", "output.recording=false", "output.figures=false"]
    sets = [word for one in lean for word in ("--set", one)]
    folder = tmp_path / "run"
    assert main(["run", "lab_circle", "--out", str(folder), *sets]) == 0
    assert re.search(r"undefined +real_time_factor", capsys.readouterr().out)
    metrics = read_metrics(folder / "metrics.json")
    assert (metrics["wall_time_s"], metrics["real_time_factor"]) == (0.0, None)


def test_a_commit_is_named_whole_and_dirty_if_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(folders, "__file__", str(tmp_path / "package" / "runs" / "folder.py"))
    assert git_commit() is None  # no checkout

    def git(*words: str) -> str:
        identity = ["-c", "user.name=a", "-c", "user.email=a@b"]
        command = ["git", "-C", str(tmp_path), *identity, *words]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    git("init")
    assert git_commit() is None  # no commit
    (tmp_path / "file").write_text("one")
    git("add", "file")
    git("commit", "-m", "one")
    git("tag", "-a", "v1", "-m", "v1")
    commit = git("rev-parse", "HEAD")
    (tmp_path / "untracked").touch()
    assert git_commit() == commit
    (tmp_path / "file").write_text("two")
    assert git_commit() == f"{commit}-dirty"


def test_default_folders_sort_by_time() -> None:
    path = results_folder("lab_circle", 7)
    assert re.fullmatch(r"results/lab_circle/\d{8}T\d{6}\.\d{3}Z-7", path.as_posix())


def test_numbers_are_read_in_handy_units() -> None:
    metrics = {key: 0.0123456 for key, *_ in RESULT_ROWS}
    metrics |= dict.fromkeys(HEADLINES, 0.0123456)
    metrics |= {"settling_time_s": None, "control_overruns": 3}
    metrics |= {"verdict": "tractor_follows_trailer_lost", "verdict_reason": "θ2 2 rad off"}
    shown = results(metrics)
    assert shown["P, rms error"] == "12.3 mm"
    assert shown["θ1, rms error, 2nd half"] == "12.3 mrad"
    assert shown["settled (1 cm) after"] == "undefined"
    assert shown["fastest wheel"] == "0.0123 rad/s"
    assert shown["saturated samples"] == "1.23 %"
    assert shown["commands slower than the period"] == "3"
    assert shown["slowest command, wall time"] == "12.3 ms"
    scenario = tt.load_scenario("lab_circle")
    assert result_text(scenario, metrics).split("\n\n") == [
        "# Tractor follows, trailer lost",
        "## 12.3 mm: trailer's F, rms error, 2nd half",
        "θ2 2 rad off",
        scenario.description,
        "contact · lyapunov · sees the truth · seed 0",
    ]
    details = details_text(metrics)
    assert details.startswith(
        "**tractor follows, trailer lost: θ2 2 rad off**\n\n"
        "steady_centre_of_oscillation_rmse_m = 0.0123\n\n| result | value |\n|---|---|\n"
    )
    assert "| P, rms error | 12.3 mm |\n" in details
    assert figure_title(scenario, metrics) == [
        "lab_circle: tractor follows, trailer lost",
        "contact · lyapunov · sees the truth · seed 0",
        "12.3 mm: trailer's F, rms error, 2nd half",
    ]
    broken = metrics | {"verdict": "failed", "verdict_reason": "it broke"}
    assert result_text(scenario, broken).startswith("# Failed\n\n## 12.3 mm")


def test_the_headline_is_the_metric_of_the_task() -> None:
    centre, tractor = HEADLINES
    assert headline({centre: 2e-3, tractor: 1e-3}) == f"{centre} = 0.002"
    assert headline({centre: None, tractor: 1e-3}) == f"{tractor} = 0.001"
    assert headline({centre: None, tractor: None}) == ""
    assert headline_words({centre: 2e-3, tractor: 1e-3}) == "2 mm: trailer's F, rms error, 2nd half"
    assert headline_words({centre: None, tractor: 1e-3}) == "1 mm: P, rms error, 2nd half"
    assert headline_words({centre: None, tractor: None}) == ""


def test_the_summary_says_what_was_asked() -> None:
    lines = summary(tt.load_scenario("lab_circle", seed=3)).splitlines()
    assert lines[0] == "# lab_circle"
    assert lines[4:6] == ["| setting | value |", "|---|---|"]
    for row in ("plant | contact", "controller | lyapunov", "reference | circle", "seed | 3"):
        assert f"| {row} |" in lines
    for row in ("control period | 33 ms", "duration | 50 s", "servo | lab", "start | at_rest"):
        assert f"| {row} |" in lines
