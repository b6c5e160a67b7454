"""A sampled closed loop on a circle, linearised in the frame that turns with the reference.

In that frame the loop of plant, channels, observer and law is the same at every sample: x ↦ f(x),
x holding the states of all of them and what is under way between them. f is smooth where nothing
saturates, and its linear part A at the fixed point decides: stable if and only if all eigenvalues
of A lie inside the unit circle. Laws and observers keep their states to themselves. So A is not
written down but realised from responses (Ho and Kalman): the loop is run to its fixed point, the
plant's pose and speeds are displaced by DISPLACEMENT, one at a time, forth in one run and back in
another, and half the differences of the plant's state, turned into the frame, are

    Y_k = C·A^k·B,    H = [Y_(i+j)] = O·R,    H' = [Y_(i+j+1)] = O·A·R,

with O and R the observability and reachability matrices. On H's singular vectors U, S, V the matrix
S^(-1/2)·Uᵀ·H'·V·S^(-1/2) is A up to a change of coordinates, restricted to what a displaced plant
moves and what the plant shows: what matters.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ttwmr_mj.controllers.base import Controller, Task
from ttwmr_mj.dynamics.kinematics import q_rate, to_body, workspace_rate
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.runs import build
from ttwmr_mj.runs.closed_loop.actuation import Actuation
from ttwmr_mj.scenario.motion import believed_reference, initial_state, sample_reference
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.sensing import Sensor
from ttwmr_mj.state import FloatArray, RobotState

DISPLACED = 7  # x, y, θ1, θ2, u1, u2, θ̇2
DISPLACEMENT = 1e-5  # m, rad, m/s and rad/s: rounding is 1e-11 of it, third derivatives 1e-10
FADE = 120  # periods, 4 s, after which fast modes are gone: fewer poles to tell apart
BLOCKS, STRIDE = 12, 3  # H has so many rows and columns, so many periods apart: 2.4 s in all
NOISE = 1e-5  # singular values below this share of the largest are modes that faded
ROUNDING = 1e-6  # and those below this are rounding: 1e-9 of each of the 8000 numbers in H
TRACTOR = (0, 1, 2, 4, 5, 6)  # differences that say nothing of the trailer
TAIL_S = 20.0  # before the end, gains of recursions that run backwards from it are not yet steady
STEADY = 1e-3  # m, rad, m/s and rad/s: a loop that moves by more at its fixed point has left it
# At the fixed point speeds are constant, so a displaced command is reached at once: a ramp would
# only add its square.
NO_RAMPS = "robot.servo.acceleration_limit_rad_s2=1e5"


class Loop:
    """Plant, sensor, law and channels of a scenario, ready at the first sample, a period a call."""

    def __init__(self, scenario: Scenario, nsim: int) -> None:
        """Start on the reference; the sensor must have no noise."""
        reference, told = sample_reference(scenario), believed_reference(scenario)
        assert reference is not None
        rng = build.generators(scenario.seed, ("sensor", "controller", "commands"))
        plant = build.make_plant(scenario, nsim)
        assert isinstance(plant, AnalyticPlant)
        self.plant: AnalyticPlant = plant
        self._sensor: Sensor = build.make_sensor(scenario, plant, [rng["sensor"]] * nsim, Path())
        self._law: Controller = build.make_controller(scenario, Path())
        self._actuation = Actuation(
            scenario.control, scenario.steps_per_period, rng["commands"].spawn(nsim)
        )
        plant.reset(initial_state(scenario, reference, nsim))
        task = Task(
            scenario.believed_robot,
            told,
            scenario.control.sampling_time_s,
            nsim,
            rng["controller"],
            scenario.believed_ground,
            scenario.believed_command_latency_s,
        )
        self._law.start(task)
        self._reference, self.k = reference, 0

    def step(self) -> None:
        """One control period."""
        command = self._law.command(self.k, self._sensor.observe(self.plant.state()))
        self._sensor.commanded(command.wheel_speed_rad_s)
        self._actuation.drive(self.plant, command.wheel_speed_rad_s)
        self.k += 1

    def errors(self) -> FloatArray:
        """(nsim, 8) of q and its rate, in the turning frame."""
        state, k = self.plant.state(), self.k
        parts = [state.q - self._reference.q[k], state.q_rate - self._reference.q_rate[k]]
        for part in parts:
            part[:, :2] = np.column_stack(
                to_body(self._reference.theta1_rad[k], part[:, 0], part[:, 1])
            )
        return np.concatenate(parts, axis=1)


def displaced(state: RobotState) -> RobotState:
    """All simulations as the first, but displaced in one number each: forth, then back."""
    q = np.repeat(state.q[:1], 2 * DISPLACED, axis=0)
    rate = np.repeat(workspace_rate(state.q, state.q_rate)[:1], 2 * DISPLACED, axis=0)
    by = DISPLACEMENT * np.concatenate([np.eye(DISPLACED), -np.eye(DISPLACED)])
    return RobotState(q=q + by[:, :4], q_rate=q_rate(q + by[:, :4], rate + by[:, 4:]))


def responses(scenario: Scenario, settle: int, follow: int, trailer: bool) -> FloatArray | None:
    """(follow, 8 or 6, 7) to what was displaced at sample `settle`, a period apart.

    None: the loop was not at its fixed point then.
    """
    loop = Loop(scenario, 2 * DISPLACED)
    last: list[FloatArray] = []
    seen = slice(None) if trailer else list(TRACTOR)
    for _ in range(settle):
        loop.step()
        last = [*last[1 - FADE :], loop.errors()[0, seen]]
    if not np.nan_to_num(np.ptp(last, axis=0), nan=np.inf).max() < STEADY:
        return None
    loop.plant.reset(displaced(loop.plant.state()))
    found = []
    for _ in range(follow):
        forth, back = np.split(loop.errors(), 2)
        found.append(0.5 / DISPLACEMENT * (forth - back)[:, seen].T)
        loop.step()
    return np.array(found)


def realised(y: FloatArray) -> FloatArray:
    """(n, n) A of Y_k = C·A^k·B (2·BLOCKS, outputs, inputs), in coordinates of its own."""
    now, after = (
        np.block([[y[i + j + later] for j in range(BLOCKS)] for i in range(BLOCKS)])
        for later in (0, 1)
    )
    left, size, right = np.linalg.svd(now, full_matrices=False)
    n = int((size > max(NOISE * size[0], ROUNDING)).sum())
    root = np.sqrt(size[:n])
    return np.asarray((left[:, :n] / root).T @ after @ (right[:n].T / root))


def moduli(scenario: Scenario, settle_s: float, *, trailer: bool = True) -> FloatArray:
    """Of the eigenvalues that have not faded, per period, the largest first.

    Args:
        scenario: on a circle, on the analytic plant, with NO_RAMPS; lasts `needed_s` or longer.
        settle_s: time in which the loop comes to its fixed point.
        trailer: False: of the tractor alone, which moves as if there were no trailer.
    """
    settle = round(settle_s / scenario.control.sampling_time_s)
    y = responses(scenario, settle, FADE + 2 * BLOCKS * STRIDE, trailer)
    if y is None:
        return np.array([math.inf])
    strides = np.linalg.eigvals(realised(y[FADE::STRIDE]))
    return np.asarray(np.sort(np.abs(strides))[::-1] ** (1.0 / STRIDE))


def needed_s(settle_s: float, period_s: float) -> float:
    """How long the scenario must last [s]."""
    return settle_s + (FADE + 2 * BLOCKS * STRIDE) * period_s + TAIL_S
