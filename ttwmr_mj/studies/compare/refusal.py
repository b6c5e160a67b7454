"""Scenarios that the two plants cannot understand in the same way."""

from __future__ import annotations

from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario.schema import Scenario


def refuse_unlike(scenario: Scenario) -> None:
    """Check that both plants mean the same thing by this scenario.

    Raises:
        InputError: they do not; the message names every key.
    """
    faults = []
    plant, hitch = scenario.plant, scenario.robot.hitch
    if plant.pushes:
        faults.append(
            f"plant.pushes: got {len(plant.pushes)}; the analytic plant's tractor moves as told "
            "and cannot be pushed: leave the pushes out"
        )
    if plant.contact.model_path is not None:
        faults.append(
            f"plant.contact.model_path: got {plant.contact.model_path!r}; the analytic plant knows "
            "only a flat floor and the robot of this scenario: leave the key out"
        )
    elastic = hitch.stiffness_n_m_rad or hitch.damping_n_m_s_rad
    if plant.analytic.published_spring and elastic:
        faults.append(
            "plant.analytic.published_spring: got true; contact physics divides the hitch's torque "
            "by J2 + m2·l² and not by k, so the two hitches differ by m2·l: set it to false"
        )
    if faults:
        lines = "\n".join(f"  {fault}" for fault in faults)
        raise InputError(f"{scenario.name}: the two plants cannot be compared\n{lines}")
