"""Tables in the documentation are those that the code gives."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parent.parent / "docs"
TABLES = runpy.run_path(str(DOCS / "tables.py"))


@pytest.mark.parametrize("page", sorted(DOCS.glob("*.md")), ids=lambda page: page.name)
def test_a_page_is_up_to_date(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert TABLES["filled"](text) == text, "run python docs/tables.py"


def test_both_tables_have_a_place() -> None:
    page = (DOCS / "controllers.md").read_text(encoding="utf-8")
    assert set(TABLES["TABLES"]) == {name for _, name, _ in TABLES["PLACE"].findall(page)}
    assert "| `tvlqr` | " in page
    assert "| `flat_circle` | " in page
