"""`ttwmr list`: what a scenario can be made of."""

import shutil
import textwrap
from collections.abc import Mapping
from pathlib import Path

from ttwmr_mj.cli.engine import Subcommand

WIDTHS = (80, 120)  # of the text, as the terminal allows


class List(Subcommand, name="list"):
    """List what there is: scenarios, laws, references, suites, sweeps, metrics."""

    def __call__(self) -> int:
        from ttwmr_mj.assets import shipped_scenarios
        from ttwmr_mj.controllers.base import CONTROLLERS
        from ttwmr_mj.references.shared.reference import REFERENCES
        from ttwmr_mj.results.metrics import METRICS, meaning_of
        from ttwmr_mj.studies.bench.suite import shipped_suites
        from ttwmr_mj.studies.sweep.plan.file import shipped_sweeps

        sections: dict[str, Mapping[str, str]] = {
            "scenarios: ttwmr run NAME": _descriptions(shipped_scenarios()),
            "laws: controller.kind": {kind: cls.summary() for kind, cls in CONTROLLERS.items()},
            "references: reference.kind": {k: cls.summary() for k, cls in REFERENCES.items()},
            "suites: ttwmr bench NAME": _descriptions(shipped_suites()),
            "sweeps: ttwmr sweep NAME": _descriptions(shipped_sweeps()),
            "metrics: in metrics.json; steady_ before a name: of the second half": {
                name: f"{meaning_of(name)} [{metric.unit}]"
                for name, metric in METRICS.items()
                if not name.startswith("steady_")
            },
        }
        least, most = WIDTHS
        width = min(max(shutil.get_terminal_size((least, 24)).columns, least), most)
        column = max(len(name) for entries in sections.values() for name in entries)
        for title, entries in sections.items():
            _print(title, entries, column, width)
        return 0


def _descriptions(files: Mapping[str, Path]) -> dict[str, str]:
    """Name → the description that a TOML file gives."""
    import tomllib

    return {
        name: tomllib.loads(path.read_text(encoding="utf-8")).get("description", "")
        for name, path in files.items()
    }


def _print(title: str, entries: Mapping[str, str], column: int, width: int) -> None:
    print(title)
    for name, text in entries.items():
        first, *rest = textwrap.wrap(text, width - column - 4, break_on_hyphens=False) or [""]
        print(f"  {name:{column}s}  {first}".rstrip())
        for line in rest:
            print(f"{'':{column + 4}s}{line}")
    print()
