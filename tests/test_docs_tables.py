"""Tables in the documentation are those that the code gives."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

import ttwmr_mj as tt
from ttwmr_mj.assets import shipped_scenarios
from ttwmr_mj.results.verdict import VERDICTS
from ttwmr_mj.scenario.file import load_scenario

DOCS = Path(__file__).resolve().parent.parent / "docs"
TABLES = runpy.run_path(str(DOCS / "tables.py"))


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=lambda page: page.name)
def test_a_page_is_up_to_date(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert TABLES["filled"](text) == text, "run python docs/tables.py"


def test_every_table_has_a_place() -> None:
    pages = {path.name: path.read_text(encoding="utf-8") for path in DOCS.rglob("*.md")}
    places = [name for page in pages.values() for _, name, _ in TABLES["PLACE"].findall(page)]
    assert sorted(places) == sorted(TABLES["TABLES"])
    page = pages["controllers.md"]
    assert "| `tvlqr` | " in page
    assert "| `flat_circle` | " in page
    assert (
        "| `end_theta2_rad` | `0.2` | largest error of θ2 in the last fifth" in pages["verdict.md"]
    )
    assert "| lost | `lost` | P exceeded a limit |" in pages["verdict.md"]


def test_the_page_on_verdicts_tells_of_every_shipped_scenario() -> None:
    page = (DOCS / "reference" / "verdict.md").read_text(encoding="utf-8")
    for name in shipped_scenarios():
        said = load_scenario(name).accept.verdict
        row = next(
            line for line in page.splitlines() if line.startswith("|") and f"`{name}`" in line
        )
        assert row.split(" | ")[1] == VERDICTS[said][0]


def test_the_page_on_metrics_tells_of_every_number_of_a_run(tmp_path: Path) -> None:
    lean = ["duration_s=0.5", "plant.kind=analytic", "output.recording=false"]
    run = tt.run(tt.load_scenario("lab_circle", [*lean, "output.figures=false"]), tmp_path / "run")
    page = (DOCS / "reference" / "metrics.md").read_text(encoding="utf-8")
    assert {name for name in run.metrics if f"`{name}`" not in page} == set()
    assert "| `control_effort` | rad²/s | ∫ (ω_r² + ω_l²) commanded dt | 8-9 | " in page
