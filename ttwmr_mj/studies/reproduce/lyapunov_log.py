"""V(t) along a run, what Eq. 36 says of V', and what V really does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ttwmr_mj.controllers.lyapunov import LyapunovOptions, lyapunov_function
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.state import FloatArray


@dataclass(frozen=True, slots=True)
class LyapunovLog:
    """The Lyapunov function of Eq. 33 and 44 along a run.

    V mixes m² and (m/s)², as the article's does; only its shape over time means something.

    Attributes:
        time_s: (n,).
        v: (n,) V.
        v_rate: (n,) dV/dt from sample to sample; the last repeats the one before.
        v_rate_claimed: (n,) −α1·e1² − (α2·e2)² − α3·e3² − (α4·e4)² (Eq. 36, 46).
    """

    time_s: FloatArray
    v: FloatArray
    v_rate: FloatArray
    v_rate_claimed: FloatArray

    @property
    def end_share(self) -> float:
        """V at the end over V at the start."""
        return float(self.v[-1] / self.v[0])

    @property
    def rise_share(self) -> float:
        """The highest V stands above its lowest value so far, over V at the start."""
        return float((self.v - np.minimum.accumulate(self.v)).max() / self.v[0])

    @property
    def rising_share(self) -> float:
        """Share of samples at which V goes up by more than 10⁻⁶ of its start per second."""
        return float((self.v_rate > 1e-6 * self.v[0]).mean())


def lyapunov_log(trajectory: Trajectory, options: LyapunovOptions) -> LyapunovLog:
    """V and V' of a run of one simulation, from the true state."""
    alive = np.isfinite(trajectory.q[:, 0]).all(axis=1)
    time_s = trajectory.time_s[alive]
    e = (trajectory.q - trajectory.ref_q)[alive, 0, :2]
    e_rate = (trajectory.q_rate - trajectory.ref_q_rate)[alive, 0, :2]
    v, claimed = lyapunov_function(e, e_rate, options)
    slope = np.diff(v) / np.diff(time_s)
    return LyapunovLog(
        time_s=time_s,
        v=v,
        v_rate=np.append(slope, slope[-1:]),
        v_rate_claimed=claimed,
    )
