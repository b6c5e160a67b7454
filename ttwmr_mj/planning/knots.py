"""A plan as a table of knots: the file, and the reference that is driven."""

from pathlib import Path

import numpy as np

from ttwmr_mj.files import write_text
from ttwmr_mj.planning.transcription import (
    A1,
    A2,
    THETA1,
    U1,
    U2,
    Plan,
    X,
    Y,
    state_count,
    trailer_rows,
)
from ttwmr_mj.references.planned import ENDS, Knots, columns, lengths_entry, motion_lengths
from ttwmr_mj.robot import RobotParameters

SAMPLES = 10  # of the reference from row to row, for what it uses at most


def write_knots(path: Path, plan: Plan, robot: RobotParameters, made_by: str) -> None:
    """Write it, whole or not at all, as `references.planned` reads it."""
    table = _table(plan, robot)
    notes = [
        f"made by: {made_by}",
        lengths_entry(robot),
        f"ends: {ENDS[0] if table.periodic else ENDS[1]}",
    ]
    rows = np.column_stack([table.time_s, table.q])
    lines = [*(f"# {note}" for note in notes), ",".join(columns(len(robot.trailers)))]
    lines += [",".join(f"{value:.12g}" for value in row) for row in rows]
    write_text(path, "\n".join(lines) + "\n")


def driven(plan: Plan, robot: RobotParameters) -> Plan:
    """The plan as the reference that is made of it, a spline through its rows, finely sampled."""
    table, rows = _table(plan, robot), np.arange(plan.time_s.size)
    time_s = np.interp(np.linspace(0.0, rows[-1], SAMPLES * rows[-1] + 1), rows, plan.time_s)
    q, rate, change, *_ = table.orders(time_s)
    cos, sin = np.cos(q[:, 2]), np.sin(q[:, 2])
    state = np.zeros((time_s.size, state_count(robot)))
    state[:, [X, Y, THETA1]] = q[:, :3]
    for along, turn, moves in ((U1, U2, rate), (A1, A2, change)):
        state[:, along] = moves[:, 0] * cos + moves[:, 1] * sin
        state[:, turn] = moves[:, 2]
    for column, (angle, speed) in enumerate(trailer_rows(robot), 3):
        state[:, angle], state[:, speed] = q[:, column], rate[:, column]
    return Plan(time_s, state, plan.iterations)


def _table(plan: Plan, robot: RobotParameters) -> Knots:
    angles = [THETA1, *(angle for angle, _ in trailer_rows(robot))]
    change = plan.state[-1] - plan.state[0]
    change[angles] -= 2.0 * np.pi * np.rint(change[angles] / (2.0 * np.pi))
    round_trip = bool(np.abs(change).max() < 1e-6)
    return Knots(plan.time_s, plan.state[:, [X, Y, *angles]], motion_lengths(robot), round_trip)
