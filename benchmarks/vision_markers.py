"""Printed ArUco markers on the robot in place of its discs, and the pose OpenCV finds by them."""

from __future__ import annotations

from typing import Any

import cv2
import mujoco
import numpy as np
from vision_poses import ROBOT

from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.mjcf import build_spec
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.frame import Image
from ttwmr_mj.vision.camera.labels import NAMES, LabelLayout
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.tracking.pose import solve_pose

DICTIONARY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
MODULES = 8  # of a printed marker: 4 of code, 2 of frame, 2 of white border
MODULE_PX = 24
# the largest printed squares that fit on the halves: side, and x from P
LARGE_SIDE_M = 0.064
LARGE_X_M = (0.0375, -0.146)
LARGE_HEIGHT_M = 0.0436  # above the axle, like the labels


def marker_model(large: bool) -> mujoco.MjModel:
    """The laboratory with printed markers on the robot: one per label, or one per half."""
    spec = build_spec(ROBOT, ContactOptions())
    squares = []
    for i, name in enumerate(NAMES):
        geom = spec.geom(f"label_{name}")
        geom.group = 5
        if not large:
            squares.append((i, "tractor" if i < 2 else "trailer", geom.pos[0], 2 * geom.size[0]))
    if large:
        squares = [(0, "tractor", LARGE_X_M[0], LARGE_SIDE_M)]
        squares += [(1, "trailer", LARGE_X_M[1], LARGE_SIDE_M)]
    for number, body, x, side in squares:
        code = cv2.aruco.generateImageMarker(DICTIONARY, number, (MODULES - 2) * MODULE_PX)
        printed = cv2.copyMakeBorder(
            code, MODULE_PX, MODULE_PX, MODULE_PX, MODULE_PX, cv2.BORDER_CONSTANT, value=255
        )
        pixels = np.maximum(printed, 8)
        texture = spec.add_texture(
            name=f"marker{number}",
            type=mujoco.mjtTexture.mjTEXTURE_2D,
            width=pixels.shape[1],
            height=pixels.shape[0],
            nchannel=3,
        )
        texture.data = np.repeat(pixels[..., None], 3, axis=2).tobytes()
        material = spec.add_material(name=f"marker{number}", rgba=[0.7, 0.7, 0.7, 1], specular=0)
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = f"marker{number}"
        spec.body(body).add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[0.5 * side, 0.5 * side, 0.0002],
            pos=[x, 0.0, LARGE_HEIGHT_M - 0.0002],
            material=f"marker{number}",
            group=2,
            contype=0,
            conaffinity=0,
            mass=0,
        )
    return spec.compile()


def aruco_pose(
    image: Image, known: CameraModel, layout: LabelLayout, detector: Any, large: bool
) -> FloatArray | None:
    """The pose q from cv2.aruco's corners, refined by OpenCV."""
    corners, ids, _ = detector.detectMarkers(image)
    seen = {} if ids is None else dict(zip(ids.ravel().tolist(), corners, strict=True))
    height = float(layout.height_m.mean())
    points = {
        number: known.to_plane(np.asarray(corner, dtype=np.float64).reshape(4, 2), height)
        for number, corner in seen.items()
    }
    if not large:
        centres = np.full((len(NAMES), 2), np.nan)
        for number, square in points.items():
            if number < len(NAMES):
                centres[number] = square.mean(axis=0)
        pose = solve_pose(centres, layout)
        return pose.q if pose and np.isfinite(centres).all() else None
    if not {0, 1} <= points.keys():
        return None
    angles, origins = [], []
    for number, x in enumerate(LARGE_X_M):
        square = points[number]
        along = square[1] + square[2] - square[0] - square[3]
        angle = np.arctan2(along[1], along[0])
        angles.append(angle)
        origins.append(square.mean(axis=0) - x * np.array([np.cos(angle), np.sin(angle)]))
    return np.array([*np.mean(origins, axis=0), *angles])
