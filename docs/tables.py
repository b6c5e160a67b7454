"""Tables of the documentation that come from the code; run it to bring them up to date.

    python docs/tables.py

A page says where a table goes: between <!-- table: NAME --> and <!-- end -->.
"""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Mapping
from pathlib import Path

from scenario_tables import scenario_keys

from ttwmr_mj.cli.engine import add_subcommand, load_subcommands
from ttwmr_mj.controllers.base import CONTROLLERS
from ttwmr_mj.references.shared.reference import REFERENCES
from ttwmr_mj.results.accept import AcceptOptions
from ttwmr_mj.results.metrics import METRICS, QUANTITIES, meaning_of
from ttwmr_mj.results.verdict import VERDICTS
from ttwmr_mj.robot import Config
from ttwmr_mj.robot.motor import Motor
from ttwmr_mj.scenario.tables import worlds

PAGES = sorted(Path(__file__).parent.rglob("*.md"))
PLACE = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def kinds(registry: Mapping[str, type[Config]]) -> str:
    """What a section's `kind` may be, and the options that go with it."""
    rows = ["| kind | what it is | options |", "|---|---|---|"]
    for kind, options in registry.items():
        names = ", ".join(f"`{name}`" for name in options.model_fields if name != "kind")
        rows.append(f"| `{kind}` | {options.summary().replace('|', chr(92) + '|')} | {names} |")
    return "\n".join(rows) + "\n"


def verdicts() -> str:
    """The verdicts, in the order in which they are looked for."""
    rows = ["| verdict | in `metrics.json` | a run gets it if |", "|---|---|---|"]
    rows += [f"| {words} | `{name}` | {when} |" for name, (words, when) in VERDICTS.items()]
    return "\n".join(rows) + "\n"


def options(model: type[Config]) -> str:
    """The keys of a table of the scenario."""
    rows = ["| key | default | what it is |", "|---|---|---|"]
    for name, field in model.model_fields.items():
        rows.append(f"| `{name}` | `{json.dumps(field.default)}` | {field.description} |")
    return "\n".join(rows) + "\n"


def lab() -> str:
    """The laboratory's world."""
    rows = ["| key | value | believed | reason |", "|---|---|---|---|"]
    for known in (*worlds.LAB, *worlds.LAB_TRUTH):
        value = "present" if isinstance(known.value, dict) else f"{known.value:g}"
        believed = "the same" if known.believed is None else f"{known.believed:g}"
        rows.append(f"| `{known.key}` | {value} | {believed} | {known.reason} |")
    return "\n".join(rows) + "\n"


def unkind() -> str:
    """The unkind world."""
    rows = ["| key | drawn from | why so much |", "|---|---|---|"]
    rows += [f"| `{key}` | {range_} | {why} |" for key, range_, why in worlds.UNKIND]
    return "\n".join(rows) + "\n"


def metrics() -> str:
    """The metrics, as they are computed."""
    rows = ["| name | unit | formula | Eq. | what it is |", "|---|---|---|---|---|"]
    for name, metric in METRICS.items():
        formula = metric.formula.replace("|", "\\|")
        equations = QUANTITIES[metric.of].equations
        meaning = meaning_of(name)
        rows.append(f"| `{name}` | {metric.unit} | {formula} | {equations} | {meaning} |")
    return "\n".join(rows) + "\n"


def commands() -> str:
    """Every command with its arguments and options, as its help has them."""
    parsers = argparse.ArgumentParser().add_subparsers()
    found = []
    for name, kind in sorted(load_subcommands("ttwmr_mj.cli.commands").items()):
        add_subcommand(parsers, name, kind)
        parser = parsers.choices[name]
        rows = ["| argument | meaning |", "|---|---|"]
        rows += [option_row(action) for action in parser._actions if action.dest != "help"]
        found.append(f"## `ttwmr {name}`\n\n{parser.description}\n\n" + "\n".join(rows))
    return "\n\n".join(found) + "\n"


def option_row(action: argparse.Action) -> str:
    """An argument or option with the values that it takes."""
    value = "" if action.nargs == 0 else str(action.metavar or action.dest.upper())
    if action.choices:
        value = "{" + ",".join(map(str, action.choices)) + "}"
    typed = ", ".join(action.option_strings)
    words = f"{typed} {value}".strip() if typed else action.metavar or action.dest
    return f"| `{words}` | {' '.join((action.help or '').split())} |".replace("\\|", "|")


TABLES = {
    "scenario": scenario_keys,
    "commands": commands,
    "metrics": metrics,
    "lab": lab,
    "unkind": unkind,
    "controllers": lambda: kinds(CONTROLLERS),
    "references": lambda: kinds(REFERENCES),
    "verdicts": verdicts,
    "accept": lambda: options(AcceptOptions),
    "motor": lambda: options(Motor),
}


def filled(page: str) -> str:
    """A page with its tables as the code has them now."""
    return PLACE.sub(lambda place: place[1] + TABLES[place[2]]() + place[3], page)


def main() -> None:
    """Bring every page up to date."""
    for page in PAGES:
        page.write_text(filled(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
