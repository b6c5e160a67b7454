"""The Kalman update: what the labels of one frame say about the state.

Both halves share P in the measurement's equations, so the hitch constraint holds by construction.
"""

import numpy as np

from ttwmr_mj.state import BoolArray, FloatArray
from ttwmr_mj.vision.camera.labels import COUNT, LabelLayout
from ttwmr_mj.vision.tracking.motion import Gaussian
from ttwmr_mj.vision.tracking.pose import label_jacobian


def update(
    prior: Gaussian,
    points_m: FloatArray,
    found: BoolArray,
    layout: LabelLayout,
    noise_m2: float,
    gate_chi2: float,
) -> tuple[Gaussian, BoolArray]:
    """Work label positions into the state.

    Args:
        prior: at the time of the frame.
        points_m: (4, 2) x, y of the labels in the plane at their height.
        found: (4,) which of them are measured; the others are ignored.
        layout: the labels on the robot.
        noise_m2: variance of a label's x and of its y.
        gate_chi2: labels with a larger squared normalised innovation are not used.

    Returns:
        The posterior, and (4,) which labels passed the gate; without any it is the prior.
    """
    innovation = points_m - layout.centres_m(prior.mean[:4])[:, :2]
    slope = label_jacobian(prior.mean[:4], layout)
    cross = prior.covariance[:, :4] @ slope.T
    spread = slope @ cross[:4]
    spread.flat[:: 2 * COUNT + 1] += noise_m2
    used = found & (_squared_distances(innovation, spread) < gate_chi2)
    if not used.any():
        return prior, used
    difference = innovation.ravel()
    if not used.all():
        rows = np.flatnonzero(np.repeat(used, 2))
        spread, cross, difference = spread[np.ix_(rows, rows)], cross[:, rows], difference[rows]
    gain = np.linalg.solve(spread, cross.T).T
    covariance = prior.covariance - gain @ cross.T
    mean = prior.mean + gain @ difference
    return Gaussian(prior.time_s, mean, 0.5 * (covariance + covariance.T)), used


def _squared_distances(innovation: FloatArray, spread: FloatArray) -> FloatArray:
    """(4,) squared Mahalanobis distance of each label's innovation (4, 2); spread is (8, 8)."""
    x, y = innovation.T
    xx, yy = spread.diagonal()[0::2], spread.diagonal()[1::2]
    xy = spread.diagonal(1)[0::2]
    return np.asarray((yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy))
