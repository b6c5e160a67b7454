"""The leaderboard in Markdown and Parquet, and its rules."""

from pathlib import Path
from typing import Any

from ttwmr_mj.errors import in_markdown, printable
from ttwmr_mj.files import write_text
from ttwmr_mj.results.parquet import write_parquet
from ttwmr_mj.results.statistics import LEVEL, share
from ttwmr_mj.studies.bench.evidence import SIGNIFICANCE
from ttwmr_mj.studies.bench.lines import COLUMNS, RANKED_BY, Line
from ttwmr_mj.studies.bench.overview import (
    CAPTION,
    NOT_MEANT,
    amount,
    failures,
    number,
    overview,
    sections,
)
from ttwmr_mj.studies.bench.scoring import Board
from ttwmr_mj.studies.bench.suite import AXES

WORST = "worst error, mm"
HEAD = ["controller", RANKED_BY, WORST, *list(COLUMNS)[1:], "followed", "verdict"]
RULES = (
    "“Error” is the rms distance of the trailer's centre of oscillation from its reference, or of "
    "P where the reference says nothing of the trailer; “trailer” is the trailer's centre of mass. "
    "They cover the second half of a run; where the condition says “whole run”, all of it.",
    "A run has failed if its verdict (docs/reference/verdict.md) is neither “followed” nor “no "
    "reference”; the latter, with nothing to follow, counts among those that followed. A run that "
    "broke off has no error or other number and counts as worse than any; one that came to its end "
    "counts with the error it had.",
    f"Of several seeds: the median with its {LEVEL:.0%} interval between two order statistics "
    "(of ten runs the second and the ninth), and the share that followed with its exact binomial "
    "interval. A single run has neither. Where all seeds gave the very same run, nothing in it is "
    "random, and it counts as a single one.",
    "Best is only what is significantly better than every other law of the row, by an exact "
    f"two-sided sign test, p ≤ {SIGNIFICANCE:g}, on pairs of runs with the same seed, so with the "
    "same world, push and noise. A run that followed beats one that did not; of two that followed "
    "the smaller error wins; two that did not are a tie and do not count. Of ten pairs that takes "
    "nine. Single runs show no difference. The test is made row by row: of many rows one may name "
    "its best by chance.",
    "“settled” is the time after which P stays within 10 mm; “effort” is ∫(ω_r² + ω_l²)dt. “∞” is "
    "any number of a run that broke off, and the time of one that never settled, where others have "
    "one; “–”: no run has one.",
    "Ranked by failures, then by the median error. Control time is wall time per sample, "
    "longer where several runs were made at once (--workers); of runs that shared a batch, each "
    "one's share of it.",
)


def write_leaderboard(board: Board, folder: Path, title: str) -> None:
    """leaderboard.md and .parquet, and summary.md, the first's head alone."""
    import pyarrow as pa

    write_text(folder / "leaderboard.md", to_markdown(board, title))
    write_text(folder / "summary.md", to_summary(board, title))
    rows = [_row(line) for line in board.lines]
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    write_parquet(pa.table(columns), folder / "leaderboard.parquet")


def _row(line: Line) -> dict[str, Any]:
    """A line of the Parquet file; null where undefined or infinite, as a single run's intervals."""
    row: dict[str, Any] = {axis: line.names[axis] for axis in AXES}
    for column in COLUMNS:
        found = line.statistic(column)
        for suffix in ("median", "low", "high", "worst"):
            value = None if found is None else getattr(found, suffix)
            name = column if suffix == "median" else f"{column} {suffix}"
            row[name] = None if value == float("inf") else value
    followed, single = share(line.followed, len(line.runs)), len(line.runs) == 1
    return row | {
        "scored": line.scored,
        "meant": line.meant,
        "best": line.best,
        "runs": len(line.runs),
        "repeats": len(line.repeats),
        "failures": len(line.failed),
        "lost": line.lost,
        "followed": followed.value,
        "followed low": None if single else followed.low,
        "followed high": None if single else followed.high,
        "verdict": line.verdict,
        "reason": "; ".join(sentences(line)),
        "command": line.command,
        "manifest": line.manifest,
    }


def sentences(line: Line) -> list[str]:
    """Of every run that failed, which and why."""
    return [f"seed {run.seed}: {run.sentence}" for run in line.failed]


def notes(line: Line) -> list[str]:
    """What is said of a line below its table: repeats, and runs that failed."""
    seeds = ", ".join(map(str, (line.runs[0].seed, *line.repeats)))
    same = f"seeds {seeds}: the very same run, which counts once"
    return [*([same] if line.repeats else []), *sentences(line)]


def status(board: Board) -> str:
    """How much of the suite was run, and by what."""
    made = "; ".join(f"{count} by {maker}" for maker, count in board.made_by.most_common())
    return f"{board.made_by.total()} of {board.rows} rows run: {made}."


def _cells(line: Line) -> list[str]:
    """A line of the detailed table, as HEAD has it."""
    found = {column: line.statistic(column) for column in COLUMNS}
    error = found.pop(RANKED_BY)
    worst = number(error.worst) if error and error.worst is not None else ""
    name = line.names["controller"] + ("" if line.meant else f" {NOT_MEANT}")
    first = f"**{amount(error)}**" if line.best else amount(error)
    return [name, first, worst, *map(amount, found.values()), followed_share(line), line.verdict]


def followed_share(line: Line) -> str:
    """How many followed; the interval only where a run more might say something else."""
    runs = len(line.runs)
    if runs == 1:
        return f"{line.followed}/1"
    _, low, high = (100.0 * number for number in share(line.followed, runs))
    return f"{line.followed}/{runs} ({low:.0f} to {high:.0f} %)"


def table(rows: list[list[str]]) -> str:
    """A Markdown table, the head first."""
    head, *body = (f"| {' | '.join(row)} |" for row in rows)
    return "\n".join([head, f"|{'---|' * len(rows[0])}", *body])


def to_markdown(board: Board, title: str) -> str:
    """Rules and overview, then each task with its numbers and the commands that repeat them."""
    parts = [to_summary(board, title)]
    for (task, condition), members in sections(board.lines).items():
        parts.append(f"## {task} · {condition}\n\n{table([HEAD, *map(_cells, members)])}\n")
        told = [
            f"- {x.names['controller']}, {in_markdown(text)}" for x in members for text in notes(x)
        ]
        parts += ["\n".join(told) + "\n"] if told else []
        commands = "\n".join(
            _one_line(f"{line.command}   # {line.manifest or ''}".rstrip()) for line in members
        )
        parts.append(f"```sh\n{commands}\n```\n")
    return "\n".join(parts)


def _one_line(command: str) -> str:
    """As part of a block of code, which it cannot end."""
    return printable(command).replace("\n", "\\n").replace("```", "\\`\\`\\`")


def to_summary(board: Board, title: str) -> str:
    """Rules and overview alone."""
    rules = "\n".join(f"- {rule}" for rule in RULES)
    parts = [
        f"# {in_markdown(title)}\n",
        f"{in_markdown(status(board))}\n",
        f"{rules}\n",
        f"{CAPTION}\n",
    ]
    told = failures(board.lines)
    for task, rows in overview(board.lines).items():
        parts.append(f"**{task}**\n\n{table(rows)}\n")
        if task in told:
            listed = "\n".join(f"- {in_markdown(text)}" for text in told[task])
            parts.append(f"Not followed, by laws made for it, each with its first:\n\n{listed}\n")
    return "\n".join(parts)
