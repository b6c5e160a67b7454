"""What the tests of the pool let its processes do."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import time
from pathlib import Path

from ttwmr_mj.errors import InputError, MachineError

CALLS: list[int] = []


def count_calls() -> int:
    CALLS.append(1)
    return len(CALLS)


def refuse() -> None:
    raise InputError.at("some.key", got="1")


def break_off() -> None:
    raise ZeroDivisionError("of its own making")


def leave() -> None:
    print("last words", flush=True)
    os._exit(3)


def leave_quietly() -> None:
    os._exit(0)


def crash() -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def close_all() -> None:
    time.sleep(1.0)  # until who waits for the caller does; later it finds its pipe closed too
    os.closerange(3, 200)
    time.sleep(600.0)


def killed() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def find_the_disk_full() -> None:
    raise OSError(errno.ENOSPC, "no space left on device")


def miss_opengl() -> None:
    raise MachineError("there is no OpenGL")


def return_a_function() -> object:
    return lambda: None


def sleep_with_a_child(pids: Path) -> None:
    child = subprocess.Popen(["sleep", "600"])
    draft = pids.with_suffix(".part")
    draft.write_text(f"{os.getpid()} {child.pid}")
    draft.replace(pids)
    time.sleep(600.0)
