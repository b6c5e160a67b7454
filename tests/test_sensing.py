"""Truth through noise and latency."""

from __future__ import annotations

import numpy as np
import pytest

from ttwmr_mj.channel import Channel, LatencyQueue
from ttwmr_mj.runs.build import generators
from ttwmr_mj.scenario.schema import TruthSensing
from ttwmr_mj.sensing import TruthSensor
from ttwmr_mj.state import RobotState

PERIOD = 0.033


def truth(k: int, nsim: int = 2) -> RobotState:
    return RobotState(np.full((nsim, 4), float(k)), np.full((nsim, 4), -float(k)))


def test_without_options_it_is_the_truth() -> None:
    sensor = TruthSensor(TruthSensing(), PERIOD, np.random.default_rng(0).spawn(2))
    seen = sensor.observe(truth(3))
    assert np.array_equal(seen.state.q, truth(3).q)
    assert seen.age_s.tolist() == [0.0, 0.0]
    assert seen.valid.all()


@pytest.mark.parametrize("periods", [1, 2, 5])
def test_latency_is_exact_and_its_age_is_told(periods: int) -> None:
    options = TruthSensing(latency_s=periods * PERIOD)
    sensor = TruthSensor(options, PERIOD, np.random.default_rng(0).spawn(2))
    for k in range(12):
        seen = sensor.observe(truth(k))
        # until the first measurement is through, it is all there is
        assert seen.state.q[0, 0] == max(k - periods, 0)
        assert seen.age_s[0] == pytest.approx(PERIOD * min(k, periods), abs=1e-15)


def test_the_queue_gives_back_what_went_in_and_how_old_it_is() -> None:
    queue = LatencyQueue[str](Channel(latency=2), [np.random.default_rng(0)])
    arrived = [queue.exchange(word).sent[0] for word in "abcde"]
    assert arrived == [0, 0, 0, 1, 2]
    assert queue.item(2) == "c"


def test_noise_has_the_asked_deviation_and_is_independent_per_simulation() -> None:
    options = TruthSensing(
        position_noise_m=0.01, angle_noise_rad=0.02, velocity_noise_m_s=0.05, rate_noise_rad_s=0.3
    )
    nsim = 20_000
    sensor = TruthSensor(options, PERIOD, np.random.default_rng(5).spawn(nsim))
    seen = sensor.observe(truth(0, nsim)).state
    # 5 σ of a sample deviation: σ/√(2n) = 0.5 %
    assert seen.q.std(axis=0) == pytest.approx([0.01, 0.01, 0.02, 0.02], rel=0.025)
    assert seen.q_rate.std(axis=0) == pytest.approx([0.05, 0.05, 0.3, 0.3], rel=0.025)
    assert np.abs(seen.q.mean(axis=0)).max() < 5e-4
    assert np.abs(np.corrcoef(np.hstack([seen.q, seen.q_rate]).T) - np.eye(8)).max() < 0.04


def test_named_generators_do_not_depend_on_one_another() -> None:
    alone = generators(7, ("sensor",))["sensor"].standard_normal(4)
    among = generators(7, ("controller", "sensor"))["sensor"].standard_normal(4)
    other = generators(8, ("sensor",))["sensor"].standard_normal(4)
    assert np.array_equal(alone, among)
    assert not np.array_equal(alone, other)
