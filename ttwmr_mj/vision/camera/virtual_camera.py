"""The simulated camera: a robot's posture becomes a frame with its truth."""

import math
from collections.abc import Callable
from copy import copy
from functools import cache
from itertools import pairwise

import numpy as np

from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.joints import Joints
from ttwmr_mj.plants.model.names import trailer_part
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.frame import (
    DISTRACTOR_CLASS,
    FIRST_LABEL_CLASS,
    TRACTOR_CLASS,
    TRAILER_CLASS,
    Frame,
    FrameTruth,
    Image,
)
from ttwmr_mj.vision.camera.labels import NAMES, TRACTOR, label_parts, read_layout
from ttwmr_mj.vision.camera.lens import LensMap
from ttwmr_mj.vision.camera.model import CameraModel, hang_camera
from ttwmr_mj.vision.camera.noise import SensorNoise
from ttwmr_mj.vision.camera.options import CameraOptions, Distractor, FadedLabel
from ttwmr_mj.vision.camera.overlays import CIRCLE, GlareSpots, Occluders, circle_points, fill
from ttwmr_mj.vision.camera.rendering.posture import Posture
from ttwmr_mj.vision.camera.rendering.region import Region
from ttwmr_mj.vision.camera.rendering.renderer import RegionRenderer

Past = Callable[[float], FloatArray]  # (nq,) generalized positions so many seconds ago
MAX_INSTANTS = 32  # averaged for one exposure, however fast the robot
FLOOR_HALF_SIZE_M = 5.0  # an infinite floor costs 1 ms a picture
_RINGS = np.sqrt(np.array([1.0, 3.0, 5.0, 7.0]) / 8.0)
# points that stand for equal shares of a disc's area
DISC: FloatArray = (_RINGS[:, None, None] * CIRCLE[::2]).reshape(-1, 2)


class VirtualCamera:
    """Takes frames of one robot. All calls must come from the thread that made it.

    Attributes:
        model: its own copy of the scene it looks at.
        true: its geometry; the loop knows only a calibration of it.
        layout: the labels on the robot.
        posture: between q and this model's joints.
    """

    def __init__(
        self,
        options: CameraOptions,
        model: mujoco.MjModel,
        rng: np.random.Generator,
        *,
        segmentation: bool = False,
    ) -> None:
        """Build the scene and render its background.

        Args:
            options: the camera, its sensor and its faults.
            model: the scene, as of `plants.model.mjcf.build_model`; it is copied.
            rng: source of the sensor's noise.
            segmentation: whether frames carry the class of every pixel.

        Raises:
            InputError: the scene lacks a part, or the lens folds the picture.
            MachineError: no OpenGL.
        """
        self._options = options
        self._segmentation = segmentation
        self.model = copy(model)
        self.layout = read_layout(self.model)
        self.true: CameraModel = hang_camera(self.model, options)
        self.posture = Posture(self.model)
        _simplify_for_drawing(self.model)
        for faded in options.faults.faded:
            _fade(self.model, faded)
        self._lens = LensMap(self.true, options.supersampling, options.lens.defocus_px)
        self._renderer = RegionRenderer(self.model, options.name, self._lens.focal_px)
        self._noise = SensorNoise(options.noise, options.width_px, options.height_px, rng)
        self._occluders = Occluders(options.faults.occluders, self.true, self.layout)
        self._glare = GlareSpots(options.faults.glare, options.width_px, options.height_px)
        self._classes = _classes(self.model)
        self._size_px = np.array([self.true.width_px, self.true.height_px])
        highest = float(self.layout.height_m.max())
        self._label_px = 2.0 * self.layout.radius_m / self.true.metres_per_pixel(highest)
        self._empty_floor = self._renderer.static(self._lens.whole)
        self.lay_out(options.faults.distractors)

    def lay_out(self, distractors: tuple[Distractor, ...]) -> None:
        """Put other distractors on the floor."""
        whole, sensor = self._lens.whole, self._lens.sensor
        self._floor = self._empty_floor.copy()
        classes = np.zeros(whole.shape, dtype=np.uint8)
        for distractor in distractors:
            centre = np.array(distractor.position_m)
            slopes = self.true.slopes(circle_points(centre, distractor.diameter_m, 0.0))
            outline = self._lens.focal_px * slopes - [whole.left + 0.5, whole.top + 0.5]
            colour = 255 * self.layout.colour_bgr[NAMES.index(distractor.colour_of)]
            fill(self._floor, outline, colour.tolist())
            fill(classes, outline, [DISTRACTOR_CLASS], smooth=False)
        self._background = self._lens.expose(self._floor, whole, sensor)
        self._background_classes = self._lens.nearest(classes, whole, sensor)

    def take(self, qpos: FloatArray, q_rate: FloatArray, time_s: float) -> Frame:
        """Expose a frame whose shutter closes now.

        Args:
            qpos: (nq,) generalized positions now.
            q_rate: (3 + n,) rates of q, taken as constant while the shutter is open.
            time_s: now; from frame to frame it must not go back.

        Returns:
            The frame, its time in the middle of the exposure.
        """
        age_s = self._options.exposure.middle_age_s
        moment = time_s - age_s
        past: Past = cache(lambda age_s: self.posture.moved(qpos, q_rate, -age_s))
        q = self.posture.coordinates(past(age_s))
        labels_m = self.layout.centres_m(q)
        centres_px = self.true.project(labels_m)
        light, classes = self._light(past, self._speed_px(q_rate))
        self._occluders.draw(light, classes, moment, labels_m)
        self._glare.add(light, moment)
        visible = self._visible(labels_m, centres_px, moment)
        truth = FrameTruth(moment, q, centres_px, visible, classes)
        return Frame(pixels=self._noise.read(light, moment), time_s=moment, truth=truth)

    def close(self) -> None:
        """Give back what OpenGL holds."""
        self._renderer.close()

    def _light(self, past: Past, speed: float) -> tuple[Image, Image | None]:
        """What falls on the sensor, and the classes seen, at the middle of the exposure."""
        light = self._background.copy()
        classes = self._background_classes.copy() if self._segmentation else None
        ages = self._ages(0.0, speed)
        oldest = self._options.exposure.rolling_shutter_s + ages[-1]
        ends = [past(age) for age in {ages[0], oldest}]
        region = self._renderer.robot_region(ends, self._options.supersampling)
        window = self._lens.footprint(region)
        if min(window.shape) <= 0:
            return light, classes
        for band, late_s in self._bands(window, speed):
            instants = [past(age) for age in self._ages(late_s, speed)]
            self._draw(instants, band, light, classes)
        return light, classes

    def _draw(
        self, instants: list[FloatArray], window: Region, light: Image, classes: Image | None
    ) -> None:
        """Draw the mean of the robot's instants (nq,) into a window of the sensor, in place."""
        seen = window.within(self._lens.sensor)
        source = self._lens.source(window)
        floor = self._floor[source.within(self._lens.whole)]
        pictures = [self._renderer.robot_on(floor, instant, source) for instant in instants]
        picture = pictures[0]
        if len(pictures) > 1:
            picture = np.rint(np.mean(pictures, axis=0, dtype=np.float32)).astype(np.uint8)
        light[seen] = self._lens.expose(picture, source, window)
        if classes is not None:
            ids = self._renderer.robot_ids(instants[len(instants) // 2], source)
            fine = self._classes[ids]  # −1, beside the robot, finds the last entry: background
            robot = self._lens.nearest(fine, source, window)
            np.copyto(classes[seen], robot, where=robot > 0)

    def _speed_px(self, q_rate: FloatArray) -> float:
        """How many pixels a second no label is faster than."""
        reach = np.abs(self.layout.offset_m).max() + self.layout.reach_m.sum()
        speed = np.hypot(q_rate[0], q_rate[1]) + reach * np.abs(q_rate[2:]).max()
        height = float(self.layout.height_m.max())
        return float(speed / self.true.metres_per_pixel(height))

    def _bands(self, window: Region, speed_px: float) -> list[tuple[Region, float]]:
        """A window in bands of rows, each with how long after its middle the shutter closes.

        The shutter of a band closes with that of its middle row; the last row's closes now.
        """
        exposure, rows = self._options.exposure, window.shape[0]
        per_row = exposure.rolling_shutter_s / max(self._options.height_px - 1, 1)
        travel_px = per_row * rows * speed_px
        count = min(self._count(travel_px), rows)
        edges = [window.top + rows * i // count for i in range(count + 1)]
        last = self._options.height_px - 1
        return [
            (
                Region(window.left, top, window.right, bottom),
                per_row * (last - 0.5 * (top + bottom - 1)),
            )
            for top, bottom in pairwise(edges)
        ]

    def _ages(self, closed_s: float, speed_px: float) -> list[float]:
        """Ages, rising, of the instants to average in rows whose shutter closed so long ago."""
        exposure_s = self._options.exposure.exposure_s
        if not exposure_s:
            return [closed_s]
        count = self._count(exposure_s * speed_px)
        return [closed_s + exposure_s * (i + 0.5) / count for i in range(count)]

    def _count(self, travel_px: float) -> int:
        """How many instants stand for so much motion."""
        step_px = self._options.exposure.blur_step_px
        return max(1, math.ceil(min(travel_px / step_px, MAX_INSTANTS)))

    def _visible(self, labels_m: FloatArray, centres_px: FloatArray, time_s: float) -> FloatArray:
        """(labels,) share of each label's area inside the picture and not hidden."""
        border_px = np.minimum(centres_px, self._size_px - 1.0 - centres_px).min()
        if border_px > self._label_px and not self._occluders.at(time_s):
            return np.ones(self.layout.count)
        points = np.repeat(labels_m[:, None], len(DISC), axis=1)
        points[..., :2] += self.layout.radius_m * DISC
        pixel = self.true.project(points)
        inside = ((pixel >= -0.5) & (pixel < self._size_px - 0.5)).all(axis=-1)
        hidden = self._occluders.hide(points, time_s, labels_m)
        return np.asarray((inside & ~hidden).mean(axis=-1))


def _simplify_for_drawing(model: mujoco.MjModel) -> None:
    """Fewer triangles where nobody sees them."""
    floor = model.geom("floor").id
    if not model.geom_size[floor, :2].any():
        model.geom_size[floor, :2] = FLOOR_HALF_SIZE_M
    quality = model.vis.quality
    quality.numquads, quality.numstacks = 1, 2


def _fade(model: mujoco.MjModel, faded: FadedLabel) -> None:
    """Bleach a label's colour towards the grey of the same brightness."""
    part = f"label_{faded.label}"
    if faded.label not in TRACTOR:
        part = trailer_part(part, faded.trailer - 1)
    material = int(model.geom(part).matid[0])
    colour = model.mat_rgba[material, :3]
    colour += faded.fading * (colour.mean() - colour)


def _classes(model: mujoco.MjModel) -> Image:
    """Class of every geom id, and of −1 in the last entry."""
    trailers = Joints(model).trailers
    towed = [model.body(trailer_part("trailer", i)).id for i in range(trailers)]
    of_body = np.zeros(model.nbody, dtype=np.uint8)
    for body in range(1, model.nbody):  # parents come before their children
        of_body[body] = of_body[model.body_parentid[body]] or TRACTOR_CLASS
        if body in towed:
            of_body[body] = TRAILER_CLASS
    classes = np.append(of_body[model.geom_bodyid], np.uint8(0))
    for i, part in enumerate(label_parts(trailers)):
        hue = i if i < len(NAMES) else 2 + i % 2
        classes[model.geom(part).id] = FIRST_LABEL_CLASS + hue
    return classes
