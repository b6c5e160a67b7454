"""Faults of a file are told where they are, whatever its keys are called."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any

import pytest
from pydantic import Field, ValidationError

from ttwmr_mj.cli.main import main
from ttwmr_mj.config import WORD, Config
from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario.faults import faults_of
from ttwmr_mj.scenario.file import check_scenario, load_scenario
from ttwmr_mj.studies.bench.suite import load_suite
from ttwmr_mj.studies.sweep.plan.build import build_plan
from ttwmr_mj.studies.sweep.plan.checks import check_plan
from ttwmr_mj.studies.sweep.plan.file import load_sweep

SWEEP = 'name = "mine"\nscenario = "lab_circle"\n'
SUITE = 'name = "mine"\n[controller.int]\n[task.circle]\nscenario = "lab_circle"\n'
FLAT = "reference={kind='flat_circle',radius_m=0.5,angular_rate_rad_s=1.0,side=%s}"


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("robot.trailer.mass[kg]=0.3", "robot.trailer.mass[kg]: unknown key (did you mean"),
        ("a[=1", "a[: unknown key; allowed: schema_version,"),
        ("int=1", "int: unknown key"),
        ("[key]=1", "[key]: unknown key; allowed: schema_version,"),
        ("plant.pushes[0].start_s=1", "plant.pushes[0]: unknown key (did you mean 'pushes'?)"),
        ("plant.pushes=[{int=1}]", "plant.pushes.0.int: unknown key; allowed: on, trailer"),
        ("plant.analytic.extended.int=1", "extended.int: unknown key; allowed: wheel_radius_m,"),
        ("reference.circle=1", "reference.circle: unknown key; allowed: kind,"),
        ("reference.[x].int=1", "reference.[x]: unknown key; allowed: kind,"),
        ("belief.robot.trailer.list[int]=1", "belief.robot.trailer.list[int]: unknown key"),
        ("ground.regions=[{shape='disc','a[0]'=1}]", "regions.0.a[0]: unknown key; allowed: shape"),
        (FLAT % 5, "reference.side: got 5; allowed: 'outside' or 'inside'"),
        (FLAT % "[5]", "reference.side.0: got 5; allowed: 'outside' or 'inside'"),
    ],
)
def test_a_key_is_told_as_it_is_written(override: str, told: str) -> None:
    with pytest.raises(InputError, match=re.escape(told)):
        load_scenario("lab_circle", [override])


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (SWEEP + '"x[0]" = 1', "\n  x[0]: unknown key; allowed: name,"),
        (SWEEP + "int = 1", "\n  int: unknown key"),
        (SWEEP + "seeds = [-1]", "\n  seeds.0: got -1; allowed: greater than or equal to 0"),
        (SWEEP + "seeds = 'x'", "\n  seeds: got 'x'; allowed: a whole number"),
        (SWEEP + "[variants.'X Y']", "\n  variants.X Y: got 'X Y'; allowed: up to 64"),
        (SWEEP + "[variants.x]\n'[key]' = 1", "\n  variants.x.[key]: unknown key; allowed: over"),
        (SWEEP + "[parameters.'x[0]']\nvalues = [1, 2]", "\n  x[0]: unknown key; allowed: schema"),
        (SWEEP + "[parameters.duration_s]\nvalues = [1, 2]\n'a[' = 1", "duration_s.a[: unknown"),
    ],
)
def test_so_it_is_in_a_sweep(text: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(InputError) as caught:
        check_plan(build_plan(load_sweep(str(tmp_path / "mine.toml"))), "mine.toml")
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("'x[0]' = 1\n" + SUITE, "\n  x[0]: unknown key; allowed: name,"),
        ("seeds = [-1]\n" + SUITE, "\n  seeds.0: got -1"),
        (SUITE + "[controller.'[key]']\nint = 1", "\n  controller.[key].int: unknown key"),
        (SUITE + "[plant.int]\noverrides = 5", "\n  plant.int.overrides: got 5; allowed: a list"),
    ],
)
def test_so_it_is_in_a_suite(text: str, told: str, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(InputError) as caught:
        load_suite(str(tmp_path / "mine.toml"))
    assert told in str(caught.value)


def test_a_key_that_would_not_be_seen_is_quoted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.toml").write_text('"" = 1\n[plant]\n" " = 1\n')
    fragment = ["--fragment", str(tmp_path / "mine.toml")]
    assert main(["validate", "lab_circle", *fragment]) == 2
    told = capsys.readouterr().err
    assert '\n  "": unknown key; allowed: schema_version,' in told
    assert '\n  plant." ": unknown key; allowed: kind,' in told


class _One(Config):
    a: int = 0


class _Other(Config):
    b: int = 0


class _Options(Config):
    """As another package's law may have them."""

    either: _One | _Other = _One()
    perhaps: _One | None = None
    named: dict[Annotated[str, Field(pattern=WORD)], int] = {}
    tables: dict[str, _One] = {}


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"either": {"x[0]": 1}}, "either.x[0]: unknown key"),
        ({"perhaps": {"x[0]": 1}}, "perhaps.x[0]: unknown key; allowed: a"),
        ({"named": {"X": 1}}, "named.X: got 'X'; allowed: up to 64 lower-case letters"),
        ({"tables": {"int": {"x[0]": 1}}}, "tables.int.x[0]: unknown key"),
    ],
)
def test_whatever_types_a_table_has_its_keys_are_told(given: dict[str, Any], told: str) -> None:
    with pytest.raises(ValidationError) as caught:
        _Options.model_validate(given)
    assert str(faults_of(caught.value, _Options)[0]).startswith(told)


def test_a_file_without_what_must_be_given_is_told_all_of_it() -> None:
    with pytest.raises(InputError) as caught:
        check_scenario({"seed": -1, "output": {"save_frames": True}}, "mine.toml")
    found = [fault.where for fault in caught.value.faults]
    assert sorted(found) == [
        "controller",
        "duration_s",
        "name",
        "output.save_frames",
        "reference",
        "seed",
    ]
