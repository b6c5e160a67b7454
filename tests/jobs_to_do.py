"""What the tests of the pool let its processes do."""

from __future__ import annotations

import errno
import os
import pickle
import signal
import subprocess
import threading
import time
from pathlib import Path

from ttwmr_mj.errors import InputError, MachineError
from ttwmr_mj.files import written
from ttwmr_mj.studies.pool import jobs

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


def close_all() -> str:
    """Close what a process does not own, after and before it begins to watch its caller."""
    time.sleep(0.5)
    os.closerange(3, 200)
    threading.Thread(target=jobs._leave_with_the_caller, daemon=True).start()
    time.sleep(2.5)
    return "done all the same"


def write_into_pipes() -> str:
    """Write half a message into whatever there is."""
    for number in range(3, 200):
        for _ in range(100):
            try:
                os.set_blocking(number, False)
                os.write(number, b"\x00\x00\x00\x40abc")
            except OSError:
                break
    return "done all the same"


def end_the_server(by: int) -> None:
    os.kill(os.getppid(), by)
    time.sleep(600.0)


def leave_a_child(pids: Path) -> None:
    child = subprocess.Popen(["sleep", "600"])
    pids.write_text(str(child.pid))


def leave_a_thread() -> str:
    threading.Thread(target=time.sleep, args=(600.0,)).start()
    return "done all the same"


def damage_the_answer(by: bytes) -> None:
    """Let something else be written."""
    pickle.dumps = lambda _: by  # type: ignore[assignment]


def killed() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def find_the_disk_full() -> None:
    raise OSError(errno.ENOSPC, "no space left on device")


def find_no_room_for_the_answer() -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "no space left on device")

    Path.open = full  # type: ignore[assignment, method-assign]


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


def write_half(path: Path) -> None:
    with written(path) as draft:
        draft.write_text("half")
        os.kill(os.getpid(), signal.SIGKILL)
