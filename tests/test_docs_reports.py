"""docs/howto/reports.md: its code runs, and what it says of the pages is so."""

from __future__ import annotations

import re
from pathlib import Path

DOCS = Path(__file__).resolve().parent.parent / "docs" / "howto"
TEXT = (DOCS / "reports.md").read_text(encoding="utf-8")


def test_the_example_runs_and_says_what_it_shows(capsys) -> None:
    (code,) = re.findall(r"^```python\n(.*?)^```", TEXT, flags=re.M | re.S)
    exec(compile(code, "reports.md", "exec"), {})
    first, medians = capsys.readouterr().out.splitlines()
    assert first.startswith("Interval(value=0.075, low=0.0157")
    assert "high=0.2038" in first
    theirs, ours = (
        [float(number) for number in re.findall(r"=([\d.e-]+)", text)]
        for text in medians.split(") ")
    )
    assert ours[2] > theirs[1]  # they overlap


def test_its_links_lead_to_pages() -> None:
    for link in re.findall(r"\]\(([a-z_./]+\.md)\)", TEXT):
        assert (DOCS / link).is_file(), link
