from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ttwmr_mj.dynamics import kinematics
from ttwmr_mj.errors import InputError
from ttwmr_mj.robot import RobotParameters

ROBOT = RobotParameters()
RNG = np.random.default_rng(1)
# Results are a handful of products of order one.
ROUNDOFF = 1e-14


def test_null_space_is_annihilated_by_the_constraint() -> None:
    q = RNG.normal(size=(5, 7, 4))
    product = kinematics.constraint_matrix(q) @ kinematics.null_space(q)
    assert product.shape == (5, 7, 1, 3)
    np.testing.assert_allclose(product, 0.0, atol=ROUNDOFF)


def test_q_rate_is_the_null_space_times_the_workspace_rate_and_respects_the_constraint() -> None:
    q, rate = RNG.normal(size=(6, 4)), RNG.normal(size=(6, 3))
    q_rate = kinematics.q_rate(q, rate)
    expected = np.einsum("nij,nj->ni", kinematics.null_space(q), rate)
    np.testing.assert_allclose(q_rate, expected, atol=ROUNDOFF)
    np.testing.assert_allclose(kinematics.constraint_residual(q, q_rate), 0.0, atol=ROUNDOFF)
    np.testing.assert_allclose(kinematics.workspace_rate(q, q_rate), rate, atol=ROUNDOFF)


def test_residual_is_the_constraint_matrix_times_the_rates() -> None:
    q, q_rate = RNG.normal(size=(6, 4)), RNG.normal(size=(6, 4))
    expected = np.einsum("nij,nj->ni", kinematics.constraint_matrix(q), q_rate)[:, 0]
    np.testing.assert_allclose(kinematics.constraint_residual(q, q_rate), expected, atol=ROUNDOFF)


def test_residual_is_positive_to_the_right() -> None:
    facing_x = np.zeros(4)
    sliding_right = np.array([0.0, -1.0, 0.0, 0.0])
    assert kinematics.constraint_residual(facing_x, sliding_right) == 1.0


def test_null_space_rate_against_finite_differences() -> None:
    q, q_rate, step = RNG.normal(size=(6, 4)), RNG.normal(size=(6, 4)), 1e-6
    difference = kinematics.null_space(q + step * q_rate) - kinematics.null_space(q - step * q_rate)
    # Central differences with a step of 1e-6 are good to about 1e-10.
    np.testing.assert_allclose(
        kinematics.null_space_rate(q, q_rate), difference / (2 * step), atol=1e-9
    )


def test_wheels_and_twist_are_inverse() -> None:
    wheels = RNG.normal(size=(3, 8, 2))
    twist = kinematics.twist_from_wheels(wheels, ROBOT)
    np.testing.assert_allclose(kinematics.wheels_from_twist(twist, ROBOT), wheels, atol=1e-13)


@pytest.mark.parametrize("right", [1.0, -2.5])
def test_one_wheel_alone_turns_about_the_other(right: float) -> None:
    u1, u2 = kinematics.twist_from_wheels(np.array([right, 0.0]), ROBOT)
    rim = right * ROBOT.tractor.wheel_radius_m
    # The contact point of the standing wheel is at rest: u1 − b·u2 = 0; the other moves with the
    # rim. This is what fixes the factor of Eq. 9 as r/(2b), 2b the track width.
    assert u1 - ROBOT.half_track_m * u2 == pytest.approx(0.0, abs=ROUNDOFF)
    assert u1 + ROBOT.half_track_m * u2 == pytest.approx(rim, rel=ROUNDOFF)


def test_lab_circle_needs_two_radians_per_second() -> None:
    wheels = kinematics.wheels_from_twist(np.array([0.43 / 8, 1 / 8]), ROBOT)
    np.testing.assert_allclose(wheels.mean(), 0.43 / 8 / 0.026, rtol=ROUNDOFF)
    assert 1.5 < wheels[1] < wheels[0] < 2.5


@pytest.mark.parametrize("difference", [0.0, 2e-3, -2e-3])
def test_wheels_of_unequal_radius_roll_each_on_its_own(difference: float) -> None:
    tractor = ROBOT.tractor.model_copy(update={"wheel_radius_difference_m": difference})
    robot = ROBOT.model_copy(update={"tractor": tractor})
    wheels = RNG.uniform(-6, 6, (20, 2))
    rims = wheels * (tractor.wheel_radius_m + 0.5 * difference * np.array([1.0, -1.0]))
    twist = kinematics.twist_from_wheels(wheels, robot)
    # the rims' speeds are those of the axle's ends
    np.testing.assert_allclose(twist[:, 0] + 0.5 * tractor.track_width_m * twist[:, 1], rims[:, 0])
    np.testing.assert_allclose(twist[:, 0] - 0.5 * tractor.track_width_m * twist[:, 1], rims[:, 1])
    np.testing.assert_allclose(kinematics.wheels_from_twist(twist, robot), wheels, rtol=1e-12)


@pytest.mark.parametrize("of", [kinematics.wheels_from_twist, kinematics.twist_from_wheels])
@pytest.mark.parametrize(
    "given", [[[0.1, 0.2, 0.3]], [0.1], 0.1, "ab", [[1.0], [1.0, 2.0]], np.zeros(2, complex), None]
)
def test_what_is_no_pair_of_numbers_is_refused(of: Callable[..., Any], given: Any) -> None:
    with pytest.raises(InputError, match=r"got .*; allowed: numbers of shape \(\.\.\., 2\)"):
        of(given, ROBOT)


@pytest.mark.parametrize("of", [kinematics.wheels_from_twist, kinematics.twist_from_wheels])
def test_lists_are_taken_and_no_robot_is_refused(of: Callable[..., Any]) -> None:
    np.testing.assert_array_equal(of([[0.1, 0.2]], ROBOT), of(np.array([[0.1, 0.2]]), ROBOT))
    with pytest.raises(InputError, match="robot: got None; allowed: RobotParameters"):
        of([0.1, 0.2], None)
