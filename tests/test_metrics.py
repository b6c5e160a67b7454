"""Metrics by hand, and null where a number is undefined."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ttwmr_mj.dynamics.flatness import point_behind
from ttwmr_mj.results.accept import END_SHARE, AcceptOptions
from ttwmr_mj.results.curves import start_of_last
from ttwmr_mj.results.metrics import METRICS, meaning_of, score
from ttwmr_mj.results.trajectory import TORQUE_SIGNALS, Trajectory
from ttwmr_mj.results.verdict import judge
from ttwmr_mj.robot import RobotParameters, Trailer

# l = 0.3 m, K = 0.3 + 0.06/(1·0.3) = 0.5 m
ROBOT = RobotParameters(trailer=Trailer(mass_kg=1.0, com_offset_m=0.3, yaw_inertia_kg_m2=0.06))
TIME_S = np.array([0.0, 0.1, 0.2, 0.3, 0.4])  # the second half starts at 0.2


def two() -> Trajectory:
    """Two simulations: one off in place and blind at times, one off in its angles."""
    rows = Trajectory.empty(TIME_S, nsim=2)
    rows.q[:], rows.ref_q[:] = 0.0, 0.0
    # distances 0.5, 0.3, 0, 0.004, 0.003 of P, so of every point of the trailer
    rows.q[:, 0, 0] = [0.3, -0.3, 0.0, 0.004, 0.0]
    rows.q[:, 0, 1] = [-0.4, 0.0, 0.0, 0.0, -0.003]
    rows.q[:, 1, 2] = [0.1, -0.2, 2 * np.pi + 0.3, 0.0, -0.4]
    rows.q[:, 1, 3] = [0.0, 0.0, np.pi, -np.pi, 4 * np.pi]  # half turns: 2·l, 2·K aside
    rows.est_q[:] = rows.q
    rows.est_q[:, 0, :2] += [0.0, 0.003]
    rows.est_q[:, 0, 2] += [0.1, -0.1, 0.1, -0.1, 2 * np.pi + 0.1]
    rows.est_q[:, 0, 3] += 2 * np.pi - 0.2
    rows.est_q[:, 1, 0] -= 0.07
    rows.wheel_command_rad_s[:, 0] = [3.0, 4.0]
    rows.wheel_command_rad_s[:, 1] = np.array([0.0, 1.0, 0.0, 0.0, 2.0])[:, None] * [1.0, -1.0]
    rows.wheel_speed_rad_s[:, 0] = [-5.0, 4.0]
    rows.wheel_speed_rad_s[:, 1] = [[0.0, 0.0], [1.0, 0.0], [0.0, -2.5], [1.0, 1.0], [0.0, 0.0]]
    rows.est_valid[1:3, 0] = False
    rows.saturated[0, 0] = True
    rows.saturated[2:, 1] = True
    rows.near_singular[:4, 0] = True
    rows.tilt_rad[:, 1], rows.height_m[:, 1], rows.wheels_on_floor[:, 1] = 0.0, -0.001, 2.0
    rows.wheel_slip_m_s[:, 1] = 0.0
    rows.tilt_rad[:, 0] = [0.0, 0.1, 0.3, 0.2, 0.0]
    rows.height_m[:, 0] = [-0.01, 0.0, 0.02, 0.0, 0.0]
    rows.wheels_on_floor[:, 0] = [2.0, 1.0, 0.0, 2.0, 2.0]
    rows.wheel_slip_m_s[:, 0] = [0.0, 0.031, 0.029, 0.5, 0.1]
    return rows


FIRST = {
    "tractor_rmse_m": np.sqrt((0.25 + 0.09 + 25e-6) / 5),
    "tractor_max_error_m": 0.5,
    "tractor_final_error_m": 0.003,
    "trailer_rmse_m": np.sqrt((0.25 + 0.09 + 25e-6) / 5),
    "trailer_max_error_m": 0.5,
    "centre_of_oscillation_rmse_m": np.sqrt((0.25 + 0.09 + 25e-6) / 5),
    "theta1_rmse_rad": 0.0,
    "theta2_rmse_rad": 0.0,
    "steady_tractor_rmse_m": np.sqrt(25e-6 / 3),
    "steady_tractor_max_error_m": 0.004,
    "steady_trailer_rmse_m": np.sqrt(25e-6 / 3),
    "steady_trailer_max_error_m": 0.004,
    "steady_centre_of_oscillation_rmse_m": np.sqrt(25e-6 / 3),
    "steady_theta1_rmse_rad": 0.0,
    "steady_theta2_rmse_rad": 0.0,
    # trapezoids over 0.1 s
    "iae_m_s": 0.1 * (0.25 + 0.3 + 0.0 + 0.004 + 0.0015),
    "itae_m_s2": 0.1 * (0.03 + 0.0 + 0.0012 + 0.0006),
    "settling_time_s": 0.2,
    "wheel_speed_max_rad_s": 5.0,
    "control_effort": 25.0 * 0.4,
    "saturated_share": 0.2,
    "near_singular_share": 0.8,
    "estimator_position_rmse_m": 0.003,
    "estimator_theta1_rmse_rad": 0.1,
    "estimator_theta2_rmse_rad": 0.2,
    "blind_share": 0.4,
    "tilt_max_rad": 0.3,
    "height_max_m": 0.02,
    "airborne_share": 0.4,
    "slipping_share": 0.6,
}
SECOND = {
    "tractor_rmse_m": 0.0,
    "tractor_max_error_m": 0.0,
    "tractor_final_error_m": 0.0,
    "trailer_rmse_m": 0.6 * np.sqrt(2 / 5),
    "trailer_max_error_m": 0.6,
    "centre_of_oscillation_rmse_m": 1.0 * np.sqrt(2 / 5),
    "theta1_rmse_rad": np.sqrt((0.01 + 0.04 + 0.09 + 0.16) / 5),
    "theta2_rmse_rad": np.pi * np.sqrt(2 / 5),
    "steady_tractor_rmse_m": 0.0,
    "steady_tractor_max_error_m": 0.0,
    "steady_trailer_rmse_m": 0.6 * np.sqrt(2 / 3),
    "steady_trailer_max_error_m": 0.6,
    "steady_centre_of_oscillation_rmse_m": 1.0 * np.sqrt(2 / 3),
    "steady_theta1_rmse_rad": np.sqrt((0.09 + 0.16) / 3),
    "steady_theta2_rmse_rad": np.pi * np.sqrt(2 / 3),
    "iae_m_s": 0.0,
    "itae_m_s2": 0.0,
    "settling_time_s": 0.0,
    "wheel_speed_max_rad_s": 2.5,
    "control_effort": 0.1 * (2.0 + 0.5 * 8.0),
    "saturated_share": 0.6,
    "near_singular_share": 0.0,
    "estimator_position_rmse_m": 0.07,
    "estimator_theta1_rmse_rad": 0.0,
    "estimator_theta2_rmse_rad": 0.0,
    "blind_share": 0.0,
    "tilt_max_rad": 0.0,
    "height_max_m": -0.001,
    "airborne_share": 0.0,
    "slipping_share": 0.0,
}


@pytest.mark.parametrize("name", list(METRICS))
def test_every_metric_by_hand_of_two_simulations(name: str) -> None:
    got = [metrics[name] for metrics in score(two(), ROBOT)]
    # 1e-15: a whole turn, added and taken off again, rounds
    assert got == pytest.approx([FIRST[name], SECOND[name]], rel=1e-12, abs=1e-15)


def test_every_metric_says_what_it_is() -> None:
    (first, second), names = score(two(), ROBOT), list(METRICS)
    assert list(first) == list(second) == names == list(FIRST) == list(SECOND)
    assert len({meaning_of(name) for name in METRICS}) == len(METRICS)  # one for each
    assert meaning_of("tractor_rmse_m") == "rms distance of P from its reference"
    assert meaning_of("steady_centre_of_oscillation_rmse_m") == (
        "over the second half: rms distance of the (last) trailer's centre of oscillation from its "
        "reference"
    )
    assert meaning_of("blind_share") == (
        "share of samples at which the sensor's estimate was invalid"
    )


def test_trailer_points_hang_behind_p() -> None:
    behind = point_behind(np.array([1.0, 2.0, 0.0, np.pi / 2]), 0.5)
    assert behind == pytest.approx([1.0, 1.5])


def test_undefined_is_none_and_never_zero() -> None:
    rows = two()
    nowhere = replace(rows, ref_q=np.full_like(rows.q, np.nan))
    got = score(nowhere, ROBOT)[0]
    of_reference = [name for name, metric in METRICS.items() if "its reference" in metric.meaning]
    of_reference += [f"{steady}theta{i}_rmse_rad" for steady in ("", "steady_") for i in (1, 2)]
    assert [name for name, value in got.items() if value is None] == [
        name for name in METRICS if name in of_reference
    ]
    assert got["wheel_speed_max_rad_s"] == 5.0


def test_a_law_that_gives_torques_and_no_speeds_is_not_without_effort() -> None:
    rows = two()
    rows.wheel_command_rad_s[:, 0] = 0.0
    assert score(rows, ROBOT)[0]["control_effort"] == 0.0  # speeds drive: it stands
    rows.add_signals(TORQUE_SIGNALS)
    silent, tells = score(rows, ROBOT)
    assert silent["control_effort"] is None
    assert tells["control_effort"] == SECOND["control_effort"]  # it names the speeds it wants


@pytest.mark.parametrize(
    ("errors_m", "expected_s"),
    [
        ([0.5, 0.3, 0.0, 0.004, 0.011], None),  # ends outside
        ([0.5, 0.3, 0.0, 0.004, 0.01], 0.2),  # on the edge is inside
        ([0.01, 0.01, 0.01, 0.01, 0.01], 0.0),
        ([0.0, 0.0, 0.0, 0.02, 0.0], 0.4),
        ([0.0, np.nan, 0.0, 0.0, 0.0], None),
    ],
)
def test_a_run_has_settled_when_it_stays(errors_m: list[float], expected_s: float | None) -> None:
    rows = two()
    rows.q[:, 0, :2] = np.column_stack([errors_m, np.zeros(5)])
    assert score(rows, ROBOT)[0]["settling_time_s"] == expected_s


def test_samples_without_a_value_are_left_out() -> None:
    rows = two()
    rows.q[3:, 0] = np.nan  # this simulation ended, the other went on
    got = score(rows, ROBOT)[0]
    assert got["tractor_rmse_m"] == pytest.approx(np.sqrt((0.25 + 0.09) / 3))
    assert got["tractor_max_error_m"] == 0.5
    assert got["tractor_final_error_m"] is None
    assert got["iae_m_s"] == pytest.approx(0.1 * (0.25 + 0.3))


def test_a_unit_is_that_of_the_name() -> None:
    ends = {"_m_s2": "m·s²", "_m_s": "m·s", "_rad_s": "rad/s", "_rad": "rad", "_share": "1"}
    ends |= {"_m": "m", "_s": "s", "control_effort": "rad²/s"}
    for name, metric in METRICS.items():
        assert metric.unit == next(unit for end, unit in ends.items() if name.endswith(end)), name
        assert metric.formula


def test_a_robot_that_stands_where_it_shall_is_not_near_a_singularity() -> None:
    rows = two()
    rows.ref_q_rate[:, 0, :2] = 0.0
    rows.ref_q_rate[3, 0, 0] = 0.1
    assert score(rows, ROBOT)[0]["near_singular_share"] == pytest.approx(0.2)


def test_a_part_of_a_run_has_halves_of_its_own() -> None:
    """What a clock says at the start is no part of a run."""
    rows = two()
    late = replace(rows, time_s=rows.time_s + 100.0)
    # what is weighted with the time, or is one, goes by the clock
    names = [name for name in METRICS if "time" not in name and "itae" not in name]
    for then, now in zip(score(rows, ROBOT), score(late, ROBOT), strict=True):
        for name in names:
            assert now[name] == pytest.approx(then[name], rel=1e-9), name


def test_a_part_of_a_run_is_judged_by_its_own_last_fifth() -> None:
    """Off for its first half, P is on its reference at the end: lost only if all counts as end."""
    rows = Trajectory.empty(np.linspace(0.0, 10.0, 101), nsim=1)
    rows.q[:], rows.ref_q[:], rows.est_q[:] = 0.0, 0.0, 0.0
    rows.q[:50, 0, 0] = 0.3
    late = replace(rows, time_s=rows.time_s + 100.0)
    lasting = {f"transient_{name}": 1.0 for name in ("tractor_m", "trailer_m", "theta2_rad")}
    for part in (rows, late):
        assert judge(part, ROBOT, accept=AcceptOptions(**lasting)).name == "followed"
    # an error of the start is given half of the part's time, whatever the clock says
    limits = {"transient_tractor_m": 0.05, "transient_trailer_m": 0.05}
    hurried = AcceptOptions(settling_share=0.5, **limits)
    rows.q[:, 0, 0] = 0.3 * np.maximum(1.0 - rows.time_s / 4.0, 0.0)
    for part in (rows, replace(rows, time_s=rows.time_s + 100.0)):
        assert judge(part, ROBOT, accept=hurried).name == "followed"


@pytest.mark.parametrize("n", range(5, 205, 5))
@pytest.mark.parametrize("start_s", [0.0, 1.7])
def test_a_sample_at_the_start_of_a_share_of_the_time_belongs_to_it(n: int, start_s: float) -> None:
    """However its time and the run's were rounded."""
    time_s = start_s + 0.033 * np.arange(n + 1)
    assert start_of_last(END_SHARE, time_s) == n - n // 5
    assert start_of_last(0.5, time_s) == (n + 1) // 2
