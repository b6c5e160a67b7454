"""Analytic open-loop rollouts against scipy's `solve_ivp(DOP853)` at equal accuracy, 1e-8.

Two kinds of open-loop input, 12 s each:

- sampled: a new command every 33 ms, as a controller gives them;
- segments: four commands that hold for 3 s each.

Both sides integrate the hybrid model (Eq. 24-29) with the hitch's damper under the same servo
ramps. scipy is asked in two ways, both with scalar arithmetic from `math`, the fastest in Python:

- one call: `solve_ivp` over the whole time, the wheel speeds looked up, as one writes it;
- restarted: a call from kink to kink of the wheel speeds, so that no step crosses one. No faster
  way is known to us.

Its tolerance is the loosest whose final state is within 1e-8 of a restarted one at 1e-13 (or 1e-13
itself, where one call does not get there); so must ours be. All alternate; medians are quoted.
Run it as

    python benchmarks/analytic_speed.py

The last line is JSON.
"""

from __future__ import annotations

import argparse
import bisect
import functools
import json
import math
import statistics
from collections.abc import Callable
from time import perf_counter

import numpy as np
from scipy.integrate import solve_ivp

from ttwmr_mj.plants.rollout import WheelHistory, roll_out, servo_history
from ttwmr_mj.robot import Hitch, RobotParameters, Servo
from ttwmr_mj.state import FloatArray, RobotState

ACCURACY = 1e-8  # m, rad: of the final x, y, θ1, θ2
ROBOT = RobotParameters(hitch=Hitch(damping_n_m_s_rad=1e-3), servo=Servo(preset="fast"))
BATCH = 1000
DURATION_S = 12.0
KNOTS = 3  # per command; our states are wanted at the commands' ends, scipy gives the last alone
TOLERANCES = (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13)
Input = tuple[FloatArray, FloatArray]  # commands (n, nsim, 2), durations (n,)


def sampled(nsim: int, rng: np.random.Generator) -> Input:
    """Commands that wander like a controller's, one every 33 ms."""
    count = round(DURATION_S / 0.033)
    mean, turn = segments(nsim, rng)[0].mean(axis=2), rng.normal(0.0, 0.05, (count, nsim))
    slow = np.repeat(mean, math.ceil(count / len(mean)), axis=0)[:count]
    turn = 0.5 + np.cumsum(turn, axis=0)
    return np.stack([slow + turn, slow - turn], axis=-1), np.full(count, 0.033)


def segments(nsim: int, rng: np.random.Generator) -> Input:
    """Four commands that hold."""
    mean, turn = rng.uniform(8.0, 12.0, (4, nsim)), rng.uniform(-2.0, 2.0, (4, nsim))
    return np.stack([mean + turn, mean - turn], axis=-1), np.full(4, DURATION_S / 4)


def by_scipy(history: WheelHistory, index: int, tolerance: float) -> FloatArray:
    """(4,) final q of one simulation, knot by knot."""
    k = ROBOT.swing_length_m
    damping = ROBOT.hitch.damping_n_m_s_rad / ROBOT.swing_inertia_kg_m2
    radius, track = ROBOT.tractor.wheel_radius_m, ROBOT.tractor.track_width_m
    column = min(index, history.time_s.shape[1] - 1)
    times = history.time_s[:, column].tolist()
    wheels = history.wheel_speed_rad_s[:, index].tolist()
    z = np.zeros(5)
    cos, sin = math.cos, math.sin
    for begin, end, (right, left), (last_right, last_left) in zip(
        times, times[1:], wheels, wheels[1:], strict=False
    ):
        if end <= begin:
            continue
        u1, u2 = 0.5 * radius * (right + left), radius / track * (right - left)
        a1 = (0.5 * radius * (last_right + last_left) - u1) / (end - begin)
        a2 = (radius / track * (last_right - last_left) - u2) / (end - begin)

        def rate(
            t: float,
            z: FloatArray,
            t0: float = begin,
            u1: float = u1,
            u2: float = u2,
            a1: float = a1,
            a2: float = a2,
        ) -> tuple[float, ...]:
            _, _, theta1, theta2, theta2_rate = z.tolist()
            v, w = u1 + a1 * (t - t0), u2 + a2 * (t - t0)
            phi = theta2 - theta1
            swing = (v * w * cos(phi) - a1 * sin(phi)) / k - damping * (theta2_rate - w)
            return v * cos(theta1), v * sin(theta1), w, theta2_rate, swing

        found = solve_ivp(rate, (begin, end), z, "DOP853", rtol=tolerance, atol=tolerance)
        z = found.y[:, -1]
    return z[:4]


def by_one_call(history: WheelHistory, index: int, tolerance: float) -> FloatArray:
    """The same by one call over the whole time."""
    k = ROBOT.swing_length_m
    damping = ROBOT.hitch.damping_n_m_s_rad / ROBOT.swing_inertia_kg_m2
    radius, track = ROBOT.tractor.wheel_radius_m, ROBOT.tractor.track_width_m
    kept = np.flatnonzero(np.diff(history.time_s[:, index], prepend=-1.0) > 0.0)
    times = history.time_s[kept, index].tolist()
    wheels = history.wheel_speed_rad_s[kept, index]
    slopes = (np.diff(wheels, axis=0) / np.diff(times)[:, None]).tolist()
    first = wheels.tolist()

    def rate(t: float, z: FloatArray) -> tuple[float, ...]:
        _, _, theta1, theta2, theta2_rate = z.tolist()
        i = min(bisect.bisect_right(times, t), len(slopes)) - 1
        (right, left), (right_rate, left_rate), since = first[i], slopes[i], t - times[i]
        right, left = right + right_rate * since, left + left_rate * since
        v, w = 0.5 * radius * (right + left), radius / track * (right - left)
        surge, phi = 0.5 * radius * (right_rate + left_rate), theta2 - theta1
        swing = (v * w * math.cos(phi) - surge * math.sin(phi)) / k - damping * (theta2_rate - w)
        return v * math.cos(theta1), v * math.sin(theta1), w, theta2_rate, swing

    span, start = (times[0], times[-1]), np.zeros(5)
    found = solve_ivp(rate, span, start, "DOP853", rtol=tolerance, atol=tolerance)
    return np.asarray(found.y[:4, -1])


Solver = Callable[[WheelHistory, int, float], FloatArray]


def loosest(solve: Solver, history: WheelHistory, truth: FloatArray) -> tuple[float, float]:
    """The loosest tolerance of a way to use scipy that is accurate, and its error."""
    for tolerance in TOLERANCES:
        error = float(np.abs(solve(history, 0, tolerance) - truth).max())
        if error <= ACCURACY:
            return tolerance, error
    return tolerance, error  # the tightest, where none is enough


def seconds(call: Callable[[], object]) -> float:
    started = perf_counter()
    call()
    return perf_counter() - started


def measure(
    name: str, make: Callable[[int, np.random.Generator], Input], rounds: int
) -> dict[str, float]:
    """One kind of input: times per simulation and their ratios."""
    rng = np.random.default_rng(0)

    def prepare(nsim: int) -> tuple[RobotState, Input, WheelHistory]:
        commands = make(nsim, rng)
        history = servo_history(np.zeros((nsim, 2)), *commands, ROBOT.servo)
        return RobotState.at_rest(0.0, 0.0, 0.0, 0.0, nsim), commands, history

    start, _, history = prepare(1)
    truth = by_scipy(history, 0, 1e-13)
    ways: dict[str, Solver] = {"one_call": by_one_call, "restarted": by_scipy}
    accurate = {way: loosest(solve, history, truth) for way, solve in ways.items()}
    many_start, _, many = prepare(BATCH)
    error = float(np.abs(roll_out(ROBOT, start, history, KNOTS)[0][-1, 0] - truth).max())
    ends = roll_out(ROBOT, many_start, many, KNOTS)[0][-1]
    batch_error = max(float(np.abs(ends[i] - by_scipy(many, i, 1e-13)).max()) for i in range(3))
    times: dict[str, list[float]] = {name: [] for name in (*ways, "one", "batch")}
    for _ in range(rounds):
        for way, solve in ways.items():
            wait = functools.partial(solve, history, 0, accurate[way][0])
            times[way].append(seconds(wait))
        for _ in range(5):  # each of another input: nothing that was kept may help
            _, _, unseen = prepare(1)
            one = functools.partial(roll_out, ROBOT, start, unseen, KNOTS)
            times["one"].append(seconds(one))
        batch = functools.partial(roll_out, ROBOT, many_start, many, KNOTS)
        times["batch"].append(seconds(batch) / BATCH)
    median = {key: statistics.median(values) for key, values in times.items()}
    result = {f"{key}_s": value for key, value in median.items()}
    result |= {"one_error": error, "batch_error": batch_error}
    print(name)
    for key, shown in (("one", error), ("batch", batch_error)):
        print(f"  {key:6s} {1e3 * median[key]:8.4f} ms per simulation, error {shown:.1e}")
        for way in ways:
            factor = median[way] / median[key]
            result[f"{key}_times_faster_than_{way}"] = factor
            took, missed = 1e3 * median[way], accurate[way][1]
            print(f"    {factor:7.1f} × DOP853, {way} ({took:.3g} ms, error {missed:.1e})")
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7, help="measurements of each")
    rounds = parser.parse_args().rounds
    kinds = {"sampled": sampled, "segments": segments}
    print(json.dumps({name: measure(name, make, rounds) for name, make in kinds.items()}))


if __name__ == "__main__":
    main()
