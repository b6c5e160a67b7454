"""`ttwmr bench`: controllers ranked on tasks."""

from pathlib import Path

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.shared import Quiet, warn


class Bench(Quiet, name="bench"):
    """Run a suite of controllers on tasks and rank them."""

    suite: str = argument("a TOML file, or the name of a shipped suite", "quick")
    out: Path | None = option(
        "folder for the results; finished runs in it are reused", metavar="DIR"
    )
    rescore: bool = option("run nothing, score the finished runs in --out")
    workers: int | None = option("processes at a time; default: one per processor", metavar="N")

    def __call__(self) -> int:
        from ttwmr_mj.runs.folder import open_folder, results_folder
        from ttwmr_mj.runs.progress import progress_bar
        from ttwmr_mj.studies.bench.execute import run_suite
        from ttwmr_mj.studies.bench.leaderboard import to_summary, write_leaderboard
        from ttwmr_mj.studies.bench.page import write_page
        from ttwmr_mj.studies.bench.scoring import collect
        from ttwmr_mj.studies.bench.suite import load_suite, rows_of

        suite = load_suite(self.suite)
        folder = self.out or results_folder("bench", suite.name)
        if not self.rescore:
            open_folder(folder, force=True)
            with progress_bar(suite.name, len(rows_of(suite)), "runs", self.quiet) as progress:
                run_suite(
                    suite,
                    folder,
                    workers=self.workers,
                    progress=progress,
                    told=None if self.quiet else warn,
                )
        board = collect(suite, folder)
        title = f"{suite.name}: {suite.description}" if suite.description else suite.name
        write_leaderboard(board, folder, title)
        write_page(board, folder, title)
        if not self.quiet:
            print(f"{to_summary(board, title)}\nwritten to {folder}")
        return 0
