"""What a person's hands ask for: arrow keys in a terminal, or the stick of a gamepad."""

import os
import re
import select
import signal
import struct
import sys
import termios
import threading
import tty
from contextlib import suppress
from pathlib import Path
from types import FrameType, TracebackType
from typing import Self

from ttwmr_mj.errors import MachineError

GAMEPAD = Path("/dev/input/js0")
EVENT = struct.Struct("<IhBB")  # linux/joystick.h: time, value, type, number
AXIS, BUTTON = 0x02, 0x01  # with 0x80 added, states at the start, which are no moves
FULL = 32767.0
STEP = 0.125  # of the largest speed, per key press
KEYS = {"A": (STEP, 0.0), "B": (-STEP, 0.0), "C": (0.0, -STEP), "D": (0.0, STEP)}
ESCAPED_OR_LETTER = re.compile(r"\x1b[\[O]([^\x1b])|([^\x1b])")  # Esc alone is neither
UNFINISHED = re.compile(r"\x1b[\[O]?\Z")  # the rest of such a key is still on its way
MOST_TYPED = 1024  # bytes in a look; nobody types as many, who pastes a text means no keys
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
        self._on_pause = signal.signal(signal.SIGTSTP, self._pause)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        signal.signal(signal.SIGTSTP, self._on_pause)
        with suppress(termios.error):  # the terminal is gone
            termios.tcsetattr(self._terminal, termios.TCSADRAIN, self._before)
        if self._gamepad is not None:
            os.close(self._gamepad)

    def _pause(self, signum: int, frame: FrameType | None) -> None:
        """Stop as Ctrl-Z asks; the shell has its terminal as it was, and keys are taken after."""
        del signum, frame
        termios.tcsetattr(self._terminal, termios.TCSADRAIN, self._before)
        signal.pthread_kill(threading.get_ident(), signal.SIGSTOP)  # `fg` goes on here
        tty.setcbreak(self._terminal)

    @property
    def told(self) -> str:
        """What can be done, in words."""
        return HELP if self._gamepad is None else f"{HELP}; or the gamepad's left stick"

    def look(self) -> None:
        """Take what was typed and moved since the last look; of a flood only its beginning."""
        if select.select([self._terminal], [], [], 0.0)[0]:
            typed = self._read_terminal()
            self.ended |= not typed  # the terminal is gone
            self._typed += typed.decode(errors="ignore")
            self._take_keys()
        if self._gamepad is not None:
            self._take_stick(self._gamepad)

    def _read_terminal(self) -> bytes:
        """At most MOST_TYPED bytes, of which there are some; none where there is no terminal."""
        try:
            typed = os.read(self._terminal, MOST_TYPED)
            if len(typed) == MOST_TYPED:
                termios.tcflush(self._terminal, termios.TCIFLUSH)
        except (OSError, termios.error):
            return b""
        return typed

    def _take_keys(self) -> None:
        unfinished = UNFINISHED.search(self._typed)
        end = unfinished.start() if unfinished else len(self._typed)
        for arrow, letter in ESCAPED_OR_LETTER.findall(self._typed[:end]):
            if arrow:
                self._take_arrow(arrow)
            else:
                self._take_letter(letter)
        self._typed = self._typed[end:]

    def _take_arrow(self, arrow: str) -> None:
        forward, turn = KEYS.get(arrow, (0.0, 0.0))
        self.forward = _within(self.forward + forward)
        self.turn = _within(self.turn + turn)

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
