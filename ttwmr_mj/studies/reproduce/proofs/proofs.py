"""Proofs by sympy of what is wrong, and of what is right, in the article's algebra.

Every proof is a function that returns the formulas it shows and whether the difference of the two
sides simplifies to zero. sympy is optional; without it the study says so.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ttwmr_mj.errors import MachineError
from ttwmr_mj.studies.reproduce.proofs import law as proofs_law
from ttwmr_mj.studies.reproduce.proofs import model as proofs_model
from ttwmr_mj.studies.reproduce.proofs.proof import Proof

PROOFS: dict[str, Callable[[], Proof]] = {
    "eq-23": proofs_model.eq_23,
    "eq-26": proofs_model.eq_26,
    "eq-32": proofs_law.eq_32,
    "eq-36": proofs_law.eq_36,
    "eq-41": proofs_model.eq_41,
    "eq-48": proofs_law.eq_48,
    "eq-53": proofs_law.eq_53,
    "eq-58": proofs_law.eq_58,
    "eq-65": proofs_law.eq_65,
    "eq-68": proofs_law.eq_68,
    "circle": proofs_model.circle_equilibrium,
}


def study() -> dict[str, Any]:
    """All proofs: name → proved, and formulas as MathML."""
    try:
        from sympy.printing.mathml import mathml
    except ImportError as error:
        raise MachineError(
            "sympy is not installed, so the errata are not proved here: pip install sympy"
        ) from error
    results: dict[str, Any] = {}
    for name, prove in PROOFS.items():
        proof = prove()
        results[name] = {
            "proved": proof.proved,
            "formulas": [
                [words, _dotted(mathml(formula, printer="presentation"))]
                for words, formula in proof.formulas
            ],
        }
    return results


def _dotted(mathml: str) -> str:
    """MathML with dots over what moves: sympy's printer knows no dotted names."""
    for name, letter, dot in (
        ("thetaddot", "θ", "¨"),
        ("thetadot", "θ", "˙"),
        ("xddot", "x", "¨"),
        ("yddot", "y", "¨"),
        ("sdot", "s", "˙"),
    ):
        dotted = f"<mover><mi>{letter}</mi><mo>{dot}</mo></mover>"
        mathml = mathml.replace(f"<mi>{name}</mi>", dotted)
    for name, letters in (("theta_1", "θ₁"), ("u_1", "u₁")):  # names of functions
        mathml = mathml.replace(f"<mi>{name}</mi>", f"<mi>{letters}</mi>")
    return mathml
