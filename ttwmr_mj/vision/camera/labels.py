"""The four labels: where they sit on the robot, how high, how large, which colour."""

from dataclasses import dataclass
from typing import get_args

import mujoco
import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.errors import InputError
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.options import LabelName

NAMES: tuple[LabelName, ...] = get_args(LabelName)
TRACTOR, TRAILER = 0, 1
BODY: NDArray[np.intp] = np.array([TRACTOR, TRACTOR, TRAILER, TRAILER])
COUNT = len(NAMES)


@dataclass(frozen=True, slots=True)
class LabelLayout:
    """Geometry and colour of the labels, in the order of `NAMES`.

    Attributes:
        offset_m: (4, 2) centre from P, x forward and y left, in the frame of the label's half.
        height_m: (4,) centre above the floor.
        radius_m: radius of a label.
        colour_bgr: (4, 3) blue, green, red, each 0 to 1.
    """

    offset_m: FloatArray
    height_m: FloatArray
    radius_m: float
    colour_bgr: FloatArray

    def centres_m(self, q: FloatArray) -> FloatArray:
        """World x, y, z of every label, (..., 4, 3), of a robot at q (..., 4)."""
        angle = q[..., 2:][..., BODY]
        cos, sin = np.cos(angle), np.sin(angle)
        x, y = self.offset_m.T
        return np.stack(
            [
                q[..., :1] + cos * x - sin * y,
                q[..., 1:2] + sin * x + cos * y,
                np.broadcast_to(self.height_m, angle.shape),
            ],
            axis=-1,
        )


def read_layout(model: mujoco.MjModel) -> LabelLayout:
    """The layout of a scene's labels: sites and geoms named label_<name>, material alike.

    Raises:
        InputError: a label or the site P is missing.
    """
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    try:
        origin = data.site("P").xpos
        sites = np.array([data.site(f"label_{name}").xpos for name in NAMES])
        geoms = [model.geom(f"label_{name}") for name in NAMES]
    except KeyError as error:
        raise InputError.at(
            "plant.contact.model_path",
            f"the scene lacks a part of the labels: {error}",
            allowed="a scene with the site P and a site and a geom label_<name> for each of "
            f"{', '.join(NAMES)}, at heading zero in keyframe 0",
        ) from error
    colour = np.array([model.mat_rgba[int(geom.matid[0]), 2::-1] for geom in geoms])
    return LabelLayout(
        offset_m=sites[:, :2] - origin[:2],
        height_m=sites[:, 2].copy(),
        radius_m=float(geoms[0].size[0]),
        colour_bgr=colour.astype(np.float64),
    )
