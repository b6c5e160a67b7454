"""Riccati recursion, tracking problem, time-varying LQR."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from ttwmr_mj.controllers import tvlqr
from ttwmr_mj.controllers.base import Task
from ttwmr_mj.controllers.shared.estimation.friction import FrictionOptions
from ttwmr_mj.controllers.shared.optimal.gauss_newton import fit
from ttwmr_mj.controllers.shared.optimal.riccati import backward
from ttwmr_mj.controllers.shared.optimal.tracking_problem import TrackingProblem, TrackingWeights
from ttwmr_mj.controllers.tvlqr import Tvlqr, TvlqrOptions
from ttwmr_mj.dynamics.kinematics import twist_from_wheels
from ttwmr_mj.dynamics.sampled.one_trailer import SampledModel
from ttwmr_mj.errors import InputError
from ttwmr_mj.references.flat_circle import FlatCircle
from ttwmr_mj.references.planned import Planned
from ttwmr_mj.results.metrics import score
from ttwmr_mj.robot import Hitch, RobotParameters, Servo
from ttwmr_mj.runs.experiment import Experiment, Result
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.motion import initial_state, sample_reference
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import RobotState

ROBOT = RobotParameters(servo=Servo(preset="fast"))
PERIOD = 0.033
CAMERA_LIKE = [
    "sensing.position_noise_m=0.0002",
    "sensing.angle_noise_rad=0.001",
    "sensing.velocity_noise_m_s=0.0086",
    "sensing.rate_noise_rad_s=0.043",
    "sensing.latency_s=0.033",
]


def problem() -> TrackingProblem:
    return TrackingProblem(ROBOT, SampledModel(ROBOT, PERIOD), TrackingWeights())


def with_tvlqr(name: str, *overrides: str) -> Scenario:
    scenario = load_scenario(name, list(overrides))
    return scenario.model_copy(update={"controller": TvlqrOptions(kind="tvlqr")})


def steady_mm(scenario: Scenario) -> float:
    result = Experiment(scenario).run()
    assert result.outcomes[0].status == "ok", result.outcomes[0].reason
    value = score(result.trajectory, scenario.robot)[0]["steady_centre_of_oscillation_rmse_m"]
    assert value is not None
    return 1e3 * value


def final_error(result: Result) -> tuple[float, float]:
    """Of P in mm, and of the worse angle in degrees."""
    miss = (result.trajectory.q - result.trajectory.ref_q)[-1, 0]
    return 1e3 * float(np.hypot(*miss[:2])), float(np.degrees(np.abs(miss[2:]).max()))


def test_riccati_converges_to_the_stationary_gain() -> None:
    rng = np.random.default_rng(0)
    A, B = np.eye(3) + 0.3 * rng.normal(size=(3, 3)), rng.normal(size=(3, 1))
    by_state, by_input = np.zeros((4, 3)), np.zeros((4, 1))
    by_state[:3] = np.eye(3)
    by_input[3] = 0.7
    count = 300
    policy = backward(
        np.broadcast_to(A, (count, 1, 3, 3)),
        np.broadcast_to(B, (count, 1, 3, 1)),
        np.broadcast_to(by_state, (count, 1, 4, 3)),
        by_input,
        np.zeros((count, 1, 4)),
        np.zeros((1, 3, 3)),
        np.zeros((1, 3)),
    )
    P = solve_discrete_are(A, B, np.eye(3), 0.49 * np.eye(1))
    assert policy.cost[0, 0] == pytest.approx(P, rel=1e-8)
    gain = -np.linalg.solve(0.49 + B.T @ P @ B, B.T @ P @ A)
    assert policy.gain[0, 0] == pytest.approx(gain, rel=1e-8)


def test_riccati_with_affine_terms_is_the_least_squares_solution() -> None:
    """A short horizon solved as one dense least-squares problem."""
    rng = np.random.default_rng(1)
    n, s, i, m = 4, 2, 1, 3
    A, B = rng.normal(size=(n, 1, s, s)), rng.normal(size=(n, 1, s, i))
    J, E = rng.normal(size=(n, 1, m, s)), rng.normal(size=(n, 1, m, i))
    r = rng.normal(size=(n, 1, m))
    policy = backward(A, B, J, E, r, np.zeros((1, s, s)), np.zeros((1, s)))
    x0 = rng.normal(size=s)
    x, inputs = x0, []
    for k in range(n):
        inputs.append(policy.feedforward[k, 0] + policy.gain[k, 0] @ x)
        x = A[k, 0] @ x + B[k, 0] @ inputs[-1]

    def residuals(u: np.ndarray) -> np.ndarray:
        x, parts = x0, []
        for k in range(n):
            parts.append(r[k, 0] + J[k, 0] @ x + E[k, 0] @ u[k : k + 1])
            x = A[k, 0] @ x + B[k, 0] @ u[k : k + 1]
        return np.concatenate(parts)

    constant = residuals(np.zeros(n))
    slope = np.stack([residuals(unit) - constant for unit in np.eye(n)], axis=1)
    best = np.linalg.lstsq(slope, -constant, rcond=None)[0]
    assert np.concatenate(inputs) == pytest.approx(best, abs=1e-9)


def test_residuals_derivatives_by_finite_differences() -> None:
    path = FlatCircle(radius_m=0.6, angular_rate_rad_s=1.0).sample(PERIOD * np.arange(5), ROBOT)
    task = problem()
    target = task.target(path)
    rng = np.random.default_rng(2)
    state = target.state[2] + 0.01 * rng.normal(size=(1, 7))
    command = target.command[2] + 0.1 * rng.normal(size=(1, 2))
    J = task.residual_by_state(state)[0]
    for column, unit in enumerate(1e-6 * np.eye(7)):
        up = task.residual(state + unit, command, target, 2)
        down = task.residual(state - unit, command, target, 2)
        assert (up - down)[0] / 2e-6 == pytest.approx(J[:, column], abs=1e-5)


def test_linearisation_predicts_a_small_change() -> None:
    task, rng = problem(), np.random.default_rng(3)
    state = np.array([[0.1, 0.2, 0.5, 2.0, 0.8, 17.0, 15.0]])
    command = np.array([[17.5, 15.2]])
    linear = task.linearise(state, command, np.zeros(4))
    moved, pushed = 1e-4 * rng.normal(size=(1, 7)), 1e-4 * rng.normal(size=(1, 2))
    disturbance = 1e-4 * rng.normal(size=(1, 4))
    change = task.next_state(state + moved, command + pushed, disturbance)
    change = change - task.next_state(state, command, np.zeros(4))
    expected = linear.A[0] @ moved[0] + linear.B[0] @ pushed[0] + linear.D[0] @ disturbance[0]
    assert change[0] == pytest.approx(expected, abs=1e-7)


def test_a_fitted_reference_is_a_trajectory_of_the_sampled_model() -> None:
    task = problem()
    path = Planned(plan="figure_eight").sample(PERIOD * np.arange(200), ROBOT)
    target = task.target(path)
    state, command = fit(task, target)
    after = task.next_state(state[:-1], command, np.zeros(4))
    assert after == pytest.approx(state[1:], abs=1e-12)
    miss = np.linalg.norm(task.centre(state) - target.centre, axis=-1)
    assert miss.max() < 1.5e-3  # commands held for 33 ms cannot do better on this eight


@pytest.mark.slow
@pytest.mark.parametrize("name", ["outer_circle", "inverted_trailer"])
def test_it_converges_on_the_model(name: str) -> None:
    assert steady_mm(with_tvlqr(name, "plant.kind=analytic")) < 0.02


def test_without_a_trailer_reference_it_is_refused() -> None:
    scenario = with_tvlqr("lab_circle")
    reference = scenario.reference.model_copy(update={"theta2": "none"})
    with pytest.raises(InputError, match="leaves θ2 undefined at 0 s"):
        Experiment(scenario.model_copy(update={"reference": reference})).run()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "truth_mm", "camera_mm"),
    [("outer_circle", 0.3, 2.0), ("inverted_trailer", 0.6, 3.0), ("flat_figure_eight", 3.0, 8.0)],
)
def test_contact_physics_meets_the_figures(name: str, truth_mm: float, camera_mm: float) -> None:
    assert steady_mm(with_tvlqr(name)) <= truth_mm
    assert steady_mm(with_tvlqr(name, *CAMERA_LIKE)) <= camera_mm


@pytest.mark.slow
def test_rest_to_rest_ends_where_it_should() -> None:
    place_mm, angle_deg = final_error(Experiment(load_scenario("rest_to_rest")).run())
    assert place_mm <= 3.0
    assert angle_deg <= 1.0
    for seed in range(4):
        noisy = load_scenario("rest_to_rest", CAMERA_LIKE, seed)
        place_mm, angle_deg = final_error(Experiment(noisy).run())
        assert place_mm <= 8.0
        assert angle_deg <= 2.0


@pytest.mark.slow
def test_flags_of_a_command_say_what_was_cut_and_what_nearly_stands() -> None:
    scenario = load_scenario("outer_circle", ['controller={kind="tvlqr"}'])
    law, path = Tvlqr(TvlqrOptions()), sample_reference(scenario)
    law.start(Task(scenario.robot, path, PERIOD, 5, np.random.default_rng(0)))
    state = initial_state(scenario, path, 5)
    now = law._observer.update(
        Estimate(state, np.zeros(5), np.ones(5, dtype=np.bool_), np.full(5, np.nan))
    )
    reach = scenario.robot.servo.acceleration_limit_rad_s2 * PERIOD
    here, still = now.wheels[0], np.zeros(2)
    wishes = np.array([here + 0.5 * reach, here + 2.0 * reach, here + reach, here - reach, still])
    slow = now._replace(wheels=np.where(np.arange(5)[:, None] == 4, 0.1, now.wheels))
    command = law._possible(wishes, slow)
    # at the limit counts as cut, on either side; standing still is near the singularity
    assert command.saturated.tolist() == [False, True, True, True, False]
    assert command.near_singular.tolist() == [False, False, False, False, True]
    assert command.wheel_speed_rad_s[1] == pytest.approx(here + reach)


def test_friction_beyond_the_plans_counts_as_an_unexplained_acceleration() -> None:
    robot, k = ROBOT.model_copy(update={"hitch": Hitch(coulomb_friction_n_m=1e-3)}), 7
    path = Planned(plan="figure_eight").sample(PERIOD * np.arange(20), robot)
    law = Tvlqr(TvlqrOptions(friction=FrictionOptions(smoothing_rad_s=1.0)))
    law.start(Task(robot, path, PERIOD, 5, np.random.default_rng(0)))
    plan = np.tile(law._state[k], (5, 1))
    off = np.array([0.0, 0.3, -0.3, 0.3, 0.6])  # rad/s of θ̇2, over which friction is curved
    planned = plan[:, 4] - twist_from_wheels(plan[:, 5:], robot)[:, 1]
    rubbing = [
        -1e-3 / robot.swing_inertia_kg_m2 * rate / np.hypot(rate, 1.0)
        for rate in (planned + off, planned)
    ]
    more = rubbing[0] - rubbing[1]
    assert min(np.abs(more[1:]).min(), np.abs(rubbing[1]).min()) > 0.01  # rad/s²
    # all rub; but for the fourth, an unexplained acceleration makes up for what the plan lacks
    none, body = np.zeros(5), plan[:, :5] + off[:, None] * np.eye(5)[4]
    estimate = Estimate(RobotState(body[:, :4], np.zeros((5, 4))), none, none == 0.0, none)
    now = law._observer.update(estimate)._replace(
        body=body, wheels=plan[:, 5:], unexplained=np.where(np.arange(5) == 3, 0.0, -more)
    )
    law._observer.update = lambda _: now  # type: ignore[method-assign]
    command = law.command(k, estimate)
    assert not command.saturated.any()
    change = command.wheel_speed_rad_s - law._command[k]
    assert change[0] == pytest.approx(0.0, abs=1e-12)  # on the plan, it is the plan's
    assert change[2] == pytest.approx(-change[1], abs=1e-12)
    assert change[4] == pytest.approx(2.0 * change[1], abs=1e-12)
    assert change[3] - change[1] == pytest.approx(more[3] * law._gain[k, 0, :, 10], abs=1e-12)


def test_a_disturbance_falls_to_an_eth_in_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    decays, plain = [], tvlqr.lqr

    def spy(*given: Any) -> Any:
        decays.append(given[3])
        return plain(*given)

    monkeypatch.setattr(tvlqr, "lqr", spy)
    path = FlatCircle(radius_m=0.6, angular_rate_rad_s=1.0).sample(PERIOD * np.arange(9), ROBOT)
    law = Tvlqr(TvlqrOptions(disturbance_time_s=3.0))
    law.start(Task(ROBOT, path, PERIOD, 1, np.random.default_rng(0)))
    assert np.ravel(decays) ** (3.0 / PERIOD) == pytest.approx(np.exp(-1.0), rel=1e-12)
