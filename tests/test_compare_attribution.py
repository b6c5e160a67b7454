"""Who contributes what to the deviation: the effects and the tables of the attribution."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from comparisons import open_loop, run_commands

from ttwmr_mj.cli.main import main
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.compare.explain import attribution
from ttwmr_mj.studies.compare.explain.attribution import (
    Attribution,
    Contribution,
    attribute,
    over_time,
    table,
)
from ttwmr_mj.studies.compare.explain.convergence import converge, refined
from ttwmr_mj.studies.compare.explain.effects import EFFECTS, with_effects
from ttwmr_mj.studies.compare.pair import run_pair

BRISK = ((0.5, 5.0, 5.0), (0.8, 5.6, 3.2))


def everything() -> Scenario:
    """A scenario in which every effect is present."""
    robot: dict[str, Any] = {
        "tractor": {"wheel_shape": "cylinder"},
        "hitch": {"damping_n_m_s_rad": 1e-3, "coulomb_friction_n_m": 1e-4},
        "casters": {"rolling_resistance_m": 1e-5},
    }
    return open_loop(*BRISK, robot=robot)


def test_every_effect_can_be_switched_off_and_on() -> None:
    full = everything()
    assert all(effect.present(full) for effect in EFFECTS)
    ideal = with_effects(full, ())
    assert not ideal.robot.hitch.damping_n_m_s_rad
    assert ideal.robot.tractor.wheel_shape == "ellipsoid"
    assert with_effects(full, [effect.name for effect in EFFECTS]) == full


def test_the_friction_of_every_hitch_can_be_switched_off() -> None:
    full = load_scenario("two_trailers_turn")
    (friction,) = (effect for effect in EFFECTS if effect.name == "hitch_friction")
    assert friction.present(full)
    ideal = with_effects(full, ())
    assert [hitch.damping_n_m_s_rad for hitch in ideal.robot.hitches] == [0.0, 0.0]
    assert not friction.present(ideal)
    assert with_effects(full, [effect.name for effect in EFFECTS]) == full


@pytest.mark.slow
def test_a_comparison_of_trains_says_where_the_deviation_comes_from(tmp_path: Path) -> None:
    assert (
        main(["compare", "two_trailers_turn", "--converge", "--out", str(tmp_path), "--quiet"]) == 0
    )
    report = json.loads((tmp_path / "compare.json").read_text())
    told = report["attribution"]
    for angle in ("theta2", "theta3"):
        sizes = {name: row["contribution_rad"] for name, row in told[angle].items()}
        assert sizes.pop("total") == pytest.approx(report[f"{angle}_deviation_rms_rad"])
        assert sum(sizes.values()) == pytest.approx(report[f"{angle}_deviation_rms_rad"])
        assert told[angle]["hitch_friction"]["share"] > 0.2  # of hitches that nothing turns
    assert report["convergence"]["order"]["theta3_deviation_max_rad"] == pytest.approx(1.0, abs=0.1)
    rows = pq.read_table(tmp_path / "attribution.parquet")
    assert rows.num_rows == 243  # 8 s in periods of 33 ms, both ends
    assert {"theta3_total_rad", "theta3_hitch_friction_rad"} <= set(rows.column_names)
    assert "θ3 by more than" in (tmp_path / "report.html").read_text()


def test_the_attribution_adds_up_and_finds_a_weak_servo() -> None:
    full = open_loop(*BRISK, robot={"servo": {"velocity_gain_n_m_s_rad": 0.2}})
    result = attribute(full, run_commands(full))
    assert result.present == ("servo", "contact_compliance", "caster_inertia", "timestep")
    for quantity in ("position", "theta1", "theta2"):
        *parts, total = result.tables[quantity]
        assert total.name == "total"
        assert sum(row.size for row in parts) == pytest.approx(total.size)
        for row in parts[:-2]:
            assert row.alone is not None
            assert row.interaction is not None
            assert row.alone + row.interaction == pytest.approx(row.size)
    shares = {row.name: row.share for row in result.tables["position"]}
    assert shares["servo"] == pytest.approx(1.0, abs=0.1)
    assert shares["rest"] == pytest.approx(0.0, abs=0.1)
    own = shares["contact_compliance"], shares["timestep"]
    assert result.as_json()["solver_share"]["position"] == pytest.approx(sum(own))


@pytest.mark.slow
def test_what_effects_contribute_does_not_hang_on_how_ideal_the_ideal_is(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The swing of a trailer without friction was counted as what friction did on the ideal."""
    full = load_scenario("lab_circle", ["duration_s=8.25"])
    commands = run_commands(full)
    tables = []
    for steps in (4, 8):
        monkeypatch.setattr("ttwmr_mj.studies.compare.explain.effects.IDEAL_STEPS", steps)
        tables.append(attribute(full, commands).tables["theta2"])
    total = tables[0][-1].size
    for coarse, fine in zip(*tables, strict=True):
        if coarse.name == "hitch_friction":  # two ideal robots with the same have the same motion
            assert coarse.alone == pytest.approx(0.0, abs=0.04 * total)
        if coarse.name != "rest":  # it is what the extrapolation leaves; others differ by 2 %
            assert coarse.size == pytest.approx(fine.size, abs=0.04 * total), coarse.name
    rest = [rows[-2].size for rows in tables]
    assert abs(rest[1]) < abs(rest[0]) < 0.05 * total


LATE = {"command_latency_s": 0.01, "command_jitter_s": 0.033, "command_drop_probability": 0.3}


@pytest.mark.parametrize("real_wheels", [False, True])
@pytest.mark.parametrize(
    "more",
    [{"robot": {"servo": {"velocity_gain_n_m_s_rad": 0.2}}}, {"world": "lab", "control": LATE}],
    ids=["weak_servo", "motor_and_late_commands"],
)
def test_what_is_explained_is_the_deviation_that_is_told(
    more: dict[str, Any], real_wheels: bool
) -> None:
    pair = run_pair(open_loop((0.2, 5.0, 5.0), (0.2, 5.6, 3.2), **more), real_wheels=real_wheels)
    run = pair.contact
    result = attribute(run.scenario, run.commands, real_wheels=real_wheels)
    assert ("servo" in result.present) == (not real_wheels)
    for quantity, rows in result.tables.items():
        told = pair.numbers[f"{quantity}_deviation_rms_{attribution.unit_of(quantity)}"]
        assert rows[-1].size == pytest.approx(told, rel=1e-9)
        assert sum(row.size for row in rows[:-1]) == pytest.approx(told)
    shares = {row.name: row.share for row in result.tables["position"]}
    assert shares["rest"] == pytest.approx(0.0, abs=0.05)


def test_what_is_refined_is_the_deviation_that_is_told() -> None:
    full = open_loop((0.2, 5.0, 5.0), (0.2, 5.6, 3.2), world="lab")
    pair = run_pair(full, real_wheels=True)
    run = pair.contact
    study = converge(run.scenario, run.commands, levels=2, real_wheels=True)
    for name, values in study.deviations.items():
        assert values[0] == pytest.approx(pair.numbers[name], rel=1e-9), name
    assert study.orders["position_deviation_max_m"] == pytest.approx(1.0, abs=0.1)


def test_what_a_world_fills_in_can_be_switched_off() -> None:
    full = open_loop(*BRISK, world="lab")
    assert full.robot.servo.motor
    assert with_effects(full, ()).robot.servo.motor is None
    assert refined(full, 0).robot.servo.motor is None


def test_what_cannot_be_switched_off_whole_is_extrapolated(monkeypatch: pytest.MonkeyPatch) -> None:
    """By hand: a deviation to which each effect adds its size, and two effects their product."""
    sizes_m = {"timestep": 1.0, "contact_compliance": 3.0, "caster_inertia": 20.0}
    full = everything()
    robot, contact = full.robot, full.plant.contact
    whole = {
        "timestep": contact.timestep_s,
        "contact_compliance": contact.contact_time_constant_s,
        "caster_inertia": robot.casters.mass_kg,
    }

    def made(variant: Scenario) -> dict[str, float]:
        """Contributions in m."""
        now = (
            variant.plant.contact.timestep_s,
            variant.plant.contact.contact_time_constant_s,
            variant.robot.casters.mass_kg,
        )
        part = {name: sizes_m[name] * x / whole[name] for name, x in zip(whole, now, strict=True)}
        part["servo"] = 5.0 * (variant.robot.servo == robot.servo)
        part["hitch_friction"] = -2.0 * (variant.robot.hitch == robot.hitch)
        part["both"] = 0.5 * part["servo"] * part["hitch_friction"]
        return part

    def deviation(variant: Scenario) -> SimpleNamespace:
        return SimpleNamespace(q=np.full((1, 4), sum(made(variant).values())))

    monkeypatch.setattr(attribution, "deviation_under", lambda *_, **__: deviation)
    rows = attribute(full, np.zeros((1, 2))).tables["theta1"]
    size = {row.name: row.size for row in rows}
    alone = {row.name: row.alone for row in rows}
    for name, expected in sizes_m.items():
        assert size[name] == alone[name] == pytest.approx(expected)
    assert (alone["servo"], alone["hitch_friction"]) == pytest.approx((5.0, -2.0))
    # the product, -5, is shared evenly
    assert (size["servo"], size["hitch_friction"]) == pytest.approx((2.5, -4.5))
    assert size["wheel_width"] == size["rolling_resistance"] == pytest.approx(0.0)
    assert (size["higher_interactions"], size["rest"]) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert size["total"] == pytest.approx(22.0)


def test_a_contribution_is_its_projection_on_the_total() -> None:
    """By hand: δ = (3, 4) mm at one sample; one effect along it, one across, one rest."""
    total, along = np.array([[3.0, 4.0, 0.0, 0.0]]), np.array([[1.5, 2.0, 0.0, 0.0]])
    across = np.array([[-4.0, 3.0, 0.0, 0.0]])
    none = np.zeros_like(total)
    rows = table({"one": (along, across), "two": (none, none)}, 0.5 * along, total, [0, 1])
    one, two, higher, rest, whole = rows
    assert (one.alone, one.interaction, one.size) == pytest.approx((2.5, 0.0, 2.5))
    assert (one.share, one.rms) == pytest.approx((0.5, np.hypot(-2.5, 5.0)))
    assert (two.size, two.rms) == (0.0, 0.0)
    assert (higher.size, rest.size, whole.size) == pytest.approx((1.25, 1.25, 5.0))
    assert whole.share == pytest.approx(1.0)


def test_over_time_contributions_add_up_to_the_deviation_at_every_sample() -> None:
    random = np.random.default_rng(2)
    total, a, i, b, higher = random.normal(size=(5, 40, 4))
    none = np.zeros_like(total)
    parts = {"one": (a, i), "two": (b, none)}
    of_p = over_time(parts, higher, total, [0, 1])
    whole = of_p.pop("total")
    np.testing.assert_allclose(whole, np.hypot(total[:, 0], total[:, 1]))
    np.testing.assert_allclose(sum(of_p.values()), whole)
    # what acts across the deviation adds nothing to its size
    across = np.stack([-total[:, 1], total[:, 0], none[:, 0], none[:, 0]], axis=1)
    of_p = over_time({"one": (across, none)}, none, total, [0, 1])
    np.testing.assert_allclose(of_p["one"], 0.0, atol=1e-12)
    # an angle keeps its sign
    of_theta2 = over_time(parts, higher, total, [3])
    np.testing.assert_allclose(of_theta2["one"], a[:, 3] + i[:, 3])
    np.testing.assert_allclose(of_theta2["total"], total[:, 3])


def test_where_nothing_deviates_nothing_contributes() -> None:
    zero = np.zeros((3, 4))
    curves = over_time({"one": (zero, zero)}, zero, zero, [0, 1])
    assert all((values == 0.0).all() for values in curves.values())


def test_the_contributions_are_a_table_with_units() -> None:
    full = open_loop(*BRISK)
    found = attribute(full, run_commands(full))
    read = found.to_table()
    columns = read.column_names
    assert columns[0] == "time_s"
    assert {"position_servo_m", "theta1_rest_rad", "theta2_total_rad"} <= set(columns)
    time_s = read["time_s"].to_numpy()
    np.testing.assert_allclose(np.diff(time_s), full.control.sampling_time_s)
    parts = [read[c].to_numpy() for c in columns if c.startswith("theta2_") and "total" not in c]
    np.testing.assert_allclose(sum(parts), read["theta2_total_rad"].to_numpy(), atol=1e-15)
    assert np.sqrt(np.mean(read["position_total_m"].to_numpy() ** 2)) == pytest.approx(
        found.tables["position"][-1].size
    )


def test_a_large_rest_is_explained() -> None:
    def found(total: float, rest: float) -> Attribution:
        part = Contribution("servo", 0.0, 0.0, total - rest, 1.0 - rest / total, total - rest)
        none = Contribution("higher_interactions", None, None, 0.0, 0.0, 0.0)
        left = Contribution("rest", None, None, rest, rest / total, rest)
        whole = Contribution("total", None, None, total, 1.0, total)
        return Attribution(("servo",), {"theta2": (part, none, left, whole)})

    assert found(1.0, 0.09).note("theta2") is None
    assert found(1e-3, 0.09e-3).as_json()["notes"] == {}
    assert "they do not add up" in found(4.0, 1.7).as_json()["notes"]["theta2"]
    assert "25.0 % of the sum" in str(found(1e-3, 0.2e-3).note("theta2"))


@pytest.mark.slow
def test_every_effect_is_attributed() -> None:
    full = everything()
    result = attribute(full, run_commands(full))
    assert result.present == tuple(effect.name for effect in EFFECTS)
    for rows in result.tables.values():
        assert sum(row.size for row in rows[:-1]) == pytest.approx(rows[-1].size)
