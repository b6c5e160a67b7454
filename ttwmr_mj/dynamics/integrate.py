"""The one fixed-step integrator: classical Runge-Kutta of fourth order."""

from collections.abc import Callable

from ttwmr_mj.state import FloatArray

# Share of the step that has passed (0, ½, 1) and the state there → the state's time derivative.
Rate = Callable[[float, FloatArray], FloatArray]


def runge_kutta(rate: Rate, state: FloatArray, step_s: FloatArray | float) -> FloatArray:
    """The state after one step.

    Args:
        rate: the time derivative, of the state's shape.
        state: (components, ...), components first.
        step_s: (...) or one number; a step of zero changes nothing, exactly.

    Returns:
        (components, ...).
    """
    half = 0.5 * step_s
    k1 = rate(0.0, state)
    k2 = rate(0.5, state + half * k1)
    k3 = rate(0.5, state + half * k2)
    k4 = rate(1.0, state + step_s * k3)
    return state + step_s / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
