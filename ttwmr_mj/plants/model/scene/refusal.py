"""What a scene has otherwise than the scenario: in words, as a fault."""

from typing import Any

import numpy as np

from ttwmr_mj.errors import Fault

ROUNDING = 1e-9  # share of the largest number
TINY = 1e-15


def refusal(got: str, *, allowed: str = "", hint: str = "") -> Fault:
    """A fault of the scene."""
    key = ("plant", "contact", "model_path")
    return Fault(key=key, got=f"a scene with {got}", allowed=allowed, hint=hint)


def otherwise(what: str, got: Any, expected: Any, set_by: str = "") -> Fault:
    """A number that a scene may not change.

    Args:
        what: whose number it is, in words.
        got: as the scene has it.
        expected: as it is in the shipped one.
        set_by: the scenario's key that does set it; empty: none.
    """
    hint = f"{set_by} sets it" if set_by else "no key sets it: leave it as models/ttwmr.xml has it"
    return refusal(f"{what} {told(got)}", allowed=told(expected), hint=hint)


def alike(got: Any, expected: Any) -> bool:
    """Whether two values are the same: text, or numbers but for rounding."""
    if np.array_equal(got, expected):  # as it nearly always is
        return True
    if isinstance(expected, str) or np.shape(got) != np.shape(expected):
        return False
    largest = np.abs(np.where(np.isfinite(expected), expected, 0.0)).max()
    return np.allclose(got, expected, rtol=0.0, atol=ROUNDING * largest + TINY)


def told(value: Any) -> str:
    """Text as it is, numbers in six digits without the zeros behind them."""
    if isinstance(value, str):
        return value
    numbers = [f"{number:.6g}" for number in np.ravel(value)]
    while len(numbers) > 1 and numbers[-1] == "0":
        numbers.pop()
    return " ".join(numbers)
