"""Driving by hand: a real process types into a pseudo-terminal, and the run is replayed."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys
import termios
import time
from array import array
from fcntl import ioctl
from pathlib import Path

import numpy as np
import pytest

from ttwmr_mj.cli.main import main
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs.by_hand.hands import EVENT, FULL, STEP, Hands
from ttwmr_mj.scenario.file import load_scenario

UP, DOWN, RIGHT, LEFT = (f"\x1b[{letter}" for letter in "ABCD")


class Terminal:
    """A process whose standard input and output are a terminal that a test types into."""

    def __init__(self, command: list[str], folder: Path) -> None:
        self._ours, theirs = pty.openpty()
        self.process = subprocess.Popen(
            command, cwd=folder, stdin=theirs, stdout=theirs, stderr=theirs, close_fds=True
        )
        os.close(theirs)
        self.said = ""

    def until(self, word: str, limit_s: float = 120.0) -> None:
        """Wait until the process has said a word."""
        give_up_s = time.monotonic() + limit_s
        while word not in self.said:
            assert time.monotonic() < give_up_s, self.said
            try:
                self.said += os.read(self._ours, 4096).decode(errors="replace")
            except OSError as error:  # the process has ended
                raise AssertionError(self.said) from error

    @property
    def echoes(self) -> bool:
        """Whether it shows what is typed, as a shell expects it to."""
        return bool(termios.tcgetattr(self._ours)[3] & termios.ECHO)

    def type(self, keys: str) -> None:
        os.write(self._ours, keys.encode())

    def end(self) -> int:
        try:
            while piece := os.read(self._ours, 4096):
                self.said += piece.decode(errors="replace")
        except OSError:
            pass
        return self.process.wait(60)


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A run that was driven ahead, then to the left, then stopped; and what was shown."""
    folder = tmp_path_factory.mktemp("drive")
    command = [sys.executable, "-m", "ttwmr_mj", "drive", "--out", "out", "--live=none"]
    terminal = Terminal(command, folder)
    terminal.until(" 0.5 s")
    terminal.type(4 * UP)
    terminal.until(" 1.5 s")
    terminal.type(3 * LEFT)
    terminal.until(" 2.5 s")
    terminal.type(" ")
    terminal.until(" 3.0 s")
    terminal.type("q")
    assert terminal.end() == 0, terminal.said
    return folder / "out", terminal.said


def test_what_is_typed_is_driven(driven: tuple[Path, str]) -> None:
    folder, said = driven
    rows = Trajectory.read(folder / "trajectory.parquet")
    right, left = rows.wheel_command_rad_s[:, 0].T
    ahead = (right > 0.0) & (right == left)
    turning = right > left
    stopped = (right == 0.0) & (left == 0.0)
    assert (ahead | turning | stopped).all()
    # rest, straight on, to the left, rest; each for about a second, on a machine under any load
    phases = [stopped, ahead, turning, stopped]
    first = [int(np.flatnonzero(phase)[0]) for phase in phases[:3]]
    assert first == sorted(first)
    assert first[0] == 0
    assert stopped[-1]
    straight = rows.q[first[2], 0, 2] - rows.q[0, 0, 2]
    assert abs(straight) < 0.05
    assert rows.q[-1, 0, 2] - rows.q[first[2], 0, 2] > 0.1  # to the left
    assert "q ends" in said
    assert "drive it again" in said


def test_a_driven_run_is_a_run_like_any_other(driven: tuple[Path, str], tmp_path: Path) -> None:
    folder, _ = driven
    scenario = load_scenario(str(folder / "scenario.resolved.toml"))
    assert scenario.controller.kind == "open_loop"
    assert json.loads((folder / "metrics.json").read_text())["status"] == "ok"
    assert (folder / "run.rrd").stat().st_size > 10_000
    again = tmp_path / "again"
    resolved = str(folder / "scenario.resolved.toml")
    assert main(["run", resolved, "--out", str(again), "--quiet"]) == 0
    was, now = (Trajectory.read(f / "trajectory.parquet").to_columns() for f in (folder, again))
    assert was.keys() == now.keys()
    for name, values in was.items():
        np.testing.assert_array_equal(values, now[name], err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("signum", [signal.SIGTERM, signal.SIGQUIT, signal.SIGUSR1])
def test_a_drive_that_is_stopped_is_no_success(signum: signal.Signals, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "ttwmr_mj", "drive", "--out", "out", "--live=none"]
    terminal = Terminal(command, tmp_path)
    echoed = terminal.echoes
    terminal.until(" 0.5 s")
    assert not terminal.echoes
    terminal.process.send_signal(signum)
    assert terminal.end() == 1
    assert terminal.echoes == echoed
    assert "ttwmr: lab_circle interrupted at" in terminal.said
    assert json.loads((tmp_path / "out" / "metrics.json").read_text())["status"] == "interrupted"


@pytest.mark.slow
def test_a_drive_pauses_as_a_shell_asks_and_goes_on(tmp_path: Path) -> None:
    """Ctrl-Z: the shell's terminal is as it was; after `fg` keys are taken again, one by one."""
    command = [sys.executable, "-m", "ttwmr_mj", "drive", "--out", "out", "--live=none"]
    terminal = Terminal(command, tmp_path)
    echoed = terminal.echoes
    terminal.until(" 0.5 s")
    process = terminal.process
    process.send_signal(signal.SIGTSTP)
    assert os.waitid(os.P_PID, process.pid, os.WSTOPPED) is not None
    assert terminal.echoes == echoed
    process.send_signal(signal.SIGCONT)
    while terminal.echoes:  # what is typed until then is dropped
        time.sleep(0.01)
    terminal.type("q")  # without Enter
    assert terminal.end() == 0, terminal.said


def test_a_drive_has_no_duration(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["--set", "duration_s=3", "--live=none", "--out", str(tmp_path / "out")]
    assert main(["drive", "lab_circle", *given]) == 2
    assert "a drive lasts until you end it; --longest ends it at the latest" in (
        capsys.readouterr().err
    )
    assert not (tmp_path / "out").exists()


def test_driving_needs_a_terminal(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "ttwmr_mj", "drive", "--live=none"]
    done = subprocess.run(
        command, cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "driving needs a terminal" in done.stderr
    assert not (tmp_path / "results").exists()


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch) -> tuple[int, Hands]:
    """Hands at a pseudo-terminal, and the file to type into."""
    ours, theirs = pty.openpty()
    monkeypatch.setattr("sys.stdin", os.fdopen(theirs))
    return ours, Hands(Path("/nonexistent"))


def _look(hands: Hands, expected: float) -> None:
    """Look until what was typed has come through the terminal."""
    for _ in range(200):
        hands.look()
        if hands.forward == expected:
            return
        time.sleep(0.01)
    raise AssertionError(f"forward stays at {hands.forward}")


def test_arrow_keys_add_up_and_have_an_end(typed: tuple[int, Hands]) -> None:
    terminal, hands = typed
    with hands:
        os.write(terminal, (3 * UP + DOWN + RIGHT).encode())
        _look(hands, 2 * STEP)
        assert hands.turn == -STEP  # to the right is negative
        os.write(terminal, (20 * UP).encode())
        _look(hands, 1.0)
        os.write(terminal, b" ")
        _look(hands, 0.0)
        assert hands.turn == 0.0
        os.write(terminal, b"\x1b" + UP.encode())  # Esc alone, then a key
        _look(hands, STEP)
        os.write(terminal, b" ")
        _look(hands, 0.0)
        os.write(terminal, b"\x1b[")  # one key in two pieces
        hands.look()
        os.write(terminal, b"B")
        _look(hands, -STEP)
        assert not hands.ended


def test_of_a_pasted_text_only_the_beginning_is_taken(typed: tuple[int, Hands]) -> None:
    """However long it is, a look takes as long; and the rest of it is no keys."""
    terminal, hands = typed
    with hands:
        text = UP.encode() + 3000 * b"a" + b"q"
        os.write(terminal, text)
        waiting = array("i", [0])
        while waiting[0] < len(text):
            ioctl(sys.stdin, termios.FIONREAD, waiting)
        hands.look()
        ioctl(sys.stdin, termios.FIONREAD, waiting)
        assert waiting[0] == 0
        assert (hands.forward, hands.ended) == (STEP, False)
        os.write(terminal, b"q")
        while not hands.ended:
            hands.look()


def test_a_terminal_that_vanishes_ends_the_drive(typed: tuple[int, Hands]) -> None:
    terminal, hands = typed
    with hands:
        os.close(terminal)
        hands.look()
        assert hands.ended


@pytest.mark.usefixtures("typed")
def test_a_gamepads_stick_sets_both(tmp_path: Path) -> None:
    pad = tmp_path / "js0"
    os.mkfifo(pad)
    writer = os.open(pad, os.O_RDWR)
    with Hands(pad) as hands:
        assert "gamepad" in hands.told
        events = [(0, -16384, 2, 1), (1, 32767, 2, 0), (2, 9, 2, 5), (3, 1, 0x81, 1)]
        os.write(writer, b"".join(EVENT.pack(*event) for event in events))
        hands.look()
        assert hands.forward == 16384 / FULL  # pushed ahead is negative on a gamepad
        assert hands.turn == -1.0
        assert not hands.ended  # the state a gamepad reports when it is opened is no press
        os.write(writer, EVENT.pack(4, 1, 1, 1))
        hands.look()
        assert hands.ended
    os.close(writer)
