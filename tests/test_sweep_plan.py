"""Plans: every row follows from its number, and samples are what their distribution says."""

from __future__ import annotations

import itertools
import json
import math
import re
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.stats

from sweeps import SMALL, plan_of
from ttwmr_mj.errors import InputError
from ttwmr_mj.studies.sweep.folder.plan_file import changes
from ttwmr_mj.studies.sweep.plan.file import shipped_sweeps
from ttwmr_mj.studies.sweep.plan.parameters import Parameter, Value, parameter_of
from ttwmr_mj.studies.sweep.plan.plan import Plan
from ttwmr_mj.studies.sweep.plan.stored import plain, restored

HEAD = 'name = "mine"\nscenario = "lab_circle"\n'
SAMPLED = """
sampling = "{}"
samples = {}
[parameters]
"reference.radius_m" = {{ low = 0.3, high = 0.5 }}
"controller.alpha1" = {{ distribution = "log_uniform", low = 1.0, high = 100.0 }}
"robot.trailer.mass_kg" = {{ distribution = "normal", mean = 0.33, std = 0.03, low = 0.2 }}
"robot.servo.preset" = {{ values = ["lab", "fast"] }}
"""


def drawn(given: dict[str, object], unit: list[float]) -> list[Value]:
    parameter = parameter_of(given)
    assert isinstance(parameter, Parameter)
    return parameter.of_unit(np.array(unit))


def all_rows(plan: Plan) -> list[tuple[int, int, str, int, dict[str, Value]]]:
    return [tuple(row) for row in plan.rows_at(np.arange(plan.rows))]  # type: ignore[misc]


def test_rows_of_a_grid_have_seeds_innermost_and_the_first_parameter_outermost(
    tmp_path: Path,
) -> None:
    text = SMALL.replace("seeds = 2", "seeds = [7, 3]").replace(
        "[variants.omitted]", '"initial.x_m" = { low = 0, high = 1, count = 2 }\n[variants.omitted]'
    )
    expected = [
        (row, row // 4, variant, seed, {"reference.radius_m": radius, "initial.x_m": x})
        for row, (radius, x, variant, seed) in enumerate(
            itertools.product((0.3, 0.4, 0.5), (0, 1), ("omitted", "published"), (7, 3))
        )
    ]
    plan = plan_of(tmp_path, text)
    assert all_rows(plan) == expected
    assert plan.rows == 24
    assert plan.rows_at(np.array([23, 5])) == [
        plan.rows_at(np.arange(24))[23],
        plan.rows_at(np.arange(24))[5],
    ]


def test_a_scenario_has_its_overrides_its_variant_its_values_and_its_seed(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, SMALL)
    scenario = plan.scenario_of(plan.rows_at(np.array([7]))[0])
    assert scenario.duration_s == 0.4
    assert scenario.controller.singular_terms == "published"  # type: ignore[attr-defined]
    assert scenario.reference.radius_m == 0.4  # type: ignore[attr-defined]
    assert scenario.seed == 1


def test_values_of_every_form() -> None:
    unit = [0.0, 0.25, 0.5, 0.75]
    assert drawn({"values": [1, 2.5]}, unit) == [1, 1, 2.5, 2.5]
    assert drawn({"low": 0, "high": 4}, unit) == pytest.approx([0, 1, 2, 3], abs=1e-12)
    log = {"low": 1.0, "high": 16.0, "spacing": "log"}
    assert drawn(log, unit) == pytest.approx([1, 2, 4, 8])
    assert parameter_of({**log, "count": 5}).values == pytest.approx((1, 2, 4, 8, 16))  # type: ignore[union-attr]
    whole = parameter_of({"low": 2, "high": 6, "count": 3}).values  # type: ignore[union-attr]
    assert [type(v) for v in whole or ()] == [int] * 3
    assert whole == (2, 4, 6)
    halves = parameter_of({"low": 0, "high": 1, "count": 3}).values  # type: ignore[union-attr]
    assert halves == (0.0, 0.5, 1.0)
    weighted = {"distribution": "choice", "values": ["a", "b"], "weights": [3, 1]}
    assert drawn(weighted, [0.0, 0.74, 0.75, 0.99]) == ["a", "a", "b", "b"]


@pytest.mark.parametrize(
    ("given", "truth"),
    [
        ({"distribution": "uniform", "low": -1.0, "high": 3.0}, scipy.stats.uniform(-1, 4)),
        (
            {"distribution": "log_uniform", "low": 1e-3, "high": 10.0},
            scipy.stats.loguniform(1e-3, 10.0),
        ),
        ({"distribution": "normal", "mean": 2.0, "std": 0.5}, scipy.stats.norm(2.0, 0.5)),
        (
            {"distribution": "normal", "mean": 2.0, "std": 0.5, "low": 1.9, "high": 4.0},
            scipy.stats.truncnorm(-0.2, 4.0, 2.0, 0.5),
        ),
    ],
)
def test_a_distribution_is_that_of_scipy(
    given: dict[str, object], truth: scipy.stats.rv_continuous
) -> None:
    unit = np.linspace(0.001, 0.999, 57)
    assert drawn(given, unit.tolist()) == pytest.approx(truth.ppf(unit).tolist(), rel=1e-9)
    assert np.isfinite(drawn(given, [0.0, 1.0 - 2**-53])).all()  # the ends, too


@pytest.mark.parametrize("sampling", ["random", "latin_hypercube", "sobol"])
def test_samples_fill_the_ranges_and_are_the_same_wherever_they_are_asked_for(
    sampling: str, tmp_path: Path
) -> None:
    plan = plan_of(tmp_path, HEAD + SAMPLED.format(sampling, 8192))
    rows = plan.rows_at(np.arange(8192))
    scattered = plan.rows_at(np.array([5000, 3, 8191]))
    assert scattered == [rows[5000], rows[3], rows[8191]]
    assert [row.draw for row in rows] == list(range(8192))
    radius = np.array([row.values["reference.radius_m"] for row in rows], float)
    gain = np.array([row.values["controller.alpha1"] for row in rows], float)
    fast = np.array([row.values["robot.servo.preset"] == "fast" for row in rows])
    # three standard errors of 8192 independent samples: 0.0006, 0.019 and 0.017
    assert radius.mean() == pytest.approx(0.4, abs=0.002)
    assert np.log10(gain).mean() == pytest.approx(1.0, abs=0.02)
    assert fast.mean() == pytest.approx(0.5, abs=0.02)
    assert abs(np.corrcoef(radius, gain)[0, 1]) < 0.04
    if sampling != "random":  # one in each of as many equal parts
        parts = np.sort(((radius - 0.3) / 0.2 * 8192).astype(int))
        assert np.array_equal(parts, np.arange(8192))


def test_another_parameter_leaves_random_samples_as_they_were(tmp_path: Path) -> None:
    one = plan_of(tmp_path, HEAD + SAMPLED.format("random", 10))
    added = SAMPLED.format("random", 10) + '"initial.x_m" = { low = 0.0, high = 1.0 }\n'
    more = plan_of(tmp_path, HEAD + added)
    for a, b in zip(one.rows_at(np.arange(10)), more.rows_at(np.arange(10)), strict=True):
        assert b.values == a.values | {"initial.x_m": b.values["initial.x_m"]}


def test_a_grid_draws_from_distributions_for_each_seed(tmp_path: Path) -> None:
    mass = '"robot.trailer.mass_kg" = { distribution = "uniform", low = 0.2, high = 0.4 }\n'
    plan = plan_of(tmp_path, SMALL.replace("[variants.om", mass + "[variants.om"))
    rows = plan.rows_at(np.arange(plan.rows))
    assert plan.draws == 3
    by_seed = {row.seed: row.values["robot.trailer.mass_kg"] for row in rows}
    assert len(set(by_seed.values())) == 2
    assert all(row.values["robot.trailer.mass_kg"] == by_seed[row.seed] for row in rows)


def test_parameters_vary_together(tmp_path: Path) -> None:
    text = HEAD + (
        "[[together]]\n"
        '"robot.tractor.mass_kg" = { values = [0.9, 1.08] }\n'
        '"robot.tractor.yaw_inertia_kg_m2" = { values = [0.0035, 0.0042] }\n'
    )
    plan = plan_of(tmp_path, text)
    assert [tuple(row.values.values()) for row in plan.rows_at(np.arange(2))] == [
        (0.9, 0.0035),
        (1.08, 0.0042),
    ]
    assert plan.to_json()["parameters"]["robot.tractor.yaw_inertia_kg_m2"]["axis"] == 0


def test_belief_holds_values_and_parameters(tmp_path: Path) -> None:
    text = HEAD + (
        "[belief]\n"
        '"robot.trailer.mass_kg" = 0.5\n'
        '"robot.hitch.coulomb_friction_n_m" = { values = [0.0, 1e-3] }\n'
    )
    plan = plan_of(tmp_path, text)
    assert plan.overrides == ("belief.robot.trailer.mass_kg=0.5",)
    scenario = plan.scenario_of(plan.rows_at(np.array([1]))[0])
    assert scenario.believed_robot.trailer.mass_kg == 0.5
    assert scenario.believed_robot.hitch.coulomb_friction_n_m == 1e-3
    assert scenario.robot.trailer.mass_kg == 0.33


def test_a_plan_holds_what_json_lacks(tmp_path: Path) -> None:
    """Options of a law of one's own are any that TOML has."""
    law = '[controller]\nkind = "custom"\ntarget = "mine:Law"\n[controller.options]\n'
    options = "limit = inf\nsince = [2024-05-06, 07:08:09]\nat = { time = 2024-05-06T07:08:09Z }\n"
    reference = '[reference]\nkind = "circle"\nradius_m = 0.4\nangular_rate_rad_s = 0.1\n'
    head = 'name = "law"\nduration_s = 0.3\n[initial]\nkind = "at_rest"\n'
    (tmp_path / "law.toml").write_text(head + reference + law + options)
    (tmp_path / "mine.py").write_text("import ttwmr_mj as tt\n\nclass Law(tt.Controller): ...\n")
    varied = '[parameters]\n"reference.radius_m" = { values = [0.3, 0.4] }\n'
    plan = plan_of(tmp_path, f'name = "mine"\nscenario = "law.toml"\n{varied}')
    stored = Plan.from_json(json.loads(json.dumps(plan.to_json(), allow_nan=False)))
    assert stored == plan
    assert math.isnan(restored(json.loads(json.dumps(plain({"a": [math.nan]}))))["a"][0])


def test_paths_need_no_quotes(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, HEAD + "[parameters]\nreference.radius_m = { values = [0.3, 0.4] }\n")
    assert list(plan.parameters) == ["reference.radius_m"]


def test_the_design_for_sobol_indices_is_that_of_saltelli(tmp_path: Path) -> None:
    text = HEAD + "sensitivity = true\n" + SAMPLED.format("sobol", 16)
    plan = plan_of(tmp_path, text)
    assert plan.draws == 16 * 6
    told = plan.to_json()["sensitivity_design"]
    assert told["sets"] == ["A", "B", "AB_0", "AB_1", "AB_2", "AB_3"]
    cells = np.array(
        [list(row.values.values()) for row in plan.rows_at(np.arange(plan.rows))], dtype=object
    ).reshape(16, 6, 4)
    a, b = cells[:, 0], cells[:, 1]
    assert (a[:, :3] != b[:, :3]).all()
    for i in range(4):
        mixed = a.copy()
        mixed[:, i] = b[:, i]
        assert (cells[:, 2 + i] == mixed).all()


def test_a_plan_survives_its_file(tmp_path: Path) -> None:
    for text in (SMALL, HEAD + SAMPLED.format("sobol", 4)):
        plan = plan_of(tmp_path, text)
        again = Plan.from_json(json.loads(json.dumps(plan.to_json())))
        assert again.digest == plan.digest
        assert all_rows(again) == all_rows(plan)
        assert again.to_json() == plan.to_json()


def test_the_headline_is_what_the_reference_says_or_what_was_asked_for(tmp_path: Path) -> None:
    assert plan_of(tmp_path, SMALL).metric == "steady_centre_of_oscillation_rmse_m"
    silent = SMALL.replace("[parameters]", "").replace('"reference.radius_m"', "#")
    told = plan_of(tmp_path, silent.replace('"sensing', '\'reference.theta2="none"\', "sensing'))
    assert told.metric == "steady_tractor_rmse_m"
    asked = plan_of(tmp_path, 'metric = "iae_m_s"\n' + SMALL)
    assert asked.metric == "iae_m_s"
    assert asked.digest == plan_of(tmp_path, SMALL).digest  # it is computed whatever is shown


def test_a_plan_of_millions_of_rows_costs_no_memory(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, HEAD + "seeds = 1000\n" + SAMPLED.format("sobol", 2**13))
    assert plan.rows == 8_192_000
    tracemalloc.start()
    rows = plan.rows_at(np.arange(8_000_000, 8_000_100))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert rows[0].draw == 8000
    assert peak < 8e6  # bytes: a block of samples, and no list of rows


def test_too_many_rows_are_refused_and_the_limit_can_be_raised(tmp_path: Path) -> None:
    from ttwmr_mj.studies.sweep.plan.build import build_plan
    from ttwmr_mj.studies.sweep.plan.file import load_sweep

    plan_of(tmp_path, HEAD + "seeds = 100\n")
    request = load_sweep(str(tmp_path / "mine.toml"))
    with pytest.raises(InputError, match=r"got 100 rows; allowed: at most 99; .*--max-rows"):
        build_plan(request, most_rows=99)
    assert build_plan(request, most_rows=100).rows == 100


def test_what_ships_is_a_sweep_or_a_suite() -> None:
    assert "hitch_friction" in shipped_sweeps()
    assert not {"quick", "standard"} & shipped_sweeps().keys()


def test_seeds_begin_at_the_first(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, SMALL.replace("seeds = 2", "seeds = 2\nfirst_seed = 10000"))
    assert plan.seeds == (10000, 10001)
    assert {row.seed for row in plan.rows_at(np.arange(plan.rows))} == {10000, 10001}


@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        ("seeds = 2", "seeds = 60", r"seeds: were 40, are 60; 20 added: 40, 41, .*, 59"),
        (
            "seeds = 2",
            f"seeds = {[*range(20), *range(21, 40), 99]}",
            "seeds: were 40, are 40; 1 left out: 20; 1 added: 99",
        ),
        ("seeds = 2", f"seeds = {[*range(39, -1, -1)]}", "seeds: were 40, are 40; in another or"),
        ("duration_s=0.4", "duration_s=0.5", r'overrides: was \["duration_s=0.4.*, is \["duration'),
    ],
)
def test_what_differs_between_plans_is_told(
    before: str, after: str, told: str, tmp_path: Path
) -> None:
    sweep = SMALL.replace("seeds = 2", "seeds = 40") if "seeds" in before else SMALL
    old = plan_of(tmp_path, sweep)
    new = plan_of(tmp_path, SMALL.replace(before, after))
    assert any(re.match(told, str(fault)) for fault in changes(old, new))


def test_of_long_texts_the_first_difference_is_told(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, SMALL)
    old, new = (replace(plan, made_of={"code": "x" * 200 + end}) for end in ("one" * 50, "other"))
    (fault,) = changes(old, new)
    assert re.fullmatch(r"was \.\.\.x{39}one\w+\.\.\., is \.\.\.x{39}other\"", fault.problem)
