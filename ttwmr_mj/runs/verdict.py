"""What a scenario's reference asks of its robot, and whether a run did it."""

from dataclasses import replace

from ttwmr_mj.dynamics.influence import DRY, influence_of
from ttwmr_mj.references.shared.feasibility import Feasibility, check_feasibility
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.results.verdict import FREE_TRAILER, Verdict, judge
from ttwmr_mj.runs.build import sample_reference
from ttwmr_mj.runs.judged import judged
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
    friction = scenario.plant.contact.floor_friction
    until_end = reference.until(scenario.periods + 1)
    asked = check_feasibility(until_end, scenario.robot, floor_friction=friction)
    without = OF_FORCES if scenario.plant.kind == "analytic" else ()
    if influence_of(scenario.robot, scenario.ground)[:DRY].any():
        without = (*without, FREE_TRAILER)  # as checked, it is free on a level floor
    return replace(asked, checks=tuple(c for c in asked.checks if c.name not in without))


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


def verdict_on(
    scenario: Scenario,
    rows: Trajectory,
    demands: Feasibility | None,
    status: str = "ok",
    reason: str = "",
) -> Verdict:
    """The verdict on one simulation of a scenario.

    Args:
        scenario: that was run.
        rows: of that simulation.
        demands: as of `demands_of`.
        status: how it ended.
        reason: why, if it broke off.
    """
    seen = judged(rows, scenario)
    return judge(
        seen, scenario.robot, status=status, reason=reason, accept=scenario.accept, demands=demands
    )
