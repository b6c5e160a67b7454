"""The laboratory from above, drawn flat: paths, where the robot should be, and where it is."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.plants.model.outline import chassis, outline
from ttwmr_mj.recording import style
from ttwmr_mj.recording.scene.poses import BodyPoses
from ttwmr_mj.recording.style import Colour
from ttwmr_mj.recording.video.footage import Footage
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.frame import Image

MARGIN_M = 0.2  # around the paths, of Table I's robot
TOP_PX, BOTTOM_PX = 46, 14  # kept free for words
GRID_M = 0.1
ROUNDING_M = 0.003  # of the robots outlines
Pixels = NDArray[np.int32]
SHIFT = 4  # coordinates are given to OpenCV in sixteenths of a pixel
BANDS = {"trailer reference": 4, "reference": 7}  # widths in pixels
LINES: dict[str, Colour] = {"trailer": style.TRAILER, "tractor": style.TRACTOR}
EDGE: Colour = (40, 44, 50)


class Map:
    """A picture that is drawn on frame by frame, in the order of time.

    Args:
        footage: what is shown.
        width, height: of the picture in pixels.
    """

    def __init__(self, footage: Footage, width: int, height: int) -> None:
        self._footage = footage
        self._paths = whole = footage.paths_m()
        points = np.concatenate(list(whole.values()))
        margin_m = MARGIN_M * footage.scenario.robot.looks_scale
        low, high = np.nanmin(points, axis=0) - margin_m, np.nanmax(points, axis=0) + margin_m
        free = np.array([width, height - TOP_PX - BOTTOM_PX])
        self._scale = float((free / (high - low)).min())  # pixels per metre
        self._middle_m = 0.5 * (low + high)
        self._middle_px = np.array([0.5 * width, TOP_PX + 0.5 * free[1]])
        self._ground = np.full((height, width, 3), style.FLOOR, dtype=np.uint8)
        self._draw_grid(width, height)
        for name, band in BANDS.items():
            self._line(self._ground, whole[name], style.REFERENCE_BAND, band)
        self._drawn = 0  # row of the run up to which the driven paths are on the ground
        self._until(0)
        model = build_model(footage.scenario.robot, footage.scenario.plant.contact)
        poses = BodyPoses(model)
        self._bodies = bodies = chassis(model)
        self._shapes = {name: outline(model, body, ROUNDING_M) for name, body in bodies.items()}
        self._now = poses.standing_at(footage.q)
        self._reference = poses.standing_at(np.nan_to_num(footage.at(footage.rows.ref_q[:, 0])))
        self._known = np.asarray(np.isfinite(footage.at(footage.rows.ref_q[:, 0])).all(axis=1))

    def at(self, frame: int) -> Image:
        """The picture (height, width, 3) RGB at a frame; frames only go on."""
        self._until(frame)
        picture = self._ground.copy()
        if self._known[frame]:
            for name in self._shapes:
                self._outline(picture, name, self._reference, frame)
        for name in self._shapes:
            corners = self._corners(name, self._now, frame)
            cv2.fillPoly(picture, [corners], _colour(name), cv2.LINE_AA, SHIFT)
            cv2.polylines(picture, [corners], True, EDGE, 1, cv2.LINE_AA, SHIFT)
        return picture

    def _outline(
        self, picture: Image, name: str, poses: tuple[FloatArray, FloatArray], frame: int
    ) -> None:
        corners = self._corners(name, poses, frame)
        cv2.polylines(picture, [corners], True, style.REFERENCE, 2, cv2.LINE_AA, SHIFT)

    def _corners(self, name: str, poses: tuple[FloatArray, FloatArray], frame: int) -> Pixels:
        body = self._bodies[name]
        w, x, y, z = poses[1][frame, body]
        c, s = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z)
        shape = self._shapes[name][:, :2]
        turned = shape @ np.array([[c, s], [-s, c]])
        return self._px(poses[0][frame, body, :2] + turned)

    def _until(self, frame: int) -> None:
        """Draw what was driven since the last frame."""
        time_s = self._footage.rows.time_s
        row = int(np.searchsorted(time_s, self._footage.time_s[frame], side="right")) - 1
        if row > self._drawn:
            for name, colour in LINES.items():
                piece = self._paths[name][self._drawn : row + 1]
                self._line(self._ground, piece, colour, 2)
            self._drawn = row

    def _draw_grid(self, width: int, height: int) -> None:
        ends_px = np.array([[0.0, height], [width, 0.0]])
        low, high = self._middle_m + (ends_px - self._middle_px) / [self._scale, -self._scale]
        for axis in range(2):
            for value in np.arange(np.ceil(low[axis] / GRID_M), high[axis] / GRID_M) * GRID_M:
                ends = np.array([low, high])
                ends[:, axis] = value
                self._line(self._ground, ends, style.GRID, 1)

    def _line(self, picture: Image, points_m: FloatArray, colour: Colour, width: int) -> None:
        finite = np.isfinite(points_m).all(axis=1)
        for piece in np.split(points_m, np.flatnonzero(np.diff(finite)) + 1):
            if len(piece) > 1 and np.isfinite(piece).all():
                px = [self._px(piece)]
                cv2.polylines(picture, px, False, colour, width, cv2.LINE_AA, SHIFT)

    def _px(self, points_m: FloatArray) -> Pixels:
        """OpenCV's coordinates of points on the floor: right and down, in sixteenths."""
        px = self._middle_px + (points_m - self._middle_m) * [self._scale, -self._scale]
        return np.asarray(np.rint(px * (1 << SHIFT)), dtype=np.int32)


def _colour(chassis_name: str) -> Colour:
    """Of the tractor, or of any trailer."""
    return LINES["tractor" if chassis_name == "tractor" else "trailer"]
