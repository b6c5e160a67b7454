"""Where the robot's coordinates are among MuJoCo's: q ↔ qpos, rates ↔ qvel.

The tractor is a free body whose frame sits at P, trailers hang on hinges whose coordinate is
θ(i+1) − θi. The order within qpos and qvel is the model's own affair, so every place is looked up.
"""

import numpy as np

from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.names import WHEELS, casters, hitches
from ttwmr_mj.state import THETA1, THETA2, FloatArray

YAW_RATE = 5  # of a free joint's six velocities
HEIGHT, W, X, Y, Z = 2, 3, 4, 5, 6  # of a free joint's seven positions: height, quaternion


class Joints:
    """Places in qpos and qvel of one model.

    Attributes:
        trailers: how many there are.
        free_qpos, free_qvel: where the tractor's seven positions and six velocities start.
        wheel_qpos, wheel_qvel: of the wheels (right, left).
        ball_qvel: where the three velocities of each caster's ball start.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        def places(names: tuple[str, ...]) -> tuple[list[int], list[int]]:
            joints = [model.joint(name) for name in names]
            return [int(j.qposadr[0]) for j in joints], [int(j.dofadr[0]) for j in joints]

        (self.free_qpos,), (self.free_qvel,) = places(("tractor",))
        named = {model.joint(i).name for i in range(model.njnt)}
        self.trailers = next(n for n in range(1, model.njnt) if hitches(n + 1)[-1] not in named)
        hitch_qpos, hitch_qvel = places(hitches(self.trailers))
        self._hitch_qpos, self._hitch_qvel = as_slice(hitch_qpos), as_slice(hitch_qvel)
        x, vx = self.free_qpos, self.free_qvel
        # where x, y, something in θ1's stead, and the hitches' angles are; and their rates
        self._q_places = np.array([x, x + 1, x + Z, *hitch_qpos])
        self._q_rate_places = np.array([vx, vx + 1, vx + YAW_RATE, *hitch_qvel])
        self.wheel_qpos, self.wheel_qvel = map(as_slice, places(WHEELS))
        _, self.ball_qvel = places(casters(self.trailers))

    def planar(self, qpos: FloatArray, qvel: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The q and its rate (..., 3 + n) of qpos (..., nq) and qvel (..., nv); θ1 is wrapped."""
        q, q_rate = qpos.take(self._q_places, axis=-1), qvel.take(self._q_rate_places, axis=-1)
        # the quaternion's twist about the vertical; a flat robot's tilt does not enter
        q[..., THETA1] = 2.0 * np.arctan2(q[..., THETA1], qpos[..., self.free_qpos + W])
        for values in (q, q_rate):
            hitches = values[..., THETA2:]
            if self.trailers > 1:
                np.add.accumulate(hitches, axis=-1, out=hitches)
            hitches += values[..., THETA1, None]
        return q, q_rate

    def standing(self, pattern: FloatArray, q: FloatArray) -> FloatArray:
        """The qpos (nsim, nq) of robots at q (nsim, 3 + n) that stand like patterns of yaw 0.

        There is a pattern (nq,), or one for each robot (nsim, nq).
        """
        free = self.free_qpos
        qpos = np.array(np.broadcast_to(pattern, (len(q), pattern.shape[-1])))
        qpos[:, free : free + 2] = q[:, :2]
        half = 0.5 * q[:, THETA1]
        cos, sin = np.cos(half), np.sin(half)
        w, x, y, z = pattern[..., free + W : free + Z + 1].T
        # yaw about the world's vertical, on top of the pattern's tilt
        turned = [cos * w - sin * z, cos * x - sin * y, cos * y + sin * x, cos * z + sin * w]
        qpos[:, free + W : free + Z + 1] = np.stack(turned, axis=-1)
        qpos[:, self._hitch_qpos] = np.diff(q[:, THETA1:], axis=-1)
        return qpos

    def turned_back(self, qpos: FloatArray) -> FloatArray:
        """Patterns of yaw 0 (nsim, nq), for `standing`, of robots as they stand."""
        pattern, free = np.array(qpos), self.free_qpos
        w, x, y, z = qpos[:, free + W : free + Z + 1].T
        half = np.arctan2(z, w)
        cos, sin = np.cos(half), np.sin(half)
        turned = [cos * w + sin * z, cos * x + sin * y, cos * y - sin * x, cos * z - sin * w]
        pattern[:, free + W : free + Z + 1] = np.stack(turned, axis=-1)
        return pattern

    def moving(self, q_rate: FloatArray, wheels: FloatArray, nv: int) -> FloatArray:
        """The qvel (nsim, nv) of rates (nsim, 3 + n) and wheel speeds (nsim, 2); balls stand."""
        qvel = np.zeros((len(q_rate), nv))
        qvel[:, self.free_qvel : self.free_qvel + 2] = q_rate[:, :2]
        qvel[:, self.free_qvel + YAW_RATE] = q_rate[:, THETA1]
        qvel[:, self._hitch_qvel] = np.diff(q_rate[:, THETA1:], axis=-1)
        qvel[:, self.wheel_qvel] = wheels
        return qvel

    def stop(self, qvel: FloatArray) -> None:
        """Set the rates of x, y, θ1 and the hitches in qvel (nsim, nv) to 0."""
        qvel[:, self._q_rate_places] = 0.0


def as_slice(places: list[int]) -> slice | list[int]:
    """Successive places as a slice, which costs a fraction of what a list costs."""
    run = list(range(places[0], places[0] + len(places)))
    return slice(run[0], run[-1] + 1) if places == run else places
