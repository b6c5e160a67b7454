"""How much of a sweep's variance each parameter is said to explain."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ttwmr_mj.studies.sweep.answers.read import Sweep
from ttwmr_mj.studies.sweep.answers.slices import Slicing, explained

WORKS, IDLE = "initial.x_offset_m", "robot.hitch.damping_n_m_s_rad"
UNIFORM = {"distribution": "uniform", "low": 0.0, "high": 1.0}
METRIC = "tractor_rmse_m"
DRAWS, SEEDS = 8, 6


def sweep_of(design: str, trial: int, noise: float = 0.01) -> Sweep:
    """Runs whose error is the one parameter and some noise, whatever the other one is."""
    rng = np.random.default_rng([trial, *design.encode()])
    given: dict[str, Any] = {WORKS: UNIFORM | {"axis": 0}, IDLE: UNIFORM | {"axis": 1}}
    sets = None
    if design == "grid":  # values of its own of one axis, and for each seed one of the other
        values = np.linspace(0.0, 1.0, 9)
        given[WORKS] = {"values": values.tolist(), "axis": 0}
        draw, seed = np.divmod(np.arange(len(values) * 2 * SEEDS), 2 * SEEDS)
        works, idle = values[draw], rng.random(2 * SEEDS)[seed]
        error = works + 40 * noise * rng.normal(size=2 * SEEDS)[seed]
    else:
        if design == "sobol":
            sets = ["A", "B", "AB_0", "AB_1"]
            a, b = rng.random((2, DRAWS, 2))
            points = np.stack([a, b, np.c_[b[:, 0], a[:, 1]], np.c_[a[:, 0], b[:, 1]]], axis=1)
        else:
            points = rng.random((DRAWS, 1, 2))
        points = points.reshape(-1, 2)
        draw, seed = np.divmod(np.arange(len(points) * SEEDS), SEEDS)
        works, idle = points[draw].T
        error = works + noise * rng.normal(size=len(draw))
    return made(design, given, sets, draw, seed, works, idle, error)


def made(
    sampling: str,
    given: dict[str, Any],
    sets: list[str] | None,
    draw: np.ndarray,
    seed: np.ndarray,
    works: np.ndarray,
    idle: np.ndarray,
    error: np.ndarray,
) -> Sweep:
    """A sweep with these columns (n,), read back."""
    n = len(draw)
    plan = {
        "parameters": given,
        "variants": {},
        "base": {},
        "overrides": [],
        "seeds": [*range(SEEDS)],
        "draws": int(draw.max()) + 1,
        "sampling": sampling,
        "headline_metric": METRIC,
        "sensitivity_design": sets and {"sets": sets},
    }
    texts = {"verdict": np.full(n, "followed"), "status": np.full(n, "ok")}
    numbers = {"row": np.arange(n), "draw": draw, "seed": seed, WORKS: works, IDLE: idle}
    return Sweep(plan, numbers | texts | {METRIC: error, "variant": np.full(n, "")})


@pytest.mark.parametrize("design", ["random", "sobol", "grid"])
def test_runs_that_share_a_draw_make_no_parameter_telling(design: str) -> None:
    """Eight draws of one parameter may lie as the other's, 48 runs with them."""
    told = []
    for trial in range(100):
        sweep = sweep_of(design, trial)
        told.append([explained(sweep, Slicing.of(sweep, axis)) for axis in sweep.axes])
    works, idle = np.array(told).T
    # at most 5 % of 100, by a binomial test: more than 12 of them once in a thousand times
    assert np.count_nonzero(idle) <= 12
    assert np.median(works) > 0.3
    assert np.count_nonzero(works) > 60


def test_of_many_draws_with_one_run_each_it_is_epsilon_squared() -> None:
    rng, n = np.random.default_rng(3), 400
    works, idle = rng.random((2, n))
    error = works + 0.5 * rng.normal(size=n)
    given = sweep_of("random", 0).plan["parameters"]
    sweep = made("random", given, None, np.arange(n), np.zeros(n), works, idle, error)
    slicing = Slicing.of(sweep, sweep.axes[0])
    ranks, which = error.argsort().argsort() + 1.0, slicing.which(sweep)
    means = np.array([ranks[which == part].mean() for part in range(10)])
    within = ((ranks - means[which]) ** 2).sum() / (n - 10)
    expected = 1.0 - within / ranks.var(ddof=1)  # Kelley 1935
    assert explained(sweep, slicing) == pytest.approx(expected, rel=1e-12)
    assert 0.0 < expected < 1.0


def test_without_chance_a_parameter_explains_all_or_nothing() -> None:
    sweep = sweep_of("grid", 0, noise=0.0)
    shares = [explained(sweep, Slicing.of(sweep, axis)) for axis in sweep.axes]
    assert shares == pytest.approx([1.0, 0.0], abs=1e-12)


@pytest.mark.parametrize(
    ("sampling", "distribution", "draws", "design", "world", "free"),
    [
        ("grid", False, 4, 0, "kind", 12),  # every run but those of the other variant
        ("grid", True, 4, 0, "kind", 3),  # each seed draws
        ("grid", False, 4, 0, "unkind", 3),  # each seed draws a world
        ("random", True, 4, 0, "kind", 4),
        ("random", True, 4, 0, "unkind", 3),
        ("random", True, 2, 0, "unkind", 2),
        ("random", True, 1, 0, "kind", 3),  # at one place, seeds are all there is
        ("sobol", False, 4, 2, "kind", 2),  # two base samples with A and B of each
    ],
)
def test_what_shares_a_draw_counts_as_one_run(
    sampling: str, distribution: bool, draws: int, design: int, world: str, free: int
) -> None:
    """Two variants with three seeds of each draw."""
    draw, seed, variant = (a.ravel() for a in np.indices((draws, 3, 2)))
    plan = {
        "parameters": {WORKS: {"axis": 0, **({"distribution": "normal"} if distribution else {})}},
        "variants": {"a": [], "b": []},
        "base": {},
        "overrides": [f'world = "{world}"'],
        "seeds": [0, 1, 2],
        "draws": draws,
        "sampling": sampling,
        "sensitivity_design": {"sets": ["A", "B"]} if design else None,
    }
    sweep = Sweep(plan, {"draw": draw, "seed": seed, "variant": np.array(["a", "b"])[variant]})
    assert sweep.independent == free
    assert all(runs.independent == free for runs in sweep.variants.values())
    # wherever the world is named
    named: dict[str, dict[str, Any]] = {
        "base": {"base": {"world": world}},
        "variants": {"variants": {"a": [], "b": [f"world={world}"]}},
        "parameters": {
            "parameters": {**plan["parameters"], "world": {"axis": 1, "values": [world]}}
        },
    }
    for where in named.values():
        other = Sweep({**plan, "overrides": [], **where}, sweep.table)
        assert other.seeds_draw == sweep.seeds_draw
