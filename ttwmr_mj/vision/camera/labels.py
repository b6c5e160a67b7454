"""The labels: where they sit on the robot, how high, how large, which colour.

Four hues tell front from rear and the tractor from a trailer. All trailers have the same two: which
is which, the chain of hitches says (`tracking.constellation`).
"""

from dataclasses import dataclass, field
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.errors import Fault, InputError
from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.joints import Joints
from ttwmr_mj.plants.model.names import hitches, trailer_part
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.camera.options import LabelName

NAMES: tuple[LabelName, ...] = get_args(LabelName)  # of the hues, and of the first four labels
TRACTOR = NAMES[:2]
LABELS_ACROSS = 4.0  # the longer side of a picture, at least: a body with its two is as long


@dataclass(frozen=True, slots=True)
class LabelLayout:
    """Geometry and colour of the labels: front and rear of the tractor, then of each trailer.

    Attributes:
        offset_m: (labels, 2) centre from P or, of a trailer, its own hitch, x forward and y left,
            in the body's frame.
        height_m: (labels,) centre above the floor.
        radius_m: radius of a label.
        colour_bgr: (4, 3) blue, green, red of the hues, each 0 to 1.
        reach_m: (n − 1,) from each trailer's hitch to the next.
        body: (labels,) whose it is: 0 the tractor's, 1 the first trailer's.
        hue: (labels,) its colour, as in `NAMES`.
    """

    offset_m: FloatArray
    height_m: FloatArray
    radius_m: float
    colour_bgr: FloatArray
    reach_m: FloatArray
    body: NDArray[np.intp] = field(init=False)
    hue: NDArray[np.intp] = field(init=False)
    _towed: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        """Number the labels."""
        labels = np.arange(len(self.offset_m))
        body = labels // 2
        object.__setattr__(self, "body", body)
        object.__setattr__(self, "hue", np.where(labels < len(NAMES), labels, 2 + labels % 2))
        # the reaches between P and a label's hitch
        behind = body[:, None] > 1 + np.arange(len(self.reach_m))
        object.__setattr__(self, "_towed", behind * self.reach_m)

    @property
    def count(self) -> int:
        """Number of labels."""
        return len(self.offset_m)

    @property
    def trailers(self) -> int:
        """Number of trailers."""
        return len(self.reach_m) + 1

    @property
    def names(self) -> tuple[str, ...]:
        """What a person calls the labels."""
        towing = range(2, self.trailers + 1)
        more = (f"trailer_{i}_{end}" for i in towing for end in ("front", "rear"))
        return (*NAMES, *more)

    @property
    def furthest_m2(self) -> FloatArray:
        """(labels,) how far from P a label can be, squared, its angles taken as independent."""
        return np.asarray((self.offset_m**2).sum(axis=1) + (self._towed**2).sum(axis=1))

    def first(self, bodies: int) -> "LabelLayout":
        """The labels of so many bodies, tractor and at least one trailer."""
        labels = slice(2 * bodies)
        return LabelLayout(
            self.offset_m[labels],
            self.height_m[labels],
            self.radius_m,
            self.colour_bgr,
            self.reach_m[: bodies - 2],
        )

    def centres_m(self, q: FloatArray) -> FloatArray:
        """World x, y, z of every label, (..., labels, 3), of a robot at q (..., 3 + n)."""
        angle = q[..., 2:][..., self.body]
        cos, sin = np.cos(angle), np.sin(angle)
        x, y = self.offset_m.T
        towing = q[..., 3:-1]
        return np.stack(
            [
                q[..., :1] - np.cos(towing) @ self._towed.T + cos * x - sin * y,
                q[..., 1:2] - np.sin(towing) @ self._towed.T + sin * x + cos * y,
                np.broadcast_to(self.height_m, angle.shape),
            ],
            axis=-1,
        )

    def hitches_m(self, q: FloatArray) -> FloatArray:
        """World x, y of every hitch, (n, 2), of a robot at q (3 + n,); the first is P."""
        towing = np.stack([np.cos(q[3:-1]), np.sin(q[3:-1])], axis=-1)
        return np.asarray(q[:2] - self._towed[2::2] @ towing)

    def jacobian(self, q: FloatArray) -> FloatArray:
        """(2·labels, 3 + n) derivatives of the labels' x, y, label after label, by q (3 + n,)."""
        jacobian = np.zeros((2 * self.count, 3 + self.trailers))
        jacobian[0::2, 0] = jacobian[1::2, 1] = 1.0
        jacobian[0::2, 3:-1] = self._towed * np.sin(q[3:-1])
        jacobian[1::2, 3:-1] = -self._towed * np.cos(q[3:-1])
        cos, sin = np.cos(q[2:])[self.body], np.sin(q[2:])[self.body]
        x, y = self.offset_m.T
        rows = np.arange(self.count)
        jacobian[2 * rows, 2 + self.body] = -sin * x - cos * y
        jacobian[2 * rows + 1, 2 + self.body] = cos * x - sin * y
        return jacobian


def label_fault(
    camera: CameraModel, layout: LabelLayout, narrowest_px: float = 0.0
) -> Fault | None:
    """Why a camera that looks down cannot see the labels, or None: it can.

    Args:
        camera: somewhere above the floor, perhaps not above the labels.
        layout: the labels.
        narrowest_px: how wide a label must be.
    """
    highest_m, camera_m = layout.height_m.max(), camera.position_m[2]
    if camera_m <= highest_m:
        return Fault(
            problem=f"this camera is {camera_m:.3g} m above the floor, and the robot's labels are "
            f"at {highest_m:.3g} m",
            hint="hang it above the robot, or say where it is in metres",
        )
    across_px = 2.0 * layout.radius_m / camera.metres_per_pixel(float(layout.height_m.mean()))
    widest_px = max(camera.width_px, camera.height_px) / LABELS_ACROSS
    if not narrowest_px <= across_px <= widest_px:
        fx, fy = camera.focal_px
        return Fault(
            problem=f"to this camera, {camera_m:.3g} m above the floor, with focal lengths of "
            f"{fx:.4g} and {fy:.4g} px, a label is {across_px:.4g} px wide",
            allowed=f"{narrowest_px:g} to {widest_px:g} px in a picture of "
            f"{camera.width_px}×{camera.height_px} px",
            hint="are its lengths in metres, and its focal lengths in pixels?",
        )
    return None


def label_parts(trailers: int) -> tuple[str, ...]:
    """Sites and geoms of the labels, in a layout's order."""
    front, rear = (f"label_{name}" for name in NAMES[2:])
    towed = (trailer_part(name, i) for i in range(trailers) for name in (front, rear))
    return (*(f"label_{name}" for name in TRACTOR), *towed)


def read_layout(model: mujoco.MjModel) -> LabelLayout:
    """The layout of a scene's labels: sites and geoms named label_<name>, material alike.

    Raises:
        InputError: a label or the site P is missing.
    """
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    try:
        trailers = Joints(model).trailers
        parts = label_parts(trailers)
        hinges = [data.joint(name).xanchor for name in hitches(trailers)]
        origin = np.array([data.site("P").xpos, data.site("P").xpos, *hinges[1:]])
        sites = np.array([data.site(part).xpos for part in parts])
        geoms = [model.geom(part) for part in parts]
    except KeyError as error:
        raise InputError.at(
            "plant.contact.model_path",
            f"the scene lacks a part of the labels: {error}",
            allowed="a scene with the site P and a site and a geom label_<name> for each of "
            f"{', '.join(NAMES)}, on the robot as it stands at the origin",
        ) from error
    paint = [int(geom.matid[0]) for geom in geoms[: len(NAMES)]]
    return LabelLayout(
        offset_m=sites[:, :2] - origin[np.arange(len(parts)) // 2, :2],
        height_m=sites[:, 2].copy(),
        radius_m=float(geoms[0].size[0]),
        colour_bgr=model.mat_rgba[paint, 2::-1].astype(np.float64),
        reach_m=-np.diff(origin[1:, 0]),
    )
