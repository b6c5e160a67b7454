"""References on slopes and with resisting balls: forces balance, and F stays on its path."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

import ttwmr_mj as tt
from ttwmr_mj.dynamics.flatness import dot, point_behind, trailer_axes, velocity_behind
from ttwmr_mj.dynamics.floor.influence import DRAG, GRAVITY, held_back
from ttwmr_mj.references.circle import Circle
from ttwmr_mj.references.flat_circle import FlatCircle
from ttwmr_mj.references.shared.carried import carried
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.scenario.motion import sample_reference
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


def eight(period_s: float) -> ReferencePath:
    path = sample_reference(
        tt.load_scenario("flat_figure_eight", [f"control.sampling_time_s={period_s}"])
    )
    assert path is not None
    return path


@pytest.mark.parametrize("strength", [0.0, 1e-7, 1e-3])
@pytest.mark.parametrize("period_s", [0.033, 0.005])
def test_a_path_on_which_f_turns_round_is_left_alone(period_s: float, strength: float) -> None:
    """F'' of an eight vanishes at its crossing, between two samples: P was to jump by 0.3 m there.

    A law that had learned of nothing was led astray so.
    """
    path = eight(period_s)
    accelerations = np.hypot(*np.moveaxis(path.flat_derivatives[:, 0, 2], -1, 0))
    assert accelerations.min() > 0.0
    for place in (0, DRAG):
        influence = np.zeros(5)
        influence[place] = strength
        assert carried(path, ROBOT, influence) is path


@pytest.mark.parametrize("lever_m", [1e-4, 4e-4])
@pytest.mark.parametrize("name", ["outer_circle", "inverted_trailer"])
def test_periods_of_any_length_have_the_same_motion(name: str, lever_m: float) -> None:
    """Over short steps rounding grew from round to round: P was to jitter by 58 mm at 1 ms."""
    starts = []
    for period_s in (0.033, 0.005, 0.004, 0.0025, 0.001, 0.0005):
        given = [f"robot.casters.rolling_resistance_m={lever_m}", "duration_s=2.0"]
        path = sample_reference(
            tt.load_scenario(name, [*given, f"control.sampling_time_s={period_s}"])
        )
        assert path is not None
        differences = np.diff(path.position_m, 2, axis=0) / period_s**2
        # of second order in a turn of 0.033 rad, and its rounding
        np.testing.assert_allclose(differences, path.acceleration_m_s2[1:-1], atol=1e-4)
        starts.append(path.q[0, 0])
    # central differences over 33 ms: 2e-4 of what the balls do; over a few ms nothing that counts
    np.testing.assert_allclose(starts, [starts[-1]] * len(starts), atol=2e-5)


@pytest.mark.parametrize("period_s", [0.033, 0.002])
def test_each_row_of_any_period_is_carried_as_if_alone(period_s: float) -> None:
    given = ["robot.hitch.damping_n_m_s_rad=5e-4", f"control.sampling_time_s={period_s}"]
    scenario = tt.load_scenario("outer_circle", [*given, "duration_s=1.0"])
    path = sample_reference(scenario)
    assert path is not None
    rows = np.array([[0.1, 0.0, 0.02, 0.0, 0.0], [0.0, 0.0, 0.3, 0.0, 0.0], [0.55, 0.0, 0.0, 0, 0]])
    together = carried(path, scenario.robot, rows)
    for i, influence in enumerate(rows):
        alone = carried(path, scenario.robot, influence)
        np.testing.assert_array_equal(together.q[:, i], alone.q[:, 0])
        np.testing.assert_array_equal(together.derivatives[:, i], alone.derivatives[:, 0])
