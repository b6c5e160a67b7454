"""Scenario files: every fault at once, overrides by path, and a dump that loads back."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest

from ttwmr_mj.assets import shipped_scenarios
from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario.file import check_scenario, dump_scenario, load_scenario, set_value
from ttwmr_mj.studies.bench.suite import load_suite
from ttwmr_mj.studies.sweep.plan.file import load_sweep

GOOD = """
name = "mine"
duration_s = 5.0
[reference]
kind = "circle"
radius_m = 0.43
angular_rate_rad_s = 0.125
[controller]
kind = "lyapunov"
"""


def write(folder: Path, text: str) -> str:
    path = folder / "mine.toml"
    path.write_text(text)
    return str(path)


def fault_of(folder: Path, text: str) -> str:
    with pytest.raises(InputError) as caught:
        load_scenario(write(folder, text))
    return str(caught.value)


def test_a_minimal_file_is_filled_with_defaults(tmp_path: Path) -> None:
    scenario = load_scenario(write(tmp_path, GOOD))
    assert scenario.robot.tractor.mass_kg == 0.9
    assert scenario.control.sampling_time_s == 0.033
    assert scenario.initial.kind == "at_rest"
    assert (scenario.periods, scenario.steps_per_period) == (151, 66)


def test_a_byte_order_mark_is_no_fault(tmp_path: Path) -> None:
    plain, marked = tmp_path / "plain.toml", tmp_path / "marked.toml"
    plain.write_text(GOOD)
    marked.write_text("\ufeff" + GOOD.replace("\n", "\r\n"), encoding="utf-8")
    assert load_scenario(str(marked)) == load_scenario(str(plain))


@pytest.mark.parametrize("find", [load_scenario, load_sweep, load_suite])
def test_what_is_no_file_is_told_as_what_it_is(
    find: Callable[[str], object], tmp_path: Path
) -> None:
    for name, told in (("folder", "is a folder"), ("loop", "is a link that leads to no file")):
        path = tmp_path / f"{name}.toml"
        path.mkdir() if name == "folder" else path.symlink_to(path)
        with pytest.raises(InputError, match=f"{name}.toml: {told}"):
            find(str(path))


def test_a_pipe_is_told_as_one(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for pipe in (str(tmp_path / "pipe"), "/dev/null"):
        with pytest.raises(InputError, match="is a pipe or a device; write it into a file"):
            load_scenario(pipe)


def test_periods_are_whole_whatever_way_decimals_round(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD)
    for duration_s, period_s, periods in ((0.3, 0.1, 3), (0.32, 0.1, 3), (0.033, 0.033, 1)):
        overrides = [f"duration_s={duration_s}", f"control.sampling_time_s={period_s}"]
        assert load_scenario(path, overrides).periods == periods  # 0.3/0.1 is 2.9999999999999996


@pytest.mark.parametrize("name", list(shipped_scenarios()))
def test_the_resolved_dump_loads_back_equal(name: str, tmp_path: Path) -> None:
    scenario = load_scenario(name)
    again = load_scenario(write(tmp_path, dump_scenario(scenario)))
    assert again == scenario


def test_all_faults_of_a_file_come_at_once(tmp_path: Path) -> None:
    text = """
name = "Bad Name"
duration_s = 1e12
seeed = 3
[robot.tractor]
mass_kg = -1.0
masss_kg = 3.0
yaw_inertia_kg_m2 = nan
[robot.trailer]
yaw_inertia_kg_m2 = 1e-9
[plant.contact]
model_path = "nowhere.xml"
[control]
sampling_time_s = 0.03325
[reference]
kind = "circle"
radius_m = "1 m"
angular_rate_rad_s = 0.5
[controller]
kind = "lyapunow"
"""
    message = fault_of(tmp_path, text)
    for expected in (
        "mine.toml: 11 errors",
        "name: got 'Bad Name'",
        "duration_s: got 1000000000000.0; allowed: less than or equal to 3600",
        "seeed: unknown key (did you mean 'seed'?)",
        "robot.tractor.mass_kg: got -1.0; allowed: greater than or equal to 0.000000000001",
        "robot.tractor.masss_kg: unknown key (did you mean 'mass_kg'?)",
        "robot.tractor.yaw_inertia_kg_m2: got nan; allowed: a finite number",
        "robot.trailer.yaw_inertia_kg_m2: got 1e-09; the wheels and casters",
        "plant.contact.model_path: got 'nowhere.xml'; no such file",
        "control.sampling_time_s: got 0.03325",
        "nearest: 0.033 and 0.0335",
        "reference.radius_m: got '1 m'; allowed: a valid number",
        "controller.kind: got 'lyapunow' (did you mean 'lyapunov'?)",
    ):
        assert expected in message


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("sensing.latency_s=0.05", "sensing.latency_s: got 0.05"),
        ("duration_s=0.01", "duration_s: got 0.01; allowed: at least one control period"),
        ("controller.alpha1=ten", "controller.alpha1: got 'ten'"),
        ("initial.x=1.0", "initial.x: unknown key (did you mean 'x_m'?)"),
        ("plant.kind=simulink", "plant.kind: got 'simulink'; allowed: 'contact' or 'analytic'"),
        ("seed=-1", "seed: got -1"),
        ("seed=1.5", "seed: got 1.5; allowed: a whole number"),
        ("robot=3", "robot: got 3"),
        ("reference.kind=none", "reference.kind: got 'none'; controller.kind = 'ly"),
        ("reference.centre_m=[0.0]", "reference.centre_m.1: missing"),
        ("schema_version=2", "schema_version: got 2; allowed: 1"),
    ],
)
def test_faults_name_key_value_and_what_is_allowed(
    line: str, expected: str, tmp_path: Path
) -> None:
    text = (
        GOOD
        if "kind=none" not in line
        else GOOD.replace("radius_m = 0.43\n", "").replace("angular_rate_rad_s = 0.125\n", "")
    )
    with pytest.raises(InputError) as caught:
        load_scenario(write(tmp_path, text), [line])
    assert expected in str(caught.value)


FLATNESS, TVLQR = 'controller={kind="flatness"}', 'controller={kind="tvlqr"}'


@pytest.mark.parametrize(
    ("name", "overrides", "expected"),
    [
        ("lab_circle", [FLATNESS], ["reference.kind: got 'circle'", "centre of oscillation"]),
        ("flat_figure_eight", [FLATNESS], ["reference.kind: got 'planned'", "hardly accelerates"]),
        ("lab_circle", [TVLQR, "reference.theta2=none"], ["reference.theta2: got 'none'"]),
        (
            "straight_line",
            ['controller={kind="mpc"}', "reference.theta2=outward"],
            ["reference.theta2: got 'outward'", "undefined at 0 s", "'mpc'"],
        ),
        (
            "lab_circle",
            ['controller={kind="lyapunov_pid"}', "reference.theta2=none"],
            ["reference.theta2: got 'none'", "controller.theta2_reference"],
        ),
        ("rest_to_rest", ["reference.plan=nothing"], ["plan: got 'nothing'; allowed: double_"]),
        (
            "rest_to_rest",
            ["robot.trailer.mass_kg=0.5"],
            ["reference.plan: got 'rest_", "; was made", "restore robot.trailer"],
        ),
        (
            "rest_to_rest",
            ["belief.robot.trailer.mass_kg=0.5"],
            ["reference.plan: got 'rest_", "; was made", "; restore belief.robot.trailer:"],
        ),
        # with every other fault of the file, and nothing about what is wrong already
        (
            "lab_circle",
            [FLATNESS, "plant.kind=simulink", "seed=-1"],
            ["3 errors", "plant.kind: got", "seed: got", "reference.kind: got 'circle'"],
        ),
        ("lab_circle", [FLATNESS, "reference.radius_m=-1.0"], ["1 error\n", "reference.radius_m"]),
    ],
)
def test_what_a_controller_needs_of_its_reference_is_checked(
    name: str, overrides: list[str], expected: list[str]
) -> None:
    with pytest.raises(InputError) as caught:
        load_scenario(name, overrides)
    for words in expected:
        assert words in str(caught.value)


def test_a_plan_of_ones_own_lies_beside_its_scenario(tmp_path: Path) -> None:
    plan = Path(__file__).parent.parent / "ttwmr_mj" / "references" / "data" / "rest_to_rest.csv"
    (tmp_path / "mine.csv").write_text(plan.read_text())
    text = GOOD.split("[reference]")[0] + '[reference]\nkind = "planned"\nplan = "mine.csv"\n'
    path = write(tmp_path, text + '[controller]\nkind = "tvlqr"\n')
    scenario = load_scenario(path)
    assert scenario.reference.model_dump()["plan"] == str((tmp_path / "mine.csv").resolve())
    with pytest.raises(InputError, match=r"reference.plan: got .*none.csv"):
        load_scenario(path, ["reference.plan=none.csv"])


def test_overrides_reach_every_depth() -> None:
    data = {"controller": {"kind": "open_loop", "segments": [{"duration_s": 1.0}]}}
    set_value(data, "controller.segments.0.duration_s=2.5")
    set_value(data, "plant.contact.timestep_s=0.0005")
    set_value(data, "plant.kind=analytic")
    set_value(data, 'description="a = b"')
    assert data["controller"]["segments"][0]["duration_s"] == 2.5
    assert data["plant"] == {"contact": {"timestep_s": 0.0005}, "kind": "analytic"}
    assert data["description"] == "a = b"


def test_a_fragment_is_merged_table_by_table_before_overrides(tmp_path: Path) -> None:
    fragment = tmp_path / "fitted.toml"
    fragment.write_text(
        "[plant]\nkind = 'analytic'\n[plant.analytic.extended]\nwheel_radius_m = 0.0261\n"
        "track_width_m = 0.12\n[robot.hitch]\ndamping_n_m_s_rad = 0.5\n"
    )
    path = write(tmp_path, GOOD)
    scenario = load_scenario(path, ["robot.hitch.damping_n_m_s_rad=0.25"], fragment=fragment)
    assert scenario.plant.kind == "analytic"
    assert scenario.plant.analytic.extended.wheel_radius_m == 0.0261
    assert scenario.robot.hitch.damping_n_m_s_rad == 0.25
    with pytest.raises(InputError, match="cannot be read as TOML"):
        load_scenario(path, fragment=tmp_path / "missing.toml")


def leaves(value: object, path: str = "") -> list[tuple[str, object]]:
    """Every path of plain data that ends in a value, list elements by index."""
    if isinstance(value, dict):
        pairs = list(value.items())
    elif isinstance(value, list):
        pairs = list(enumerate(value))
    else:
        return [(path, value)]
    return [leaf for key, item in pairs for leaf in leaves(item, f"{path}.{key}".lstrip("."))]


@pytest.mark.parametrize("name", ["lab_circle", "open_loop_turn", "waypoints"])
def test_every_value_of_a_scenario_can_be_set(name: str, tmp_path: Path) -> None:
    resolved = dump_scenario(load_scenario(name))
    values = leaves(tomllib.loads(resolved))
    assert len(values) > 40
    overrides = [f"{path}={json.dumps(value)}" for path, value in values]
    assert load_scenario(write(tmp_path, resolved), overrides) == load_scenario(name)


@pytest.mark.parametrize("bad", ["novalue", "=3", "a..b=1", "segments.7.x=1", "name.x=1"])
def test_malformed_overrides_are_refused(bad: str) -> None:
    with pytest.raises(InputError, match=r"^override "):
        set_value({"segments": [{}], "name": "text"}, bad)


def test_override_values_are_data_never_code(tmp_path: Path) -> None:
    evil = "__import__('os').system('touch owned')"
    scenario = load_scenario(write(tmp_path, GOOD), [f"description={evil}"])
    assert scenario.description == evil


def test_unknown_scenario_names_suggest_the_near_one() -> None:
    with pytest.raises(InputError, match=r"did you mean 'lab_circle'.*shipped: "):
        load_scenario("lab_cirle")


def test_a_file_beside_the_one_that_is_not_there_is_suggested(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("")
    with pytest.raises(InputError, match=r"did you mean '.*/mine\.toml'"):
        load_scenario(str(tmp_path / "mime.toml"))


def test_a_key_of_another_kind_says_how_the_kind_is_changed() -> None:
    own = ["controller.kind=tvlqr", "controller.alpha1=3.0"]
    with pytest.raises(InputError) as told:
        load_scenario("lab_circle", own)
    text = str(told.value)
    assert "it belongs to lyapunov, lyapunov_pid, and the kind here is tvlqr" in text
    for whole in re.findall(r"--set '(controller=\{[^']*\})'", text):  # what it says to do helps
        changed = load_scenario("outer_circle", [whole])
        assert changed.controller.kind in ("lyapunov", "tvlqr")
    needed = 'reference={kind="straight_line", speed_m_s=...}\''
    with pytest.raises(InputError, match=re.escape(needed)):
        load_scenario("lab_circle", ["reference.speed_m_s=0.2"])
    with pytest.raises(InputError) as told:  # which no kind has
        load_scenario("lab_circle", ["controller.alpha9=3.0"])
    assert "it belongs to" not in str(told.value)


def test_unreadable_files_are_refused(tmp_path: Path) -> None:
    assert "cannot be read as TOML" in fault_of(tmp_path, "name = ")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="cannot be read as TOML"):
        load_scenario(str(tmp_path / "binary.toml"))


def test_servo_presets_fill_what_is_not_given() -> None:
    base = {
        "name": "a",
        "duration_s": 1.0,
        "reference": {"kind": "none"},
        "controller": {
            "kind": "open_loop",
            "segments": [{"duration_s": 1.0, "wheel_right_rad_s": 1.0, "wheel_left_rad_s": 1.0}],
        },
    }
    servo = check_scenario(
        {**base, "robot": {"servo": {"preset": "fast", "speed_limit_rad_s": 30.0}}}, "a"
    ).robot.servo
    assert (servo.speed_limit_rad_s, servo.acceleration_limit_rad_s2) == (30.0, 100.0)


@pytest.mark.parametrize("damage", ["no notes", "no numbers", "a column less", "times fall", "nan"])
def test_a_damaged_plan_is_refused(damage: str, tmp_path: Path) -> None:
    data = Path(__file__).parent.parent / "ttwmr_mj" / "references" / "data"
    lines = (data / "rest_to_rest.csv").read_text(encoding="utf-8").splitlines()
    notes = [line for line in lines if line.startswith("#")]
    head, *rows = [line for line in lines if not line.startswith("#")]
    match damage:
        case "no notes":
            notes = []
        case "no numbers":
            rows = ["hello"] * len(rows)
        case "a column less":
            rows = [row.rsplit(",", 1)[0] for row in rows]
        case "times fall":
            rows = rows[::-1]
        case "nan":
            rows[3] = rows[3].rsplit(",", 1)[0] + ",nan"
    (tmp_path / "mine.csv").write_text("\n".join([*notes, head, *rows]) + "\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"reference\.plan: got .*mine\.csv'; is not a valid plan"):
        load_scenario("rest_to_rest", [f"reference.plan={tmp_path / 'mine.csv'}"])
