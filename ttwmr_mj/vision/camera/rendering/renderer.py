"""Renders parts of the picture plane of an ideal pinhole camera, finely.

The plane is cut into fine pixels, `focal_px` to a slope of one, counted right and down from the
optical axis. Only the region asked for is rendered, through an off-axis frustum: a robot costs a
sixth of a frame. It has the pixels of that part of a whole picture, but for one on an edge in 30
frames, where rounding decides.
"""

import weakref
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.errors import MachineError, described
from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.frame import Image
from ttwmr_mj.vision.camera.rendering.gl import make_context
from ttwmr_mj.vision.camera.rendering.region import Region

IdImage = NDArray[np.int32]

TILE_PX = 512  # side of the offscreen buffer; clearing a larger one costs more than drawing
MAX_GEOMS = 2000  # far more than a laboratory has
STATIC_GROUPS = (0, 1)  # floor and walls
IDS_AS_COLOURS = [int(mujoco.mjtRndFlag.mjRND_SEGMENT), int(mujoco.mjtRndFlag.mjRND_IDCOLOR)]
OCTANTS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
ROBOT_GROUP = 2  # what is seen of the robot; collision shapes are in group 3


class RegionRenderer:
    """One camera of one scene. All calls must come from the thread that made it.

    Attributes:
        close: gives back what OpenGL holds; happens by itself when this is garbage.
    """

    def __init__(self, model: mujoco.MjModel, camera: str, focal_px: float) -> None:
        """Set up OpenGL for a scene.

        Args:
            model: the scene; its quality settings are overwritten for fine rendering.
            camera: name of the camera whose position and axes to take.
            focal_px: fine pixels per unit slope.

        Raises:
            MachineError: no OpenGL.
        """
        model.vis.global_.offwidth = model.vis.global_.offheight = TILE_PX
        # fine pixels are averaged later; multisampling costs more, and blends into the background
        model.vis.quality.offsamples = model.vis.quality.shadowsize = 0
        self._model = model
        self._focal_px = focal_px
        self._data = mujoco.MjData(model)
        self._context = make_context()
        self._buffers = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._buffers)
        self.close = weakref.finalize(self, _release, self._context, self._buffers)
        self.close.atexit = False  # the process's end frees it all
        self._scene = mujoco.MjvScene(model, maxgeom=MAX_GEOMS)
        self._option = mujoco.MjvOption()
        self._option.sitegroup[:] = 0
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = model.camera(camera).id
        self._robot_geoms = np.flatnonzero(model.geom_group == ROBOT_GROUP)
        middle, half = np.split(model.geom_aabb[self._robot_geoms], 2, axis=1)
        self._corners = middle[:, None] + OCTANTS * half[:, None]  # of boxes around the geoms
        self._place(model.qpos0)

    def robot_region(self, postures: Sequence[FloatArray], margin: int) -> Region:
        """A region that contains the robot at every qpos (nq,), with a margin in fine pixels."""
        edges = np.concatenate([self._robot_edges(qpos) for qpos in postures])
        return Region.around(*edges.T).grown(margin)

    def robot(self, qpos: FloatArray, region: Region) -> Image:
        """The robot alone before black, (rows, columns, 3) BGR, at generalized positions (nq,)."""
        self._place(qpos)
        self._show(ROBOT_GROUP)
        return self._tiles(region)

    def robot_on(self, floor: Image, qpos: FloatArray, region: Region) -> Image:
        """The robot before a picture of the region, which shows where no lit surface is."""
        robot = self.robot(qpos, region)
        beside = cv2.inRange(robot, (0, 0, 0), (0, 0, 0))
        return np.asarray(cv2.copyTo(floor, beside, robot))

    def static(self, region: Region) -> Image:
        """Everything but the robot, (rows, columns, 3) BGR."""
        self._show(*STATIC_GROUPS)
        return self._tiles(region)

    def robot_ids(self, qpos: FloatArray, region: Region) -> IdImage:
        """Geom id of what is seen of the robot, (rows, columns); −1 beside it."""
        self._scene.flags[IDS_AS_COLOURS] = 1
        code = self.robot(qpos, region).astype(np.int32)
        self._scene.flags[IDS_AS_COLOURS] = 0
        number = code @ [65536, 256, 1]  # blue is the highest of the three bytes
        ids = np.full(self._scene.ngeom + 1, -1, dtype=np.int32)
        for geom in self._scene.geoms[: self._scene.ngeom]:
            if geom.segid >= 0 and geom.objtype == mujoco.mjtObj.mjOBJ_GEOM:
                ids[geom.segid + 1] = geom.objid
        return np.asarray(ids[number])

    def _place(self, qpos: FloatArray) -> None:
        self._data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)

    def _robot_edges(self, qpos: FloatArray) -> FloatArray:
        """(8n, 2) fine pixels: the corners of a box around each geom."""
        self._place(qpos)
        data, geoms = self._data, self._robot_geoms
        axes = data.cam_xmat[self._camera.fixedcamid].reshape(3, 3)
        turns = data.geom_xmat[geoms].reshape(-1, 3, 3)
        away = data.geom_xpos[geoms] - data.cam_xpos[self._camera.fixedcamid]
        corners = self._corners @ (turns.transpose(0, 2, 1) @ axes) + (away @ axes)[:, None]
        right, up, back = corners.reshape(-1, 3).T
        return np.asarray(np.stack([-right, up], axis=1) * (self._focal_px / back)[:, None])

    def _show(self, *groups: int) -> None:
        self._option.geomgroup[:] = 0
        self._option.geomgroup[list(groups)] = 1
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(
            self._model, self._data, self._option, None, self._camera, everything, self._scene
        )

    def _tiles(self, region: Region) -> Image:
        """The region in pieces that fit the buffer.

        Raises:
            MachineError: OpenGL works no longer.
        """
        try:
            self._context.make_current()
            return self._drawn(region)
        except Exception as error:  # each backend has its own, none has a common base
            raise MachineError(
                f"the camera's OpenGL works no longer: {described(error)}"
            ) from error

    def _drawn(self, region: Region) -> Image:
        picture = np.empty((*region.shape, 3), dtype=np.uint8)
        for top in range(region.top, region.bottom, TILE_PX):
            for left in range(region.left, region.right, TILE_PX):
                tile = Region(left, top, left + TILE_PX, top + TILE_PX).clipped(region)
                picture[tile.within(region)] = self._tile(tile)
        return picture

    def _tile(self, tile: Region) -> Image:
        rows, columns = tile.shape
        for eye in self._scene.camera:
            scale = eye.frustum_near / self._focal_px
            eye.frustum_center = scale * 0.5 * (tile.left + tile.right)
            eye.frustum_width = scale * 0.5 * columns  # MuJoCo's "width" is half of it
            eye.frustum_top = -scale * tile.top
            eye.frustum_bottom = -scale * tile.bottom
        rectangle = mujoco.MjrRect(0, 0, columns, rows)
        pixels = np.empty((rows, columns, 3), dtype=np.uint8)
        mujoco.mjr_render(rectangle, self._scene, self._buffers)
        mujoco.mjr_readPixels(pixels, None, rectangle, self._buffers)
        # OpenGL counts rows from below and colours from red
        return np.asarray(cv2.cvtColor(cv2.flip(pixels, 0), cv2.COLOR_RGB2BGR))


def _release(context: Any, buffers: mujoco.MjrContext) -> None:
    """Free OpenGL's objects in the context that owns them: in another they are someone else's."""
    with suppress(Exception):  # of a context that broke in another thread, which still has it
        context.make_current()
        buffers.free()
        context.free()
