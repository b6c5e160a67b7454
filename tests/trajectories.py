"""Comparing trajectories."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from ttwmr_mj.results.trajectory import Trajectory


def different(a: Trajectory, b: Trajectory) -> list[str]:
    """Names of the arrays and signals that are not the same bits."""
    names = [f.name for f in fields(Trajectory) if f.name != "signals"]
    pairs = [(name, getattr(a, name), getattr(b, name)) for name in names]
    signals = sorted(a.signals.keys() | b.signals.keys())
    nothing = np.empty(0)
    pairs += [(n, a.signals.get(n, nothing), b.signals.get(n, nothing)) for n in signals]
    return [n for n, x, y in pairs if not np.array_equal(x, y, equal_nan=x.dtype.kind == "f")]
