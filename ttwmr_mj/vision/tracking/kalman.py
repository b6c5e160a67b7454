"""The Kalman update: what the labels of one frame say about the state.

The bodies share their hitches in the measurement's equations, so the hitches hold by construction.
"""

import numpy as np

from ttwmr_mj.state import BoolArray, FloatArray
from ttwmr_mj.vision.camera.labels import LabelLayout
from ttwmr_mj.vision.tracking.motion import Gaussian

# a label's variance of what its place had before, at least: less is lost in the digits of numbers
LEAST_SHARE = 1e-10
JUMP_CHI2 = 32.0  # one pose of eight numbers in 10 000 is farther off, and fewer of a shorter train


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
        points_m: (labels, 2) x, y of the labels in the plane at their height.
        found: (labels,) which of them are measured; the others are ignored.
        layout: the labels on the robot.
        noise_m2: variance of a label's x and of its y.
        gate_chi2: labels with a larger squared normalised innovation are not used.

    Returns:
        The posterior, and (labels,) which labels passed the gate; without any it is the prior.
    """
    width = 3 + layout.trailers
    q = prior.mean[:width]
    innovation = points_m - layout.centres_m(q)[:, :2]
    slope = layout.jacobian(q)
    cross = prior.covariance[:, :width] @ slope.T
    spread = slope @ cross[:width]
    spread.flat[:: len(spread) + 1] += max(noise_m2, LEAST_SHARE * float(spread.max()))
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


def update_pose(prior: Gaussian, seen: Gaussian, width: int) -> Gaussian | None:
    """Work a pose that was found without the prior into it.

    What the prior knows of rates is kept so: two poses, however far apart, tell how fast a trailer
    turns. Nothing is linearised.

    Args:
        prior: at the time of the pose.
        seen: whose first `width` numbers, and their covariance, are the pose.
        width: numbers of a pose.

    Returns:
        The posterior; None where the robot is not where the prior says it can be.
    """
    innovation = seen.mean[:width] - prior.mean[:width]
    cross = prior.covariance[:, :width]
    spread = cross[:width] + seen.covariance[:width, :width]
    gain = np.linalg.solve(spread, cross.T).T
    if innovation @ np.linalg.solve(spread, innovation) > JUMP_CHI2:
        return None
    covariance = prior.covariance - gain @ cross.T
    mean = prior.mean + gain @ innovation
    return Gaussian(prior.time_s, mean, 0.5 * (covariance + covariance.T))


def _squared_distances(innovation: FloatArray, spread: FloatArray) -> FloatArray:
    """Squared Mahalanobis distance (labels,) of each label's innovation (labels, 2), of spread."""
    x, y = innovation.T
    xx, yy = spread.diagonal()[0::2], spread.diagonal()[1::2]
    xy = spread.diagonal(1)[0::2]
    return np.asarray((yy * x * x - 2.0 * xy * x * y + xx * y * y) / (xx * yy - xy * xy))
