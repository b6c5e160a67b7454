"""Gauss-Newton steps and the LQR on a tracking problem, against the cost they minimise."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from ttwmr_mj.controllers.shared.optimal import gauss_newton
from ttwmr_mj.controllers.shared.optimal.gauss_newton import (
    EXACT_PASSES,
    FITTING_PASSES,
    fit,
    improved,
    lqr,
)
from ttwmr_mj.controllers.shared.optimal.tracking_problem import (
    Target,
    TrackingProblem,
    TrackingWeights,
)
from ttwmr_mj.dynamics.sampled.one_trailer import SampledModel
from ttwmr_mj.references.flat_circle import FlatCircle
from ttwmr_mj.robot import RobotParameters, Servo

ROBOT = RobotParameters(servo=Servo(preset="fast"))
PERIOD = 0.033
PROBLEM = TrackingProblem(ROBOT, SampledModel(ROBOT, PERIOD), TrackingWeights())


def circle(samples: int) -> Target:
    path = FlatCircle(radius_m=0.6, angular_rate_rad_s=1.0).sample(
        PERIOD * np.arange(samples), ROBOT
    )
    return PROBLEM.target(path)


def cost_of(
    target: Target, start: np.ndarray, command: np.ndarray, d: np.ndarray, beyond: np.ndarray
) -> float:
    """½Σ|r|² + ½zᵀHz of commands (n, 2), by a plain loop."""
    x, total = start, 0.0
    for k, u in enumerate(command[:, None]):
        total += 0.5 * float((PROBLEM.residual(x, u, target, k) ** 2).sum())
        x = PROBLEM.next_state(x, u, d)
    z = np.concatenate([x - target.state[len(command)], d], axis=1)[0]
    return total + 0.5 * float(z @ beyond[0] @ z)


def far_problem() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(5)
    half = rng.normal(size=(11, 11))
    return {
        "beyond": 30.0 * (half @ half.T)[None],
        "start": circle(7).state[0] + [[0.01, -0.02, 0.03, 0.1, 0.2, 0.3, -0.2]],
        "disturbance": np.array([[0.01, -0.02, 0.03, 0.2]]),
    }


def test_steps_lead_to_a_minimum_of_the_whole_cost() -> None:
    target, far = circle(7), far_problem()
    state, command, costs = target.state, target.command, [np.inf]
    for _ in range(12):
        plan = improved(PROBLEM, state, command, target, **far, lengths=np.array([1.0, 0.3, 0.0]))
        state, command = plan.state, plan.command
        costs.append(float(plan.cost[0]))
    assert (np.diff(costs) <= 1e-9 * costs[-1]).all()

    def cost(u: np.ndarray) -> float:
        return cost_of(target, far["start"], u, far["disturbance"], far["beyond"])

    best = command[:, 0]
    assert costs[-1] == pytest.approx(cost(best), rel=1e-12)
    step = 1e-3
    for unit in np.eye(best.size).reshape(-1, *best.shape):
        up, down = cost(best + step * unit), cost(best - step * unit)
        curvature = (up + down - 2.0 * cost(best)) / step**2
        # where the parabola through three points has its top, in rad/s of commands of 20
        assert abs(up - down) / (2.0 * step) / curvature < 1e-3
        assert curvature > 0.0


def test_commands_are_cut_where_it_is_asked_for() -> None:
    servo = Servo(preset="fast", acceleration_limit_rad_s2=10.0)
    slow = SampledModel(ROBOT.model_copy(update={"servo": servo}), PERIOD)
    task = TrackingProblem(ROBOT, slow, TrackingWeights(change_scale_rad_s=50.0))
    target, far = circle(7), far_problem()
    free, cut = (
        improved(task, target.state, target.command, target, **far, lengths=np.ones(1), cut=flag)
        for flag in (False, True)
    )
    reach = 10.0 * PERIOD
    first = cut.command[0] - far["start"][:, 5:]
    assert np.abs(first).max() == pytest.approx(reach, rel=1e-9)
    assert np.abs(free.command[0] - far["start"][:, 5:]).max() > reach
    x = far["start"]
    for k, u in enumerate(cut.command):  # the states belong to the commands
        assert cut.state[k] == pytest.approx(x, abs=1e-12)
        assert np.abs(u - x[:, 5:]).max() <= reach * (1.0 + 1e-9)
        x = task.next_state(x, u, far["disturbance"])


def test_of_no_step_and_a_bad_one_the_plan_stays() -> None:
    target, still = circle(7), np.zeros((1, 4))
    state, command = fit(PROBLEM, target)
    plan = improved(
        PROBLEM,
        state,
        command,
        target,
        np.zeros((1, 11, 11)),
        start=state[0],
        disturbance=still,
        lengths=np.array([-50.0, 0.0, 30.0]),
    )
    assert plan.command == pytest.approx(command, abs=1e-12)


def test_the_cost_to_go_of_the_lqr_is_what_its_policy_costs() -> None:
    target, decay = circle(25), 0.9
    state, command = fit(PROBLEM, target)
    exact = Target(state, command, PROBLEM.centre(state))
    policy = lqr(PROBLEM, state, command, np.full(4, decay))
    z = 1e-4 * np.random.default_rng(6).normal(size=(1, 11)) * [1, 1, 1, 1, 1, 10, 10, 1, 1, 1, 1]
    expected = 0.5 * (z @ policy.cost[0, 0] @ z.T)[0, 0]
    x, d, cost = state[0] + z[:, :7], z[:, 7:], 0.0
    for k in range(len(command)):
        miss = np.concatenate([x - state[k], d], axis=1)
        u = command[k] + miss @ policy.gain[k, 0].T
        cost += 0.5 * float((PROBLEM.residual(x, u, exact, k) ** 2).sum())
        x, d = PROBLEM.next_state(x, u, d), decay * d
    # to second order in z
    assert cost == pytest.approx(expected, rel=1e-2)


def test_an_error_of_one_scale_is_a_residual_of_one() -> None:
    weights = TrackingWeights(position_scale_m=0.02, angle_scale_rad=0.1, change_scale_rad_s=0.4)
    task = TrackingProblem(ROBOT, SampledModel(ROBOT, PERIOD), weights)
    target = circle(3)
    on, u = target.state[1], target.command[1]
    assert task.residual(on, u, target, 1) == pytest.approx(0.0, abs=1e-12)
    moved = on + np.array([0.02, -0.02, 0.1, 0.0, 5.0, 0.0, 0.0])
    expected = [1.0, -1.0, 1.0, 0.0, 0.0, 0.0]
    assert task.residual(moved, u, target, 1)[0] == pytest.approx(expected, abs=1e-12)
    wound = on + np.array([0.0, 0.0, 2 * np.pi, 0.0, 0.0, 0.4, 0.0])
    expected = [0.0, 0.0, 0.0, 0.0, -1.0, 0.0]
    assert task.residual(wound, u, target, 1)[0] == pytest.approx(expected, abs=1e-12)
    assert task.residual(on, u + [0.0, 0.4], target, 1)[0, 5] == pytest.approx(1.0, abs=1e-12)
    swung = on + np.array([0.0, 0.0, 0.0, -0.1, 0.0, 0.0, 0.0])
    chord = 2.0 * ROBOT.swing_length_m * np.sin(0.05) / 0.02
    residual = task.residual(swung, u, target, 1)[0]
    assert np.hypot(*residual[:2]) == pytest.approx(chord, rel=1e-12)
    assert residual[2:4] == pytest.approx([0.0, -1.0], abs=1e-12)


def test_the_target_of_a_circle_is_known_by_hand() -> None:
    target = circle(4)
    u1 = 0.6 - ROBOT.swing_length_m
    half = ROBOT.half_track_m
    wheels = np.array([u1 + half, u1 - half]) / ROBOT.tractor.wheel_radius_m
    assert target.command[:, 0] == pytest.approx(np.tile(wheels, (3, 1)), rel=1e-12)
    assert target.state[:, 0, 5:] == pytest.approx(np.tile(wheels, (4, 1)), rel=1e-12)
    assert np.hypot(*target.centre[:, 0].T) == pytest.approx(0.6, rel=1e-12)
    part = target.between(1, 3)
    assert np.array_equal(part.state, target.state[1:4])
    assert np.array_equal(part.command, target.command[1:3])
    assert np.array_equal(part.centre, target.centre[1:4])


def test_fitting_stops_when_nothing_is_gained(monkeypatch: pytest.MonkeyPatch) -> None:
    passes = []

    def counted(*given: object, **named: object) -> gauss_newton.Rollout:
        passes.append(improved(*given, **named))  # type: ignore[arg-type]
        return passes[-1]

    monkeypatch.setattr(gauss_newton, "improved", counted)
    state, _ = fit(PROBLEM, circle(40))
    costs = [float(plan.cost[0]) for plan in passes]
    assert len(costs) < 10
    assert all(b < 0.999 * a for a, b in pairwise(costs[:-1]))
    assert costs[-1] >= 0.999 * costs[-2]
    assert np.array_equal(state, passes[-1].state)


@pytest.mark.parametrize(("first", "most"), [(1e-20, EXACT_PASSES), (1.0, FITTING_PASSES)])
def test_the_rounding_of_an_exact_plan_is_not_fitted_for_long(
    first: float, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a long plan its cost falls a little with every pass."""
    costs = []

    def falling(
        _: TrackingProblem, state: np.ndarray, command: np.ndarray, *__: object, **___: object
    ) -> gauss_newton.Rollout:
        costs.append(first * 0.9 ** len(costs))
        return gauss_newton.Rollout(state, command, np.array(costs[-1:]))

    monkeypatch.setattr(gauss_newton, "improved", falling)
    fit(PROBLEM, circle(40))
    assert len(costs) == most
