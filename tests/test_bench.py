"""Suites: every row a real run that can be repeated, broken rows alone in their misfortune."""

from __future__ import annotations

import json
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from ttwmr_mj.assets import sweeps_folder
from ttwmr_mj.errors import InputError
from ttwmr_mj.studies.bench.suite import load_suite, rows_of

SUITE = """
name = "mine"
seeds = [0, 1]
timeout_s = 25.0

[controller.lyapunov]
overrides = ['controller={kind="lyapunov"}']

[controller.broken]
overrides = ['controller={kind="custom", target="misbehaving:Broken"}']

[controller.endless]
overrides = ['controller={kind="custom", target="misbehaving:Endless"}']

[task.circle]
scenario = "mine.toml"
overrides = ["duration_s=2.0", "sensing.position_noise_m=0.001"]

[plant.analytic]
overrides = ["plant.kind=analytic"]
"""


def bench(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "ttwmr_mj", "bench", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("bench")
    (folder / "suite.toml").write_text(SUITE)
    (folder / "misbehaving.py").write_text((Path(__file__).parent / "misbehaving.py").read_text())
    (folder / "mine.toml").write_text(
        'name = "mine"\nduration_s = 2.0\n[reference]\nkind = "circle"\nradius_m = 0.43\n'
        'angular_rate_rad_s = 0.125\ntheta2 = "outward"\n[controller]\nkind = "lyapunov"\n'
    )
    done = bench("suite.toml", "--out", "out", "--workers", "2", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.slow
def test_failures_stay_alone_and_say_why(finished: Path) -> None:
    table = pq.read_table(finished / "out" / "leaderboard.parquet").to_pylist()
    lines = {line["controller"]: line for line in table}
    assert (lines["lyapunov"]["failures"], lines["lyapunov"]["runs"]) == (0, 2)
    assert lines["lyapunov"]["P rms, mm"] > 0
    assert "ZeroDivisionError: of its own making" in lines["broken"]["reason"]
    assert lines["broken"]["failures"] == 2
    assert lines["broken"]["P rms, mm"] is None
    assert "no end within 25 s" in lines["endless"]["reason"]
    # the one that works is ranked first
    assert table[0]["controller"] == "lyapunov"


@pytest.mark.slow
def test_every_row_names_a_manifest_and_a_command_that_repeats_it(finished: Path) -> None:
    page = (finished / "out" / "leaderboard.html").read_text()
    line = pq.read_table(finished / "out" / "leaderboard.parquet").to_pylist()[0]
    manifest = json.loads((finished / "out" / line["manifest"]).read_text())
    assert manifest["scenario"] == "mine"
    assert line["manifest"] in page
    words = shlex.split(line["command"])
    assert words[:2] == ["ttwmr", "run"]
    again = [sys.executable, "-m", "ttwmr_mj", *words[1:], "--out", "again"]
    again += ["--set", "output.figures=false", "--quiet"]
    assert subprocess.run(again, cwd=finished, check=False).returncode == 0
    stored = (finished / "out" / line["manifest"]).parent / "trajectory.parquet"
    assert (finished / "again" / "trajectory.parquet").read_bytes() == stored.read_bytes()


@pytest.mark.slow
def test_rescoring_simulates_nothing_and_finished_rows_are_reused(finished: Path) -> None:
    first = (finished / "out" / "leaderboard.md").read_text()
    (finished / "out" / "leaderboard.md").unlink()
    # without its scenario no row could run again
    shutil.move(finished / "mine.toml", finished / "away.toml")
    for extra in (["--rescore"], []):
        done = bench("suite.toml", "--out", "out", *extra, cwd=finished)
        assert done.returncode == 0, done.stderr
        assert (finished / "out" / "leaderboard.md").read_text() == first
    shutil.move(finished / "away.toml", finished / "mine.toml")


@pytest.mark.parametrize("path", sorted(sweeps_folder().glob("*.toml")), ids=lambda p: p.stem)
def test_shipped_suites_have_distinct_rows_with_valid_overrides(path: Path) -> None:
    from ttwmr_mj.scenario_file import load_scenario

    rows = list(rows_of(load_suite(path.stem)))
    assert len({row.key for row in rows}) == len(rows) >= 20
    for row in rows:
        load_scenario(row.scenario, list(row.overrides), row.seed)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("name = 3", "name: got 3"),
        ('name = "a"\n[controller.x]\n[task.y]\n', "task.y.scenario: missing"),
        ("name = ", "cannot be read as TOML"),
    ],
)
def test_wrong_suites_are_refused(text: str, expected: str, tmp_path: Path) -> None:
    (tmp_path / "suite.toml").write_text(text)
    with pytest.raises(InputError, match=expected):
        load_suite(str(tmp_path / "suite.toml"))
    with pytest.raises(InputError, match=r"shipped: .*standard"):
        load_suite("nothing")


def test_rescoring_an_empty_folder_is_refused(tmp_path: Path) -> None:
    done = bench("quick", "--out", "out", "--rescore", cwd=tmp_path)
    assert done.returncode == 2
    assert "no finished runs" in done.stderr
