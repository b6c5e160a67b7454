"""What a sweep varies and holds: said in any way that TOML has, and nothing said in vain."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.stats

from sweeps import SMALL, plan_of, written
from ttwmr_mj.cli.main import main
from ttwmr_mj.studies.sweep.plan.file import load_sweep
from ttwmr_mj.studies.sweep.plan.parameters import Parameter, parameter_of

HEAD = 'name = "mine"\nscenario = "lab_circle"\n'
MASS = "robot.trailer.mass_kg"
VARIED = f'[parameters]\n"{MASS}" = {{ values = [0.3, 0.4] }}\n'
BELIEF = {
    "quoted": f'[belief]\n"{MASS}" = 0.33\n"ground.slope_rad" = {{ values = [0.0, 0.1] }}\n',
    "without quotes": f"[belief]\n{MASS} = 0.33\nground.slope_rad = {{ values = [0.0, 0.1] }}\n",
    "tables": "[belief.robot.trailer]\nmass_kg = 0.33\n"
    "[belief.ground.slope_rad]\nvalues = [0.0, 0.1]\n",
    "tables in a table": "[belief]\nground = { slope_rad = { values = [0.0, 0.1] } }\n"
    "robot = { trailer = { mass_kg = 0.33 } }\n",
}


@pytest.mark.parametrize("how", BELIEF)
def test_belief_takes_keys_as_a_scenario_does(how: str, tmp_path: Path) -> None:
    request = load_sweep(written(tmp_path, HEAD + BELIEF[how]))
    assert request.overrides == (f"belief.{MASS}=0.33",)
    (axis,) = request.axes
    assert axis.name == "belief.ground.slope_rad"
    assert axis.count == 2


@pytest.mark.parametrize(
    "text",
    [
        f"[parameters]\n{MASS} = {{ values = [0.3, 0.4] }}\n",
        "[parameters.robot.trailer]\nmass_kg = { values = [0.3, 0.4] }\n",
        f"[parameters.{MASS}]\nvalues = [0.3, 0.4]\n",
        f"[[together]]\n{MASS} = {{ values = [0.3, 0.4] }}\n",
    ],
)
def test_parameters_take_keys_without_quotes(text: str, tmp_path: Path) -> None:
    axes = load_sweep(written(tmp_path, HEAD + text)).axes
    assert [(axis.name, axis.count) for axis in axes] == [(MASS, 2)]


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        (f'overrides = ["{MASS}=0.5"]\n{VARIED}', [], f"overrides: got {MASS}=0.5; this key is va"),
        (VARIED, ["--set", f"{MASS} = 0.5"], f"--set: got {MASS} = 0.5; this key is varied"),
        (VARIED, ["--set", "robot.trailer={mass_kg=0.5}"], "mass_kg=0.5}; this key is varied"),
        (
            f"[variants.a]\noverrides = ['robot.trailer={{mass_kg=0.5}}']\n{VARIED}",
            [],
            "variants.a.overrides: got robot.trailer={mass_kg=0.5}; this key is varied",
        ),
        (f'{VARIED}[belief]\n"{MASS}" = 0.33\n{MASS} = 0.34\n', [], f"belief.{MASS}: given twice"),
        (
            f"overrides = ['seed=4']\n{VARIED}",
            [],
            "overrides: got seed=4; cannot be set; seeds are",
        ),
        (VARIED, ["--set", "seed=4"], "--set: got seed=4; cannot be set; seeds are given in"),
        (
            f'overrides = ["belief.{MASS}=0.5"]\n{VARIED}{BELIEF["quoted"]}',
            [],
            f"overrides: got belief.{MASS}=0.5; this key is set in [belief]",
        ),
    ],
)
def test_what_would_be_set_in_vain_is_refused(
    text: str, options: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sweep", written(tmp_path, HEAD + text), "--dry-run", *options]) == 2
    assert said in capsys.readouterr().err


def test_a_value_may_come_again_with_another_beside_it(tmp_path: Path) -> None:
    both = (
        '[[together]]\n"robot.trailer.mass_kg" = { values = [0.33, 0.33, 0.66] }\n'
        '"robot.hitch.damping_n_m_s_rad" = { values = [0.0, 0.001, 0.002] }\n'
    )
    plan = plan_of(tmp_path, SMALL + both)
    assert plan.draws == 9
    cells = [tuple(row.values.values())[1:] for row in plan.rows_at(np.arange(0, 12, 4))]
    assert cells == [(0.33, 0.0), (0.33, 0.001), (0.66, 0.002)]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            '[[together]]\n"robot.trailer.mass_kg" = { values = [0.3, 0.3, 0.6] }\n'
            '"robot.hitch.damping_n_m_s_rad" = { values = [0.1, 0.1, 0.2] }\n',
            "together.0: got [(0.3, 0.1), (0.3, 0.1), (0.6, 0.2)]; a value twice",
        ),
        (
            f'[parameters]\n"{MASS}" = {{ values = [0.3, 0.3] }}\n',
            f"parameters.{MASS}.values: got [0.3, 0.3]; a value twice",
        ),
        (
            f'[belief]\n"{MASS}" = {{ values = [0.3, 0.3] }}\n',
            f"belief.{MASS}.values: got [0.3, 0.3]; a value twice",
        ),
        (
            f'[parameters]\n"{MASS}" = {{ low = 0.33, high = 0.33000000000000007, count = 5 }}\n',
            f"parameters.{MASS}: got a table; `count` is 5; between 0.33 and 0.33000000000000007 "
            "there are not that many floating-point numbers (2 were found)",
        ),
    ],
)
def test_what_would_be_computed_twice_is_refused(
    text: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sweep", written(tmp_path, HEAD + text), "--dry-run"]) == 2
    assert said in capsys.readouterr().err


def parameter(**given: object) -> Parameter:
    found = parameter_of(given)
    assert isinstance(found, Parameter)
    return found


def test_weights_whose_sum_overflows_count_by_their_ratios() -> None:
    large = parameter(distribution="choice", values=[1, 2, 3], weights=[1e308, 1e308, 1.0])
    assert large.of_unit(np.array([0.1, 0.49, 0.51, 0.99])) == [1, 1, 2, 2]


@pytest.mark.parametrize("end", [2.0, 8.15, 30.0, 37.0])
def test_the_tails_of_a_normal_distribution_are_alike_and_finite(end: float) -> None:
    unit = np.array([0.0, 1e-3, 0.25, 0.5, 0.75, 0.999, 1.0 - 2.0**-53])
    upper = parameter(distribution="normal", mean=0.0, std=1.0, low=end).of_unit(unit)
    lower = parameter(distribution="normal", mean=0.0, std=1.0, high=-end).of_unit(1.0 - unit)
    assert np.isfinite(np.array(upper, dtype=float)).all()
    assert upper == sorted(upper, key=float)
    np.testing.assert_allclose(upper, -np.array(lower, dtype=float), rtol=1e-12)
    expected = scipy.stats.truncnorm(end, np.inf).ppf(unit[1:-1])
    # SciPy's own error in the far tail is of that size
    np.testing.assert_allclose(np.array(upper[1:-1], dtype=float), expected, rtol=1e-8)
