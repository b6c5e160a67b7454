"""Proofs by sympy of what is wrong, and of what is right, in the article's algebra.

Every proof is a function that returns the formulas it shows and whether the difference of the two
sides simplifies to zero. sympy is an extra of this package; without it the study says so.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ttwmr_mj.errors import MachineError

if TYPE_CHECKING:
    from ttwmr_mj.studies.reproduce.proofs.proof import Proof


def all_proofs() -> dict[str, Callable[[], Proof]]:
    """Every proof by its name.

    Raises:
        MachineError: sympy is not installed.
    """
    try:
        from ttwmr_mj.studies.reproduce.proofs import law, model, steering
    except ImportError as error:
        raise MachineError(
            "sympy is not installed, so the errata are not proved here; install it with "
            "pip install 'ttwmr-mj[reproduce]'"
        ) from error
    return {
        "eq-11": model.eq_11,
        "eq-21": model.eq_21,
        "eq-23": model.eq_23,
        "eq-24": model.eq_24,
        "eq-26": model.eq_26,
        "eq-32": law.eq_32,
        "eq-36": law.eq_36,
        "eq-41": model.eq_41,
        "eq-48": law.eq_48,
        "eq-53": law.eq_53,
        "eq-58": law.eq_58,
        "eq-65": law.eq_65,
        "eq-68": law.eq_68,
        "no-gamma": steering.no_gamma,
        "circle": model.circle_equilibrium,
    }


def study() -> dict[str, Any]:
    """All proofs: name → proved, and formulas as MathML."""
    results: dict[str, Any] = {}
    for name, prove in all_proofs().items():
        proof = prove()
        results[name] = {
            "proved": proof.proved,
            "formulas": [[words, _mathml(formula)] for words, formula in proof.formulas],
        }
    return results


def _mathml(formula: Any) -> str:
    """MathML with dots over what moves: sympy's printer knows no dotted names."""
    from sympy.printing.mathml import mathml

    text = str(mathml(formula, printer="presentation"))
    for name, letter, dot in (
        ("thetaddot", "θ", "¨"),
        ("thetadot", "θ", "˙"),
        ("xddot", "x", "¨"),
        ("yddot", "y", "¨"),
        ("sdot", "s", "˙"),
    ):
        dotted = f"<mover><mi>{letter}</mi><mo>{dot}</mo></mover>"
        text = text.replace(f"<mi>{name}</mi>", dotted)
    for name, letters in (("theta_1", "θ₁"), ("u_1", "u₁"), ("u_2", "u₂")):  # names of functions
        text = text.replace(f"<mi>{name}</mi>", f"<mi>{letters}</mi>")
    return text
