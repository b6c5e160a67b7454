"""Model predictive control: agrees with the LQR near the reference, recovers far from it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from ttwmr_mj.controllers.base import Task
from ttwmr_mj.controllers.mpc import MpcOptions
from ttwmr_mj.controllers.tvlqr import TvlqrOptions
from ttwmr_mj.references.nothing import Nothing
from ttwmr_mj.results.metrics import score
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs.build import make_controller
from ttwmr_mj.runs.execute import run_scenario
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.runs.report import details_text
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.motion import initial_state, sample_reference
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.sensing import Estimate

PERIOD = 0.033
MPC = MpcOptions(kind="mpc", horizon_samples=20)


def with_mpc(name: str, *overrides: str) -> Scenario:
    return load_scenario(name, list(overrides)).model_copy(update={"controller": MPC})


def steady_mm(scenario: Scenario) -> float:
    result = Experiment(scenario).run()
    assert result.outcomes[0].status == "ok", result.outcomes[0].reason
    value = score(result.trajectory, scenario.robot)[0]["steady_centre_of_oscillation_rmse_m"]
    assert value is not None
    return 1e3 * value


def first_command(scenario: Scenario, options: MpcOptions | TvlqrOptions) -> np.ndarray:
    scenario = scenario.model_copy(update={"controller": options})
    reference = sample_reference(scenario)
    controller = make_controller(scenario, Path())
    controller.start(Task(scenario.robot, reference, PERIOD, 1, np.random.default_rng(0)))
    state = initial_state(scenario, reference)
    seen = Estimate(state, np.zeros(1), np.ones(1, dtype=np.bool_), np.full(1, np.nan))
    return controller.command(0, seen).wheel_speed_rad_s


def test_near_the_reference_it_is_the_lqr() -> None:
    """With the LQR's cost beyond the horizon, the horizon makes no difference to first order."""
    errors = []
    for offset in (1e-3, 1e-4):
        start = [f"initial.x_offset_m={offset}", f"initial.theta2_offset_rad={offset}"]
        near = load_scenario("outer_circle", ["duration_s=8.0", *start])
        mpc = first_command(near, MPC)
        lqr = first_command(near, TvlqrOptions(kind="tvlqr"))
        errors.append(np.abs(mpc - lqr).max())
    assert errors[0] < 0.02
    # the coarser prediction leaves a small linear part beside the quadratic one
    assert errors[1] < 0.2 * errors[0]


@pytest.mark.slow
def test_far_from_the_reference_it_recovers() -> None:
    """0.2 m and 0.8 rad off, the trailer inside, the servo at its limits."""
    far = with_mpc(
        "inverted_trailer",
        "plant.kind=analytic",
        "initial.x_offset_m=0.2",
        "initial.theta2_offset_rad=0.8",
        "duration_s=16.0",
    )
    assert steady_mm(far) < 1.0


def test_limits_are_kept() -> None:
    far = with_mpc("outer_circle", "plant.kind=analytic", "initial.x_offset_m=0.4", "duration_s=4")
    result = Experiment(far).run()
    commands = result.trajectory.wheel_command_rad_s[:, 0]
    servo = far.robot.servo
    assert np.abs(commands).max() <= servo.speed_limit_rad_s
    step = servo.acceleration_limit_rad_s2 * PERIOD
    assert np.abs(np.diff(commands, axis=0)).max() <= step + 1e-9
    assert result.trajectory.saturated.any()


def test_a_batch_is_its_single_runs() -> None:
    noisy = with_mpc(
        "outer_circle", "plant.kind=analytic", "sensing.position_noise_m=0.001", "duration_s=1.5"
    )
    batch = Experiment(noisy, nsim=3).run().trajectory
    assert not np.array_equal(batch.q[-1, 0], batch.q[-1, 1])
    assert np.isfinite(batch.q).all()


def test_overruns_are_counted_and_reported_and_change_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    quiet = ["output.recording=false", "output.figures=false"]
    scenario = with_mpc("outer_circle", "plant.kind=analytic", "duration_s=0.4", *quiet)
    usual = Experiment(scenario).run().trajectory
    clock = iter(0.04 * np.arange(10_000))  # every command takes 40 ms
    monkeypatch.setattr("ttwmr_mj.runs.closed_loop.stopwatch.perf_counter", lambda: next(clock))
    metrics = run_scenario(scenario, tmp_path).metrics
    assert metrics["control_overruns"] == len(usual)
    assert metrics["control_slowest_s"] == pytest.approx(0.04)
    assert json.loads((tmp_path / "metrics.json").read_text())["control_overruns"] == len(usual)
    text = details_text(metrics)
    assert f"commands slower than the period | {len(usual)} |" in text
    assert "slowest command, wall time | 40 ms |" in text
    assert np.array_equal(Trajectory.read(tmp_path / "trajectory.parquet").q, usual.q)


def test_it_needs_a_reference() -> None:
    (fault,) = MPC.faults(Nothing(), None)
    assert "controller.kind = 'mpc' needs a reference" in str(fault)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "limit_mm"),
    [("outer_circle", 0.3), ("inverted_trailer", 0.6), ("flat_figure_eight", 3.0)],
)
def test_contact_physics_meets_the_figures(name: str, limit_mm: float) -> None:
    assert steady_mm(with_mpc(name)) <= limit_mm


@pytest.mark.slow
def test_a_command_fits_into_its_period() -> None:
    experiment = Experiment(with_mpc("inverted_trailer", "plant.kind=analytic", "duration_s=10.0"))
    result = experiment.run()
    # the mean over the run: a busy machine may stretch single commands
    mean_s = result.wall_time_s["controller"] / len(result.trajectory)
    assert mean_s < PERIOD
