"""One requirement along a reference: how much is asked, where, and how much there is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ttwmr_mj.errors import Fault, Keys
from ttwmr_mj.state import BoolArray, FloatArray

MOMENT_S = 0.1  # three control periods: what servos are late by in them, a law works off
ROUNDING = 1e-9
# what the robot needs to move so at all, whatever its trailer does; in words
DRIVES = {
    "wheel speed": "turns a wheel at {}",
    "wheel acceleration": "accelerates a wheel by {}",
    "wheel torque": "asks a wheel for {}",
    "motor voltage": "asks a motor for {}",
    "grip": "asks the tyres for {}",
}
OTHERS = {
    "free trailer": "asks the hitch for {} that it does not have",
    "workspace": "reaches {}",
    "picture": "is {} outside the camera's picture",
}


@dataclass(frozen=True, slots=True)
class Demand:
    """One requirement along a reference."""

    name: str  # what is required
    unit: str  # of the values
    worst: float  # the largest value, at `worst_time_s`; NaN where the reference defines none
    worst_time_s: float
    limit: float  # its bound
    spans_s: tuple[tuple[float, float], ...]  # (start, end) of every stretch of time over the bound
    binding: bool = True  # whether breaking it makes the reference infeasible
    place_m: tuple[float, float] = (np.nan, np.nan)  # P at `worst_time_s`
    key: Keys = ()  # of the scenario, where the limit is set

    @property
    def kept(self) -> bool:
        """Whether the bound holds everywhere."""
        return not self.spans_s

    @property
    def broken_for_s(self) -> float:
        """How long the bound is exceeded, all stretches together."""
        return sum(end - start for start, end in self.spans_s)

    @property
    def lasts(self) -> bool:
        """Whether the bound is exceeded for more than a moment."""
        return self.broken_for_s > MOMENT_S

    @property
    def sentence(self) -> str:
        """What the reference asks of the drive, against what there is."""
        return f"the reference {self._asked} (limit {self._amount(self.limit)})"

    def fault(self, duration_s: float, hint: str = "") -> Fault:
        """The broken bound as a fault of the reference.

        Args:
            duration_s: of the reference, to say whether it is exceeded throughout.
            hint: what to do about it.
        """
        long = self.broken_for_s
        lasting = "throughout" if long > 0.99 * duration_s else f"for {long:.3g} s in all"
        x, y = (round(value, 2) + 0.0 for value in self.place_m)  # no minus zero
        problem = f"at {self.worst_time_s:.3g} s, where P is at ({x:.2f}, {y:.2f}) m; {lasting}"
        where = f" ({'.'.join(map(str, self.key))})" if self.key else ""
        most = "" if self.name == "free trailer" else f"{self._amount(self.limit)}{where}"
        return Fault(
            key=("reference",), problem=f"{self._asked} {problem}", allowed=most, hint=hint
        )

    @property
    def _asked(self) -> str:
        return {**DRIVES, **OTHERS}[self.name].format(self._amount(self.worst))

    def _amount(self, value: float) -> str:
        if self.unit == "N·m" and abs(value) < 0.1:
            return f"{1e3 * value:.3g} mN·m"
        return f"{value:.3g} {self.unit}".rstrip()

    def __str__(self) -> str:
        mark = "ok  " if self.kept else "FAIL" if self.binding else "note"
        text = f"{mark} {self.name}: {self.worst:.4g} of {self.limit:.4g} {self.unit}".rstrip()
        text += f" at {self.worst_time_s:.4g} s"
        if self.kept:
            return text
        first, last = self.spans_s[0]
        more = f" and {len(self.spans_s) - 1} more" if len(self.spans_s) > 1 else ""
        return f"{text}; broken from {first:.4g} s to {last:.4g} s{more}"


@dataclass(frozen=True, slots=True)
class Feasibility:
    """The verdict on a reference."""

    checks: tuple[Demand, ...]

    @property
    def feasible(self) -> bool:
        """Whether every binding check is kept."""
        return all(check.kept for check in self.checks if check.binding)

    @property
    def undrivable(self) -> tuple[Demand, ...]:
        """What is asked of servo and tyres beyond their limits for more than a moment."""
        driven = (check for check in self.checks if check.name in DRIVES)
        return tuple(check for check in driven if check.lasts)

    @property
    def broken(self) -> tuple[Demand, ...]:
        """What is exceeded for more than a moment, and can be said."""
        said = (check for check in self.checks if check.name in {**DRIVES, **OTHERS})
        return tuple(check for check in said if check.lasts)

    def __getitem__(self, name: str) -> Demand:
        """A check by its name."""
        return next(check for check in self.checks if check.name == name)

    def __str__(self) -> str:
        return "\n".join([f"feasible: {'yes' if self.feasible else 'no'}", *map(str, self.checks)])


class Along(NamedTuple):
    """Where demands are made."""

    time_s: FloatArray  # (n,)
    place_m: FloatArray  # (n, batch, 2) P

    def at_most(
        self, name: str, unit: str, values: FloatArray, limit: float, *key: str | int
    ) -> Demand:
        """The demand that no value (n, batch, ...) be larger than a limit, of either sign.

        Of a batch, the worst member counts; NaN is not too large.
        """
        size = np.fmax.reduce(np.abs(values).reshape(len(self.time_s), -1), axis=1)
        return replace(self.worst_of(name, unit, size, limit), key=key)

    def worst_of(self, name: str, unit: str, size: FloatArray, limit: float) -> Demand:
        """The same of sizes (n,)."""
        known = np.nan_to_num(size, nan=-np.inf)
        k = int(
            np.argmax(known >= known.max() - ROUNDING * abs(known.max()))
        )  # the first of equals
        x, y = map(float, self.place_m[k, 0])
        broken = spans(self.time_s, size > limit)
        worst, when = float(size[k]), float(self.time_s[k])
        return Demand(name, unit, worst, when, limit, broken, place_m=(x, y))


def spans(time_s: FloatArray, broken: BoolArray) -> tuple[tuple[float, float], ...]:
    """First and last sample of every stretch of broken samples."""
    edges = np.diff(np.concatenate([[0], broken.astype(np.int8), [0]]))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    return tuple((float(time_s[i]), float(time_s[j])) for i, j in zip(starts, ends, strict=True))
