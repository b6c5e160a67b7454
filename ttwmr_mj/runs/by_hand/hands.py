"""What a person's hands ask for: arrow keys in a terminal, or the stick of a gamepad."""

import os
import select
import struct
import sys
import termios
import tty
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from ttwmr_mj.errors import MachineError

GAMEPAD = Path("/dev/input/js0")
EVENT = struct.Struct("<IhBB")  # linux/joystick.h: time, value, type, number
AXIS, BUTTON = 0x02, 0x01  # with 0x80 added, states at the start, which are no moves
FULL = 32767.0
STEP = 0.125  # of the largest speed, per key press
KEYS = {"A": (STEP, 0.0), "B": (-STEP, 0.0), "C": (0.0, -STEP), "D": (0.0, STEP)}
HELP = "↑ ↓ faster, slower; ← → turn; space stops; q ends the run"


class Hands:
    """Reads the terminal and the gamepad without waiting; a context manager.

    Every press of an arrow key adds a step to the speed or the turn. A gamepad's left stick sets
    both at once; its button 2 ends the run.

    Attributes:
        forward: share of the largest speed, in [−1, 1].
        turn: share of the largest turn rate, in [−1, 1]; positive to the left.
        ended: whether the run shall end.

    Raises:
        MachineError: standard input is no terminal.
    """

    def __init__(self, gamepad: Path = GAMEPAD) -> None:
        self.forward = self.turn = 0.0
        self.ended = False
        if not sys.stdin.isatty():
            raise MachineError("driving needs a terminal to type into; standard input is none")
        self._terminal = sys.stdin.fileno()
        self._before = termios.tcgetattr(self._terminal)
        self._typed = ""  # a key's sequence may come in two pieces
        self._gamepad: int | None = None
        if gamepad.exists() and os.access(gamepad, os.R_OK):
            self._gamepad = os.open(gamepad, os.O_RDONLY | os.O_NONBLOCK)

    def __enter__(self) -> Self:
        tty.setcbreak(self._terminal)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with suppress(termios.error):  # the terminal is gone
            termios.tcsetattr(self._terminal, termios.TCSADRAIN, self._before)
        if self._gamepad is not None:
            os.close(self._gamepad)

    @property
    def told(self) -> str:
        """What can be done, in words."""
        return HELP if self._gamepad is None else f"{HELP}; or the gamepad's left stick"

    def look(self) -> None:
        """Take what was typed and moved since the last look."""
        while select.select([self._terminal], [], [], 0.0)[0]:
            try:
                typed = os.read(self._terminal, 64)
            except OSError:
                typed = b""
            if not typed:  # the terminal is gone
                self.ended = True
                break
            self._typed += typed.decode(errors="ignore")
        self._take_keys()
        if self._gamepad is not None:
            self._take_stick(self._gamepad)

    def _take_keys(self) -> None:
        while self._typed:
            if self._typed[0] != "\x1b":
                self._take_letter(self._typed[0])
                self._typed = self._typed[1:]
            elif self._typed[1:2] not in ("", "[", "O"):  # Esc alone
                self._typed = self._typed[1:]
            elif len(self._typed) < 3:
                break  # the rest of the sequence is still on its way
            else:
                forward, turn = KEYS.get(self._typed[2], (0.0, 0.0))
                self.forward = _within(self.forward + forward)
                self.turn = _within(self.turn + turn)
                self._typed = self._typed[3:]

    def _take_letter(self, letter: str) -> None:
        if letter == " ":
            self.forward = self.turn = 0.0
        self.ended |= letter in "qQ"

    def _take_stick(self, gamepad: int) -> None:
        try:
            events = os.read(gamepad, 64 * EVENT.size)
        except OSError:  # nothing moved, or it was unplugged
            return
        for _, value, kind, number in EVENT.iter_unpack(events[: len(events) // 8 * 8]):
            if kind == AXIS and number == 0:
                self.turn = _within(-value / FULL)
            elif kind == AXIS and number == 1:
                self.forward = _within(-value / FULL)
            elif kind == BUTTON and number == 1 and value:
                self.ended = True


def _within(share: float) -> float:
    return min(max(share, -1.0), 1.0)
