"""`ttwmr bench`: controllers ranked on tasks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.shared import Quiet, kept_in, warn
from ttwmr_mj.errors import RunError, in_brief

if TYPE_CHECKING:
    from ttwmr_mj.studies.bench.scoring import Board
    from ttwmr_mj.studies.bench.suite import Suite


class Bench(Quiet, name="bench"):
    """Run a suite of controllers on tasks and rank them."""

    suite: str = argument("a TOML file, or the name of a shipped suite", "quick")
    out: Path | None = option(
        "folder for the results; finished runs in it are reused", metavar="DIR"
    )
    rescore: bool = option("run nothing, score the finished runs in --out")
    workers: int | None = option(
        "processes at a time; default: one per processor", metavar="N", least=1
    )
    max_rows: int = option("refuse larger suites", 10_000, metavar="N", least=1)

    def __call__(self) -> int:
        from ttwmr_mj.runs.files.folder import results_folder
        from ttwmr_mj.studies.bench.scoring import collect
        from ttwmr_mj.studies.bench.suite import load_suite, rows_of

        suite = load_suite(self.suite, self.max_rows)
        folder = self.out or results_folder("bench", suite.name)
        count = len(rows_of(suite))
        not_run: dict[str, str] = {}

        def kept() -> str:
            return f"{len(list(folder.glob('runs/*/row.json')))} of {count} runs are kept"

        with kept_in(folder, kept):
            if not self.rescore:
                not_run = self._run(suite, folder)
                if len(not_run) == count:
                    raise RunError(_told_not_run(not_run))
            board = collect(suite, folder)
            if board.lines:
                self._show(board, suite, folder)
        left_out = {key: why for key, why in board.damaged.items() if key not in not_run}
        faults = [_told_not_run(not_run)] if not_run else []
        faults += [_told_left_out(left_out, self.rescore)] if left_out else []
        if faults:
            raise RunError("\n".join(faults))
        return 0

    def _run(self, suite: Suite, folder: Path) -> dict[str, str]:
        """Run what is missing; rows that were not, and why."""
        from ttwmr_mj.runs.process.progress import progress_bar
        from ttwmr_mj.studies.bench.execute import run_suite
        from ttwmr_mj.studies.bench.suite import rows_of

        count, told = len(rows_of(suite)), None if self.quiet else warn
        with progress_bar(suite.name, count, "runs", self.quiet) as progress:
            return run_suite(suite, folder, workers=self.workers, progress=progress, told=told)

    def _show(self, board: Board, suite: Suite, folder: Path) -> None:
        """The ranking, as files and on the terminal."""
        from ttwmr_mj.studies.bench.leaderboard import to_summary, write_leaderboard
        from ttwmr_mj.studies.bench.page import write_page

        title = f"{suite.name}: {suite.description}" if suite.description else suite.name
        write_leaderboard(board, folder, title)
        write_page(board, folder, title)
        print(folder if self.quiet else f"{to_summary(board, title)}\nwritten to {folder}")


def _told_not_run(not_run: dict[str, str]) -> str:
    """Which rows were not run, in a line for each reason."""
    reasons: dict[str, list[str]] = {}
    for key, reason in not_run.items():
        reasons.setdefault(in_brief(reason), []).append(key)
    lines = [
        f"  {keys[0]}{f' and {len(keys) - 1} more' if keys[1:] else ''}: {reason}"
        for reason, keys in reasons.items()
    ]
    count = "1 row was" if len(not_run) == 1 else f"{len(not_run)} rows were"
    head = f"{count} not run, which is no fault of a law; the same command tries again:"
    return "\n".join([head, *lines])


def _told_left_out(left_out: dict[str, str], rescored: bool) -> str:
    """Which rows are not scored, and what to do about it."""
    count = "1 row is" if len(left_out) == 1 else f"{len(left_out)} rows are"
    why = (
        "as what was written is no run of the scenario; if a law changes what computes or writes "
        "it, mend the law"
    )
    if rescored:
        why = (
            "incomplete, damaged or not run as the suite says; without --rescore they are run again"
        )
    lines = (f"  {key}: {reason}" for key, reason in left_out.items())
    return "\n".join([f"{count} left out, {why}:", *lines])
