"""A controller that does not answer ends its run, and only its run."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import threading
import time
import tomllib
from contextlib import suppress
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from test_hostile_arrays import Still

from ttwmr_mj.controllers.base import Command, Task
from ttwmr_mj.deadline import Deadline, Overrun, limited
from ttwmr_mj.runs.experiment import Experiment, Result
from ttwmr_mj.scenario.file import check_scenario, load_scenario
from ttwmr_mj.sensing import Estimate

SCENARIO = """
name = "mine"
duration_s = 2.0
plant.kind = "analytic"
reference.kind = "none"
control.controller_time_limit_s = 0.2
[controller]
kind = "custom"
target = "misbehaving:{name}"
"""


def experiment(name: str, nsim: int = 1) -> Experiment:
    folder = Path(__file__).parent
    return Experiment(
        check_scenario(tomllib.loads(SCENARIO.format(name=name)), "mine"), folder, nsim
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Endless", "Stubborn"])
def test_a_hanging_controller_ends_its_run_with_the_reason_and_the_files(
    name: str, tmp_path: Path
) -> None:
    (tmp_path / "misbehaving.py").write_text((Path(__file__).parent / "misbehaving.py").read_text())
    (tmp_path / "mine.toml").write_text(SCENARIO.format(name=name))
    command = [sys.executable, "-m", "ttwmr_mj", "run", "mine.toml", "--out", "out"]
    command += ["--set", "output.recording=false", "--set", "output.figures=false"]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 1
    reason = "the controller timed out after 0.2 s at its sample at t = 0.099 s"
    assert reason in done.stderr
    assert "control.controller_time_limit_s" in done.stderr
    assert "Traceback" not in done.stderr
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert metrics["status"] == "failed"
    assert metrics["reason"].startswith(reason)
    assert pq.read_table(tmp_path / "out" / "trajectory.parquet").num_rows == 4


def test_a_sleeping_controller_is_woken() -> None:
    began = time.perf_counter()
    assert "timed out after 0.2 s" in experiment("Sleeper").run().outcomes[0].reason
    assert time.perf_counter() - began < 30  # it would sleep for a minute


def test_waiting_for_a_busy_machine_is_no_overrun() -> None:
    deadline = Deadline(0.05)
    deadline.arm()
    with deadline:  # as if another process had the processor
        time.sleep(0.2)
    deadline.disarm()


def test_what_raises_at_its_start_has_failed_there() -> None:
    result = experiment("Stillborn").run()
    (outcome,) = result.outcomes
    assert (outcome.status, outcome.time_s) == ("failed", 0.0)
    assert outcome.reason == "controller.start() raised SystemExit: never"
    assert len(result.trajectory) == 1


def test_a_batch_has_the_time_of_its_simulations() -> None:
    # one answer of 0.3 s: too long for one simulation, not for three
    assert experiment("Slow", nsim=1).run().outcomes[0].status == "failed"
    assert experiment("Slow", nsim=3).run().outcomes[0].status == "ok"


def test_outside_the_main_thread_an_answer_is_judged_when_it_comes() -> None:
    results: list[Result] = []
    thread = threading.Thread(target=lambda: results.append(experiment("Slow").run()))
    thread.start()
    thread.join()
    assert "timed out after 0.2 s" in results[0].outcomes[0].reason


def test_a_limit_that_rings_while_it_is_set_ends_the_call_alone() -> None:
    """Not what comes after it: the timer has stopped, however early it rang."""
    for limit_s in (1e-6, 1e-5, 2e-5):
        deadline = Deadline(limit_s)
        deadline.arm()
        for _ in range(100):
            with suppress(Overrun), deadline:
                pass
            assert not deadline._running
            assert signal.getitimer(signal.ITIMER_REAL)[0] == 0.0
        deadline.disarm()


def test_without_a_timer_waiting_is_judged_when_it_ends() -> None:
    with pytest.raises(Overrun), Deadline(0.01):  # never armed
        time.sleep(0.2)


def test_what_is_in_time_or_breaks_by_itself_is_no_overrun() -> None:
    with Deadline(60.0):  # never armed
        pass
    until = time.thread_time() + 0.05
    with pytest.raises(KeyError), Deadline(0.01):  # noqa: PT012  # the loop is the point
        while time.thread_time() < until:
            pass
        raise KeyError
    with pytest.raises(Overrun), Deadline(0.01):  # noqa: PT012
        while time.thread_time() < until + 0.05:
            pass


def test_who_waits_has_fifteen_times_the_limit_in_rings_of_a_tenth_of_a_second() -> None:
    with Deadline(0.1) as deadline:  # never armed: the test is the timer
        for _ in range(14):
            deadline._ring(signal.SIGALRM, None)
    deadline._ring(signal.SIGALRM, None)  # too late: the body is over
    with pytest.raises(Overrun), Deadline(0.1) as deadline:  # noqa: PT012
        for _ in range(16):
            deadline._ring(signal.SIGALRM, None)


class Swallower(Still):
    """Waits for an hour in its start or its third sample, and lets nothing break it off."""

    def __init__(self, where: str) -> None:
        self._where = where

    def start(self, task: Task) -> None:
        super().start(task)
        self._wait(self._where == "start")

    def command(self, k: int, estimate: Estimate) -> Command:
        self._wait(self._where == "command" and k == 3)
        return super().command(k, estimate)

    def _wait(self, long: bool) -> None:
        with suppress(BaseException):
            time.sleep(3600.0 * long)


@pytest.mark.parametrize(
    ("where", "reason"),
    [
        ("start", "controller.start() timed out after 0.05 s"),
        ("command", "the controller timed out after 0.05 s at its sample at t = 0.099 s"),
    ],
)
def test_a_law_that_swallows_the_end_of_its_waiting_has_failed(where: str, reason: str) -> None:
    overrides = {"controller_time_limit_s": 0.05, "controller_start_limit_s": 0.05}
    scenario = experiment("Away").scenario
    scenario = scenario.model_copy(
        update={"control": scenario.control.model_copy(update=overrides)}
    )
    (outcome,) = Experiment(scenario, controller=Swallower(where)).run().outcomes
    assert outcome.status == "failed"
    assert outcome.reason.startswith(reason)


def test_a_law_has_longer_to_plan_a_longer_run() -> None:
    """Laws that plan along the whole reference take 2 ms a period: a quarter hour of run, 60 s."""
    limit = "control.controller_start_limit_s=0.02"
    for periods, limit_s in ((1_000, 0.02), (20_000, 0.08)):
        overrides = [limit, f"duration_s={periods * 0.033}", "plant.kind='analytic'"]
        scenario = load_scenario("lab_circle", overrides)
        (outcome,) = Experiment(scenario, controller=Swallower("start")).run().outcomes
        told = re.fullmatch(r"controller.start\(\) timed out after (\S+) s; .*=0.2", outcome.reason)
        assert told, outcome.reason
        # the reference goes on behind the end of the run, for laws that look ahead
        assert limit_s <= float(told[1]) < 1.05 * limit_s


class Lingering:
    """Waits for a minute as it is deleted, or raises at once."""

    def __init__(self, error: Exception | None = None) -> None:
        self._error = error

    def __del__(self) -> None:
        if self._error:
            raise self._error
        time.sleep(60.0)


def test_what_is_broken_off_as_it_is_deleted_is_told_by_its_limit_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told: list[Any] = []
    ours = lambda unraisable: told.append(unraisable.exc_type)  # noqa: E731
    monkeypatch.setattr("sys.unraisablehook", ours)
    with pytest.raises(Overrun), limited(0.02):
        Lingering()
    assert told == []
    with limited(60.0):
        Lingering(KeyError())
    assert told == [KeyError]  # others go where they went
    assert sys.unraisablehook is ours


def test_the_alarm_is_given_back() -> None:
    rung = []
    before = signal.signal(signal.SIGALRM, lambda *_: rung.append(1))
    try:
        deadline = Deadline(0.05)
        deadline.arm()
        with pytest.raises(Overrun), deadline:  # noqa: PT012  # the loop is the point
            while True:
                pass
        with deadline:  # in time, and nothing rings afterwards
            pass
        time.sleep(0.3)
        deadline.disarm()
        signal.raise_signal(signal.SIGALRM)
        assert rung == [1]
    finally:
        signal.signal(signal.SIGALRM, before)


class Nested(Still):
    """Runs a simulation within its third sample, and never answers it."""

    def command(self, k: int, estimate: Estimate) -> Command:
        if k == 3:
            assert experiment("Away").run().outcomes[0].status == "ok"
        while k == 3:
            pass
        return super().command(k, estimate)


def test_a_law_that_simulates_is_broken_off_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    board = memoryview(bytearray(16)).cast("d")
    monkeypatch.setattr("ttwmr_mj.deadline._board", board)
    scenario = experiment("Away").scenario
    assert (
        "timed out after 0.2 s"
        in Experiment(scenario, controller=Nested()).run().outcomes[0].reason
    )
    assert board[0] == 0.0


def test_the_limit_of_a_body_is_shown_again_after_one_within_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    board = memoryview(bytearray(16)).cast("d")
    monkeypatch.setattr("ttwmr_mj.deadline._board", board)
    with limited(60.0):
        with limited(30.0):
            assert board[0] == 30.0
        assert board[0] == 60.0
        assert 30.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 60.0
    assert board[0] == signal.getitimer(signal.ITIMER_REAL)[0] == 0.0


@pytest.mark.parametrize("left_s", [60.0, 0.1])  # it would ring much later, or while a law drives
def test_a_timer_of_the_scripts_own_is_given_back(left_s: float) -> None:
    rung, one = threading.Event(), experiment("Slow", nsim=3)
    before = signal.signal(signal.SIGALRM, lambda *_: rung.set())
    try:
        signal.setitimer(signal.ITIMER_REAL, left_s, 50.0)
        one.run()
        if left_s < 1.0:
            assert rung.wait(60.0)
        assert 0.0 < signal.getitimer(signal.ITIMER_REAL)[0] < 60.0
        assert signal.getitimer(signal.ITIMER_REAL)[1] == 50.0
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
