"""The backward pass of a linear-quadratic tracking problem, for a batch of trajectories."""

from typing import NamedTuple

import numpy as np

from ttwmr_mj.state import FloatArray


class RiccatiSolution(NamedTuple):
    """u = ū + feedforward + gain·(x − x̄) minimises the cost to second order; axes (n, batch)."""

    gain: FloatArray  # (n, batch, inputs, states)
    feedforward: FloatArray  # (n, batch, inputs)
    cost: FloatArray  # (n + 1, batch, states, states) Hessian of the cost to go


def backward(
    A: FloatArray,
    B: FloatArray,
    by_state: FloatArray,
    by_input: FloatArray,
    residual: FloatArray,
    final: FloatArray,
    final_slope: FloatArray,
) -> RiccatiSolution:
    """Dynamic programming for x⁺ = A·x + B·u and stage cost ½|r + by_state·x + by_input·u|².

    The Riccati recursion, with the affine terms of a trajectory that is not optimal yet. The input
    must have a cost of its own (by_input of full column rank).

    Args:
        A: (n, batch, s, s).
        B: (n, batch, s, i).
        by_state: (n, batch, m, s).
        by_input: (m, i), or with leading axes (n, batch).
        residual: (n, batch, m) r along the trajectory.
        final: (batch, s, s) Hessian of the final cost.
        final_slope: (batch, s) gradient of the final cost.
    """
    n, batch, states, inputs = B.shape
    R = np.broadcast_to(np.swapaxes(by_input, -1, -2) @ by_input, (n, batch, inputs, inputs))
    Q = np.swapaxes(by_state, -1, -2) @ by_state
    S = np.swapaxes(by_input, -1, -2) @ by_state
    q = apply(np.swapaxes(by_state, -1, -2), residual)
    r = apply(np.swapaxes(by_input, -1, -2), residual)
    gain, feedforward = np.empty((n, batch, inputs, states)), np.empty((n, batch, inputs))
    cost = np.empty((n + 1, batch, states, states))
    P, p = final, final_slope
    cost[n] = final
    for k in range(n - 1, -1, -1):
        At, Bt = np.swapaxes(A[k], -1, -2), np.swapaxes(B[k], -1, -2)
        PA = P @ A[k]
        H = R[k] + Bt @ (P @ B[k])
        G = S[k] + Bt @ PA
        h = r[k] + apply(Bt, p)
        solution = -np.linalg.solve(H, np.concatenate([G, h[..., None]], axis=-1))
        K, f = solution[..., :-1], solution[..., -1]
        Gt = np.swapaxes(G, -1, -2)
        P = Q[k] + At @ PA + Gt @ K
        P = 0.5 * (P + np.swapaxes(P, -1, -2))
        p = q[k] + apply(At, p) + apply(Gt, f)
        gain[k], feedforward[k], cost[k] = K, f, P
    return RiccatiSolution(gain, feedforward, cost)


def apply(matrix: FloatArray, vector: FloatArray) -> FloatArray:
    """(batch, m) product of matrices (batch, m, n) with vectors (batch, n)."""
    return np.asarray((matrix @ vector[..., None])[..., 0])
