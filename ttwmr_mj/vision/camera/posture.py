"""Where the joints of the MuJoCo robot are when the article's coordinates say q."""

from __future__ import annotations

import mujoco
import numpy as np

from ttwmr_mj.state import THETA1, THETA2, FloatArray, X, Y


class Posture:
    """Puts the four coordinates of Eq. 2 into a model's generalized positions and velocities."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Resolve the joints; keyframe 0 gives height, tilt and wheels."""
        self._model = model
        self._home = np.array(model.key_qpos[0])
        self._free = int(model.joint("tractor").qposadr[0])
        self._free_speed = int(model.joint("tractor").dofadr[0])
        self._hitch = int(model.joint("hitch").qposadr[0])
        self._hitch_speed = int(model.joint("hitch").dofadr[0])

    def positions(self, q: FloatArray) -> FloatArray:
        """(nq,) generalized positions at q (4,), standing as in keyframe 0."""
        qpos = self._home.copy()
        free = self._free
        qpos[free : free + 2] = q[X], q[Y]
        qpos[free + 3 : free + 7] = np.cos(0.5 * q[THETA1]), 0.0, 0.0, np.sin(0.5 * q[THETA1])
        qpos[self._hitch] = q[THETA2] - q[THETA1]
        return qpos

    def coordinates(self, qpos: FloatArray) -> FloatArray:
        """(4,) q at generalized positions (nq,); θ1 in [−2π, 2π]."""
        free = self._free
        theta1 = 2.0 * np.arctan2(qpos[free + 6], qpos[free + 3])
        return np.array([qpos[free], qpos[free + 1], theta1, theta1 + qpos[self._hitch]])

    def moved(self, qpos: FloatArray, q_rate: FloatArray, duration_s: float) -> FloatArray:
        """(nq,) positions after moving at constant rates (4,) for a time, which may be negative.

        Wheels and balls stay as they are.
        """
        qvel = np.zeros(self._model.nv)
        qvel[self._free_speed : self._free_speed + 2] = q_rate[X], q_rate[Y]
        qvel[self._free_speed + 5] = q_rate[THETA1]
        qvel[self._hitch_speed] = q_rate[THETA2] - q_rate[THETA1]
        moved = np.array(qpos, dtype=np.float64)
        mujoco.mj_integratePos(self._model, moved, qvel, duration_s)
        return moved
