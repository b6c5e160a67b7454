"""The leaderboard at a glance: for each task conditions by controllers, and what failed."""

from collections import defaultdict
from collections.abc import Iterable
from statistics import mean

from ttwmr_mj.results.verdict import VERDICTS
from ttwmr_mj.studies.bench.evidence import Statistic
from ttwmr_mj.studies.bench.lines import RANKED_BY, Line
from ttwmr_mj.studies.bench.suite import AXES

NOT_MEANT = "†"
CAPTION = (
    "Error, mm; of several runs the median and its interval, and how many followed where not all "
    "did. The verdict stands where none did. Bold: significantly better than every other law of "
    f"the row. {NOT_MEANT}: the law is not made for the task. Empty: not in the suite, or not run. "
    "Controllers with the smaller share of failures first."
)

Table = list[list[str]]


def condition(line: Line) -> str:
    """Plant, sensing and disturbance in words, and whether the whole run is scored."""
    plant, sensing, disturbance = (line.names[axis] for axis in AXES[2:])
    parts = [plant, sensing, *([disturbance] if disturbance != "none" else [])]
    return " · ".join(parts) + (", whole run" if line.scored == "whole" else "")


def sections(lines: Iterable[Line]) -> dict[tuple[str, str], list[Line]]:
    """(task, condition) → its lines."""
    found: dict[tuple[str, str], list[Line]] = defaultdict(list)
    for line in lines:
        found[line.names["task"], condition(line)].append(line)
    return dict(found)


def overview(lines: list[Line]) -> dict[str, Table]:
    """Task → table of conditions by the controllers that had this task, its head first."""
    standing = _by_standing(sections(lines).values())
    tables: dict[str, Table] = {}
    for (task, name), members in sections(lines).items():
        had = {line.names["controller"] for line in lines if line.names["task"] == task}
        controllers = [controller for controller in standing if controller in had]
        by_name = {line.names["controller"]: line for line in members}
        cells = [_cell(by_name[one]) if one in by_name else "" for one in controllers]
        tables.setdefault(task, [["condition", *controllers]]).append([name, *cells])
    return tables


def failures(lines: list[Line]) -> dict[str, list[str]]:
    """Task → a sentence on each line with failures of a law that is made for the task."""
    told: dict[str, list[str]] = defaultdict(list)
    for line in lines:
        if line.failed and line.meant:
            several = f", {len(line.failed)} of {len(line.runs)}" if len(line.runs) > 1 else ""
            first = line.failed[0]
            what = f"seed {first.seed}: {first.sentence}" if several else first.sentence
            where = f"{condition(line)} · {line.names['controller']}"
            told[line.names["task"]].append(f"{where}{several}: {what}")
    return dict(told)


def number(value: float | None) -> str:
    """Three digits; a dash where there is none."""
    if value is None:
        return "–"
    if value == float("inf"):
        return "∞"
    return "<0.001" if 0.0 < value < 1e-3 else f"{value:.3g}"


def amount(found: Statistic | None) -> str:
    """The median with its interval."""
    if found is None:
        return "–"
    if found.low is None:
        return number(found.median)
    return f"{number(found.median)} ({number(found.low)} to {number(found.high)})"


def _by_standing(groups: Iterable[list[Line]]) -> list[str]:
    """Controllers by the share of their lines' runs that failed, then by their mean place."""
    places: dict[str, list[tuple[int, Line]]] = defaultdict(list)
    for members in groups:
        for place, line in enumerate(members):
            places[line.names["controller"]].append((place, line))

    def standing(controller: str) -> tuple[float, float]:
        found = places[controller]
        failed = sum(len(line.failed) for _, line in found) / sum(len(x.runs) for _, x in found)
        return failed, mean(place for place, _ in found)

    return sorted(places, key=standing)


def _cell(line: Line) -> str:
    """A controller on a task in a word."""
    mark = "" if line.meant else f" {NOT_MEANT}"
    runs, error = len(line.runs), line.statistic(RANKED_BY)
    share = f"{line.followed}/{runs}"
    if not line.followed or error is None:
        usual = VERDICTS[max(line.runs, key=lambda r: _count(line, r.verdict)).verdict][0]
        return f"{usual}{f' {share}' if runs > 1 else ''}{mark}"
    text = amount(error)
    if line.failed:
        text += f", {share}"
    return f"{f'**{text}**' if line.best else text}{mark}"


def _count(line: Line, verdict: str) -> int:
    return sum(run.verdict == verdict for run in line.runs)
