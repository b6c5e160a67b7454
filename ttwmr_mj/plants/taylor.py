"""The hitch's swing over one stretch as a Taylor series, for batches of simulations in `rollout`.

In units of the stretch, τ = t/T, the series φ = Σ φ_k τ^k of

    φ'' = α(τ)·cos φ + β·sin φ − κ·φ − γ·φ' − η

follows term by term, as those of cos φ = Σ C_k τ^k and sin φ = Σ S_k τ^k do:

    k·S_k = Σ_j j·φ_j·C_{k−j},    k·C_k = −Σ_j j·φ_j·S_{k−j}        (j = 1 … k)

α is a parabola, all else is constant. Terms are added until they vanish in all simulations.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ttwmr_mj.errors import InputError
from ttwmr_mj.state import FloatArray

MAX_ORDER = 24
NEGLIGIBLE_RAD = 1e-10  # the last term; those left out are smaller, and stretches are thousands
MAX_HALVINGS = 12
TOO_VIOLENT = (
    "the trailer's swing did not converge: the wheel speeds or the hitch's spring and damper are "
    "too violent for a rollout; use the analytic plant"
)


class Room(NamedTuple):
    """Where the terms are worked out, used again and again: fresh memory would cost more time."""

    turn: FloatArray  # (MAX_ORDER + 1, nsim) k·φ_k
    waves: FloatArray  # (MAX_ORDER, 2, nsim) S_k, C_k

    @classmethod
    def of(cls, nsim: int) -> Room:
        """Room for a batch."""
        return cls(np.empty((MAX_ORDER + 1, nsim)), np.empty((MAX_ORDER, 2, nsim)))


class Ramp(NamedTuple):
    """What the accelerations of a stretch add to the equation, all (nsim,)."""

    linear: FloatArray  # of α
    quadratic: FloatArray
    along: FloatArray  # β
    drive: FloatArray  # η


class Series(NamedTuple):
    """The equation over one stretch, all (nsim,)."""

    duration_s: FloatArray
    constant: FloatArray  # of α
    ramp: Ramp | None  # None where no wheel changes its speed
    stiffness: FloatArray | None  # κ; None where there is no spring
    damping: FloatArray | None  # γ; None where there is no damper

    def end(
        self, angle: FloatArray, rate: FloatArray, room: Room, halvings: int = MAX_HALVINGS
    ) -> tuple[FloatArray, FloatArray]:
        """φ [rad] and φ̇ [rad/s] after the stretch from those before.

        A stretch whose series is too long is made in two halves.

        Raises:
            InputError: the halves of halves are still too long.
        """
        gain = self._gain(angle, rate * self.duration_s, room)
        if gain is not None:
            unit = np.where(self.duration_s > 0.0, self.duration_s, 1.0)
            return angle + gain[0], rate + gain[1] / unit
        if not halvings:
            raise InputError(TOO_VIOLENT)
        first, second = self._halves()
        return second.end(*first.end(angle, rate, room, halvings - 1), room, halvings - 1)

    def _gain(
        self, angle: FloatArray, slope: FloatArray, room: Room
    ) -> tuple[FloatArray, FloatArray] | None:
        """By what φ and φ' grow from τ = 0 to 1; None if more than MAX_ORDER terms matter."""
        turn, waves = room
        np.sin(angle, out=waves[0, 0])
        np.cos(angle, out=waves[0, 1])
        turn[1] = slope
        for k in range(MAX_ORDER - 1):
            if k:
                np.einsum("jn,jcn->cn", turn[1 : k + 1], waves[k - 1 :: -1, ::-1], out=waves[k])
                waves[k] *= SIGNS[k]
            push = self.constant * waves[k, 1]
            if self.ramp is not None:
                push += self.ramp.along * waves[k, 0]
                if k == 0:
                    push -= self.ramp.drive
                else:
                    push += self.ramp.linear * waves[k - 1, 1]
                if k > 1:
                    push += self.ramp.quadratic * waves[k - 2, 1]
            if self.damping is not None:
                push -= self.damping * turn[k + 1]
            if self.stiffness is not None:
                push -= self.stiffness * (turn[k] / k if k else angle)
            push = np.divide(push, k + 1, out=turn[k + 2])
            # two terms, as one may vanish by chance; looking costs half a term: at every other
            if k % 2 and k > 2 and _largest(turn[k + 1 : k + 3]) < NEGLIGIBLE_RAD:
                angle_gain, slope_gain = SUMS[:, : k + 2] @ turn[1 : k + 3]
                return angle_gain, slope_gain - slope
        return None

    def _halves(self) -> tuple[Series, Series]:
        """The two halves, each in its own units."""
        whole = self._replace(
            duration_s=0.5 * self.duration_s,
            constant=0.25 * self.constant,
            stiffness=None if self.stiffness is None else 0.25 * self.stiffness,
            damping=None if self.damping is None else 0.5 * self.damping,
        )
        if self.ramp is None:
            return whole, whole
        linear, quadratic, along, drive = self.ramp
        first = Ramp(linear / 8.0, quadratic / 16.0, along / 4.0, drive / 4.0)
        middle = whole.constant + first.linear + first.quadratic
        second = first._replace(linear=first.linear + 2.0 * first.quadratic)
        return whole._replace(ramp=first), whole._replace(constant=middle, ramp=second)


def _largest(values: FloatArray) -> float:
    """Of the absolute values, in the fewest operations."""
    return float(max(values.max(), -values.min()))


# k·S_k and −k·C_k are the sums
SIGNS = np.array([[[1.0], [-1.0]]]) / np.maximum(1, np.arange(MAX_ORDER))[:, None, None]
# of the terms k·φ_k: φ(1) − φ(0) and φ'(1)
SUMS = np.stack([1.0 / np.arange(1, MAX_ORDER + 1), np.ones(MAX_ORDER)])
