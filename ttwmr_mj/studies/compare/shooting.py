"""Multiple shooting: a motion under known wheels, all of its stretches of time at once.

The wheels are known, so every stretch can be made before the stretch before it is, from a guess of
where that ends: all of them are one batch. Finite differences of the batch are the derivatives A
(by the state) and B (by parameters) of every stretch z' = F(z, p). Newton's method closes the gaps
between the stretches, and the chain rule gives the derivatives of the motion,

    δ' = A·δ + (F(z, p) − z'),    S' = A·S + B,    S = dz/dp

Gaps that close quadratically need few rounds, and those of numpy are as many as for one stretch,
where marching from stretch to stretch costs them once for every stretch.
"""

from typing import Protocol

import numpy as np

from ttwmr_mj.state import FloatArray

FIRST = 2  # of the states that matter for rates: θ1, θ2, θ̇2; not x, y
DIFFERENCE = 1e-6  # of these [rad, rad/s]: rounding and curvature both cost 1e-10
CLOSED = 1e-9  # a correction after which the next would be of its square
MAX_ROUNDS = 8  # smooth hitches take 3


class Ends(Protocol):
    """Where stretches end."""

    def __call__(self, states: FloatArray, which: slice) -> FloatArray:
        """States at the ends of some stretches from those at their beginnings.

        Args:
            states: (variants + parameters, n, states): every stretch as it is, with each state
                but x and y a little different, and with one parameter varied.
            which: the n stretches among all.
        """


def shoot(ends: Ends, guess: FloatArray, parameters: int = 0) -> tuple[FloatArray, FloatArray]:
    """The motion, and by how much it differs with each parameter.

    Args:
        ends: what makes a stretch.
        guess: (n + 1, states) at the stretches' ends, the first where the motion starts.
        parameters: how many are varied.

    Returns:
        The states (n + 1, states) and their differences (n + 1, states, parameters).
    """
    for _ in range(MAX_ROUNDS):
        correction, slope = _newton(ends, guess, parameters)
        guess = guess + correction
        if np.abs(correction).max() < CLOSED:  # false also where it is not finite
            return guess, slope
    # dry friction can be too rough for it, and an unstable trailer run away from any guess
    guess = guess.copy()
    for k in range(len(guess) - 1):
        start = np.tile(guess[k], (guess.shape[1] - FIRST + 1 + parameters, 1, 1))
        guess[k + 1] = ends(start, slice(k, k + 1))[0, 0]
    return guess, _newton(ends, guess, parameters)[1]


def _newton(ends: Ends, guess: FloatArray, parameters: int) -> tuple[FloatArray, FloatArray]:
    """Correction (n + 1, states) of a guess, and the differences (n + 1, states, parameters)."""
    states = guess.shape[1]
    variants = 1 + states - FIRST
    changes = np.zeros((variants + parameters, 1, states))
    changes[1:variants, 0, FIRST:] = DIFFERENCE * np.eye(states - FIRST)
    found = ends(guess[:-1] + changes, slice(None))
    by_state = np.moveaxis(found[1:variants] - found[0], 0, -1) / DIFFERENCE  # of x, y: trivial
    by_parameter = np.moveaxis(found[variants:] - found[0], 0, -1)
    added = np.concatenate([(found[0] - guess[1:])[..., None], by_parameter], axis=-1)
    total = np.zeros((len(guess), states, 1 + parameters))
    for k in range(len(added)):
        total[k + 1] = added[k] + by_state[k] @ total[k, FIRST:]
        total[k + 1, :FIRST] += total[k, :FIRST]
    return total[..., 0], total[..., 1:]
