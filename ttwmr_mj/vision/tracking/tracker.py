"""Follows the robot from frame to frame: an extended Kalman filter on labels and wheel commands.

Each frame is worked in at its own time, however late it comes, and the result carried forward to
now over the commands given since. Both halves share P in the measurement model, so the hitch
constraint holds by construction.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ttwmr_mj.dynamics.kinematics import q_rate
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import BoolArray, FloatArray, unwrap_near
from ttwmr_mj.vision.camera.labels import COUNT, LabelLayout
from ttwmr_mj.vision.camera.model import CameraModel
from ttwmr_mj.vision.camera.renderer import Image
from ttwmr_mj.vision.options import TrackerOptions
from ttwmr_mj.vision.tracking import constellation
from ttwmr_mj.vision.tracking.commands import CommandHistory
from ttwmr_mj.vision.tracking.detection import Detector
from ttwmr_mj.vision.tracking.kalman import Innovation, update
from ttwmr_mj.vision.tracking.motion import DELTA1, SIZE, THETA2_RATE, Belief, MotionModel

MIN_SEARCH_PX = 3.0
MAX_SEARCH_PX = 32.0  # a wider region costs more than the whole frame shrunk
SEARCH_SIGMAS = 4.0
FROZEN_PX = 1e-3  # noise moves a label's centre more than that from frame to frame
MOVING_PX = 0.3  # so far a label must have gone for a picture without motion to be a frozen one
MAX_MISFITS = 5  # frames in a row that show labels, but not where they are expected
FIRST_SWING_STD_RAD_S = 2.0
LONGEST_GAP_S = 1.0  # no frame comes later than that; older beliefs are carried along
# of x, y, θ1, θ2: put down by hand, and taken from labels before the update with the same labels
PUT_DOWN_STD = np.array([0.05, 0.05, 0.2, 0.2])
SIGHTED_STD = np.array([0.02, 0.02, 0.2, 0.2])


class Status(StrEnum):
    """What the tracker knows."""

    TRACKED = "tracked"  # the last frame showed labels where they belong
    BLIND = "blind"  # it did not, and the prediction stands in, for a short while
    LOST = "lost"  # nothing is known; the whole of every frame is searched


@dataclass(frozen=True, slots=True)
class Sighting:
    """What came of one frame.

    Attributes:
        time_s: of the frame.
        found_px: (4, 2) centres that were used, NaN where none.
        predicted_px: (4, 2) where they were looked for; NaN in a whole-frame search.
        search_px: half the side of the search regions; NaN in a whole-frame search.
        nis: normalised innovation squared of the labels used; NaN where the filter was not updated.
    """

    time_s: float
    found_px: FloatArray
    predicted_px: FloatArray
    search_px: float
    nis: float

    @property
    def labels(self) -> int:
        """How many labels were used."""
        return int(np.isfinite(self.found_px[:, 0]).sum())


@dataclass(frozen=True, slots=True)
class TrackEstimate:
    """The tracker's answer for one instant.

    Attributes:
        time_s: the instant.
        q: (4,) x, y, θ1, θ2, angles unwrapped.
        q_rate: (4,) their rates.
        covariance: (4, 4) of q.
        valid: False while lost, or too uncertain.
        status: tracked, blind or lost.
        measurement_age_s: since the last frame with labels; infinite before the first.
        labels: used in the newest frame; 0 when none has come.
    """

    time_s: float
    q: FloatArray
    q_rate: FloatArray
    covariance: FloatArray
    valid: bool
    status: Status
    measurement_age_s: float
    labels: int


class Tracker:
    """One robot, one calibrated camera.

    Attributes:
        commands: what the wheels were told; the caller adds to it.
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
        robot: RobotParameters,
        options: TrackerOptions,
    ) -> None:
        self.commands = CommandHistory(robot)
        self.sighting: Sighting | None = None
        self.status = Status.LOST
        self.camera = camera
        self.layout = layout
        self._options = options
        self._motion = MotionModel(robot, options)
        scale = camera.metres_per_pixel(float(layout.height_m.mean()))
        self._scale_m_px = scale
        self._noise_m2 = (options.label_noise_px * scale) ** 2 + options.calibration_noise_m**2
        self.detector = Detector(layout, layout.radius_m / scale)
        self._belief: Belief | None = None
        self._seen_s = -np.inf
        self._seen_px = np.full((COUNT, 2), np.nan)
        self._misfits = 0

    def assume(self, time_s: float, q: FloatArray, theta2_rate_rad_s: float = 0.0) -> None:
        """Say where the robot was put down, roughly; it counts as lost until it is seen.

        Args:
            time_s: when.
            q: (4,) the pose.
            theta2_rate_rad_s: how fast the trailer turned, of a start in motion.
        """
        mean = np.zeros(SIZE)
        mean[:4] = q
        mean[THETA2_RATE] = theta2_rate_rad_s
        spread = self._first_spread(PUT_DOWN_STD)
        self._belief = Belief(time_s, mean, np.diag(spread**2))

    def see(self, image: Image, time_s: float) -> Sighting:
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
        self.sighting = sighting or _nothing(time_s)
        return self.sighting

    def miss(self, time_s: float) -> None:
        """Say that no frame came until a time."""
        self.sighting = None
        self._expire(time_s)
        if self._belief is not None and time_s - self._belief.time_s > LONGEST_GAP_S:
            self._belief = self._at(time_s - LONGEST_GAP_S)

    def estimate(self, time_s: float) -> TrackEstimate:
        """The state at a time, normally now: the last belief carried over the commands since."""
        if self._belief is None:
            unknown = np.full(4, np.nan)
            return TrackEstimate(
                time_s, unknown, unknown, np.diag(unknown), False, Status.LOST, np.inf, 0
            )
        belief = self._at(time_s)
        covariance = belief.covariance[:4, :4]
        spread = np.sqrt(covariance.diagonal())
        sure = (
            max(spread[0], spread[1]) <= self._options.max_position_std_m
            and max(spread[2], spread[3]) <= self._options.max_angle_std_rad
        )
        twist = belief.mean[DELTA1:THETA2_RATE] + self.commands.twist(time_s)
        workspace_rate = np.append(twist, belief.mean[THETA2_RATE])
        return TrackEstimate(
            time_s=time_s,
            q=belief.mean[:4].copy(),
            q_rate=q_rate(belief.mean[:4], workspace_rate),
            covariance=covariance,
            valid=bool(sure) and self.status is not Status.LOST,
            status=self.status,
            measurement_age_s=time_s - self._seen_s,
            labels=0 if self.sighting is None else self.sighting.labels,
        )

    def _at(self, time_s: float) -> Belief:
        """The belief carried to a time, without keeping it."""
        if self._belief is None:
            raise AssertionError("there is nothing to carry before the first sighting")
        stretches = self.commands.stretches(self._belief.time_s, time_s)
        return self._motion.predict(self._belief, time_s, stretches)

    def _follow(self, image: Image, time_s: float) -> Sighting | None:
        """Look where the labels should be, and update; None where regions would be too wide."""
        prior = self._at(time_s)
        expected = self.camera.project(self.layout.centres_m(prior.mean[:4]))
        search = self._search_px(prior)
        if search > MAX_SEARCH_PX:
            self.status = Status.LOST
            return None
        centres, found = self.detector.track(image, expected, search)
        self._belief = prior
        if not found.any() or self._is_frozen(centres, found, expected):
            self._expire(time_s)
            return Sighting(time_s, np.full((COUNT, 2), np.nan), expected, search, np.nan)
        used, nis = self._update(prior, centres, found)
        self._misfits = 0 if used.sum() * 2 > found.sum() else self._misfits + 1
        centres[~used] = np.nan
        if used.any():
            self._remember(time_s, centres)
        self._expire(time_s)
        if self._misfits >= MAX_MISFITS:
            self.status, self._misfits = Status.LOST, 0
        return Sighting(time_s, centres, expected, search, nis)

    def _update(self, prior: Belief, centres: FloatArray, found: BoolArray) -> Innovation:
        """Kalman's update of the belief with the labels that pass the gate."""
        points = self.camera.to_plane(np.where(found[:, None], centres, 0.0), self.layout.height_m)
        self._belief, innovation = update(
            prior, points, found, self.layout, self._noise_m2, self._options.gate_chi2
        )
        return innovation

    def _acquire(self, image: Image, time_s: float) -> Sighting | None:
        """Look everywhere, and start afresh from what looks like the robot."""
        candidates = self.detector.search(image)
        points = self.camera.to_plane(candidates.centre_px, self.layout.height_m[candidates.label])
        got = constellation.choose(candidates, points, self.layout)
        if got is None:
            return None
        pose, index = got
        mean = np.zeros(SIZE)
        mean[:4] = pose.q
        spread = self._first_spread(SIGHTED_STD)
        if self._belief is not None:
            last = self._at(time_s).mean
            mean[2:4] = unwrap_near(mean[2:4], last[2:4])
            mean[THETA2_RATE] = last[THETA2_RATE]
        prior = Belief(time_s, mean, np.diag(spread**2))
        centres = np.full((COUNT, 2), np.nan)
        centres[index >= 0] = candidates.centre_px[index[index >= 0]]
        self._update(prior, centres, index >= 0)
        self._remember(time_s, centres)
        blank = np.full((COUNT, 2), np.nan)
        return Sighting(time_s, centres, blank, np.nan, np.nan)

    def _first_spread(self, pose: FloatArray) -> FloatArray:
        """(7,) standard deviations of a state of which only the pose (4,) was told."""
        return np.concatenate([pose, self._motion.deviation, [FIRST_SWING_STD_RAD_S]])

    def _remember(self, time_s: float, centres: FloatArray) -> None:
        self.status = Status.TRACKED
        self._seen_s, self._seen_px = time_s, centres

    def _expire(self, time_s: float) -> None:
        """Turn blind, then lost, when nothing was seen for long."""
        if self.status is Status.LOST or time_s <= self._seen_s:
            return
        blind_s = time_s - self._seen_s
        self.status = Status.LOST if blind_s > self._options.max_blind_s else Status.BLIND

    def _search_px(self, prior: Belief) -> float:
        """How far from its predicted place a label may be."""
        variance = prior.covariance.diagonal()
        reach2 = (self.layout.offset_m**2).sum(axis=1).max()
        spread = np.sqrt(variance[0] + variance[1] + reach2 * max(variance[2], variance[3]))
        return MIN_SEARCH_PX + SEARCH_SIGMAS * float(spread) / self._scale_m_px

    def _is_frozen(self, centres: FloatArray, found: BoolArray, expected: FloatArray) -> bool:
        """Whether all labels are where they were in the last frame, though they must have moved."""
        both = found & np.isfinite(self._seen_px[:, 0])
        if not both.any():
            return False
        still = np.abs(centres[both] - self._seen_px[both]).max() < FROZEN_PX
        return bool(still and np.abs(expected[both] - self._seen_px[both]).max() > MOVING_PX)


def _nothing(time_s: float) -> Sighting:
    blank = np.full((COUNT, 2), np.nan)
    return Sighting(time_s, blank, blank, np.nan, np.nan)
