"""`ttwmr score`: a run folder summed up again."""

from pathlib import Path

from ttwmr_mj.cli.engine import argument
from ttwmr_mj.cli.shared import Quiet


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
        print("\n".join(filter(None, [verdict_line(metrics), headline(metrics)])) + "\n")
        print(results_table(metrics))
        print(f"\nwritten: {self.run / 'metrics.json'}")
        return 0
