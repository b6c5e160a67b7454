"""Sweep folders that look like real ones, without running anything."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ttwmr_mj.results.metrics import METRICS

FRICTION = "robot.hitch.coulomb_friction_n_m"
RATE = "reference.angular_rate_rad_s"
MASS = "belief.robot.trailer.mass_kg"
HEADLINE = "steady_centre_of_oscillation_rmse_m"


def drawn_sweep(
    folder: Path,
    parameters: dict[str, dict[str, Any]],
    *,
    variants: tuple[str, ...] = (),
    seeds: int = 1,
    samples: int | None = None,
    sensitivity: bool = False,
    break_off: float = 0.3,
    lost_above: float = 1.0,
    headline: str = HEADLINE,
) -> dict[str, list[Any]]:
    """Write plan.json and results.parquet; returns the table's columns.

    A run's load is the sum of its parameters' places in their ranges (0 to 1 each), per parameter;
    its error grows with it. Above `lost_above` it is lost, some of those diverge.
    """
    rng = np.random.default_rng(5)
    axes = list(parameters)
    if samples is None:
        points = list(itertools.product(*(given["values"] for given in parameters.values())))
    else:
        points = _sampled(parameters, samples, sensitivity, rng)
    columns: dict[str, list[Any]] = {}
    names = variants or ("",)
    rows = itertools.product(enumerate(points), enumerate(names), range(seeds))
    for row, ((draw, point), (place, variant), seed) in enumerate(rows):
        load = _load(parameters, point) + 0.15 * place
        load += 0.1 * np.random.default_rng([draw, seed]).normal()  # shared by variants
        record = {"row": row, "draw": draw, "variant": variant, "seed": seed}
        record |= dict(zip(axes, point, strict=True))
        columns_of = _result(load, lost_above, rng.random() < break_off)
        for key, value in {**record, **columns_of}.items():
            columns.setdefault(key, []).append(value)
    folder.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table(columns), folder / "results.parquet")
    sets = ["A", "B", *(f"AB_{i}" for i in range(len(axes)))]
    plan = {
        "format": 1, "name": "drawn", "description": "What is not a run.", "scenario": "lab_circle",
        "folder": "", "base": {}, "made_of": {},
        "overrides": ["duration_s=20.0"], "draws": draw + 1, "seeds": list(range(seeds)),
        "sampling": "grid" if samples is None else "sobol" if sensitivity else "random",
        "samples": samples, "sampling_seed": 0, "sensitivity": sensitivity,
        "parameters": {p: {"axis": axes.index(p), "kind": "x", **parameters[p]} for p in axes},
        "variants": {name: [f"controller.kind={name}"] for name in variants},
        "headline_metric": headline, "timeout_s": 300.0, "rows": row + 1,
        "digest": "0123456789abcdef",
        "sensitivity_design": {"base_samples": samples, "sets": sets} if sensitivity else None,
    }  # fmt: skip
    (folder / "plan.json").write_text(json.dumps(plan))
    return columns


def _sampled(
    parameters: dict[str, dict[str, Any]], samples: int, sensitivity: bool, rng: np.random.Generator
) -> list[list[Any]]:
    count = len(parameters)
    a, b = rng.random((2, samples, count))
    points = []
    for one, other in zip(a, b, strict=True):
        mixed = [np.where(np.arange(count) == i, other, one) for i in range(count)]
        points += [one, other, *mixed] if sensitivity else [one]
    return [
        [_of_unit(given, u) for given, u in zip(parameters.values(), point, strict=True)]
        for point in points
    ]


def _of_unit(given: dict[str, Any], unit: float) -> Any:
    if "values" in given:
        return given["values"][int(unit * len(given["values"]))]
    low, high = given["low"], given["high"]
    if given.get("distribution") == "log_uniform":
        return float(low * (high / low) ** unit)
    return float(low + (high - low) * unit)


def _load(parameters: dict[str, dict[str, Any]], point: Any) -> float:
    """Mean over the parameters, the first of which counts double."""
    places = []
    for given, value in zip(parameters.values(), point, strict=True):
        if "values" in given:
            places.append(given["values"].index(value) / max(1, len(given["values"]) - 1))
        else:
            low, high = given["low"], given["high"]
            places.append((value - low) / (high - low))
    return float(np.average(places, weights=[2.0, *[1.0] * (len(places) - 1)])) if places else 0.5


def _result(load: float, lost_above: float, breaks: bool) -> dict[str, Any]:
    lost = load > lost_above
    broke = lost and breaks
    verdict = "diverged" if broke else "lost" if lost else "followed"
    off = f"P {1e3 * load:.3g} mm off in the last fifth of the run (limit 10 mm)"
    reason = off if lost else ""
    numbers: dict[str, float | None] = {}
    for i, name in enumerate(METRICS):
        value = 1e-3 * (1.0 + 0.1 * i) * np.exp(3.0 * load)
        numbers[name] = value if name != "estimator_theta2_rmse_rad" else None
    numbers["settling_time_s"] = None if lost else 4.0 + load
    return {
        "status": "diverged" if broke else "ok", "verdict": verdict, "reason": reason, **numbers,
        "scenario_digest": "ab12", "version_ttwmr_mj": "0.1.0", "version_mujoco": "4.0.0",
    }  # fmt: skip
