"""Laws and references of installed packages: what is broken spoils nothing else."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from packaged import distribute, start

from ttwmr_mj import registry
from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.references.shared.reference import Reference, reference_faults, sampled
from ttwmr_mj.references.straight_line import StraightLine
from ttwmr_mj.registry import guarded
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.scenario.checks import check
from ttwmr_mj.scenario.file import load_scenario

ROBOT = RobotParameters()
ANGLES = ("theta", "theta_rate", "theta_acceleration")
TIME = np.linspace(0.0, 1.0, 5)
PLUGIN = '''
import os, sys, threading, time
from pathlib import Path
from typing import ClassVar, Literal
from ttwmr_mj.controllers.base import Command, Controller, ControllerOptions, Law
import numpy as np
{at_import}

class Still(Controller):
    """Stands still."""
    def start(self, task):
        self.nsim = task.nsim
        {at_start}

    def command(self, k, estimate):
        return self.plain(np.zeros((self.nsim, 2)))


class Options(ControllerOptions):
    """Stands still."""

    kind: Literal["still"] = "still"
    needs_reference: ClassVar[bool] = False
    {options}

    def make(self, folder):
        {at_making}
        return Still()


class Empty(ControllerOptions):
    """Makes no law."""

    kind: Literal["still"] = "still"
'''
SCENARIO = """
name = "plugged"
duration_s = 0.2
plant.kind = "analytic"
reference.kind = "none"
controller.kind = "still"
output = {recording = false, figures = false}
"""


def install(folder: Path, point: str = "still = plugin:Options", **code: str) -> None:
    """What pip leaves of a distribution whose module has this code at these places."""
    parts = dict.fromkeys(("at_import", "at_start", "at_making", "options"), "pass") | code
    (folder / "plugin.py").write_text(PLUGIN.format(**parts))
    distribute(folder, "some_plugin", f"[ttwmr_mj.controllers]\n{point}\n")
    (folder / "plugged.toml").write_text(SCENARIO)


def ttwmr(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return start(folder, "-m", "ttwmr_mj", *words)


@pytest.mark.parametrize(
    ("point", "code", "told"),
    [
        ("still = plugin:Nobody", {}, "loading it raised AttributeError"),
        ("still = plugin:Still", {}, "it is not a concrete ControllerOptions of that kind"),
        ("other = plugin:Options", {}, "it is not a concrete ControllerOptions of that kind"),
        ("still = plugin:Empty", {}, "it has neither `law`"),
        ("lyapunov = ttwmr_mj.controllers.mpc:MpcOptions", {}, "not a concrete"),
        ("still = no module", {}, "allowed as a value: module:Class"),
        ("st\x1b[31mill = plugin:Options", {}, "allowed as a name: up to 64 lower-case letters"),
        ("still = plugin:Options", {"at_import": "sys.exit(0)"}, "raised SystemExit: 0"),
        ("still = plugin:Options", {"at_import": "1 / 0"}, "raised ZeroDivisionError"),
        ("still = plugin:Options", {"options": "x: object = 1"}, ""),
        ("still = plugin:Options", {"options": "x: 'Nobody' = 1"}, "raised PydanticUserError"),
    ],
)
def test_what_cannot_be_used_is_left_out_and_named(
    point: str, code: dict[str, str], told: str, tmp_path: Path
) -> None:
    install(tmp_path, point, **code)
    done = ttwmr(tmp_path, "validate", "lab_circle")
    assert (done.returncode, done.stdout) == (0, "lab_circle: valid\n"), done.stderr
    if told:
        (line,) = done.stderr.splitlines()
        assert line.startswith("ttwmr: ttwmr_mj.controllers: ")
        assert "which the package some-plugin adds, is left out: " in line
        assert told in line
        assert "\x1b" not in line


def test_what_is_left_out_is_told_once_by_a_study_of_many_processes(tmp_path: Path) -> None:
    install(tmp_path, "still = plugin:Nobody")
    sweep = 'name = "two"\nscenario = "straight_line"\noverrides = ["duration_s=0.1", '
    sweep += '"plant.kind=analytic"]\n[parameters]\n"initial.y_m" = { values = [0.0, 0.1] }'
    (tmp_path / "two.toml").write_text(sweep)
    done = ttwmr(tmp_path, "sweep", "two.toml", "--out", "out", "--quiet")
    assert done.returncode == 0, done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("ttwmr: ttwmr_mj.controllers: still = plugin:Nobody, ")


def test_a_name_that_is_taken_stays_with_whom_it_was(tmp_path: Path) -> None:
    code = 'from ttwmr_mj.controllers.mpc import MpcOptions\nclass Mine(MpcOptions): "Mine."'
    install(tmp_path, "mpc = plugin:Mine", at_import=code)
    done = ttwmr(tmp_path, "list")
    assert "that name is taken by ttwmr_mj.controllers.mpc:MpcOptions" in done.stderr
    assert "Model predictive control" in done.stdout


def test_what_is_installed_twice_is_there_once(tmp_path: Path) -> None:
    install(tmp_path)
    info = tmp_path / "again-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: again\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[ttwmr_mj.controllers]\nstill = plugin:Options\n")
    done = ttwmr(tmp_path, "validate", "plugged.toml")
    assert (done.returncode, done.stderr) == (0, "")


def test_what_a_package_prints_is_no_part_of_our_output(tmp_path: Path) -> None:
    install(tmp_path, at_import="print('hello')")
    done = ttwmr(tmp_path, "export-schema")
    assert done.stdout.startswith("{")
    assert done.stderr == "hello\n"


def test_threads_of_a_package_do_not_keep_a_command(tmp_path: Path) -> None:
    install(tmp_path, at_import="threading.Thread(target=time.sleep, args=(600,)).start()")
    done = ttwmr(tmp_path, "validate", "lab_circle")
    assert (done.returncode, done.stdout, done.stderr) == (0, "lab_circle: valid\n", "")


@pytest.mark.parametrize(
    ("place", "code", "status", "told"),
    [
        ("at_making", "1 / 0", 2, "controller.kind: make() of plugin:Options raised ZeroDivision"),
        ("at_making", "return None", 2, "raised TypeError: it must return a Controller"),
        ("at_making", "sys.exit(0)", 2, "make() of plugin:Options raised SystemExit: 0"),
        ("at_start", "os._exit(0)", 1, "ended with exit code 0 before it was over"),
    ],
)
def test_a_packages_law_is_watched_like_ones_own(
    place: str, code: str, status: int, told: str, tmp_path: Path
) -> None:
    install(tmp_path, **{place: code})
    done = ttwmr(tmp_path, "run", "plugged.toml", "--out", "out")
    assert done.returncode == status
    assert told in done.stderr
    assert "Traceback" not in done.stderr


class Wrong(Reference):
    """A line, but for one thing that is wrong with it."""

    kind: Literal["wrong"] = "wrong"
    what: str

    def faults(self, robot: RobotParameters) -> list[Fault]:
        del robot
        return None if self.what == "faults" else []  # type: ignore[return-value]

    def sample(self, time_s, robot):  # type: ignore[no-untyped-def]
        path = StraightLine(speed_m_s=0.1).sample(time_s, robot)
        match self.what:
            case "nothing":
                return None
            case "raise":
                raise SystemExit(0)
            case "text":
                return "path"
            case "random":
                path.derivatives[0, 0, 0, 0] = np.random.default_rng().random()
            case "input":
                time_s += 1.0
            case "rows":
                return path.until(3)
            case "angles":
                twice = {name: np.repeat(getattr(path, name), 2, axis=-1) for name in ANGLES}
                path = replace(path, **twice)
            case "nan":
                path.derivatives[3, 0, 1] = np.nan
            case "infinite":
                path.theta[2] = np.inf
            case "undefined":
                path.theta[:, :, 1] = np.nan
            case "aside":
                path.theta[:, :, 0] += 0.1
            case "a little aside":
                path.theta[:, :, 0] += 0.03
            case "integers":
                path = replace(path, derivatives=path.derivatives.astype(np.int64))
        return path


@pytest.mark.parametrize(
    ("what", "told"),
    [
        ("raise", "SystemExit: 0"),
        ("text", "TypeError: it must return a ReferencePath or None"),
        ("random", "ValueError: two calls with the same times must return the same motion"),
        ("input", "ValueError: time_s are not the times that were asked for"),
        ("rows", r"ValueError: time_s has shape \(3,\), and must have \(5,\)"),
        ("angles", r"ValueError: theta has shape \(5, 1, 4\), and must have \(5, 1, 2\)"),
        ("nan", "ValueError: derivatives is not finite at t = 0.75 s"),
        ("infinite", "ValueError: theta is not finite at t = 0.5 s"),
        ("integers", "TypeError: derivatives must be a NumPy array of float64"),
    ],
)
def test_a_packages_reference_is_looked_at(what: str, told: str) -> None:
    with pytest.raises(InputError, match=f"sample.. of test_plugins:Wrong raised {told}") as caught:
        sampled(Wrong(what=what), TIME, ROBOT)
    assert caught.value.faults[0].where == "reference.kind"


def test_a_packages_reference_that_slides_sideways_is_refused() -> None:
    scenario = load_scenario("outer_circle", ['controller={kind="feedforward"}'])

    def told(what: str) -> str:
        wrong = scenario.model_copy(update={"reference": Wrong(what=what)})
        return "\n".join(map(str, check(wrong, [])))

    assert "reference: moves P at 0.00998 m/s across its heading θ1" in told("aside")
    assert "allowed: at most 0.005 m/s" in told("aside")
    assert told("a little aside") == told("undefined") == ""


def test_what_a_package_may_leave_undefined() -> None:
    assert sampled(Wrong(what="nothing"), TIME, ROBOT) is None
    path = sampled(Wrong(what="undefined"), TIME, ROBOT)
    assert path is not None
    assert np.isnan(path.theta2_rad).all()
    with pytest.raises(InputError, match=r"faults.. of .*Wrong raised TypeError: it must return a"):
        reference_faults(Wrong(what="faults"), ROBOT)


def test_code_of_a_package_has_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object) -> None:
        while True:
            pass

    monkeypatch.setattr(Wrong, "sample", never)
    monkeypatch.setattr(registry, "LIMIT_S", 0.05)
    with pytest.raises(InputError, match=r"sample.. of test_plugins:Wrong timed out after 0.05 s"):
        sampled(Wrong(what=""), TIME, ROBOT)


def test_our_own_faults_are_not_told_as_a_packages() -> None:
    with pytest.raises(ZeroDivisionError), guarded(StraightLine, "k", "f()"):
        raise ZeroDivisionError
