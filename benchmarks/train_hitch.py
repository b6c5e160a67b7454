"""What the place of the hitches does to trains on circles: poles, controllability, error.

    python benchmarks/train_hitch.py [--out docs/images/train_hitch.png]

P on 0.6 m at 1 rad/s, Table I's trailers, every hitch d behind the one before; 33 ms, fast servo.
Of the sampled model, linearised in the frame that turns, where it does not change:

* the fastest unstable pole;
* controllability in 1 s: the smallest singular value of the Gramian's root, that is how far the
  wheels' commands of unit energy, ∫|Δω|²dt = 1 (rad/s)²·s, move the train in the direction that is
  hardest to reach. Angles count by the trailer's swing length k, rates by k·1 s;
* the steady rms error of the last trailer's centre of oscillation when `tvlqr`'s gains and observer
  are fed white noise as large as the errors of the camera's tracker. With --coupled the observer's
  gain is the Kalman filter's for all trailers together instead of a chain for each.

The last line is JSON.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trains
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

from ttwmr_mj.controllers.shared.estimation.steady_kalman import (
    MODEL_ANGLE_STD_RAD,
    MODEL_POSITION_STD_M,
    ObserverOptions,
    chain_gains,
    process_std,
)
from ttwmr_mj.controllers.shared.optimal.gauss_newton import DISTURBANCE_TIME_S
from ttwmr_mj.controllers.shared.optimal.tracking_problem import TrackingWeights
from ttwmr_mj.controllers.shared.optimal.train_problem import TrainProblem
from ttwmr_mj.dynamics.circling import circling
from ttwmr_mj.dynamics.kinematics import wheels_from_twist
from ttwmr_mj.dynamics.sampled.train import SampledTrain
from ttwmr_mj.figures.canvas import canvas, save
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

PERIOD_S, RADIUS_M, RATE_RAD_S, HORIZON_S = 0.033, 0.6, 1.0, 1.0
HITCH_M = np.linspace(0.10, 0.30, 21)
SHIPPED_M = 0.23
# of the tracker's answers, three trailers inside: position [m], angle [rad] and their rates
NOISE_STD = (4e-5, 5e-4, 6e-4, 5e-3)
SMOOTHING_RAD_S = 0.1  # of dry friction, of which there is none


class Turning(NamedTuple):
    """A train on its circle, linearised in the frame that turns."""

    A: FloatArray  # (states, states)
    B: FloatArray  # (states, 2)
    D: FloatArray  # (states, width) by slip and unexplained θ̈
    by_state: FloatArray  # (residuals, states) of `TrainProblem`
    by_command: FloatArray  # (residuals, 2)
    centre: FloatArray  # (2, states) of F [m]
    trailers: int


class Measures(NamedTuple):
    """What is drawn."""

    pole_1_s: float
    controllable_mm: float
    error_mm: float


def turning(robot: RobotParameters, outside: tuple[bool, ...]) -> Turning:
    """The linear system of an equilibrium."""
    n, heading = len(outside), 0.5 * np.pi
    model = SampledTrain(robot, PERIOD_S, SMOOTHING_RAD_S)
    weights = TrackingWeights()
    problem = TrainProblem(robot, model, weights)
    shape = circling(robot, outside, RADIUS_M).trailer_rad
    # where P heads along x
    body = np.concatenate([[0.0, 0.0, 0.0], shape - heading, np.full(n, RATE_RAD_S)])
    wheels = wheels_from_twist(np.array([RADIUS_M * RATE_RAD_S, RATE_RAD_S]), robot)
    state = np.concatenate([body, wheels])[None]
    A, B, D = (part[0] for part in problem.linearise(state, wheels[None], np.zeros(problem.width)))
    frame = np.eye(problem.states)
    cos, sin = np.cos(RATE_RAD_S * PERIOD_S), np.sin(RATE_RAD_S * PERIOD_S)
    frame[:2, :2] = [[cos, sin], [-sin, cos]]
    by_state = problem.residual_by_state(state)[0]
    centre = weights.position_scale_m * by_state[:2]
    return Turning(
        frame @ A, frame @ B, frame @ D, by_state, problem.residual_by_command, centre, n
    )


def controllability(train: Turning, swing_length_m: float) -> float:
    """Smallest singular value of the Gramian's root [m per rad/s·√s]."""
    n = train.trailers
    size = np.concatenate([[1.0, 1.0], np.full(1 + 2 * n, swing_length_m)])
    gramian, reach = np.zeros((3 + 2 * n, 3 + 2 * n)), train.B / np.sqrt(PERIOD_S)
    for _ in range(round(HORIZON_S / PERIOD_S)):
        moved = size[:, None] * reach[: 3 + 2 * n]
        gramian += moved @ moved.T
        reach = train.A @ reach
    return float(np.sqrt(np.linalg.eigvalsh(gramian)[0]))


def feedback(train: Turning) -> FloatArray:
    """(2, states + width) K of `tvlqr` far from the run's end."""
    states, width = train.D.shape
    lasting = np.exp(-PERIOD_S / DISTURBANCE_TIME_S) * np.eye(width)
    A = np.block([[train.A, train.D], [np.zeros((width, states)), lasting]])
    B = np.vstack([train.B, np.zeros((width, 2))])
    C = np.hstack([train.by_state, np.zeros((len(train.by_state), width))])
    cross, R = C.T @ train.by_command, train.by_command.T @ train.by_command
    P = solve_discrete_are(A, B, C.T @ C, R, s=cross)
    return np.asarray(-np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A + cross.T))


def observer(train: Turning, coupled: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A, C and gain L; states are the body's, slip and the unexplained θ̈ of every trailer."""
    n, options = train.trailers, ObserverOptions()
    body, width, seen = 3 + 2 * n, 3 + n, 3 + n
    A = np.eye(body + width)
    A[:body] = np.hstack([train.A[:body, :body], train.D[:body]])
    C = np.zeros((2 * seen, body + width))
    C[:seen, :seen] = np.eye(seen)
    C[seen + 1, 2] = RADIUS_M * RATE_RAD_S  # P's velocity turns with the heading
    C[seen : seen + 3, body : body + 3] = np.eye(3)
    C[seen + 3 :, seen:body] = np.eye(n)
    if coupled:
        root = np.sqrt(PERIOD_S)
        _, rate, swing = process_std(options, PERIOD_S)
        creep = [options.creep_walk_m_s * root] * 2 + [options.turn_creep_walk_rad_s * root]
        walk = [MODEL_POSITION_STD_M] * 2 + [MODEL_ANGLE_STD_RAD] * (1 + n) + [rate] * n
        Q = np.diag(np.square([*walk, *creep, *[swing] * n]))
        R = np.diag(np.square(_measured_std(options, n)))
        P = solve_discrete_are(A.T, C.T, Q, R)
        return A, C, np.asarray(P @ C.T @ np.linalg.inv(C @ P @ C.T + R))
    gain, L = chain_gains(options, PERIOD_S), np.zeros((body + width, 2 * seen))
    for column in range(seen):
        chain, both = min(column, 3), [column, seen + column]
        slope = body + column if column < 3 else n + column
        L[column, both], L[slope, both] = gain[0, :, chain], gain[1, :, chain]
        if column >= 3:
            L[body + column, both] = gain[2, :, chain]
    return A, C, L


def error(train: Turning, coupled: bool) -> float:
    """Steady rms of F under measurement noise [m]."""
    states, n = len(train.A), train.trailers
    K = feedback(train)
    A, C, L = observer(train, coupled)
    body, wide = 3 + 2 * n, len(A)
    on_estimate = np.hstack([K[:, :body], K[:, states:]])
    lag = (np.eye(wide) - L @ C) @ A
    above = np.hstack([train.A + train.B @ K[:, :states], train.B @ on_estimate])
    loop = np.vstack([above, np.hstack([np.zeros((wide, states)), lag])])
    position, angle, velocity, rate = NOISE_STD
    noise = np.array([position] * 2 + [angle] * (1 + n) + [velocity] * 2 + [rate] * (1 + n))
    enters = np.vstack([np.zeros((states, len(noise))), L * noise])
    spread = solve_discrete_lyapunov(loop, enters @ enters.T)[:states, :states]
    return float(np.sqrt(np.trace(train.centre @ spread @ train.centre.T)))


def _measured_std(options: ObserverOptions, n: int) -> list[float]:
    angles, rates = [options.angle_std_rad] * (1 + n), [options.rate_std_rad_s] * (1 + n)
    return [options.position_std_m] * 2 + angles + [options.velocity_std_m_s] * 2 + rates


def measured(sides: tuple[str, ...], hitch_m: float, coupled: bool) -> Measures:
    """Of a train with its hitches somewhere."""
    robot = trains.scenario_of(sides, 1.9, "truth", 0.0, hitch_m).robot
    outside = tuple(side == "outside" for side in sides)
    poles = circling(robot, outside, RADIUS_M).poles(robot, RATE_RAD_S)
    train = turning(robot, outside)
    reach_m = controllability(train, robot.trailers[-1].swing_length_m)
    return Measures(float(poles.real.max()), 1e3 * reach_m, 1e3 * error(train, coupled))


def draw(rows: dict[str, list[Measures]], flat_m: float, path: Path) -> None:
    """Three panels over d, a line for every train."""
    titles = (
        "fastest unstable pole [1/s]",
        "controllability in 1 s [mm]",
        "error of F with the camera's noise [mm]",
    )
    with canvas((12.0, 4.6)) as figure:
        panels = figure.subplots(1, 3)
        for i, (axes, title) in enumerate(zip(panels, titles, strict=True)):
            for name, measures in rows.items():
                axes.plot(1e3 * HITCH_M, [m[i] for m in measures], label=name, linewidth=1.8)
            for place, word in ((flat_m, "flat"), (SHIPPED_M, "shipped")):
                axes.axvline(1e3 * place, color="#9a948c", linewidth=1.0, linestyle=":", zorder=0)
                where = axes.get_xaxis_transform()
                axes.text(1e3 * place, 1.01, word, transform=where, ha="center", fontsize=9)
            axes.set_title(title, pad=18)
            axes.set_xlabel("hitch behind the one before, d [mm]")
        panels[1].set_yscale("log")
        panels[2].set_ylim(bottom=0.0)
        handles, names = panels[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=5, frameon=False)
        save(figure, path)


def main() -> None:
    """Measure and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("docs/images/train_hitch.png"))
    parser.add_argument("--coupled", action="store_true", help="one Kalman gain for all trailers")
    args = parser.parse_args()
    rows = {
        name: [measured(sides, float(d), args.coupled) for d in HITCH_M]
        for name, (sides, _) in trains.CASES.items()
    }
    robot = trains.scenario_of(("inside", "inside"), 1.9, "truth", 0.0).robot
    draw(rows, robot.trailers[-1].swing_length_m, args.out)
    table = {name: np.round(measures, 4).tolist() for name, measures in rows.items()}
    print(json.dumps({"d_m": np.round(HITCH_M, 3).tolist(), **table}))


if __name__ == "__main__":
    main()
