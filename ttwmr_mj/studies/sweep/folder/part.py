"""A part of a sweep's rows, for one of several machines that do not talk to each other."""

from __future__ import annotations

from dataclasses import dataclass

from ttwmr_mj.errors import InputError, shown, whole
from ttwmr_mj.studies.sweep.plan.plan import Plan


@dataclass(frozen=True, slots=True)
class Part:
    """One of several equal parts of a plan's rows, counted from 1."""

    index: int = 1
    count: int = 1

    @classmethod
    def of(cls, text: str | None) -> Part:
        """What --shard says, such as 2/8.

        Raises:
            InputError: it is no such thing.
        """
        if text is None:
            return cls()
        index, count = map(whole, text.partition("/")[::2])
        if index and count and index <= count:
            return cls(index, count)
        raise InputError.at("--shard", got=shown(text), allowed="i/n with 1 <= i <= n, such as 2/8")

    def rows(self, plan: Plan) -> tuple[int, int]:
        """First row, and the one after the last."""
        return (plan.rows * (self.index - 1) // self.count, plan.rows * self.index // self.count)

    @property
    def name(self) -> str:
        """For the lock's file; empty for the whole."""
        return f"{self.index}-of-{self.count}" if self.count > 1 else ""
