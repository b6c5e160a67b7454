import re
from typing import Any

import numpy as np
import pytest

from ttwmr_mj.references.circle import Circle
from ttwmr_mj.references.figure_eight import FigureEight
from ttwmr_mj.references.shared.path_reference import PathReference
from ttwmr_mj.references.shared.time_law import TimeLaw
from ttwmr_mj.references.straight_line import StraightLine
from ttwmr_mj.references.waypoints import Waypoints
from ttwmr_mj.robot import RobotParameters

CORNERS = ((0.0, 0.0), (0.6, 0.1), (0.9, 0.6), (0.3, 0.9), (-0.2, 0.5))
ALIGNED: dict[str, Any] = {"theta2": "aligned"}
REFERENCES: dict[str, PathReference] = {
    "circle": Circle(**ALIGNED, radius_m=1.0, angular_rate_rad_s=0.5),
    "lab circle": Circle(**ALIGNED, radius_m=0.43, angular_rate_rad_s=0.125, phase_rad=0.35),
    "clockwise circle": Circle(
        **ALIGNED, radius_m=0.7, angular_rate_rad_s=-0.8, centre_m=(1.0, -2.0), ramp_s=2.03
    ),
    "eight": FigureEight(
        **ALIGNED, half_width_m=0.8, half_height_m=0.4, period_s=12.0, phase_rad=0.3
    ),
    "eight from rest": FigureEight(
        **ALIGNED,
        half_width_m=0.8,
        half_height_m=0.5,
        period_s=9.0,
        centre_m=(0.2, 0.1),
        ramp_s=1.53,
    ),
    "line": StraightLine(
        **ALIGNED, start_m=(0.3, -0.2), heading_rad=2.0, speed_m_s=0.4, ramp_s=1.03
    ),
    "open spline": Waypoints(**ALIGNED, points_m=CORNERS, speed_m_s=0.3, ramp_s=1.03),
    "closed spline": Waypoints(
        **ALIGNED, points_m=CORNERS, speed_m_s=0.3, closed=True, ramp_s=1.03
    ),
}
NAMES = list(REFERENCES)
TIME_STEP = 1e-2
# Central differences of eighth order: error about step⁸·(ninth derivative)/630.
STENCIL = np.array([3, -32, 168, -672, 0, 672, -168, 32, -3]) / 840.0 / TIME_STEP


def differentiate(values: np.ndarray) -> np.ndarray:
    """Derivative along axis 0 of samples TIME_STEP apart; four samples at each end are lost."""
    count = values.shape[0] - 8
    return sum(weight * values[k : k + count] for k, weight in enumerate(STENCIL))


def smooth_samples(reference: PathReference, time_s: np.ndarray) -> np.ndarray:
    """Where no kink of the fourth derivative (spline corner, end of a ramp) is near."""
    sigma = reference.time_law().derivatives(time_s)[0]
    law = reference.time_law()
    bad = np.abs(time_s - law.ramp_s) < 0.1
    if isinstance(reference, Waypoints):
        sigma = sigma % reference.length_m if reference.closed else sigma
        for corner in reference._knots_m:
            bad |= np.abs(sigma - corner) < 0.05
        if law.end is not None:
            bad |= sigma > law.end - law.rate * law.stop_s / 2 - 0.05
    return ~bad


@pytest.mark.parametrize("name", NAMES)
def test_every_derivative_is_the_derivative_of_the_one_before(name: str) -> None:
    time_s = np.arange(0.0, 14.0, TIME_STEP)
    path = REFERENCES[name].sample(time_s)
    smooth = smooth_samples(REFERENCES[name], time_s)[4:-4]
    assert smooth.sum() > 200
    for order in range(4):
        expected = differentiate(path.derivatives[:, 0, order])[smooth]
        ours = path.derivatives[4:-4, 0, order + 1][smooth]
        # The stencil's error and 1e-16/step of roundoff, in m/s^(order + 1).
        np.testing.assert_allclose(ours, expected, rtol=0, atol=2e-9)


@pytest.mark.parametrize("name", NAMES)
def test_angles_and_their_rates_belong_together(name: str) -> None:
    time_s = np.arange(0.0, 14.0, TIME_STEP)
    path = REFERENCES[name].sample(time_s)
    smooth = smooth_samples(REFERENCES[name], time_s)[4:-4]
    expected_rate = differentiate(path.theta1_rad[:, 0])[smooth]
    expected_acceleration = differentiate(path.theta_rate[:, 0, 0])[smooth]
    # Angles turn faster than positions in the spline's tight corners.
    np.testing.assert_allclose(path.theta_rate[4:-4, 0, 0][smooth], expected_rate, atol=1e-7)
    np.testing.assert_allclose(
        path.theta_acceleration[4:-4, 0, 0][smooth], expected_acceleration, atol=1e-6
    )


@pytest.mark.parametrize("name", NAMES)
def test_velocity_is_along_the_heading_and_forward(name: str) -> None:
    path = REFERENCES[name].sample(np.arange(0.0, 14.0, 0.1))
    cos, sin = np.cos(path.theta1_rad), np.sin(path.theta1_rad)
    velocity = path.velocity_m_s
    sideways = -velocity[..., 0] * sin + velocity[..., 1] * cos
    forward = velocity[..., 0] * cos + velocity[..., 1] * sin
    np.testing.assert_allclose(sideways, 0.0, atol=1e-14)
    assert np.all(forward >= 0.0)


@pytest.mark.parametrize("name", NAMES)
def test_shapes_have_a_batch_axis_of_one(name: str) -> None:
    path = REFERENCES[name].sample(np.array([0.0, 0.1, 0.2]))
    assert path.derivatives.shape == (3, 1, 5, 2)
    assert path.theta.shape == path.theta_rate.shape == path.theta_acceleration.shape == (3, 1, 2)
    assert path.q.shape == path.q_rate.shape == (3, 1, 4)


def test_lab_circle_is_eq_72_and_73() -> None:
    time_s = np.linspace(0.0, 60.0, 7)
    position = REFERENCES["lab circle"].sample(time_s).position_m[:, 0]
    angle = time_s / 8 + 0.35
    expected = 0.43 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    np.testing.assert_allclose(position, expected, atol=1e-15)


@pytest.mark.parametrize("rate", [0.5, -0.5])
def test_heading_is_unwrapped_over_several_turns(rate: float) -> None:
    time_s = np.arange(0.0, 60.0, PERIOD := 0.033)
    path = Circle(radius_m=1.0, angular_rate_rad_s=rate).sample(time_s)
    start = np.copysign(np.pi / 2, rate)
    # Roundoff of an angle of 30 rad.
    np.testing.assert_allclose(path.theta1_rad[:, 0], start + rate * time_s, rtol=0, atol=1e-13)
    assert np.abs(np.diff(path.theta1_rad[:, 0])).max() < 2 * abs(rate) * PERIOD


@pytest.mark.parametrize(
    "law",
    [
        TimeLaw(rate=0.7, ramp_s=1.5),
        TimeLaw(rate=0.7, ramp_s=1.5, end=3.0, stop_s=2.0),
        TimeLaw(rate=0.7, end=3.0, stop_s=0.5),
    ],
)
def test_time_law_is_continuous_to_the_fourth_derivative(law: TimeLaw) -> None:
    joints = [0.0, law.ramp_s] if law.ramp_s else []
    if law.end is not None:
        end_s = law.end / law.rate + 0.5 * (law.ramp_s + law.stop_s)
        joints += [end_s - law.stop_s, end_s]
    joint = np.array(joints)
    gap = 1e-9
    jump = law.derivatives(joint + gap) - law.derivatives(joint - gap)
    # The fourth derivative's own slope, 840·rate/ramp⁴ at most, over the gap.
    np.testing.assert_allclose(jump, 0.0, atol=2 * gap * 840 * law.rate / 0.5**4)


def test_time_law_starts_at_rest_and_is_late_by_half_its_ramp() -> None:
    law = TimeLaw(rate=0.7, ramp_s=1.5)
    np.testing.assert_array_equal(law.derivatives(np.array([-1.0, 0.0])), 0.0)
    sigma = law.derivatives(np.array([1.5, 4.0]))
    np.testing.assert_allclose(sigma[0], 0.7 * (np.array([1.5, 4.0]) - 0.75), rtol=1e-14)
    np.testing.assert_array_equal(sigma[1], 0.7)
    np.testing.assert_array_equal(sigma[2:], 0.0)


def test_time_law_derivatives_against_differences_while_starting_and_stopping() -> None:
    law = TimeLaw(rate=0.7, ramp_s=4.0, end=5.0, stop_s=5.0)
    end_s = 5.0 / 0.7 + 4.5
    for begin, end in ((0.0, 4.0), (end_s - 5.0, end_s)):
        sigma = law.derivatives(np.arange(begin + 1e-3, end - 1e-3, TIME_STEP)).T
        # Polynomials of eighth degree: the stencil is exact up to roundoff.
        np.testing.assert_allclose(sigma[4:-4, 1:], differentiate(sigma[:, :-1]), atol=1e-11)
        assert np.all(sigma[:, 1] >= 0.0)


def test_time_law_stops_at_its_end_and_stays() -> None:
    sigma = TimeLaw(rate=0.7, ramp_s=1.0, end=3.0, stop_s=2.0).derivatives(np.array([6.0, 99.0]))
    np.testing.assert_array_equal(sigma, [[3.0, 3.0]] + 4 * [[0.0, 0.0]])


def test_time_law_without_room_to_stop_is_rejected() -> None:
    fault = TimeLaw(rate=0.7, ramp_s=1.0, end=1.0, stop_s=2.0).fault()
    assert "a path of at least 1.05 m, and there are 1 m" in str(fault)
    # just enough: half of what constant rate would take, twice
    assert TimeLaw(rate=0.7, ramp_s=1.0, end=1.06, stop_s=2.0).fault() is None


@pytest.mark.parametrize("name", ["clockwise circle", "line", "open spline", "eight from rest"])
def test_heading_is_defined_at_standstill(name: str) -> None:
    path = REFERENCES[name].sample(np.array([0.0, 0.2]))
    np.testing.assert_array_equal(path.derivatives[0, 0, 1:], 0.0)
    np.testing.assert_array_equal(path.theta_rate[0], 0.0)
    assert abs(path.theta1_rad[1, 0] - path.theta1_rad[0, 0]) < 0.01


@pytest.mark.parametrize(("rate", "side"), [(0.5, 1.0), (-0.5, -1.0)])
def test_outward_trailer_hangs_outside_the_circle(rate: float, side: float) -> None:
    circle = Circle(
        radius_m=1.0, angular_rate_rad_s=rate, centre_m=(0.3, 0.4), theta2="outward", ramp_s=1.0
    )
    path = circle.sample(np.arange(0.0, 30.0, 0.1))
    hitch_angle = path.theta2_rad - path.theta1_rad
    np.testing.assert_allclose(hitch_angle, side * np.pi / 2, atol=1e-14)
    along = np.stack([np.cos(path.theta2_rad), np.sin(path.theta2_rad)], axis=-1)
    trailer_com = path.position_m - 0.141 * along
    distance = np.linalg.norm(trailer_com - [0.3, 0.4], axis=-1)
    np.testing.assert_allclose(distance, 1.141, rtol=1e-13)
    np.testing.assert_array_equal(path.theta_rate[..., 0], path.theta_rate[..., 1])


def test_outward_is_undefined_on_a_straight_line_and_at_an_inflection() -> None:
    line = StraightLine(speed_m_s=0.3, heading_rad=0.4, theta2="outward").sample(np.arange(3.0))
    for values in (line.theta, line.theta_rate, line.theta_acceleration):
        assert np.isnan(values[..., 1]).all()
        assert np.isfinite(values[..., 0]).all()
    eight = FigureEight(half_width_m=1.0, half_height_m=0.5, period_s=8.0, theta2="outward")
    theta = eight.sample(np.array([0.0, 0.5, 4.5])).theta[:, 0]
    assert np.isnan(theta[0, 1])  # at the crossing
    offset = theta[1:, 1] - theta[1:, 0]
    np.testing.assert_allclose(offset, [-np.pi / 2, np.pi / 2])  # right turn, then left turn


def test_aligned_and_none() -> None:
    time_s = np.arange(0.0, 3.0, 0.1)
    aligned = FigureEight(half_width_m=1.0, half_height_m=0.5, period_s=8.0, **ALIGNED).sample(
        time_s
    )
    for values in (aligned.theta, aligned.theta_rate, aligned.theta_acceleration):
        np.testing.assert_array_equal(values[..., 1], values[..., 0])
    none = Circle(radius_m=1.0, angular_rate_rad_s=1.0).sample(time_s)
    for values in (none.theta, none.theta_rate, none.theta_acceleration):
        assert np.isnan(values[..., 1]).all()


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("count", [3, 4, 5])
def test_spline_passes_through_its_waypoints(count: int, closed: bool) -> None:
    curve = Waypoints(points_m=CORNERS[:count], speed_m_s=0.2, closed=closed)
    position = curve.path_derivatives(curve._knots_m)[0]
    np.testing.assert_allclose(position[:count], CORNERS[:count], atol=1e-13)


@pytest.mark.parametrize("closed", [False, True])
def test_spline_is_continuous_to_the_fourth_derivative(closed: bool) -> None:
    curve = Waypoints(points_m=CORNERS, speed_m_s=0.2, closed=closed)
    gap = 1e-7
    corners = curve._knots_m if closed else curve._knots_m[1:-1]
    jump = curve.path_derivatives(corners + gap) - curve.path_derivatives(corners - gap)
    # Smooth change over the gap; derivatives reach 1e4 at fourth and fifth order.
    np.testing.assert_allclose(jump, 0.0, atol=1e4 * gap)


def test_closed_spline_is_periodic() -> None:
    curve = Waypoints(points_m=CORNERS, speed_m_s=0.2, closed=True)
    sigma = np.linspace(0.0, 1.0, 20)
    # Roundoff of σ times derivatives of up to 1e4.
    np.testing.assert_allclose(
        curve.path_derivatives(sigma + 3 * curve.length_m),
        curve.path_derivatives(sigma),
        atol=1e-10,
    )
    round_s = curve.length_m / 0.2
    path = curve.sample(np.linspace(0.0, 2 * round_s, 401))
    np.testing.assert_allclose(path.position_m[-1, 0], CORNERS[0], atol=1e-13)
    turned = path.theta1_rad[-1, 0] - path.theta1_rad[0, 0]
    np.testing.assert_allclose(turned, 4 * np.pi, atol=1e-10)


def test_open_spline_stops_at_its_last_waypoint_with_its_last_heading() -> None:
    curve = Waypoints(points_m=CORNERS, speed_m_s=0.3, stop_s=2.0, **ALIGNED)
    path = curve.sample(np.arange(0.0, 30.0, 0.05))
    np.testing.assert_allclose(path.position_m[-1, 0], CORNERS[-1], atol=1e-13)
    np.testing.assert_array_equal(path.derivatives[-1, 0, 1:], 0.0)
    assert path.theta1_rad[-1, 0] == path.theta1_rad[-100, 0]
    np.testing.assert_array_equal(path.theta_rate[-1], 0.0)


@pytest.mark.parametrize(
    ("points", "closed", "message"),
    [
        (
            (CORNERS[0], CORNERS[1], CORNERS[1], CORNERS[2]),
            False,
            r"points_m\.1: .* point 2 repeats",
        ),
        ((*CORNERS, CORNERS[0]), True, "needs no copy"),
        (
            ((0.0, 0.0), (0.01, 0.0), (0.0, 0.01)),
            False,
            "path of at least 0.15 m, and there are 0.02",
        ),
    ],
)
def test_impossible_waypoints_are_rejected(
    points: tuple[tuple[float, float], ...], closed: bool, message: str
) -> None:
    (fault,) = Waypoints(points_m=points, speed_m_s=0.3, closed=closed).faults(RobotParameters())
    assert re.search(message, str(fault))


def test_points_of_which_no_curve_can_be_computed_are_refused() -> None:
    points = ((0.0, 0.0), (1e-6, 0.0), (0.0, 1e-6), (100.0, 100.0))
    curve = Waypoints(points_m=points, speed_m_s=0.2, closed=True)
    (fault,) = curve.faults(RobotParameters())
    assert fault.key == ("points_m",)
    assert "between 1e-06 and 141 m apart, too unevenly" in fault.problem
