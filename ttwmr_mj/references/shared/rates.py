"""Is one array of a path the rate of another?"""

import numpy as np

from ttwmr_mj.state import FloatArray

ROUNDING = 1e-7  # of the largest value: of numbers of single precision, too
LOOSE = 0.05  # of the rate, as of values that were measured or written with few digits
MOST_WRONG = 0.25  # of the steps that say something: where values jump, steps are wrong


def require_rate(
    names: tuple[str, str], time_s: FloatArray, values: FloatArray, rate: FloatArray, *, jumps: bool
) -> None:
    """Compare the change from sample to sample with the trapezoid rule's.

    Between two samples a right rate strays from the rule by no more than it varies around them,
    whatever its kinks: half its range over the two and their neighbours is allowed for, and LOOSE.
    A rate that is wrong by a factor is caught where it varies by less than that. A jump of values
    is in no rate; so it is refused only where a good part of the steps are wrong.

    Args:
        names: of values and rate, for the message.
        time_s: (n,).
        values: (n, ...); NaN where undefined.
        rate: the same.
        jumps: whether values may change where the rate is zero, as derivatives of a kink do.

    Raises:
        ValueError: it is not.
    """
    if len(time_s) < 2:
        return
    values, rate = values.reshape(len(time_s), -1), rate.reshape(len(time_s), -1)
    step = np.diff(time_s)[:, None]
    change, told = np.diff(values, axis=0), step * 0.5 * (rate[1:] + rate[:-1])
    around = np.pad(rate, ((1, 1), (0, 0)), mode="edge")
    near = np.lib.stride_tricks.sliding_window_view(around, 4, axis=0)
    rounding = ROUNDING * np.nanmax(np.abs(values), axis=0, initial=0.0)
    allowed = 0.5 * np.ptp(near, axis=-1) + LOOSE * np.abs(near).max(axis=-1)
    wrong = np.abs(change - told) > step * allowed + rounding
    says = (np.abs(told) > rounding) | ((np.abs(change) > rounding) & (not jumps))
    if np.sum(wrong & says) > MOST_WRONG * np.sum(says):
        k, i = np.unravel_index(np.argmax(np.where(wrong, np.abs(change - told), 0.0)), wrong.shape)
        raise ValueError(
            f"{names[1]} is not the rate of {names[0]}, which from t = {time_s[k]:g} to "
            f"{time_s[k + 1]:g} s changes by {change[k, i]:.4g}, and by its rate would by "
            f"{told[k, i]:.4g}"
        )
