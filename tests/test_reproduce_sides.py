"""No verdict is a constant: every rule comes out each way, comparison by comparison."""

from __future__ import annotations

import math
from string import Formatter

import pytest

from ttwmr_mj.studies.reproduce.claims.claims import CLAIMS, Claim
from ttwmr_mj.studies.reproduce.claims.limits import LIMITS, REASONS
from ttwmr_mj.studies.reproduce.claims.rule import Comparison, Rule

BEYOND = 1e-9  # of a limit


def threshold(part: Comparison) -> float:
    return LIMITS[part.limit] if part.limit in LIMITS else float(part.limit)


def at(part: Comparison, *, met: bool) -> float:
    """A number just on one side of a comparison's limit."""
    limit = threshold(part)
    size = BEYOND * (abs(limit) or 1.0)
    if part.sign == "<=":
        return limit if met else limit + size
    if part.sign == ">=":
        return limit if met else limit - size
    return limit - size if met else limit


def numbers(claim: Claim, **changed: float) -> dict[str, float]:
    """Numbers that meet nothing, but for those given; what is only told is zero."""
    parts = claim.decides.comparisons
    unmet = {part.number: at(part, met=False) for part in reversed(parts)}
    told = {name: 0.0 for _, name, _, _ in Formatter().parse(claim.finding) if name}
    return told | unmet | changed


def verdict(claim: Claim, **changed: float) -> str:
    return claim.judged(dict.fromkeys(claim.cases, numbers(claim, **changed))).verdict


def meeting(row: tuple[Comparison, ...]) -> dict[str, float]:
    return {part.number: at(part, met=True) for part in row}


@pytest.mark.parametrize("name", CLAIMS)
def test_a_claim_can_hold_and_fail(name: str) -> None:
    claim = CLAIMS[name]
    holds, changed = claim.decides.holds, claim.decides.holds_with_changes
    assert holds, "a claim that cannot hold is not tested"
    assert verdict(claim) == "fails"
    assert verdict(claim, **meeting(holds)) == "holds"
    for part in holds:
        missed = {**meeting(holds), part.number: at(part, met=False)}
        assert verdict(claim, **missed) != "holds", part
    if changed:
        assert verdict(claim, **meeting(changed)) == "holds with changes"
    for part in changed:
        missed = {**meeting(changed), part.number: at(part, met=False)}
        assert verdict(claim, **missed) == "fails", part


@pytest.mark.parametrize("name", [name for name, claim in CLAIMS.items() if len(claim.cases) > 1])
def test_a_verdict_that_hinges_on_an_assumption_is_undecided(name: str) -> None:
    claim = CLAIMS[name]
    first, *others = claim.cases
    bad, good = numbers(claim), numbers(claim, **meeting(claim.decides.holds))
    found = claim.judged({first: bad, **dict.fromkeys(others, good)})
    assert found.verdict == "undecided"
    assert [case.verdict for case in found.cases] == ["fails", *["holds"] * len(others)]
    assert [case.assumed for case in found.cases] == list(claim.cases)
    assert claim.judged(dict.fromkeys(claim.cases, good)).verdict == "holds"


def test_an_undefined_number_meets_nothing() -> None:
    for sign in ("<=", ">=", "<"):
        assert not Comparison("x", sign, "1").met({"x": math.nan}, {})
    assert not Comparison("x", "<=", "1").met({"x": math.inf}, {})


def test_a_limit_may_move_until_a_verdict_turns() -> None:
    """By hand: x = 3 and y = 5 below a limit of 4, or z = 20 below it."""
    rule = Rule.parse("x <= L and y <= L", "z <= L")
    case = {"x": 3.0, "y": 5.0, "z": 20.0}
    assert rule.verdict(case, {"L": 4.0}) == "fails"
    assert rule.range_of("L", [case], {"L": 4.0}) == (0.0, 5.0)  # x alone turns nothing
    assert rule.range_of("L", [case], {"L": 6.0}) == (5.0, math.inf)
    assert rule.range_of("L", [{**case, "z": 4.5}], {"L": 4.7}) == (4.5, 5.0)
    # a second case narrows it, an undefined number does not
    other = {"x": 3.0, "y": 4.5, "z": math.inf}
    assert rule.range_of("L", [case, other], {"L": 4.0}) == (0.0, 4.5)
    at_least = Rule.parse("x >= L", "")
    assert at_least.range_of("L", [{"x": 3.0}], {"L": 1.0}) == (0.0, 3.0)
    assert at_least.range_of("L", [{"x": 3.0}], {"L": 5.0}) == (3.0, math.inf)


def test_how_far_a_limit_may_move_is_told() -> None:
    claim = CLAIMS["fig-3"]
    printed, omitted = (part.number for part in claim.decides.comparisons)
    found = claim.judged({"": {printed: 0.38, omitted: 0.0003}})
    assert found.stays == {"TRACTOR_FOLLOWS_M": (0.0003, 0.38)}
    assert found.sensitivity == ["TRACTOR_FOLLOWS_M = 10 mm: 0.3 mm to 380 mm"]
    found = claim.judged({"": {printed: 0.38, omitted: math.inf}})
    assert found.sensitivity == ["TRACTOR_FOLLOWS_M = 10 mm: anything up to 380 mm"]


def test_the_trailer_has_twice_the_tractors_limit_and_every_limit_its_reason() -> None:
    assert LIMITS["TRAILER_FOLLOWS_M"] == 2.0 * LIMITS["TRACTOR_FOLLOWS_M"]
    assert all(REASONS[name] for name in LIMITS)
