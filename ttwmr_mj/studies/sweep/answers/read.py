"""A sweep's folder, read back: the plan, and the table of results by columns."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ttwmr_mj.files import read_json
from ttwmr_mj.results.metrics import METRICS
from ttwmr_mj.results.parquet import read_parquet
from ttwmr_mj.results.verdict import SUCCESSES
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.sweep.plan.plan import Plan

BoolArray = np.ndarray


@dataclass(frozen=True)
class Sweep:
    """Runs of one sweep: all, or some of them.

    Attributes:
        plan: plan.json.
        table: column of results.parquet → (n,) its values; numbers that are null are NaN.
        undefined: metric → variants whose plant or task does not have it.
    """

    plan: dict[str, Any]
    table: dict[str, np.ndarray]
    undefined: Mapping[str, frozenset[str]] = field(default_factory=dict)

    @classmethod
    def read(cls, folder: Path) -> Sweep:
        """What a sweep left in its folder."""
        plan = read_json(folder / "plan.json")
        read = read_parquet(folder / "results.parquet")
        table = {name: read[name].to_numpy() for name in read.column_names}
        return cls(plan, table, _undefined(table))

    @cached_property
    def planned(self) -> Plan:
        """The plan as the sweep's own code has it."""
        return Plan.from_json(self.plan)

    def __len__(self) -> int:
        return len(self.table["row"])

    def where(self, rows: BoolArray) -> Sweep:
        """These rows (n,) alone."""
        return replace(self, table={name: values[rows] for name, values in self.table.items()})

    def without_repeats(self) -> Sweep:
        """Of variants in which no seed changes anything, the runs of the first seed alone.

        Intervals count runs; the same run counted twice would make them too narrow.
        """
        quiet = [name for name, runs in self.variants.items() if runs._seeds_repeat()]
        repeats = np.isin(self.table["variant"].astype(str), quiet)
        return self.where(~repeats | (self.table["seed"] == self.plan["seeds"][0]))

    def _seeds_repeat(self) -> bool:
        """Whether every seed gave the very same runs; runs without any number do not show it.

        Where seeds draw parameters they are runs of their own, though nothing comes of it.
        """
        if self.seeds_draw:
            return False
        first, *others = (self.where(self.table["seed"] == seed) for seed in self.plan["seeds"])
        numbers = first._outcomes()
        repeats = (np.array_equal(numbers, seed._outcomes(), equal_nan=True) for seed in others)
        return bool(others) and bool(np.isfinite(numbers).any()) and all(repeats)

    def _outcomes(self) -> FloatArray:
        """(metrics, n) of the runs in the order of draws."""
        order = np.argsort(self.table["draw"], kind="stable")
        named = [name for name in ("end_time_s", *METRICS) if name in self.table]
        return np.array([self.table[name].astype(float)[order] for name in named])

    @cached_property
    def failed(self) -> BoolArray:
        """(n,) whether the verdict is a failure; a run that broke off has one that is."""
        return ~np.isin(self.table["verdict"].astype(str), SUCCESSES)

    @cached_property
    def finished(self) -> BoolArray:
        """(n,) whether the run came to its end, lost or not."""
        return np.asarray(self.table["status"].astype(str) == "ok")

    def numbers(self, metric: str) -> FloatArray:
        """(n,) a metric; infinite where a run broke off or never got it, "worse than any".

        NaN where it is undefined.
        """
        values = self.table[metric].astype(float)
        there = np.where(self.finished & np.isfinite(values), values, np.inf)
        without = list(self.undefined.get(metric, ()))
        return np.where(np.isin(self.table["variant"].astype(str), without), np.nan, there)

    def has(self, metric: str) -> bool:
        """Whether it is defined for these runs, if only as worse than any."""
        return not np.isnan(self.numbers(metric)).all()

    @cached_property
    def metrics(self) -> list[str]:
        """Metrics that at least one finished run has; the others are undefined."""
        there = (name for name in METRICS if name in self.table)
        return [name for name in there if np.isfinite(self.numbers(name)).any()]

    @cached_property
    def headline(self) -> str:
        """The metric that the report is about; empty if it is undefined in every run."""
        name = str(self.plan["headline_metric"])
        return name if name in self.metrics else ""

    @cached_property
    def variants(self) -> dict[str, Sweep]:
        """Variant → its rows; in the plan's order."""
        names = list(self.plan["variants"]) or [""]
        given = self.table["variant"].astype(str)
        return {name: self.where(given == name) for name in names}

    @cached_property
    def seeds(self) -> dict[str, int]:
        """Variant → how many seeds it has runs of."""
        return {name: len(np.unique(runs.table["seed"])) for name, runs in self.variants.items()}

    @cached_property
    def axes(self) -> list[Axis]:
        """What is varied, in the plan's order."""
        axes: dict[int, list[str]] = {}
        for path, given in self.plan["parameters"].items():
            axes.setdefault(given["axis"], []).append(path)
        return [Axis(paths, self.plan["parameters"][paths[0]]) for paths in axes.values()]

    @cached_property
    def design(self) -> tuple[np.ndarray, np.ndarray] | None:
        """For Sobol indices (n,): which base sample a row is of, and which set: A, B, AB_0, ….

        None if the plan has no such design.
        """
        if (design := self.plan["sensitivity_design"]) is None:
            return None
        sample, which = np.divmod(self.table["draw"].astype(int), len(design["sets"]))
        return sample, which

    @cached_property
    def seeds_draw(self) -> bool:
        """Whether each seed draws: a world, or on a grid the values of some parameter."""
        drawn = any("distribution" in axis.given for axis in self.axes)
        return (drawn and self.plan["sampling"] == "grid") or self._has_drawn_worlds()

    def _has_drawn_worlds(self) -> bool:
        sets = [*self.plan["overrides"], *itertools.chain(*self.plan["variants"].values())]
        sets += [
            f"world={value}" for value in self.plan["parameters"].get("world", {}).get("values", ())
        ]
        given = {"".join(text.split()).replace('"', "").replace("'", "") for text in sets}
        return "world=unkind" in given or self.plan["base"].get("world") == "unkind"

    @cached_property
    def independent(self) -> int:
        """How many of the runs share nothing that was drawn with each other, but for noise."""
        draw, seed = (self.table[name].astype(int) for name in ("draw", "seed"))
        pairs = len({*zip(draw.tolist(), seed.tolist(), strict=True)})  # variants share them
        sources = [pairs]
        if self.design is not None:
            sources.append(len(np.unique(self.design[0])))
        elif self.plan["sampling"] != "grid" and self.plan["draws"] > 1:
            sources.append(len(np.unique(draw)))
        if self.seeds_draw and len(self.plan["seeds"]) > 1:
            sources.append(len(np.unique(seed)))
        return min(sources)

    def sources(self, axis: Axis) -> np.ndarray:
        """(n,) which draw each run has an axis' value of; runs of the same one are no two words."""
        if self.design is not None:
            sample, which = self.design
            from_b = (which == 1) | (which - 2 == self.axes.index(axis))
            return np.asarray(2 * sample + from_b)
        if self.plan["sampling"] != "grid":
            return self.table["draw"]
        # of a grid's own values each row is one, as all the others are spread over them evenly
        return self.table["seed" if "distribution" in axis.given else "row"]


def _undefined(table: dict[str, np.ndarray]) -> dict[str, frozenset[str]]:
    """Metric → variants of which no finished run has it, but for what a run may never reach.

    What a plant does not have, as the analytic ones no slip, is no failure of its runs.
    """
    variant, finished = table["variant"].astype(str), table["status"].astype(str) == "ok"
    return {
        name: frozenset(variant[finished])
        - set(variant[finished & np.isfinite(table[name].astype(float))])
        for name, metric in METRICS.items()
        if name in table and not metric.may_never_come
    }


@dataclass(frozen=True)
class Axis:
    """Parameters that vary together, as one; shown by the first of them.

    Attributes:
        paths: of the parameters, in the scenario.
        given: of the first, as plan.json has it.
    """

    paths: list[str]
    given: dict[str, Any]

    @property
    def path(self) -> str:
        """Of the first parameter."""
        return self.paths[0]

    @property
    def logarithmic(self) -> bool:
        """Whether equal ratios are equal steps."""
        return "log" in (self.given.get("spacing"), str(self.given.get("distribution"))[:3])
