"""`ttwmr list`: what is shipped."""

from __future__ import annotations

from dataclasses import dataclass

from ttwmr_mj.cli.engine import Subcommand


@dataclass(frozen=True, kw_only=True)
class List(Subcommand, name="list"):
    """List the shipped scenarios."""

    def call(self) -> int:
        """One line each, with its description."""
        import tomllib

        from ttwmr_mj.assets import shipped_scenarios

        for name, path in shipped_scenarios().items():
            print(f"{name:20s} {tomllib.loads(path.read_text()).get('description', '')}")
        return 0
