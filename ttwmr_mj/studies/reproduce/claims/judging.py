"""What a claim is, what a verdict is, and the limits the rules share."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from typing import Literal

from ttwmr_mj.studies.reproduce.evidence import Evidence

Verdict = Literal["holds", "holds with changes", "fails", "evidence missing"]
Numbers = dict[str, float | None]

TRACTOR_ERROR, TRAILER_ERROR = "steady_tractor_rmse_m", "steady_trailer_rmse_m"  # metrics

# The limits of all rules, fixed before any run. Errors are rms values over a run's second half.
TRACTOR_FOLLOWS_M = 0.010  # P: a fifteenth of the robot's length
TRAILER_FOLLOWS_M = 0.020  # the trailer's COM, which also takes the tractor's error
SWINGS_RAD = 0.2  # peak to peak of the hitch angle
STILL_RAD = 0.02
GONE = 0.01  # of V at the start
EFFORT_RATIO = 1.2  # of what the reference itself needs
NEVER_RISES = 0.01  # of V at the start
NEAR_CONSTANT = 0.5  # |ρ·D − 1|
MOSTLY = 0.9  # of the samples
E5_SMALL_RAD = 0.05
AGREES_M = 0.010
DECADE_SHRINKS = 0.5  # each decade's time over that of the one before, in finite time


@dataclass(frozen=True, slots=True)
class Judgement:
    """What a rule says of the evidence.

    Attributes:
        verdict: one of four.
        numbers: what it was judged by, units in the names; None where undefined.
        finding: in words; empty: as claims.toml has it.
    """

    verdict: Verdict
    numbers: Numbers
    finding: str = ""


Judge = Callable[[Evidence], Judgement]


@dataclass(frozen=True, slots=True)
class Claim:
    """A statement of the article and the rule that tests it.

    Attributes:
        name: short, for claims.json.
        judge: the rule as code.
        runs: the runs it needs.
        studies: the studies it needs.
        source: where the article says it.
        statement: what it says.
        rule: how it is judged, written down before the run.
        finding: what a judgement that has no words of its own says, with its numbers in braces.
    """

    name: str
    judge: Judge
    runs: tuple[str, ...]
    studies: tuple[str, ...]
    source: str
    statement: str
    rule: str
    finding: str = ""

    def judgement(self, evidence: Evidence) -> Judgement:
        """The rule's answer, or that evidence is missing where its runs could not be done."""
        lacking = evidence.lacking(self)
        if lacking:
            reasons = "; ".join(f"{name}: {evidence.failures[name]}" for name in lacking)
            return Judgement("evidence missing", {}, f"What the rule needs was not run. {reasons}")
        judged = self.judge(evidence)
        shown = {key: _Shown(value) for key, value in judged.numbers.items() if value is not None}
        return replace(
            judged,
            numbers={key: finite(value) for key, value in judged.numbers.items()},
            finding=judged.finding or self.finding.format(**shown),
        )


class _Shown(float):
    """A number in a finding: `mm` a length, `x100` and `x1000` times that, no digits after it."""

    def __format__(self, how: str) -> str:
        if how == "mm":
            return mm(self)
        return f"{float(how[1:]) * self:.0f}" if how.startswith("x") else super().__format__(how)


@cache
def _words() -> dict[str, dict[str, str]]:
    """Claim → source, statement, rule with this module's limits put in, and finding."""
    text = (resources.files(__package__) / "claims.toml").read_text(encoding="utf-8")
    limits = {name: value for name, value in globals().items() if name.isupper()}
    limits |= {f"{name}M": mm(value) for name, value in limits.items() if name.endswith("_M")}
    claims: dict[str, dict[str, str]] = tomllib.loads(text)
    for words in claims.values():
        words.update({key: " ".join(value.split()) for key, value in words.items()})
        words["rule"] = words["rule"].format(**limits)
    return claims


def claim(
    name: str, runs: tuple[str, ...] = (), studies: tuple[str, ...] = ()
) -> Callable[[Judge], Claim]:
    """A claim of claims.toml, of the function below it that judges by its rule."""
    return lambda judge: Claim(name, judge, runs, studies, **_words()[name])


def robot_follows(evidence: Evidence, run: str) -> bool:
    """Whether tractor and trailer both follow in a run."""
    return (
        evidence.value(run, TRACTOR_ERROR) <= TRACTOR_FOLLOWS_M
        and evidence.value(run, TRAILER_ERROR) <= TRAILER_FOLLOWS_M
    )


def tractor_follows(
    evidence: Evidence, printed: tuple[str, ...], changed: tuple[str, ...]
) -> Judgement:
    """Whether P follows in all runs as printed, or in all without the singular terms."""
    errors = [evidence.worst(runs, TRACTOR_ERROR) for runs in (printed, changed)]
    return Judgement(
        verdict_of(*(error <= TRACTOR_FOLLOWS_M for error in errors)),
        {f"published_{TRACTOR_ERROR}": errors[0], f"omitted_{TRACTOR_ERROR}": errors[1]},
    )


def verdict_of(as_printed: bool, with_changes: bool) -> Verdict:
    """The order of the three verdicts."""
    if as_printed:
        return "holds"
    return "holds with changes" if with_changes else "fails"


def finite(number: float | None) -> float | None:
    """For JSON: None instead of infinity and NaN."""
    return number if number is not None and math.isfinite(number) else None


def mm(number: float) -> str:
    """A length for reading, three digits, in mm below a metre."""
    if not math.isfinite(number):
        return "undefined"
    return f"{number * 1e3:.3g} mm" if abs(number) < 1.0 else f"{number:.3g} m"
