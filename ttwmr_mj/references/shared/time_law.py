"""How fast a reference travels along its path: constant rate, smooth start, smooth stop."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from ttwmr_mj.errors import Fault
from ttwmr_mj.state import FloatArray

ORDERS = 5  # value and four derivatives
JUMP_S = 1e-9  # what is shorter has derivatives beyond numbers, and a sample at its start alone

SMOOTHSTEP = Polynomial([0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0])  # 0 to 1, C³ at both ends
SMOOTHSTEP_INTEGRAL = SMOOTHSTEP.integ()  # reaches exactly ½


@dataclass(frozen=True, kw_only=True)
class TimeLaw:
    """Path parameter σ(t), starting at σ(0) = 0 and never running backwards.

    Starting and stopping, σ̇ follows a septic smoothstep, so four derivatives of σ are continuous.
    A start that takes `ramp_s` covers half of what constant rate would: from then on
    σ = rate·(t − ramp_s/2), and the reference is late by ramp_s/2 for the rest of its time.

    Attributes:
        rate: σ̇ at constant speed, positive [1/s times the unit of σ].
        ramp_s: duration of the start from rest; 0 starts at full rate (and extends to t < 0).
        end: σ at which to come to rest and stay; None travels for ever.
        stop_s: duration of the stop before `end`.
    """

    rate: float
    ramp_s: float = 0.0
    end: float | None = None
    stop_s: float = 0.0

    def fault(self) -> Fault | None:
        """Start and stop that need more path than there is."""
        needed = 0.5 * self.rate * (self.ramp_s + self.stop_s)
        if self.end is None or needed <= self.end:
            return None
        return Fault(
            key=("ramp_s",),
            got=f"{self.ramp_s:g}",
            problem=f"with a stop of {self.stop_s:g} s that takes a path of at least "
            f"{needed:.4g} m, and there are {self.end:.4g} m",
            hint="shorten start and stop, or go slower",
        )

    def derivatives(self, time_s: FloatArray) -> FloatArray:
        """(5, n) σ and its derivatives to the fourth, at times (n,)."""
        sigma = np.zeros((ORDERS, time_s.size))
        sigma[0], sigma[1] = self.rate * (time_s - 0.5 * self.ramp_s), self.rate
        starting = time_s < self.ramp_s
        sigma[:, starting] = self._ramp(time_s[starting], self.ramp_s)
        if self.end is None:
            return sigma
        end_s = self.end / self.rate + 0.5 * (self.ramp_s + self.stop_s)
        stopping = time_s > end_s - self.stop_s
        # A stop is a start seen backwards in time: odd derivatives keep their sign.
        reversed_signs = np.array([-1.0, 1.0, -1.0, 1.0, -1.0])[:, None]
        sigma[:, stopping] = reversed_signs * self._ramp(end_s - time_s[stopping], self.stop_s)
        sigma[0, stopping] += self.end
        return sigma

    def _ramp(self, time_s: FloatArray, duration_s: float) -> FloatArray:
        """(5, n) a start from rest, with rest before it; times up to its duration."""
        sigma = np.zeros((ORDERS, time_s.size))
        if duration_s > JUMP_S:
            fraction = np.maximum(time_s / duration_s, 0.0)
            for order in range(ORDERS):
                shape = SMOOTHSTEP_INTEGRAL.deriv(order) if order else SMOOTHSTEP_INTEGRAL
                sigma[order] = self.rate * duration_s ** (1 - order) * shape(fraction)
        return sigma
