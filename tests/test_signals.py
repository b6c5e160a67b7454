"""SIGTERM and Ctrl-C in every phase of a run: one line, exit code 1, and what is complete stays."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
import time
import weakref
from abc import ABCMeta
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import pytest

import ttwmr_mj as tt
from ttwmr_mj.cli.main import main
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs.process import signals
from ttwmr_mj.runs.process.signals import held_back

PHASES = {  # what is being done when the signal comes → what is told of what is kept
    "ttwmr_mj.runs.execute.write_manifest": "nothing was recorded",
    "ttwmr_mj.plants.analytic.AnalyticPlant.follow": "what was recorded is in out",
    "ttwmr_mj.runs.execute.metrics_of": "the run is complete in out",
    "ttwmr_mj.results.trajectory.write_parquet": "the run is complete in out",
    "ttwmr_mj.runs.metrics.write_json": "the run is complete in out",
    "ttwmr_mj.figures.summary.write_summary": "the run is complete in out, figures may be missing",
    "matplotlib.figure.Figure.savefig": "the run is complete in out, figures may be missing",
}


ENDS = [signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1]


@pytest.mark.parametrize("signum", ENDS)
@pytest.mark.parametrize("phase", PHASES)
def test_a_signal_in_any_phase(
    phase: str,
    signum: signal.Signals,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    interrupt(phase, signum, monkeypatch)
    words = ["run", "lab_circle", "--out", "out", "--set", "duration_s=2.0"]
    assert main([*words, "--set", "plant.kind=analytic", "--set", "output.recording=false"]) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert PHASES[phase] in err
    left = {path.name for path in tmp_path.rglob("*") if path.is_file()}
    assert not [name for name in left if "part" in name or name == ".lock"]
    if "nothing" in PHASES[phase]:
        assert not left
        return
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    rows = Trajectory.read(tmp_path / "out" / "trajectory.parquet")
    assert metrics["end_time_s"] == rows.time_s[-1]
    assert metrics["status"] == ("ok" if "complete" in PHASES[phase] else "interrupted")


def interrupt(name: str, signum: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Send this process a signal when it calls a function, once."""
    holder, _, attribute = name.rpartition(".")
    real = resolved(holder, attribute)
    calls: list[int] = []

    def interrupted(*arguments: object, **named: object) -> object:
        calls.append(1)
        if len(calls) == 1:
            signal.raise_signal(signum)
        return real(*arguments, **named)

    monkeypatch.setattr(name, interrupted)


def resolved(holder: str, attribute: str) -> Callable[..., object]:
    import pkgutil

    return getattr(pkgutil.resolve_name(holder), attribute)  # type: ignore[no-any-return]


def test_signals_wait_for_the_end_of_a_block_and_a_second_one_does_not() -> None:
    done = []

    def held(times: int) -> None:
        with held_back():
            for _ in range(times):
                signal.raise_signal(signal.SIGINT)
            done.append(times)

    before = signal.getsignal(signal.SIGINT)
    for times in (1, 2):
        with pytest.raises(KeyboardInterrupt):
            held(times)
        assert signal.getsignal(signal.SIGINT) is before
    held(0)
    assert done == [1, 0]
    with pytest.raises(ZeroDivisionError), held_back():  # the first fault is told
        raise ZeroDivisionError


def test_an_import_is_not_broken_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As if numpy told a Ctrl-C during its import as an ImportError, which it does."""
    (tmp_path / "interrupted.py").write_text(
        "import signal, time\n"
        "try:\n"
        "    signal.raise_signal(signal.SIGINT)\n"
        "except KeyboardInterrupt as error:\n"
        "    raise ImportError from error\n"
        "done = True\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    signal.signal(signal.SIGINT, signals.interrupt)
    with pytest.raises(KeyboardInterrupt):
        work_until_stopped()
    assert sys.modules.pop("interrupted").done
    (tmp_path / "interrupted.py").write_text("import signal\nsignal.raise_signal(2)\nwhile True: 1")
    monkeypatch.setattr(signals, "LONGEST_WAIT_S", 0.2)
    with pytest.raises(KeyboardInterrupt):  # an import that never ends
        work_until_stopped()


def work_until_stopped() -> None:
    import_module("interrupted")
    time.sleep(60.0)


class Silent:
    """What weak references can be to."""


class Rings:
    def __del__(self) -> None:
        signal.raise_signal(signal.SIGTERM)


def ring(_: object = None) -> bool:
    signal.raise_signal(signal.SIGTERM)
    return True


def ring_in_a_weak_references_callback() -> None:
    held = Silent()
    reference = weakref.ref(held, ring)
    del held
    assert reference() is None


def ring_as_an_abstract_class_is_asked() -> None:
    """As pydantic asks, in C code, whether something is a mapping."""
    asked = classmethod(lambda *_: ring())
    assert isinstance(Silent(), ABCMeta("Kind", (), {"__subclasshook__": asked}))


@pytest.mark.parametrize(
    "lose", [Rings, ring_in_a_weak_references_callback, ring_as_an_abstract_class_is_asked]
)
def test_a_signal_is_not_lost_where_nobody_hears_its_exception(
    lose: Callable[[], object], capsys: pytest.CaptureFixture[str]
) -> None:
    """Python prints what a callback of C code raises, and goes on."""
    gone_on = []

    def work() -> None:
        lose()
        gone_on.append(True)
        time.sleep(5.0)

    with signals.noted(), pytest.raises(KeyboardInterrupt):
        work()
    assert gone_on
    assert not capsys.readouterr().err


def test_what_is_ignored_stays_ignored() -> None:
    """As a shell's background lets Ctrl-C be, and nohup a closed terminal."""
    before = {n: signal.signal(n, signal.SIG_IGN) for n in (signal.SIGINT, signal.SIGHUP)}
    try:
        with held_back(), signals.noted() as came:
            for signum in before:
                signal.raise_signal(signum)
        assert main(["list"]) == 0
        assert not came
        assert all(signal.getsignal(n) is signal.SIG_IGN for n in before)
    except KeyboardInterrupt:
        pytest.fail("a signal that is ignored was heard")
    finally:
        signals.give_back(before)


def test_the_command_line_gives_signals_back() -> None:
    before, hook = signal.getsignal(signal.SIGTERM), sys.unraisablehook
    assert main(["list"]) == 0
    assert signal.getsignal(signal.SIGTERM) is before
    assert main(["validate", "nowhere.toml"]) == 2
    assert signal.getsignal(signal.SIGTERM) is before
    assert sys.unraisablehook is hook


FORKS = """
import multiprocessing, os, signal, sys, time
from ttwmr_mj.runs.process import signals

usual = [signal.getsignal(signum) for signum in signals.WAITING]
with signals.noted(), signals.held_back():
    worker = multiprocessing.get_context("fork").Process(target=time.sleep, args=(5,))
    worker.start()
    time.sleep(0.2)
    worker.terminate()
    worker.join()
    print(worker.exitcode)
    for fork in (os.fork, signals.fork, os.fork):
        if (child := fork()) == 0:
            os._exit([signal.getsignal(signum) for signum in signals.WAITING] == usual)
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # by a law, whose children know that
    if (child := os.fork()) == 0:
        os._exit(signal.getsignal(signal.SIGTERM) is signal.SIG_IGN)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


def test_children_that_a_law_forks_have_signals_as_they_were() -> None:
    done = subprocess.run(
        [sys.executable, "-c", FORKS], capture_output=True, text=True, timeout=60, check=False
    )
    assert not done.stderr
    assert done.stdout.split() == [str(-signal.SIGTERM), *"1011"]


def test_it_works_in_a_thread_which_gets_no_signals(tmp_path: Path) -> None:
    codes = []
    scenario = tt.load_scenario(
        "lab_circle",
        ["plant.kind=analytic", "duration_s=1.0", "output.recording=false", "output.figures=false"],
    )

    def work() -> None:
        codes.append(main(["list"]))
        tt.run(scenario, tmp_path / "out")

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert codes == [0]
    assert (tmp_path / "out" / "metrics.json").is_file()
