"""What a proof by sympy is; only `proofs.all_proofs` imports this, as sympy is optional."""

from dataclasses import dataclass
from typing import Any

import sympy as sp


@dataclass(frozen=True, slots=True)
class Proof:
    """What a proof found."""

    proved: bool  # every difference simplified to zero, every sign is as stated
    formulas: list[tuple[str, sp.Expr]]  # (words, expression) pairs to show


def vanish(*expressions: Any) -> bool:
    """Whether every expression simplifies to zero."""
    return all(sp.simplify(expression) == 0 for expression in expressions)
