"""The sampled closed loop, while it runs: observe, command, record, advance."""

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Literal

import numpy as np

from ttwmr_mj.controllers.base import Command, Controller, Task
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.base import Plant
from ttwmr_mj.results.trajectory import Trajectory, column_names
from ttwmr_mj.runs.actuation import Actuation
from ttwmr_mj.runs.deadline import Deadline, Overrun
from ttwmr_mj.runs.pace import Pace
from ttwmr_mj.runs.pushes import Push, forces
from ttwmr_mj.runs.stopwatch import Stopwatch
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.sensing import Estimate, Sensor
from ttwmr_mj.state import BoolArray, RobotState

Status = Literal["ok", "diverged", "failed", "interrupted"]
Report = Callable[[Trajectory], None]
ESCAPE = 1e4  # m or rad: no scenario may start or lead that far, so the run has diverged
TORQUE_SIGNALS = ("wheel_torque_right_n_m", "wheel_torque_left_n_m")
SIGNAL_NAME = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True, slots=True)
class Outcome:
    """How one simulation ended.

    Attributes:
        status: "ok", "diverged" (the state left all bounds), "failed" (physics or the controller
            failed, or the controller timed out), "interrupted" (Ctrl-C).
        reason: why, in words; empty when ok.
        time_s: simulated time at the end.
        cause: the exception behind it, if there is one.
    """

    status: Status
    reason: str
    time_s: float
    cause: BaseException | None = None


@dataclass(slots=True)
class Loop:
    """One run under way.

    Attributes:
        scenario: what is run.
        plant, sensor: ready at the first sample.
        controller: not yet started.
        rows: blank but for times and reference; filled in place.
        report: called with the rows that are new, now and then and once with the last ones.
        actuation: the commands' way to the plant.
        pushes: what disturbs it.
        pace: how fast it goes, how often it reports, and whether it goes on.
        ends: how simulations ended, as far as they have.
        done: rows filled so far.
        control_time_s: wall time of every command, the whole batch's.
        watch: wall time by part: "plant", "sensing", "controller", "loop", "report", "pace".
    """

    scenario: Scenario
    plant: Plant
    sensor: Sensor
    controller: Controller
    rows: Trajectory
    report: Report | None
    actuation: Actuation
    pushes: tuple[Push, ...]
    pace: Pace = field(default_factory=Pace)
    ends: dict[int, Outcome] = field(default_factory=dict)
    done: int = 0
    control_time_s: list[float] = field(default_factory=list)
    watch: Stopwatch = field(default_factory=Stopwatch)
    _reported: int = 0
    _last_report_s: float = field(default_factory=perf_counter)

    def run(self, task: Task) -> None:
        """From the first sample to the last, or to where everything has ended.

        Raises:
            InputError: from the controller's start.
        """
        period = self.scenario.control.sampling_time_s
        # a batch asks for as many answers at once
        limit_s = self.plant.nsim * self.scenario.control.controller_time_limit_s
        deadline = Deadline(limit_s)
        self._start(task)
        deadline.arm()
        try:
            for k in range(self.scenario.periods + 1):
                if not self._hold(k * period):
                    break
                truth = self._look(k)
                if len(self.ends) == self.plant.nsim:
                    break
                command = self._ask(k, truth, deadline)
                if command is None:
                    break
                self._advance(k, command)
        except KeyboardInterrupt:
            time_s = max(self.done - 1, 0) * period
            self._end_all(Outcome("interrupted", "stopped by the user", time_s))
        finally:
            deadline.disarm()
            self.sensor.close()
        self.watch.lap("loop")
        if self.report:
            self.report(self.rows.rows(self._reported, self.done))
        self.watch.lap("report")
        self._end_all(Outcome("ok", "", max(self.done - 1, 0) * period))

    def _start(self, task: Task) -> None:
        """Start the controller; if that breaks, all simulations end before their first command."""
        try:
            self.controller.start(task)
        except InputError:
            raise
        except (Exception, SystemExit) as error:  # a controller of the user's may raise anything
            reason = f"controller.start() raised {type(error).__name__}: {error}"
            self._end_all(Outcome("failed", reason, 0.0, error))

    def _hold(self, time_s: float) -> bool:
        """Keep the pace; whether the run goes on."""
        self.watch.lap("loop")
        goes_on = self.pace.hold(time_s)
        self.watch.lap("pace")
        return goes_on

    def _look(self, k: int) -> RobotState:
        """Record the truth at sample k, and who has ended."""
        rows, plant = self.rows, self.plant
        truth = plant.state()
        rows.q[k], rows.q_rate[k] = truth.q, truth.q_rate
        rows.wheel_speed_rad_s[k] = plant.wheel_speed_rad_s()
        rows.joint_positions[k] = plant.joint_positions()
        rows.contact_readings[k] = plant.contact_readings()
        self.done = k + 1
        failed = plant.failed()
        if failed.any() or not np.abs(truth.q).max() <= ESCAPE:
            self._end_some(truth, failed, k * self.scenario.control.sampling_time_s)
        return truth

    def _ask(self, k: int, truth: RobotState, deadline: Deadline) -> Command | None:
        """The controller's command at sample k, recorded; None where it broke."""
        watch, rows = self.watch, self.rows
        watch.lap("loop")
        estimate = self.sensor.observe(truth)
        if self.scenario.control.torque_input:
            estimate = replace(estimate, wheel_angle_rad=self.plant.encoder_angle_rad())
        asked = watch.lap("sensing")
        try:
            with deadline:
                command = self.controller.command(k, estimate)
            if self.scenario.control.torque_input:
                command = _with_torques_logged(command, self.plant.nsim)
            self._check(command)
            self.sensor.commanded(command.wheel_speed_rad_s)
        except (Exception, SystemExit, Overrun) as error:
            time_s = k * self.scenario.control.sampling_time_s
            reason = _broken(error, time_s, deadline.limit_s)
            self._end_all(Outcome("failed", reason, time_s, error))
            return None
        self.control_time_s.append(watch.lap("controller") - asked)
        _record_estimate(rows, k, estimate)
        rows.wheel_command_rad_s[k] = command.wheel_speed_rad_s
        rows.saturated[k], rows.near_singular[k] = command.saturated, command.near_singular
        for name, values in command.signals.items():
            rows.signals[name][k] = values
        watch.lap("loop")
        return command

    def _advance(self, k: int, command: Command) -> None:
        """Hold the command until the next sample, if there is one; and report now and then."""
        scenario, plant = self.scenario, self.plant
        if k < scenario.periods:
            if self.pushes:
                plant.push(forces(self.pushes, k * scenario.control.sampling_time_s))
            torque = command.wheel_torque_n_m if scenario.control.torque_input else None
            self.actuation.drive(plant, command.wheel_speed_rad_s if torque is None else torque)
        now = self.watch.lap("plant")
        if self.report and now - self._last_report_s > self.pace.report_every_s:
            self.report(self.rows.rows(self._reported, self.done))
            self._reported, self._last_report_s = self.done, self.watch.lap("report")

    def _check(self, command: Command) -> None:
        """A controller's answer must be finite wheel speeds of the right shape, and its signals."""
        wheels, nsim = command.wheel_speed_rad_s, self.plant.nsim
        if np.shape(wheels) != (nsim, 2):
            raise ValueError(f"wheel speeds have shape {np.shape(wheels)}, allowed: ({nsim}, 2)")
        if not math.isfinite(wheels.sum()):  # one number shows a NaN or infinity in any
            raise ValueError(f"wheel speeds are not finite: {wheels.tolist()}")
        signals = self.rows.signals
        if not self.control_time_s:  # the first command says which signals there are
            self._make_room(command.signals)
        if command.signals.keys() != signals.keys():
            raise ValueError(
                f"the signals are {sorted(command.signals)}; at the first sample they were "
                f"{sorted(signals)}, and they must stay the same"
            )
        for name, values in command.signals.items():
            if np.shape(values) != (nsim,):
                raise ValueError(f"signal {name} has shape {np.shape(values)}, allowed: ({nsim},)")

    def _make_room(self, names: Iterable[str]) -> None:
        """Blank rows for signals of these names."""
        taken = column_names(self.rows.q.shape[-1])
        for name in names:
            if not SIGNAL_NAME.fullmatch(name) or name in taken:
                raise ValueError(
                    f"a signal is called {name!r}; allowed: lower-case letters, digits and _, "
                    "with the unit at the end, and no name of another column"
                )
            self.rows.signals[name] = np.full((len(self.rows), self.plant.nsim), np.nan)

    def _end_some(self, truth: RobotState, failed: BoolArray, time_s: float) -> None:
        """Note how simulations ended whose physics failed or whose state left all bounds."""
        escaped = np.abs(truth.q).max(axis=1) > ESCAPE
        for i in map(int, np.flatnonzero(failed | escaped)):
            if failed[i]:
                end = Outcome("failed", f"the physics failed: {self.plant.fault(i)}", time_s)
            else:
                reason = f"the state diverged beyond {ESCAPE:g} m or {ESCAPE:g} rad"
                end = Outcome("diverged", reason, time_s)
            self.ends.setdefault(i, end)

    def _end_all(self, outcome: Outcome) -> None:
        """The same end for every simulation that has none yet."""
        for i in range(self.plant.nsim):
            self.ends.setdefault(i, outcome)


def _with_torques_logged(command: Command, nsim: int) -> Command:
    """The command of a controller that must give wheel torques, these among its signals."""
    torque = command.wheel_torque_n_m
    if torque is None:
        raise ValueError("there are no wheel torques, which control.inner_loop = 'torque' needs")
    if np.shape(torque) != (nsim, 2):
        raise ValueError(f"wheel torques have shape {np.shape(torque)}, allowed: ({nsim}, 2)")
    if not math.isfinite(torque.sum()):
        raise ValueError(f"wheel torques are not finite: {torque.tolist()}")
    columns = dict(zip(TORQUE_SIGNALS, torque.T, strict=True))
    return replace(command, signals={**command.signals, **columns})


def _record_estimate(rows: Trajectory, k: int, estimate: Estimate) -> None:
    rows.est_q[k], rows.est_q_rate[k] = estimate.state.q, estimate.state.q_rate
    rows.est_valid[k] = estimate.valid
    age = estimate.measurement_age_s
    rows.measurement_age_s[k] = estimate.age_s if age is None else age
    rows.labels_found[k] = estimate.labels_found


def _broken(error: BaseException, time_s: float, limit_s: float) -> str:
    """Why a controller gave no command, in words."""
    if not isinstance(error, Overrun):
        return f"controller.command() raised {type(error).__name__}: {error}"
    return (
        f"the controller timed out after {limit_s:g} s at its sample at t = {time_s:.3f} s "
        "(limit: control.controller_time_limit_s)"
    )
