"""The 3D scene: laboratory and robot once, then poses, paths and contact forces over time."""

from typing import Any

import numpy as np
import rerun as rr

from ttwmr_mj.plants.contact_readings import read_contacts
from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.outline import VISUAL_GROUP
from ttwmr_mj.plants.model.relief import Relief
from ttwmr_mj.recording import style
from ttwmr_mj.recording.scene.floor import (
    TRACTOR_HEIGHT_M,
    TRAILER_HEIGHT_M,
    floor_shapes,
    lift,
    relief_shapes,
)
from ttwmr_mj.recording.scene.poses import BodyPoses
from ttwmr_mj.recording.scene.target import Target
from ttwmr_mj.recording.series import time_column
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.results.curves import Curves
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

WORLD = "world"
P_MARKER = f"{WORLD}/tractor/P"

FORCE_SCALE_M_N = 0.03  # of Table I's robot: a contact that carries 2.5 N gets an arrow of 75 mm


def driven_paths(root: str = WORLD) -> tuple[str, str]:
    """The entities of the tractor's and the trailer's driven path."""
    return f"{root}/driven/tractor", f"{root}/driven/trailer"


def force_scale_m_n(robot: RobotParameters) -> float:
    """Length of a force's arrow [m] per newton, to one digit.

    A force as large as the tractor's weight is as long beside a large robot as beside a small one.
    """
    lighter = RobotParameters().tractor.mass_kg / robot.tractor.mass_kg
    return float(f"{FORCE_SCALE_M_N * robot.looks_scale * lighter:.0e}")


class Scene:
    """A robot with its paths and forces under one entity of a recording, the world or a part of it.

    Args:
        stream: of the recording.
        model: the robot to draw.
        robot: the numbers of that robot.
        reference: drawn as where the robot should be; None draws none.
        floor_m: (2, 2) corners of the floor to draw; None draws none.
        root: the entity everything is put under.
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        model: mujoco.MjModel,
        robot: RobotParameters,
        reference: ReferencePath | None = None,
        floor_m: FloatArray | None = None,
        root: str = WORLD,
    ) -> None:
        self._stream = stream
        self._root = root
        self._poses, self._relief = BodyPoses(model), Relief(model)
        self._bodies = [_body_path(root, model, i) for i in range(1, model.nbody)]
        self._last_points: dict[str, FloatArray] = {}
        if root == WORLD:
            stream.log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._undrawn: mujoco.MjModel | None = model  # until it is known where the robot is
        if floor_m is not None:
            flat = self._relief.flat
            plate, grid = floor_shapes(floor_m) if flat else relief_shapes(self._relief, floor_m)
            self._draw("floor", plate)
            self._draw("floor/grid", grid)
        self._target: Target | None = None
        if reference is not None:
            self._target = Target(stream, model, robot, reference, root, self._relief)
        for path, colour in zip(driven_paths(root), (style.TRACTOR, style.TRAILER), strict=True):
            line = rr.LineStrips3D.from_fields(colors=[colour], radii=rr.Radius.ui_points([2.0]))
            stream.log(path, line, static=True)
        self._force_m_n = force_scale_m_n(robot)
        radius = 0.002 * robot.looks_scale
        arrow = rr.Arrows3D.from_fields(colors=[style.FORCE], radii=[radius])
        self._draw("contact_forces", arrow)

    def _draw(self, name: str, shape: rr.AsComponents) -> None:
        """Log what is the same at all times."""
        self._stream.log(f"{self._root}/{name}", shape, static=True)

    def _draw_robot(self, model: mujoco.MjModel) -> None:
        """The model's visual geoms in the frames of their bodies."""
        for i in np.flatnonzero(model.geom_group == VISUAL_GROUP).tolist():
            if (shape := _shape(model, i)) is not None:
                body = _body_path(self._root, model, model.geom_bodyid[i])
                path = f"{body}/{model.geom(i).name or f'geom_{i}'}"
                self._stream.log(path, shape, static=True)
        self._draw("tractor/P", rr.Points3D([[0.0, 0.0, 0.0]], radii=[0.002]))

    def append(self, rows: Trajectory, curves: Curves) -> None:
        """Log the next rows of the run, of one simulation, and the curves of the same rows."""
        now = time_column(rows.time_s)
        position, quaternion = self._poses.at(rows)
        for i, body in enumerate(self._bodies, start=1):
            columns = rr.Transform3D.columns(
                translation=position[:, i], quaternion=_xyzw(quaternion[:, i])
            )
            self._stream.send_columns(body, [now], columns)
        if self._undrawn is not None:
            self._draw_robot(self._undrawn)
            self._undrawn = None
        tractor, trailer = driven_paths(self._root)
        self._append_path(tractor, now, lift(rows.q[:, 0, :2], TRACTOR_HEIGHT_M, self._relief))
        com = curves.trailer_com_m[:, 0]
        self._append_path(trailer, now, lift(com, TRAILER_HEIGHT_M, self._relief))
        if self._target is not None:
            self._target.append(rows, curves)
        if rows.contact_readings.shape[2]:
            self._append_forces(now, rows.contact_readings[:, 0])

    def _append_path(self, path: str, now: rr.TimeColumn, ends_m: FloatArray) -> None:
        """One segment per row, from the row before; the view shows all up to the time cursor."""
        starts = np.vstack([self._last_points.get(path, ends_m[0]), ends_m[:-1]])
        self._last_points[path] = ends_m[-1]
        strips = np.stack([starts, ends_m], axis=1)
        self._stream.send_columns(path, [now], rr.LineStrips3D.columns(strips=strips))

    def _append_forces(self, now: rr.TimeColumn, readings: FloatArray) -> None:
        contacts = read_contacts(readings)
        arrows = rr.Arrows3D.columns(
            origins=contacts.position_m.reshape(-1, 3),
            vectors=self._force_m_n * contacts.force_n.reshape(-1, 3),
        )
        counts = np.full(len(readings), readings.shape[1])
        path = f"{self._root}/contact_forces"
        self._stream.send_columns(path, [now], arrows.partition(counts))


def _shape(
    model: mujoco.MjModel, geom: int
) -> rr.Boxes3D | rr.Cylinders3D | rr.Ellipsoids3D | None:
    """A geom as Rerun draws it; None for a type the robot has no use for (planes, meshes)."""
    material = model.geom_matid[geom]
    size = model.geom_size[geom]
    looks: dict[str, Any] = {
        "centers": [model.geom_pos[geom]],
        "quaternions": [_xyzw(model.geom_quat[geom])],
        "colors": [model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]],
        "fill_mode": rr.components.FillMode.Solid,
    }
    match mujoco.mjtGeom(model.geom_type[geom]):
        case mujoco.mjtGeom.mjGEOM_BOX:
            return rr.Boxes3D(half_sizes=[size], **looks)
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return rr.Cylinders3D(radii=[size[0]], lengths=[2.0 * size[1]], **looks)
        case mujoco.mjtGeom.mjGEOM_SPHERE | mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return rr.Ellipsoids3D(half_sizes=[model.geom_aabb[geom, 3:]], **looks)
    return None


def _body_path(root: str, model: mujoco.MjModel, body: int) -> str:
    return root if body == 0 else f"{root}/{model.body(body).name or f'body_{body}'}"


def _xyzw(quaternion: FloatArray) -> FloatArray:
    """Rerun's order of MuJoCo's (w, x, y, z), last axis."""
    return np.roll(quaternion, -1, axis=-1)
