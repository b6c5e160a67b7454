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

        metrics = score_run(self.run)
        if self.quiet:
            print(self.run)
            return 0
        verdict = in_one_line(verdict_line(metrics))  # whose reason a stranger may have written
        print("\n".join(filter(None, [verdict, headline(metrics)])) + "\n")
        print(results_table(metrics))
        print(f"\nwritten: {self.run / 'metrics.json'}")
        return 0
