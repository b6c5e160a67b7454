"""References on slopes and with resisting balls: forces balance, and F stays on its path."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from ttwmr_mj.dynamics.flatness import dot, point_behind, trailer_axes, velocity_behind
from ttwmr_mj.dynamics.floor.influence import DRAG, GRAVITY, held_back
from ttwmr_mj.references.circle import Circle
from ttwmr_mj.references.flat_circle import FlatCircle
from ttwmr_mj.references.shared.carried import carried
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

ROBOT = RobotParameters()
K = ROBOT.swing_length_m
PERIOD = 0.033
TIMES = PERIOD * np.arange(400)
RADIUS, RATE = 0.6, 1.0
CASES = {
    "slope": np.array([0.2, -0.1, 0.0, 0.0, 0.0]),
    "drag": np.array([0.0, 0.0, 0.12, 0.0, 0.0]),
    "both": np.array([0.15, 0.1, 0.1, 0.0, 0.0]),
}


def circle(side: str) -> ReferencePath:
    flat = FlatCircle(radius_m=RADIUS, angular_rate_rad_s=RATE, side=side)  # type: ignore[arg-type]
    return flat.sample(TIMES, ROBOT)


def imbalance(path: ReferencePath, influence: FloatArray) -> FloatArray:
    """(n, batch) k·θ̈2 − (P'' − g)·n − what balls hold back [m/s²]."""
    theta2, rate = path.theta2_rad, path.theta_rate[..., 1]
    t, n = trailer_axes(theta2)
    com = velocity_behind(path.velocity_m_s, theta2, rate, ROBOT.trailer.com_offset_m)
    held = held_back(influence[..., DRAG], dot(com, t), dot(com, n), rate, ROBOT)
    pushed = dot(path.acceleration_m_s2 - influence[..., GRAVITY], n)
    return np.asarray(K * path.theta_acceleration[..., 1] - pushed - held)


@pytest.mark.parametrize("side", ["inside", "outside"])
@pytest.mark.parametrize("name", CASES)
def test_the_equation_of_motion_holds_and_f_stays_on_its_path(name: str, side: str) -> None:
    influence, path = CASES[name], circle(side)
    assert np.abs(imbalance(path, influence)).max() > 0.05  # without, it does not
    found = carried(path, ROBOT, influence)
    # rounding; a fifth of the error is left in each round of 25, or a tenth: 0.2^25 = 3e-18
    np.testing.assert_allclose(imbalance(found, influence), 0.0, atol=1e-13)
    centre = point_behind(found.q, K)
    np.testing.assert_allclose(centre, path.flat_derivatives[:, :, 0], rtol=0, atol=1e-14)
    np.testing.assert_array_equal(found.flat_derivatives, path.flat_derivatives)
    # θ1 is where P goes
    speed = np.hypot(*np.moveaxis(found.velocity_m_s, -1, 0))
    heading = np.stack([np.cos(found.theta1_rad), np.sin(found.theta1_rad)], axis=-1)
    np.testing.assert_allclose(dot(found.velocity_m_s, heading), speed, rtol=1e-12)


@pytest.mark.parametrize("name", CASES)
def test_rates_are_those_of_the_motion_and_angles_stay_on_their_branch(name: str) -> None:
    path = circle("inside")
    found = carried(path, ROBOT, CASES[name])
    assert np.abs(np.diff(found.theta, axis=0)).max() < 2.0 * RATE * PERIOD
    assert np.abs(found.theta - path.theta).max() < 1.0
    inner = slice(2, -2)  # one-sided differences at the ends err by T·ω/2
    for values, rates in (
        (found.theta, found.theta_rate),
        (found.theta_rate, found.theta_acceleration),
        (found.derivatives[:, :, 0], found.velocity_m_s),
        (found.velocity_m_s, found.acceleration_m_s2),
        (found.acceleration_m_s2, found.derivatives[:, :, 3]),
        (found.derivatives[:, :, 3], found.derivatives[:, :, 4]),
    ):
        slope = np.gradient(values, TIMES, axis=0)
        # central differences err by (T·ω)²/6 of the third derivative, 2e-4 of it
        np.testing.assert_allclose(rates[inner], slope[inner], atol=2e-3)


def test_on_a_slope_a_pendulum_hangs_the_way_gravity_pulls() -> None:
    """By hand: θ2 points along ±(F'' − g), P is k ahead of F."""
    gravity = np.array([0.2, -0.1])
    path = circle("inside")
    found = carried(path, ROBOT, np.array([*gravity, 0.0, 0.0, 0.0]))
    centre, second = path.flat_derivatives[:, 0, 0], path.flat_derivatives[:, 0, 2]
    t = -(second - gravity) / np.linalg.norm(second - gravity, axis=1)[:, None]
    np.testing.assert_allclose(found.position_m[:, 0], centre + K * t, atol=1e-14)


def test_where_nothing_acts_nothing_changes() -> None:
    path = circle("outside")
    found = carried(path, ROBOT, np.zeros(5))
    np.testing.assert_allclose(found.q, path.q, atol=1e-13)
    np.testing.assert_allclose(found.q_rate, path.q_rate, atol=1e-13)
    np.testing.assert_allclose(found.theta_acceleration[..., 1], path.theta_acceleration[..., 1])
    # and what a path was made for before does not matter
    again = carried(carried(path, ROBOT, CASES["both"]), ROBOT, np.zeros(5))
    np.testing.assert_allclose(again.q, path.q, atol=1e-13)
    # friction in the hitch is no reason to go elsewhere
    rubbing = carried(path, ROBOT, np.array([0.0, 0.0, 0.0, 0.3, 0.4]))
    np.testing.assert_array_equal(rubbing.q, found.q)


def test_what_f_cannot_be_carried_under_leaves_the_path_alone() -> None:
    path, size = circle("inside"), RADIUS * RATE**2
    for place in ([0], [1], [DRAG]):
        influence = np.zeros(5)
        influence[place] = size / 1.19
        assert carried(path, ROBOT, influence) is path
        influence[place] = size / 1.21
        assert carried(path, ROBOT, influence) is not path
    of_p = Circle(radius_m=0.5, angular_rate_rad_s=0.5).sample(TIMES, ROBOT)
    assert carried(of_p, ROBOT, CASES["both"]) is of_p


def test_each_row_is_carried_as_if_alone() -> None:
    path = circle("inside")
    too_much = np.array([RADIUS, 0.0, 0.0, 0.0, 0.0])
    rows = np.stack([*CASES.values(), np.zeros(5), too_much])
    together = carried(path, ROBOT, rows)
    for i, influence in enumerate(rows):
        alone = carried(path, ROBOT, influence)
        for name in (field.name for field in fields(ReferencePath)):
            ours, single = getattr(together, name), getattr(alone, name)
            np.testing.assert_array_equal(ours if name == "time_s" else ours[:, i : i + 1], single)
