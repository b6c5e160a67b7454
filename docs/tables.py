"""Tables of the documentation that come from the code; run it to bring them up to date.

    python docs/tables.py

A page says where a table goes: between <!-- table: NAME --> and <!-- end -->.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from ttwmr_mj.controllers.base import CONTROLLERS
from ttwmr_mj.references.shared.reference import REFERENCES
from ttwmr_mj.robot import Config

PAGES = sorted(Path(__file__).parent.glob("*.md"))
PLACE = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def kinds(registry: Mapping[str, type[Config]]) -> str:
    """What a section's `kind` may be, and the options that go with it."""
    rows = ["| kind | what it is | options |", "|---|---|---|"]
    for kind, options in registry.items():
        names = ", ".join(f"`{name}`" for name in options.model_fields if name != "kind")
        rows.append(f"| `{kind}` | {options.summary().replace('|', chr(92) + '|')} | {names} |")
    return "\n".join(rows) + "\n"


TABLES = {"controllers": lambda: kinds(CONTROLLERS), "references": lambda: kinds(REFERENCES)}


def filled(page: str) -> str:
    """A page with its tables as the code has them now."""
    return PLACE.sub(lambda place: place[1] + TABLES[place[2]]() + place[3], page)


def main() -> None:
    """Bring every page up to date."""
    for page in PAGES:
        page.write_text(filled(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
