"""The map from equations to code is true: every equation is in it, and every name exists."""

from __future__ import annotations

import importlib
import re
from functools import reduce
from pathlib import Path

import pytest

from ttwmr_mj.studies.reproduce.errata import errata_markdown

DOCS = Path(__file__).resolve().parent.parent / "docs"
MAP = DOCS / "reference" / "equations.md"
ROWS = [
    (numbers.strip(), re.findall(r"`([^`]+)`", where))
    for numbers, where in re.findall(
        r"^\| ([\d-]+) \|.*\| (.*) \|$",
        (DOCS / "reference" / "equations.md").read_text("utf-8"),
        re.MULTILINE,
    )
]
NAMES = sorted({name for _, names in ROWS for name in names})


def test_every_equation_of_the_article_is_there_once_and_in_order() -> None:
    listed = []
    for numbers, _ in ROWS:
        first, _, last = numbers.partition("-")
        listed += range(int(first), int(last or first) + 1)
    assert listed == list(range(1, 74))


def test_every_row_names_code() -> None:
    assert all(names for _, names in ROWS)


@pytest.mark.parametrize("name", NAMES)
def test_the_name_exists(name: str) -> None:
    module, _, attribute = name.partition(":")
    found = reduce(getattr, attribute.split("."), importlib.import_module(f"ttwmr_mj.{module}"))
    assert found.__doc__, f"{name} is undocumented"


def test_the_code_says_which_equation_it_is() -> None:
    """One name per row, at least, mentions an equation of that row in its module."""
    for numbers, names in ROWS:
        first, _, last = numbers.partition("-")
        wanted = range(int(first), int(last or first) + 1)
        texts = [
            Path(importlib.import_module(f"ttwmr_mj.{n.split(':')[0]}").__file__).read_text("utf-8")
            for n in names
        ]
        assert any(_mentions(text, number) for text in texts for number in wanted), numbers


def _mentions(text: str, number: int) -> bool:
    """Whether "Eq. 12", "Eq. 11-13", "Eq. 3, 12" or "law (12)" is in the text."""
    spans = re.findall(r"(?:Eq\.|law|laws|and) \(?((?:\d+(?:-\d+)?(?:, )?)+)", text)
    for part in re.findall(r"\d+(?:-\d+)?", " ".join(spans)):
        first, _, last = part.partition("-")
        if int(first) <= number <= int(last or first):
            return True
    return False


def test_the_errata_page_is_the_one_the_code_writes() -> None:
    assert (DOCS / "theory" / "errata.md").read_text("utf-8") == errata_markdown()
