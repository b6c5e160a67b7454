"""Annotations of exported frames, by hand-made masks."""

from __future__ import annotations

import numpy as np
import pytest

from ttwmr_mj.vision.camera.frame import FrameTruth
from ttwmr_mj.vision.coco import annotation


def made(centres: list[tuple[float, float]], visible: list[float], classes: np.ndarray) -> dict:
    truth = FrameTruth(0.0, np.zeros(4), np.array(centres), np.array(visible), classes)
    return annotation(truth, classes, 7)


def test_keypoints_say_where_and_whether_a_label_is_seen() -> None:
    centres = [(-0.5, 5.0), (3.0, 29.5), (-0.6, 5.0), (39.6, 4.0)]
    note = made(centres, [0.5, 0.49, 1.0, 1.0], np.zeros((30, 40), dtype=np.uint8))
    # from the picture's corner; on its border still inside, half seen still visible
    assert note["keypoints"] == [0.0, 5.5, 2, 3.5, 30.0, 1, 0.0, 0.0, 0, 0.0, 0.0, 0]
    assert note["num_keypoints"] == 2
    assert (note["id"], note["image_id"], note["category_id"]) == (7, 7, 1)
    assert (note["area"], note["bbox"], note["segmentation"]) == (0.0, [0.0] * 4, [])


@pytest.mark.parametrize("value", [1, 2, 3, 6])
def test_box_and_area_are_of_the_robots_pixels(value: int) -> None:
    classes = np.zeros((30, 40), dtype=np.uint8)
    classes[10:14, 20:27] = value
    classes[0:5, 0:5] = 7  # an occluder
    classes[20:25, 0:5] = 8  # a distractor
    note = made([(0.0, 0.0)] * 4, [1.0] * 4, classes)
    assert note["bbox"] == [20.0, 10.0, 7.0, 4.0]
    assert note["area"] == 28.0
    assert note["segmentation"] == [[20.0, 10.0, 20.0, 13.0, 26.0, 13.0, 26.0, 10.0]]
