"""The leaderboard's files: Markdown, one page of HTML, Parquet."""

from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ttwmr_mj.files import write_parquet, write_text
from ttwmr_mj.studies.bench.scoring import COLUMNS, RANKED_BY, Board, Line
from ttwmr_mj.studies.bench.suite import AXES

HEAD = ["controller", *COLUMNS, "failures", "verdict"]
RULES = (
    "Errors are rms over the second half of a run; the median over seeds, or the largest in "
    "columns named “worst”.",
    "“trailer” is the trailer's centre of mass; “settled” is the time after which P stays within "
    "10 mm, “–” if it never does; “effort” is ∫(ω_r² + ω_l²)dt.",
    "A run has failed if its verdict (docs/verdict.md) is not “followed”: it ended early, or it "
    "finished and was lost. Failures count both.",
    "Errors cover all runs that finished, lost ones included.",
    "Ranked by failures, then by the trailer's error.",
    "Control time is wall time per sample, measured with several runs at once.",
)
OVERVIEW = (
    "Trailer rms, mm, median over seeds: the best of each row in bold, the verdict where all runs "
    "failed, empty what is not in the suite. Controllers with fewer failures first."
)


def write_leaderboard(board: Board, folder: Path, title: str) -> None:
    """leaderboard.md, .html and .parquet, and summary.md, its head alone."""
    import pyarrow as pa

    lines = board.lines
    write_text(folder / "leaderboard.md", to_markdown(board, title))
    write_text(folder / "summary.md", to_summary(board, title))
    write_text(folder / "leaderboard.html", to_html(board, title))
    columns: dict[str, list[Any]] = {axis: [line.names[axis] for line in lines] for axis in AXES}
    columns |= {name: [line.values[name] for line in lines] for name in COLUMNS}
    for name in ("runs", "failures", "lost", "verdict", "reason", "command", "manifest"):
        columns[name] = [getattr(line, name) for line in lines]
    write_parquet(pa.table(columns), folder / "leaderboard.parquet")


def status(board: Board) -> str:
    """How much of the suite was run, and by what."""
    made = "; ".join(f"{count} by {maker}" for maker, count in board.made_by.most_common())
    return f"{board.made_by.total()} of {board.rows} rows run: {made}."


def _condition(line: Line) -> str:
    plant, sensing, disturbance = (line.names[axis] for axis in AXES[2:])
    return " · ".join([plant, sensing, *([disturbance] if disturbance != "none" else [])])


def _sections(lines: list[Line]) -> dict[tuple[str, str], list[Line]]:
    """(task, condition) → its lines."""
    sections: dict[tuple[str, str], list[Line]] = defaultdict(list)
    for line in lines:
        sections[line.names["task"], _condition(line)].append(line)
    return dict(sections)


def _cells(line: Line) -> list[str]:
    numbers = map(_number, line.values.values())
    return [line.names["controller"], *numbers, f"{line.failures}/{line.runs}", line.verdict]


def _number(value: float | None) -> str:
    if value is None:
        return "–"
    return "<0.001" if 0.0 < value < 1e-3 else f"{value:.3g}"


def overview(lines: list[Line]) -> dict[str, list[list[str]]]:
    """Task → table of conditions by controllers, its head first."""
    sections = _sections(lines)
    controllers = _by_standing(sections.values())
    tables: dict[str, list[list[str]]] = {}
    for (task, condition), members in sections.items():
        by_name = {line.names["controller"]: line for line in members}
        cells = [_summary(by_name.get(name), members) for name in controllers]
        tables.setdefault(task, [["condition", *controllers]]).append([condition, *cells])
    return tables


def _by_standing(sections: Iterable[list[Line]]) -> list[str]:
    """Controllers by the share of their runs that failed, then by their mean place in sections."""
    places: dict[str, list[tuple[int, Line]]] = defaultdict(list)
    for members in sections:
        for place, line in enumerate(members):
            places[line.names["controller"]].append((place, line))

    def standing(controller: str) -> tuple[float, float]:
        found = places[controller]
        failed = sum(line.failures for _, line in found) / sum(line.runs for _, line in found)
        return failed, sum(place for place, _ in found) / len(found)

    return sorted(places, key=standing)


def _summary(line: Line | None, members: list[Line]) -> str:
    """A controller on a task in a word."""
    if line is None:
        return ""
    value = line.values[RANKED_BY]
    if line.failures == line.runs or value is None:
        return line.verdict
    number = _number(value)
    if line.failures:
        return f"{number} ({line.failures} of {line.runs} failed)"
    return f"**{number}**" if line is members[0] else number


def _table(rows: list[list[str]]) -> str:
    """A Markdown table, the head first."""
    head, *body = (f"| {' | '.join(row)} |" for row in rows)
    return "\n".join([head, f"|{'---|' * len(rows[0])}", *body])


def to_markdown(board: Board, title: str) -> str:
    """Rules and overview, then each task with its numbers and the commands that repeat them."""
    parts = [to_summary(board, title)]
    for (task, condition), members in _sections(board.lines).items():
        parts.append(f"## {task} · {condition}\n\n{_table([HEAD, *map(_cells, members)])}\n")
        parts += [
            f"- {line.names['controller']}: {line.reason}\n" for line in members if line.reason
        ]
        commands = "\n".join(
            f"{line.command}   # {line.manifest or ''}".rstrip() for line in members
        )
        parts.append(f"```sh\n{commands}\n```\n")
    return "\n".join(parts)


def to_summary(board: Board, title: str) -> str:
    """Rules and overview alone."""
    rules = "\n".join(f"- {rule}" for rule in RULES)
    parts = [f"# {title}\n", f"{status(board)}\n", f"{rules}\n", f"{OVERVIEW}\n"]
    parts += [f"**{task}**\n\n{_table(rows)}\n" for task, rows in overview(board.lines).items()]
    return "\n".join(parts)


def to_html(board: Board, title: str) -> str:
    """The same as one page without anything outside of it."""
    import jinja2

    source = (Path(__file__).parent / "leaderboard.html.j2").read_text(encoding="utf-8")
    template = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return template.from_string(source).render(
        title=title,
        status=status(board),
        rules=RULES,
        caption=OVERVIEW,
        overview=overview(board.lines),
        head=HEAD,
        sections={
            " · ".join(head): [(_cells(line), line) for line in members]
            for head, members in _sections(board.lines).items()
        },
    )
