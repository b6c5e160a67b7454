"""The command line as a user meets it: real processes, exit codes, files, signals."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from ttwmr_mj.assets import shipped_scenarios
from ttwmr_mj.controllers.base import CONTROLLERS
from ttwmr_mj.references.shared.reference import REFERENCES
from ttwmr_mj.results.metrics import METRICS, meaning_of
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.studies.bench.suite import shipped_suites
from ttwmr_mj.studies.sweep.plan.file import shipped_sweeps

QUICK = ["--set", "duration_s=1.0", "--set", "output.figures=false"]


HELP_IMPORTS = """
import sys
from ttwmr_mj.cli.main import main
try:
    main(["--help"])
except SystemExit:
    heavy = {"mujoco", "numpy", "rerun", "cv2", "matplotlib", "pydantic", "scipy"}
    sys.exit(str(heavy & set(sys.modules)) if heavy & set(sys.modules) else 0)
"""


def ttwmr(*arguments: str, cwd: Path, timeout: float = 120) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "ttwmr_mj", *arguments],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


@pytest.mark.slow
def test_the_plots_of_the_article_are_drawn_on_demand(tmp_path: Path) -> None:
    lean = ["--set", "duration_s=0.3", "--set", "output.recording=false"]
    words = ["run", "lab_circle", *lean, "--set", "output.figures=false", "--paper-plots"]
    done = ttwmr(*words, "--out", "out", cwd=tmp_path, timeout=600)
    assert done.returncode == 0, done.stderr
    assert {path.suffix for path in (tmp_path / "out/figures").iterdir()} == {".png", ".svg"}
    assert (tmp_path / "out/figures/theta2.svg").is_file()
    assert not list((tmp_path / "out").glob("summary.*"))


@pytest.mark.slow
def test_run_leaves_a_complete_run_folder(tmp_path: Path) -> None:
    done = ttwmr("run", "lab_circle", "--set", "duration_s=2.0", "--seed", "3", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "P, rms error" in done.stdout
    (folder,) = (tmp_path / "results" / "lab_circle").iterdir()
    assert folder.name.endswith("-3")
    names = {path.name for path in folder.iterdir()}
    assert names == {
        "scenario.resolved.toml",
        "manifest.json",
        "trajectory.parquet",
        "metrics.json",
        "run.rrd",
        "summary.png",
        "summary.svg",
        "summary.pdf",
    }
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["schema_version"] == 1
    assert manifest["seed"] == 3
    assert manifest["command_line"][:3] == ["ttwmr", "run", "lab_circle"]
    assert manifest["libraries"]["mujoco"]
    metrics = json.loads((folder / "metrics.json").read_text())
    assert metrics["status"] == "ok"
    assert metrics["tractor_rmse_m"] > 0
    # 2.0 s are 60 whole periods of 33 ms, and both ends are samples
    assert pq.read_table(folder / "trajectory.parquet").num_rows == 61
    again = load_scenario(str(folder / "scenario.resolved.toml"))
    assert (again.seed, again.duration_s) == (3, 2.0)


@pytest.mark.slow
def test_the_same_command_gives_the_same_bytes_of_numbers(tmp_path: Path) -> None:
    files = []
    for name in ("a", "b"):
        noisy = ["--set", "sensing.position_noise_m=0.002"]
        done = ttwmr("run", "lab_circle", *QUICK, *noisy, "--out", name, "--quiet", cwd=tmp_path)
        assert (done.returncode, done.stdout, done.stderr) == (0, f"{name}\n", "")
        files.append((tmp_path / name / "trajectory.parquet").read_bytes())
    assert files[0] == files[1]


def test_a_folder_that_holds_something_is_refused_without_force(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("keep me")
    arguments = ["run", "lab_circle", *QUICK, "--out", "mine", "--quiet"]
    refused = ttwmr(*arguments, cwd=tmp_path)
    assert refused.returncode == 2
    assert "not empty" in refused.stderr
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["notes.txt"]
    assert ttwmr(*arguments, "--force", cwd=tmp_path).returncode == 0
    assert (tmp_path / "mine" / "notes.txt").read_text() == "keep me"


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["run", "lab_cirle"], "did you mean 'lab_circle'"),
        (["run", "lab_circle", "--set", "duration_s=1e12"], "duration_s: got 1000000000000.0"),
        (["run", "lab_circle", "--set", "robot.tractor.mass_kg=nan"], "a finite number"),
        (["run", "lab_circle", "--set", "plant.contact.model_path=no.xml"], "no such file"),
        (["run", "lab_circle", "--seed", "-1"], "seed: got -1"),
        (["validate", "lab_circle", "missing.toml"], "missing.toml: no such scenario"),
        (["view", "missing.rrd"], "missing.rrd: no such file"),
        (["view"], "no recording under results/"),
        (["runn"], "there is no command 'runn'; did you mean 'run'?"),
        (["fly"], "there is no command 'fly'; there are bench, "),
        (["--fly"], "the following arguments are required"),
    ],
)
def test_wrong_input_is_exit_code_2_and_one_readable_block(
    arguments: list[str], expected: str, tmp_path: Path
) -> None:
    done = ttwmr(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert expected in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ("lab_circle: valid\n" if "missing.toml" in arguments else "")
    assert list(tmp_path.iterdir()) == []


def test_debug_shows_the_traceback(tmp_path: Path) -> None:
    done = ttwmr("run", "lab_cirle", "--debug", cwd=tmp_path)
    assert done.returncode != 0
    assert "Traceback" in done.stderr


def test_validate_is_silent_on_all_shipped_scenarios(tmp_path: Path) -> None:
    done = ttwmr("validate", *shipped_scenarios(), cwd=tmp_path)
    assert done.returncode == 0
    assert done.stdout.splitlines() == [f"{name}: valid" for name in shipped_scenarios()]
    # what a shipped scenario says of itself
    told = {line.split(": ")[2] for line in done.stderr.splitlines()}
    lost = {n for n in shipped_scenarios() if "lost" in load_scenario(n).accept.verdict}
    followed = {"double_eight"}  # knots too coarse for its turns (docs/results/trains.md)
    assert told == {"figure_eight", "spline"} | followed
    assert told - followed <= lost


def test_without_a_command_there_are_three_to_try(tmp_path: Path) -> None:
    done = ttwmr(cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "usage: ttwmr" in done.stdout
    tried = done.stdout.partition("three to try:")[2].split("\n  ttwmr ")[1:]
    assert [words.split()[0] for words in tried] == ["run", "view", "list"]


def _description(path: Path) -> str:
    return str(tomllib.loads(path.read_text(encoding="utf-8"))["description"])


def test_list_names_every_scenario_and_kind_with_its_description(tmp_path: Path) -> None:
    done = ttwmr("list", cwd=tmp_path)
    assert done.returncode == 0
    assert max(map(len, done.stdout.splitlines())) <= 80
    metrics = {name: f"{meaning_of(name)} [{m.unit}]" for name, m in METRICS.items()}
    metrics = {name: text for name, text in metrics.items() if not name.startswith("steady_")}
    column = max(map(len, [*metrics, *shipped_scenarios()])) + 4
    listed: dict[str, dict[str, str]] = {}
    for line in filter(None, done.stdout.splitlines()):
        if not line.startswith("  "):
            entries = listed.setdefault(line.partition(":")[0], {})
            continue
        assert line[column - 1] == " " != line[column]
        name, text = line[:column].strip(), line[column:]
        if name:
            last = name
            entries[name] = text
        else:
            entries[last] += f" {text}"
    assert listed == {
        "scenarios": {name: load_scenario(name).description for name in shipped_scenarios()},
        "laws": {kind: cls.summary() for kind, cls in CONTROLLERS.items()},
        "references": {kind: cls.summary() for kind, cls in REFERENCES.items()},
        "suites": {name: _description(path) for name, path in shipped_suites().items()},
        "sweeps": {name: _description(path) for name, path in shipped_sweeps().items()},
        "metrics": metrics,
    }


def test_export_schema_is_json_schema(tmp_path: Path) -> None:
    printed = ttwmr("export-schema", cwd=tmp_path)
    assert printed.returncode == 0
    schema = json.loads(printed.stdout)
    assert schema["title"] == "Scenario"
    written = ttwmr("export-schema", "--out", "schema.json", cwd=tmp_path)
    assert (written.returncode, written.stdout, written.stderr) == (0, "", "")
    assert json.loads((tmp_path / "schema.json").read_text()) == schema
    (tmp_path / "schema.json").write_text("mine")
    refused = ttwmr("export-schema", "--out", "schema.json", cwd=tmp_path)
    told = "ttwmr: --out: there is schema.json already; name another, or add --force"
    assert (refused.returncode, refused.stdout, refused.stderr.strip()) == (2, "", told)
    assert (tmp_path / "schema.json").read_text() == "mine"
    replaced = ttwmr("export-schema", "--out", "schema.json", "--force", cwd=tmp_path)
    assert (replaced.returncode, replaced.stdout, replaced.stderr) == (0, "", "")
    assert json.loads((tmp_path / "schema.json").read_text()) == schema


def test_doctor_reports_versions_and_backends(tmp_path: Path) -> None:
    done = ttwmr("doctor", cwd=tmp_path)
    assert done.returncode == 0
    for word in ("mujoco", "rerun-sdk", "egl", "osmesa", "Vulkan"):
        assert word in done.stdout


def test_help_needs_none_of_the_heavy_libraries(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", HELP_IMPORTS],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
def test_a_failed_run_is_exit_code_1_with_its_reason_and_its_files(tmp_path: Path) -> None:
    (tmp_path / "misbehaving.py").write_text((Path(__file__).parent / "misbehaving.py").read_text())
    (tmp_path / "mine.toml").write_text(
        'name = "mine"\nduration_s = 2.0\n[reference]\nkind = "none"\n'
        '[controller]\nkind = "custom"\ntarget = "misbehaving:Broken"\n'
    )
    mine = ("run", "mine.toml", "--set", "output.figures=false")
    done = ttwmr(*mine, "--out", "out", cwd=tmp_path)
    assert done.returncode == 1
    assert "mine failed at 0.165 s" in done.stderr
    assert "ZeroDivisionError: of its own making" in done.stderr
    assert "Traceback" not in done.stderr
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert metrics["status"] == "failed"
    assert "ZeroDivisionError" in metrics["reason"]
    assert metrics["tractor_rmse_m"] is None
    assert recorded_rows(tmp_path / "out" / "run.rrd") == 6
    debugged = ttwmr(*mine, "--out", "out2", "--debug", cwd=tmp_path)
    assert "raise ZeroDivisionError" in debugged.stderr


def recorded_rows(path: Path, *, torn: bool = False) -> int:
    """Rows of the tractor's transform in a recording.

    The last message of a file that is being written, or whose writer was killed, may be torn. The
    viewer and `rerun rrd merge` leave it out; the strict reader wants it left out before.
    """
    from rerun.chunk import RrdReader

    if torn:
        whole = path.with_suffix(".whole.rrd")
        merge = [sys.executable, "-m", "rerun", "rrd", "merge", str(path), "-o", str(whole)]
        subprocess.run(merge, check=True, capture_output=True, timeout=60)
        path = whole
    chunks = RrdReader(path).stream().filter(content="/world/tractor").to_chunks()
    batches = [chunk.to_record_batch() for chunk in chunks]
    return sum(batch.num_rows for batch in batches if "sim_time" in batch.schema.names)


@pytest.mark.slow
@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_cleanly(signum: signal.Signals, tmp_path: Path) -> None:
    process = start_long_run(tmp_path)
    process.send_signal(signum)
    assert process.wait(timeout=60) == 1
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert metrics["status"] == "interrupted"
    rows = pq.read_table(tmp_path / "out" / "trajectory.parquet").num_rows
    assert rows == recorded_rows(tmp_path / "out" / "run.rrd") > 0


@pytest.mark.slow
def test_a_killed_run_leaves_a_readable_recording(tmp_path: Path) -> None:
    recording = tmp_path / "out" / "run.rrd"
    process = start_long_run(tmp_path)
    deadline = time.monotonic() + 60
    while (rows := recorded_rows(recording, torn=True)) == 0:  # a reviewer may look while it runs
        assert time.monotonic() < deadline
        time.sleep(0.1)
    process.kill()
    process.wait(timeout=60)
    assert recorded_rows(recording, torn=True) >= rows


def start_long_run(folder: Path) -> subprocess.Popen[bytes]:
    """A run of an hour's simulated time, started and already recording."""
    process = subprocess.Popen(
        [sys.executable, "-m", "ttwmr_mj", "run", "lab_circle", "--out", "out"]
        + ["--set", "duration_s=3600.0", "--set", "output.figures=false"],
        cwd=folder,
        stderr=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    )
    recording = folder / "out" / "run.rrd"
    deadline = time.monotonic() + 60
    while not (recording.exists() and recording.stat().st_size > 200_000):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.05)
    return process
