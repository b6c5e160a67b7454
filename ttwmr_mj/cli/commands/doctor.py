"""`ttwmr doctor`: what this machine can do."""

from __future__ import annotations

from dataclasses import dataclass

from ttwmr_mj.cli.engine import Subcommand


@dataclass(frozen=True, kw_only=True)
class Doctor(Subcommand, name="doctor"):
    """Say what this machine has and what is missing."""

    def call(self) -> int:
        """Print the report; exit code 1 if a run without a camera would fail."""
        from ttwmr_mj.run.machine import examine

        text, healthy = examine()
        print(text)
        return 0 if healthy else 1
