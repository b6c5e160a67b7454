"""The robot in a scene of the user's own is the scenario's, number by number.

A scene is what stands around the robot. Its compiler's settings, its options, its defaults or an
edited copy of the robot could also make the robot another one, in silence. So what was compiled is
compared with the shipped scene, part by part and by name.
"""

from collections.abc import Iterator
from typing import Any

from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.scene.additions import additions
from ttwmr_mj.plants.model.scene.options import option_differences
from ttwmr_mj.plants.model.scene.refusal import alike, otherwise, refusal
from ttwmr_mj.plants.model.scene.robot_parts import numbers, robot_parts

CONTACT = {
    "friction": "plant.contact.floor_friction",
    "solref": "plant.contact.contact_time_constant_s",
}
DRIVE = ("armature", "damping", "frictionloss", "gainprm", "biasprm", "forcerange", "ctrlrange")
# first word of a part's name → what is its number → the key of a scenario that sets it
SET_BY = {
    "tractor": {
        "mass": "robot.tractor.mass_kg",
        "inertia": "robot.tractor.yaw_inertia_kg_m2",
        "ipos": "robot.tractor.com_offset_m",
    },
    "trailer": {
        "mass": "robot.trailer.mass_kg",
        "inertia": "robot.trailer.yaw_inertia_kg_m2",
        "ipos": "robot.trailer.com_offset_m",
    },
    "wheel": {
        "mass": "robot.tractor.wheel_mass_kg",
        "inertia": "robot.tractor.wheel_mass_kg",
        "size": "robot.tractor.wheel_radius_m",
        **CONTACT,
        **dict.fromkeys(DRIVE, "robot.servo"),
    },
    "caster": {
        "mass": "robot.casters.mass_kg",
        "inertia": "robot.casters.mass_kg",
        "size": "robot.casters.radius_m",
        **CONTACT,
    },
    "hitch": {
        "stiffness": "robot.hitch.stiffness_n_m_rad",
        "damping": "robot.hitch.damping_n_m_s_rad",
        "frictionloss": "robot.hitch.coulomb_friction_n_m",
    },
}


def refuse_another_robot(
    own: mujoco.MjModel, shipped: mujoco.MjModel, stated: Any, by_default: Any
) -> None:
    """A scene may add to the laboratory, but change neither the robot nor how physics is solved.

    Args:
        own: compiled from the user's scene.
        shipped: compiled from the shipped one, for the same scenario.
        stated: <option> of the user's scene as read, before the scenario's numbers were set.
        by_default: the same of the shipped one.

    Raises:
        InputError: with every difference.
    """
    faults = [
        *option_differences(own, shipped, stated, by_default),
        *_robot_differences(own, shipped),
        *additions(own, shipped),
    ]
    if faults:
        raise InputError(*faults)


def _robot_differences(own: mujoco.MjModel, shipped: mujoco.MjModel) -> Iterator[Fault]:
    for part in robot_parts(shipped):
        expected, got = numbers(shipped, part), numbers(own, part)
        if expected is None or got is None:
            yield refusal(f"no {part}", hint="include models/ttwmr.xml as it is")
            continue
        word = part.name.rpartition("/")[2].partition("_")[0]
        for name, value in expected.items():
            if not alike(got[name], value):
                set_by = SET_BY.get(word, {}).get(name, "")
                yield otherwise(f"{part}: {name}", got[name], value, set_by)
