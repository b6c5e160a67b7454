"""Reports in a real browser: what a click on a column's head does."""

from __future__ import annotations

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


def column(table: Any, index: int) -> list[str]:
    """What a column sorts by, from top to bottom."""
    cells = table.locator(f"tbody tr > :nth-child({index + 1})")
    return [str(text) for text in cells.evaluate_all(
        "cells => cells.map(cell => cell.dataset.value ?? cell.textContent.trim())"
    )]  # fmt: skip


def test_a_click_on_a_head_sorts_numbers_as_numbers_and_the_next_turns_them_round(
    page: Any,
) -> None:
    tables = page.locator("table.sortable")
    assert tables.count() > 0
    sorted_by_number = 0
    for i in range(tables.count()):
        table = tables.nth(i)
        for k in range(table.locator("thead th").count()):
            before, head = column(table, k), table.locator("thead th").nth(k)
            for direction in ("ascending", "descending"):
                head.locator("button").evaluate("button => button.click()")
                assert head.get_attribute("aria-sort") == direction
                assert table.locator("thead th[aria-sort]").count() == 1
                after = column(table, k)
                assert sorted(after) == sorted(before)
                numbers = [float(text) for text in after if is_number(text)]
                assert numbers == sorted(numbers, reverse=direction == "descending")
                assert all(map(is_number, after[: len(numbers)]))  # what has none comes last
            sorted_by_number += len(numbers) > 1
    assert sorted_by_number > 2


def is_number(text: str) -> bool:
    try:
        return float(text) == float(text)
    except ValueError:
        return False
