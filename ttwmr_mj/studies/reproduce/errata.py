"""What is wrong in the article, and what that changes; each with the proof that says so."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Erratum:
    """One error.

    Attributes:
        where: equation or theorem.
        printed: what stands there.
        correct: what follows from the article's own premises.
        consequence: what depends on it, and what this package does.
        proof: name of one of `proofs.all_proofs`.
    """

    where: str
    printed: str
    correct: str
    consequence: str
    proof: str


ERRATA = (
    Erratum(
        "Eq. 23",
        "accelerations (ẍ, θ̈1, θ̈2); biases m1·a1·θ̇1 and −m2·l·cos(θ2−θ1)·θ̇1",
        "accelerations (s̈, θ̈1, θ̈2); biases m1·a1·ṡ·θ̇1 and −m2·l·cos(θ2−θ1)·ṡ·θ̇1",
        "The printed biases have not the unit of a torque, and at ṡ = 0 they would turn a robot "
        "that stands. The control laws use Eq. 17 and are not touched. "
        "`dynamics.kinetics.reduced_bias` is the derived form, `published_bias` the printed one.",
        "eq-23",
    ),
    Erratum(
        "Eq. 26, 28-29",
        "the second derivatives of y and θ2 appear as first ones in places",
        "ż4 = ÿ = v2 and ż6 = θ̈2, as Eq. 27-28 have it",
        "Misprints without consequence.",
        "eq-26",
    ),
    Erratum(
        "Eq. 32, Theorem 1",
        "the error goes to zero asymptotically, since V' of Eq. 36 is negative definite",
        "Eq. 36 holds where e2 ≠ 0 and e4 ≠ 0, but every path except one ray reaches e2 = 0 with "
        "e1 ≠ 0 in finite time; there the law is undefined and holds the error fast",
        "Table II's start, at rest beside a circle that begins along y, has e2 = 0 at once. Two "
        "repairs are stable: omit e²/ė, or regularise it to e²·ė/(ė² + ε²). "
        "`controller.singular_terms` names them; “omitted” is the default.",
        "eq-32",
    ),
    Erratum(
        "Eq. 36",
        "V' = −α1·e1² − (α2·e2)² − … for the printed law",
        "the same where e2, e4 ≠ 0; without e²/ė it is −(α2·e2)² − (α4·e4)², and LaSalle's "
        "principle gives e → 0",
        "The algebra is right; that the motion stays where it applies is not.",
        "eq-36",
    ),
    Erratum(
        "Eq. 41-43",
        "spring and damper torque divided by k",
        "divided by J2 + m2·l² = m2·l·k",
        "Printed gains act m2·l = 0.0465 kg·m times as strong as torques: “200” amounts to 9.31 "
        "N·m/rad. (The unit in Table II, N/m, is that of no torsion spring.) "
        "`plant.analytic.published_spring` selects the printed form.",
        "eq-41",
    ),
    Erratum(
        "Eq. 48, Theorem 3",
        "the errors go to zero asymptotically, since the corrective terms cancel in V'",
        "with γ = N/D the correction drives D² at a rate of 2·α2·α4·N·(e4·cos θ2 − e2·sin θ2), "
        "which does not vanish at D = 0: solutions run into D = 0 within milliseconds and end",
        "No step size helps, see the study of continuous time. `controller.gamma` offers "
        "“regularized”, `controller.gamma_limit` a limit; neither makes the trailer follow.",
        "eq-48",
    ),
    Erratum(
        "Eq. 53-55",
        "the corrective terms act as a virtual spring and damper",
        "for α2 = α4 they turn (e2, e4) and leave its length; where e2 = e4 = 0 they are zero",
        "A tractor that tracks leaves no way to act on the trailer. That they cancel in V' is "
        "true.",
        "eq-53",
    ),
    Erratum(
        "Eq. 58",
        "+(α4·e4·sin θ2 + α2·e2·cos θ2)·γ",
        "−(α4·e4·sin θ2 + α2·e2·cos θ2)·γ",
        "Eq. 59-62 use the right sign, so Eq. 60 and 61 are right.",
        "eq-58",
    ),
    Erratum(
        "Eq. 68-69",
        "α4·e4·sin e5 + α2·e2·cos e5, nearly constant",
        "θ2 in place of e5, as in Eq. 48; made of errors, it goes to zero with them",
        "With a constant ρ the angle does not matter any more; that D is constant is refuted by "
        "the claim rho-is-constant.",
        "eq-68",
    ),
    Erratum(
        "Figs. 4, 8, 12",
        "the trailer has a reference that it oscillates about, or tracks",
        "on a circle a free trailer is in equilibrium radially outward, θ2 − θ1 = π/2; straight "
        "behind the tractor is no equilibrium",
        "The article does not say what θ2d is. `reference.theta2` offers “aligned” and “outward”.",
        "circle",
    ),
)


def errata_markdown() -> str:
    """docs/errata.md."""
    parts = [
        "# Errata of the article\n",
        "Each entry is proved by sympy in `ttwmr_mj.studies.reproduce.proofs.proofs`; "
        "`ttwmr reproduce` shows the proofs and the runs that go with them. This page is written "
        "by `ttwmr_mj.studies.reproduce.errata.errata_markdown`; a test keeps it so.\n",
    ]
    parts += [
        f"## {erratum.where}\n\n"
        f"- Printed: {erratum.printed}.\n"
        f"- Correct: {erratum.correct}.\n"
        f"- {erratum.consequence}\n"
        f'- Proof: `proofs.all_proofs()["{erratum.proof}"]`\n'
        for erratum in ERRATA
    ]
    return "\n".join(parts)
