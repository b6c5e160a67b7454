"""The process that watches the one of a law: when it waits, when it ends it, what it believes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from ttwmr_mj.cli import watch
from ttwmr_mj.cli.watch import Watch

SLEEPS = "time.sleep(60)"
DEAF = f"[signal.signal(n, signal.SIG_IGN) for n in {{}}]; print(flush=True); {SLEEPS}"
SIGNALS = (signal.SIGTERM, signal.SIGUSR1, signal.SIGUSR2)


@contextmanager
def watched(code: str, result: Path | None = None) -> Iterator[tuple[Watch, int]]:
    """A process that runs this, watched, and where it would tell its exit code."""
    answers, telling = os.pipe()
    line = [sys.executable, "-c", f"import signal, time; {code}"]
    board = memoryview(bytearray(24)).cast("d")
    with subprocess.Popen(line, start_new_session=True, stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        if "print" in code:
            child.stdout.readline()
        yield Watch(child.pid, answers, board, result), telling
        child.returncode = 0  # the watch has waited for it
    os.close(answers)
    os.close(telling)


@contextmanager
def beside(work: threading.Thread) -> Iterator[None]:
    work.start()
    yield
    work.join()


def test_a_child_in_which_nothing_goes_on_is_ended(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(watch, "IDLE_S", 0.5)
    with watched(SLEEPS) as (one, _):
        assert one.code() == 1
    assert "nothing went on for 0.5 s" in capsys.readouterr().err


def test_a_child_that_computes_is_waited_for(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(watch, "IDLE_S", 0.5)
    with watched("end = time.time() + 1.5\nwhile time.time() < end: pass") as (one, _):
        one.code()
    assert "with exit code 0 before it was over" in capsys.readouterr().err


@pytest.mark.parametrize("place", [1, 2])  # a call into the law, a step of other work
def test_a_child_that_shows_that_it_gets_further_is_waited_for(
    place: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(watch, "IDLE_S", 0.5)
    with watched("time.sleep(1.2)") as (one, _):

        def show() -> None:
            for _ in range(60):
                one.board[place] += 1.0
                time.sleep(0.02)

        with beside(threading.Thread(target=show)):
            one.code()
    assert "with exit code 0 before it was over" in capsys.readouterr().err


def test_an_output_that_nobody_reads_is_no_fault_of_the_child() -> None:
    source, entry = os.pipe()
    os.set_blocking(entry, False)
    stdout = os.dup(1)
    try:
        os.dup2(entry, 1)
        assert watch._is_heard()
        with suppress(BlockingIOError):
            while True:
                os.write(entry, bytes(4096))
        assert not watch._is_heard()
        os.close(source)  # who reads has left
        assert watch._is_heard()
    finally:
        os.dup2(stdout, 1)
        os.close(stdout)
        os.close(entry)


@pytest.mark.parametrize(
    ("signals", "stop_s", "told"),
    [
        (SIGNALS[:1], 0.5, "did not end within 0.5 s of SIGTERM"),
        (SIGNALS, 600.0, "stopped at the third signal"),
    ],
)
def test_a_child_that_no_signal_ends_is_ended(
    signals: tuple[signal.Signals, ...],
    stop_s: float,
    told: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(watch, "STOP_S", stop_s)

    def send() -> None:
        for one in signals:
            time.sleep(0.1)
            os.kill(os.getpid(), one)

    code = DEAF.format([*map(int, SIGNALS)])
    before = {n: signal.signal(n, lambda *_: None) for n in SIGNALS}
    try:
        with watched(code) as (one, _), beside(threading.Thread(target=send)):
            assert one.code() == 1
    finally:
        for n, handler in before.items():
            signal.signal(n, handler)
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(
    ("content", "code", "told"),
    [
        ("{}", 0, ""),
        (None, 1, "metrics.json cannot be read"),
        ('{"verd', 1, "metrics.json cannot be read"),
    ],
)
def test_a_child_that_ended_well_has_left_its_result(
    content: str | None,
    code: int,
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(watch, "LEAVE_S", 0.0)
    result = tmp_path / "metrics.json"
    if content is not None:
        result.write_text(content)
    with watched(SLEEPS, result) as (one, telling):
        os.write(telling, b"\0")
        assert one.code() == code
    said = capsys.readouterr().err
    assert told in said
    assert said.count("\n") == code
