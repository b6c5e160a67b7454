"""A rule: comparisons of numbers with limits, and by how much a limit may move before it turns."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

Verdict = Literal["holds", "holds with changes", "fails", "undecided", "evidence missing"]

COMPARE: dict[str, Callable[[float, float], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
}


@dataclass(frozen=True, slots=True)
class Comparison:
    """`number sign limit`; not met where the number is undefined."""

    number: str  # its name
    sign: str  # a key of COMPARE
    limit: str  # name of a limit, or a number as text

    def met(self, values: Mapping[str, float], limits: Mapping[str, float]) -> bool:
        """Whether a claim's numbers are on the right side."""
        limit = limits[self.limit] if self.limit in limits else float(self.limit)
        return COMPARE[self.sign](values[self.number], limit)


@dataclass(frozen=True, slots=True)
class Rule:
    """What makes a claim hold: all comparisons of one of the two rows."""

    holds: tuple[Comparison, ...]
    holds_with_changes: tuple[Comparison, ...]  # none where no change is named

    @classmethod
    def parse(cls, holds: str, holds_with_changes: str) -> Rule:
        """As claims.toml has it: comparisons joined by "and"."""

        def row(text: str) -> tuple[Comparison, ...]:
            return tuple(Comparison(*part.split()) for part in text.split(" and ") if part)

        return cls(row(holds), row(holds_with_changes))

    def verdict(self, values: Mapping[str, float], limits: Mapping[str, float]) -> Verdict:
        """The answer for one set of numbers."""
        if all(part.met(values, limits) for part in self.holds):
            return "holds"
        changed = self.holds_with_changes
        if changed and all(part.met(values, limits) for part in changed):
            return "holds with changes"
        return "fails"

    @property
    def comparisons(self) -> tuple[Comparison, ...]:
        """All of both rows."""
        return (*self.holds, *self.holds_with_changes)

    def range_of(
        self, limit: str, cases: Iterable[Mapping[str, float]], limits: Mapping[str, float]
    ) -> tuple[float, float]:
        """The range in which a limit may lie without any case's verdict turning.

        Verdicts turn only where the limit meets a number it is compared with.

        Args:
            limit: its name.
            cases: the numbers of every case.
            limits: all limits; the others stay.

        Returns:
            The ends of the range; 0 and infinity where nothing turns.
        """
        told = list(cases)
        numbers = {part.number for part in self.comparisons if part.limit == limit}
        turns = {abs(case[name]) for case in told for name in numbers if math.isfinite(case[name])}
        below = sorted((x for x in turns if x <= limits[limit]), reverse=True)
        above = sorted(x for x in turns if x > limits[limit])

        def verdicts(value: float) -> list[Verdict]:
            return [self.verdict(case, {**limits, limit: value}) for case in told]

        def first(ends: list[float], scale: float, none: float) -> float:
            """The first number beyond which some verdict is another."""
            beyond = (end for end in ends if verdicts(end * scale) != now)
            return next(beyond, none)

        now = verdicts(limits[limit])
        return first(below, 1.0 - 1e-9, 0.0), first(above, 1.0 + 1e-9, math.inf)
