"""What is wrong in the article, and what that changes (errata.toml); each with its proof."""

from dataclasses import dataclass

from ttwmr_mj.studies.reproduce.words import read_toml


@dataclass(frozen=True, slots=True)
class Erratum:
    """One error."""

    where: str  # equation or theorem
    printed: str  # what stands there
    correct: str  # what follows from the article's own premises
    consequence: str  # what depends on it, and what this package does
    proof: str  # name of one of `proofs.all_proofs`


ERRATA = tuple(Erratum(**entry) for entry in read_toml(__package__, "errata.toml")["erratum"])


def errata_markdown() -> str:
    """docs/theory/errata.md."""
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
