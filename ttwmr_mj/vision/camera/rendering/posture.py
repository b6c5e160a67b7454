"""The robot's posture in the camera's own model: q or joints, and where they were a moment ago."""

import numpy as np

from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.joints import Joints
from ttwmr_mj.state import FloatArray


class Posture:
    """Moves between q and generalized positions of one robot; wheels and balls are left alone."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """The model's own pose, `qpos0`, gives height, tilt and wheels."""
        self._model = model
        self._joints = Joints(model)
        self._home = np.array(model.qpos0)

    def positions(self, q: FloatArray) -> FloatArray:
        """(..., nq) generalized positions at q (..., 3 + n), standing as in `qpos0`."""
        qpos = self._joints.standing(self._home, np.atleast_2d(q))
        return np.reshape(qpos, (*q.shape[:-1], -1))

    def coordinates(self, qpos: FloatArray) -> FloatArray:
        """(3 + n,) q at generalized positions (nq,); θ1 in [−2π, 2π]."""
        return self._joints.planar(qpos, np.zeros(self._model.nv))[0]

    def moved(self, qpos: FloatArray, q_rate: FloatArray, duration_s: float) -> FloatArray:
        """(nq,) positions after constant rates (3 + n,) for a time, which may be negative."""
        qvel = self._joints.moving(q_rate[None], np.zeros((1, 2)), self._model.nv)[0]
        moved = np.array(qpos, dtype=np.float64)
        mujoco.mj_integratePos(self._model, moved, qvel, duration_s)
        return moved
