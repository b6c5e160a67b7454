"""Poses that a camera's accuracy is measured at, with distractors on the floor beside them."""

from __future__ import annotations

import mujoco
import numpy as np

from ttwmr_mj.robot import Hitch, RobotParameters, Trailer
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.labels import NAMES
from ttwmr_mj.vision.camera.options import Distractor
from ttwmr_mj.vision.camera.virtual_camera import VirtualCamera

POSES_PER_LAYOUT = 10
DISTRACTORS = 3
REACH_M = 0.43  # of P, the article's circle
ROBOT_REACH_M = 0.26  # from P, with a disc's radius: distractors lie beyond
LARGEST_HITCH_RAD = 2.0
ROBOT = RobotParameters()
REAR_HITCH_M = 0.23  # of a towing trailer, behind its bed
BORDER_PX = 12.0  # a label and its blur are so far inside of the picture


def train_of(trailers: int) -> RobotParameters:
    """Table I's trailer repeated."""
    towing = Trailer(next_hitch_offset_m=REAR_HITCH_M)
    return RobotParameters(
        trailers=(*[towing] * (trailers - 1), Trailer()), hitches=(Hitch(),) * trailers
    )


class Drawn:
    """Random poses of a train (n, 3 + trailers) that a camera sees whole, no body in another."""

    def __init__(self, camera: VirtualCamera) -> None:
        self._camera, self._data = camera, mujoco.MjData(camera.model)
        self._size_px = np.array([camera.true.width_px, camera.true.height_px])
        hulls = [
            i for i in range(camera.model.ngeom) if camera.model.geom(i).name.endswith("_hull")
        ]
        self._hulls = set(hulls)

    def layout(self, rng: np.random.Generator) -> tuple[tuple[Distractor, ...], FloatArray]:
        """Distractors anywhere in view, and poses clear of them."""
        trailers = self._camera.layout.trailers
        if trailers == 1:
            return random_layout(rng)
        discs = rng.uniform([-0.85, -0.62], [0.85, 0.62], (DISTRACTORS, 2))
        poses: list[FloatArray] = []
        while len(poses) < POSES_PER_LAYOUT:
            hitches = rng.uniform(-1.0, 1.0, trailers) * LARGEST_HITCH_RAD
            place = rng.uniform([-0.8, -0.6], [0.8, 0.6])
            q = np.array([*place, *np.cumsum([rng.uniform(-np.pi, np.pi), *hitches])])
            labels_m = self._camera.layout.centres_m(q)
            away = np.linalg.norm(discs[:, None] - labels_m[:, :2], axis=2).min()
            # a disc's radius and a label's, and their blur
            if away > 0.06 and self._apart(q) and self._in_view(labels_m):
                poses.append(q)
        return distractors(discs, rng), np.array(poses)

    def _apart(self, q: FloatArray) -> bool:
        self._data.qpos[:] = self._camera.posture.positions(q)
        mujoco.mj_forward(self._camera.model, self._data)
        pairs = self._data.contact.geom[: self._data.ncon].tolist()
        return not any(self._hulls.issuperset(pair) for pair in pairs)

    def _in_view(self, labels_m: FloatArray) -> bool:
        pixel = self._camera.true.project(labels_m)
        return bool(np.minimum(pixel, self._size_px - 1.0 - pixel).min() > BORDER_PX)


def distractors(discs: FloatArray, rng: np.random.Generator) -> tuple[Distractor, ...]:
    """Discs (n, 2) in random colours of labels."""
    colours = rng.integers(len(NAMES), size=DISTRACTORS)
    return tuple(
        Distractor(colour_of=NAMES[colour], position_m=(float(x), float(y)))
        for colour, (x, y) in zip(colours, discs, strict=True)
    )


def random_layout(rng: np.random.Generator) -> tuple[tuple[Distractor, ...], FloatArray]:
    """Distractors anywhere in view, and poses (n, 4) of one trailer clear of them."""
    discs = rng.uniform([-0.85, -0.62], [0.85, 0.62], (DISTRACTORS, 2))
    poses: list[FloatArray] = []
    while len(poses) < POSES_PER_LAYOUT:
        radius, around = REACH_M * np.sqrt(rng.random()), rng.uniform(-np.pi, np.pi)
        place = radius * np.array([np.cos(around), np.sin(around)])
        theta1, hitch = rng.uniform(-np.pi, np.pi), rng.uniform(-1.0, 1.0) * LARGEST_HITCH_RAD
        if np.linalg.norm(discs - place, axis=1).min() > ROBOT_REACH_M:
            poses.append(np.array([*place, theta1, theta1 + hitch]))
    return distractors(discs, rng), np.array(poses)


def moving(q: FloatArray, speed_m_s: float) -> FloatArray:
    """Rates of a robot that drives straight on."""
    rates = np.zeros_like(q)
    rates[:2] = speed_m_s * np.cos(q[2]), speed_m_s * np.sin(q[2])
    return rates
