"""What all jobs import: asked for by name, for the server that their processes are forked from."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from importlib import import_module

from ttwmr_mj.registry import LeftOut

_VARIABLE = "TTWMR_MJ_PRELOAD"  # of the environment, which processes inherit


def ask_for(modules: Sequence[str]) -> None:
    """Let processes that are started from now on import these."""
    os.environ[_VARIABLE] = " ".join(modules)


def load() -> None:
    """Import what was asked for; raises whatever an import raises.

    What other packages add and cannot be used, the command that starts these processes tells.
    """
    warnings.filterwarnings("ignore", category=LeftOut)
    for name in os.environ.get(_VARIABLE, "").split():
        import_module(name)
