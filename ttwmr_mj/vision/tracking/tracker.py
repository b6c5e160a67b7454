"""Follows the robot from frame to frame: an extended Kalman filter on labels and wheel commands.

Each frame is worked in at its own time, however late it comes, and the result carried forward to
now over the commands given since. The bodies share their hitches in the measurement model, which
hold by construction.
"""

from collections.abc import Iterable

import numpy as np

from ttwmr_mj.dynamics.kinematics import q_rate
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import BoolArray, FloatArray, unwrap_near
from ttwmr_mj.vision.camera.frame import Frame, Pixels
from ttwmr_mj.vision.camera.labels import LabelLayout
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.tracking import constellation
from ttwmr_mj.vision.tracking.commands import CommandHistory
from ttwmr_mj.vision.tracking.detection import Detector
from ttwmr_mj.vision.tracking.estimate import Sighting, Status, TrackEstimate, no_labels
from ttwmr_mj.vision.tracking.kalman import update, update_pose
from ttwmr_mj.vision.tracking.motion import Gaussian, MotionModel
from ttwmr_mj.vision.tracking.options import TrackerOptions
from ttwmr_mj.vision.tracking.pose import LabelPose, solve_pose

MIN_SEARCH_PX = 3.0  # a quarter of a label, for what calibration and model leave over
MAX_SEARCH_PX = 32.0  # a wider region costs more than the whole frame shrunk
SEARCH_SIGMAS = 4.0  # one prediction in 16 000 is farther off
FROZEN_PX = 1e-3  # noise moves a label's centre more than that from frame to frame
MOVING_PX = 0.3  # so far a label must have gone for a picture without motion to be a frozen one
MAX_MISFITS = 5  # frames in a row that show labels, but not where they are expected
FIRST_RATE_STD_RAD_S = 2.0  # of a trailer seen for the first time: anything it may do
LONGEST_GAP_S = 1.0  # no frame comes later than that; an older state is carried along
# of x and y, and of an angle: put down by hand, and taken from labels before the update with them
PUT_DOWN_STD = (0.05, 0.2)
SIGHTED_STD = (0.02, 0.2)


class Tracker:
    """One robot, one calibrated camera.

    Attributes:
        commands: the commanded wheel speeds; the caller adds to it.
        detector: finds the labels.
        sighting: what came of the last frame; None before the first.
        status: what is known after the last frame.
        camera: the calibrated camera.
        layout: the labels on the robot.
    """

    def __init__(
        self,
        camera: CameraModel,
        layout: LabelLayout,
        believed: RobotParameters,
        options: TrackerOptions,
    ) -> None:
        """Nothing is seen yet; `believed` is the robot that the motion model takes."""
        self.commands = CommandHistory(believed)
        self.sighting: Sighting | None = None
        self.status = Status.LOST
        self.camera = camera
        self.layout = layout
        self._options = options
        self._trailers = layout.trailers
        self._width = 3 + layout.trailers
        self._largest_std = self._of_q(options.max_position_std_m, options.max_angle_std_rad)
        self._motion = MotionModel(believed, options)
        scale = camera.metres_per_pixel(float(layout.height_m.mean()))
        self._scale_m_px = scale
        self._noise_m2 = (options.label_noise_px * scale) ** 2 + options.calibration_noise_m**2
        self.detector = Detector(layout, layout.radius_m / scale)
        self._filtered: Gaussian | None = None
        self._seen_s = -np.inf
        self._seen_px = no_labels(layout.count)
        self._told: Gaussian | None = None  # where commands alone led since that was a new picture
        self._misfits = 0

    def assume(
        self, time_s: float, q: FloatArray, trailer_rate_rad_s: FloatArray | float = 0.0
    ) -> None:
        """Say where the robot was put down, roughly; it counts as lost until it is seen.

        Args:
            time_s: when.
            q: (3 + n,) the pose.
            trailer_rate_rad_s: (n,) how fast the trailers turned, of a start in motion.
        """
        self._filtered = self._first(time_s, q, trailer_rate_rad_s, PUT_DOWN_STD)

    def follow(self, frames: Iterable[Frame], now_s: float) -> TrackEstimate:
        """Work in the frames that have arrived by now, perhaps none, and answer for now."""
        self.sighting = None
        for frame in frames:
            self.see(frame.pixels, frame.time_s)
        if self.sighting is None:
            self.miss(now_s)
        return self.estimate(now_s)

    def see(self, image: Pixels, time_s: float) -> Sighting:
        """Work in a frame.

        Args:
            image: (rows, columns, 3) BGR.
            time_s: when it was exposed; frames must come in order, but may come late.
        """
        sighting = None
        if self.status is not Status.LOST:
            sighting = self._follow(image, time_s)
        if self.status is Status.LOST:
            sighting = self._acquire(image, time_s) or sighting
        self._carry_along(time_s)
        self.sighting = sighting or Sighting.of_none(self.layout.count)
        return self.sighting

    def miss(self, time_s: float) -> None:
        """Say that no frame came until a time."""
        self.sighting = None
        self._expire(time_s)
        self._carry_along(time_s)

    def estimate(self, time_s: float) -> TrackEstimate:
        """The state at a time, normally now: the filtered one carried over the commands since."""
        if self._filtered is None:
            unknown = np.full(self._width, np.nan)
            return TrackEstimate(unknown, unknown, np.diag(unknown), False, Status.LOST, np.inf, 0)
        now = self._at(time_s)
        width = self._width
        covariance = now.covariance[:width, :width]
        sure = (np.sqrt(covariance.diagonal()) <= self._largest_std).all()
        twist = now.mean[width : width + 2] + self.commands.twist(time_s)
        workspace_rate = np.concatenate([twist, now.mean[width + 2 :]])
        return TrackEstimate(
            q=now.mean[:width].copy(),
            q_rate=q_rate(now.mean[:width], workspace_rate),
            covariance=covariance,
            valid=bool(sure) and self.status is not Status.LOST,
            status=self.status,
            measurement_age_s=time_s - self._seen_s,
            labels=0 if self.sighting is None else self.sighting.labels,
        )

    def sighted_pose(self) -> LabelPose | None:
        """The pose from the labels of the last frame alone; None if it showed too few."""
        if self.sighting is None:
            return None
        pixels = self.sighting.found_px
        found = np.isfinite(pixels[:, :1])
        points = self.camera.to_plane(np.where(found, pixels, 0.0), self.layout.height_m)
        return solve_pose(np.where(found, points, np.nan), self.layout)

    def _at(self, time_s: float) -> Gaussian:
        """The filtered state carried to a time, without keeping it."""
        if self._filtered is None:
            raise AssertionError("there is no state to predict from before the first sighting")
        return self._carried(self._filtered, time_s)

    def _carried(self, state: Gaussian, time_s: float) -> Gaussian:
        """A state carried to a time over the commands."""
        ramps = self.commands.ramps(state.time_s, time_s)
        return self._motion.predict(state, time_s, ramps)

    def _carry_along(self, time_s: float) -> None:
        """Keep the filtered state within the time of which commands are remembered."""
        if self._filtered is not None and time_s - self._filtered.time_s > LONGEST_GAP_S:
            self._filtered = self._at(time_s - LONGEST_GAP_S)

    def _follow(self, image: Pixels, time_s: float) -> Sighting | None:
        """Look where the labels should be, and update; None where regions would be too wide."""
        prior = self._at(time_s)
        expected = self.camera.project(self.layout.centres_m(prior.mean[: self._width]))
        search = self._search_px(prior)
        if search > MAX_SEARCH_PX:
            self.status = Status.LOST
            return None
        centres, found = self.detector.track(image, expected, search)
        self._filtered = prior
        still = self._is_still(centres)
        if not found.any() or (still and self._must_have_moved(centres, expected, time_s)):
            self._expire(time_s)
            return Sighting(no_labels(self.layout.count), expected, search)
        self._filtered, used = self._updated(prior, centres, found)
        self._misfits = 0 if used.sum() * 2 > found.sum() else self._misfits + 1
        centres[~used] = np.nan
        if used.any():
            self._believe(centres, time_s, still=still)
        self._expire(time_s)
        if self._misfits >= MAX_MISFITS:
            self.status, self._misfits = Status.LOST, 0
        return Sighting(centres, expected, search)

    def _updated(
        self, prior: Gaussian, centres: FloatArray, found: BoolArray
    ) -> tuple[Gaussian, BoolArray]:
        """Kalman's update with the labels that pass the gate (labels,)."""
        points = self.camera.to_plane(np.where(found[:, None], centres, 0.0), self.layout.height_m)
        noise_m2, gate = self._noise_m2, self._options.gate_chi2
        return update(prior, points, found, self.layout, noise_m2, gate)

    def _acquire(self, image: Pixels, time_s: float) -> Sighting | None:
        """Look everywhere; go on from what looks like the robot, afresh where it jumped."""
        candidates = self.detector.search(image)
        points = self.camera.to_plane(candidates.centre_px, self.layout.height_m[candidates.hue])
        got = constellation.choose(candidates, points, self.layout)
        if got is None:
            return None
        pose, index = got
        centres = no_labels(self.layout.count)
        centres[index >= 0] = candidates.centre_px[index[index >= 0]]
        still = self._is_still(centres)
        # what it was thought to do does not count here: it is lost
        if still and self._must_have_moved(centres, centres, time_s):
            return None
        q, rate = pose.q, np.zeros(self._trailers)
        last = None if self._filtered is None else self._at(time_s)
        if last is not None:
            q[2:] = unwrap_near(q[2:], last.mean[2 : self._width])
            rate = last.mean[self._width + 2 :]
        fresh = self._first(time_s, q, rate, SIGHTED_STD)
        self._filtered, _ = self._updated(fresh, centres, index >= 0)
        if last is not None:
            self._filtered = update_pose(last, self._filtered, self._width) or self._filtered
        self._believe(centres, time_s, still=still)
        return Sighting(centres, no_labels(self.layout.count))

    def _believe(self, centres: FloatArray, time_s: float, *, still: bool) -> None:
        """Take note of the labels that the filtered state now knows."""
        self._seen_s, self._seen_px, self.status = time_s, centres, Status.TRACKED
        if not still and self._filtered is not None:
            mean = self._filtered.mean.copy()
            mean[self._width :] = 0.0
            self._told = Gaussian(time_s, mean, np.zeros((mean.size, mean.size)))

    def _first(
        self,
        time_s: float,
        q: FloatArray,
        trailer_rate_rad_s: FloatArray | float,
        pose_std: tuple[float, float],
    ) -> Gaussian:
        """A state of which only the pose is known, and how well."""
        rate = np.full(self._trailers, trailer_rate_rad_s)
        mean = np.concatenate([q, [0.0, 0.0], rate])
        swing = np.full(self._trailers, FIRST_RATE_STD_RAD_S)
        std = np.concatenate([self._of_q(*pose_std), self._motion.deviation, swing])
        return Gaussian(time_s, mean, np.diag(std**2))

    def _of_q(self, position_m: float, angle_rad: float) -> FloatArray:
        """(3 + n,) one number for x and y, one for all angles."""
        return np.array([position_m] * 2 + [angle_rad] * (1 + self._trailers))

    def _expire(self, time_s: float) -> None:
        """Turn blind, then lost, when nothing was seen for long."""
        if self.status is Status.LOST or time_s <= self._seen_s:
            return
        blind_s = time_s - self._seen_s
        self.status = Status.LOST if blind_s > self._options.max_blind_s else Status.BLIND

    def _search_px(self, prior: Gaussian) -> float:
        """How far from its predicted place a label may be."""
        variance = prior.covariance.diagonal()
        reach2 = self.layout.furthest_m2.max()
        angles = variance[2 : self._width].max()
        spread = np.sqrt(variance[0] + variance[1] + reach2 * angles)
        return MIN_SEARCH_PX + SEARCH_SIGMAS * float(spread) / self._scale_m_px

    def _is_still(self, centres: FloatArray) -> bool:
        """Whether labels are where they were in the last picture that was believed.

        The picture is the same, for noise would have moved them: it is frozen, or the robot rests
        and the camera has no noise.
        """
        moved = np.abs(centres - self._seen_px).max(axis=1)
        return bool(np.nanmax(moved, initial=0.0) < FROZEN_PX and np.isfinite(moved).any())

    def _must_have_moved(self, centres: FloatArray, expected: FloatArray, time_s: float) -> bool:
        """Whether labels cannot still be there: they are expected elsewhere, or were sent there."""
        assert self._told is not None
        self._told = self._carried(self._told, time_s)
        sent = self.camera.project(self.layout.centres_m(self._told.mean[: self._width]))
        away = np.abs(np.stack([expected, sent]) - self._seen_px)[:, np.isfinite(centres[:, 0])]
        return bool(np.nanmax(away, initial=0.0) > MOVING_PX)
