"""The camera as the loop's sensor: a frame every control period, and the robot's state from it."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from copy import copy
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ttwmr_mj.dynamics.kinematics import wheels_from_twist, workspace_rate
from ttwmr_mj.dynamics.latency import LatencyFinder
from ttwmr_mj.errors import InputError, shown
from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.sensing import Estimate, MeasurementQueue, Sensor
from ttwmr_mj.state import THETA2, FloatArray, RobotState
from ttwmr_mj.vision import threads
from ttwmr_mj.vision.calibration.calibrate import Calibration, calibrate_virtual
from ttwmr_mj.vision.calibration.file import load_calibration
from ttwmr_mj.vision.camera.delivery import DeliveryFaults
from ttwmr_mj.vision.camera.frame import Frame
from ttwmr_mj.vision.camera.labels import label_fault, read_layout
from ttwmr_mj.vision.camera.lens import CAMERA, refuse_folding
from ttwmr_mj.vision.camera.model import CameraModel, hang_camera
from ttwmr_mj.vision.camera.options import CameraOptions
from ttwmr_mj.vision.camera.virtual_camera import VirtualCamera
from ttwmr_mj.vision.log import CameraRecord
from ttwmr_mj.vision.options import CameraSensing
from ttwmr_mj.vision.tracking.estimate import TrackEstimate
from ttwmr_mj.vision.tracking.tracker import Tracker

Frames = list[list[Frame]]  # of each simulation, those of one control period
BELIEVED = "belief.camera"
POSE_STD = (3e-4, 2e-3)  # of a pose from one frame's labels, twice that of the lab's camera


class CameraSensor(Sensor):
    """A `Sensor` that sees frames only.

    Once per control period: `observe`, then `commanded` with what the controller answered.

    Attributes:
        cameras: one per simulation.
        trackers: one per simulation.
        layout: the labels on the robot.
        estimates: the trackers' full answers of this period.
        latency: what is found out of the frames' latency; None where that is not wanted.
    """

    def __init__(
        self,
        section: CameraSensing,
        calibrated: CameraModel,
        believed: RobotParameters,
        model: mujoco.MjModel,
        *,
        period_s: float,
        nsim: int,
        rng: np.random.Generator,
        joint_positions: Callable[[], FloatArray],
        told_latency_s: float | None = None,
        told_command_latency_s: float = 0.0,
        segmentation: bool = False,
    ) -> None:
        """Set up a camera and a tracker per simulation.

        Args:
            section: the camera with its faults, its latency and the tracker's options.
            calibrated: what the loop knows of the camera (`find_calibration`).
            believed: what the trackers take the robot to be.
            model: the scene with the robot that is seen, as of `plants.model.mjcf.build_model`.
            period_s: control period; a frame is taken in each.
            nsim: simulations in the batch.
            rng: source of all noise and faults.
            joint_positions: the plant's, (nsim, nq), so that frames show every joint; of a plant
                without joints, the robot is drawn from q alone.
            told_latency_s: latency that the trackers assume; None: the true one.
            told_command_latency_s: latency of commands that the trackers assume.
            segmentation: whether frames carry the class of every pixel; costs time.

        Raises:
            InputError: the scene lacks a part.
            MachineError: no OpenGL.
        """
        children = rng.spawn(3 * nsim)  # three of each simulation's, whatever the batch
        # OpenGL belongs to one thread; in one of its own, frames are exposed while the physics
        # and the tracker go on, for as long as they are travelling anyway
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="camera")
        make = partial(VirtualCamera, section.camera, model, segmentation=segmentation)
        self.cameras = self._made(make, children[::3])
        self.layout = layout = self.cameras[0].layout
        known = calibrated, layout, believed, section.tracker
        self.trackers = [Tracker(*known) for _ in range(nsim)]
        self.estimates: list[TrackEstimate] = []
        self.latency: LatencyFinder | None = None
        if section.tracker.learn_latency:
            self.latency = LatencyFinder(believed, period_s, nsim, POSE_STD)
        self._made_up_s = np.zeros(nsim)  # latency that stamps are corrected by
        delivery = section.camera.faults.delivery
        self._faults = [DeliveryFaults(delivery, child) for child in children[1::3]]
        self._log: list[CameraRecord] | None = None
        self._frames_every = self._frames = 0  # kept one in, so far
        self._period_s, self._believed = period_s, believed
        channel = section, period_s, children[2::3], told_latency_s
        self._travelling = MeasurementQueue[Future[Frames]](*channel)
        self._arrived = np.full(nsim, -1)  # period in which the last frames were taken
        self._command_latency_s = told_command_latency_s
        self._joint_positions = joint_positions
        self._k = 0

    def _made(
        self, make: Callable[[np.random.Generator], VirtualCamera], rngs: list[np.random.Generator]
    ) -> list[VirtualCamera]:
        """One camera per simulation, made in their thread."""
        # camera and loop keep two cores busy; parting a strip of a picture among more threads
        # costs more time than it saves
        threads.keep_to_one()
        made = [self._worker.submit(make, rng) for rng in rngs]
        try:
            return [camera.result() for camera in made]
        except BaseException:
            threads.give_back()
            raise

    def observe(self, truth: RobotState) -> Estimate:
        """Take this period's frames, track in those that have arrived, and answer for now.

        The estimate describes this instant, latency compensated: its age is zero. How old the
        newest measurement in it is, `estimates` tells.
        """
        now = self._k * self._period_s
        if self._k == 0:
            self._start(truth)
        arrived = self._exchange(self._expose(truth, now), now)
        pairs = zip(self.trackers, arrived, strict=True)
        self.estimates = answers = [tracker.follow(frames, now) for tracker, frames in pairs]
        if self.latency is not None:
            self._learn_latency(arrived)
        if self._log is not None:
            self._log.append(self._record(arrived[0], answers[0], now))

        def column(name: str) -> FloatArray:
            return np.array([getattr(answer, name) for answer in answers], dtype=np.float64)

        return Estimate(
            state=RobotState(q=column("q"), q_rate=column("q_rate")),
            age_s=np.zeros(len(answers)),
            valid=column("valid") > 0.0,
            labels_found=column("labels"),
            measurement_age_s=column("measurement_age_s"),
        )

    def commanded(self, wheel_speed_rad_s: FloatArray) -> None:
        """Tell the trackers the wheel speeds (nsim, 2) that hold from now on for one period."""
        now = self._k * self._period_s
        for tracker, command in zip(self.trackers, wheel_speed_rad_s, strict=True):
            tracker.commands.tell(now + self._command_latency_s, command, self._period_s)
        if self.latency is not None:
            self.latency.commanded(wheel_speed_rad_s)
        self._k += 1

    def keep_log(self, frames_every: int = 1) -> None:
        """From now on, keep what the first simulation's camera saw, for `drain_log`.

        Args:
            frames_every: keep one frame in this many; a frame is 0.9 MB. 0: none.
        """
        self._log, self._frames_every, self._frames = [], frames_every, 0

    def _record(self, arrived: list[Frame], answer: TrackEstimate, now: float) -> CameraRecord:
        """What the log says of the first simulation's camera in this period."""
        sighting = self.trackers[0].sighting
        if not arrived:
            return CameraRecord(now, None, None, sighting, answer)
        frame, every = arrived[-1], self._frames_every
        kept = every and self._frames % every == 0
        self._frames += 1
        return CameraRecord(now, frame if kept else None, frame.truth, sighting, answer)

    def drain_log(self) -> list[CameraRecord]:
        """The records since the last call, oldest first."""
        records, self._log = self._log or [], []
        return records

    def close(self) -> None:
        """Give back what OpenGL holds, and OpenCV's threads."""
        for camera in self.cameras:
            self._worker.submit(camera.close)
        self._worker.shutdown()
        threads.give_back()

    def _start(self, truth: RobotState) -> None:
        """Who puts the robot down knows roughly where, and how fast its wheels turn."""
        twist = workspace_rate(truth.q, truth.q_rate)[:, :2]
        speeds = wheels_from_twist(twist, self._believed)
        for tracker, wheels in zip(self.trackers, speeds, strict=True):
            tracker.commands.roll(wheels)
        if self.latency is not None:
            self.latency.roll(speeds)
        for i, tracker in enumerate(self.trackers):
            tracker.assume(0.0, truth.q[i], truth.q_rate[i, THETA2:])

    def _expose(self, truth: RobotState, now: float) -> Future[Frames]:
        """Let the cameras' thread take this period's frames of each simulation."""
        postures = self._joint_positions()
        if not postures.size:
            postures = self.cameras[0].posture.positions(truth.q)
        return self._worker.submit(self._deliver, postures, truth.q_rate, now)

    def _deliver(self, postures: FloatArray, q_rate: FloatArray, now: float) -> Frames:
        """The frames that leave each camera in this period; runs in the cameras' thread."""
        shots = zip(self.cameras, self._faults, postures, q_rate, strict=True)
        return [
            faults.deliver(now, partial(camera.take, qpos, rate, now))
            for camera, faults, qpos, rate in shots
        ]

    def _exchange(self, leaving: Future[Frames], now: float) -> Frames:
        """Put in what leaves the cameras, take out what arrives, with the stamps it is given."""
        arrived = self._travelling.exchange(leaving)
        late = self._travelling.stamp_error_s(arrived)
        frames: Frames = [[] for _ in self.cameras]
        for i in np.flatnonzero(arrived.sent > self._arrived).tolist():
            due = self._travelling.item(int(arrived.sent[i])).result()
            error = float(late[i] - self._made_up_s[i])
            frames[i] = [_stamped(frame, error, now) for frame in due[i]]
        self._arrived = arrived.sent
        return frames

    def _learn_latency(self, arrived: Frames) -> None:
        """Compare the poses of new frames with what was commanded before their stamps."""
        assert self.latency is not None
        stamp_s, poses = np.zeros(len(arrived)), np.zeros((len(arrived), 3 + self.layout.trailers))
        due = np.zeros(len(arrived), dtype=np.bool_)
        for i, (tracker, frames) in enumerate(zip(self.trackers, arrived, strict=True)):
            pose = tracker.sighted_pose() if frames else None
            if pose is not None:
                due[i], poses[i] = True, pose.q
                stamp_s[i] = frames[-1].time_s + self._made_up_s[i] - self._command_latency_s
        self.latency.measured(stamp_s, poses, due)
        # no faster than a period at a time, or stamps would run backward
        change = self.latency.extra_s - self._made_up_s
        self._made_up_s += np.clip(change, -self._period_s, self._period_s)


def _stamped(frame: Frame, late_s: float, now: float) -> Frame:
    """A frame whose stamp is late; a stamp of the future is taken for now."""
    return replace(frame, time_s=min(frame.time_s + late_s, now)) if late_s else frame


def find_calibration(
    section: CameraSensing, believed: CameraOptions, rng: np.random.Generator, folder: Path
) -> Calibration:
    """The named calibration file, or else a calibration of the simulated camera, made now.

    Args:
        section: the camera.
        believed: the camera as it was then.
        rng: source of the noise in a calibration's pictures.
        folder: where the file is looked for.

    Raises:
        InputError: the file cannot be used, or is for another resolution.
        MachineError: no OpenGL.
    """
    if section.calibration_path is None:
        key = CAMERA if believed == section.camera else BELIEVED
        return calibrate_virtual(believed, rng, key)
    return named_calibration(section, folder)


def named_calibration(section: CameraSensing, folder: Path) -> Calibration:
    """What the named file holds.

    Raises:
        InputError: it cannot be used, or is for another resolution.
    """
    assert section.calibration_path is not None, "asked of a scenario that names one"
    calibration, seen = load_calibration(folder / section.calibration_path), section.camera
    size_px = calibration.camera.width_px, calibration.camera.height_px
    if size_px != (seen.width_px, seen.height_px):
        raise InputError.at(
            "sensing.calibration_path",
            f"calibrated at {size_px[0]}×{size_px[1]} px, but sensing.camera.width_px and "
            f"height_px make {seen.width_px}×{seen.height_px} px",
            got=shown(section.calibration_path),
            hint="calibrate at the resolution that is used, or leave the key out",
        )
    return calibration


def refuse_unusable(
    section: CameraSensing, believed: CameraOptions, model: mujoco.MjModel, folder: Path
) -> None:
    """Look at a camera and what is believed of it, without taking pictures.

    Raises:
        InputError: a run with it is refused.
    """
    layout, hung = read_layout(model), {CAMERA: section.camera}
    known: dict[str, CameraModel] = {}
    if section.calibration_path is not None:
        known["sensing.calibration_path"] = named_calibration(section, folder).camera
    elif believed != section.camera:
        hung[BELIEVED] = believed
    for key, options in hung.items():
        known[key] = hang_camera(copy(model), options)
        refuse_folding(known[key], key)
    for key, camera in known.items():
        if fault := label_fault(camera, layout):
            raise InputError(fault.within(*key.split(".")))
