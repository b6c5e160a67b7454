"""Every shipped scenario on every plant: finite, repeatable, and true to what it is for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from trajectories import different

from ttwmr_mj.assets import shipped_scenarios
from ttwmr_mj.controllers.custom import CustomOptions
from ttwmr_mj.errors import InputError
from ttwmr_mj.results.metrics import Metrics, score
from ttwmr_mj.runs.experiment import Experiment, Result
from ttwmr_mj.scenario.file import load_scenario

PLANTS = ("contact", "analytic")


def run(name: str, *overrides: str) -> Result:
    return Experiment(load_scenario(name, list(overrides))).run()


def scored(name: str, plant: str) -> Metrics:
    scenario = load_scenario(name, [f"plant.kind={plant}"])
    return score(Experiment(scenario).run().trajectory, scenario.robot)[0]


QUICK = {  # of each kind one
    ("lab_circle", "contact"),
    ("lab_circle", "analytic"),
    ("lab_circle_camera", "contact"),
    ("inverted_trailer", "contact"),
    ("inverted_trailer_torque", "contact"),
    ("open_loop_turn", "analytic"),
    ("outdoor_circle", "contact"),
    ("triple_inverted", "contact"),
}
PAIRS = [
    pytest.param(name, plant, marks=[] if (name, plant) in QUICK else pytest.mark.slow)
    for name in shipped_scenarios()
    for plant in PLANTS
    if (name, plant) != ("outdoor_circle", "analytic")  # which knows no terrain
]


@pytest.mark.parametrize(("name", "plant"), PAIRS)
def test_runs_finite_and_repeats_bit_for_bit(name: str, plant: str) -> None:
    by_camera = load_scenario(name).sensing.kind == "camera"  # a frame takes a while
    overrides = [f"plant.kind={plant}", f"duration_s={0.7 if by_camera else 1.0}"]
    first, second = run(name, *overrides), run(name, *overrides)
    assert [outcome.status for outcome in first.outcomes] == ["ok"]
    assert np.isfinite(first.trajectory.q).all()
    assert np.isfinite(first.trajectory.wheel_command_rad_s).all()
    assert different(first.trajectory, second.trajectory) == []


def test_another_seed_changes_noise_and_nothing_without_noise() -> None:
    quiet = ["plant.kind=analytic", "duration_s=2.0"]
    noisy = [*quiet, "sensing.position_noise_m=0.001"]
    other_seed = run("lab_circle", *quiet, "seed=5").trajectory
    assert different(run("lab_circle", *quiet).trajectory, other_seed) == []
    a, b = run("lab_circle", *noisy).trajectory, run("lab_circle", *noisy, "seed=5").trajectory
    assert not np.array_equal(a.est_q, b.est_q)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "limit_m"), [("lab_circle", 0.5e-3), ("sim_circle", 2e-3)])
def test_law_32_tracks_on_contact_physics_as_on_the_model(name: str, limit_m: float) -> None:
    contact, analytic = scored(name, "contact"), scored(name, "analytic")
    assert contact["steady_tractor_rmse_m"] <= limit_m
    # the two plants are asked to agree within 1 mm
    assert contact["steady_tractor_rmse_m"] == pytest.approx(
        analytic["steady_tractor_rmse_m"], abs=1e-3
    )
    assert contact["tractor_rmse_m"] == pytest.approx(analytic["tractor_rmse_m"], abs=1e-3)


def test_a_batch_run_is_its_single_run() -> None:
    scenario = load_scenario("lab_circle", ["duration_s=2.0"])
    alone = Experiment(scenario).run().trajectory
    among = Experiment(scenario, nsim=3).run().trajectory
    for i in range(3):
        assert different(among.simulation(i), alone) == []


@pytest.mark.parametrize(
    ("target", "reason", "rows"),
    [
        ("misbehaving:Runaway", "wheel speeds are not finite", 11),
        ("misbehaving:Broken", "controller.command() raised ZeroDivisionError: of its own", 6),
    ],
)
def test_a_broken_controller_ends_the_run_and_what_was_reached_is_kept(
    target: str, reason: str, rows: int
) -> None:
    overrides = ["plant.kind=analytic", "duration_s=3.0"]
    scenario = load_scenario("open_loop_turn", overrides)
    custom = CustomOptions(kind="custom", target=target)
    scenario = scenario.model_copy(update={"controller": custom})
    result = Experiment(scenario, folder=Path(__file__).parent).run()
    outcome = result.outcomes[0]
    assert outcome.status == "failed"
    assert reason in outcome.reason
    assert outcome.time_s == pytest.approx((rows - 1) * 0.033)
    assert len(result.trajectory) == rows
    assert np.isfinite(result.trajectory.q).all()


@pytest.mark.parametrize("target", ["misbehaving:np", "misbehaving:Estimate", "misbehaving:nobody"])
def test_a_target_that_is_no_controller_is_refused(target: str) -> None:
    """A module, a class of another kind, nothing at all."""
    scenario = load_scenario("open_loop_turn").model_copy(
        update={"controller": CustomOptions(target=target)}
    )
    with pytest.raises(InputError, match=r"controller\.target: got .* has no class"):
        Experiment(scenario, folder=Path(__file__).parent)
