"""What contact sensors say of wheels and balls is what MuJoCo's contacts add up to."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.contact_readings import joined, read_contacts
from ttwmr_mj.plants.model.names import contacts
from ttwmr_mj.runs.build import make_plant
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.motion import initial_state
from ttwmr_mj.state import FloatArray

KERB = "{height_m=0.006, x_m=0.15, y_m=0.0, length_m=0.03, width_m=0.4}"
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


def test_a_ball_that_floor_and_kerb_touch_at_once_feels_both() -> None:
    """The nose ball is pressed against the edge of a plate that it cannot climb."""
    start = 'initial={kind="at_rest", x_m=0.0, y_m=0.0, theta1_rad=0.0, theta2_rad=0.0}'
    scenario = load_scenario("lab_circle", [start, f"ground.kerbs=[{KERB}]"])
    plant = make_plant(scenario)
    assert isinstance(plant, ContactPlant)
    plant.reset(initial_state(scenario, None))
    several = 0
    for _ in range(200):
        plant.advance(np.full((1, 2), 5.0), 13)
        plant._batch.forward()  # readings are of a step's start, and the state of its end
        force_n = summed(plant)
        # another start of the solver's iteration is all that differs
        assert read_contacts(plant.contact_readings()).force_n[0] == pytest.approx(
            force_n, abs=1e-6
        )
        strongest = plant._sensordata[:, plant._contact_columns[:, 0]]
        several += int(np.abs(read_contacts(strongest).force_n[0] - force_n).max() > 0.1)
    assert several > 3


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
