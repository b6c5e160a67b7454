"""A plan as a file: a table of knots, with what it was made for above it."""

from pathlib import Path

import numpy as np

from ttwmr_mj.files import write_text
from ttwmr_mj.planning.transcription import THETA1, Plan, X, Y, trailer_rows
from ttwmr_mj.references.planned import ENDS, columns, lengths_entry
from ttwmr_mj.robot import RobotParameters


def write_knots(path: Path, plan: Plan, robot: RobotParameters, made_by: str) -> None:
    """Write it, whole or not at all, as `references.planned` reads it."""
    angles = [THETA1, *(angle for angle, _ in trailer_rows(robot))]
    change = plan.state[-1] - plan.state[0]
    change[angles] -= 2.0 * np.pi * np.rint(change[angles] / (2.0 * np.pi))
    round_trip = bool(np.abs(change).max() < 1e-6)
    notes = [
        f"made by: {made_by}",
        lengths_entry(robot),
        f"ends: {ENDS[0] if round_trip else ENDS[1]}",
    ]
    rows = np.column_stack([plan.time_s, plan.state[:, [X, Y, *angles]]])
    lines = [*(f"# {note}" for note in notes), ",".join(columns(len(robot.trailers)))]
    lines += [",".join(f"{value:.12g}" for value in row) for row in rows]
    write_text(path, "\n".join(lines) + "\n")
