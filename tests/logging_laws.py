"""A control law that logs signals, well or badly; named in scenarios of the tests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ttwmr_mj.controllers.base import Command, Controller, Task
from ttwmr_mj.sensing import Estimate

BAD: dict[str, Mapping[str, Any]] = {  # from the first sample on
    "taken": {"est_x_m": np.zeros(1)},
    "capital": {"Gain": np.zeros(1)},
    "bracket": {"gain [1/s]": np.zeros(1)},
    "long": {"gain_1_s": np.zeros(2)},
    "deep": {"gain_1_s": np.zeros((1, 1))},
}


class Logger(Controller):
    """Drives straight and logs two signals.

    Args:
        case: how; "well", a key of BAD, or what changes at sample 4: "more", "fewer", "renamed".
    """

    def __init__(self, case: str = "well") -> None:
        self._case = case

    def start(self, task: Task) -> None:
        self._nsim = task.nsim

    def command(self, k: int, estimate: Estimate) -> Command:
        wheels = np.full((self._nsim, 2), 1.0)
        return replace(self.plain(wheels), signals=self._signals(k, estimate))

    def _signals(self, k: int, estimate: Estimate) -> Mapping[str, Any]:
        if self._case in BAD:
            return BAD[self._case]
        sample = 10.0 * k + np.arange(self._nsim)
        good = {"sample": sample, "seen_x_m": estimate.state.q[:, 0]}
        if k < 4 or self._case == "well":
            return good
        changed = {
            "more": good | {"third": sample},
            "fewer": {"sample": sample},
            "renamed": {"sample": sample, "x_seen_m": sample},
        }
        return changed[self._case]
