"""The leaderboard's words and order, on lines that are made up."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from drawn import drawn

from ttwmr_mj.results.accept import VerdictName
from ttwmr_mj.results.verdict import SUCCESSES, VERDICTS
from ttwmr_mj.studies.bench.figures import write_charts
from ttwmr_mj.studies.bench.leaderboard import (
    HEAD,
    RULES,
    to_markdown,
    to_summary,
    write_leaderboard,
)
from ttwmr_mj.studies.bench.lines import COLUMNS, RANKED_BY, Column, Line, Run, ranked
from ttwmr_mj.studies.bench.overview import overview
from ttwmr_mj.studies.bench.page import to_html, write_page
from ttwmr_mj.studies.bench.scoring import Board

ORDER = {
    "controller": ["a", "b", "c", "d", "e"],
    "task": ["circle", "eight", "parked"],
    "plant": ["contact"],
    "sensing": ["truth"],
    "disturbance": ["none", "push"],
}


def run(seed: int, error_mm: float | None, verdict: VerdictName = "followed") -> Run:
    """A run that broke off if it has no error."""
    values = dict.fromkeys(COLUMNS)
    values[RANKED_BY] = None if error_mm is None else 1e-3 * error_mm
    sentence = f"{verdict}: decided by {seed}"
    return Run(seed, verdict, sentence, error_mm is not None, values)


def line(
    controller: str,
    errors_mm: Sequence[float | None],
    verdicts: Sequence[VerdictName] = (),
    *,
    task: str = "circle",
    meant: bool = True,
    scored: str = "steady",
    disturbance: str = "none",
) -> Line:
    """One run for each error, all of which followed unless said."""
    names = {"controller": controller, "task": task, "plant": "contact", "sensing": "truth"}
    said = verdicts or ["followed"] * len(errors_mm)
    return Line(
        names=names | {"disturbance": disturbance},
        runs=tuple(run(i, *pair) for i, pair in enumerate(zip(errors_mm, said, strict=True))),
        scored=scored,
        meant=meant,
        command=f"ttwmr run {controller}",
        manifest=f"runs/{controller}/manifest.json",
    )


def board(*lines: Line) -> Board:
    return Board(ranked(lines, ORDER), 9, Counter({"version 1": 4}))


def test_fewer_failures_come_first_then_smaller_errors_then_the_suites_order() -> None:
    lines = ranked(
        [
            line("a", [None], ["failed"]),
            line("b", [3.0]),
            line("c", [1.0, 0.5], ["followed", "lost"]),
            line("d", [2.0]),
            line("e", [3.0]),
        ],
        ORDER,
    )
    assert [line.names["controller"] for line in lines] == ["d", "b", "e", "c", "a"]
    lines = ranked([line("a", [1.0], task="eight"), line("b", [2.0])], ORDER)
    assert [line.names["task"] for line in lines] == ["circle", "eight"]


def test_the_best_is_named_where_it_is_better_than_every_other_on_the_same_seeds() -> None:
    def best(*lines: Line) -> list[str]:
        return [found.names["controller"] for found in ranked(lines, ORDER) if found.best]

    ahead, behind = [float(i) for i in range(10)], [i + 0.5 for i in range(10)]
    assert best(line("a", ahead), line("b", behind)) == ["a"]
    assert best(line("a", ahead), line("b", behind), line("c", ahead)) == []
    # eight of ten are not enough, whatever the medians
    close = [*[x + 9.0 for x in ahead[:8]], *[x - 0.1 for x in ahead[8:]]]
    assert best(line("a", ahead), line("b", close)) == []
    # one run alone shows nothing, nor does a law without another
    assert best(line("a", [1.0]), line("b", [100.0])) == []
    assert best(line("a", ahead)) == []
    # other tasks and disturbances are other rows
    elsewhere = line("b", [x - 1.0 for x in ahead], disturbance="push")
    assert best(line("a", ahead), line("c", behind), elsewhere) == ["a"]
    # and a law that never follows cannot be
    lost = line("b", [0.0] * 10, ["lost"] * 10)
    assert best(line("a", ahead), lost) == ["a"]


def test_second_halves_are_not_compared_with_whole_runs() -> None:
    ahead, behind = [float(i) for i in range(10)], [i + 0.5 for i in range(10)]
    whole = [x + 20.0 for x in ahead]  # of the very same runs as `ahead`
    b, d = (line(law, whole, scored="whole") for law in "bd")
    assert not any(found.best for found in ranked([line("a", ahead), b], ORDER))
    # a law that is compared with one is not held up by those that it is not compared with
    lines = ranked([d, line("c", behind), b, line("a", ahead)], ORDER)
    assert [(x.names["controller"], x.best) for x in lines] == [
        *[("a", True), ("c", False)],  # the row of second halves
        *[("b", False), ("d", False)],
    ]
    assert overview(lines)["circle"] == [
        ["condition", "a", "b", "c", "d"],
        ["contact · truth", "**4.5 (1 to 8)**", "", "5 (1.5 to 8.5)", ""],
        ["contact · truth, whole run", "", "24.5 (21 to 28)", "", "24.5 (21 to 28)"],
    ]


def test_the_overview_says_who_stands_where_in_a_word() -> None:
    ten = [float(i) for i in range(1, 11)]
    lines = board(
        line("a", [1234.0, 1.0], ["lost", "lost"]),
        line("b", [None], ["failed"], meant=False),
        line("c", [0.0004]),
        line("d", [2.0, None], ["followed", "failed"], meant=False),
        line("e", [2.5, 3.5]),
        line("c", ten, task="eight"),
        line("e", [1e3 * x for x in ten], task="eight"),
        line("a", [9e3] * 10, [*["lost"] * 7, *["saturated_throughout"] * 3], task="eight"),
        line("c", [7.0], task="parked", disturbance="push", scored="whole"),
    ).lines
    tables = overview(lines)
    assert tables["circle"] == [
        ["condition", "c", "e", "d", "a", "b"],
        ["contact · truth", "<0.001", "3", "∞, 1/2 †", "lost 0/2", "failed †"],
    ]
    assert tables["eight"] == [  # without those that it did not meet
        ["condition", "c", "e", "a"],
        ["contact · truth", "**5.5 (2 to 9)**", "5.5e+03 (2e+03 to 9e+03)", "lost 0/10"],
    ]
    assert tables["parked"] == [["condition", "c"], ["contact · truth · push, whole run", "7"]]


def test_controllers_stand_by_shares_and_means_however_many_tasks_they_met() -> None:
    tasks = ("circle", "eight", "parked")
    lines = [
        line("b", [9.0, 9.0], ["lost", "followed"]),
        line("a", [1.0, 1.0], task="circle"),
        line("a", [1.0, 1.0], task="eight"),
        line("a", [1.0, 1.0], ["lost", "followed"], task="parked"),
    ]
    assert overview(lines)["circle"][0] == ["condition", "a", "b"]  # 1 of 6 failed, 1 of 2
    lines = [line(name, [1.0], task=task) for task in tasks for name in ("d", "a")]
    lines = [*lines[:2], line("b", [1.0]), line("c", [1.0]), *lines[2:]]
    assert overview(lines)["circle"][0] == ["condition", "d", "a", "b", "c"]  # 0, 1, 2 and 3


def test_the_pages_show_every_line_with_its_command_and_every_failure() -> None:
    verdicts: list[VerdictName] = [*["followed"] * 8, "lost", "failed"]
    ours = board(
        line("a", [3.0]),
        line("b", [*range(1, 10), None], verdicts),
        line("c", [4.0], ["lost"], meant=False),
    )
    page = to_markdown(ours, "mine")
    assert "4 of 9 rows run: 4 by version 1." in page
    assert "- b, seed 8: lost: decided by 8\n- b, seed 9: failed: decided by 9\n" in page
    assert "- c, seed 0: lost" in page
    assert "- a, " not in page
    assert "ttwmr run a   # runs/a/manifest.json\n" in page
    cells = {row.split(" | ")[0]: row.split(" | ") for row in page.splitlines()}
    # a single run has no worst and no interval
    assert cells["| a"][HEAD.index(RANKED_BY)] == "3"
    assert cells["| a"][2] == ""
    assert cells["| a"][-2:] == ["1/1", "followed |"]
    assert cells["| b"][1:3] == ["5.5 (2 to 9)", "∞"]
    assert cells["| b"][-2:] == ["8/10 (44 to 97 %)", "8 followed; 1 lost; 1 failed |"]
    assert "| c † | 4 |  | – |" in page  # whose other columns no run has
    assert "“∞” is any number of a run that broke off" in page
    html = to_html(ours, "mine")
    assert "ttwmr run b" in html
    assert "seed 9: failed: decided by 9" in html


def test_the_summary_tells_the_first_failure_of_laws_made_for_the_task() -> None:
    ours = board(
        line("a", [1.0, 2.0, 3.0], ["followed", "lost", "blind"]),
        line("b", [4.0], ["lost"], meant=False),
        line("c", [5.0], ["lost"]),
    )
    page = to_summary(ours, "mine")
    assert "- contact · truth · a, 2 of 3: seed 1: lost: decided by 1\n" in page
    assert "- contact · truth · c: lost: decided by 0\n" in page
    assert "· b" not in page
    assert "contact · truth · a, 2 of 3: seed 1" in to_html(ours, "mine")
    assert all(rule in page for rule in RULES)
    assert all(f"“{VERDICTS[name][0]}”" in RULES[1] for name in SUCCESSES)
    assert "Not followed" not in to_summary(board(line("a", [1.0])), "mine")
    # no row says how many ran beside it
    assert "longer where several runs were made at once" in page


def test_the_best_is_bold_on_every_page() -> None:
    tied = [float(i) for i in range(1, 11)]
    ours = board(line("a", tied), line("b", [x + 1.0 for x in tied]))
    assert to_summary(ours, "mine").count("**5.5 (2 to 9)**") == 1
    assert to_markdown(ours, "mine").count("**5.5 (2 to 9)**") == 2
    html = to_html(ours, "mine")
    assert html.count("<b>5.5 (2 to 9)</b>") == html.count("<b>a</b>") == 1
    assert "Better than every other law, beyond chance: contact · truth: a." in html


def test_the_table_has_every_number_and_no_infinity(tmp_path: Path) -> None:
    verdicts: list[VerdictName] = [*["followed"] * 9, "failed"]
    ours = board(line("a", [*range(1, 10), None], verdicts), line("b", [2.0], meant=False))
    write_leaderboard(ours, tmp_path, "mine")
    one, other = pq.read_table(tmp_path / "leaderboard.parquet").to_pylist()
    assert one["controller"] == "b"  # no failure
    assert (one["runs"], one["followed"], one["meant"], one["best"]) == (1, 1.0, False, False)
    assert one["error, mm"] == pytest.approx(2.0)
    assert one["error, mm low"] is one["error, mm worst"] is None
    assert one["followed low"] is one["followed high"] is None
    assert other["error, mm"] == pytest.approx(5.5)
    assert (other["error, mm low"], other["error, mm high"]) == pytest.approx((2.0, 9.0))
    assert other["error, mm worst"] is None  # it broke off
    assert (other["failures"], other["lost"], other["followed"]) == (1, 0, 0.9)
    assert (other["followed low"], other["followed high"]) == pytest.approx(
        (0.555, 0.9975), abs=1e-3
    )
    assert other["reason"] == "seed 9: failed: decided by 9"
    assert other["scored"] == "steady"
    written = sorted(file.name for file in tmp_path.iterdir())
    assert written == ["leaderboard.md", "leaderboard.parquet", "summary.md"]


def test_the_page_has_a_chart_of_each_task_and_links_every_recording(tmp_path: Path) -> None:
    made = replace(line("a", [1.0, 4.0]), recordings=("runs/a/run.rrd",))
    ours = board(made, line("b", [2.0], task="eight"), line("b", [None], ["failed"], task="parked"))
    write_page(ours, tmp_path, "mine")
    page = (tmp_path / "leaderboard.html").read_text()
    assert page.count('href="runs/a/manifest.json"') == 1
    assert page.count('<a href="runs/a/run.rrd">') == page.count("run.rrd</a>") == 1
    charts = {path.name for path in (tmp_path / "figures").iterdir()}
    assert charts == {f"{task}.{end}" for task in ("circle", "eight") for end in ("png", "svg")}
    assert page.count('<svg class="drawing"') == 2  # and none of a task without an error
    assert "hollow: not every run followed" in page
    assert page.count("No law is better than every other beyond chance.") == 3
    # seeds are summed up where there are several, and only there
    of_a, of_b = (
        page.split(f'<h2 id="{task}">')[1].split("<h2")[0] for task in ("circle", "eight")
    )
    assert "<th>worst, mm</th>" in of_a
    assert 'data-value="4.0">4</td>' in of_a
    assert "worst" not in of_b
    tasks = [f'<a href="#{name}">' in page for name in ("circle", "eight", "parked", "rules")]
    assert all(tasks)


def test_the_chart_draws_each_error_with_its_interval(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    curves = drawn(monkeypatch)
    seeds = [float(i) for i in range(1, 11)]
    verdicts: list[VerdictName] = [*["followed"] * 9, "lost"]
    write_charts([line("a", seeds, verdicts), line("b", [3.0]), line("c", [None])], tmp_path)
    found = sorted(x for x, _ in curves["circle"].values() if len(x) and x != [0, 1])
    assert [x for line in found for x in line] == pytest.approx([2.0, 9.0, 3.0, 5.5])


def test_errors_too_small_for_the_table_lie_at_the_edge_of_the_chart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    curves = drawn(monkeypatch)
    small = [1e-9 * i for i in range(1, 11)]
    lines = [line("a", small, ["followed"] * 10), line("b", [3.0])]
    written = write_charts(lines, tmp_path)
    found = sorted(x for x, _ in curves["circle"].values() if len(x) and x != [0, 1])
    assert [x for part in found for x in part] == [1e-3, 1e-3, 1e-3, 3.0]
    assert "error, mm; leftmost: 0.001 or less; hollow" in written["circle"].read_text()


@pytest.mark.parametrize(
    ("numbers", "scored", "expected"),
    [
        ({"steady_f_m": 1.0, "f_m": 2.0, "steady_p_m": 3.0}, "steady", 1.0),
        ({"steady_f_m": 1.0, "f_m": 2.0, "steady_p_m": 3.0}, "whole", 2.0),
        ({"steady_f_m": None, "steady_p_m": 3.0}, "steady", 3.0),
        ({"steady_f_m": 0.0, "steady_p_m": 3.0}, "steady", 0.0),
        ({}, "steady", None),
    ],
)
def test_errors_cover_the_part_that_is_scored(
    numbers: dict[str, float | None], scored: str, expected: float | None
) -> None:
    assert Column(("f_m", "p_m"), of_part=True).of(numbers, scored) == expected
    assert Column(("f_m",)).of({"f_m": 5.0, "steady_f_m": 6.0}, scored) == 5.0


def test_what_has_no_number_takes_longest_or_is_left_out() -> None:
    def of(column: str, *values: float | None) -> tuple[float | None, float | None] | None:
        runs = [
            Run(i, "followed", "", True, dict.fromkeys(COLUMNS) | {column: v})
            for i, v in enumerate(values)
        ]
        names = {axis: names[0] for axis, names in ORDER.items()}
        found = Line(names, tuple(runs), "steady", True, "", None).statistic(column)
        return found and (found.median, found.worst)

    inf = float("inf")
    assert of("settled, s", 2.0, 4.0, None) == (4.0, inf)
    assert of("settled, s", 2.0, None, None) == (inf, inf)
    assert of("error, mm", 0.001, 0.002, None) == (2.0, inf)
    assert of("saturated, %", 0.1, 0.2, None) == pytest.approx((15.0, 20.0))
    assert of("blind, %", None, None) is None


def test_a_run_that_broke_off_counts_as_worse_than_any_in_every_column() -> None:
    runs = [
        Run(
            i, "failed", "", effort is not None, dict.fromkeys(COLUMNS) | {"effort, rad²/s": effort}
        )
        for i, effort in enumerate([3.0, 1.0, 2.0, None, None, None, None])
    ]
    names = {axis: names[0] for axis, names in ORDER.items()}
    found = Line(names, tuple(runs), "steady", True, "", None).statistic("effort, rad²/s")
    assert found == (float("inf"), 1.0, float("inf"), float("inf"))
