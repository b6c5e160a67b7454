"""`ttwmr export-schema`: what a scenario may hold, for editors."""

from pathlib import Path

from ttwmr_mj.cli.engine import option
from ttwmr_mj.cli.shared import NewFiles


class ExportSchema(NewFiles, name="export-schema"):
    """Print the JSON Schema of scenarios."""

    out: Path | None = option("write the schema to a file instead", metavar="FILE")

    def __call__(self) -> int:
        import json

        from ttwmr_mj.files import write_text
        from ttwmr_mj.scenario.schema import Scenario

        text = json.dumps(Scenario.model_json_schema(), indent=2, ensure_ascii=False) + "\n"
        if self.out:
            self.refuse_to_replace("--out", self.out)
            write_text(self.out, text)
        else:
            print(text, end="")
        return 0
