"""Wheels of unequal radius: a circle where equal ones go straight, in every model."""

from __future__ import annotations

import numpy as np
import pytest

from ttwmr_mj.controllers.shared.wheels import AccelerationToWheels
from ttwmr_mj.dynamics.extended.one_trailer import ExtendedModel
from ttwmr_mj.dynamics.extended.parameters import ExtendedParameters
from ttwmr_mj.dynamics.kinematics import twist_from_wheels
from ttwmr_mj.dynamics.sampled.one_trailer import SampledModel
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.contact_readings import read_contacts
from ttwmr_mj.plants.extended import ExtendedPlant
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.robot import RobotParameters, Tractor
from ttwmr_mj.state import RobotState

UNEQUAL = RobotParameters(tractor=Tractor(wheel_radius_difference_m=5e-4))
PERIOD = 0.033
WHEELS = np.array([[4.0, 4.0]])


def test_equal_speeds_turn_the_robot_in_every_plant() -> None:
    tractor = UNEQUAL.tractor
    turn = 4.0 * tractor.wheel_radius_difference_m / tractor.track_width_m
    expected = ExtendedModel.of(UNEQUAL, ExtendedParameters.expected(UNEQUAL))
    plants = (
        ContactPlant(UNEQUAL, ContactOptions()),
        AnalyticPlant(UNEQUAL, 1, 0.0005, 0.011),
        ExtendedPlant(expected, 1, 0.0005, 0.011),
    )
    paths = []
    for plant in plants:
        rate = [4.0 * tractor.wheel_radius_m, 0.0, turn, turn]
        plant.reset(RobotState(np.zeros((1, 4)), np.array([rate])))
        # who starts like that has both wheels at 4 rad/s
        np.testing.assert_allclose(plant.wheel_speed_rad_s(), WHEELS, rtol=1e-12)
        plant.advance(WHEELS, 6000)
        paths.append(plant.state().q[0])
    contact, plain, extended = paths
    assert plain[2] == pytest.approx(3.0 * turn, rel=1e-12)
    radius = 4.0 * tractor.wheel_radius_m / turn
    exact = radius * np.array([np.sin(plain[2]), 1.0 - np.cos(plain[2])])
    np.testing.assert_allclose(plain[:2], exact, atol=1e-12)
    # contacts creep: micrometres of 0.3 m
    np.testing.assert_allclose(contact[:3], plain[:3], atol=2e-5)
    np.testing.assert_allclose(extended[:3], plain[:3], atol=2e-5)


def test_the_robot_stands_level_on_unequal_wheels() -> None:
    plant = ContactPlant(UNEQUAL, ContactOptions())
    plant.reset(RobotState.at_rest(0, 0, 0, 0))
    force = read_contacts(plant.contact_readings()).force_n[0, :, 2]
    assert force[0] == pytest.approx(force[1], rel=1e-3)
    radii = plant.model.geom("wheel_right").size[0], plant.model.geom("wheel_left").size[0]
    assert radii == pytest.approx(UNEQUAL.tractor.wheel_radii_m)


def test_the_sampled_model_rolls_like_the_plant() -> None:
    plant = AnalyticPlant(UNEQUAL, 1, PERIOD, 0.001)
    body, wheels = np.zeros((1, 5)), np.zeros((1, 2))
    model = SampledModel(UNEQUAL, PERIOD)
    plant.reset(RobotState.at_rest(0, 0, 0, 0))
    for _ in range(30):
        body, wheels = model.advance(body, wheels, WHEELS)
        plant.advance(WHEELS, 1)
    np.testing.assert_allclose(body[0, :4], plant.state().q[0], atol=1e-6)


def test_a_law_of_accelerations_goes_straight_where_it_knows_the_radii() -> None:
    ramp = AccelerationToWheels(UNEQUAL, PERIOD, 1)
    state = RobotState(np.zeros((1, 4)), np.array([[0.05, 0.0, 0.0, 0.0]]))
    command = ramp.command(np.array([[0.1, 0.0]]), state).wheel_speed_rad_s
    twist = twist_from_wheels(command, UNEQUAL)
    np.testing.assert_allclose(twist, [[0.05 + 0.1 * PERIOD, 0.0]], atol=1e-12)
