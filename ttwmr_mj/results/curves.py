"""The curves a run is judged by: where the trailer is, and how far all is from the reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ttwmr_mj.dynamics.flatness import trailer_point
from ttwmr_mj.errors import InputError, require
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA1, FloatArray, hitch_angles, wrap

SLACK = 1e-9  # of a share of the time, whose ends are rounded


def trailer_com(q: FloatArray, robot: RobotParameters) -> FloatArray:
    """(..., 2) the last trailer's COM, of one P − l·(cos θ2, sin θ2) [m]; NaN where θ2 of q is."""
    last = robot.trailers[-1]
    return trailer_point(q, robot, last.com_distance_m, last.lean_rad)


def centre_of_oscillation(q: FloatArray, robot: RobotParameters) -> FloatArray:
    """(..., 2) F of the last trailer, K behind its hitch on the line through its COM [m]."""
    last = robot.trailers[-1]
    return trailer_point(q, robot, last.swing_length_m, last.lean_rad)


def start_of_last(share: float, time_s: FloatArray) -> int:
    """Number of the first sample of the last share of time (n,); its very start belongs to it."""
    before_end_s = time_s[-1] - time_s
    return int(np.argmax(before_end_s <= (share + SLACK) * before_end_s[0]))


def require_run(trajectory: object, robot: object) -> None:
    """Refuse what is no trajectory of that robot; a script may have taken another scenario's.

    Raises:
        InputError: it is none, or of another number of trailers.
    """
    require(Trajectory, "trajectory", trajectory)
    require(RobotParameters, "robot", robot)
    assert isinstance(trajectory, Trajectory)
    assert isinstance(robot, RobotParameters)
    driven, given = trajectory.q.shape[-1] - 3, len(robot.trailers)
    if driven != given:
        problem = f"the trajectory is of a robot with {driven}"
        got = f"a robot with {given} trailer{'s'[: given > 1]}"
        raise InputError.at("robot", problem, got=got, hint="give the robot of its scenario")


def require_rows(trajectory: Trajectory) -> None:
    """Refuse a trajectory of no rows, of which nothing can be said."""
    if not len(trajectory):
        raise InputError.at("trajectory", got="no rows", allowed="one or more")


@dataclass(frozen=True, slots=True)
class Curves:
    """What follows from a trajectory, row by row; NaN where the reference defines nothing.

    Attributes:
        trailer_com_m, ref_trailer_com_m: (n, nsim, 2) the last trailer's COM, true and
            reference.
        tractor_error_m: (n, nsim) distance of P from its reference.
        trailer_error_m: (n, nsim) distance of that COM from its reference.
        oscillation_error_m: (n, nsim) distance of the last trailer's centre of oscillation,
            of one P − K·(cos θ2, sin θ2), from its reference.
        theta_error_rad: (n, nsim, 1 + trailers) θ1, θ2, … minus their references, in [−π, π).
        hitch_angle_rad: (n, nsim) θ2 − θ1.
    """

    trailer_com_m: FloatArray
    ref_trailer_com_m: FloatArray
    tractor_error_m: FloatArray
    trailer_error_m: FloatArray
    oscillation_error_m: FloatArray
    theta_error_rad: FloatArray
    hitch_angle_rad: FloatArray

    @classmethod
    def of(cls, rows: Trajectory, robot: RobotParameters) -> Curves:
        """What follows from these rows."""
        com, ref_com = trailer_com(rows.q, robot), trailer_com(rows.ref_q, robot)
        return cls(
            trailer_com_m=com,
            ref_trailer_com_m=ref_com,
            tractor_error_m=_distance(rows.q[..., :2], rows.ref_q[..., :2]),
            trailer_error_m=_distance(com, ref_com),
            oscillation_error_m=_distance(
                *(centre_of_oscillation(q, robot) for q in (rows.q, rows.ref_q))
            ),
            theta_error_rad=wrap(rows.q[..., THETA1:] - rows.ref_q[..., THETA1:]),
            hitch_angle_rad=hitch_angles(rows.q)[..., 0],
        )


def _distance(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.hypot(a[..., 0] - b[..., 0], a[..., 1] - b[..., 1]))
