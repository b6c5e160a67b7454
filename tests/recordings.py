"""Short real runs for the tests of recordings, and a reader of what was recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np
import pyarrow as pa

from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.plants.model.names import CONTACTS
from ttwmr_mj.recording.run_recorder import RunRecorder
from ttwmr_mj.references.circle import Circle
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray, RobotState

ROBOT = RobotParameters()
PERIOD_S = 0.033
BODIES = ("tractor", "wheel_right", "wheel_left", "caster_tractor", "trailer")
FLOAT32_M = 1e-6  # rerun stores positions in single precision


@cache
def robot_model() -> mujoco.MjModel:
    return build_model(ROBOT, ContactOptions())


@cache
def circle_reference() -> ReferencePath:
    circle = Circle(radius_m=0.43, angular_rate_rad_s=0.125, phase_rad=0.35, theta2="outward")
    return circle.sample(PERIOD_S * np.arange(61))


@cache
def contact_run() -> Trajectory:
    """Two seconds of the contact plant, started from rest with constant wheel commands."""
    reference = circle_reference()
    plant = ContactPlant(ROBOT, ContactOptions())
    q = reference.q[0, 0]
    plant.reset(RobotState.at_rest(*q))
    rows = Trajectory.empty(reference.time_s, 1, plant.model.nq, len(CONTACTS))
    rows.ref_q[:], rows.ref_q_rate[:] = reference.q, reference.q_rate
    rows.wheel_command_rad_s[:] = 2.35, 1.78
    rows.saturated[10:15] = True
    for k in range(len(rows)):
        state = plant.state()
        rows.q[k], rows.q_rate[k] = state.q, state.q_rate
        rows.wheel_speed_rad_s[k] = plant.wheel_speed_rad_s()
        rows.joint_positions[k] = plant.joint_positions()
        rows.contact_readings[k] = plant.contact_readings()
        plant.advance(rows.wheel_command_rad_s[k], round(PERIOD_S / plant.time_step_s))
    rows.est_q[:], rows.est_q_rate[:] = rows.q, rows.q_rate
    return rows


def analytic(run: Trajectory) -> Trajectory:
    """The same rows as the analytic plant would give them."""
    n = len(run)
    return replace(
        run, joint_positions=np.zeros((n, 1, 0)), contact_readings=np.zeros((n, 1, 0, 15))
    )


def recorder(path: Path, reference: ReferencePath | None) -> RunRecorder:
    return RunRecorder(
        path,
        model=robot_model(),
        robot=ROBOT,
        reference=reference,
        name="circle",
        summary_markdown="# circle\nseed 7",
    )


def record(
    path: Path, reference: ReferencePath | None, rows: Trajectory, cuts: Sequence[int] = ()
) -> Path:
    """Record rows, in pieces that start at the cuts."""
    ends = [0, *cuts, len(rows)]
    with recorder(path, reference) as recording:
        for start, stop in pairwise(ends):
            recording.append(rows.rows(start, stop))
        recording.finish("**ok**", "| rms | 1 mm |")
    return path


class Recording:
    """What a file holds: entity → component → (time [ns] or None if static, value) rows."""

    def __init__(self, path: Path) -> None:
        from rerun.chunk import RrdReader

        self.entities: dict[str, dict[str, list[tuple[int | None, list]]]] = {}
        self.timelines: set[str] = set()
        for chunk in RrdReader(str(path)).stream().to_chunks():
            batch = chunk.to_record_batch()
            times: list[int | None] = [None] * batch.num_rows
            if "sim_time" in batch.schema.names:
                times = batch.column("sim_time").cast("int64").to_pylist()
            self.timelines |= {f.name for f in batch.schema if pa.types.is_temporal(f.type)}
            entity = self.entities.setdefault(chunk.entity_path, {})
            for field, column in zip(batch.schema, batch.columns, strict=True):
                if ":" in field.name:
                    rows = zip(times, column.to_pylist(), strict=True)
                    entity.setdefault(field.name, []).extend(rows)

    def times_ns(self, entity: str, component: str) -> list[int | None]:
        return [time for time, _ in self.entities[entity][component]]

    def values(self, entity: str, component: str) -> FloatArray:
        """(n, instances, ...) of a component with as many instances in every row."""
        return np.array([value for _, value in self.entities[entity][component]], dtype=float)

    def temporal(self) -> dict[tuple[str, str], list[tuple[int | None, list]]]:
        return {
            (entity, name): sorted(row for row in rows if row[0] is not None)
            for entity, components in self.entities.items()
            for name, rows in components.items()
            if any(time is not None for time, _ in rows)
        }


def views(path: Path) -> list[tuple[str, str]]:
    """(origin, title) of every view in the layout that a viewer shows, the last one sent."""
    from rerun.chunk import RrdReader

    reader = RrdReader(str(path))
    found = []
    raw = path.read_bytes()  # ids in the order they were sent, which the reader does not keep
    last = max(reader.blueprints(), key=lambda entry: raw.find(entry.recording_id.encode()))
    for chunk in reader.stream(store=last).to_chunks():
        batch = chunk.to_record_batch()
        if "ViewBlueprint:space_origin" in batch.schema.names:
            names = ("ViewBlueprint:space_origin", "ViewBlueprint:display_name")
            found.append(tuple(batch.column(name).to_pylist()[0][0] for name in names))
    return sorted(found)
