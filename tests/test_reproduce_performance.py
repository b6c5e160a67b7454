"""Verdicts by numbers that are computed from trajectories and from several runs at once."""

from __future__ import annotations

import math

import numpy as np
import pytest
from told_evidence import Told, judged

from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.studies.reproduce.claims import computed
from ttwmr_mj.studies.reproduce.claims.claims import CLAIMS, Judgement

MORE = 1.0 + 1e-9  # just beyond a limit


def test_finite_time_means_decades_that_halve() -> None:
    runs = CLAIMS["finite-time"].runs
    steady = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    halving = [8.0, 12.0, 14.0, 15.0, 15.5, 15.75]

    def falls(times_s: list[float]) -> Trajectory:
        """P is 1 m off, and falls to 0.9 of every power of ten at these times."""
        rows = Trajectory.empty(np.r_[0.0, times_s], 1)
        rows.ref_q[:] = rows.q[:] = 0.0
        rows.q[:, 0, 1] = 0.9 * 10.0 ** -np.arange(len(times_s) + 1.0)
        rows.q[0, 0, 1] = 1.0
        return rows

    def decades(ideal: list[float], *sampled: list[float]) -> Judgement:
        paths = [falls(times) for times in sampled]
        run = dict(zip(runs, paths * len(runs), strict=False))
        return judged("finite-time", {"continuous": {"decade_times_s": ideal}}, trajectories=run)

    assert len(runs) == 4
    assert decades(steady, halving).verdict == "holds"
    assert decades(steady, halving[:5]).verdict == "fails"  # not a millionth
    assert decades(halving, halving, steady).verdict == "holds with changes"
    assert decades(steady, steady).verdict == "fails"
    found = decades([8.0, 10.0, 14.0, 16.0, 17.0, 17.5], steady[:3]).numbers
    assert (found["published_largest_ratio_of_decades"], found["published_decades"]) == (None, 3.0)
    ideal = ("first_decade_s", "shortest_decade_s", "longest_decade_s", "largest_ratio_of_decades")
    assert [found[name] for name in ideal] == [8.0, 0.5, 4.0, 2.0]


@pytest.mark.parametrize("gain", ["alpha1", "alpha2"])
def test_a_higher_gain_must_be_better_each_time(gain: str) -> None:
    name = {"alpha1": "higher-position-gains", "alpha2": "higher-velocity-gains"}[gain]

    def errors(law: str, table: str, sizes: tuple[float, ...]) -> dict[str, float]:
        return dict(zip((f"{law}-{gain}-half", table, f"{law}-{gain}-double"), sizes, strict=True))

    def verdict(published: tuple[float, ...], omitted: tuple[float, ...]) -> str:
        values = errors("gains70", computed.TABLE_70, published)
        values |= errors("gains", computed.TABLE_32, omitted)
        return judged(name, values=values).verdict

    better = (3.0, 2.0, 1.0)
    for worse in ((3.0, 3.0, 1.0), (3.0, 2.0, 2.0), (1.0, 2.0, 3.0), (math.inf,) * 3):
        assert verdict(better, worse) == "holds"
        assert verdict(worse, better) == "holds with changes"
        assert verdict(worse, worse) == "fails"


def test_of_the_pid_gains_all_or_one_must_help() -> None:
    names = ("k_p", "k_i", "k_d", "rho")

    def found(*helping: str) -> Judgement:
        values = {computed.TABLE_70: 2.0}
        for gain in names:
            half, double = (3.0, 1.0) if gain in helping else (3.0, 2.0)
            values |= {f"gains70-{gain}-half": half, f"gains70-{gain}-double": double}
        return judged("higher-pid-gains", values=values)

    assert found(*names).verdict == "holds"
    assert found("k_i").verdict == "holds with changes"
    assert found("k_i", "rho").numbers["gains_that_help"] == 2.0
    assert found().verdict == "fails"
    assert (found().numbers["least_m"], found().numbers["most_m"]) == (2.0, 3.0)


def test_effort_is_held_against_what_the_circle_needs() -> None:
    """On the circle of radius R at rate ω the wheels turn at (R·ω ± b·ω)/r."""
    scenario = Told().scenario("lab-pid")
    robot = scenario.robot
    rate, half_track = 0.125, robot.half_track_m
    both = (0.43 * rate + rate * half_track * np.array([1.0, -1.0])) / robot.tractor.wheel_radius_m

    def driven(scale: float) -> Trajectory:
        rows = Trajectory.empty(np.arange(10.0), 1)
        rows.wheel_command_rad_s[:] = scale * both
        rows.wheel_command_rad_s[:5] = 99.0  # the start does not count
        rows.saturated[:] = False
        rows.saturated[7] = True
        return rows

    cases = {case: numbers.runs for case, numbers in CLAIMS["low-effort"].cases.items()}

    def effort(published: float, changed: float, error: float = 0.010) -> Judgement:
        pairs = list(cases.values())
        runs = {run: driven(published) for run, _ in pairs}
        runs |= {run: driven(changed) for _, run in pairs}
        return judged("low-effort", None, dict.fromkeys(runs, error), trajectories=runs)

    limit = math.sqrt(1.2)
    assert effort(limit / MORE, 9.0).verdict == "holds"
    assert effort(limit * MORE, limit / MORE).verdict == "holds with changes"
    assert effort(2.0, 3.0).verdict == "fails"
    assert effort(1.0, 1.0, 0.010 * MORE).verdict == "fails"  # little effort, far off
    found = list(effort(2.0, 3.0).numbers.values())
    assert found == pytest.approx([4.0, 0.2, 0.01, 9.0, 0.01])


def test_experiment_and_model_agree_within_a_centimetre() -> None:
    def at(x: float, y: float) -> Trajectory:
        rows = Trajectory.empty(np.arange(4.0), 1)
        rows.q[:] = 0.0
        rows.q[:, 0, :2] = x, y
        return rows

    def agrees(x: float, y: float, published: float = 1.0) -> Judgement:
        model = at(0.25, -0.5)
        runs = {"lab-pid-without": at(x + 0.25, y - 0.5), "lab-analytic": model}
        runs |= {"lab-pid": at(0.25 + published, -0.5), "lab-analytic-pid": model}
        return judged("experiment-agrees", trajectories=runs)

    assert agrees(0.006, 0.00799).verdict == "holds with changes"
    assert agrees(0.006, 0.00801).verdict == "fails"
    assert agrees(9.0, 9.0, 0.00999).verdict == "holds"
    assert agrees(0.006, 0.00799, 0.01001).verdict == "holds with changes"
    found = agrees(3.0, 4.0).numbers
    assert list(found.values()) == pytest.approx([1.0, 5.0])
    broken = {"lab-pid": at(0.0, 0.0), "lab-analytic-pid": Trajectory.empty(np.arange(2.0), 1)}
    same = {"lab-pid-without": at(0.0, 0.0), "lab-analytic": at(0.0, 0.0)}
    assert judged("experiment-agrees", trajectories=broken | same).verdict == "holds with changes"
