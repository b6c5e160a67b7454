"""A reference as the controllers see it: sampled once for the whole run."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.references.shared.rates import require_rate
from ttwmr_mj.state import ArrayFields, FloatArray


class Moment(NamedTuple):
    """A reference's motion at one sample (batch, …), or at several (m, batch, …)."""

    position_m: FloatArray  # (..., 2) P
    velocity_m_s: FloatArray  # (..., 2)
    acceleration_m_s2: FloatArray  # (..., 2)
    theta: FloatArray  # (..., 1 + trailers) θ1, θ2, …; NaN where undefined
    theta_rate: FloatArray  # (..., 1 + trailers)


@dataclass(frozen=True, slots=True, eq=False)
class ReferencePath(ArrayFields):
    """Reference motion of P and of the two angles, at n sample times.

    World frame, SI units. The batch axis is 1 when every simulation follows the same reference,
    else nsim; either way row k broadcasts against a state of shape (nsim, ...).

    Attributes:
        time_s: (n,) sample times.
        derivatives: (n, batch, 5, 2) position of P and its derivatives to the fourth
            [m, m/s, m/s², m/s³, m/s⁴].
        theta: (n, batch, 1 + trailers) θ1, θ2, … [rad], unwrapped; NaN where the reference defines
            none.
        theta_rate: (n, batch, 1 + trailers) [rad/s]; NaN where undefined.
        theta_acceleration: (n, batch, 1 + trailers) [rad/s²]; NaN where undefined.
        flat_derivatives: (n, batch, 5, 2) the last trailer's centre of oscillation and its
            derivatives to the fourth, of references that give it or can.
    """

    time_s: FloatArray
    derivatives: FloatArray
    theta: FloatArray
    theta_rate: FloatArray
    theta_acceleration: FloatArray
    flat_derivatives: FloatArray | None = None

    def until(self, count: int) -> "ReferencePath":
        """The first samples, as views."""
        flat = self.flat_derivatives
        return ReferencePath(
            time_s=self.time_s[:count],
            derivatives=self.derivatives[:count],
            theta=self.theta[:count],
            theta_rate=self.theta_rate[:count],
            theta_acceleration=self.theta_acceleration[:count],
            flat_derivatives=None if flat is None else flat[:count],
        )

    def copy(self) -> "ReferencePath":
        """The same in arrays of its own."""
        flat = self.flat_derivatives
        return ReferencePath(
            self.time_s.copy(),
            self.derivatives.copy(),
            self.theta.copy(),
            self.theta_rate.copy(),
            self.theta_acceleration.copy(),
            None if flat is None else flat.copy(),
        )

    def at(self, k: "int | NDArray[np.intp]") -> "Moment":
        """The motion at sample k, or at several (m,); beyond the last it goes on.

        Beyond the last sample P goes straight on at its last velocity, and the angles at their last
        rates, without acceleration; what has come to rest stays there. Before the first it holds.
        """
        last = len(self.time_s) - 1
        k = np.asarray(k)
        row = np.clip(k, 0, last)
        period = self.time_s[1] - self.time_s[0] if last else 0.0
        beyond = (np.maximum(k - last, 0) * period)[..., None, None]
        velocity, rate = self.velocity_m_s[row], self.theta_rate[row]
        within = beyond == 0.0
        return Moment(
            position_m=self.position_m[row] + beyond * velocity,
            velocity_m_s=velocity,
            acceleration_m_s2=within * self.acceleration_m_s2[row],
            theta=self.theta[row] + beyond * rate,
            theta_rate=rate,
        )

    def at_pace(self, pace: float) -> "ReferencePath":
        """The same way in 1/pace of the time."""
        orders = pace ** np.arange(5.0)[:, None]
        flat = self.flat_derivatives
        return ReferencePath(
            time_s=self.time_s / pace,
            derivatives=self.derivatives * orders,
            theta=self.theta,
            theta_rate=self.theta_rate * pace,
            theta_acceleration=self.theta_acceleration * pace**2,
            flat_derivatives=None if flat is None else flat * orders,
        )

    @staticmethod
    def beside(paths: "Sequence[ReferencePath]") -> "ReferencePath":
        """The paths of as many simulations as one; of batch 1 where all are equal.

        Args:
            paths: of batch 1, at the same times; without flat derivatives if any has none.
        """
        first, names = paths[0], [field.name for field in fields(ReferencePath)][1:]
        distinct = {id(path): path for path in paths}
        if all(first.equals(path) for path in distinct.values()):
            return first
        rows: dict[str, Any] = {}
        for name in names:
            parts = [getattr(path, name) for path in paths]
            there = all(part is not None for part in parts)
            rows[name] = np.concatenate(parts, axis=1) if there else None
        return ReferencePath(first.time_s, **rows)

    def equals(self, other: "ReferencePath") -> bool:
        """Whether two paths are the same, undefined values included."""
        names = [field.name for field in fields(ReferencePath)]
        pairs = ((getattr(self, name), getattr(other, name)) for name in names)
        return self is other or all(
            x is y or (x is not None and np.array_equal(x, y, equal_nan=True)) for x, y in pairs
        )

    @property
    def position_m(self) -> FloatArray:
        """(n, batch, 2) position of P."""
        return self.derivatives[:, :, 0]

    @property
    def velocity_m_s(self) -> FloatArray:
        """(n, batch, 2) velocity of P."""
        return self.derivatives[:, :, 1]

    @property
    def acceleration_m_s2(self) -> FloatArray:
        """(n, batch, 2) acceleration of P."""
        return self.derivatives[:, :, 2]

    @property
    def q(self) -> FloatArray:
        """(n, batch, 3 + trailers) x, y, θ1, θ2, … (Eq. 2), NaN where undefined."""
        return np.concatenate([self.position_m, self.theta], axis=-1)

    @property
    def q_rate(self) -> FloatArray:
        """(n, batch, 3 + trailers) rates of q, NaN where undefined."""
        return np.concatenate([self.velocity_m_s, self.theta_rate], axis=-1)

    @property
    def theta1_rad(self) -> FloatArray:
        """(n, batch) heading of the tractor."""
        return self.theta[..., 0]

    @property
    def theta2_rad(self) -> FloatArray:
        """(n, batch) orientation of the trailer, NaN where undefined."""
        return self.theta[..., 1]

    def after(self, k: int) -> "ReferencePath":
        """The same from sample k on."""
        flat = self.flat_derivatives
        return ReferencePath(
            self.time_s[k:],
            self.derivatives[k:],
            self.theta[k:],
            self.theta_rate[k:],
            self.theta_acceleration[k:],
            None if flat is None else flat[k:],
        )


def require_motion(path: object, time_s: FloatArray, trailers: int) -> None:
    """Look at a path that another package made.

    Args:
        path: of one simulation.
        time_s: (n,) the times that were asked for.
        trailers: of the robot.

    Raises:
        TypeError, ValueError: it is no path at these times of this robot, with what is wrong.
    """
    if not isinstance(path, ReferencePath):
        raise TypeError("it must return a ReferencePath or None")
    n, angles = len(time_s), (len(time_s), 1, 1 + trailers)
    motion = (n, 1, 5, 2)
    shapes = {"time_s": (n,), "derivatives": motion, "theta": angles, "theta_rate": angles}
    shapes["theta_acceleration"] = angles
    if path.flat_derivatives is not None:
        shapes["flat_derivatives"] = motion
    for name, shape in shapes.items():
        values = getattr(path, name)
        if type(values) is not np.ndarray or values.dtype != np.float64:
            raise TypeError(f"{name} must be a NumPy array of float64")
        if values.shape != shape:
            raise ValueError(f"{name} has shape {values.shape}, and must have {shape}")
        defined = np.isfinite(values) | (np.isnan(values) & name.startswith("theta"))
        if not defined.all():
            first_s = time_s[~defined.reshape(n, -1).all(axis=1)][0]
            raise ValueError(f"{name} is not finite at t = {first_s:g} s")
    if not np.array_equal(path.time_s, time_s):
        raise ValueError("time_s are not the times that were asked for")
    _require_rates(path)


def _require_rates(path: ReferencePath) -> None:
    """Refuse derivatives that are not those of the motion, of which laws would be told."""
    theta = {name: getattr(path, name) for name in ("theta", "theta_rate", "theta_acceleration")}
    motions = {"derivatives": path.derivatives, "flat_derivatives": path.flat_derivatives}
    chains = [
        {f"{name}[:, :, {i}]": orders[:, :, i] for i in range(5)}
        for name, orders in motions.items()
        if orders is not None
    ]
    for chain in (theta, *chains):
        for k, (values, rate) in enumerate(pairwise(chain)):
            require_rate((values, rate), path.time_s, chain[values], chain[rate], jumps=k > 0)
