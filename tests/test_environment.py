"""What lies about on a machine, variables and files, neither ends a run nor runs within it."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

import ttwmr_mj
from ttwmr_mj.cli.main import main
from ttwmr_mj.files import variable
from ttwmr_mj.runs.process import machine
from ttwmr_mj.vision.camera.rendering import gl

TTWMR = [sys.executable, "-m", "ttwmr_mj"]
SHORT = ["--set=duration_s=0.1", "--out=out"]
NOTEBOOK = "module://matplotlib_inline.backend_inline"
STRANGERS = ("numpy", "mujoco", "json", "OpenGL", "scipy", "pyarrow", "multiprocessing", "struct")


def ttwmr(folder: Path, *words: str, **env: str) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [*TTWMR, *words],
        cwd=folder,
        env=os.environ | env,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert "Traceback" not in done.stderr
    return done


@pytest.mark.parametrize(
    ("which", "most", "words"),
    [
        (resource.RLIMIT_AS, 1_500_000_000, "1.5 GB (ulimit -v), but 6 GB are needed"),
        (resource.RLIMIT_NOFILE, 20, "20 files can be open at once (ulimit -n), but 64 are needed"),
    ],
)
def test_limits_of_the_shell_that_leave_no_room_are_refused(
    which: int, most: int, words: str, tmp_path: Path
) -> None:
    done = subprocess.run(
        [*TTWMR, "run", "lab_circle", *SHORT],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(which, (most, most)),
    )
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert words in done.stderr
    assert not any(tmp_path.iterdir())


def test_a_clock_that_python_cannot_read_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def late() -> float:
        raise OverflowError("timestamp too large to convert to C _PyTime_t")

    monkeypatch.setattr("time.time", late)
    assert main(["list"]) == 2
    told = capsys.readouterr().err
    assert "clock is beyond the year 2262" in told
    assert "set the clock" in told
    assert told.count("\n") == 1


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become somebody else")
def test_too_few_processes_are_refused(tmp_path: Path) -> None:
    """Root is not held to that limit, so the check is tried as somebody else is."""
    code = (
        "import os, resource; from ttwmr_mj.cli import last_resort; "
        "resource.setrlimit(resource.RLIMIT_NPROC, (most := {most}, most)); os.setuid(65534); "
        "last_resort.refuse_narrow_limits()"
    )
    for most, words in ((3, ["no more than 3 processes and threads"]), (1000, [])):
        done = subprocess.run(
            [sys.executable, "-c", code.format(most=most)],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert [word for word in words if word not in done.stderr] == [], done.stderr
        assert bool(done.returncode) == bool(words)


@pytest.mark.parametrize(
    "words", ["bench quick --quiet", pytest.param("video run -o film.mp4", marks=pytest.mark.slow)]
)
def test_nowhere_to_put_what_is_not_to_last_is_told(words: str, tmp_path: Path) -> None:
    if "run" in words:
        short = ["--set=duration_s=0.1", "--set=output.figures=false"]
        ttwmr(tmp_path, "run", "lab_circle", *short, "--out", "run")
    done = subprocess.run(
        [*TTWMR, *words.split()],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0)),
    )
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert "let TMPDIR name a folder" in done.stderr


@pytest.mark.slow
def test_the_end_of_the_time_that_was_allowed_is_as_ctrl_c(tmp_path: Path) -> None:
    done = subprocess.run(
        [*TTWMR, "run", "lab_circle", "--out", "out", "--set", "duration_s=3000", "--quiet"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (6, 60)),
    )
    assert done.returncode == 1, done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    assert not list(tmp_path.rglob("*.part"))
    assert (tmp_path / "out" / "metrics.json").is_file()


@pytest.mark.slow
def test_a_run_of_truth_obeys_no_variable(tmp_path: Path) -> None:
    strange = {"MUJOCO_GL": "garbage", "MPLBACKEND": "garbage", "RERUN": "off"}
    strange |= {"SOURCE_DATE_EPOCH": "garbage", "RERUN_FLUSH_NUM_BYTES": "garbage"}
    done = ttwmr(tmp_path, "run", "lab_circle", *SHORT, **strange)
    assert (done.returncode, done.stderr.replace("\r", "")[:7]) == (0, "")
    assert {"run.rrd", "summary.png"} <= {path.name for path in (tmp_path / "out").iterdir()}
    assert (tmp_path / "out" / "run.rrd").stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.parametrize("strange", ["osmesa", "glfw", "egl", "off"])
def test_nor_any_other_value_of_it(strange: str, tmp_path: Path) -> None:
    more = {"MUJOCO_GL": strange, "MPLBACKEND": NOTEBOOK, "RERUN": "false", "DISPLAY": ""}
    assert ttwmr(tmp_path, "run", "lab_circle", *SHORT, **more).returncode == 0


@pytest.mark.slow
def test_no_variable_chooses_for_the_camera(tmp_path: Path) -> None:
    strange = {"PYOPENGL_PLATFORM": "garbage", "SOURCE_DATE_EPOCH": "9" * 30}
    done = ttwmr(tmp_path, "run", "lab_circle_camera", "--quiet", *SHORT, **strange)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
@pytest.mark.parametrize("strange", ["garbage", "osmesa", "glfw", "off"])
def test_a_camera_that_cannot_have_what_was_asked_for_says_so(strange: str, tmp_path: Path) -> None:
    without = {"MUJOCO_GL": strange, "DISPLAY": "", "WAYLAND_DISPLAY": ""}
    done = ttwmr(tmp_path, "run", "lab_circle_camera", "--quiet", *SHORT, **without)
    if strange == "osmesa" and done.returncode == 0:
        pytest.skip("OSMesa works here")
    assert done.returncode == 2
    assert done.stderr.startswith("ttwmr: ")
    assert done.stderr.count("\n") == 1
    assert "MUJOCO_GL" in done.stderr


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ("garbage", "MUJOCO_GL=garbage ends camera runs, and no others; unset it, or set"),
        ("osmesa", "MUJOCO_GL=osmesa ends camera runs, and no others"),
        ("egl", ""),
        ("on", ""),
    ],
)
def test_the_doctor_tells(asked: str, told: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def probe(backend: str) -> gl.Probe:
        works = backend == "egl"
        return gl.Probe(backend, "llvmpipe" if works else None, "" if works else "no library")

    monkeypatch.setattr(machine, "probe", probe)
    for name, value in {"MUJOCO_GL": asked, "RERUN": "off", "MPLBACKEND": NOTEBOOK}.items():
        monkeypatch.setenv(name, value)
    text, healthy = machine.examine()
    assert healthy
    assert told in text
    assert ("MUJOCO_GL" in text) == bool(told)
    assert "RERUN=off changes nothing: output.recording decides" in text
    assert f"MPLBACKEND={NOTEBOOK} changes nothing" in text


def test_mujoco_has_one_door() -> None:
    package = Path(ttwmr_mj.__file__).parent
    doors = {
        path.relative_to(package).as_posix()
        for path in package.rglob("*.py")
        for line in path.read_text().splitlines()
        if line.strip().startswith(("import mujoco", "from mujoco"))
    }
    others = {"plants/model/scene/trial.py", "vision/camera/rendering/gl.py"}  # other processes
    assert doors == {"plants/model/engine.py", *others}


def test_a_variable_is_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TTWMR_A", "1")
    monkeypatch.delenv("TTWMR_B", raising=False)
    with variable("TTWMR_A", None), variable("TTWMR_B", "2"):
        assert ("TTWMR_A" in os.environ, os.environ["TTWMR_B"]) == (False, "2")
    assert (os.environ["TTWMR_A"], "TTWMR_B" in os.environ) == ("1", False)


@pytest.fixture
def littered(tmp_path: Path) -> Path:
    """A working directory with modules that nobody asked for, which leave a mark when they run."""
    mark = f"open({str(tmp_path / 'ran')!r}, 'a').write(__name__)\nraise SystemExit(0)\n"
    folder = tmp_path / "here"
    folder.mkdir()
    for name in STRANGERS:
        (folder / f"{name}.py").write_text(mark)
    (folder / "suite.toml").write_text(
        'name = "s"\n[controller.feedforward]\noverrides = ["controller={kind=\'feedforward\'}"]\n'
        '[task.circle]\nscenario = "lab_circle"\noverrides = ["duration_s=0.1"]\n'
    )
    (folder / "sweep.toml").write_text(
        'name = "s"\nscenario = "lab_circle"\noverrides = ["duration_s=0.1"]\n'
        '[parameters."robot.trailer.mass_kg"]\nvalues = [0.2, 0.3]\n'
    )
    return folder


LINES = [
    "list",
    "doctor",
    "run lab_circle --set duration_s=0.1",
    "bench suite.toml --out b",
    "sweep sweep.toml --workers 1 --out s",
    "run lab_circle_camera --set duration_s=0.1",
]


@pytest.mark.parametrize(
    "line", [LINES[0], *(pytest.param(line, marks=pytest.mark.slow) for line in LINES[1:])]
)
def test_files_that_lie_about_are_not_run(line: str, littered: Path) -> None:
    done = ttwmr(littered, *line.split())
    assert not (littered.parent / "ran").exists(), (littered.parent / "ran").read_text()
    assert done.stdout.strip(), done.stderr


@pytest.mark.slow
def test_a_home_that_cannot_be_written_is_nothing_to_tell(tmp_path: Path) -> None:
    """Where Matplotlib, which films and the check of libraries import, cannot keep its fonts."""
    home = {"HOME": "/proc/nowhere", "MPLCONFIGDIR": "", "XDG_CONFIG_HOME": ""}
    assert ttwmr(tmp_path, "run", "lab_circle", *SHORT, **home).stderr.replace("\r", "")[:7] == ""
    film = ["-o", "film.gif", "--view", "overhead", "--quiet"]
    for words in (["video", "out", *film], ["doctor"]):
        done = ttwmr(tmp_path, *words, **home)
        assert (done.returncode, done.stderr) == (0, ""), words
