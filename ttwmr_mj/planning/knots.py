"""A plan as a file: a table of knots, with what it was made for above it."""

from pathlib import Path

import numpy as np

from ttwmr_mj.files import write_text
from ttwmr_mj.planning.transcription import STATES, THETA1, Plan
from ttwmr_mj.references.planned import COLUMNS, ENDS
from ttwmr_mj.robot import RobotParameters


def write_knots(path: Path, plan: Plan, robot: RobotParameters, made_by: str) -> None:
    """Write it, whole or not at all, as `references.planned` reads it."""
    change = plan.state[-1, :STATES] - plan.state[0, :STATES]
    angles = slice(THETA1, THETA1 + 2)
    change[angles] -= 2.0 * np.pi * np.rint(change[angles] / (2.0 * np.pi))
    round_trip = bool(np.abs(change).max() < 1e-6)
    notes = [
        f"made by: {made_by}",
        f"swing_length_m: {robot.swing_length_m!r}",
        f"ends: {ENDS[0] if round_trip else ENDS[1]}",
    ]
    rows = np.column_stack([plan.time_s, plan.state[:, : len(COLUMNS) - 1]])
    lines = [*(f"# {note}" for note in notes), ",".join(COLUMNS)]
    lines += [",".join(f"{value:.12g}" for value in row) for row in rows]
    write_text(path, "\n".join(lines) + "\n")
