"""Open-loop scenarios that the comparison's tests share."""

from __future__ import annotations

from typing import Any

import numpy as np

from ttwmr_mj.scenario.file import check_scenario
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.compare.motion import run_contact

TURN = ((1.0, 5.0, 5.0), (1.2, 5.6, 3.2), (0.8, 5.0, 5.0))


def open_loop(
    *wheels: tuple[float, float, float], hitch: dict[str, Any] | None = None, **more: Any
) -> Scenario:
    """An open-loop scenario: (duration, right, left) segments, from rest at the origin."""
    segments = [
        {"duration_s": d, "wheel_right_rad_s": r, "wheel_left_rad_s": left} for d, r, left in wheels
    ]
    data: dict[str, Any] = {
        "name": "test",
        "duration_s": sum(d for d, _, _ in wheels),
        "robot": {"hitch": hitch or {}},
        "initial": {"x_m": 0.0, "y_m": 0.0},
        "reference": {"kind": "none"},
        "controller": {"kind": "open_loop", "segments": segments},
        "output": {"recording": False, "figures": False},
        **more,
    }
    return check_scenario(data, "test")


def run_commands(scenario: Scenario) -> FloatArray:
    return np.array(run_contact(scenario).commands)
