"""`ttwmr new` writes what runs as written; `ttwmr validate` checks laws of the user's."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import ttwmr_mj as tt
from ttwmr_mj.assets import models_folder
from ttwmr_mj.cli.commands.new import ALLOWED
from ttwmr_mj.cli.main import main

SCENARIO = """name = "mine"
duration_s = 1.0
[plant]
kind = "analytic"
[reference]
kind = "circle"
radius_m = 0.5
angular_rate_rad_s = 0.1
[controller]
kind = "custom"
target = "{module}:{law}"
[controller.options]
{options}
"""
LAW = """import ttwmr_mj as tt
print("loaded", flush=True)

class Law(tt.Controller):
    def __init__(self, gain, more=2.0):
        self.gain = gain

    def start(self, task):
        {start}

    def command(self, k, estimate):
        return self.plain(0.0 * estimate.state.q[:, :2])

class Half(Law):
    pass

class Lame(tt.Controller):
    def start(self, task): pass

class Other:
    pass
"""


def python(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *words]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_what_new_writes_runs_and_passes_as_written(tmp_path: Path) -> None:
    def ttwmr(*words: str) -> subprocess.CompletedProcess[str]:
        return python("-m", "ttwmr_mj", *words, cwd=tmp_path)

    made = ttwmr("new", "my-first", "--controller")
    assert (made.returncode, made.stderr) == (0, "")
    files = ["my-first.toml", "my_first_law.py", "test_my_first_law.py"]
    assert sorted(path.name for path in tmp_path.iterdir()) == files
    for words in made.stdout.splitlines()[3:]:
        command = words.partition(": ")[2].split()
        lean = ["--quiet", "--out", "out"] if command[1] == "run" else []
        more = ["-m", "ttwmr_mj", *command[1:], *lean] if command[0] == "ttwmr" else command[1:]
        done = python(*more, cwd=tmp_path)
        assert done.returncode == 0, done.stdout + done.stderr
    assert "2 passed" in done.stdout
    again = ttwmr("new", "my-first")
    assert (again.returncode, "already" in again.stderr) == (2, True)


@pytest.mark.parametrize("found", [None, "there"])
def test_how_to_get_pytest_is_told_where_it_is_missing(
    found: str | None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("ttwmr_mj.cli.commands.new.find_spec", lambda _: found)
    assert main(["new", "tested", "--controller", "--out", str(tmp_path)]) == 0
    assert ("pip install pytest" in capsys.readouterr().out) is (found is None)


@pytest.mark.slow
def test_a_new_scenario_is_followed(tmp_path: Path) -> None:
    assert main(["new", "plain", "--out", str(tmp_path)]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["plain.toml"]
    scenario = tt.load_scenario(str(tmp_path / "plain.toml"))
    (verdict,) = tt.simulate(scenario).verdicts
    assert verdict.name == "followed"


@pytest.mark.parametrize("name", ["2nd", "a-b_c"])
def test_any_name_gives_a_module_that_can_be_imported(name: str, tmp_path: Path) -> None:
    assert main(["new", name, "--controller", "--out", str(tmp_path)]) == 0
    (module,) = (path for path in tmp_path.glob("*_law.py") if not path.name.startswith("test"))
    assert module.stem.isidentifier()
    assert main(["validate", str(tmp_path / f"{name}.toml"), "--load"]) == 0


def test_a_name_that_is_none(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new", "My Law"]) == 2
    assert f"NAME: got 'My Law'; allowed: {ALLOWED}" in capsys.readouterr().err


def test_the_help_calls_things_as_messages_and_files_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(["new", "--help"])
    told = " ".join(capsys.readouterr().out.split())
    assert " NAME " in told.partition("positional arguments")[0]
    assert f"NAME name of the scenario: {ALLOWED}" in told
    assert "in these names - becomes _, and my_ is put before a digit at the beginning" in told
    for name in ("1", "a-b"):
        assert main(["new", name, "--controller", "--out", str(tmp_path)]) == 0
    laws = {path.name for path in tmp_path.glob("*_law.py")}
    assert laws == {"my_1_law.py", "test_my_1_law.py", "a_b_law.py", "test_a_b_law.py"}


@pytest.mark.parametrize(
    ("law", "options", "start", "read", "loaded"),
    [
        ("Law", "gain = 1.0", "pass", "", ""),
        ("Half", "gain = 1.0", "pass", "", ""),
        ("Law", "gain = 1.0", "1 / 0", "", "controller.start() raised ZeroDivisionError"),
        ("Law", "more = 1.0", "pass", "options.gain: missing; Law has no default", "missing 1 req"),
        ("Half", "gain = 1\nmor = 2", "pass", "options.mor: Half does not take it", "unexpected"),
        ("Lame", "", "pass", "Lame has no method command", "abstract"),
        ("Other", "", "pass", "Other does not derive from", "derives from"),
        ("None_", "", "pass", "has no class None_; allowed: Law, Half, Lame, Other", "no class"),
        ("Law", "gain = 1.0", "return (", "cannot be read", "SyntaxError"),
    ],
)
def test_a_law_of_the_users_is_read_or_loaded(
    law: str,
    options: str,
    start: str,
    read: str,
    loaded: str,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    request: pytest.FixtureRequest,
) -> None:
    module = f"law_{abs(hash(request.node.name))}"  # a name that no test imported before
    (tmp_path / f"{module}.py").write_text(LAW.format(start=start))
    path = tmp_path / "mine.toml"
    path.write_text(SCENARIO.format(module=module, law=law, options=options))
    assert main(["validate", str(path)]) == (2 if read else 0)
    out, err = capfd.readouterr()
    assert read in err
    assert "loaded" not in out
    assert ("was read, not run; --load imports and starts it" in out) is not bool(read)
    assert main(["validate", str(path), "--load"]) == (2 if loaded else 0)
    out, err = capfd.readouterr()
    assert loaded in err
    assert "was read" not in out


def test_a_module_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(SCENARIO.format(module="nowhere_law", law="Law", options=""))
    assert main(["validate", str(path)]) == 2
    assert "there is no module nowhere_law; it must be beside the scenario" in (
        capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("name", "values", "key"),
    [
        ("lab_circle_camera", ["sensing.camera.lens.k1=-1.0"], "sensing.camera.lens"),
        ("lab_circle_camera", ["sensing.camera.lens.k3=-1.0"], "sensing.camera.lens"),
        ("lab_circle_camera", ["sensing.camera.name=attic"], "sensing.camera.name"),
        (
            "lab_circle_camera",
            ["sensing.camera.width_px=320", "sensing.camera.height_px=240"],
            "sensing.calibration_path",
        ),
        ("rest_to_rest_camera", ["belief.camera.lens.k2=-1.0"], "belief.camera"),
        ("lab_circle", [f"plant.contact.model_path={__file__}"], "plant.contact.model_path"),
    ],
)
def test_what_a_run_would_refuse_is_not_valid(
    name: str, values: list[str], key: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [word for value in values for word in ("--set", value)]
    _refused(name, given, key, tmp_path, capsys)


def _refused(
    name: str, given: list[str], key: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> str:
    """What `validate` and `run` say of a key, which is the same."""
    told = []
    for command in (["validate", name], ["run", name, "--out", str(folder / "out")]):
        assert main([*command, *given]) == 2
        out, err = capsys.readouterr()
        assert "valid" not in out
        line = next(line for line in err.splitlines() if key in line and "warning: " not in line)
        told.append(line.removeprefix("ttwmr:").strip())
    assert told[0].split(": got")[-1] == told[1].split(": got")[-1]
    return told[0]


@pytest.mark.parametrize(
    ("hung", "key", "told"),
    [
        ('pos="0 0 1.9" euler="3.1416 0 0" fovy="41"', "sensing.camera.name", "does not look down"),
        ('pos="0 0 0.06" fovy="41"', "sensing.camera", "0.06 m above the floor, and the robot's"),
        ('pos="0 0 1.9" fovy="0.05"', "sensing.camera", "a label is 1.082e+04 px wide"),
    ],
)
def test_a_scenes_camera_that_cannot_see_the_labels_is_refused(
    hung: str, key: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(models_folder(), tmp_path / "mine")
    scene = tmp_path / "mine" / "scene.xml"
    text, count = re.subn('pos="0 0 1.9" fovy="41.1"', hung, scene.read_text())
    assert count == 1
    scene.write_text(text)
    given = ["--set", f"plant.contact.model_path={scene}"]
    assert told in _refused("lab_circle_camera", given, key, tmp_path, capsys)


def test_whether_a_camera_can_be_calibrated_is_left_to_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = SCENARIO.partition("[controller]")[0] + '[controller]\nkind = "lyapunov"\n'
    file, out = tmp_path / "mine.toml", tmp_path / "out"
    hung = "{ height_m = 20.0, width_px = 160, height_px = 120 }"
    file.write_text(f'{text}[sensing]\nkind = "camera"\ncamera = {hung}\n')
    assert main(["validate", str(file)]) == 0
    assert "valid (whether its camera can be calibrated, a run finds out" in capsys.readouterr().out
    assert main(["run", str(file), "--out", str(out)]) == 2
    assert "before a run the camera is calibrated" in capsys.readouterr().err
    assert not out.exists()
    assert main(["validate", "lab_circle_camera"]) == 0
    assert capsys.readouterr().out == "lab_circle_camera: valid\n"
