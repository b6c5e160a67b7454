"""`ttwmr doctor`: what this machine can do."""

from ttwmr_mj.cli.engine import Subcommand
from ttwmr_mj.errors import printable


class Doctor(Subcommand, name="doctor"):
    """Say what this machine has and what is missing."""

    def __call__(self) -> int:
        from ttwmr_mj.runs.process.machine import examine

        text, healthy = examine()
        print(printable(text))
        return 0 if healthy else 1
