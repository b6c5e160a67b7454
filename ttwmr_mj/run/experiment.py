"""The sampled closed loop: observe, command, record, advance."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Literal

import numpy as np

from ttwmr_mj.controllers.base import Command, Task
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.base import Plant
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.run import build
from ttwmr_mj.run.deadline import Deadline, Overrun
from ttwmr_mj.run.stopwatch import Stopwatch
from ttwmr_mj.scenario.schema import Push, Scenario
from ttwmr_mj.sensing import Sensor
from ttwmr_mj.state import BoolArray, FloatArray, RobotState

Status = Literal["ok", "diverged", "failed", "interrupted"]
ESCAPE = 1e4  # m or rad: no scenario may start or lead that far, so the run has diverged
REPORT_EVERY_S = 0.5  # wall time between two reports, so that a kill costs less than a second


@dataclass(frozen=True, slots=True)
class Outcome:
    """How one simulation ended.

    Attributes:
        status: "ok", "diverged" (the state left all bounds), "failed" (physics or the controller
            broke, or the controller took too long), "interrupted" (Ctrl-C).
        reason: why, in words; empty when ok.
        time_s: simulated time at the end.
        cause: the exception behind it, if there is one.
    """

    status: Status
    reason: str
    time_s: float
    cause: BaseException | None = None


@dataclass(frozen=True, slots=True)
class Result:
    """A finished run.

    Attributes:
        trajectory: one row per control sample, up to the last one that any simulation reached;
            a simulation's rows after its end repeat nothing and are NaN.
        outcomes: how each simulation ended.
        wall_time_s: wall time by part of the loop: "plant", "sensing", "controller", "loop"
            (bookkeeping), "report".
        control_time_s: (n,) wall time of every command, the whole batch's.
    """

    trajectory: Trajectory
    outcomes: tuple[Outcome, ...]
    wall_time_s: dict[str, float]
    control_time_s: FloatArray


Report = Callable[[Trajectory], None]


class Experiment:
    """One scenario made ready to run: reference, plant and controller.

    Attributes:
        scenario: what to run.
        nsim: simulations in the batch; they differ by their sensor noise only.
        reference: the sampled reference, or None.
        plant: the plant, reset at every run.
        sensor: made anew at every run; None before the first.
    """

    def __init__(self, scenario: Scenario, folder: Path | None = None, nsim: int = 1) -> None:
        self.scenario = scenario
        self.nsim = nsim
        self.reference: ReferencePath | None = build.sample_reference(scenario)
        self.plant: Plant = build.make_plant(scenario, nsim)
        self.sensor: Sensor | None = None
        self._folder = folder or Path()
        self._controller = build.make_controller(scenario, self.reference, self._folder)

    def run(self, report: Report | None = None, initial: RobotState | None = None) -> Result:
        """Run from the initial state to the end, or to where it breaks.

        Args:
            initial: where every simulation starts; None: where the scenario says, all of them.
            report: called with the rows that are new, at most every REPORT_EVERY_S of wall time,
                and once with the last ones.

        Raises:
            InputError: the controller cannot follow this reference.
        """
        scenario, plant, nsim = self.scenario, self.plant, self.nsim
        period = scenario.control.sampling_time_s
        steps = scenario.steps_per_period
        rng = build.generators(scenario.seed, ("sensor", "controller"))
        self.sensor = build.make_sensor(scenario, plant, rng["sensor"], self._folder)
        sensor = self.sensor
        if report:
            sensor.keep_log()
        plant.reset(initial or build.initial_state(scenario, self.reference, nsim))
        stillborn = self._start(
            Task(scenario.believed_robot, self.reference, period, nsim, rng["controller"])
        )
        rows = self._blank_rows()
        ends: dict[int, Outcome] = {}
        done, reported = 0, 0
        control_time_s: list[float] = []
        watch = Stopwatch()
        last_report = perf_counter()
        if stillborn:
            _end_all(ends, nsim, stillborn)
        # a batch asks for as many answers at once
        deadline = Deadline(nsim * scenario.control.controller_time_limit_s)
        deadline.arm()
        try:
            for k in range(scenario.periods + 1):
                truth = plant.state()
                rows.q[k], rows.q_rate[k] = truth.q, truth.q_rate
                rows.wheel_speed_rad_s[k] = plant.wheel_speed_rad_s()
                rows.joint_positions[k] = plant.joint_positions()
                rows.contact_readings[k] = plant.contact_readings()
                done = k + 1
                failed = plant.failed()
                if failed.any() or not np.abs(truth.q).max() <= ESCAPE:
                    _end(ends, truth, failed, plant, k * period)
                if len(ends) == nsim:
                    break
                watch.lap("loop")
                estimate = sensor.observe(truth)
                asked = watch.lap("sensing")
                try:
                    with deadline:
                        command = self._controller.command(k, estimate)
                    _check(command, nsim)
                    sensor.commanded(command.wheel_speed_rad_s)
                except (Exception, SystemExit, Overrun) as error:
                    reason = _broken(error, k * period, deadline.limit_s)
                    _end_all(ends, nsim, Outcome("failed", reason, k * period, error))
                    break
                control_time_s.append(watch.lap("controller") - asked)
                rows.est_q[k], rows.est_q_rate[k] = estimate.state.q, estimate.state.q_rate
                rows.est_valid[k] = estimate.valid
                age = estimate.measurement_age_s
                rows.measurement_age_s[k] = estimate.age_s if age is None else age
                rows.labels_found[k] = estimate.labels_found
                rows.wheel_command_rad_s[k] = command.wheel_speed_rad_s
                rows.saturated[k], rows.near_singular[k] = command.saturated, command.near_singular
                watch.lap("loop")
                if k < scenario.periods:
                    if scenario.plant.pushes:
                        plant.push(_forces(scenario.plant.pushes, k * period))
                    plant.advance(command.wheel_speed_rad_s, steps)
                now = watch.lap("plant")
                if report and now - last_report > REPORT_EVERY_S:
                    report(rows.rows(reported, done))
                    reported, last_report = done, watch.lap("report")
        except KeyboardInterrupt:
            reason = "stopped by the user"
            _end_all(ends, nsim, Outcome("interrupted", reason, max(done - 1, 0) * period))
        finally:
            deadline.disarm()
            sensor.close()
        watch.lap("loop")
        if report:
            report(rows.rows(reported, done))
        watch.lap("report")
        _end_all(ends, nsim, Outcome("ok", "", scenario.periods * period))
        trajectory = rows.rows(0, done)
        return Result(
            trajectory=trajectory,
            outcomes=tuple(ends[i] for i in range(nsim)),
            wall_time_s=dict(watch.parts),
            control_time_s=np.array(control_time_s),
        )

    def _start(self, task: Task) -> Outcome | None:
        """Start the controller; how the run ends already if that breaks."""
        try:
            self._controller.start(task)
        except InputError:
            raise
        except (Exception, SystemExit) as error:  # a controller of the user's may raise anything
            return Outcome("failed", f"at its start {_raised(error)}", 0.0, error)
        return None

    def _blank_rows(self) -> Trajectory:
        """Rows for the whole run with times and reference filled in."""
        count = self.scenario.periods + 1
        time_s = self.scenario.control.sampling_time_s * np.arange(count, dtype=np.float64)
        nq = self.plant.joint_positions().shape[-1]
        ncontact = self.plant.contact_readings().shape[1]
        rows = Trajectory.empty(
            time_s, self.nsim, nq, ncontact, trailers=len(self.scenario.robot.trailers)
        )
        if self.reference is not None:
            rows.ref_q[:] = self.reference.q[:count]
            rows.ref_q_rate[:] = self.reference.q_rate[:count]
        return rows


def _end(
    ends: dict[int, Outcome], truth: RobotState, failed: BoolArray, plant: Plant, time_s: float
) -> None:
    """Note how simulations ended whose physics failed or whose state left all bounds."""
    escaped = np.abs(truth.q).max(axis=1) > ESCAPE
    for i in map(int, np.flatnonzero(failed | escaped)):
        if failed[i]:
            ends.setdefault(i, Outcome("failed", f"the physics broke: {plant.fault(i)}", time_s))
        else:
            reason = f"the state left all bounds, {ESCAPE:g} m and {ESCAPE:g} rad"
            ends.setdefault(i, Outcome("diverged", reason, time_s))


def _forces(pushes: tuple[Push, ...], time_s: float) -> dict[str, FloatArray]:
    """Half → (2,) sum of the pushes that act in the control period that starts now."""
    forces: dict[str, FloatArray] = {}
    for push in pushes:
        # a hair early, so that a start at a sample belongs to its period
        if push.start_s - 1e-9 <= time_s < push.start_s + push.duration_s - 1e-9:
            forces[push.on] = forces.get(push.on, 0.0) + np.array(push.force_n)
    return forces


def _end_all(ends: dict[int, Outcome], nsim: int, outcome: Outcome) -> None:
    """The same end for every simulation that has none yet."""
    for i in range(nsim):
        ends.setdefault(i, outcome)


def _raised(error: BaseException) -> str:
    return f"the controller raised {type(error).__name__}: {error}"


def _broken(error: BaseException, time_s: float, limit_s: float) -> str:
    """Why a controller gave no command, in words."""
    if not isinstance(error, Overrun):
        return _raised(error)
    return (
        f"the controller took longer than {limit_s:g} s for its sample at t = {time_s:.3f} s "
        "(limit: control.controller_time_limit_s)"
    )


def _check(command: Command, nsim: int) -> None:
    """A controller's answer must be finite wheel speeds of the right shape."""
    wheels = command.wheel_speed_rad_s
    if np.shape(wheels) != (nsim, 2):
        raise ValueError(f"wheel speeds have shape {np.shape(wheels)}, allowed: ({nsim}, 2)")
    if not math.isfinite(wheels.sum()):  # one number shows a NaN or infinity in any
        raise ValueError(f"wheel speeds are not finite: {wheels.tolist()}")
