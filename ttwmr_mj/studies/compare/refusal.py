"""Scenarios that the two plants cannot understand in the same way."""

from __future__ import annotations

from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.scenario.checks import physics_step_faults
from ttwmr_mj.scenario.schema import Scenario


def refuse_unlike(scenario: Scenario) -> None:
    """Check that both plants mean the same thing by this scenario.

    Raises:
        InputError: they do not; every key is named.
    """
    plant, hitch = scenario.plant, scenario.robot.hitch
    faults = []

    def refuse(*key: str, got: str, problem: str, hint: str) -> None:
        faults.append(Fault(key=("plant", *key), got=got, problem=problem, hint=hint))

    if plant.pushes:
        problem = "the analytic plant's tractor moves as told and cannot be pushed"
        refuse("pushes", got=str(len(plant.pushes)), problem=problem, hint="leave the pushes out")
    if scene := plant.contact.model_path:
        problem = "the analytic plant knows only a flat floor and the robot of this scenario"
        refuse("contact", "model_path", got=repr(scene), problem=problem, hint="leave the key out")
    if plant.analytic.published_spring and (hitch.stiffness_n_m_rad or hitch.damping_n_m_s_rad):
        problem = (
            "contact physics divides the hitch's torque by J2 + m2·l² and not by k, so the two "
            "hitches differ by m2·l"
        )
        refuse("analytic", "published_spring", got="true", problem=problem, hint="set it to false")
    faults += physics_step_faults(scenario)
    if faults:
        raise InputError(*faults, file=f"{scenario.name}, compared on both plants")
