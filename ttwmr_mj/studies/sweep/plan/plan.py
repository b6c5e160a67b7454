"""The plan of a sweep: which rows there are, and what each is, from its number alone.

Rows are counted with the seed innermost, around it the variants, around them the draws: the points
of a grid, its first parameter outermost, or the samples. Nothing here holds all rows.
"""

from __future__ import annotations

import copy
import hashlib
import json
import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ttwmr_mj.assets import scenarios_folder
from ttwmr_mj.scenario.file import check_scenario, put_value, set_value
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.sweep.plan import sampling
from ttwmr_mj.studies.sweep.plan.axes import Axis, Table
from ttwmr_mj.studies.sweep.plan.file import Sampling
from ttwmr_mj.studies.sweep.plan.parameters import Parameter, Value
from ttwmr_mj.studies.sweep.plan.sampling import IntArray
from ttwmr_mj.studies.sweep.plan.stored import FORMAT, StoredPlan, plain, restored

SHIPPED = ""  # in place of the folder of the shipped scenarios, which is elsewhere elsewhere


class Row(NamedTuple):
    """One run of a sweep."""

    row: int
    draw: int  # the grid's point or the sample: equal across variants and seeds
    variant: str  # "" if there are none
    seed: int
    values: dict[str, Value]  # parameter → its value


@dataclass(frozen=True)
class Plan:
    """Everything a sweep's rows follow from.

    Attributes:
        name: of the sweep.
        description: what it is for.
        scenario: that everything starts from, as it was named.
        base: what its file holds.
        folder: where files that it names are; "" for a shipped one.
        overrides: on every row.
        seeds: of the runs.
        sampling: how the axes are sampled.
        samples: how many; None for a grid.
        sampling_seed: of the samples.
        sensitivity: whether the samples are those that Sobol indices need.
        axes: what is varied.
        variants: name → overrides; empty if there are none.
        metric: what the report is about.
        timeout_s: wall time for each run of a chunk.
        made_of: what else decides about results: code, libraries, data files.
    """

    name: str
    description: str
    scenario: str
    base: Table
    folder: str
    overrides: tuple[str, ...]
    seeds: tuple[int, ...]
    sampling: Sampling
    samples: int | None
    sampling_seed: int
    sensitivity: bool
    axes: tuple[Axis, ...]
    variants: dict[str, tuple[str, ...]]
    metric: str = ""
    timeout_s: float = 300.0
    made_of: Table = field(default_factory=dict)

    @cached_property
    def draws(self) -> int:
        """Points of the grid, or samples."""
        if self.samples is not None:
            return self.samples * (len(self.axes) + 2 if self.sensitivity else 1)
        return math.prod(self._grid)

    @cached_property
    def rows(self) -> int:
        """How many runs there are."""
        return self.draws * len(self.variant_names) * len(self.seeds)

    @cached_property
    def variant_names(self) -> tuple[str, ...]:
        """The variants; a nameless one if there are none."""
        return tuple(self.variants) or ("",)

    @cached_property
    def parameters(self) -> dict[str, Parameter]:
        """Key → what it may be, of all axes."""
        return {key: p for axis in self.axes for key, p in axis.parameters.items()}

    @cached_property
    def _grid(self) -> tuple[int, ...]:
        """How many places each axis has in the grid: one, if it is drawn for each seed."""
        return tuple(1 if axis.drawn else axis.count or 1 for axis in self.axes)

    def numbers(self, rows: IntArray) -> tuple[IntArray, IntArray, IntArray]:
        """Draw, place among the variants and place among the seeds of these rows."""
        outer, seed = np.divmod(rows, len(self.seeds))
        draw, variant = np.divmod(outer, len(self.variant_names))
        return draw, variant, seed

    def row_of(self, draw: IntArray, variant: IntArray, seed: IntArray) -> IntArray:
        """The inverse of `numbers`."""
        return np.asarray((draw * len(self.variant_names) + variant) * len(self.seeds) + seed)

    def rows_at(self, rows: IntArray) -> list[Row]:
        """What these rows are."""
        draw, variant, seed = self.numbers(rows)
        seeds = [self.seeds[i] for i in seed.tolist()]
        columns: dict[str, list[Value]] = {}
        for k, axis in enumerate(self.axes):
            columns |= self._axis_values(k, axis, draw, seeds)
        names = [self.variant_names[i] for i in variant.tolist()]
        cells = zip(*columns.values(), strict=True) if columns else ((),) * len(rows)
        return [
            Row(row, place, name, number, dict(zip(columns, cell, strict=True)))
            for row, place, name, number, cell in zip(
                rows.tolist(), draw.tolist(), names, seeds, cells, strict=True
            )
        ]

    def _axis_values(
        self, k: int, axis: Axis, draw: IntArray, seeds: list[int]
    ) -> dict[str, list[Value]]:
        if self.sampling == "grid" and not axis.drawn:
            index = (draw // math.prod(self._grid[k + 1 :])) % self._grid[k]
            return {
                key: [(p.values or ())[i] for i in index.tolist()]
                for key, p in axis.parameters.items()
            }
        if self.sampling == "grid":
            drawn = {s: sampling.unit_of_seed(self.sampling_seed, s, axis.name) for s in set(seeds)}
            unit = np.array([drawn[seed] for seed in seeds])
        else:
            unit = self._units(draw)[:, k]
        return {key: p.of_unit(unit) for key, p in axis.parameters.items()}

    def _units(self, draw: IntArray) -> Any:
        seed, axes = self.sampling_seed, len(self.axes)
        match self.sampling:
            case "random":
                return sampling.random_units(seed, tuple(axis.name for axis in self.axes), draw)
            case "latin_hypercube":
                return sampling.latin_units(seed, axes, self.draws, draw)
        if self.sensitivity:
            return sampling.saltelli_units(seed, axes, draw)
        return sampling.sobol_units(seed, axes, draw)

    def data_of(self, row: Row) -> Table:
        """The scenario of a row as plain data, not checked.

        Raises:
            InputError: an override or a parameter runs through something that is no table.
        """
        data = copy.deepcopy(self.base)
        for override in (*self.overrides, *self.variants.get(row.variant, ())):
            set_value(data, override)
        for key, value in row.values.items():
            put_value(data, key.split("."), value, key)
        data["seed"] = row.seed
        return data

    def scenario_of(self, row: Row, checked: bool = False) -> Scenario:
        """The resolved scenario of a row.

        Args:
            row: which.
            checked: whether it is known to be sound.

        Raises:
            InputError: it is not; with every fault.
        """
        data = self.data_of(row)
        if checked:
            return Scenario.model_validate(data, context={"folder": self.beside})
        return check_scenario(data, f"row {row.row}", self.beside)

    @cached_property
    def beside(self) -> Path:
        """The folder of the scenario."""
        return scenarios_folder() if self.folder == SHIPPED else Path(self.folder)

    @cached_property
    def identity(self) -> Table:
        """All that decides about results, as plain data."""
        return {
            "base": plain(self.base),
            "overrides": list(self.overrides),
            "seeds": list(self.seeds),
            "sampling": self.sampling,
            "samples": self.samples,
            "sampling_seed": self.sampling_seed,
            "sensitivity": self.sensitivity,
            "parameters": self._parameter_tables(),
            "variants": {name: list(given) for name, given in self.variants.items()},
            "made_of": self.made_of,
        }

    @cached_property
    def digest(self) -> str:
        """Of its identity: two plans with the same have the same results."""
        text = json.dumps(self.identity, sort_keys=True, allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def has_rows_of(self, other: Plan) -> bool:
        """Whether both have the same rows, whatever these are made of."""
        return replace(other, made_of=self.made_of).digest == self.digest

    def _parameter_tables(self) -> Table:
        tables = {}
        for k, axis in enumerate(self.axes):
            for key, parameter in axis.parameters.items():
                given = parameter.model_dump(by_alias=True, exclude_unset=True)
                tables[key] = {"kind": parameter.kind, "axis": k, **given}
        return tables

    def to_json(self) -> Table:
        """plan.json."""
        return {
            "format": FORMAT,
            "name": self.name,
            "description": self.description,
            "scenario": self.scenario,
            "folder": self.folder,
            **self.identity,
            "headline_metric": self.metric,
            "timeout_s": self.timeout_s,
            "sensitivity_design": self._design(),
            "draws": self.draws,
            "rows": self.rows,
            "digest": self.digest,
        }

    def _design(self) -> Table | None:
        """Which draws are which set of the design for Sobol indices."""
        if not self.sensitivity:
            return None
        sets = ["A", "B", *(f"AB_{i}" for i in range(len(self.axes)))]
        return {
            "base_samples": self.samples,
            "axes": [list(axis.parameters) for axis in self.axes],
            "sets": sets,
            "rule": "draw = len(sets) * sample + place of the set; AB_i is A with axis i from B",
        }

    @classmethod
    def from_json(cls, data: Table) -> Plan:
        """The plan that a plan.json tells of.

        Raises:
            InputError: it was written by another version, or is none.
        """
        stored = StoredPlan.of(data)
        return cls(
            name=stored.name,
            description=stored.description,
            scenario=stored.scenario,
            base=restored(stored.base),
            folder=stored.folder,
            overrides=tuple(stored.overrides),
            seeds=tuple(stored.seeds),
            sampling=stored.sampling,
            samples=stored.samples,
            sampling_seed=stored.sampling_seed,
            sensitivity=stored.sensitivity,
            axes=stored.axes,
            variants={name: tuple(given) for name, given in stored.variants.items()},
            metric=stored.headline_metric,
            timeout_s=stored.timeout_s,
            made_of=stored.made_of,
        )
