"""A scene is compiled on trial, by a process that ends before it takes too much.

A few lines can make MuJoCo fill the memory or work for hours: pictures, nested <replicate>, sizes.
Nothing breaks it off within this process.
"""

import os
import subprocess
import sys
from functools import cache
from pathlib import Path

from ttwmr_mj.deadline import step
from ttwmr_mj.errors import InputError

MOST_S = 3.0  # of processor time
MOST_BYTES = 1_000_000_000  # of memory, where the system tells how much is taken: on Linux
# MuJoCo's errors are told by whoever reads the scene next
_TRY = """
import os, sys, threading, time
import mujoco

scene, most_s, most_bytes = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])

def resident_bytes():
    if sys.platform != "linux":
        return 0
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE")

def stop_if_too_much():
    for taken, most, told in (
        (resident_bytes(), most_bytes, f"{most_bytes / 1e9:g} GB of memory"),
        (time.process_time(), most_s, f"{most_s:g} s of processor time"),
    ):
        if taken > most:
            os.write(1, f"MuJoCo needs more than {told} to compile it".encode())
            os._exit(1)

def watch():
    while True:
        stop_if_too_much()
        time.sleep(0.02)

threading.Thread(target=watch, daemon=True).start()
mujoco.set_mju_user_warning(lambda _: None)
try:
    spec = mujoco.MjSpec.from_file(scene)
    for key in spec.keys:
        spec.delete(key)
    mujoco.MjData(spec.compile())
except Exception:
    pass
stop_if_too_much()
os._exit(0)
"""


def refuse_what_takes_too_much(scene: str, files: list[Path]) -> None:
    """Refuse a scene that cannot be compiled within the limits, or by which MuJoCo crashes.

    Args:
        scene: path of the MJCF file.
        files: that it is made of; it is tried once, and again when they have changed.

    Raises:
        InputError: with the limit.
    """
    states = ((file, file.stat()) for file in files)
    problem = _problem(scene, tuple((file, s.st_mtime_ns, s.st_size) for file, s in states))
    if problem:
        raise InputError.at(
            "plant.contact.model_path",
            problem,
            got=repr(scene),
            allowed=f"{MOST_BYTES / 1e9:g} GB and {MOST_S:g} s",
            hint="make its pictures, meshes and height fields smaller, and the numbers in "
            "<replicate> and <size>",
        )


@cache
def _problem(scene: str, files: tuple[tuple[Path, int, int], ...]) -> str:
    """Why a scene made of these files in this state is refused; empty: it is not."""
    del files
    step()
    done = subprocess.run(
        [sys.executable, "-c", _TRY, scene, str(MOST_S), str(MOST_BYTES)],
        env={**os.environ, "MUJOCO_GL": "", "PYTHONSAFEPATH": "1"},  # no files lying about
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    if done.returncode == 0:
        return ""
    last = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
    return done.stdout or f"MuJoCo crashes as it compiles it: {last}"
