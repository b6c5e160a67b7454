"""Lines of the leaderboard: a controller on a task, its numbers over all seeds, and their ranks."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

from ttwmr_mj.results.accept import VerdictName
from ttwmr_mj.results.metrics import Metrics
from ttwmr_mj.results.verdict import SUCCESSES, VERDICTS
from ttwmr_mj.studies.bench.evidence import Outcome, Statistic, better
from ttwmr_mj.studies.bench.suite import AXES


class Column(NamedTuple):
    """A number of the leaderboard."""

    metrics: tuple[str, ...]  # the first that is defined counts
    scale: float = 1.0
    of_part: bool = False  # covers what the row is scored by: the second half, or the whole run
    endless: bool = False  # where a finished run has none, it counts as larger than any number

    def of(self, numbers: Metrics, scored: str) -> float | None:
        """Its value in a run; None where undefined."""
        prefix = "steady_" if self.of_part and scored == "steady" else ""
        found = (numbers.get(prefix + name) for name in self.metrics)
        return next((value for value in found if value is not None), None)


TIME = "control, µs"
_error = partial(Column, scale=1e3, of_part=True, endless=True)
COLUMNS = {
    "error, mm": _error(("centre_of_oscillation_rmse_m", "tractor_rmse_m")),
    "P rms, mm": _error(("tractor_rmse_m",)),
    "trailer rms, mm": _error(("trailer_rmse_m",)),
    "P largest, mm": _error(("tractor_max_error_m",)),
    "settled, s": Column(("settling_time_s",), endless=True),
    "effort, rad²/s": Column(("control_effort",)),
    "saturated, %": Column(("saturated_share",), 100.0),
    "blind, %": Column(("blind_share",), 100.0),
    TIME: Column(("control_time_per_sample_us",)),
}
RANKED_BY = "error, mm"


@dataclass(frozen=True, slots=True)
class Run:
    """One run, scored.

    Attributes:
        seed: of it.
        verdict: the name.
        sentence: the verdict with what decided, or why it broke off.
        finished: whether it came to its end.
        values: column → number; None where undefined.
    """

    seed: int
    verdict: VerdictName
    sentence: str
    finished: bool
    values: dict[str, float | None]

    @property
    def followed(self) -> bool:
        """Whether it is no failure."""
        return self.verdict in SUCCESSES

    def repeats(self, other: Run) -> bool:
        """Whether all that is known of both is the same, but for the time that the law took."""
        mine, theirs = ({**run.values, TIME: None} for run in (self, other))
        return (self.verdict, self.sentence, mine) == (other.verdict, other.sentence, theirs)

    @property
    def outcome(self) -> Outcome:
        """As laws are compared."""
        error = self.values[RANKED_BY]
        return Outcome(self.followed, math.inf if error is None else error)


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the leaderboard: a controller on a task, all seeds together.

    Attributes:
        names: axis → name.
        runs: by seed, in the suite's order, each once.
        repeats: seeds whose runs are the first's, bit for bit, and are not counted.
        scored: what errors cover, "steady" or "whole".
        meant: the law is made for the task.
        command: runs its first seed again.
        manifest: of its first seed, relative to the leaderboard; None if that never started.
        recordings: of those runs that have one, relative to the leaderboard.
        best: significantly better than every other law of its row, of which there are some.
    """

    names: dict[str, str]
    runs: tuple[Run, ...]
    scored: str
    meant: bool
    command: str
    manifest: str | None
    recordings: tuple[str, ...] = ()
    best: bool = False
    repeats: tuple[int, ...] = ()

    @property
    def row(self) -> tuple[str, ...]:
        """Lines of one are compared: all names but the law's, and what errors cover."""
        return (*(self.names[axis] for axis in AXES[1:]), self.scored)

    @property
    def alike(self) -> bool:
        """Whether seeds make no difference that can be seen."""
        return all(run.repeats(self.runs[0]) for run in self.runs)

    @property
    def outcomes(self) -> dict[int, Outcome]:
        """Of every seed, repeats included."""
        repeats = dict.fromkeys(self.repeats, self.runs[0].outcome)
        return repeats | {run.seed: run.outcome for run in self.runs}

    @property
    def followed(self) -> int:
        """How many runs did not fail."""
        return sum(run.followed for run in self.runs)

    @property
    def failed(self) -> tuple[Run, ...]:
        """Runs that did not follow."""
        return tuple(run for run in self.runs if not run.followed)

    @property
    def lost(self) -> int:
        """How many of those came to their end."""
        return sum(run.finished for run in self.failed)

    @property
    def verdict(self) -> str:
        """In words; with counts where runs differ."""
        found = Counter(run.verdict for run in self.runs).most_common()
        counted = [(VERDICTS[name][0], count) for name, count in found]
        if len(counted) == 1:
            return counted[0][0]
        return "; ".join(f"{count} {words}" for words, count in counted)

    def statistic(self, column: str) -> Statistic | None:
        """A column over all runs, of which one that broke off counts as larger than any number.

        None where no run has a number.
        """
        how = COLUMNS[column]
        numbers = [run.values[column] for run in self.runs]
        if all(number is None for number in numbers):
            return None
        endless = [how.endless or not run.finished for run in self.runs]
        filled = [math.inf if x is None and e else x for x, e in zip(numbers, endless, strict=True)]
        return Statistic.of([x for x in filled if x is not None], how.scale)


def ranked(lines: Iterable[Line], order: dict[str, list[str]]) -> list[Line]:
    """Lines as a leaderboard lists them, the best marked.

    Args:
        lines: in any order.
        order: axis → names, as the suite has them.
    """
    inorder = sorted(lines, key=lambda line: _rank(line, order))
    groups: dict[tuple[str, ...], list[Line]] = defaultdict(list)
    for line in inorder:
        groups[line.row].append(line)
    return [replace(x, best=_is_best(x, group)) for group in groups.values() for x in group]


def without_repeats(line: Line) -> Line:
    """The line with one run alone, if all of its runs came to their end and are the same one.

    Runs that broke off have no numbers that could show it.
    """
    first, *others = line.runs
    if not (line.alike and first.finished):
        return line
    return replace(line, runs=(first,), repeats=tuple(run.seed for run in others))


def _is_best(line: Line, group: list[Line]) -> bool:
    """Whether it is significantly better than every other one, of which there are some."""
    others = [other for other in group if other != line]
    return bool(others) and all(_is_better(line, other) for other in others)


def _is_better(line: Line, other: Line) -> bool:
    """Whether it is significantly better; where seeds decide about neither, they are one pair."""
    if line.alike and other.alike:
        return better({0: line.runs[0].outcome}, {0: other.runs[0].outcome})
    return better(line.outcomes, other.outcomes)


def _rank(line: Line, order: dict[str, list[str]]) -> tuple[Any, ...]:
    """Tasks and their conditions as the suite has them; failures, then errors within a row."""
    place = {axis: order[axis].index(name) for axis, name in line.names.items()}
    where = (place["task"], place["sensing"], place["plant"], place["disturbance"], line.scored)
    error = line.statistic(RANKED_BY)
    failed = len(line.failed) / len(line.runs)
    return (*where, failed, math.inf if error is None else error.median, place["controller"])
