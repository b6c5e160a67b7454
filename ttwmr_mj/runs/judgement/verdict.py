"""What a scenario's reference asks of its robot, and whether a run did it."""

from dataclasses import replace

from ttwmr_mj.references.shared.demand import Feasibility
from ttwmr_mj.references.shared.feasibility import check_feasibility
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.results.verdict import Verdict, judge
from ttwmr_mj.runs.judgement.judged import judged
from ttwmr_mj.scenario.schema import Scenario


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
        ground=scenario.ground,
    )
    without = _of_no_concern(scenario)
    return replace(asked, checks=tuple(c for c in asked.checks if c.name not in without))


def _of_no_concern(scenario: Scenario) -> set[str]:
    """Names of demands whose limits no part of the scenario's plant and inner loop has."""
    names, control = set[str](), scenario.control
    if scenario.plant.kind == "analytic":  # where wheels always grip, and no motor turns them
        names |= {"grip", "motor voltage"}
        if not control.torque_input:  # and they turn as they are told
            names.add("wheel torque")
    if control.inner_loop == "torque":  # no servo ramps them
        names |= {"wheel speed", "wheel acceleration"}
    return names


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
