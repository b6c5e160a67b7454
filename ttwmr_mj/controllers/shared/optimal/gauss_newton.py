"""Gauss-Newton on a tracking problem: the Riccati recursion for a step, rollouts for its length.

The cost beyond the last sample is ½zᵀHz with z = (x − x_ref, disturbance − that of the reference).
"""

from typing import NamedTuple

import numpy as np

from ttwmr_mj.controllers.shared.optimal.riccati import RiccatiSolution, apply, backward
from ttwmr_mj.controllers.shared.optimal.tracking_problem import INPUTS, UNKNOWN, Problem, Target
from ttwmr_mj.state import FloatArray

FITTING_PASSES = 30  # shipped scenarios take 2 to 5, rest to rest with 1e-3 N·m of friction 16
FITTED = 1e-3  # a pass that lowers the cost by a smaller share is the last
EXACT = 1e-9  # root mean square of residuals, in their scales, of which only rounding is left
EXACT_PASSES = 4  # at most for such a plan: more shuffle its rounding, of long ones again and again
DISTURBANCE_TIME_S = 10.0  # in which what is unexplained is assumed to decay
FITTING_LENGTHS = np.array([1.0, 0.5, 0.2, 0.05, 0.0])  # of a step; zero keeps what there is


class Rollout(NamedTuple):
    """States and commands, one after the other in time, and the policy that made them."""

    state: FloatArray  # (n + 1, batch, 7)
    command: FloatArray  # (n, batch, 2)
    cost: FloatArray  # (batch,)


def improved(
    problem: Problem,
    state: FloatArray,
    command: FloatArray,
    target: Target,
    beyond: FloatArray,
    *,
    start: FloatArray,
    disturbance: FloatArray,
    lengths: FloatArray,
    planned: FloatArray | float = 0.0,
    cut: bool = False,
) -> Rollout:
    """One Gauss-Newton step from a plan; of a few lengths of the step the one that costs least.

    Args:
        problem: model and stage cost.
        state: (n + 1, batch, 7) of the plan.
        command: (n, batch, 2) of the plan.
        target: n + 1 samples.
        beyond: (1 or batch, 7 + lasting, 7 + lasting) H.
        start: (batch, 7) where the robot is, near the plan's first state.
        disturbance: (batch, width) which lasts.
        lengths: (m,) of the step.
        planned: (1 or batch, width) disturbance of the reference.
        cut: commands are cut to the servos' limits.
    """
    n, batch = command.shape[:2]
    linear = problem.linearise(state[:-1], command, disturbance)
    beside = (disturbance - planned)[:, : problem.lasting]
    width = problem.states
    hessian = np.broadcast_to(beyond[:, :width], (batch, width, width + problem.lasting))
    end = np.concatenate([state[-1] - target.state[-1], beside], axis=1)
    policy = backward(
        linear.A,
        linear.B,
        problem.residual_by_state(state[:-1]),
        problem.residual_by_command,
        problem.residual(state[:-1], command, target, slice(n)),
        hessian[:, :, :width],
        apply(hessian, end),
    )
    lasting = np.broadcast_to(disturbance, (lengths.size, *disturbance.shape))
    states, commands = _rollouts(problem, state, command, policy, start, lasting, lengths, cut)
    aims = Target(*(values[:, None] for values in target))
    residual = problem.residual(states[:-1], commands, aims, slice(n))
    beside = np.broadcast_to(beside, (lengths.size, *beside.shape))
    end = np.concatenate([states[-1] - target.state[-1], beside], axis=-1)
    costs = 0.5 * (residual**2).sum(axis=(0, -1)) + 0.5 * (end * apply(beyond, end)).sum(axis=-1)
    best, each = np.argmin(costs, axis=0), np.arange(batch)
    return Rollout(states[:, best, each], commands[:, best, each], costs[best, each])


def _rollouts(
    problem: Problem,
    state: FloatArray,
    command: FloatArray,
    policy: RiccatiSolution,
    start: FloatArray,
    disturbance: FloatArray,
    lengths: FloatArray,
    cut: bool,
) -> tuple[FloatArray, FloatArray]:
    """The sampled model under a policy about a plan, for several lengths m of its feedforward.

    Returns:
        states (n + 1, m, batch, 7) and commands (n, m, batch, 2).
    """
    count = disturbance.shape[:-1]
    states = np.empty((len(state), *count, problem.states))
    commands = np.empty((len(command), *count, 2))
    now = states[0] = np.broadcast_to(start, (*count, problem.states))
    for k in range(len(command)):
        push = lengths[:, None, None] * policy.feedforward[k]
        wish = command[k] + push + apply(policy.gain[k], now - state[k])
        commands[k] = problem.within_limits(now, wish) if cut else wish
        now = states[k + 1] = problem.next_state(now, commands[k], disturbance)
    return states, commands


def fit(
    problem: Problem, target: Target, disturbance: FloatArray | None = None, passes: int = 0
) -> tuple[FloatArray, FloatArray]:
    """States (n, batch, 7) and commands (n − 1, batch, 2) of the sampled model near the target.

    Args:
        problem: model and stage cost.
        target: what to come close to.
        disturbance: (batch, width) which lasts; None: none.
        passes: steps; 0: until the cost of none falls by a share of FITTED, at most FITTING_PASSES
            or, where all are EXACT, EXACT_PASSES. A batch of different simulations says how many,
            or they would depend on each other.
    """
    batch = target.state.shape[1]
    size = problem.states + problem.lasting
    if disturbance is None:
        disturbance = np.zeros((batch, problem.width))
    rounding = 0.5 * len(target.command) * EXACT**2
    plan = Rollout(target.state, target.command, np.full(batch, np.inf))
    for done in range(1, (passes or FITTING_PASSES) + 1):
        last = plan
        plan = improved(
            problem,
            last.state,
            last.command,
            target,
            np.zeros((batch, size, size)),
            start=last.state[0],
            disturbance=disturbance,
            planned=disturbance,
            lengths=FITTING_LENGTHS,
        )
        falls = plan.cost < (1.0 - FITTED) * last.cost
        enough = done >= EXACT_PASSES and (plan.cost <= rounding).all()
        if not passes and (enough or not falls.any()):
            break
    return plan.state, plan.command


def lqr(
    problem: Problem,
    state: FloatArray,
    command: FloatArray,
    decay: FloatArray,
    disturbance: FloatArray | None = None,
) -> RiccatiSolution:
    """The time-varying LQR about a plan; its states are the errors and the lasting disturbances.

    Args:
        problem: model and stage cost.
        state: (n + 1, batch, 7).
        command: (n, batch, 2).
        decay: (lasting,) factor by which disturbances fall in a period.
        disturbance: (batch, width) of the plan; None: none.

    Raises:
        numpy.linalg.LinAlgError: there are no gains that are numbers.
    """
    if disturbance is None:
        disturbance = np.zeros(problem.width)
    linear = problem.linearise(state[:-1], command, disturbance)
    n, batch = linear.A.shape[:2]
    states = problem.states
    size = states + problem.lasting
    A, B = np.zeros((n, batch, size, size)), np.zeros((n, batch, size, INPUTS))
    A[..., :states, :states], A[..., :states, states:] = linear.A, linear.D
    A[..., states:, states:] = np.diag(decay)
    B[..., :states, :] = linear.B
    by_state = np.zeros((n, batch, problem.residuals, size))
    by_state[..., :states] = problem.residual_by_state(state[:-1])
    exact, end, slope = (
        np.zeros((n, batch, problem.residuals)),
        np.zeros((batch, size, size)),
        np.zeros((batch, size)),
    )
    with np.errstate(all="ignore"):  # what overflows is told
        found = backward(A, B, by_state, problem.residual_by_command, exact, end, slope)
    if not np.isfinite(found.cost).all():
        raise np.linalg.LinAlgError("they overflow")
    return found


def decay(time_s: float, period_s: float, lasting: int) -> FloatArray:
    """(lasting,) factors by which disturbances fall in a period; what is learned lasts."""
    factors = np.ones(lasting)
    factors[:UNKNOWN] = np.exp(-period_s / time_s)
    return factors
