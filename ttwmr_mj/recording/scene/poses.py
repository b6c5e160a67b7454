"""Where every body of the model is at the rows of a trajectory, by forward kinematics."""

import numpy as np

from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.joints import Joints
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.state import FloatArray


class BodyPoses:
    """Poses of the model's bodies over a run that arrives in chunks.

    Rows of the contact plant carry MuJoCo's positions. Rows of the analytic plant have none: there
    the robot stands on its wheels at q, each wheel turned by the integral of its speed since the
    first row (trapezoids).
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._data = mujoco.MjData(model)
        self._joints = Joints(model)
        self._wheel_angle: FloatArray = np.zeros(2)
        self._last: tuple[FloatArray, FloatArray] | None = None

    def at(self, rows: Trajectory) -> tuple[FloatArray, FloatArray]:
        """Poses at the next rows of the run, of one simulation.

        Returns:
            (n, nbody, 3) origins [m] and (n, nbody, 4) quaternions (w, x, y, z), world frame.
        """
        qpos = rows.joint_positions[:, 0]
        return self._kinematics(qpos if qpos.shape[1] else self._rolling(rows))

    def standing_at(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Poses of a robot that stands level at q (n, 3 + trailers); shapes as of `at`."""
        return self._kinematics(self._joints.standing(np.array(self._model.qpos0), q))

    def _kinematics(self, qpos: FloatArray) -> tuple[FloatArray, FloatArray]:
        model, data = self._model, self._data
        position = np.empty((len(qpos), model.nbody, 3))
        quaternion = np.empty((len(qpos), model.nbody, 4))
        # faster than mujoco.batch: one MjData stays in the cache
        for k in range(len(qpos)):
            data.qpos[:] = qpos[k]
            mujoco.mj_kinematics(model, data)
            position[k], quaternion[k] = data.xpos, data.xquat
        return position, quaternion

    def _rolling(self, rows: Trajectory) -> FloatArray:
        """(n, nq) generalized positions of a robot that stands level on its wheels, as in qpos0."""
        qpos = self._joints.standing(np.array(self._model.qpos0), rows.q[:, 0])
        qpos[:, self._joints.wheel_qpos] = self._roll(rows.time_s, rows.wheel_speed_rad_s[:, 0])
        return qpos

    def _roll(self, time_s: FloatArray, speed_rad_s: FloatArray) -> FloatArray:
        """(n, 2) wheel angles (right, left) [rad], zero at the run's first row."""
        before_s, before_rad_s = self._last or (time_s[0], speed_rad_s[0])
        self._last = time_s[-1], speed_rad_s[-1]
        steps = np.diff(time_s, prepend=before_s)[:, None]
        speeds = np.vstack([before_rad_s, speed_rad_s])
        turned = 0.5 * (speeds[1:] + speeds[:-1]) * steps
        # the angle so far leads the sum, so that chunks add up to the same bits as one piece
        angle = np.cumsum(np.vstack([self._wheel_angle, turned]), axis=0)[1:]
        self._wheel_angle = angle[-1]
        return np.asarray(angle)
