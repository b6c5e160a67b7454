"""The laboratory in MuJoCo's renderer: the robot, its paths on the floor, its contact forces."""

from __future__ import annotations

import os
from itertools import pairwise
from typing import Any

import numpy as np

from ttwmr_mj.files import variable
from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.joints import HEIGHT, Joints
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.plants.model.outline import chassis
from ttwmr_mj.plants.model.relief import Relief
from ttwmr_mj.recording import style
from ttwmr_mj.recording.style import Colour
from ttwmr_mj.recording.video.footage import Footage
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.frame import Image
from ttwmr_mj.vision.camera.rendering.gl import make_context

STEP_M = 0.016  # between two points of a drawn path
# path → width [m], height over the floor [m], colour; they lie apart, else they flicker
PATHS: dict[str, tuple[float, float, Colour]] = {
    "reference": (0.020, 0.0006, style.REFERENCE_BAND),
    "trailer reference": (0.011, 0.0010, style.REFERENCE_BAND),
    "tractor": (0.006, 0.0016, style.TRACTOR),
    "trailer": (0.006, 0.0020, style.TRAILER),
}
DRIVEN = ("tractor", "trailer")
THICKNESS_M = 2e-4
LIFT_M = 0.1  # of Table I's robot: forces are drawn above the robot, inside it they cannot be seen
ARROW_M = 0.004  # half the width of a force's arrow
STEM_M = 0.0012  # of the line from where the force acts to its arrow
SHADE = (0.0, 0.0, 0.0, 0.22)
SHADE_MARGIN_M = 0.006
MAX_GEOMS = 20_000


class Stage:
    """A scene that is drawn frame by frame; all calls must come from the thread that made it.

    Raises:
        MachineError: no OpenGL.
    """

    def __init__(self, footage: Footage, largest_px: tuple[int, int]) -> None:
        """Set up OpenGL and draw what stays.

        Args:
            footage: what is shown.
            largest_px: width and height of the largest picture.
        """
        self._model = model = _model(footage.scenario, largest_px)
        self._bodies = list(chassis(model).values())
        self._footage = footage
        self._data = mujoco.MjData(model)
        joints = Joints(model)
        self._qpos = joints.standing(np.array(model.qpos0), footage.q)
        self._qpos[:, joints.wheel_qpos] = footage.wheel_angle_rad
        self._relief = Relief(model)
        if not self._relief.flat:
            self._qpos[:, joints.free_qpos + HEIGHT] += self._relief.at(footage.q[:, :2])
        many = os.environ.get("LP_NUM_THREADS", str(os.cpu_count() or 1))  # large pictures
        with variable("LP_NUM_THREADS", many):
            self._gl = make_context()
        self._buffers = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._buffers)
        self._scene = mujoco.MjvScene(model, maxgeom=MAX_GEOMS)
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        self._option = mujoco.MjvOption()
        self._option.sitegroup[:] = 0
        self._option.geomgroup[:] = [1, 1, 1, 0, 0, 0]
        self._update(0)
        self._first_moving = self._scene.ngeom
        self._first_still = self._first_moving + 2 * footage.arrows_m.shape[1] + len(self._bodies)
        self._reached_s = self._draw_paths()

    def close(self) -> None:
        """Give back what OpenGL holds."""
        self._buffers.free()
        self._gl.free()

    def show(self, frame: int) -> None:
        """Set the scene up as it is at a frame."""
        self._update(frame)
        scene, count = self._scene, self._first_moving
        scale = self._footage.scenario.robot.looks_scale
        for origin, vector in self._footage.arrows_m[frame]:
            foot = origin + [0.0, 0.0, scale * LIFT_M]
            for kind, width_m, start, end in (
                (mujoco.mjtGeom.mjGEOM_ARROW, ARROW_M, foot, foot + vector),
                (mujoco.mjtGeom.mjGEOM_CAPSULE, STEM_M, origin, foot),
            ):
                geom = scene.geoms[count]
                _look(geom, kind, style.FORCE)
                mujoco.mjv_connector(geom, kind, scale * width_m, start, end)
                count += 1
        for body in self._bodies:
            self._shade(scene.geoms[count], body)
            count += 1
        now_s = self._footage.time_s[frame]
        driven = int(np.searchsorted(self._reached_s, now_s, side="right"))
        scene.ngeom = self._first_still + driven

    def picture(self, camera: mujoco.MjvCamera, width: int, height: int) -> Image:
        """What a camera sees, (height, width, 3) RGB."""
        mujoco.mjv_updateCamera(self._model, self._data, camera, self._scene)
        rectangle = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(rectangle, self._scene, self._buffers)
        pixels = np.empty((height, width, 3), dtype=np.uint8)
        mujoco.mjr_readPixels(pixels, None, rectangle, self._buffers)
        return pixels[::-1]

    def _update(self, frame: int) -> None:
        self._data.qpos[:] = self._qpos[frame]
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        everything = mujoco.mjtCatBit.mjCAT_ALL
        camera = mujoco.MjvCamera()
        mujoco.mjv_updateScene(
            self._model, self._data, self._option, None, camera, everything, self._scene
        )

    def _shade(self, geom: mujoco.MjvGeom, at: int) -> None:
        """A dark place below a body, so that it stands on the floor."""
        turned = self._data.xmat[at].reshape(3, 3)
        low, high = _footprint(self._model, at)
        middle = self._data.xpos[at] + turned @ np.array([*(0.5 * (low + high)), 0.0])
        half = 0.5 * (high - low) + SHADE_MARGIN_M
        _look(geom, mujoco.mjtGeom.mjGEOM_BOX, (0, 0, 0))
        mujoco.mjv_initGeom(
            geom,
            mujoco.mjtGeom.mjGEOM_BOX,
            np.array([*half, THICKNESS_M]),
            np.array([*middle[:2], 0.0026 + float(self._relief.at(middle[:2]))]),
            turned.flatten(),
            np.array(SHADE, dtype=np.float32),
        )

    def _draw_paths(self) -> FloatArray:
        """Draw all paths; the times at which each of the geoms appears, in their order."""
        pieces: list[tuple[float, FloatArray, FloatArray, str]] = []
        time_s = self._footage.rows.time_s
        for name, points in self._footage.paths_m().items():
            kept = _spaced(points)
            for k, m in pairwise(kept):
                if np.isfinite(points[[k, m]]).all():
                    appears_s = time_s[m] if name in DRIVEN else -1.0
                    pieces.append((appears_s, points[k], points[m], name))
        pieces.sort(key=lambda piece: piece[0])
        pieces = pieces[: MAX_GEOMS - self._first_still]
        for i, (_, start, end, name) in enumerate(pieces):
            width, height, colour = PATHS[name]
            height += float(self._relief.at(0.5 * (start + end)))
            geom = self._scene.geoms[self._first_still + i]
            _floor_line(geom, start, end, width, height, colour)
        return np.array([piece[0] for piece in pieces])


def _model(scenario: Scenario, largest_px: tuple[int, int]) -> mujoco.MjModel:
    """The scenario's robot on a light floor, in a size and a light for the eye."""
    model = build_model(scenario.robot, scenario.plant.contact, scenario.ground)
    model.vis.global_.offwidth, model.vis.global_.offheight = largest_px
    model.vis.quality.offsamples = 4
    model.vis.quality.shadowsize = 0
    model.vis.headlight.ambient[:] = 0.42
    model.vis.headlight.diffuse[:] = 0.42
    return model


def _footprint(model: mujoco.MjModel, body: int) -> tuple[FloatArray, FloatArray]:
    """(2,) lower and upper corner of what is seen of a body, in its own frame."""
    geoms = np.flatnonzero((model.geom_bodyid == body) & (model.geom_group == 2))
    centres, reach = model.geom_pos[geoms, :2], model.geom_aabb[geoms, 3:5]
    return (centres - reach).min(axis=0), (centres + reach).max(axis=0)


def _spaced(points: FloatArray) -> list[int]:
    """Indices of points (n, 2) that lie `STEP_M` apart, and of the ends."""
    kept = [0]
    for k in range(1, len(points)):
        near = np.hypot(*(points[k] - points[kept[-1]])) < STEP_M
        if not near:
            kept.append(k)
    return kept if kept[-1] == len(points) - 1 else [*kept, len(points) - 1]


def _floor_line(
    geom: Any, start: FloatArray, end: FloatArray, width_m: float, height_m: float, colour: Colour
) -> None:
    """A flat piece of a path, a little longer than its ends so that bends have no gaps."""
    along = end - start
    length = float(np.hypot(*along))
    c, s = along / length if length > 0.0 else (1.0, 0.0)
    mujoco.mjv_initGeom(
        geom,
        mujoco.mjtGeom.mjGEOM_BOX,
        np.array([0.5 * length + 0.25 * width_m, 0.5 * width_m, THICKNESS_M]),
        np.array([*(0.5 * (start + end)), height_m]),
        np.array([c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0]),
        np.array([*np.array(colour) / 255.0, 1.0], dtype=np.float32),
    )
    geom.emission, geom.specular = 0.0, 0.0


def _look(geom: Any, kind: mujoco.mjtGeom, colour: Colour) -> None:
    rgba = np.array([*np.array(colour) / 255.0, 1.0], dtype=np.float32)
    mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.eye(3).flatten(), rgba)
    geom.emission, geom.specular = 0.25, 0.0
