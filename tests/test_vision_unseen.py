"""What the camera's filter believes of a robot that nobody sees for minutes."""

import numpy as np
import pytest
from trains import train

from ttwmr_mj.vision.tracking.commands import TwistRamp
from ttwmr_mj.vision.tracking.motion import MOST_VARIANCE, Gaussian, MotionModel
from ttwmr_mj.vision.tracking.options import TrackerOptions


def unseen(count: int, swing_rad_s: float) -> Gaussian:
    """After five minutes of turning."""
    motion = MotionModel(train(count), TrackerOptions())
    mean = np.zeros(motion.size)
    mean[3 : 3 + count], mean[-count:] = 3.0, swing_rad_s
    state = Gaussian(0.0, mean, 1e-4 * np.eye(motion.size))
    for k in range(3000):
        state = motion.predict(state, 0.1 * (k + 1), [TwistRamp(0.1, 0.5, 3.0, -0.5, 3.0)])
    return state


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2])
def test_what_nobody_sees_for_long_stays_a_distribution(count: int) -> None:
    """The variance of a trailer that falls would grow by e⁷⁰⁰ and more; the tractor's does not."""
    state = unseen(count, 90.0)
    assert np.isfinite(state.mean).all()
    variance = state.covariance.diagonal()
    assert variance.max() <= MOST_VARIANCE * (1.0 + 1e-12)
    correlation = state.covariance / np.sqrt(np.outer(variance, variance))
    assert np.linalg.eigvalsh(correlation).min() >= -1e-9  # rounding
    calm = unseen(1, 0.0).covariance[:3, :3]
    np.testing.assert_allclose(state.covariance[:3, :3], calm, rtol=0, atol=1e-6 * calm.max())
