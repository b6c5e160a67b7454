"""ttwmr-mj: a MuJoCo testbed for a tractor towing a spherical-wheeled trailer."""

from __future__ import annotations

from typing import Any


def __getattr__(name: str) -> Any:
    """The version, looked up when asked for: reading it takes as long as `ttwmr --help` has."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib.metadata import version

    return version("ttwmr-mj")
