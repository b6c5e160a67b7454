"""The article's claims (claims.toml): statements, and the rules that judge them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ttwmr_mj.studies.reproduce.claims.computed import Numbers
from ttwmr_mj.studies.reproduce.claims.limits import LIMITS
from ttwmr_mj.studies.reproduce.claims.rule import Rule, Verdict
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.words import mm, read_toml, told

Values = dict[str, float | None]  # None where undefined


@dataclass(frozen=True, slots=True)
class Case:
    """What the rule says under one assumption."""

    assumed: str  # in words; "" where the claim assumes nothing that is varied
    verdict: Verdict
    numbers: Values


@dataclass(frozen=True, slots=True)
class Judgement:
    """What a rule says of the evidence.

    Attributes:
        verdict: one of five; "undecided" where it depends on what is assumed.
        numbers: what it was judged by, units in the names; of the first case where there are more.
        finding: in words.
        cases: the verdict under every assumption.
        stays: limit → the range in which it may lie without a verdict turning; None: no end.
    """

    verdict: Verdict
    numbers: Values
    finding: str
    cases: tuple[Case, ...] = ()
    stays: dict[str, tuple[float, float | None]] | None = None

    @property
    def sensitivity(self) -> list[str]:
        """By how much each limit may move, in words."""
        return [_stays(name, *ends) for name, ends in (self.stays or {}).items()]


def _stays(name: str, low: float, high: float | None) -> str:
    def shown(value: float) -> str:
        return mm(value) if name.endswith("_M") else f"{value:.3g}"

    at = f"{name} = {shown(LIMITS[name])}"
    if high is None:
        return f"{at}: anything above {shown(low)}" if low else f"{at}: anything"
    return f"{at}: {shown(low)} to {shown(high)}" if low else f"{at}: anything up to {shown(high)}"


@dataclass(frozen=True, slots=True)
class Claim:
    """A statement of the article and the rule that tests it.

    Attributes:
        name: short, for claims.json.
        source: where the article says it.
        statement: what it says.
        rule: how it is judged, in words, written down before the run.
        finding: what came out, with numbers in braces.
        decides: the rule.
        cases: what is assumed in words → what the claim is judged by then; one case where nothing
            is varied.
        figures: those that show it.
    """

    name: str
    source: str
    statement: str
    rule: str
    finding: str
    decides: Rule
    cases: dict[str, Numbers]
    figures: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, entry: dict[str, Any]) -> Claim:
        """As claims.toml has it."""
        return cls(
            name=name,
            source=entry["source"],
            statement=entry["statement"],
            rule=told(entry["rule"], LIMITS),
            finding=entry["finding"],
            decides=Rule.parse(entry["holds"], entry.get("holds_with_changes", "")),
            cases={
                assumed: Numbers.of(_assuming(entry, word))
                for assumed, word in entry.get("assuming", {"": ""}).items()
            },
            figures=tuple(entry.get("figures", ())),
        )

    @property
    def runs(self) -> tuple[str, ...]:
        """The runs it needs, of all cases."""
        return tuple(dict.fromkeys(run for case in self.cases.values() for run in case.runs))

    @property
    def studies(self) -> tuple[str, ...]:
        """The studies it needs."""
        return tuple(dict.fromkeys(name for case in self.cases.values() for name in case.studies))

    def judgement(self, evidence: Evidence) -> Judgement:
        """The rule's answer, or that evidence is missing where its runs could not be done."""
        lacking = evidence.lacking((*self.runs, *self.studies))
        if lacking:
            reasons = "; ".join(f"{name}: {evidence.failures[name]}" for name in lacking)
            return Judgement("evidence missing", {}, f"What the rule needs was not run. {reasons}")
        return self.judged({name: case.values(evidence) for name, case in self.cases.items()})

    def judged(self, values: dict[str, dict[str, float]]) -> Judgement:
        """The rule's answer for the numbers of every case."""
        cases = tuple(
            Case(assumed, self.decides.verdict(numbers, LIMITS), _defined(numbers))
            for assumed, numbers in values.items()
        )
        verdicts = {case.verdict for case in cases}
        return Judgement(
            verdict=verdicts.pop() if len(verdicts) == 1 else "undecided",
            numbers=cases[0].numbers,
            finding=told(self.finding, LIMITS | next(iter(values.values()))),
            cases=cases,
            stays=self._stays(values),
        )

    def _stays(self, values: dict[str, dict[str, float]]) -> dict[str, tuple[float, float | None]]:
        used = dict.fromkeys(c.limit for c in self.decides.comparisons if c.limit in LIMITS)
        ranges = {name: self.decides.range_of(name, values.values(), LIMITS) for name in used}
        return {
            name: (low, high if math.isfinite(high) else None)
            for name, (low, high) in ranges.items()
        }


def _defined(numbers: dict[str, float]) -> Values:
    return {name: value if math.isfinite(value) else None for name, value in numbers.items()}


def _assuming(entry: dict[str, Any], word: str) -> dict[str, Any]:
    """The entry with a word for {assumed} in the names of its runs."""
    numbers = entry.get("numbers", {}).items()
    return {**entry, "numbers": {name: text.replace("{assumed}", word) for name, text in numbers}}


CLAIMS = {
    name: Claim.of(name, entry)
    for name, entry in read_toml(__package__, "claims.toml").items()
    if name != "limits"
}
