"""The geometry of a camera: from points in the world to pixels and back.

OpenCV's conventions: the camera's x is right, y down, z along the optical axis; the centre of the
first pixel is (0, 0); distortion is Brown-Conrady (k1, k2, p1, p2, k3).
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from ttwmr_mj.errors import InputError, shown
from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.options import MOVES, CameraOptions

# OpenCV stops after five steps unless told; near the border of a wide lens's picture it takes some
# hundred
UNTIL_CONVERGED = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 1000, 1e-13)
DISTORTION = ("k1", "k2", "p1", "p2", "k3")  # OpenCV's order
FOLD_PX = 1e-3  # distortion undone and done again leads back to the same pixel
FOLD_GRID = (65, 49)  # columns and rows of pixels, to the corners, whose rays are looked at
FOLD_STEPS = 32  # on the way from the optical axis out to each of them
_UNIT = np.eye(3)


@dataclass(frozen=True, slots=True)
class CameraModel:
    """Intrinsics, distortion and pose of one camera."""

    width_px: int  # columns of the picture
    height_px: int  # rows of the picture
    focal_px: FloatArray  # (2,) fx, fy
    principal_px: FloatArray  # (2,) where the optical axis meets the picture
    distortion: FloatArray  # (5,) k1, k2, p1, p2, k3
    rotation: FloatArray  # (3, 3) from world to camera axes
    position_m: FloatArray  # (3,) of the optical centre in the world

    @property
    def matrix(self) -> FloatArray:
        """(3, 3) OpenCV's camera matrix."""
        (fx, fy), (cx, cy) = self.focal_px, self.principal_px
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    def project(self, point_m: FloatArray) -> FloatArray:
        """Pixels (..., 2) of world points (..., 3) in front of the camera."""
        return self.to_pixels(self.slopes(point_m))

    def slopes(self, point_m: FloatArray) -> FloatArray:
        """Slopes x/z and y/z (..., 2) of the rays to world points (..., 3), undistorted."""
        in_camera = (point_m - self.position_m) @ self.rotation.T
        return np.asarray(in_camera[..., :2] / in_camera[..., 2:])

    def to_pixels(self, tangent: FloatArray) -> FloatArray:
        """Pixels (..., 2) of undistorted ray slopes (..., 2), x/z and y/z in the camera."""
        return distort(tangent, self.distortion) * self.focal_px + self.principal_px

    def to_tangents(self, pixel: FloatArray) -> FloatArray:
        """Undistorted ray slopes (..., 2) of pixels (..., 2): the inverse of `to_pixels`."""
        return undistort((pixel - self.principal_px) / self.focal_px, self.distortion)

    def to_plane(self, pixel: FloatArray, height_m: FloatArray | float) -> FloatArray:
        """Where the rays of pixels meet horizontal planes.

        Args:
            pixel: (..., 2) column and row.
            height_m: (...) z of each plane in the world; a label's height, against parallax.

        Returns:
            (..., 2) world x, y [m].
        """
        tangent = self.to_tangents(pixel)
        ray = tangent @ self.rotation[:2] + self.rotation[2]
        reach = (height_m - self.position_m[2]) / ray[..., 2]
        return np.asarray(self.position_m[:2] + reach[..., None] * ray[..., :2])

    @property
    def looks_down(self) -> bool:
        """Whether the optical axis meets the floor."""
        return bool(self.rotation[2, 2] < 0.0)

    @property
    def folds(self) -> bool:
        """Whether a pixel has no ray of its own: distortion turns back on the way out to it."""
        sides = zip((self.width_px, self.height_px), FOLD_GRID, strict=True)
        columns, rows = (np.linspace(0.0, side - 1.0, count) for side, count in sides)
        pixel = np.stack(np.meshgrid(columns, rows), axis=-1)
        tangent = self.to_tangents(pixel)
        if not np.abs(self.to_pixels(tangent) - pixel).max() < FOLD_PX:
            return True
        way = np.linspace(0.0, 1.0, FOLD_STEPS)[:, None, None, None] * tangent
        return not bool((stretch(way, self.distortion) > 0.0).all())

    def metres_per_pixel(self, height_m: float) -> float:
        """Size of a pixel at a height, on the optical axis, across it."""
        depth = (height_m - self.position_m[2]) / self.rotation[2, 2]
        return float(depth / np.sqrt(self.focal_px[0] * self.focal_px[1]))


def hang_camera(model: mujoco.MjModel, options: CameraOptions) -> CameraModel:
    """The camera of a scene as it really is, with this lens.

    The model's camera, a child of the world, is moved and turned by the options: once per call.

    Raises:
        InputError: the scene has no camera of that name, or it looks up.
    """
    names = [model.camera(index).name for index in range(model.ncam)]
    if options.name not in names:
        allowed = ", ".join(map(repr, names)) or "none, as the scene has no camera"
        raise InputError.at("sensing.camera.name", got=shown(options.name), allowed=allowed)
    camera = model.camera(options.name)
    if options.height_m is not None:
        camera.pos[2] = options.height_m
    if any(getattr(options, name) for name in MOVES):
        _move(camera, options)
    data = mujoco.MjData(model)
    for place in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight):  # no contacts
        place(model, data)
    axes = data.cam_xmat[camera.id].reshape(3, 3)
    focal = 0.5 * options.height_px / np.tan(np.radians(float(camera.fovy[0])) / 2)
    size = np.array([options.width_px, options.height_px], dtype=np.float64)
    hung = CameraModel(
        width_px=options.width_px,
        height_px=options.height_px,
        focal_px=np.array([focal, focal]),
        principal_px=0.5 * (size - 1.0) + options.lens.principal_offset_px,
        distortion=np.array([getattr(options.lens, name) for name in DISTORTION]),
        rotation=np.diag([1.0, -1.0, -1.0]) @ axes.T,
        position_m=np.array(data.cam_xpos[camera.id]),
    )
    if not hung.looks_down:
        problem = "this camera of the scene does not look down at the floor"
        raise InputError.at("sensing.camera.name", problem, got=shown(options.name))
    return hung


def _move(camera: Any, options: CameraOptions) -> None:
    """Move a camera of a scene aside, and turn it by roll, pitch and yaw about fixed axes."""
    camera.pos[:2] += [options.x_m, options.y_m]
    angles = options.roll_rad, options.pitch_rad, options.yaw_rad
    for axis, angle in zip(_UNIT, angles, strict=True):
        turn, turned = np.empty(4), np.empty(4)
        mujoco.mju_axisAngle2Quat(turn, axis, angle)
        mujoco.mju_mulQuat(turned, turn, np.array(camera.quat))
        camera.quat[:] = turned


def distort(tangent: FloatArray, coefficient: FloatArray) -> FloatArray:
    """Brown-Conrady: where a ray of slopes (..., 2) appears to come from, (..., 2)."""
    k1, k2, p1, p2, k3 = coefficient
    x, y = tangent[..., 0], tangent[..., 1]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    cross = 2.0 * x * y
    return np.stack(
        [
            x * radial + p1 * cross + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + p2 * cross,
        ],
        axis=-1,
    )


def stretch(tangent: FloatArray, coefficient: FloatArray) -> FloatArray:
    """By how much `distort` stretches what is near (..., 2) in the direction where it does least.

    Its derivatives are symmetric, and this is their lower eigenvalue: where it is positive all the
    way out from the optical axis, no two rays appear to come from the same direction.
    """
    k1, k2, p1, p2, k3 = coefficient
    x, y = tangent[..., 0], tangent[..., 1]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    growth = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3))
    xx = radial + growth * x * x + 2.0 * p1 * y + 6.0 * p2 * x
    yy = radial + growth * y * y + 6.0 * p1 * y + 2.0 * p2 * x
    xy = growth * x * y + 2.0 * (p1 * x + p2 * y)
    return np.asarray(0.5 * (xx + yy) - np.hypot(0.5 * (xx - yy), xy))


def undistort(distorted: FloatArray, coefficient: FloatArray) -> FloatArray:
    """The inverse of `distort`, by OpenCV's fixed-point iteration carried to convergence."""
    if not coefficient.any() or not distorted.size:
        return np.array(distorted)
    points = np.ascontiguousarray(distorted, dtype=np.float64).reshape(-1, 1, 2)
    slopes = cv2.undistortPoints(points, _UNIT, coefficient, criteria=UNTIL_CONVERGED)
    return np.asarray(slopes, dtype=np.float64).reshape(distorted.shape)
