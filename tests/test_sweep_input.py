"""Bad input of a sweep: exit code 2, file, key and remedy, all faults at once, nothing written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sweeps import SMALL, written
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError
from ttwmr_mj.studies.sweep.plan import checks
from ttwmr_mj.studies.sweep.plan.build import build_plan, completed
from ttwmr_mj.studies.sweep.plan.file import load_sweep, shipped_sweeps

HEAD = 'name = "mine"\nscenario = "lab_circle"\n'
RADIUS = '"reference.radius_m" = '


def varied(*lines: str) -> str:
    return HEAD + "[parameters]\n" + "\n".join(lines) + "\n"


BAD = {
    "an unknown path": (
        varied('"robot.trailer.mas_kg" = { values = [1.0, 2.0] }'),
        "robot.trailer.mas_kg: unknown key (did you mean 'mass_kg'?)",
    ),
    "a path through a value": (
        varied('"duration_s.long" = { values = [1.0, 2.0] }'),
        "duration_s.long: 'long' can only be set in a table",
    ),
    "a variant that names no folder": (
        HEAD + '[variants."../x"]\noverrides = []\n',
        "got '../x'; allowed: up to 64 lower-case letters, digits and _, a letter or digit first",
    ),
    "a wrong type": (
        varied(RADIUS + '{ values = ["wide", "narrow"] }'),
        "reference.radius_m: got 'wide'; allowed: a valid number",
    ),
    "mixed types": (
        varied(RADIUS + '{ values = [1.0, "narrow"] }'),
        "parameters.reference.radius_m.values: got [1.0, 'narrow']; allowed: values of one type",
    ),
    "a value out of range": (
        varied('"robot.trailer.mass_kg" = { values = [0.3, -0.3] }'),
        "robot.trailer.mass_kg: got -0.3; allowed: greater than or equal to 0.000000001",
    ),
    "no values": (varied(RADIUS + "{ values = [] }"), "allowed: at least 1 of them"),
    "one value": (
        varied(RADIUS + "{ values = [0.3] }"),
        'one value varies nothing; overrides = ["reference.radius_m=0.3"] sets it',
    ),
    "one word": (
        varied('"initial.kind" = { values = ["at_rest"] }'),
        r'one value varies nothing; overrides = ["initial.kind=\"at_rest\""] sets it',
    ),
    "a value twice": (varied(RADIUS + "{ values = [0.3, 0.3] }"), "a value twice; leave out"),
    "an empty range": (
        varied(RADIUS + "{ low = 0.5, high = 0.5, count = 3 }"),
        "the range is empty: `low` is 0.5 and `high` 0.5",
    ),
    "an infinite range": (
        varied(RADIUS + "{ low = 0.5, high = inf, count = 3 }"),
        "parameters.reference.radius_m.high: got inf; this is not a finite number",
    ),
    "a range that is too long": (
        varied(RADIUS + "{ low = -1.7e308, high = 1.7e308, count = 3 }"),
        "the range is too long",
    ),
    "NaN": (
        varied(RADIUS + "{ values = [nan, 0.3] }"),
        "values.0: got nan; this is not a finite number",
    ),
    "a range of equal ratios from zero": (
        varied(RADIUS + '{ low = 0, high = 1, count = 3, spacing = "log" }'),
        "with equal ratios it has to be positive",
    ),
    "a grid without a count": (
        varied(RADIUS + "{ low = 0.3, high = 0.5 }"),
        "count: missing; a grid needs to know how many values",
    ),
    "an unknown distribution": (
        varied(RADIUS + '{ distribution = "gauss", mean = 0.4, std = 0.1 }'),
        "distribution: got 'gauss'; allowed: 'uniform', 'log_uniform', 'normal', 'choice'",
    ),
    "an unknown key of a parameter": (
        varied(RADIUS + "{ values = [0.3, 0.4], step = 2 }"),
        "parameters.reference.radius_m.step: unknown key; allowed: values",
    ),
    "no parameter": (
        varied(RADIUS + "0.3"),
        "parameters.reference.radius_m: got 0.3; says no values; a fixed value goes into overrides",
    ),
    "an empty parameter": (varied(RADIUS + "{ count = 3 }"), "says no values; allowed: { values"),
    "an empty tail of a distribution": (
        varied(RADIUS + '{ distribution = "normal", mean = 0, std = 1, low = 50 }'),
        "lies nothing of this distribution",
    ),
    "weights of another number": (
        varied(RADIUS + '{ distribution = "choice", values = [0.3, 0.4], weights = [1] }'),
        "1 weights for 2 values",
    ),
    "weights of nothing": (
        varied(RADIUS + '{ distribution = "choice", values = [0.3, 0.4], weights = [0, 0] }'),
        "all weights are 0",
    ),
    "what changes nothing": (
        HEAD
        + "[[together]]\n"
        + '"reference.radius_m" = { values = [0.3, 0.4] }\n'
        + '"reference" = { values = ["a", "b"] }\n',
        "reference: got 'a'",
    ),
    "a variant's seed": (
        varied(RADIUS + "{ values = [0.3, 0.4] }") + "[variants.a]\noverrides = ['seed=4']\n",
        "variants.a.overrides: got seed=4; cannot be set by a variant; all variants have the seeds",
    ),
    "a variant that sets what is varied": (
        varied(RADIUS + "{ values = [0.3, 0.4] }")
        + "[variants.a]\noverrides = ['reference.radius_m=0.5']\n",
        "variants.a.overrides: got reference.radius_m=0.5; this key is varied",
    ),
    "variants that are the same": (
        varied(RADIUS + "{ values = [0.3, 0.4] }") + "[variants.a]\n[variants.b]\n",
        "variants.b.overrides: the same as those of a: nothing to compare",
    ),
    "seeds as a parameter": (
        varied('"seed" = { values = [1, 2] }'),
        "parameters.seed: cannot be varied; seeds are given in `seeds`",
    ),
    "no seeds": (HEAD + "seeds = 0\n", "seeds: got 0; allowed: 1 to 1000000, or a list"),
    "a first seed and a list": (
        HEAD + "first_seed = 3\nseeds = [1]\n",
        "first_seed: got 3; allowed: where seeds is a number",
    ),
    "seeds that are too large": (
        HEAD + "first_seed = 4294967295\nseeds = 2\n",
        "first_seed: got 4294967295; allowed: at most 4294967294 with 2 seeds",
    ),
    "a seed twice": (HEAD + "seeds = [1, 1]\n", "seeds: got [1, 1]; allowed: one or more"),
    "samples of a grid": (HEAD + "samples = 5\n", "samples: got 5; a grid has none"),
    "sampling without samples": (
        HEAD + 'sampling = "random"\n',
        "samples: missing; sampling = 'random' needs a number",
    ),
    "sampling of nothing": (
        HEAD + 'sampling = "random"\nsamples = 3\n',
        "samples: nothing is varied",
    ),
    "seeds of another type": (
        HEAD + 'seeds = "ten"\n',
        "mine.toml: 1 error\n  seeds: got 'ten'; allowed: a whole number\n",
    ),
    "a seed of another type": (
        HEAD + 'seeds = [1, "ten"]\n',
        "mine.toml: 1 error\n  seeds.1: got 'ten'; allowed: a whole number\n",
    ),
    "an unknown sampling": (HEAD + 'sampling = "halton"\n', "sampling: got 'halton'; allowed:"),
    "a Sobol sequence out of balance": (
        HEAD + 'sampling = "sobol"\nsamples = 100\n',
        "samples: got 100; allowed: a power of two, such as 64 or 128",
    ),
    "sensitivity without Sobol": (
        HEAD + "sensitivity = true\n",
        "sensitivity: got true; allowed: with sampling = 'sobol' only",
    ),
    "an unknown metric": (
        HEAD + 'metric = "tractor_rms_m"\n',
        "metric: got 'tractor_rms_m' (did you mean 'tractor_rmse_m'?)",
    ),
    "an unknown key": (HEAD + "seed = 5\n", "seed: unknown key (did you mean 'seeds'?)"),
    "no scenario": ('name = "mine"\n', "scenario: missing"),
    "an unknown scenario": (
        'name = "mine"\nscenario = "lab_circl"\n',
        "no such scenario file, and no shipped scenario of that name (did you mean 'lab_circle'?)",
    ),
    "a faulty scenario": (HEAD + 'overrides = ["duration_s=-1"]\n', "duration_s: got -1"),
    "a variant that cannot run": (
        HEAD + "[variants.a]\noverrides = ['controller.kind=flatness']\n[variants.b]\n",
        "in variant a",
    ),
    "parts of unequal number that vary together": (
        HEAD + "[[together]]\n" + RADIUS + "{ values = [0.3, 0.4] }\n"
        '"robot.trailer.mass_kg" = { low = 0.3, high = 0.4, count = 3 }\n',
        "together: got reference.radius_m: 2, robot.trailer.mass_kg: 3; they vary together",
    ),
    "a value and a distribution that vary together": (
        HEAD + "[[together]]\n" + RADIUS + "{ values = [0.3, 0.4] }\n"
        '"robot.trailer.mass_kg" = { distribution = "choice", values = [0.3, 0.4] }\n',
        "they vary together, and only some are distributions",
    ),
    "what is varied twice": (
        varied(RADIUS + "{ values = [0.3, 0.4] }")
        + "[[together]]\n"
        + RADIUS
        + "{ values = [1, 2] }",
        "together.0.reference.radius_m: varied twice",
    ),
    "no TOML": ("name = \n", "cannot be read as TOML"),
    "a suite": (HEAD + "[controller.flatness]\n", "this is a suite of controllers and tasks"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_refused_before_anything_is_written(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    text, said = BAD[case]
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", written(tmp_path, text)]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert "mine.toml" in err or "scenario" in case
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]


def test_all_faults_are_told_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = varied(
        '"robot.trailer.mass_kg" = { values = [-0.3, 0.3] }',
        '"robot.trailer.mas_kg" = { values = [1, 2] }',
        '"reference.radius_m" = { values = [0.3, "wide"] }',
    )
    assert main(["sweep", written(tmp_path, "seeds = 0\n" + text)]) == 2
    err = capsys.readouterr().err
    assert "2 errors" in err  # of the file; whether its rows can run is asked afterwards
    assert main(["sweep", written(tmp_path, text.replace('"wide"', "-1.0"))]) == 2
    err = capsys.readouterr().err
    assert "unknown key" in err
    assert "got -0.3; allowed: greater than or equal to 0.000000001" in err


def test_a_parameter_that_changes_nothing_is_refused(tmp_path: Path) -> None:
    """What a later key overrides: here the whole table that the first is in."""
    text = varied(
        '"robot.hitches.0.damping_n_m_s_rad" = { values = [0.0, 0.1] }',
        '"robot.hitch.damping_n_m_s_rad" = { values = [0.2, 0.3] }',
    )
    path = written(tmp_path, text.replace("[para", "overrides = ['robot.hitches=[{}]']\n[para"))
    plan = build_plan(load_sweep(path))
    with pytest.raises(InputError, match=r"hitches.0.damping_n_m_s_rad: changes nothing"):
        checks.check_plan(plan, path)


def test_faults_inside_a_plan_are_found_and_counted_once(tmp_path: Path) -> None:
    text = varied(
        '"robot.trailer.mass_kg" = { values = [0.3, 0.4] }',
        '"reference.radius_m" = { distribution = "normal", mean = 0.4, std = 0.2 }',
    )
    path = written(tmp_path, text.replace("[para", 'sampling = "random"\nsamples = 400\n[para'))
    plan = build_plan(load_sweep(path))
    radii = [row.values["reference.radius_m"] for row in plan.rows_at(np.arange(400))]
    bad = [i for i, radius in enumerate(radii) if float(radius) <= 1e-3]
    assert bad
    with pytest.raises(InputError) as caught:  # in processes, too
        checks.check_plan(plan, path, workers=2)
    (fault,) = caught.value.faults
    assert fault.where == "reference.radius_m"
    others = f" and {len(bad) - 1} more" if len(bad) > 1 else ""
    assert f"in row {bad[0]}{others}" in fault.message


def test_of_a_huge_plan_the_ends_and_some_rows_are_checked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checks, "MOST_CHECKED", 100)
    text = varied(RADIUS + "{ low = 0.3, high = 0.5, count = 300 }")
    plan = build_plan(load_sweep(written(tmp_path, "seeds = 3\n" + text)))
    rows = checks._rows_to_check(plan)
    assert 60 < len(rows) <= 100
    assert (rows % 3 == 0).all()  # one seed of each
    assert not checks.check_plan(plan, "mine")
    assert checks.checked_text(plan).startswith(f"{len(rows)} of 300 different rows, drawn at")
    monkeypatch.undo()
    assert checks.checked_text(plan) == "all 900 rows, as seeds change nothing: 300 different ones"
    assert checks._rows_to_check(plan).tolist() == list(range(0, 900, 3))


def test_seeds_are_checked_where_they_decide(tmp_path: Path) -> None:
    for line in (
        'overrides = ["world=unkind"]',
        '[parameters]\nworld = { values = ["kind", "lab"] }',
    ):
        plan = build_plan(load_sweep(written(tmp_path, HEAD + "seeds = 5\n" + line)))
        assert len(checks._rows_to_check(plan)) == plan.rows
    plan = build_plan(load_sweep(written(tmp_path, HEAD + "seeds = 5\n")))
    assert len(checks._rows_to_check(plan)) == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "SWEEP: missing; allowed: a TOML file, or shipped: "),
        (["hitch_fricton"], "did you mean 'hitch_friction'?"),
        (["quick"], "this is a suite of controllers and tasks, not a sweep; ttwmr bench quick"),
        (["mine.toml", "--shard", "3/2"], "--shard: got '3/2'; allowed: i/n"),
        (["mine.toml", "--record", "worst"], "--record: got 'worst'; allowed: worst:N"),
        (["mine.toml", "--record", "failed:0"], "N, median or failed:N, with N at least 1"),
        (["mine.toml", "--max-rows", "11"], "got 12 rows; allowed: at most 11"),
        (["mine.toml", "--set", "nonsense"], "override nonsense: allowed: key.path=value"),
        (["mine.toml", "--out", "full"], "--out: got full; the folder holds something, and no"),
        (["mine.toml", "--out", "mine.toml"], "--out: got mine.toml; a file is in the way"),
        (["--merge", "full", "--out", "new"], "full: no sweep's folder"),
        (["--merge", "full"], "--merge: --out is missing"),
        (["mine.toml", "--merge", "full", "--out", "new"], "SWEEP: the folders that are joined"),
        (["--merge", "full", "--set", "seed=3"], "--set: the folders that are joined"),
        (["--merge", "full", "--dry-run"], "--dry-run: the folders that are joined"),
        (["--merge", "full", "--extend"], "--extend: the folders that are joined"),
        (["--merge", "full", "--shard", "1/2"], "--shard: the folders that are joined"),
    ],
)
def test_wrong_options_are_refused(
    arguments: list[str],
    said: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    written(tmp_path, SMALL)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("all of it")
    assert main(["sweep", *arguments]) == 2
    assert said in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["full", "mine.toml"]


def test_bench_knows_a_sweep(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "hitch_friction"]) == 2
    said = "this is a sweep, not a suite; ttwmr sweep hitch_friction"
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("name", shipped_sweeps())
def test_what_ships_can_be_run(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, "MOST_CHECKED", 40)  # all of them: `ttwmr sweep NAME --dry-run`
    request = load_sweep(name)
    plan = build_plan(request)
    checks.check_plan(plan, request.source)
    assert plan.name == name
    assert plan.description
    assert completed(plan).metric
