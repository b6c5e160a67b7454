"""The analytic plant against scipy's `solve_ivp(DOP853)` under known commands.

12 s of commands, a new one every 33 ms, as a controller gives them. Both sides integrate the hybrid
model (Eq. 24-29) with the hitch's damper under the same servo ramps. scipy gets scalar arithmetic
from `math`, the fastest in Python, and is restarted at every kink of the wheel speeds, so that no
step crosses one; no faster way is known to us. It makes each stretch in one step, whatever the
tolerance, and is the truth for the plant's error. All alternate; medians are quoted. Run it as

    python benchmarks/analytic_speed.py

The last line is JSON.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
from collections.abc import Callable
from time import perf_counter

import numpy as np
from scipy.integrate import solve_ivp

from ttwmr_mj.dynamics.servo import cut, ramp
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.robot import Hitch, RobotParameters, Servo
from ttwmr_mj.state import FloatArray

ROBOT = RobotParameters(hitch=Hitch(damping_n_m_s_rad=1e-3), servo=Servo(preset="fast"))
BATCH = 1000
PERIOD_S, PERIODS = 0.033, 364
LONGEST_S = 0.011  # the plant's default
TOLERANCE = 1e-6


def sampled(nsim: int, rng: np.random.Generator) -> FloatArray:
    """(periods, nsim, 2) commands that wander like a controller's."""
    slow = np.repeat(rng.uniform(8.0, 12.0, (4, nsim)), PERIODS // 4, axis=0)
    turn = 0.5 + np.cumsum(rng.normal(0.0, 0.05, (PERIODS, nsim)), axis=0)
    return np.stack([slow + turn, slow - turn], axis=-1)


def by_plant(commands: FloatArray) -> FloatArray:
    """(nsim, 4) final q."""
    plant = AnalyticPlant(ROBOT, commands.shape[1], PERIOD_S, LONGEST_S)
    for command in commands:
        plant.advance(command, 1)
    return plant.state().q


def by_scipy(commands: FloatArray) -> FloatArray:
    """(4,) final q of the first simulation, stretch by stretch."""
    k, inertia = ROBOT.swing_length_m, ROBOT.swing_inertia_kg_m2
    damping = ROBOT.hitch.damping_n_m_s_rad / inertia
    radius, track = ROBOT.tractor.wheel_radius_m, ROBOT.tractor.track_width_m
    cos, sin = math.cos, math.sin
    z, wheels = np.zeros(5), np.zeros((1, 2))

    def rate(
        t: float, z: FloatArray, u1: float, u2: float, a1: float, a2: float
    ) -> tuple[float, ...]:
        _, _, theta1, theta2, theta2_rate = z.tolist()
        v, w = u1 + a1 * t, u2 + a2 * t
        phi = theta2 - theta1
        swing = (v * w * cos(phi) - a1 * sin(phi)) / k - damping * (theta2_rate - w)
        return v * cos(theta1), v * sin(theta1), w, theta2_rate, swing

    for command in commands[:, :1]:
        stretches = cut(wheels, command, ROBOT.servo, PERIOD_S, PERIOD_S).lasting
        for duration, speed, change, _ in zip(*stretches, strict=True):
            (right, left), (right_rate, left_rate) = speed[0].tolist(), change[0].tolist()
            extra = (
                0.5 * radius * (right + left),
                radius / track * (right - left),
                0.5 * radius * (right_rate + left_rate),
                radius / track * (right_rate - left_rate),
            )
            span = (0.0, float(duration[0]))
            found = solve_ivp(rate, span, z, "DOP853", args=extra, rtol=TOLERANCE, atol=TOLERANCE)
            z = found.y[:, -1]
        wheels = ramp(wheels, command, ROBOT.servo, np.array([PERIOD_S]))[:, 0]
    return z[:4]


def seconds(call: Callable[[], object]) -> float:
    started = perf_counter()
    call()
    return perf_counter() - started


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7, help="measurements of each")
    rounds = parser.parse_args().rounds
    rng = np.random.default_rng(0)
    one, many = sampled(1, rng), sampled(BATCH, rng)
    error = float(np.abs(by_plant(one)[0] - by_scipy(one)).max())
    times: dict[str, list[float]] = {"scipy": [], "one": [], "batch": []}
    for _ in range(rounds):
        times["scipy"].append(seconds(lambda: by_scipy(one)))
        times["one"].append(seconds(lambda: by_plant(one)))
        times["batch"].append(seconds(lambda: by_plant(many)) / BATCH)
    median = {key: statistics.median(values) for key, values in times.items()}
    print(f"scipy  {1e3 * median['scipy']:8.3f} ms per simulation")
    for key in ("one", "batch"):
        factor = median["scipy"] / median[key]
        print(f"{key:6s} {1e3 * median[key]:8.3f} ms per simulation, {error=:.1e}, {factor:.0f} ×")
    print(json.dumps({f"{k}_s": v for k, v in median.items()} | {"error": error}))


if __name__ == "__main__":
    main()
