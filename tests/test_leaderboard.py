"""The leaderboard's words and order, on lines that are made up."""

from __future__ import annotations

from collections import Counter

import pytest

from ttwmr_mj.studies.bench.leaderboard import HEAD, overview, to_html, to_markdown
from ttwmr_mj.studies.bench.scoring import COLUMNS, RANKED_BY, Board, Line, _combined, _rank


def line(
    controller: str, error: float | None, failures: int = 0, lost: int = 0, task: str = "circle"
) -> Line:
    """Two runs, of which some broke off and some were lost."""
    verdicts = {"followed": 2 - failures, "failed": failures - lost, "lost": lost}
    names = {"controller": controller, "task": task, "plant": "contact", "sensing": "truth"}
    return Line(
        names=names | {"disturbance": "none"},
        values=dict.fromkeys(COLUMNS) | {RANKED_BY: error},
        runs=2,
        failures=failures,
        lost=lost,
        verdicts=Counter({name: count for name, count in verdicts.items() if count}),
        reason="why" if failures else "",
        command=f"ttwmr run {controller}",
        manifest=f"runs/{controller}/manifest.json",
    )


ORDER = {
    "controller": ["a", "b", "c", "d", "e"],
    "task": ["circle", "eight"],
    "plant": ["contact"],
    "sensing": ["truth"],
    "disturbance": ["none"],
}


def ranked(*lines: Line) -> list[Line]:
    return sorted(lines, key=lambda line: _rank(line, ORDER))


def test_fewer_failures_come_first_then_smaller_errors_then_the_suites_order() -> None:
    lines = ranked(
        line("a", None), line("b", 3.0), line("c", 1.0, 1), line("d", 2.0), line("e", 3.0)
    )
    assert [line.names["controller"] for line in lines] == ["d", "b", "e", "a", "c"]
    lines = ranked(line("a", 1.0, task="eight"), line("b", 2.0))
    assert [line.names["task"] for line in lines] == ["circle", "eight"]


def test_the_overview_says_who_stands_where_in_a_word() -> None:
    lines = ranked(
        line("a", 1234.0, 2, lost=2),
        line("b", None, 2),
        line("c", 0.0004),
        line("d", 2.0, 1),
        line("e", 2.5),
        line("c", 7.25, task="eight"),
    )
    tables = overview(lines)
    # of what failed as often, the mean place in the sections decides
    assert tables["circle"][0] == ["condition", "c", "e", "d", "a", "b"]
    assert tables["circle"][1] == [
        "contact · truth",
        "**<0.001**",
        "2.5",
        "2 (1 of 2 failed)",
        "lost",
        "failed",
    ]
    assert tables["eight"][1] == ["contact · truth", "**7.25**", "", "", "", ""]


def test_controllers_stand_by_shares_and_means_however_many_tasks_they_met() -> None:
    tasks = ("circle", "eight", "parked")
    lines = [
        line("b", 9.0, 1, task="circle"),
        *(line("a", 1.0, i // 2, task=tasks[i]) for i in range(3)),
    ]
    assert overview(lines)["circle"][0] == ["condition", "a", "b"]  # 1 of 6 failed, 1 of 2
    lines = [line(name, 1.0, task=task) for task in tasks for name in ("d", "a")]
    lines = [*lines[:2], line("b", 1.0), line("c", 1.0), *lines[2:]]
    assert overview(lines)["circle"][0] == ["condition", "d", "a", "b", "c"]  # 0, 1, 2 and 3


def test_the_pages_show_every_line_with_its_command_and_its_failure() -> None:
    board = Board(ranked(line("a", 3.0), line("b", 0.0, 1)), 5, Counter({"version 1": 4}))
    page = to_markdown(board, "mine")
    assert "4 of 5 rows run: 4 by version 1." in page
    assert "- b: why" in page
    assert "- a: " not in page
    assert "ttwmr run a   # runs/a/manifest.json\n" in page
    row = next(text for text in page.splitlines() if text.startswith("| a | – |"))
    assert row.split(" | ")[HEAD.index(RANKED_BY)] == "3"
    assert row.endswith(" 0/2 | followed |")
    row = next(text for text in page.splitlines() if text.startswith("| b | "))
    assert row.endswith(" 1/2 | 1 followed; 1 failed |")
    assert "ttwmr run b" in to_html(board, "mine")


@pytest.mark.parametrize(("how", "expected"), [("median", 20.0), ("worst", 70.0)])
def test_seeds_are_combined_over_the_runs_that_came_to_their_end(how: str, expected: float) -> None:
    runs = [{"error_m": error} for error in (0.002, None, 0.007, 0.001)]
    assert _combined(runs, "error_m", 1e4, how) == pytest.approx(expected)
    assert _combined([{"error_m": None}], "error_m", 1e4, how) is None
