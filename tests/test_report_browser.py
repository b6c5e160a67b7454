"""Reports in a real browser: what a click on a column's head does."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator
from typing import Any

import pytest
from sweeps_drawn import FRICTION, RATE, drawn_sweep

from ttwmr_mj.studies.sweep.answers.report import write_report

pytestmark = pytest.mark.slow

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    if CHROMIUM is None:
        pytest.skip("no Chromium here; install it: apt-get install chromium")
    playwright = pytest.importorskip("playwright.sync_api")
    folder = tmp_path_factory.mktemp("report")
    axes = {FRICTION: {"values": [0.0, 5e-4, 1e-3]}, RATE: {"values": [0.2, 0.6, 1.0]}}
    drawn_sweep(folder, axes, variants=("flatness", "tvlqr"), seeds=4, lost_above=0.8)
    write_report(folder)
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page()
        errors: list[str] = []
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto((folder / "report.html").as_uri(), timeout=120_000)
        yield page
        browser.close()
        assert errors == []


# clicks on every head of every table, twice; what each column sorts by, before and after
CLICKS = """
() => [...document.querySelectorAll("table.sortable")].map((table) => {
  const column = (k) => [...table.tBodies[0].rows].map(
    (row) => row.cells[k].dataset.value ?? row.cells[k].textContent.trim());
  return [...table.tHead.rows[0].cells].map((head, k) => [0, 1].map(() => {
    const before = column(k);
    head.querySelector("button").click();
    const marked = table.querySelectorAll("th[aria-sort]").length;
    return { before, after: column(k), marked, direction: head.getAttribute("aria-sort") };
  }));
})
"""


def test_a_click_on_a_head_sorts_numbers_as_numbers_and_the_next_turns_them_round(
    page: Any,
) -> None:
    clicks = [pair for table in page.evaluate(CLICKS) for pair in table]
    sorted_by_number = with_infinity = 0
    for first, second in clicks:
        assert (first["direction"], second["direction"]) == ("ascending", "descending")
        for click in (first, second):
            assert click["marked"] == 1
            assert sorted(click["after"]) == sorted(click["before"])
            numbers = [float(text) for text in click["after"] if is_number(text)]
            assert numbers == sorted(numbers, reverse=click is second)
            assert all(map(is_number, click["after"][: len(numbers)]))  # what has none comes last
        sorted_by_number += len(set(numbers)) > 1
        with_infinity += math.inf in numbers and min(numbers) < math.inf
    assert sorted_by_number > 10
    assert with_infinity > 0


def is_number(text: str) -> bool:
    """Whether it is one, infinity included, and no "not a number"."""
    try:
        return not math.isnan(float(text))
    except ValueError:
        return False
