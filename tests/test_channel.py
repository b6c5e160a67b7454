"""Latency, jitter and loss, on both sides of the controller, and what it is told of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ttwmr_mj as tt
from ttwmr_mj.channel import BLOCK, Channel, LatencyQueue
from ttwmr_mj.runs.build import make_plant
from ttwmr_mj.runs.execute import run_scenario
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.runs.pushes import Push
from ttwmr_mj.scenario.schema import PushOptions, TruthSensing
from ttwmr_mj.sensing import TruthSensor
from ttwmr_mj.state import FloatArray, RobotState

PERIOD_S = 0.033
SPEED_M_S = 0.25


def rngs(nsim: int, seed: int = 0) -> list[np.random.Generator]:
    return np.random.default_rng(seed).spawn(nsim)


def sent(channel: Channel, nsim: int, periods: int, seed: int = 0) -> FloatArray:
    queue = LatencyQueue[int](channel, rngs(nsim, seed))
    return np.array([queue.exchange(k).sent for k in range(periods)])


def test_only_the_newest_is_delivered_and_the_rest_is_forgotten() -> None:
    """Against a plain list of arrivals, kept by hand."""
    channel, periods = Channel(latency=1, jitter=3, drop_probability=0.3), 60
    (rng,) = rngs(1)
    lost, late = rng.random(BLOCK) < 0.3, rng.integers(3, size=BLOCK, endpoint=True)
    arrival = {0: 0}
    arrival |= {k: k + 1 + int(late[k - 1]) for k in range(1, periods) if not lost[k - 1]}
    queue = LatencyQueue[str](channel, rngs(1))
    for k in range(periods):
        arrived = queue.exchange(f"item {k}")
        newest = max(s for s, when in arrival.items() if when <= k)
        assert arrived.sent.tolist() == [newest]
        assert queue.item(newest) == f"item {newest}"
        assert arrived.travel.tolist() == [arrival[newest] - newest if newest else 1]
        assert len(queue._sent) <= 6  # what is held, and those on their way


def test_shares_and_delays_are_those_asked_for() -> None:
    periods, nsim = 2 * BLOCK, 20
    dropped = np.diff(sent(Channel(drop_probability=0.2), nsim, periods), axis=0) == 0
    # 5 σ of a share of 20 000: 1.4 %
    assert dropped.mean() == pytest.approx(0.2, abs=0.015)
    queue = LatencyQueue[int](Channel(latency=2, jitter=1), rngs(nsim))
    travel = np.array([queue.exchange(k).travel for k in range(periods)])[10:]
    assert set(np.unique(travel)) == {2, 3}
    # the one due now is late (1/2), and so was the one before, which is all there is then (1/2)
    assert (travel == 3).mean() == pytest.approx(0.25, abs=0.02)


@pytest.mark.parametrize("nsim", [1, 3])
def test_a_row_of_a_batch_is_the_row_alone(nsim: int) -> None:
    channel = Channel(1, 2, 0.2)
    batch, few = sent(channel, 5, 700), sent(channel, nsim, 700)
    np.testing.assert_array_equal(batch[:, :nsim], few)
    assert (batch[:, 0] != batch[:, 1]).any()
    assert (batch != sent(channel, 5, 700, seed=1)).any()


def believed(sensing: TruthSensing, told_latency_s: float | None, periods: int) -> FloatArray:
    """(n,) error of P as told, carried over its age, of a robot at constant speed [m]."""
    sensor = TruthSensor(sensing, PERIOD_S, [np.random.default_rng(0)], told_latency_s)
    errors = []
    for k in range(periods):
        q, rate = np.zeros((1, 4)), np.zeros((1, 4))
        q[0, 0], rate[0, 0] = SPEED_M_S * k * PERIOD_S, SPEED_M_S
        seen = sensor.observe(RobotState(q, rate))
        errors.append((seen.state.q + seen.age_s[:, None] * seen.state.q_rate - q)[0, 0])
    return np.array(errors)


@pytest.mark.parametrize(
    ("keys", "told_s", "late_s"),
    [
        ({"latency_s": 2 * PERIOD_S}, None, 0.0),
        ({"latency_s": 2 * PERIOD_S}, 0.0, 2 * PERIOD_S),  # v·n·T
        ({"latency_s": 2 * PERIOD_S}, 0.05, 2 * PERIOD_S - 0.05),
        ({"latency_s": PERIOD_S, "clock_offset_s": 0.01}, None, 0.01),
        ({"latency_s": PERIOD_S, "clock_offset_s": -0.02}, PERIOD_S, -0.02),
        ({"latency_s": PERIOD_S, "drop_probability": 0.4}, None, 0.0),  # it ages, and says so
        ({"drop_probability": 0.4}, None, 0.0),
    ],
)
def test_what_is_not_told_costs_speed_times_time(
    keys: dict[str, Any], told_s: float | None, late_s: float
) -> None:
    error = believed(TruthSensing(**keys), told_s, 50)
    # from the third sample on, the first one no longer stands in
    np.testing.assert_allclose(error[3:], -SPEED_M_S * late_s, atol=1e-15)


def test_jitter_is_never_told() -> None:
    error = believed(TruthSensing(latency_s=PERIOD_S, latency_jitter_s=PERIOD_S), None, 400)
    late = np.rint(error / (-SPEED_M_S * PERIOD_S))
    np.testing.assert_allclose(error, -SPEED_M_S * PERIOD_S * late, atol=1e-13)
    assert set(late[3:]) == {0.0, 1.0}


OPEN_LOOP = [
    'reference={kind="none"}',
    'initial={kind="at_rest"}',
    'controller={kind="open_loop",segments=[{duration_s=1,wheel_right_rad_s=2,wheel_left_rad_s=2},'
    "{duration_s=9,wheel_right_rad_s=5,wheel_left_rad_s=3}]}",
    "duration_s=3.0",
]


@pytest.mark.parametrize("plant", ["contact", "analytic"])
@pytest.mark.parametrize("late_s", [0.01, 0.033, 0.05])
def test_commands_act_exactly_so_much_later(plant: str, late_s: float) -> None:
    """The run is that of a plain plant that is given the commands late, step by step."""
    sets = [*OPEN_LOOP, f"plant.kind={plant}", f"control.command_latency_s={late_s}"]
    scenario = tt.load_scenario("open_loop_turn", sets)
    rows = Experiment(scenario).run().trajectory
    plain = make_plant(scenario)
    plain.reset(RobotState.at_rest(0.6, -0.3, 0.0, 0.0))
    step_s = PERIOD_S / scenario.steps_per_period
    held, waiting = np.zeros((1, 2)), []
    for k in range(scenario.periods):
        assert plain.state().q[0] == pytest.approx(rows.q[k, 0], abs=1e-9)
        waiting.append((k * PERIOD_S + late_s, rows.wheel_command_rad_s[k]))
        for step in range(scenario.steps_per_period):
            now = k * PERIOD_S + step * step_s + 1e-9
            while waiting and waiting[0][0] <= now:
                held = waiting.pop(0)[1]
            plain.advance(held, 1)


def test_servos_hold_the_last_command_that_arrived() -> None:
    sets = [*OPEN_LOOP, "plant.kind=analytic", "control.command_drop_probability=0.5"]
    scenario = tt.load_scenario("open_loop_turn", sets)
    rows = Experiment(scenario, nsim=40).run().trajectory
    change = round(1.0 / PERIOD_S) + 1  # sample of the second segment's first command
    faster = rows.wheel_speed_rad_s[change + 1 :, :, 0] > 2.0
    late = np.argmax(faster, axis=0)
    # the first of the new commands that gets through: geometric, mean 1, deviation √2
    assert 0.4 < late.mean() < 1.8
    assert late.min() == 0
    assert late.max() > 2
    again = Experiment(scenario, nsim=2).run().trajectory
    np.testing.assert_array_equal(again.q, rows.q[:, :2])


@pytest.mark.slow
@pytest.mark.parametrize("law", ["flatness", "tvlqr"])
def test_a_latency_of_commands_that_is_told_costs_nothing(law: str) -> None:
    """The law steers the state that its command will act on; what it is not told, it pays for."""
    error = {}
    for sets in ("", "control.command_latency_s=0.066", "belief.command_latency_s=0.0"):
        lines = [f'controller={{kind="{law}", recovery="own"}}']
        lines += ["duration_s=6", "plant.kind=analytic"]
        lines += ["control.command_latency_s=0.066"] * (sets != "") + [sets] * (sets != "")
        scenario = tt.load_scenario("inverted_trailer", lines)
        (numbers,) = tt.score(Experiment(scenario).run().trajectory, scenario.robot)
        error[sets] = numbers["steady_centre_of_oscillation_rmse_m"] or 0.0
    nothing, told, untold = error.values()
    assert told < 2.0 * nothing + 1e-4
    assert untold > 100 * told


def test_a_push_comes_at_any_phase_and_in_any_direction() -> None:
    options = PushOptions(
        start_s=2.0, duration_s=0.2, force_n=(0.3, 0.4), random_within_s=6.0, random_direction=True
    )
    (push,) = Push.drawn((options,), rngs(2000))
    # 5 σ of the mean and of the largest and least of 2000 even numbers
    assert push.start_s.mean() == pytest.approx(5.0, abs=5 * 6 / np.sqrt(12 * 2000))
    assert (push.start_s.min(), push.start_s.max()) == pytest.approx((2.0, 8.0), abs=0.02)
    np.testing.assert_allclose(np.hypot(*push.force_n.T), 0.5, rtol=1e-12)
    assert np.abs(push.force_n.mean(axis=0)).max() < 5 * 0.5 / np.sqrt(2 * 2000)
    time_s = push.start_s[7] + 0.1
    np.testing.assert_array_equal(push.at(time_s)[7], push.force_n[7])
    assert not push.at(time_s + 0.1001)[7].any()
    (few,) = Push.drawn((options,), rngs(3))
    np.testing.assert_array_equal(few.start_s, push.start_s[:3])


def test_the_phase_that_was_drawn_is_in_the_manifest(tmp_path: Path) -> None:
    push = "{start_s=0.1,duration_s=0.2,force_n=[1.0,0.0],random_within_s=0.5}"
    sets = [f"plant.pushes=[{push}]", "duration_s=1", "output.recording=false"]
    scenario = tt.load_scenario("inverted_trailer", [*sets, "output.figures=false"])
    run_scenario(scenario, tmp_path)
    (told,) = json.loads((tmp_path / "manifest.json").read_text())["pushes"]
    assert 0.1 < told["start_s"] < 0.6
    fixed = [f"plant.pushes=[{{start_s={told['start_s']!r},duration_s=0.2,force_n=[1.0,0.0]}}]"]
    same = tt.load_scenario("inverted_trailer", [*fixed, *sets[1:]])
    np.testing.assert_array_equal(
        Experiment(same).run().trajectory.q, tt.Trajectory.read(tmp_path / "trajectory.parquet").q
    )
    other = tt.load_scenario("inverted_trailer", [*sets, "seed=1"])
    assert Push.of_scenario(other)[0].start_s[0] != told["start_s"]
