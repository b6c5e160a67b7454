"""What a law does to what it was given is its own business: the judge and the record stay."""

from __future__ import annotations

import os
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_hostile_laws import LAW, made

from ttwmr_mj.controllers.base import Command, Controller, Task
from ttwmr_mj.errors import InputError
from ttwmr_mj.files import read_toml
from ttwmr_mj.runs.execute import run_scenario
from ttwmr_mj.runs.experiment import Experiment, Result
from ttwmr_mj.runs.law.answers import LARGEST, MOST_SIGNALS
from ttwmr_mj.scenario.file import check_scenario, load_scenario
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.sensing import Estimate

SENSING = {
    "truth": [],
    "late truth": ["sensing.latency_s=0.066", "sensing.position_noise_m=0.001"],
    "lost truth": ["sensing.drop_probability=0.5"],
}
QUICK = ["plant.kind=analytic", "duration_s=1.0"]


class Still(Controller):
    """Stands still, and does nothing else."""

    def start(self, task: Task) -> None:
        self.task = task

    def command(self, k: int, estimate: Estimate) -> Command:
        return self.plain(np.zeros((self.task.nsim, 2)))


class Vandal(Still):
    """Overwrites all that it can reach from what it was given."""

    def start(self, task: Task) -> None:
        super().start(task)
        vandalize(task)

    def command(self, k: int, estimate: Estimate) -> Command:
        vandalize(estimate)
        return super().command(k, estimate)


def vandalize(given: Any, depth: int = 0) -> None:
    if isinstance(given, np.ndarray):
        while given is not None:  # and what it is a view of
            given.flags.writeable = True
            given[...] = 0
            given = given.base
        return
    names = getattr(type(given), "__slots__", ()) or getattr(given, "__dict__", {})
    for name in list(names) if depth < 4 else []:
        value = getattr(given, name)
        if isinstance(value, float):
            object.__setattr__(given, name, 1.0)
        elif not isinstance(value, np.random.Generator):
            vandalize(value, depth + 1)


@pytest.mark.parametrize("sensing", SENSING)
def test_the_judge_and_the_record_cannot_be_reached(sensing: str, tmp_path: Path) -> None:
    changes = [*QUICK, *SENSING[sensing]]
    for law in ("Still", "Vandal"):
        custom = f"controller={{kind='custom', target='{__name__}:{law}'}}"
        scenario = load_scenario("lab_circle", [*changes, custom])
        before = repr(scenario)
        experiment = Experiment(scenario, tmp_path)
        result = experiment.run()
        assert repr(scenario) == before
        again = experiment.run()  # nor does one run reach the next
        assert_alike(again, result)
        if law == "Still":
            still = result
    assert result.outcomes[0].status == "ok"
    assert_alike(result, still)


def assert_alike(one: Result, other: Result) -> None:
    ours, theirs = one.trajectory.to_columns(), other.trajectory.to_columns()
    assert list(ours) == list(theirs)
    for name, values in ours.items():
        assert values.tobytes() == theirs[name].tobytes(), name
    assert one.verdicts == other.verdicts
    assert one.verdicts[0].name != "followed"


class Reusing(Still):
    """Answers in the same array every time."""

    def start(self, task: Task) -> None:
        super().start(task)
        self.wheels, self.signal = np.zeros((1, 2)), np.zeros(1)

    def command(self, k: int, estimate: Estimate) -> Command:
        self.wheels[:] = self.signal[:] = k
        return self.plain(self.wheels, {"k": self.signal})


class Fresh(Still):
    def command(self, k: int, estimate: Estimate) -> Command:
        return self.plain(np.full((1, 2), float(k)), {"k": np.full(1, float(k))})


def test_an_array_that_a_law_uses_again_is_no_array_of_the_loop() -> None:
    scenario = load_scenario("lab_circle", [*QUICK, "control.command_latency_s=0.066"])
    one, other = (Experiment(scenario, controller=law).run() for law in (Reusing(), Fresh()))
    assert_alike(one, other)
    assert one.trajectory.q[-1, 0, 0] != one.trajectory.q[0, 0, 0]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("code", "told"),
    [
        ("return Command([[1.0, 1.0]], no, no)", ""),  # a list is as good
        ("return Command(one.astype(np.float16), no, no, {'a_m': [3]})", ""),
        ("return Command(np.ma.masked_all((1, 2)), no, no)", "wheel speeds are not real numbers"),
        ("return Command(one.astype(object), no, no)", "wheel speeds are not real numbers"),
        ("return Command(one.astype(str), no, no)", "wheel speeds are not real numbers"),
        ("return Command(one * np.nan, no, no)", "wheel speeds are not finite"),
        ("return Command(one * 1e308, no, no)", f"wheel speeds are beyond {LARGEST:g}"),
        ("return Command(one * np.longdouble('1e4000'), no, no)", "wheel speeds are not finite"),
        ("return Command(one, np.full(1, np.nan), no)", "saturated is not of booleans"),
        ("return Command(one, no, np.array(['no']))", "near_singular is not of booleans"),
        ("return Command(one, no, no, {'a_m': one[0, :1] * 1j})", "a_m is not real numbers"),
        ("return Command(one, no, no, {'a_m': ['x']})", "signal a_m is not real numbers"),
        ("return Command(one, no, no, {'a_m': one})", "signal a_m has shape (1, 2)"),
        ("return Command(one, no, no, {5: no * 1.0})", "a signal is called 5"),
        ("return Command(one, no, no, {'a' * 101: no * 1.0})", "a signal is called 'aaa"),
        ("return Command(one, no, no, {'theta2_rad': no * 1.0})", "no name of another column"),
        ("return Command(one, no, no, {'theta3_rad': no * 1.0})", "column, of any train"),
        ("return Command(one, no, no, {'ref_theta99_rate_rad_s': no * 1.0})", "of any train"),
        ("return Command(one, no, no, {'theta3_aim_rad': no * 1.0})", ""),
        (
            "return Command(one, no, no, dict.fromkeys(map('a{}'.format, range(201)), no + 0.0))",
            f"allowed: {MOST_SIGNALS}",
        ),
        ("return Command(one, no, no, None)", "raised TypeError"),
        ("return Command(one, no, no, {'a_m': np.array([np.inf])})", ""),  # it may be undefined
        ("return type('C', (), {})()", "the answer is of the type C; allowed: a ttwmr_mj.Command"),
        ("raise ValueError('x' * 10**6)", "xxx..."),
        ("raise type('E', (Exception,), {'__str__': lambda e: exit(0)})", "(whose text raised Sys"),
    ],
)
def test_answers_that_are_none(code: str, told: str, tmp_path: Path) -> None:
    (outcome,) = made(tmp_path, "at_command", code).run().outcomes
    assert (outcome.status == "failed") == bool(told), outcome.reason
    assert told in outcome.reason
    assert len(outcome.reason) < 2000


def test_the_torques_that_a_law_commands_are_logged_and_no_signal_of_its_own(
    tmp_path: Path,
) -> None:
    code = "return Command(one, no, no, {'wheel_torque_left_n_m': no + 1.0}, 0.0 * one)"
    (outcome,) = made(tmp_path, "at_command", code, "control.inner_loop=torque").run().outcomes
    assert "a signal is called 'wheel_torque_left_n_m'" in outcome.reason


def test_a_text_that_never_comes_is_not_waited_for(tmp_path: Path) -> None:
    text = "{'__str__': lambda e: [None for _ in iter(int, 1)]}"
    code = f"raise type('Slow', (Exception,), {text})"
    experiment = made(tmp_path, "at_command", code, "control.controller_time_limit_s=0.1")
    (outcome,) = experiment.run().outcomes
    assert "raised Slow (whose text took more than 0.1 s)" in outcome.reason


@pytest.mark.parametrize(
    ("place", "told"),
    [
        ("at_import", "importing and making the law timed out after 0.1 s"),
        ("at_making", "importing and making the law timed out after 0.1 s"),
        ("at_start", "controller.start() timed out after 0.1 s"),
    ],
)
@pytest.mark.parametrize("code", ["while True: pass", "import time; time.sleep(60)"])
def test_what_never_comes_up_is_ended(place: str, told: str, code: str, tmp_path: Path) -> None:
    limit = "control.controller_start_limit_s"
    if place == "at_start":
        (outcome,) = made(tmp_path, place, code, f"{limit}=0.1").run().outcomes
        assert outcome.status == "failed"
        assert f"{told}; to give it longer: --set {limit}=1" in outcome.reason
        return
    with pytest.raises(InputError, match=re.escape(f"{told}; to give it longer: --set {limit}=1")):
        made(tmp_path, place, code, f"{limit}=0.1")


@pytest.mark.parametrize("place", ["at_import", "at_command"])  # the first and the last
def test_a_law_that_changes_the_directory_changes_nothing_else(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "away").mkdir()
    (tmp_path / "out").mkdir()
    away = f"import os; os.chdir({str(tmp_path / 'away')!r})"
    code = f"{away}\n        return Command(one, no, no)" if place == "at_command" else away
    scenario = law_beside(tmp_path, place, code, f"away_{place}")
    run_scenario(scenario, Path("out"), scenario_folder=Path())
    assert Path.cwd() == tmp_path / "away"
    assert not list((tmp_path / "away").iterdir())
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"metrics.json", "trajectory.parquet", "run.rrd", "summary.png"} <= names


def law_beside(folder: Path, place: str, code: str, module: str, options: str = "") -> Scenario:
    """A scenario in a folder, and its law beside it."""
    parts = dict.fromkeys(("at_import", "at_making", "at_start"), "pass")
    parts["at_command"] = "return Command(one, no, no)"
    law = LAW.format(**parts | {place: code}).replace("__init__(self)", "__init__(self, **given)")
    (folder / f"{module}.py").write_text(law)
    text = f"""
name = "mine"
duration_s = 0.3
plant.kind = "analytic"
reference.kind = "none"
[controller]
kind = "custom"
target = "{module}:Law"
{options}
"""
    (folder / "mine.toml").write_text(text)
    return check_scenario(tomllib.loads(text), "mine", folder)


@pytest.mark.slow
def test_the_resolved_scenario_of_a_law_runs_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = (
        "[controller.options]\na = inf\nb = 1979-05-27\nc = [nan, 1979-05-27T07:32:00Z]\n"
        "d = {e = -inf, f = 07:32:00}\n"
    )
    mess = "given['c'].clear(); given['d']['e'] = 0"
    beside, out = tmp_path / "mine", tmp_path / "out"
    beside.mkdir()
    out.mkdir()
    scenario = law_beside(beside, "at_making", mess, "kept_law", options)
    run_scenario(scenario, out, scenario_folder=beside)
    resolved = out / "scenario.resolved.toml"
    given, again = (read_toml(path)["controller"] for path in (beside / "mine.toml", resolved))
    assert repr(again["options"]) == repr(given["options"])  # NaN is not equal to itself
    assert again["folder"] == str(beside)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(__import__("sys").modules, "kept_law")
    second = tmp_path / "second"
    second.mkdir()
    run = run_scenario(load_scenario(str(resolved)), second, scenario_folder=out)
    assert run.outcome.status == "ok"
    assert (second / "scenario.resolved.toml").read_text() == resolved.read_text()


def test_a_child_that_a_law_forks_does_not_come_back(tmp_path: Path) -> None:
    code = f"open({str(tmp_path / 'runs')!r}, 'a').write('x')\n"
    code += "        k == 2 and os.fork()\n        return Command(one, no, no)"
    result = made(tmp_path, "at_command", f"import os\n        {code}").run()
    assert len((tmp_path / "runs").read_text()) == len(result.trajectory)
    assert os.waitpid(-1, 0)[1] != 0  # it has ended
