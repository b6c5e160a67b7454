"""The article's claims (claims.toml): statements, and the rules that judge them."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from typing import Any, Literal

from ttwmr_mj.studies.reproduce.claims.computed import Numbers
from ttwmr_mj.studies.reproduce.claims.limits import LIMITS
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.words import read_toml, told

Verdict = Literal["holds", "holds with changes", "fails", "evidence missing"]

COMPARE = {"<=": operator.le, ">=": operator.ge, "<": operator.lt}


@dataclass(frozen=True, slots=True)
class Judgement:
    """What a rule says of the evidence.

    Attributes:
        verdict: one of four.
        numbers: what it was judged by, units in the names; None where undefined.
        finding: in words.
    """

    verdict: Verdict
    numbers: dict[str, float | None]
    finding: str


@dataclass(frozen=True, slots=True)
class Claim:
    """A statement of the article and the rule that tests it.

    Attributes:
        name: short, for claims.json.
        source: where the article says it.
        statement: what it says.
        rule: how it is judged, in words, written down before the run.
        finding: what came out, with numbers in braces.
        holds: the rule: comparisons of numbers with numbers and limits, joined by "and"; with none
            it is never met.
        holds_with_changes: likewise.
        numbers: what it is judged by.
    """

    name: str
    source: str
    statement: str
    rule: str
    finding: str
    holds: str
    holds_with_changes: str
    numbers: Numbers

    @classmethod
    def of(cls, name: str, entry: dict[str, Any]) -> Claim:
        """As claims.toml has it."""
        return cls(
            name=name,
            source=entry["source"],
            statement=entry["statement"],
            rule=told(entry["rule"], LIMITS),
            finding=entry["finding"],
            holds=entry.get("holds", ""),
            holds_with_changes=entry.get("holds_with_changes", ""),
            numbers=Numbers.of(entry),
        )

    def judgement(self, evidence: Evidence) -> Judgement:
        """The rule's answer, or that evidence is missing where its runs could not be done."""
        lacking = evidence.lacking(self.numbers.needed)
        if lacking:
            reasons = "; ".join(f"{name}: {evidence.failures[name]}" for name in lacking)
            return Judgement("evidence missing", {}, f"What the rule needs was not run. {reasons}")
        values = self.numbers.values(evidence)
        return Judgement(
            self._verdict(values),
            {name: value if math.isfinite(value) else None for name, value in values.items()},
            told(self.finding, values),
        )

    def _verdict(self, values: dict[str, float]) -> Verdict:
        if _met(self.holds, values):
            return "holds"
        return "holds with changes" if _met(self.holds_with_changes, values) else "fails"


def _met(condition: str, values: dict[str, float]) -> bool:
    known = LIMITS | values
    comparisons = (part.split() for part in condition.split(" and ") if part)
    met = [
        COMPARE[sign](values[left], known[right] if right in known else float(right))
        for left, sign, right in comparisons
    ]
    return bool(met) and all(met)


CLAIMS = {
    name: Claim.of(name, entry) for name, entry in read_toml(__package__, "claims.toml").items()
}
