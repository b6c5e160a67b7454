"""The sampled closed loop, while it runs: observe, command, record, advance."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np

from ttwmr_mj.config import column
from ttwmr_mj.controllers.base import Command
from ttwmr_mj.errors import MachineError, apart
from ttwmr_mj.plants.base import Plant
from ttwmr_mj.plants.footing import FLOWN_M, TIPPED_RAD, Footing
from ttwmr_mj.results.accept import Status
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs.closed_loop.actuation import Actuation
from ttwmr_mj.runs.closed_loop.pace import Pace
from ttwmr_mj.runs.closed_loop.stopwatch import Stopwatch
from ttwmr_mj.runs.law.laws import Broken, Laws
from ttwmr_mj.runs.pushes import Push, forces
from ttwmr_mj.scenario.limits import ESCAPE
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.sensing import Estimate, Sensor
from ttwmr_mj.state import BoolArray, FloatArray, RobotState

Report = Callable[[Trajectory], None]
AT_LIMIT = 1.0 - 1e-12  # a law that scales its command down to the limit rounds
STANCES = 1000  # samples that may wait until their footing is computed, all at once


@dataclass(frozen=True, slots=True)
class Outcome:
    """How one simulation ended.

    Attributes:
        status: "ok", "diverged" (the state left all bounds), "failed" (physics or the controller
            failed, or the controller timed out), "interrupted" (Ctrl-C), "killed" (as is known
            afterwards).
        reason: why, in words; empty when ok.
        time_s: simulated time at the end.
        cause: the exception behind it, if there is one; it stays in its process, as the law's
            module that it is of may not be known to another.
    """

    status: Status
    reason: str
    time_s: float
    cause: BaseException | None = field(default=None, compare=False)

    def __reduce__(self) -> "tuple[type[Outcome], tuple[Status, str, float]]":
        return Outcome, (self.status, self.reason, self.time_s)


@dataclass(slots=True)
class Loop:
    """One run under way, of one simulation or many.

    Attributes:
        scenario: what is run, or those of all simulations (`config.stacked`).
        plant, sensor: ready at the first sample.
        laws: not yet started.
        rows: blank but for times and reference; filled in place. Without room for joints and
            contacts, these are not read.
        report: called with the rows that are new, now and then and once with the last ones.
        actuation: the commands' way to the plant.
        pushes: what disturbs it.
        pace: how fast it goes, how often it reports, and whether it goes on.
        ends: how simulations ended, as far as they have.
        lengths: rows of simulations that ended early.
        together: simulations that ended early because a law broke that drove several.
        done: rows filled so far.
        control_time_s: wall time of every command, the whole batch's.
        watch: wall time by part: "plant", "sensing", "controller", "loop", "report", "pace".
    """

    scenario: Scenario
    plant: Plant
    sensor: Sensor
    laws: Laws
    rows: Trajectory
    report: Report | None
    actuation: Actuation
    pushes: tuple[Push, ...]
    pace: Pace = field(default_factory=Pace)
    ends: dict[int, Outcome] = field(default_factory=dict)
    lengths: dict[int, int] = field(default_factory=dict)
    together: set[int] = field(default_factory=set)
    done: int = 0
    control_time_s: list[float] = field(default_factory=list)
    watch: Stopwatch = field(default_factory=Stopwatch)
    _first: RobotState | None = None
    _stances: dict[int, FloatArray] = field(default_factory=dict)  # of the last samples
    _reported: int = 0
    _last_report_s: float = field(default_factory=perf_counter)

    def run(self) -> None:
        """From the first sample to the last, or to where everything has ended.

        Raises:
            InputError: from a law's start.
        """
        period = self.scenario.control.sampling_time_s
        self.laws.deadline.arm()
        try:
            # what overflows ends as failed or diverged
            with np.errstate(all="ignore"), self.pace.heeding_stops():
                self._break_off(self.laws.start(), 0.0)
                self._drive(period)
        finally:
            self.laws.deadline.disarm()
            self.sensor.close()
        self.watch.lap("loop")
        self._end_all(Outcome("ok", "", max(self.done - 1, 0) * period))

    def _drive(self, period: float) -> None:
        """Sample after sample."""
        try:
            for k in range(self.scenario.periods + 1):
                if not self._hold(k * period):
                    break
                truth = self._look(k)
                if len(self.ends) == self.plant.nsim:
                    break
                command = self._ask(k, truth)
                if command is None:
                    break
                self._advance(k, command)
            self._report_rest()
        except KeyboardInterrupt:
            time_s = max(self.done - 1, 0) * period
            self._end_all(Outcome("interrupted", "stopped by the user", time_s))
            self._report_rest()
        except MachineError:  # of a camera that works no longer
            self._report_rest()
            raise

    def _report_rest(self) -> None:
        """Report the last rows, unless that was done."""
        self._fill_footing()
        if self.report and self._reported < self.done:
            self.watch.lap("loop")
            self.report(self.rows.rows(self._reported, self.done))
            self._reported = self.done
            self.watch.lap("report")

    def _hold(self, time_s: float) -> bool:
        """Keep the pace; whether the run goes on."""
        self.watch.lap("loop")
        goes_on = self.pace.hold(time_s)
        self.watch.lap("pace")
        return goes_on

    def _look(self, k: int) -> RobotState:
        """Record the truth at sample k, and who has ended; returns what sensors may see of it."""
        rows, plant = self.rows, self.plant
        truth = plant.state()
        rows.q[k], rows.q_rate[k] = truth.q, truth.q_rate
        rows.wheel_speed_rad_s[k] = plant.wheel_speed_rad_s()
        if rows.joint_positions.size:
            rows.joint_positions[k] = plant.joint_positions()
        if rows.contact_readings.size:
            rows.contact_readings[k] = plant.contact_readings()
        self.done = k + 1
        stance = plant.stance()
        if stance.size:
            self._stances[k] = stance
        if not (plant.sound(stance) and np.abs(truth.q).max() <= ESCAPE):
            self._end_some(truth, k)
        self._first = self._first or truth
        return self._with_the_ended_at_rest(truth) if self.ends else truth

    def _fill_footing(self) -> None:
        """Record how the robots stood at the last samples."""
        if not self._stances:
            return
        samples = list(self._stances)
        footing = self.plant.footing(np.array([*self._stances.values()]))
        for name, values in zip(footing._fields, footing, strict=True):
            getattr(self.rows, name)[samples] = values
        self._stances.clear()

    def _with_the_ended_at_rest(self, truth: RobotState) -> RobotState:
        """The state with ended simulations where they started: nothing they do harms the others."""
        assert self._first is not None, "nothing ends before the first look"
        ended, q, q_rate = list(self.ends), truth.q.copy(), truth.q_rate.copy()
        q[ended], q_rate[ended] = self._first.q[ended], self._first.q_rate[ended]
        return RobotState(q, q_rate)

    def _ask(self, k: int, truth: RobotState) -> Command | None:
        """The command at sample k, recorded; None where nobody is left to get one."""
        watch, rows = self.watch, self.rows
        watch.lap("loop")
        estimate = self.sensor.observe(truth)
        if self.scenario.control.torque_input:
            estimate = replace(estimate, wheel_angle_rad=self.plant.encoder_angle_rad())
        asked = watch.lap("sensing")
        command, broken = self.laws.command(k, estimate, self.ends)
        if broken:
            self._break_off(broken, k * self.scenario.control.sampling_time_s)
        if command is None or len(self.ends) == self.plant.nsim:
            return None
        if self.ends:
            command = _without(command, list(self.ends))
        self.sensor.commanded(command.wheel_speed_rad_s)
        if not self.control_time_s:
            rows.add_signals(command.signals)
        self.control_time_s.append(watch.lap("controller") - asked)
        who = self._who_is_left()
        _record_estimate(rows, k, estimate, who)
        rows.wheel_command_rad_s[k, who] = command.wheel_speed_rad_s[who]
        rows.saturated[k, who] = (command.saturated | self._at_limit(command))[who]
        rows.near_singular[k, who] = command.near_singular[who]
        for name, values in command.signals.items():
            rows.signals[name][k, who] = values[who]
        watch.lap("loop")
        return command

    def _at_limit(self, command: Command) -> BoolArray:
        """(nsim,) whose servos are asked for all they give, or more, whatever the law tells."""
        servo, loop = self.scenario.robot.servo, self.scenario.control.inner_loop
        limited = []
        if loop != "torque":  # there no part of ours acts on the speeds, which are but logged
            limited.append((command.wheel_speed_rad_s, servo.speed_limit_rad_s))
        if command.wheel_torque_n_m is not None:  # then they drive
            limited.append((command.wheel_torque_n_m, servo.largest_torque_n_m))
        reached = [np.abs(asked) >= AT_LIMIT * column(limit) for asked, limit in limited]
        return np.asarray(np.any(reached, axis=(0, 2)))

    def _who_is_left(self) -> Any:
        """An index of the simulations that have not ended."""
        if not self.ends:
            return slice(None)
        return [i for i in range(self.plant.nsim) if i not in self.ends]

    def _advance(self, k: int, command: Command) -> None:
        """Hold the command until the next sample, if there is one; and report now and then."""
        scenario, plant = self.scenario, self.plant
        if k < scenario.periods:
            if self.pushes:
                plant.push(forces(self.pushes, k * scenario.control.sampling_time_s))
            torque = command.wheel_torque_n_m if scenario.control.torque_input else None
            self.actuation.drive(plant, command.wheel_speed_rad_s if torque is None else torque)
        now = self.watch.lap("plant")
        due = now - self._last_report_s > self.pace.report_every_s
        if due or len(self._stances) >= STANCES:
            self._fill_footing()
        if self.report and due:
            self.report(self.rows.rows(self._reported, self.done))
            self._reported, self._last_report_s = self.done, self.watch.lap("report")

    def _end_some(self, truth: RobotState, k: int) -> None:
        """Note how simulations ended whose physics failed or whose state left all bounds."""
        time_s = k * self.scenario.control.sampling_time_s
        failed, escaped = self.plant.failed(), np.abs(truth.q).max(axis=1) > ESCAPE
        footing = self.plant.footing(self._stances[k]) if self._stances else None
        gone = np.zeros_like(failed) if footing is None else footing.gone
        for i in map(int, np.flatnonzero(failed | escaped | gone)):
            if failed[i]:
                end = Outcome("failed", f"the physics failed: {self.plant.fault(i)}", time_s)
            elif footing is not None and gone[i]:
                end = Outcome("diverged", _no_longer_stands(footing, i), time_s)
            else:
                reason = f"the state diverged beyond {ESCAPE:g} m or {ESCAPE:g} rad"
                end = Outcome("diverged", reason, time_s)
            self._end(i, end)

    def _break_off(self, broken: list[Broken], time_s: float) -> None:
        """Note how simulations ended whose law broke."""
        for who, reason, cause in broken:
            for i in who:
                self._end(i, Outcome("failed", reason, time_s, cause))
            if len(who) > 1:
                self.together.update(who)

    def _end_all(self, outcome: Outcome) -> None:
        """The same end for every simulation that has none yet."""
        for i in range(self.plant.nsim):
            self._end(i, outcome)

    def _end(self, simulation: int, outcome: Outcome) -> None:
        """One end for a simulation, unless it has one."""
        self.ends.setdefault(simulation, outcome)
        self.lengths.setdefault(simulation, max(self.done, 1))  # the start is always a row


def _no_longer_stands(footing: Footing, simulation: int) -> str:
    tilt, height = footing.tilt_rad[simulation], footing.height_m[simulation]
    if tilt > TIPPED_RAD:
        number, limit = apart(tilt, TIPPED_RAD, 2)
        return f"the robot tipped over: its tilt is {number} rad (limit {limit} rad)"
    number, limit = apart(abs(height), FLOWN_M, 2)
    if height > 0.0:
        return f"the robot left the ground: it is {number} m above it (limit {limit} m)"
    return f"the robot fell: it is {number} m below the ground (limit {limit} m)"


def _without(command: Command, ended: list[int]) -> Command:
    """The command with nothing for those who have ended, whatever they got."""
    wheels, torque = command.wheel_speed_rad_s.copy(), command.wheel_torque_n_m
    wheels[ended] = 0.0
    if torque is not None:
        torque = torque.copy()
        torque[ended] = 0.0
    return replace(command, wheel_speed_rad_s=wheels, wheel_torque_n_m=torque)


def _record_estimate(rows: Trajectory, k: int, estimate: Estimate, who: Any) -> None:
    rows.est_q[k, who], rows.est_q_rate[k, who] = estimate.state.q[who], estimate.state.q_rate[who]
    rows.est_valid[k, who] = estimate.valid[who]
    age = estimate.measurement_age_s
    rows.measurement_age_s[k, who] = (estimate.age_s if age is None else age)[who]
    rows.labels_found[k, who] = estimate.labels_found[who]
