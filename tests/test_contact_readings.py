"""What contact sensors say of wheels and balls is what MuJoCo's contacts add up to."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import ttwmr_mj as tt
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.contact_readings import joined, read_contacts
from ttwmr_mj.plants.model.names import contacts
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.runs.build import make_plant
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.motion import initial_state
from ttwmr_mj.state import FloatArray

NAMES = contacts(1)


def summed(plant: ContactPlant) -> FloatArray:
    """Forces (5, 3) of the floor on wheels and balls, over all of MuJoCo's contacts."""
    data = mujoco.MjData(plant.model)
    data.qpos[:], data.qvel[:] = plant._qpos[0], plant._qvel[0]
    data.ctrl[:] = plant._control[0]
    mujoco.mj_forward(plant.model, data)
    force_n = np.zeros((len(NAMES), 3))
    for i, contact in enumerate(data.contact):
        wrench = np.zeros(6)
        mujoco.mj_contactForce(plant.model, data, i, wrench)
        on_second = contact.frame.reshape(3, 3).T @ wrench[:3]
        for geom, sign in ((contact.geom1, -1.0), (contact.geom2, 1.0)):
            if (name := plant.model.geom(geom).name) in NAMES:
                force_n[NAMES.index(name)] += sign * on_second
    return force_n


def test_a_ball_in_a_groove_feels_both_edges() -> None:
    """The nose ball between two plates, pressed down by 0.4 mm."""
    x_m = RobotParameters().casters.tractor_position_m
    plate = "{{height_m=0.003, x_m={}, y_m=0.0, length_m=0.01, width_m=0.04}}"
    groove = ", ".join(plate.format(x_m + aside_m) for aside_m in (-0.008, 0.008))
    start = 'initial={kind="at_rest", x_m=0.0, y_m=0.0, theta1_rad=0.0, theta2_rad=0.0}'
    scenario = load_scenario("lab_circle", [start, f"ground.kerbs=[{groove}]"])
    plant = make_plant(scenario)
    assert isinstance(plant, ContactPlant)
    plant.reset(initial_state(scenario, None))
    plant._qpos[:, 2] -= 4e-4
    plant._batch.forward()
    force_n = read_contacts(plant.contact_readings()).force_n[0]
    assert force_n == pytest.approx(summed(plant), abs=1e-9)
    strongest = plant._sensordata[:, plant._contact_columns[:, 0]]
    assert np.abs(read_contacts(strongest).force_n[0] - force_n).max() > 100.0


@pytest.mark.slow
def test_no_floor_of_a_shipped_scenario_pulls() -> None:
    """At 2.57 s terrain squeezes the left tyre, and its strongest contact alone pulls by 1067 N."""
    scenario = load_scenario("outdoor_circle", ["duration_s=3.0"])
    readings = tt.simulate(scenario).trajectory.contact_readings[:, 0]
    assert read_contacts(readings).force_n[..., 2].min() > -0.1


def test_the_strongest_contact_has_the_force_of_all() -> None:
    """Two contacts of opposite normals, as of a tyre that is squeezed on terrain."""
    rng = np.random.default_rng(0)
    down, along = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0])
    below = np.concatenate([[1095.19, 3.0, 4.0], rng.normal(size=3), down, along, [0.1, 0.2, 0.3]])
    above = np.concatenate(
        [[1066.86, 1.0, 2.0], rng.normal(size=3), -down, along, rng.normal(size=3)]
    )
    readings = np.stack([below, above, np.zeros(15)])
    found, alone = read_contacts(joined(readings)), read_contacts(below)
    assert found.force_n == pytest.approx([-3.0 - 1.0, 4.0 - 2.0, 1095.19 - 1066.86])
    np.testing.assert_array_equal(found.position_m, alone.position_m)
    np.testing.assert_array_equal(found.slip_m_s, alone.slip_m_s)
    # where there is but one, its numbers are as they were, bit for bit
    np.testing.assert_array_equal(joined(np.stack([below, 0.0 * below])), below)
