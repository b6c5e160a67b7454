"""What a sweep's results say, in numbers; nothing here draws or words anything."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ttwmr_mj.results.sensitivity import Indices, sobol_indices
from ttwmr_mj.results.statistics import Interval, Paired, paired, quantile
from ttwmr_mj.results.verdict import VERDICTS
from ttwmr_mj.studies.sweep.answers.read import Sweep
from ttwmr_mj.studies.sweep.answers.slices import OUTER, Group, Slicing, explained, groups

SEED = 20170401  # of the bootstraps: the same table gives the same report
MOST_MAPS = 3  # parameters whose pairs are mapped
MAP_BINS = 7
ALL_PAIRS = 4  # variants up to which each is compared with each; more: with the first


@dataclass(frozen=True)
class Along:
    """What happens along one parameter: variant → its groups, part by part."""

    slicing: Slicing
    explained: float
    groups: dict[str, list[Group]]


@dataclass(frozen=True)
class Map:
    """Two parameters at once: variant → (rows of the second, columns of the first) of groups."""

    across: Slicing
    up: Slicing
    groups: dict[str, np.ndarray]


@dataclass(frozen=True)
class Pair:
    """One variant against another: who, and what came of it."""

    ours: str
    theirs: str
    found: Paired


@dataclass(frozen=True)
class Sensitivity:
    """Sobol indices of one number in one variant.

    Attributes:
        variant: which.
        of: "failed" (0 or 1), "headline", or "rank" of the headline where not all runs finished.
        samples: base samples of the design.
        indices: one for each axis; None if the number never varies.
    """

    variant: str
    of: str
    samples: int
    indices: list[Indices] | None


@dataclass(frozen=True)
class Findings:
    """All of it.

    Attributes:
        whole: all runs together.
        verdicts: variant → verdict → runs, in the order of `VERDICTS` from the end.
        variants: variant → its runs together.
        metrics: variant → metric → its lower, middle and upper quantile.
        along: one for each axis.
        maps: of the axes that explain most.
        sensitivity: empty if the plan is no design for it.
        pairs: empty if there is one variant.
    """

    whole: Group
    verdicts: dict[str, dict[str, int]]
    variants: dict[str, Group]
    metrics: dict[str, dict[str, tuple[Interval, Interval, Interval]]]
    along: list[Along]
    maps: list[Map]
    sensitivity: list[Sensitivity]
    pairs: list[Pair]


def find(sweep: Sweep) -> Findings:
    """Everything that the report tells."""
    along = [_along(sweep, Slicing.of(sweep, axis)) for axis in sweep.axes]
    return Findings(
        whole=Group.of(sweep, sweep.headline),
        verdicts={name: _verdicts(runs) for name, runs in sweep.variants.items()},
        variants={n: Group.of(runs, sweep.headline) for n, runs in sweep.variants.items()},
        metrics={name: _metrics(sweep, runs) for name, runs in sweep.variants.items()},
        along=along,
        maps=_maps(sweep, along),
        sensitivity=list(_sensitivity(sweep, np.random.default_rng(SEED))),
        pairs=_pairs(sweep),
    )


def _verdicts(runs: Sweep) -> dict[str, int]:
    counts = Counter(runs.table["verdict"].tolist())
    known = [name for name in reversed(VERDICTS) if name in counts]
    return {name: counts[name] for name in [*known, *sorted(counts.keys() - set(known))]}


def _metrics(sweep: Sweep, runs: Sweep) -> dict[str, tuple[Interval, Interval, Interval]]:
    def quantiles(values: np.ndarray) -> tuple[Interval, Interval, Interval]:
        low, middle, high = (
            quantile(values, at, independent=runs.independent) for at in (OUTER[0], 0.5, OUTER[1])
        )
        return low, middle, high

    return {name: quantiles(runs.numbers(name)) for name in sweep.metrics}


def _along(sweep: Sweep, slicing: Slicing) -> Along:
    found = {
        name: groups(runs, [slicing], sweep.headline).tolist()
        for name, runs in sweep.variants.items()
    }
    return Along(slicing, explained(sweep, slicing), found)


def _maps(sweep: Sweep, along: list[Along]) -> list[Map]:
    """Each pair of the parameters that explain most, in the plan's order."""
    most = sorted(along, key=lambda a: -a.explained)[:MOST_MAPS]
    chosen = [a.slicing.axis for a in along if a in most]
    cut = [Slicing.of(sweep, axis, MAP_BINS) for axis in chosen]
    return [
        Map(
            across,
            up,
            {
                name: groups(runs, [up, across], sweep.headline)
                for name, runs in sweep.variants.items()
            },
        )
        for across, up in combinations(cut, 2)
    ]


def _pairs(sweep: Sweep) -> list[Pair]:
    names = list(sweep.variants)
    chosen = list(combinations(names, 2))
    if len(names) > ALL_PAIRS:
        chosen = [(names[0], name) for name in names[1:]]
    return [Pair(ours, theirs, _paired(sweep, ours, theirs)) for theirs, ours in chosen]


def _paired(sweep: Sweep, ours: str, theirs: str) -> Paired:
    """Of two variants, on the draws and seeds that both have; one without repeats has any seed."""
    pair = [sweep.variants[name] for name in (ours, theirs)]
    keys = [np.array([r.table["draw"], r.table["seed"]], dtype=np.int64).T for r in pair]
    places = [{tuple(key): i for i, key in enumerate(each.tolist())} for each in keys]
    if sweep.seeds[ours] != sweep.seeds[theirs]:
        few = int(sweep.seeds[ours] > sweep.seeds[theirs])
        of_draw = {draw: i for (draw, _), i in places[few].items()}
        places[few] = {key: of_draw[key[0]] for key in places[1 - few] if key[0] in of_draw}
    shared = [key for key in places[0] if key in places[1]]
    one, other = (
        runs.where(np.array([at[key] for key in shared], dtype=int))
        for runs, at in zip(pair, places, strict=True)
    )
    values = [
        runs.numbers(sweep.headline) if sweep.headline else np.full(len(runs), np.inf)
        for runs in (one, other)
    ]
    failed, free = (one.failed, other.failed), min(one.independent, other.independent)
    return paired(values[0], values[1], failed, independent=free)


def _sensitivity(sweep: Sweep, rng: np.random.Generator) -> list[Sensitivity]:
    """Of every variant: of who failed, and of the headline metric."""
    if sweep.design is None:
        return []
    found = []
    for name, runs in sweep.variants.items():
        kinds = {"failed": runs.failed.astype(float)}
        if sweep.headline and runs.has(sweep.headline):
            values = runs.numbers(sweep.headline)
            whole = bool(np.isfinite(values).all())
            kinds["headline" if whole else "rank"] = values if whole else _ranks(values)
        for kind, numbers in kinds.items():
            sets = _by_set(runs, numbers, len(sweep.axes))
            indices = sobol_indices(sets[0], sets[1], sets[2:], rng)
            found.append(Sensitivity(name, kind, sets.shape[1], indices))
    return found


def _ranks(values: np.ndarray) -> np.ndarray:
    from scipy.stats import rankdata

    return np.asarray(rankdata(values))


def _by_set(runs: Sweep, numbers: np.ndarray, axes: int) -> np.ndarray:
    """(2 + axes, samples) mean over seeds of a number, of the samples whose sets are all there."""
    assert runs.design is not None
    sample, which = runs.design
    shape = (2 + axes, int(sample.max()) + 1)
    sums, counts = np.zeros(shape), np.zeros(shape)
    np.add.at(sums, (which, sample), numbers)
    np.add.at(counts, (which, sample), 1.0)
    whole = (counts > 0).all(axis=0)
    return np.asarray(sums[:, whole] / counts[:, whole])
