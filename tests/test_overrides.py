"""What is set later counts: nothing of an override or a fragment is lost without a word."""

from __future__ import annotations

from pathlib import Path

import pytest

from ttwmr_mj.cli.command_line import parse
from ttwmr_mj.cli.commands.validate import Validate
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario.file import load_scenario, paths_set

DAMPING = "[{damping_n_m_s_rad=0.01}]"


@pytest.mark.parametrize("more", [[], ["world=lab"], ["world=unkind"]])
def test_a_list_that_is_set_replaces_the_first_by_its_name(more: list[str]) -> None:
    given = load_scenario("lab_circle").robot.hitch.damping_n_m_s_rad
    scenario = load_scenario("lab_circle", [f"robot.hitches={DAMPING}", *more])
    assert scenario.robot.hitch.damping_n_m_s_rad == 0.01 != given


def test_a_fragments_list_replaces_the_first_by_its_name(tmp_path: Path) -> None:
    fragment = tmp_path / "hitch.toml"
    fragment.write_text("[[robot.hitches]]\ndamping_n_m_s_rad = 0.01\n")
    robot = load_scenario("lab_circle", fragment=fragment).robot
    assert robot.hitch.damping_n_m_s_rad == 0.01
    both = [f"robot.hitches={DAMPING}", "robot.hitch.damping_n_m_s_rad=0.02"]  # the later one
    assert load_scenario("lab_circle", both).robot.hitch.damping_n_m_s_rad == 0.02


def test_fragments_then_overrides_then_the_seed_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("one.toml").write_text(
        "seed = 1\nrobot.tractor.mass_kg = 1.1\nrobot.trailer.mass_kg = 0.3\n"
    )
    Path("two.toml").write_text("seed = 2\n[[robot.trailers]]\nmass_kg = 0.4\n")
    words = ["--fragment", "one.toml", "--fragment", "two.toml"]
    for more, seed in (([], 2), (["--set", "seed=3"], 3), (["--seed", "4", "--set", "seed=3"], 4)):
        command = parse(["validate", "lab_circle", *words, *more])
        assert isinstance(command, Validate)
        found = command.load("lab_circle")
        assert (found.robot.tractor.mass_kg, found.robot.trailer.mass_kg) == (1.1, 0.4)
        assert found.seed == seed
    assert load_scenario("lab_circle", fragment=["two.toml", "one.toml"]).seed == 1
    Path("two.toml").write_text("robot = 5\n")
    assert main(["validate", "lab_circle", *words]) == 2
    assert "lab_circle.toml with one.toml with two.toml: 1 error" in capsys.readouterr().err


@pytest.mark.parametrize("world", ["kind", "lab", "unkind"])
@pytest.mark.parametrize("table", ["robot", "belief.robot"])
@pytest.mark.parametrize("first", ["hitch", "trailer"])
@pytest.mark.parametrize("entry", ["5", "'x'", "true", "[]"])
def test_the_first_of_a_list_is_a_table_in_every_world(
    world: str, table: str, first: str, entry: str
) -> None:
    lists = {"hitch": "hitches", "trailer": "trailers"}
    override = f"{table}.{lists[first]}=[{entry}]"
    with pytest.raises(InputError, match=rf"{table}\.{first}: .* a table"):
        load_scenario("lab_circle", [override, f"world={world}"])


def test_what_has_more_than_one_line_is_one_value() -> None:
    with pytest.raises(InputError, match=r"controller.alpha1: got '33\\nalpha2=9'"):
        load_scenario("lab_circle", ["controller.alpha1=33\nalpha2=9"])
    assert load_scenario("lab_circle", ["description=a = 1\nb = 2"]).description == "a = 1\nb = 2"


def test_no_entry_of_an_empty_list_can_be_set() -> None:
    words = ["plant.pushes=[]", "plant.pushes.0.time_s=1.0"]
    with pytest.raises(InputError, match=r"the list is empty; set it as a whole"):
        load_scenario("lab_circle", words)


def test_every_place_that_an_override_sets_is_known() -> None:
    told = list(paths_set("robot . trailers=[{mass_kg=1, com_offset_m=2}]"))
    one = "robot.trailers.0"
    assert told == ["robot.trailers", one, f"{one}.mass_kg", f"{one}.com_offset_m"]
    assert list(paths_set("plant.kind=analytic")) == ["plant.kind"]


@pytest.mark.parametrize(
    ("bad", "told"),
    [
        ("duration_s=.5", "got '.5'; allowed: a valid number; TOML writes 0.5"),
        ("duration_s=5.", "got '5.'; allowed: a valid number; TOML writes 5.0"),
        ("duration_s=0,5", "got '0,5'; allowed: a valid number; TOML writes 0.5"),
        ("seed=007", "got '007'; allowed: a whole number; TOML writes 7"),
        ('seed="7"', "got '7'; allowed: a whole number; TOML writes 7"),
        ("output.figures=True", "got 'True'; allowed: a valid boolean; TOML writes true"),
        ("duration_s=", "got ''; allowed: a valid number; no value is given"),
        ("duration_s=long", "got 'long'; allowed: a valid number"),
    ],
)
def test_how_toml_writes_a_value_is_told(bad: str, told: str) -> None:
    with pytest.raises(InputError) as caught:
        load_scenario("lab_circle", [bad])
    (fault,) = caught.value.faults
    assert fault.message == told
