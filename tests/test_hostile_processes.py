"""A law of the user's that leaves, never answers or stays: real processes, ended with a reason."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from test_hostile_laws import LAW, SCENARIO

TTWMR = [sys.executable, "-m", "ttwmr_mj"]
# Within one loop alone, what breaks it off may come between two rounds, where nothing catches it.
SWALLOW = """
            while True:
                try:
                    while True:
                        try:
                            time.sleep(0.01)
                        except BaseException:
                            pass
                except BaseException:
                    pass
"""
FAST = ["control.controller_time_limit_s=0.1", "control.controller_start_limit_s=0.1"]
BARE = [*FAST, "output.recording=false", "output.figures=false"]


def law_in(folder: Path, place: str, code: str) -> None:
    """A scenario mine.toml whose law has this code at that place."""
    parts = dict.fromkeys(("at_import", "at_making", "at_start"), "pass")
    parts["at_command"] = "return Command(one, no, no)"
    if place == "at_command":
        code = f"{code}\n        return Command(one, no, no)"
    parts |= {place: code}
    (folder / "mine.py").write_text("import os, sys, threading, time\n" + LAW.format(**parts))
    (folder / "mine.toml").write_text(SCENARIO.replace("TARGET", "mine"))


def ttwmr(folder: Path, *words: str, changes: list[str]) -> subprocess.CompletedProcess[str]:
    """What a command says and leaves with; everything it started must be over too."""
    line = [*TTWMR, *words, "mine.toml", *(f"--set={change}" for change in changes)]
    done = subprocess.run(  # returns when nobody has its pipes any longer
        line, cwd=folder, capture_output=True, text=True, timeout=60, check=False
    )
    assert "Traceback" not in done.stderr
    return done


@pytest.mark.parametrize(
    ("place", "code", "told"),
    [
        ("at_import", "os._exit(0)", "with exit code 0 before it was over"),
        ("at_making", "os.kill(os.getpid(), 11)", "by SIGSEGV before it was over"),
        pytest.param(
            *("at_start", SWALLOW, "did not answer within 0.1 s and could not be broken off"),
            marks=pytest.mark.slow,
        ),
        ("at_import", "while True: pass", "making the law timed out after 0.1 s"),
    ],
)
def test_what_never_answers_or_leaves_while_it_is_loaded(
    place: str, code: str, told: str, tmp_path: Path
) -> None:
    law_in(tmp_path, place, code)
    done = ttwmr(tmp_path, "validate", "--load", changes=FAST)
    assert done.returncode in (1, 2)
    assert told in done.stderr
    assert done.stderr.startswith("ttwmr: ")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "status", "told"),
    [
        ("if k == 2: os._exit(0)", 1, "with exit code 0 before it was over"),
        ("if k == 2: threading.Thread(target=lambda: os._exit(0)).start(); time.sleep(9)", 1, "0"),
        (f"if k == 2:{SWALLOW}", 1, "could not be broken off"),
        ("if k == 2: time.sleep(60)", 1, "the controller timed out after 0.1 s at its sample"),
        ("import signal; signal.signal(signal.SIGALRM, signal.SIG_IGN)\n        while k: pass",)
        + (1, "could not be broken off"),
        ("if k == 2: threading.Thread(target=time.sleep, args=(60,)).start()", 0, ""),
        ("if k == 2 and os.fork() == 0: time.sleep(60)", 0, ""),
        ("if k == 2: os.fork()", 0, ""),  # both come back
        ("if k == 2: os.closerange(3, 200)", 1, "Bad file descriptor"),
        ("import builtins; builtins.len = None", 1, "with exit code 1 before it was over"),
        ("sys.stdout = None", 0, ""),
        ("import atexit; k or atexit.register(time.sleep, 60)", 0, ""),
        ("print('x' * 20_000)", 0, ""),
    ],
)
def test_a_run_ends_whatever_its_law_does(
    code: str, status: int, told: str, tmp_path: Path
) -> None:
    law_in(tmp_path, "at_command", code)
    began_s = time.monotonic()
    done = ttwmr(tmp_path, "run", "--out", "out", changes=BARE)
    assert time.monotonic() - began_s < 50.0  # the sleeping ones would take a minute
    assert done.returncode == status, done.stderr
    assert told in done.stderr
    metrics = tmp_path / "out" / "metrics.json"
    if status == 0:
        assert json.loads(metrics.read_text())["status"] == "ok"
    assert not list((tmp_path / "out").rglob("*.part"))


CLOSED = "sys.stdout.close(); sys.stderr.close(); k == 2 and (os.close(1), os.close(2))"


@pytest.mark.parametrize(
    ("then", "status", "said", "told"),
    [("pass", 0, "run folder: out", ""), ("if k == 3: 1 / 0", 1, "", "ZeroDivisionError")],
)
def test_a_law_that_closes_the_streams_does_not_close_the_commands(
    then: str, status: int, said: str, told: str, tmp_path: Path
) -> None:
    law_in(tmp_path, "at_command", f"{CLOSED}\n        {then}")
    done = ttwmr(tmp_path, "run", "--out", "out", changes=BARE)
    assert done.returncode == status
    assert said in done.stdout
    assert told in done.stderr


@pytest.mark.parametrize(
    ("code", "status", "told"),
    [
        ("import signal; signal.signal = None", 1, "mine:Law ran in this process and may have"),
        ("sys.stderr = None; raise KeyError('k')", 2, "KeyError"),
        ("sys.stdout = sys.stderr = None", 0, "run folder: out"),
        ("np.abs = lambda *_: sys.exit(0)", 1, "unexpected SystemExit: 0; the law mine:Law ran"),
        ("sys.setrecursionlimit(60)", 1, "RecursionError: maximum recursion depth exceeded"),
        ("sys.modules.clear()", 1, "the law mine:Law ran in this process and may have caused it"),
    ],
)
def test_what_a_law_changes_of_the_process_is_not_told_as_a_bug(
    code: str, status: int, told: str, tmp_path: Path
) -> None:
    law_in(tmp_path, "at_making", code)
    done = ttwmr(tmp_path, "run", "--out", "out", changes=BARE)
    assert done.returncode == status
    assert told in done.stdout + done.stderr


def test_a_law_that_asks_for_all_warnings_hears_none_of_ours(tmp_path: Path) -> None:
    law_in(tmp_path, "at_making", "import warnings; warnings.simplefilter('always')")
    done = ttwmr(tmp_path, "validate", "--load", changes=FAST)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_folder_that_a_law_removes_is_no_fault_of_the_input(tmp_path: Path) -> None:
    law_in(tmp_path, "at_start", "import shutil; shutil.rmtree('out')")
    done = ttwmr(tmp_path, "run", "--out", "out", changes=[*FAST, "output.figures=false"])
    assert done.returncode == 1
    assert "out: the folder is gone" in done.stderr


def test_a_stopped_process_of_a_law_can_be_ended(tmp_path: Path) -> None:
    law_in(tmp_path, "at_start", "os.kill(os.getpid(), 19)  # SIGSTOP")
    line = [*TTWMR, "run", "mine.toml", "--out", "out", "--set=output.figures=false"]
    with subprocess.Popen(line, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as run:
        until_s = time.monotonic() + 30.0
        children = Path(f"/proc/{run.pid}/task/{run.pid}/children")
        while time.monotonic() < until_s and not _stopped(children.read_text().split()):
            time.sleep(0.05)
        run.terminate()
        try:
            _, said = run.communicate(timeout=30.0)
        finally:
            run.kill()  # its child goes with it
    assert run.returncode == 1
    assert "stopped" in said


def _stopped(processes: list[str]) -> bool:
    """Whether one of them is."""
    told = (Path(f"/proc/{one}/stat").read_text() for one in processes)
    return any(words.rpartition(")")[2].split()[0] == "T" for words in told)


@pytest.mark.slow
@pytest.mark.parametrize("place", ["at_making", "at_command"])
def test_a_row_that_is_interrupted_is_not_stored_as_its_laws_failure(
    place: str, tmp_path: Path
) -> None:
    law_in(tmp_path, place, "raise KeyboardInterrupt")
    suite = tmp_path / "suite.toml"
    suite.write_text('name = "s"\n[controller.a]\n[task.t]\nscenario = "mine.toml"\n')
    line = [*TTWMR, "bench", "suite.toml", "--out", "out", "--workers", "1"]
    done = subprocess.run(
        line, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 1
    assert "1 row was not run" in done.stderr
    assert "stopped by Ctrl-C, or its law raised KeyboardInterrupt" in done.stderr
    assert not list((tmp_path / "out").rglob("row.json"))


@pytest.mark.slow
@pytest.mark.parametrize("how", ["TERM", "INT", "KILL"])
def test_signals_reach_the_process_that_runs_the_law(how: str, tmp_path: Path) -> None:
    law_in(tmp_path, "at_command", "open('pid', 'w').write(str(os.getpid())); time.sleep(0.05)")
    line = [*TTWMR, "run", "mine.toml", "--out", "out", "--set=duration_s=60"]
    line += [f"--set={change}" for change in BARE]
    running = subprocess.Popen(line, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    pid = tmp_path / "pid"
    while not (pid.exists() and pid.read_text()):
        assert running.poll() is None
        time.sleep(0.05)
    law = int(pid.read_text())
    assert law != running.pid
    running.send_signal(signal.Signals[f"SIG{how}"])
    told = running.communicate(timeout=30)[1]
    assert running.returncode == (-9 if how == "KILL" else 1)
    assert "Traceback" not in told
    until = time.monotonic() + 10.0
    while time.monotonic() < until and _runs(law):
        time.sleep(0.05)
    assert not _runs(law)
    if how != "KILL":
        assert json.loads((tmp_path / "out" / "metrics.json").read_text())["status"] == (
            "interrupted"
        )


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return "Z" not in Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
