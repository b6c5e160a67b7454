"""Limits that give way at a price: a problem that has no solution then says what stands in its way.

Each limit of a group may be exceeded by the same share s ≥ 0, which costs PRICE·s. As long as the
price is above what the limit is worth to the cost (its multiplier), s is zero wherever it can be
(an exact penalty); where it cannot, s is by how much the limit has to be raised.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ttwmr_mj.state import FloatArray

PRICE = 1e3
GIVEN_WAY = 1e-3  # less is the solver's tolerance


@dataclass(frozen=True, slots=True)
class Exceeded:
    """A limit that cannot be kept."""

    group: str
    share: float  # what has to be added to it, of it
    limit: float
    knot: int  # where it is exceeded most


class Elastic:
    """The limits of one problem (`casadi.Opti`)."""

    def __init__(self, problem: Any) -> None:
        self._problem = problem
        self._slack: dict[str, Any] = {}
        self._values: dict[str, list[tuple[Any, float]]] = {}

    def within(self, group: str, value: Any, limit: float) -> None:
        """|value| ≤ limit, of a row of knots, or of steps between them."""
        slack = self._slack_of(group)
        self._problem.subject_to(value / limit <= 1.0 + slack)
        self._problem.subject_to(value / limit >= -1.0 - slack)
        self._values[group].append((value, limit))

    def at_least(self, group: str, value: Any, limit: float) -> None:
        """Value ≥ limit, of a row of knots."""
        slack = self._slack_of(group)
        self._problem.subject_to(value / limit >= 1.0 - slack)
        self._values[group].append((2.0 * limit - value, limit))  # which exceeds it as it falls

    @property
    def cost(self) -> Any:
        """What giving way costs."""
        return PRICE * sum(self._slack.values())

    def exceeded(self, value_of: Callable[[Any], Any]) -> list[Exceeded]:
        """The limits that gave way in a solution, the most first."""
        found = []
        for group, slack in self._slack.items():
            share = float(value_of(slack))
            if share > GIVEN_WAY:
                rows = [_of(value_of(value), limit) for value, limit in self._values[group]]
                knot = int(max(rows, key=np.max).argmax())
                found.append(Exceeded(group, share, self._values[group][0][1], knot))
        return sorted(found, key=lambda one: -one.share)

    def _slack_of(self, group: str) -> Any:
        if group not in self._slack:
            slack = self._problem.variable()
            self._problem.subject_to(slack >= 0.0)
            self._problem.set_initial(slack, 0.1)
            self._slack[group], self._values[group] = slack, []
        return self._slack[group]


def _of(value: Any, limit: float) -> FloatArray:
    """(n,) shares of a limit."""
    return np.asarray(np.abs(np.atleast_1d(value)) / limit, dtype=np.float64).ravel()
