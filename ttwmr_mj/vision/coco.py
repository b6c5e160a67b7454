"""Frames for others to train or test on: PNG pictures with COCO keypoint annotations.

The four labels are the keypoints of one category, "ttwmr". Beside each picture lies a mask, an
8-bit PNG whose values are the classes of `vision.frame`.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ttwmr_mj.files import write_text
from ttwmr_mj.vision.camera.frame import FIRST_LABEL_CLASS, TRACTOR_CLASS, Frame
from ttwmr_mj.vision.camera.labels import COUNT, NAMES
from ttwmr_mj.vision.log import CameraRecord

HIDDEN_SHARE = 0.5  # a label of which less can be seen is annotated, but not as visible
CATEGORY = {
    "id": 1,
    "name": "ttwmr",
    "supercategory": "robot",
    "keypoints": list(NAMES),
    "skeleton": [[1, 2], [2, 3], [3, 4]],  # COCO counts keypoints from 1
}


class FrameExport:
    """Writes frames as they come; `finish` writes annotations.json beside them.

    Args:
        folder: gets images/, masks/ and annotations.json; made if absent.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        for name in ("images", "masks"):
            (folder / name).mkdir(parents=True, exist_ok=True)
        self._images: list[dict[str, Any]] = []
        self._annotations: list[dict[str, Any]] = []

    def add(self, records: Sequence[CameraRecord]) -> None:
        """Write the frames that arrived; frames without truth have nothing to annotate."""
        for record in records:
            if record.frame is not None and record.frame.truth is not None:
                self._write(record.frame)

    def finish(self) -> None:
        """Write the annotations of all frames."""
        dataset = {
            "info": {"description": "ttwmr-mj overhead camera, truth from the simulation"},
            "images": self._images,
            "annotations": self._annotations,
            "categories": [CATEGORY],
        }
        write_text(self._folder / "annotations.json", json.dumps(dataset, allow_nan=False) + "\n")

    def _write(self, frame: Frame) -> None:
        number = len(self._images) + 1
        name = f"{number:06d}.png"
        rows, columns = frame.image.shape[:2]
        cv2.imwrite(str(self._folder / "images" / name), frame.image)
        self._images.append(
            {
                "id": number,
                "file_name": name,
                "width": columns,
                "height": rows,
                "time_s": frame.time_s,
            }
        )
        self._annotations.append(annotation(frame, number))
        if frame.truth is not None and frame.truth.segmentation is not None:
            cv2.imwrite(str(self._folder / "masks" / name), frame.truth.segmentation)


def annotation(frame: Frame, number: int) -> dict[str, Any]:
    """The COCO annotation of a frame's robot; `number` is the image's and the annotation's id.

    Keypoint flags: 2 visible, 1 in the picture but hidden, 0 outside (then at 0, 0). Box and area
    are of the robot's visible pixels; without segmentation they span the visible labels.
    """
    truth = frame.truth
    if truth is None:
        raise ValueError("a frame without truth cannot be annotated")
    rows, columns = frame.image.shape[:2]
    keypoints: list[float] = []
    for (x, y), seen in zip(truth.centres_px, truth.visible, strict=True):
        inside = -0.5 <= x <= columns - 0.5 and -0.5 <= y <= rows - 0.5
        flag = 0 if not inside else 2 if seen >= HIDDEN_SHARE else 1
        # COCO counts from the picture's corner, OpenCV from the first pixel's centre
        keypoints += [float(x) + 0.5, float(y) + 0.5, flag] if flag else [0.0, 0.0, 0]
    box, area, outlines = _extent(frame)
    return {
        "id": number,
        "image_id": number,
        "category_id": CATEGORY["id"],
        "keypoints": keypoints,
        "num_keypoints": sum(1 for flag in keypoints[2::3] if flag),
        "bbox": box,
        "area": area,
        "segmentation": outlines,
        "iscrowd": 0,
    }


def _extent(frame: Frame) -> tuple[list[float], float, list[list[float]]]:
    """Box (x, y, width, height), area and outlines of the robot's pixels."""
    truth = frame.truth
    if truth is None or truth.segmentation is None:
        shown = truth.centres_px[truth.visible > 0] if truth is not None else np.empty((0, 2))
        if not len(shown):
            return [0.0, 0.0, 0.0, 0.0], 0.0, []
        low, size = shown.min(axis=0), np.ptp(shown, axis=0)
        return [*map(float, low), *map(float, size)], float(size.prod()), []
    last = FIRST_LABEL_CLASS + COUNT - 1
    robot = cv2.inRange(truth.segmentation, TRACTOR_CLASS, last)
    area = float(cv2.countNonZero(robot))
    if area == 0:
        return [0.0, 0.0, 0.0, 0.0], 0.0, []
    contours, _ = cv2.findContours(robot, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    outlines = [part.reshape(-1).astype(float).tolist() for part in contours if len(part) > 2]
    return [float(value) for value in cv2.boundingRect(robot)], area, outlines
