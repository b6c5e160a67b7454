"""Laws that learn, in worlds that they are told nothing of, and what such runs are judged by."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from ttwmr_mj.controllers.base import Task
from ttwmr_mj.controllers.flatness import Flatness, FlatnessOptions
from ttwmr_mj.controllers.shared.estimation.friction import FrictionOptions
from ttwmr_mj.controllers.tvlqr import Tvlqr, TvlqrOptions
from ttwmr_mj.dynamics.floor.influence import DRY, influence_of
from ttwmr_mj.references.flat_circle import FlatCircle
from ttwmr_mj.references.shared.carried import carried
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.results.metrics import score
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.runs.execute import run_scenario
from ttwmr_mj.runs.experiment import Experiment, Result
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.motion import believed_reference, sample_reference
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import FloatArray, RobotState

LEVEL = "belief.ground.slope_rad=0.0"
SLOPE = "ground.slope_rad=0.0349", LEVEL  # 2°
ROLLING = "robot.casters.rolling_resistance_m=1e-4", "belief.robot.casters.rolling_resistance_m=0.0"
LATE = "sensing.latency_s=0.066", "belief.latency_s=0.0"
SLOW_MPC = pytest.param("mpc", marks=pytest.mark.slow)
STANDING = 'initial={kind="at_rest"}'
EVERYTHING = (
    "slope",
    "rolling_resistance",
    "dry_friction",
    "viscous_friction",
    "latency",
    "wheel_radius",
)


def alone(law: str) -> tuple[str, ...]:
    """A law that is lost shall be: nothing leads it back."""
    return () if law == "mpc" else ('controller.recovery="own"',)


def scenario_of(law: str, learn: tuple[str, ...], *sets: str) -> Scenario:
    names = ", ".join(f'"{name}"' for name in learn)
    controller = f'controller={{kind="{law}", learn=[{names}]}}'
    return load_scenario("inverted_trailer", ["duration_s=14.0", controller, *sets])


@cache
def result(law: str, learn: tuple[str, ...], *sets: str) -> Result:
    return Experiment(scenario_of(law, learn, *sets)).run()


def errors(found: Result) -> FloatArray:
    """(2,) of F and P [m], rms over the second half."""
    (numbers,) = score(found.trajectory, found.scenario.robot)
    names = "steady_centre_of_oscillation_rmse_m", "steady_tractor_rmse_m"
    return np.array([numbers[name] for name in names], dtype=np.float64)


@pytest.mark.slow
@pytest.mark.parametrize("law", ["tvlqr", SLOW_MPC])
def test_a_slope_that_nobody_told_of(law: str) -> None:
    found = errors(result(law, ("slope",), *SLOPE))
    assert found[0] < 2e-3
    assert errors(result(law, (), *SLOPE, *alone(law)))[0] > 0.1  # lost
    gravity = influence_of(RobotParameters(), result(law, ("slope",), *SLOPE).scenario.ground)[:2]
    rows = result(law, ("slope",), *SLOPE).trajectory.signals
    for i, axis in enumerate("xy"):
        values, std = (rows[f"learned_gravity_{axis}{what}_m_s2"] for what in ("", "_std"))
        # the tyres' creep, which the model lacks, makes a few mm/s²
        assert abs(values[-1, 0] - gravity[i]) < 3.0 * std[-1, 0] + 5e-3
        assert std[-1, 0] < 0.3 * std[0, 0]


@pytest.mark.slow
@pytest.mark.parametrize("law", ["flatness", "tvlqr", "mpc"])
def test_in_the_laboratory_motors_and_noise_are_not_taken_for_forces(law: str) -> None:
    learn = ("slope", "rolling_resistance", "dry_friction", "viscous_friction")
    with_it, without = (result(law, what, "world=lab") for what in (learn, ()))
    assert with_it.verdicts[0].name == "followed"
    if law != "flatness":  # whose feedback shakes with noise and motor, learning or not
        assert errors(with_it)[0] < 0.5 * errors(without)[0]


@pytest.mark.slow
@pytest.mark.parametrize("law", ["tvlqr", SLOW_MPC])
def test_rolling_resistance_that_nobody_told_of(law: str) -> None:
    found = result(law, ("rolling_resistance",), *ROLLING)
    f, p = errors(found)
    assert f < 1e-3
    assert p < 3e-3
    assert errors(result(law, (), *ROLLING, *alone(law)))[0] > 10.0 * f
    # on a steady circle an unexplained θ̈2 looks alike, and takes a share
    learned = found.trajectory.signals["learned_rolling_resistance_m"][-1, 0]
    assert learned == pytest.approx(1e-4, rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(
    "law", [pytest.param("flatness", marks=pytest.mark.slow), "tvlqr", SLOW_MPC]
)
def test_two_frames_of_latency_that_nobody_told_of(law: str) -> None:
    found = result(law, ("latency",), *LATE)
    assert errors(found)[0] < 2e-3
    assert found.verdicts[0].name == "followed"
    late = found.trajectory.signals["learned_latency_s"][-1, 0]
    assert np.rint(late / 0.033) == 2.0
    assert result(law, (), *LATE, *alone(law)).verdicts[0].name != "followed"


@pytest.mark.slow
def test_what_was_learned_under_a_wrong_latency_is_forgotten() -> None:
    one = "sensing.latency_s=0.033", "belief.latency_s=0.0"
    found = result("flatness", EVERYTHING, *one)
    assert found.verdicts[0].name == "followed"
    assert errors(found)[0] < 2e-3


@pytest.mark.slow
def test_a_plan_made_anew_is_for_when_commands_arrive() -> None:
    """Two periods of command latency that are told, on a slope that is not."""
    sets = (*SLOPE, "control.command_latency_s=0.066", "plant.kind=analytic")
    assert errors(result("tvlqr", ("slope",), *sets))[0] < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.98, pytest.param(1.02, marks=pytest.mark.slow)])
def test_a_wheel_radius_that_is_off(share: float) -> None:
    radius = RobotParameters().tractor.wheel_radius_m
    true = f"robot.tractor.wheel_radius_m={share * radius}"
    sets = (true, f"belief.robot.tractor.wheel_radius_m={radius}")
    signals = result("tvlqr", ("wheel_radius",), *sets).trajectory.signals
    found = signals["learned_wheel_radius_m"][300:, 0]
    std = signals["learned_wheel_radius_std_m"][300:, 0]
    assert (np.abs(found - share * radius) < 3.0 * std).all()
    assert (std < 0.01 * radius).all()
    # of the 2 %, but for a tenth: tyres creep too
    assert found.mean() == pytest.approx(share * radius, abs=0.002 * radius)


def test_a_robot_that_stands_tells_nothing_of_its_wheels() -> None:
    signals = result("tvlqr", ("wheel_radius",), "duration_s=0.5", STANDING).trajectory.signals
    assert set(signals) == {"learned_wheel_radius_m", "learned_wheel_radius_std_m"}
    assert np.isnan(signals["learned_wheel_radius_m"][0, 0])
    assert np.isinf(signals["learned_wheel_radius_std_m"][0, 0])
    assert np.isfinite(signals["learned_wheel_radius_std_m"][-1, 0])


def test_the_log_says_what_was_learned_with_units(tmp_path: Path) -> None:
    scenario = scenario_of("flatness", EVERYTHING, "duration_s=0.3", STANDING)
    run = run_scenario(scenario, tmp_path)
    names = pq.read_schema(run.folder / "trajectory.parquet").names
    of_trailer = {
        "gravity_x": "m_s2",
        "gravity_y": "m_s2",
        "rolling_resistance": "m",
        "dry_friction": "n_m",
        "viscous_friction": "n_m_s_rad",
        "wheel_radius": "m",
    }
    expected = {f"learned_{n}{std}_{u}" for n, u in of_trailer.items() for std in ("", "_std")}
    assert {name for name in names if "learned" in name} == expected | {"learned_latency_s"}


@pytest.mark.slow
def test_runs_are_judged_by_what_carries_f_on_the_floor_there_is() -> None:
    scenario = scenario_of("tvlqr", ("slope",), *SLOPE)
    level = scenario_of("tvlqr", ("slope",))
    told, judged = believed_reference(scenario), sample_reference(scenario)
    plain = sample_reference(level)
    assert told is not None
    assert judged is not None
    assert plain is not None
    np.testing.assert_array_equal(told.q, plain.q)  # level is believed
    influence = influence_of(scenario.robot, scenario.ground)
    np.testing.assert_array_equal(judged.q, carried(plain, scenario.robot, influence).q)
    assert np.abs(judged.q - plain.q)[..., 3].max() > 0.3
    rows = result("tvlqr", ("slope",), *SLOPE).trajectory
    np.testing.assert_array_equal(rows.ref_q, judged.q[: len(rows.ref_q)])
    np.testing.assert_array_equal(rows.ref_q_rate, judged.q_rate[: len(rows.ref_q)])
    # who rides that motion has no error of θ2
    off = rows.q[300:, 0, 3] - rows.ref_q[300:, 0, 3]
    assert np.abs((off + np.pi) % (2.0 * np.pi) - np.pi).max() < 0.02


def test_the_filter_smooths_dry_friction_as_the_law_does() -> None:
    smooth = FrictionOptions(smoothing_rad_s=2.0)
    law = Flatness(FlatnessOptions(kind="flatness", learn=("dry_friction",), friction=smooth))
    path = FlatCircle(radius_m=0.6, angular_rate_rad_s=1.0).sample(
        0.033 * np.arange(70), RobotParameters()
    )
    law.start(Task(RobotParameters(), path, 0.033, 1, np.random.default_rng(0)))
    learner = law._observer.learner
    assert learner is not None
    factors = learner._factors(np.zeros((1, 5)), np.ones((1, 2)), np.array([2.0]))
    assert factors[0, DRY] == pytest.approx(-np.sqrt(0.5))


def test_another_trailer_that_is_believed_in_has_a_reference_of_its_own() -> None:
    longer = "belief.robot.trailer.com_offset_m=0.16"
    scenario = scenario_of("tvlqr", (), longer)
    told, judged = believed_reference(scenario), sample_reference(scenario)
    times = scenario.control.sampling_time_s * np.arange(scenario.samples)
    of_truth = scenario.reference.sample(times, scenario.robot)
    of_belief = scenario.reference.sample(times, scenario.believed_robot)
    assert told is not None
    assert judged is not None
    assert of_truth is not None
    assert of_belief is not None
    np.testing.assert_array_equal(judged.q, of_truth.q)
    np.testing.assert_array_equal(told.q, of_belief.q)
    assert np.abs(told.q - judged.q).max() > 5e-3


@pytest.mark.slow
def test_plans_are_made_anew_early_and_then_every_eight_seconds() -> None:
    law = Tvlqr(TvlqrOptions(learn=("slope",)))
    time_s = 0.033 * np.arange(1000)
    path = FlatCircle(radius_m=0.6, angular_rate_rad_s=1.0).sample(time_s, RobotParameters())
    law.start(Task(RobotParameters(), path, 0.033, 1, np.random.default_rng(0)))
    made: list[tuple[int, int]] = []
    none = np.zeros(1)
    at = RobotState(path.q[0], path.q_rate[0])
    now = law._observer.update(Estimate(at, none, none == 0.0, none))
    since: list[int] = []

    def note(path: ReferencePath, passes: int = 0) -> None:
        assert passes > 0
        made.append((len(since), len(path.time_s)))

    law._plan = note  # type: ignore[method-assign]
    for k in range(900):
        since += [law._since_plan(k, now)]
    assert [k for k, _ in made] == [30, 60, 120, 242, 484, 726]  # 1, 2, 4, 8, 16 and 24 s
    assert [since[k] for k in (29, 30, 59, 60, 700)] == [29, 0, 29, 0, 700 - 484]
    longest = max(b - a for (a, _), (b, _) in pairwise(made))
    # each reaches beyond the next; the last to where the reference ends
    assert all(length > longest + 100 for _, length in made[:-1])
