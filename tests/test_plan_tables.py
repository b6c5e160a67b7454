"""Tables of plans that are whole in form and no plan all the same."""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from ttwmr_mj.cli.main import main
from ttwmr_mj.references.planned import Planned, shipped_plans
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

ROUND, WAY = "waypoints_lab", "rest_to_rest"
SCENARIO = """
name = "mine"
duration_s = 20.0
plant.kind = "analytic"
[initial]
kind = "on_reference"
[reference]
kind = "planned"
plan = "mine.csv"
[controller]
kind = "tvlqr"
"""


def shipped(name: str) -> tuple[list[str], FloatArray]:
    """Its header with the columns' names, and its table."""
    lines = (files("ttwmr_mj.references") / "data" / f"{name}.csv").read_text().splitlines()
    return lines[:4], np.loadtxt(lines[4:], delimiter=",")


def write(folder: Path, header: list[str], table: FloatArray, form: str = "%.12g") -> str:
    """The plan, and a scenario that follows it; returns the plan's path."""
    (folder / "mine.toml").write_text(SCENARIO)
    with (folder / "mine.csv").open("w") as file:
        file.write("\n".join(header) + "\n")
        np.savetxt(file, table, fmt=form, delimiter=",")
    return str(folder / "mine.csv")


def refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """What `ttwmr validate` says of that scenario."""
    assert main(["validate", str(folder / "mine.toml")]) == 2
    return capsys.readouterr().err


@pytest.mark.parametrize(
    ("left", "told"),
    [(143, "theta2 of its last row is 0.0309 rad"), (96, "theta2 of its last row is 2.23 rad")],
)
def test_a_round_whose_last_rows_are_missing_is_refused(
    left: int, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    header, table = shipped(ROUND)
    write(tmp_path, header, table[:left])
    said = refused(tmp_path, capsys)
    assert f"it ends as it began, and {told} away from that of its first" in said
    assert "the file may be cut off" in said


def test_a_round_that_ends_elsewhere_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    header, table = shipped(ROUND)
    table[-1, 1] += 0.1
    write(tmp_path, header, table)
    assert "x of its last row is 0.1 m away from that of its first" in refused(tmp_path, capsys)


def in_degrees(table: FloatArray) -> None:
    table[:, 3:] = np.degrees(table[:, 3:])


def without_turns(table: FloatArray) -> None:
    table[:, 3:] = np.angle(np.exp(1j * table[:, 3:]))


def exchanged(*columns: int) -> Callable[[FloatArray], None]:
    def exchange(table: FloatArray) -> None:
        table[:, columns] = table[:, columns[::-1]]

    return exchange


def behind_p(table: FloatArray) -> None:
    table[:, 1:3] -= 0.05 * np.column_stack([np.cos(table[:, 3]), np.sin(table[:, 3])])


@pytest.mark.parametrize("name", [ROUND, WAY])
@pytest.mark.parametrize(
    "change",
    [exchanged(1, 2), exchanged(3, 4), without_turns, in_degrees, behind_p],
    ids=["x, y", "angles", "wrapped", "degrees", "another point"],
)
def test_a_plan_that_slides_sideways_is_refused(
    change: Callable[[FloatArray], None],
    name: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    header, table = shipped(name)
    if change is without_turns:
        table[:, 3:] += 3.0 - table[0, 3]  # so that there is a jump on both ways
    change(table)
    write(tmp_path, header, table)
    said = refused(tmp_path, capsys)
    if (name, change) == (ROUND, in_degrees):
        assert "away from that of its first: the file may be cut off, or its angles may be" in said
        return
    assert re.search(
        r"reference: moves P at 0\.\d+ m/s across its heading .*, at \d+\.?\d* s", said
    )
    assert "columns exchanged, are angles in degrees or do they jump by a turn" in said
    assert "hitch" not in said


@pytest.mark.parametrize("name", [ROUND, WAY])
def test_a_plan_of_fewer_rows_is_one_all_the_same(name: str, tmp_path: Path) -> None:
    header, table = shipped(name)
    thinned = np.concatenate([table[:-1:4], table[-1:]])
    write(tmp_path, header, thinned)
    assert main(["validate", str(tmp_path / "mine.toml")]) == 0


@pytest.mark.parametrize("name", [ROUND, "figure_eight", "double_eight"])
def test_a_round_may_be_written_with_four_decimals(name: str, tmp_path: Path) -> None:
    """And some turns on: each row rounds a turn by itself."""
    header, table = shipped(name)
    robot = RobotParameters()
    for turns in range(-3, 4):
        moved = table + 0.0
        moved[:, 3:] += np.linspace(0.0, 2.0 * np.pi * turns, len(table))[:, None]
        told = [
            f.problem for f in Planned(plan=write(tmp_path, header, moved, "%.4f")).faults(robot)
        ]
        assert not any("is not a valid plan" in problem for problem in told)


@pytest.mark.parametrize(
    "name", [name for name in shipped_plans() if "rest" in name or "turn" in name]
)
def test_a_way_from_rest_to_rest_that_is_cut_is_refused(name: str, tmp_path: Path) -> None:
    header, table = shipped(name)
    assert header[2] == "# ends: at rest"

    def problem(rows: FloatArray) -> str:
        faults = Planned(plan=write(tmp_path, header, rows)).faults(RobotParameters())
        return "".join(one.problem for one in faults if "not a valid plan" in one.problem)

    assert problem(table) == ""
    assert problem(table[::4]) == ""  # fewer rows, and as much at rest
    for missing in (10, len(table) // 2):
        assert "in its last step, and must rest at both ends: the file may" in problem(
            table[:-missing]
        )
        late = table[missing:] - np.array([table[missing, 0], *[0.0] * (table.shape[1] - 1)])
        assert "in its first step" in problem(late)
    held = np.repeat(table[-1:], 5, axis=0)  # what stands, stands
    held[:, 0] += 0.05 * np.arange(1, 6)
    assert problem(np.concatenate([table, held])) == ""
