"""Suite files: what rows they give, and what the shipped ones promise."""

from __future__ import annotations

from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest

from ttwmr_mj.cli.main import main
from ttwmr_mj.controllers.lyapunov import LyapunovOptions
from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.bench.suite import (
    AXES,
    SuiteRow,
    checked_scenarios,
    load_suite,
    rows_of,
    shipped_suites,
)

SHIPPED = list(shipped_suites())
STANDARD = rows_of(load_suite("standard"))
ARTICLE = ["lyapunov", "lyapunov_tuned", "lyapunov_published", "lyapunov_pid"]


def draws(scenario: Scenario) -> bool:
    """Whether another seed makes another run."""
    sensing, control = scenario.sensing, scenario.control
    random = [
        scenario.world == "unkind",
        sensing.kind == "camera",
        sensing.latency_jitter_s,
        sensing.drop_probability,
        control.command_jitter_s,
        control.command_drop_probability,
        *(push.random_within_s or push.random_direction for push in scenario.plant.pushes),
    ]
    if sensing.kind == "truth":
        noises = ("position_m", "angle_rad", "velocity_m_s", "rate_rad_s")
        random += [getattr(sensing, noise.replace("_", "_noise_", 1)) for noise in noises]
    return any(random)


@cache
def scenarios(suite: str) -> dict[str, Scenario]:
    """Row's key → what it runs; every row of a shipped suite can."""
    return checked_scenarios(rows_of(load_suite(suite)))


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_suites_have_ten_seeds_where_something_is_random_and_else_one(name: str) -> None:
    rows = rows_of(load_suite(name))
    assert len({row.key for row in rows}) == len(rows) >= 20
    seeds: dict[tuple[str, ...], list[int]] = defaultdict(list)
    random: dict[tuple[str, ...], bool] = {}
    for row in rows:
        names = tuple(row.names[axis] for axis in AXES)
        seeds[names].append(row.seed)
        random[names] = draws(scenarios(name)[row.key])
    for names, given in seeds.items():
        assert given == (list(range(10)) if random[names] else [0]), names


def test_no_two_laws_of_the_standard_suite_differ_in_more_than_the_law() -> None:
    """Laws are compared on equal worlds, pushes and noise."""
    worlds: dict[tuple[str, ...], dict[str, object]] = {}
    for row in STANDARD:
        scenario = scenarios("standard")[row.key].model_dump()
        del scenario["controller"]
        if scenario["sensing"]["kind"] == "camera":
            del scenario["sensing"]["tracker"]  # finds the latency, if the law learns
        where = (*(row.names[axis] for axis in AXES[1:]), str(row.seed))
        assert scenario == worlds.setdefault(where, scenario), row.key


def of(**names: str) -> list[SuiteRow]:
    return [row for row in STANDARD if names.items() <= row.names.items()]


def scenario_of(**names: str) -> Scenario:
    return scenarios("standard")[of(**names)[0].key]


def test_the_standard_suite_has_worlds_pushes_latency_friction_and_baselines() -> None:
    for sensing in ("truth", "camera"):
        for world in ("lab", "unkind"):
            there = {row.names["controller"] for row in of(sensing=sensing, disturbance=world)}
            assert {"tvlqr", "tvlqr_learn"} <= there
    assert {row.names["controller"] for row in STANDARD} >= {*ARTICLE, "feedforward"}
    assert scenario_of(disturbance="lab").world == "lab"
    assert scenario_of(disturbance="unkind").world == "unkind"
    (push,) = scenario_of(disturbance="push").plant.pushes
    lap_s = 6.283
    assert (push.random_within_s, push.random_direction) == (lap_s, True)
    late = scenario_of(disturbance="latency")
    assert (late.sensing.latency_s, late.belief.latency_s) == (0.033, 0.0)
    for disturbance, believed in (("hitch_friction", 0.0), ("hitch_friction_told", 1e-3)):
        dry = scenario_of(disturbance=disturbance)
        assert dry.robot.hitch.coulomb_friction_n_m == 1e-3
        assert dry.believed_robot.hitch.coulomb_friction_n_m == believed
    tuned = scenario_of(controller="lyapunov_tuned").controller
    usual = LyapunovOptions(kind="lyapunov")
    assert isinstance(tuned, LyapunovOptions)
    doubled = {"alpha1": 2 * usual.alpha1, "alpha3": 2 * usual.alpha3}
    assert tuned == usual.model_copy(update=doubled)


def test_starts_and_pushes_are_scored_with_their_transient_and_worlds_are_not() -> None:
    for row in STANDARD:
        transient = row.names["disturbance"] in ("start", "push")
        assert row.scored == ("whole" if transient else "steady")
    assert scenario_of(disturbance="start").initial.x_offset_m == 0.05


def test_laws_that_do_not_steer_the_trailer_are_marked_where_it_must_be_steered() -> None:
    for row in STANDARD:
        steers = row.names["controller"] not in (*ARTICLE, "feedforward")
        assert row.meant == (steers or row.names["task"] == "outer_circle")
    assert any(not row.meant for row in STANDARD)


def test_the_laws_that_learn_learn_all_and_the_others_nothing() -> None:
    for row in STANDARD:
        scenario = scenarios("standard")[row.key]
        learned = getattr(scenario.controller, "learn", ())
        learns = row.names["controller"].endswith("_learn")
        assert len(learned) == learns * (5 - (row.names["sensing"] == "camera"))
        if scenario.sensing.kind == "camera":
            assert scenario.sensing.tracker.learn_latency is learns
            assert "latency" not in learned


def test_a_choice_overrides_more_where_it_meets_another(tmp_path: Path) -> None:
    (tmp_path / "suite.toml").write_text(
        'name = "a"\n[controller.x]\noverrides = ["control.sampling_time_s=0.03"]\n'
        'when.b = ["duration_s=3.0"]\n'
        'not_meant_for = ["t"]\n[controller.y]\n'
        '[task.s]\nscenario = "lab_circle"\n[task.t]\nscenario = "sim_circle"\n'
        '[disturbance.a]\n[disturbance.b]\noverrides = ["name=b"]\nscored = "whole"\n'
        '[sensing.truth]\n[sensing.late]\nscored = "whole"\n'
    )
    rows = rows_of(load_suite(str(tmp_path / "suite.toml")))
    found = {"-".join(row.names.values()): row for row in rows}
    period = "control.sampling_time_s=0.03"
    assert found["x-s-contact-truth-a"].overrides == (period,)
    assert found["x-s-contact-truth-b"].overrides == (period, "name=b", "duration_s=3.0")
    assert found["y-s-contact-truth-b"].overrides == ("name=b",)
    assert "duration_s=3.0" in found["x-s-contact-truth-b"].command()
    assert {name for name, row in found.items() if not row.meant} == {
        f"x-t-contact-{sensing}-{end}" for sensing in ("truth", "late") for end in "ab"
    }
    assert {name for name, row in found.items() if row.scored == "steady"} == {
        f"{law}-{task}-contact-truth-a" for law in "xy" for task in "st"
    }


def test_when_counts_whatever_a_later_axis_sets(tmp_path: Path) -> None:
    (tmp_path / "suite.toml").write_text(
        'name = "a"\n[controller.x]\noverrides = ["duration_s=1.0"]\n'
        'when.late = ["duration_s=4.0"]\nwhen.s = ["duration_s=3.0"]\n'
        '[task.s]\nscenario = "lab_circle"\noverrides = ["duration_s=2.0"]\n'
        '[task.t]\nscenario = "lab_circle"\noverrides = ["duration_s=2.0"]\n'
        "[sensing.truth]\n[sensing.late]\n"
    )
    rows = rows_of(load_suite(str(tmp_path / "suite.toml")))
    found = {key: scenario.duration_s for key, scenario in checked_scenarios(rows).items()}
    assert found == {  # of two `when` that of the later axis, as of two overrides
        "x-s-contact-truth-none-0": 3.0,
        "x-s-contact-late-none-0": 4.0,
        "x-t-contact-truth-none-0": 2.0,
        "x-t-contact-late-none-0": 4.0,
    }


def test_blocks_pick_from_the_axes(tmp_path: Path) -> None:
    (tmp_path / "suite.toml").write_text(
        'name = "a"\nseeds = [5]\n[controller.x]\n[controller.y]\nskip = ["t"]\n'
        '[task.s]\nscenario = "lab_circle"\n[task.t]\nscenario = "sim_circle"\n'
        '[[block]]\ntask = ["s"]\n[[block]]\ncontroller = ["y", "x"]\nseeds = [1, 2]\n'
    )
    keys = [row.key for row in rows_of(load_suite(str(tmp_path / "suite.toml")))]
    tail = "contact-truth-none"
    assert keys == [
        *(f"{name}-s-{tail}-5" for name in "xy"),
        *(f"{name}-{tail}-{seed}" for name in ("y-s", "x-s", "x-t") for seed in (1, 2)),
    ]


def test_a_name_on_two_axes_means_the_choice_of_the_other(tmp_path: Path) -> None:
    (tmp_path / "suite.toml").write_text(
        'name = "a"\n[controller.x]\n[controller.turn]\nskip = ["turn"]\n'
        '[task.turn]\nscenario = "lab_circle"\n[task.y]\nscenario = "lab_circle"\n'
    )
    keys = [row.key for row in rows_of(load_suite(str(tmp_path / "suite.toml")))]
    assert keys == [f"{pair}-contact-truth-none-0" for pair in ("x-turn", "x-y", "turn-y")]


def test_a_tasks_scenario_is_looked_for_beside_the_suite_first(tmp_path: Path) -> None:
    (tmp_path / "suite.toml").write_text(
        'name = "a"\n[controller.x]\n[task.s]\nscenario = "mine.toml"\n'
        '[task.t]\nscenario = "lab_circle"\n'
    )
    (tmp_path / "mine.toml").touch()
    rows = rows_of(load_suite(str(tmp_path / "suite.toml")))
    assert [row.scenario for row in rows] == [str(tmp_path / "mine.toml"), "lab_circle"]


def test_suites_larger_than_any_memory_are_counted_and_not_made(tmp_path: Path) -> None:
    names = range(300)
    text = 'name = "a"\n' + "".join(
        f"[controller.c{i}]\n[plant.p{i}]\n[sensing.s{i}]\n[task.t{i}]\nscenario = 'lab_circle'\n"
        for i in names
    )
    (tmp_path / "suite.toml").write_text(text)
    with pytest.raises(InputError, match="got 8100000000 rows"):
        load_suite(str(tmp_path / "suite.toml"))


def test_as_many_rows_as_asked_and_no_folder_of_a_suite_that_cannot_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["bench", "quick", "--out", str(tmp_path / "out")]
    assert main([*words, "--max-rows", "31"]) == 2
    assert "got 32 rows; allowed: at most 31" in capsys.readouterr().err
    (tmp_path / "bad.toml").write_text(
        'name = "bad"\n[controller.x]\noverrides = ["seeds=1"]\n[task.y]\nscenario = "lab_circle"\n'
    )
    assert main(["bench", str(tmp_path / "bad.toml"), *words[2:]]) == 2
    assert "1 row cannot run" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("name = 3", "name: got 3; allowed: a valid string"),
        ('name = "a"\n[controller.x]\n[task.y]\n', "task.y.scenario: missing"),
        ("name = ", "cannot be read as TOML"),
        (
            'name = "a"\n[controller.x]\noverride = []\n',
            "controller.x.override: unknown key .did y",
        ),
        (
            'name = "a"\n[controller.x]\nskip = ["z"]\n[task.y]\nscenario = "lab_circle"\n'
            '[[block]]\ntask = ["yy"]\n',
            "2 errors\n  controller.x.skip: got 'z'; .*\n  block.0.task: got 'yy' .did you",
        ),
        ('name = "a"\n[controller.x]\n[task.y]\n[[block]]\nplants = []\n', "block.0.plants: unk"),
        (
            'name = "a"\n[controller.x]\nwhen.z = []\nnot_meant_for = ["zz"]\n'
            '[task.y]\nscenario = "lab_circle"\n',
            "2 errors\n  controller.x.when: got 'z'.*\n  controller.x.not_meant_for: got 'zz'",
        ),
        (
            'name = "a"\n[controller.x]\nskip = ["z"]\nwhen.x = []\n[controller.z]\n'
            '[task.y]\nscenario = "lab_circle"\n',  # names of its own axis
            "2 errors\n  controller.x.when: got 'x'; .*\n  controller.x.skip: got 'z'; allowed: y",
        ),
        (
            'name = "a"\n[controller.noise]\n[task.y]\nscenario = "lab_circle"\n'
            'skip = ["noise"]\nwhen.noise = []\nnot_meant_for = ["noise"]\n'
            "[disturbance.noise]\n",
            "3 errors\n  task.y.when: 'noise' is a choice of controller and of disturbance; give .*"
            "\n  task.y.skip: 'noise' is a .*\n  task.y.not_meant_for: 'noise' is a choice of",
        ),
        (
            'name = "a"\nseeds = [3, 1, 3]\n[controller.x]\n[task.y]\n'
            '[[block]]\ncontroller = ["x", "x"]\n',
            "2 errors\n  seeds: .*3 is there 2 times; give .*\n  block.0.controller: .*'x' is",
        ),
        ('name = "a"\n[controller.x]\nscored = "half"\n', "scored: got 'half'; allowed: 'steady'"),
        (
            'name = "a"\n[controller.X]\n[task.y]\n',
            "controller.X: got 'X'; allowed: up to 64 lower-case letters, digits and _, a letter",
        ),
        (
            'name = "a"\n[controller.x]\nskip = ["y"]\n[task.y]\nscenario = "lab_circle"\n',
            "block: no row is left: `skip` leaves all",
        ),
        (
            'name = "a"\n[controller.x]\noverrides = ["seed=3"]\n[task.y]\n'
            'scenario = "lab_circle"\nwhen.x = ["seed = 4"]\n',
            "2 errors\n  controller.x.overrides: got 'seed=3'; a suite has `seeds`\n  task.y.over",
        ),
        (
            f'name = "a"\nseeds = {list(range(5001))}\n[controller.x]\n[controller.z]\n'
            '[task.y]\nscenario = "lab_circle"\n',
            "block: got 10002 rows; allowed: at most 10000; .*--max-rows",
        ),
        (
            f'name = "a"\n[controller.{"x" * 64}]\n[task.{"y" * 64}]\nscenario = "lab_circle"\n'
            f"[plant.{'p' * 64}]\n[sensing.{'s' * 64}]\n",
            "block: got 'xxx.*; allowed: names of choices that together have 255 letters",
        ),
    ],
)
def test_wrong_suites_are_refused(text: str, expected: str, tmp_path: Path) -> None:
    (tmp_path / "suite.toml").write_text(text)
    with pytest.raises(InputError, match=expected):
        load_suite(str(tmp_path / "suite.toml"))
    with pytest.raises(InputError, match=r"shipped: .*standard"):
        load_suite("nothing")
