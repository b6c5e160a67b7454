"""`ttwmr reproduce`: the article, run again."""

from pathlib import Path

from ttwmr_mj.cli.engine import option
from ttwmr_mj.cli.last_resort import say
from ttwmr_mj.cli.shared import Quiet, kept_in


class Reproduce(Quiet, name="reproduce"):
    """Re-run the article: every figure, every claim."""

    out: Path = option(
        "folder for the report; finished runs in it are reused",
        Path("results/reproduce"),
        metavar="DIR",
    )
    only: tuple[str, ...] = option("reproduce only this figure; repeatable", metavar="FIG")

    def __call__(self) -> int:
        from ttwmr_mj.studies.reproduce.study import reproduce, verdict_table

        with kept_in(self.out, lambda: "what is done is kept"):
            done = reproduce(self.out, list(self.only), quiet=self.quiet)
        text = f"{verdict_table(done.judgements)}\n\nreport: {done.report}".lstrip()
        print(done.report if self.quiet else text)
        for name, reason in done.failures.items():
            say(f"{name} could not be run: {reason}")
        return 1 if done.runs_failed else 0
