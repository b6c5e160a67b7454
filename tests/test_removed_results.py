"""Results that somebody removes while they are made: told, exit 1, and the same command goes on."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Generator, Iterable
from pathlib import Path

import pytest

from sweeps import SMALL, here, written
from ttwmr_mj.cli.commands.sweep import Sweep
from ttwmr_mj.cli.main import main
from ttwmr_mj.figures.canvas import write_figures
from ttwmr_mj.runs.many import Placed, run_into_folders
from ttwmr_mj.studies.bench import execute
from ttwmr_mj.studies.sweep.compute import Outcome
from ttwmr_mj.studies.sweep.plan.plan import Plan
from ttwmr_mj.studies.sweep.plan.sampling import IntArray

Remove = Callable[[Path], None]


def first_shard(folder: Path) -> None:
    min(folder.glob("shards/*/*.parquet")).unlink()


def the_plan(folder: Path) -> None:
    (folder / "plan.json").unlink()


def all_but_the_plan(folder: Path) -> None:
    shutil.rmtree(folder / "shards")


def removing(folder: Path, remove: Remove, after: int) -> Callable[..., object]:
    """Computes chunks in this process, and removes something after that many."""

    def compute(plan: Plan, chunks: Iterable[IntArray]) -> Generator[Outcome, None, None]:
        for count, outcome in enumerate(here(plan, chunks), start=1):
            yield outcome
            if count == after:
                remove(folder)

    return lambda _: compute


REPORT = "ttwmr_mj.studies.sweep.answers.report.write_report"


@pytest.mark.parametrize(
    ("remove", "after", "told"),
    [
        (first_shard, 1, "removed while the sweep ran: 4 rows of 12 in out, which were done; "),
        (first_shard, 3, "removed while the sweep ran: 4 rows of 12 in out, which were done; "),
        (all_but_the_plan, 2, "removed while the sweep ran: 8 rows of 12 in out, which were done"),
        (shutil.rmtree, 1, "removed while the sweep ran: out; the same command goes on"),
        (shutil.rmtree, 3, "removed while the sweep ran: 12 rows of 12 in out, which were done; "),
        (the_plan, 1, ""),  # it is known, and written again
        (the_plan, 3, ""),
    ],
)
def test_what_vanishes_of_a_sweep_is_told_and_made_again(
    remove: Remove,
    after: int,
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["sweep", written(tmp_path, SMALL), "--out", "out", "--chunk", "4", "--quiet"]
    monkeypatch.setattr(REPORT, str)
    monkeypatch.setattr(Sweep, "_compute", removing(Path("out"), remove, after))
    assert main(words) == (1 if told else 0)
    assert told in capsys.readouterr().err
    monkeypatch.setattr(Sweep, "_compute", removing(Path("out"), remove, 0))
    assert main(words) == 0
    assert capsys.readouterr().out == "out\n"


def test_a_sweep_that_vanishes_while_its_report_is_written_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    draw = "ttwmr_mj.studies.sweep.answers.report.write_sweep_figures"
    monkeypatch.setattr(Sweep, "_compute", removing(Path("out"), the_plan, 0))

    def vanish(*_: object) -> None:
        shutil.rmtree("out")
        write_figures({}, Path("out/f"), "")

    monkeypatch.setattr(draw, vanish)
    assert main(["sweep", written(tmp_path, SMALL), "--out", "out", "--quiet"]) == 1
    assert "removed while the command ran: out/f: No such file" in capsys.readouterr().err
    assert not Path("out").exists()


SUITE = """
name = "mine"
seeds = [0, 1, 2]
[controller.lyapunov]
overrides = ['controller={kind="lyapunov"}']
[task.circle]
scenario = "lab_circle"
overrides = ["duration_s=0.3", "sensing.position_noise_m=0.001"]
[plant.analytic]
overrides = ["plant.kind=analytic"]
"""


def rows_removing(remove: Remove, after: int) -> Callable[..., object]:
    """Runs rows one by one in this process, and removes something after that many."""

    def computed(
        runs: list[Placed], *_: object
    ) -> Generator[tuple[tuple[Placed, ...], None], None, None]:
        for count, run in enumerate(runs):
            if count == after:
                remove(Path("out"))
            run_into_folders([run])
            if count + 1 == len(runs) == after:  # before it is written down
                remove(Path("out"))
            yield (run,), None

    return computed


def first_row(folder: Path) -> None:
    (min(folder.glob("runs/*")) / "row.json").unlink()


def first_trajectory(folder: Path) -> None:
    (min(folder.glob("runs/*")) / "trajectory.parquet").unlink()


@pytest.mark.parametrize(
    ("remove", "after", "told"),
    [
        (first_row, 1, "1 row was"),
        (first_trajectory, 2, "1 row was"),
        (shutil.rmtree, 2, "2 rows were"),
        (shutil.rmtree, 3, "3 rows were"),
    ],
)
def test_what_vanishes_of_a_suite_is_told_and_run_again(
    remove: Remove,
    after: int,
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("ttwmr_mj.studies.bench.page.write_page", lambda *_: None)
    words = ["bench", written(tmp_path, SUITE), "--out", "out", "--quiet"]
    monkeypatch.setattr(execute, "_computed", rows_removing(remove, after))
    assert main(words) == 1
    told_all = capsys.readouterr().err
    assert f"{told} not run, which is no fault of a law; the same command tries again" in told_all
    assert "its files were removed or changed while the suite ran" in told_all
    monkeypatch.setattr(execute, "_computed", rows_removing(remove, 9))
    assert main(words) == 0
