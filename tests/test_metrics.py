"""Metrics by hand, and null where a number is undefined."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ttwmr_mj.dynamics.flatness import point_behind
from ttwmr_mj.results.metrics import score
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters

ROBOT = RobotParameters()


def trajectory(error_m: np.ndarray, theta2_error: float = 0.0) -> Trajectory:
    """P off by `error_m` in x from a reference at rest; rows are 0.1 s apart."""
    n = len(error_m)
    q = np.zeros((n, 1, 4))
    q[:, 0, 0], q[:, 0, 3] = error_m, theta2_error
    return replace(
        Trajectory.empty(0.1 * np.arange(n), 1),
        q=q,
        q_rate=np.zeros_like(q),
        ref_q=np.zeros_like(q),
        ref_q_rate=np.zeros_like(q),
        est_q=q + [0.0, 0.003, 0.0, 2 * np.pi],
        est_q_rate=np.zeros_like(q),
        wheel_command_rad_s=np.tile([3.0, 4.0], (n, 1, 1)),
        wheel_speed_rad_s=np.tile([-5.0, 4.0], (n, 1, 1)),
    )


def test_errors_by_hand() -> None:
    got = score(trajectory(np.array([0.4, 0.3, 0.0, 0.004, 0.003])), ROBOT)[0]
    assert got["tractor_max_error_m"] == 0.4
    assert got["tractor_final_error_m"] == 0.003
    assert got["tractor_rmse_m"] == pytest.approx(np.sqrt((0.25 + 25e-6) / 5))
    # the second half starts at t = 0.2 s
    assert got["steady_tractor_rmse_m"] == pytest.approx(np.sqrt(25e-6 / 3))
    assert got["settling_time_s"] == pytest.approx(0.2)
    assert got["iae_m_s"] == pytest.approx(0.1 * (0.2 + 0.3 + 0.0 + 0.004 + 0.0015))
    assert got["wheel_speed_max_rad_s"] == 5.0
    assert got["control_effort"] == pytest.approx(25.0 * 0.4)
    assert got["estimator_position_rmse_m"] == pytest.approx(0.003)
    # a whole turn is no error of an angle
    assert got["estimator_theta2_rmse_rad"] == pytest.approx(0.0, abs=1e-12)


def test_trailer_points_hang_behind_p() -> None:
    got = score(trajectory(np.zeros(4), theta2_error=np.pi), ROBOT)[0]
    assert got["tractor_rmse_m"] == 0.0
    assert got["trailer_rmse_m"] == pytest.approx(2 * 0.141)
    assert got["centre_of_oscillation_rmse_m"] == pytest.approx(2 * ROBOT.swing_length_m)
    assert got["theta2_rmse_rad"] == pytest.approx(np.pi)
    behind = point_behind(np.array([1.0, 2.0, 0.0, np.pi / 2]), 0.5)
    assert behind == pytest.approx([1.0, 1.5])


def test_undefined_is_none_and_never_zero() -> None:
    free = trajectory(np.array([0.1, 0.2, 0.3]))
    nowhere = replace(free, ref_q=np.full_like(free.q, np.nan))
    got = score(nowhere, ROBOT)[0]
    for key in ("tractor_rmse_m", "steady_trailer_rmse_m", "theta2_rmse_rad", "iae_m_s"):
        assert got[key] is None
    assert got["settling_time_s"] is None
    assert got["wheel_speed_max_rad_s"] == 5.0
    assert score(free, ROBOT)[0]["settling_time_s"] is None  # ends 0.3 m off
