"""`ttwmr score`: a run folder summed up again."""

from pathlib import Path

from ttwmr_mj.cli.engine import argument
from ttwmr_mj.cli.shared import Quiet
from ttwmr_mj.errors import in_one_line


class Score(Quiet, name="score"):
    """Sum up a run folder from its trajectory, also of a run that was killed."""

    run: Path = argument("the run folder")

    def __call__(self) -> int:
        from ttwmr_mj.runs.report import headline, results_table, verdict_line
        from ttwmr_mj.runs.score import score_run

        self._settle()
        metrics = score_run(self.run)
        if self.quiet:
            print(self.run)
            return 0
        verdict = in_one_line(verdict_line(metrics))  # whose reason a stranger may have written
        print("\n".join(filter(None, [verdict, headline(metrics)])) + "\n")
        print(results_table(metrics))
        print(f"\nwritten: {self.run / 'metrics.json'}")
        return 0

    def _settle(self) -> None:
        """Put the run back that one was to replace which was killed before its first row."""
        from ttwmr_mj.cli.last_resort import say
        from ttwmr_mj.runs.files.lock import locked
        from ttwmr_mj.runs.files.new_folder import ASIDE, settle_the_dead

        if not (self.run / ASIDE).is_dir():
            return
        with locked(self.run, key="RUN"):
            if settle_the_dead(self.run):
                say(
                    f"warning: nothing was recorded before the run in {self.run} was killed; the "
                    "one that it was to replace is there again"
                )
