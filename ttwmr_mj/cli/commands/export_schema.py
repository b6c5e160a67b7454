"""`ttwmr export-schema`: what may stand in a scenario, for editors."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ttwmr_mj.cli.engine import Subcommand, option


@dataclass(frozen=True, kw_only=True)
class ExportSchema(Subcommand, name="export-schema"):
    """Print the JSON Schema of scenarios."""

    out: Path | None = option(None, "write it to a file instead", metavar="FILE")

    def call(self) -> int:
        """Print or write it."""
        import json

        from ttwmr_mj.files import write_text
        from ttwmr_mj.scenario.schema import Scenario

        text = json.dumps(Scenario.model_json_schema(), indent=2, ensure_ascii=False) + "\n"
        if self.out:
            write_text(self.out, text)
        else:
            print(text, end="")
        return 0
