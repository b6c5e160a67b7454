"""What a scenario's reference asks of its robot, before anything runs."""

from dataclasses import replace

from ttwmr_mj.references.shared.feasibility import Feasibility, check_feasibility
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.runs.build import sample_reference
from ttwmr_mj.scenario.schema import Scenario

OF_FORCES = ("wheel torque", "grip")  # the analytic plants' wheels turn and grip as they are told


def demands_of(scenario: Scenario, reference: ReferencePath | None) -> Feasibility | None:
    """The demands on the robot that is driven, up to the end of the run; None without reference.

    Args:
        scenario: with one trailer.
        reference: sampled at every control period, and beyond the end.
    """
    if reference is None:
        return None
    asked = check_feasibility(
        reference.until(scenario.periods + 1),
        scenario.robot,
        floor_friction=scenario.plant.contact.floor_friction,
    )
    if scenario.plant.kind == "contact":
        return asked
    return replace(asked, checks=tuple(c for c in asked.checks if c.name not in OF_FORCES))


def warnings(scenario: Scenario) -> list[str]:
    """What cannot be driven of a scenario, in a line each: it runs, and can hardly be followed."""
    if len(scenario.robot.trailers) > 1:
        return []  # no plant drives it
    asked = demands_of(scenario, sample_reference(scenario))
    return [
        f"{scenario.name}: {demand.sentence}, from {demand.spans_s[0][0]:.3g} s on for "
        f"{demand.broken_for_s:.3g} s in all"
        for demand in (asked.undrivable if asked else ())
    ]
