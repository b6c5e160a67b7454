"""What only contact physics has: a pin with play in its hole, and a floor that grips unevenly."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ttwmr_mj.assets import scenarios_folder
from ttwmr_mj.dynamics.floor.ground import Ground
from ttwmr_mj.dynamics.floor.regions import Disc, Rectangle, Region, friction_at
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.robot import Hitch, RobotParameters
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.state import FloatArray, RobotState
from ttwmr_mj.studies.compare.pair import run_pair

PLAY = 5e-4
LOOSE = RobotParameters(hitch=Hitch(play_m=PLAY))
SLOPE = Ground(slope_rad=0.1, downhill_rad=0.5)
WET = Disc(shape="disc", friction=0.05, x_m=1.0, y_m=0.0, radius_m=0.5)
MAT = Rectangle(
    shape="rectangle", friction=0.3, x_m=-1.0, y_m=0.0, length_m=1.0, width_m=0.2, angle_rad=0.5
)


def pin(plant: ContactPlant) -> FloatArray:
    """(nsim, 2) of the pin in its hole, in the trailer's frame."""
    places = [int(plant.model.joint(name).qposadr[0]) for name in ("play_x", "play_y")]
    return plant.joint_positions()[:, places]


def test_a_loose_pin_falls_freely_and_then_holds_at_its_clearance() -> None:
    plant = ContactPlant(LOOSE, ContactOptions(), ground=SLOPE)
    plant.reset(RobotState.at_rest(0.0, 0.0, 0.0, 0.5 - np.pi))  # hanging downhill
    time_s = 0.02
    plant.advance(np.zeros((1, 2)), 40)
    fall = 0.5 * np.hypot(*SLOPE.gravity_m_s2) * time_s**2
    # half a step of the speed at its end, 5 µm, and the balls' rolling: 0.5 % of the mass
    assert -pin(plant)[0, 0] == pytest.approx(fall, rel=0.03)
    plant.advance(np.zeros((1, 2)), 2000)
    assert np.hypot(*pin(plant)[0]) == pytest.approx(PLAY, rel=2e-3)  # 0.2 µm of the contact
    assert plant.state().q[0, 3] == pytest.approx(0.5 - np.pi, abs=1e-3)


def test_the_clearance_is_round() -> None:
    """Whichever way the trailer hangs, it hangs at the same distance."""
    headings = np.linspace(0.0, 2.0, 5)
    for heading in headings:
        ground = Ground(slope_rad=0.1, downhill_rad=heading)
        plant = ContactPlant(LOOSE, ContactOptions(), ground=ground)
        plant.reset(RobotState.at_rest(0.0, 0.0, 0.3, -2.0))
        plant.advance(np.zeros((1, 2)), 400)
        assert np.hypot(*pin(plant)[0]) < 1.03 * PLAY


def test_friction_where_regions_are() -> None:
    regions: tuple[Region, ...] = (MAT, WET)
    inside = np.array([-1.0, 0.0]) + 0.49 * np.array([np.cos(0.5), np.sin(0.5)])
    beside = np.array([-1.0, 0.0]) + 0.11 * np.array([-np.sin(0.5), np.cos(0.5)])
    points = np.array([[1.4, 0.0], [1.6, 0.0], inside, beside])
    np.testing.assert_array_equal(friction_at(regions, points, 0.9), [0.05, 0.9, 0.3, 0.9])
    on_top = WET.model_copy(update={"friction": 0.7})
    assert friction_at((WET, on_top), points[:1], 0.9) == 0.7


def test_in_a_region_the_robot_drives_as_on_a_floor_of_that_friction() -> None:
    """Bit for bit, and row by row of a batch: one robot on the wet spot, one beside it."""
    commands = np.tile([6.5, -6.5], (2, 1))
    start = RobotState(np.array([[1.0, 0.0, 0.3, 0.3], [-1.0, 1.0, 0.3, 0.3]]), np.zeros((2, 4)))

    def driven(ground: Ground, options: ContactOptions) -> FloatArray:
        plant = ContactPlant(RobotParameters(), options, 2, ground=ground)
        plant.reset(start)
        for _ in range(10):
            plant.advance(commands, 66)
        return plant.state().q

    mixed = driven(Ground(regions=(WET,)), ContactOptions())
    np.testing.assert_array_equal(
        mixed[0], driven(Ground(), ContactOptions(floor_friction=0.05))[0]
    )
    np.testing.assert_array_equal(mixed[1], driven(Ground(), ContactOptions())[1])
    turned = mixed[:, 2] - 0.3
    assert turned[0] < 0.9 * turned[1]  # it spins its wheels


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("robot.hitch.play_m", "2e-4"),
        ("ground.regions", '[{shape="disc",friction=0.2,x_m=0.0,y_m=0.0,radius_m=0.3}]'),
    ],
)
def test_the_models_refuse_what_they_do_not_know(key: str, value: str) -> None:
    path = str(scenarios_folder() / "lab_circle.toml")
    sets: list[Any] = [f"{key}={value}", "duration_s=1.0"]
    known = load_scenario(path, sets)
    with pytest.raises(InputError, match=key):
        load_scenario(path, [*sets, "plant.kind=analytic"])
    with pytest.raises(InputError, match=key):
        run_pair(known)
