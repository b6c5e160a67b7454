"""Imports what all jobs need, once in the server that their processes are forked from.

The server would end with what such an import raises, as MuJoCo's does of a wrong MUJOCO_GL. Here it
goes on, and every job's process tries again and can say so.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module

_VARIABLE = "TTWMR_MJ_PRELOAD"  # of the environment, which processes inherit


def ask_for(modules: Sequence[str]) -> None:
    """Let processes that are started from now on import these."""
    os.environ[_VARIABLE] = " ".join(modules)


def load() -> None:
    """Import what was asked for; raises whatever an import raises."""
    for name in os.environ.get(_VARIABLE, "").split():
        import_module(name)


with suppress(Exception):
    load()
