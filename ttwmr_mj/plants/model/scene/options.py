"""How physics is solved is the scenario's affair, in whatever scene."""

from collections.abc import Iterator
from typing import Any

from ttwmr_mj.errors import Fault
from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.scene.refusal import alike, otherwise, refusal, told

SET_BY_SCENARIO = {
    "gravity": "it is 9.81 m/s² everywhere, and ground.slope_rad turns it",
    "timestep": "plant.contact.timestep_s sets it",
    "impratio": "plant.contact.friction_impedance_ratio sets it",
}
FLAGS = {"disableflags": mujoco.mjtDisableBit, "enableflags": mujoco.mjtEnableBit}
WORDS = {
    "integrator": mujoco.mjtIntegrator,
    "solver": mujoco.mjtSolver,
    "cone": mujoco.mjtCone,
    "jacobian": mujoco.mjtJacobian,
}
# only read by sensors and by shapes that the robot has not
FREE = {"magnetic", "sdf_initpoints", "sdf_iterations"}


def option_differences(
    own: mujoco.MjModel, shipped: mujoco.MjModel, stated: Any, by_default: Any
) -> Iterator[Fault]:
    """Options that a scene has otherwise than the scenario and the shipped scene.

    Args:
        own: compiled from the user's scene.
        shipped: compiled from the shipped one, for the same scenario.
        stated: <option> of the user's scene as read, before the scenario's numbers were set.
        by_default: the same of the shipped one.
    """
    for name in sorted(set(dir(own.opt)) - FREE):
        if name.startswith("_"):
            continue
        got, expected = getattr(own.opt, name), getattr(shipped.opt, name)
        if name in FLAGS:
            yield from _flags(FLAGS[name], got, expected)
        elif name in WORDS:
            words = (WORDS[name](value).name.split("_")[-1].lower() for value in (got, expected))
            if got != expected:
                yield otherwise(f"option {name}", *words)
        elif not alike(got, expected):
            yield otherwise(f"option {name}", got, expected)
    for name, hint in SET_BY_SCENARIO.items():
        got, expected = getattr(stated, name), getattr(shipped.opt, name)
        if not alike(got, getattr(by_default, name)) and not alike(got, expected):
            yield refusal(f"option {name} {told(got)}", allowed=told(expected), hint=hint)


def _flags(bits: Any, got: int, expected: int) -> Iterator[Fault]:
    for name, bit in bits.__members__.items():
        if "_" in name and (got ^ expected) & int(bit.value):
            flag = name.split("_")[-1].lower()
            does = "enable" if bits is mujoco.mjtEnableBit else "disable"
            is_changed = f'flag {flag}="{does}"' if got & bit.value else f"flag {flag} reset"
            yield refusal(is_changed, hint="no key sets it: leave it out")
