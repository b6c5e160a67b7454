"""Frames for others to train or test on: PNG pictures with COCO keypoint annotations.

The labels are the keypoints of one category, "ttwmr". Beside each picture lies a mask, an
8-bit PNG whose values are the classes of `camera.frame`. A picture's `time_s` is when it was
exposed, in truth as all else; `stamp_s` is when the loop took it to be.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ttwmr_mj.files import write_bytes, write_text
from ttwmr_mj.vision.camera.frame import FIRST_LABEL_CLASS, TRACTOR_CLASS, Frame, FrameTruth, Image
from ttwmr_mj.vision.camera.labels import NAMES, LabelLayout
from ttwmr_mj.vision.log import CameraRecord

HIDDEN_SHARE = 0.5  # a label of which less can be seen counts as hidden
CATEGORY_ID = 1


def category(layout: LabelLayout) -> dict[str, Any]:
    """The robot, its labels a chain from front to rear."""
    count = layout.count
    return {
        "id": CATEGORY_ID,
        "name": "ttwmr",
        "supercategory": "robot",
        "keypoints": list(layout.names),
        "skeleton": [[i, i + 1] for i in range(1, count)],  # COCO counts keypoints from 1
    }


class FrameExport:
    """Writes frames as they come; `finish` writes annotations.json beside them.

    Args:
        folder: gets images/, masks/ and annotations.json; made if absent.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._categories: list[dict[str, Any]] = []
        for name in ("images", "masks"):
            (folder / name).mkdir(parents=True, exist_ok=True)
        self._images: list[dict[str, Any]] = []
        self._annotations: list[dict[str, Any]] = []

    def add(self, layout: LabelLayout, records: Sequence[CameraRecord]) -> None:
        """Write the frames that arrived; without the truth there is nothing to annotate.

        Args:
            layout: the labels on the robot.
            records: one per control period, oldest first.
        """
        self._categories = [category(layout)]
        for record in records:
            frame = record.frame
            if frame and frame.truth and frame.truth.segmentation is not None:
                self._write(frame, frame.truth, frame.truth.segmentation)

    def finish(self) -> None:
        """Write the annotations of all frames."""
        dataset = {
            "info": {"description": "ttwmr-mj overhead camera, truth from the simulation"},
            "images": self._images,
            "annotations": self._annotations,
            "categories": self._categories,
        }
        write_text(self._folder / "annotations.json", json.dumps(dataset, allow_nan=False) + "\n")

    def _write(self, frame: Frame, truth: FrameTruth, classes: Image) -> None:
        number = len(self._images) + 1
        name = f"{number:06d}.png"
        rows, columns = frame.pixels.shape[:2]
        image = {"id": number, "file_name": name, "width": columns, "height": rows}
        times = {"time_s": truth.time_s, "stamp_s": frame.time_s}
        self._images.append({**image, **times})
        self._annotations.append(annotation(truth, classes, number))
        for kind, picture in (("images", frame.image), ("masks", classes)):
            _, content = cv2.imencode(".png", picture)
            write_bytes(self._folder / kind / name, content.tobytes())


def annotation(truth: FrameTruth, classes: Image, number: int) -> dict[str, Any]:
    """The COCO annotation of a frame's robot.

    Keypoint flags: 2 visible, 1 in the picture but hidden, 0 outside (then at 0, 0). Box, area and
    outlines are of the robot's visible pixels.

    Args:
        truth: of the frame.
        classes: (rows, columns) its segmentation.
        number: the image's and the annotation's id.
    """
    size = np.array(classes.shape[::-1])
    # COCO counts from the picture's corner, OpenCV from the first pixel's centre
    places = truth.centres_px + 0.5
    inside = ((places >= 0) & (places <= size)).all(axis=1)
    flags = np.where(inside, np.where(truth.visible >= HIDDEN_SHARE, 2, 1), 0)
    keypoints: list[float] = []
    for (x, y), flag in zip(places.tolist(), flags.tolist(), strict=True):
        keypoints += [x, y, flag] if flag else [0.0, 0.0, 0]
    robot = cv2.inRange(classes, TRACTOR_CLASS, FIRST_LABEL_CLASS + len(NAMES) - 1)
    contours, _ = cv2.findContours(robot, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    return {
        "id": number,
        "image_id": number,
        "category_id": CATEGORY_ID,
        "keypoints": keypoints,
        "num_keypoints": int(inside.sum()),
        "bbox": [float(value) for value in cv2.boundingRect(robot)],
        "area": float(cv2.countNonZero(robot)),
        "segmentation": [part.ravel().astype(float).tolist() for part in contours if len(part) > 2],
        "iscrowd": 0,
    }
