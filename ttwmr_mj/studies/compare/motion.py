"""What the two plants did, on the same clock, and how each was driven."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ttwmr_mj.dynamics.kinematics import q_rate, twist_from_wheels
from ttwmr_mj.dynamics.servo import Stretches
from ttwmr_mj.errors import RunError
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.plants.base import Plant
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.results.trajectory import TORQUE_SIGNALS, Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.runs.build import generator, make_plant
from ttwmr_mj.runs.closed_loop.actuation import Actuation
from ttwmr_mj.runs.closed_loop.loop import Outcome, Report
from ttwmr_mj.runs.closed_loop.pace import Pace
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.motion import initial_state, sample_reference
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import THETA2, FloatArray, RobotState
from ttwmr_mj.studies.compare.physics_rate import PhysicsRate
from ttwmr_mj.studies.compare.shooting import shoot
from ttwmr_mj.studies.compare.variants import changed, on_plant


@dataclass(frozen=True, slots=True)
class ContactRun:
    """A scenario's run on contact physics."""

    scenario: Scenario
    start: RobotState
    trajectory: Trajectory  # at the control samples, of one simulation
    physics: PhysicsRate  # the same run at every physics step

    @property
    def robot(self) -> RobotParameters:
        """The robot that was driven."""
        return self.scenario.robot

    @property
    def commands(self) -> FloatArray:
        """(n − 1, 2) what drove the wheels in every period: speeds [rad/s], or torques [N·m]."""
        return commands_of(self.scenario, self.trajectory)[:-1]


def commands_of(scenario: Scenario, rows: Trajectory) -> FloatArray:
    """(n, 2) what the rows' samples commanded: wheel speeds [rad/s], or torques [N·m]."""
    if scenario.control.torque_input:
        return np.concatenate([rows.signals[name] for name in TORQUE_SIGNALS], axis=1)
    return rows.wheel_command_rad_s[:, 0]


def run_contact(
    scenario: Scenario,
    folder: Path | None = None,
    *,
    watch: Report | None = None,
    pace: Pace | None = None,
) -> ContactRun:
    """The scenario on contact physics under its own controller.

    Args:
        scenario: what to run.
        folder: where a custom controller is looked for first.
        watch: called with the rows that are new, now and then.
        pace: how fast; None: as fast as it can.

    Raises:
        InputError: the scenario cannot be built.
        RunError: the run broke.
    """
    scenario = on_plant(scenario, "contact")
    experiment = Experiment(scenario, folder)
    plant = experiment.plant
    assert isinstance(plant, ContactPlant)
    plant.keep_physics_rate()
    result = experiment.run(watch, pace=pace)
    _check(result.outcomes[0], "contact physics")
    rows, start = result.trajectory, initial_state(scenario, experiment.reference)
    physics = PhysicsRate.of(plant, start, rows.wheel_speed_rad_s[0])
    return ContactRun(scenario, start, rows, physics)


def run_analytic(scenario: Scenario, folder: Path | None = None) -> Trajectory:
    """The scenario on the analytic plant under its own controller; errors as `run_contact`."""
    result = Experiment(on_plant(scenario, "analytic"), folder).run()
    _check(result.outcomes[0], "the analytic plant")
    return result.trajectory


def replay_analytic(scenario: Scenario, commands: FloatArray) -> Trajectory:
    """Commands (n, 2) [rad/s] (right, left), one per control period, on the analytic model."""
    return replay(scenario, commands, analytic_plant(scenario))


def replay_plain(scenario: Scenario, commands: FloatArray) -> Trajectory:
    """The same on the model without extensions."""
    return replay_analytic(changed(scenario, {"plant.analytic.extended": None}), commands)


def analytic_plant(scenario: Scenario) -> Plant:
    """The analytic model, extended where the scenario has it so."""
    return make_plant(on_plant(scenario, "analytic"))


def replay_contact(scenario: Scenario, commands: FloatArray) -> Trajectory:
    """The same on contact physics.

    Raises:
        RunError: the physics broke.
    """
    return _replay_sound(scenario, commands, make_plant(on_plant(scenario, "contact")))


def replay_contact_run(scenario: Scenario, commands: FloatArray) -> ContactRun:
    """The same, known at every physics step."""
    scenario = on_plant(scenario, "contact")
    plant = make_plant(scenario)
    assert isinstance(plant, ContactPlant)
    plant.keep_physics_rate()
    rows = _replay_sound(scenario, commands, plant)
    start = initial_state(scenario, sample_reference(scenario))
    physics = PhysicsRate.of(plant, start, rows.wheel_speed_rad_s[0])
    return ContactRun(scenario, start, rows, physics)


def _replay_sound(scenario: Scenario, commands: FloatArray, plant: Plant) -> Trajectory:
    rows = replay(scenario, commands, plant)
    if plant.failed().any():
        raise RunError(
            f"{scenario.name}: contact physics failed while replaying commands: {plant.fault(0)}"
        )
    return rows


def replay(scenario: Scenario, commands: FloatArray, plant: Plant) -> Trajectory:
    """Drive a plant from the scenario's start through commands (n, 2), one per control period."""
    time_s = scenario.control.sampling_time_s * np.arange(len(commands) + 1, dtype=np.float64)
    return Replay(scenario, plant).follow(time_s, np.vstack([commands, [np.nan, np.nan]]))


class Replay:
    """A plant driven from the scenario's start through commands that are given in chunks.

    They reach it as they did in the run: as late, and the same of them lost.
    """

    def __init__(self, scenario: Scenario, plant: Plant) -> None:
        self._plant = plant
        steps = round(scenario.control.sampling_time_s / plant.time_step_s)
        chance = generator(scenario.seed, "commands", 0)  # of a run's only simulation
        self._actuation = Actuation(scenario.control, steps, [chance])
        self._command: FloatArray | None = None  # of the last sample so far
        self._trailers = len(scenario.robot.trailers)
        plant.reset(initial_state(scenario, sample_reference(scenario), plant.nsim))

    def follow(self, time_s: FloatArray, commands: FloatArray) -> Trajectory:
        """The next rows, at times (n,), and what was commanded at each (n, 2)."""
        plant = self._plant
        rows = Trajectory.empty(time_s, plant.nsim, trailers=self._trailers)
        for k, command in enumerate(commands):
            if self._command is not None:
                self._actuation.drive(plant, self._command)
            state = plant.state()
            rows.q[k], rows.q_rate[k] = state.q, state.q_rate
            rows.wheel_speed_rad_s[k] = plant.wheel_speed_rad_s()
            self._command = np.tile(command, (plant.nsim, 1))
            rows.wheel_command_rad_s[k] = self._command
        return rows


def follow_wheels(run: ContactRun) -> Trajectory:
    """The analytic model driven by the wheels' real speeds, known at every physics step.

    Every period is a stretch for `shooting`.
    """
    was, robot, scenario = run.trajectory, run.robot, run.scenario
    width = was.q.shape[-1]
    stretches, speeds = run.physics.stretches(scenario.steps_per_period)
    twist = twist_from_wheels(speeds, robot)
    timing = scenario.control.sampling_time_s, scenario.plant.analytic.max_step_s

    def ends(states: FloatArray, which: slice) -> FloatArray:
        tiled = [np.concatenate([part[:, which]] * len(states), axis=1) for part in stretches]
        twists = np.tile(twist[:-1][which], (len(states), 1))
        q, swing_rate = (part.reshape(-1, part.shape[-1]) for part in np.split(states, [width], -1))
        plant = AnalyticPlant(robot, len(q), *timing, ground=scenario.ground)
        plant.reset(RobotState(q, q_rate(q, np.column_stack([twists, swing_rate]))))
        plant.follow(Stretches(*tiled), np.tile(speeds[1:][which], (len(states), 1)))
        now = plant.state()
        return np.column_stack([now.q, now.q_rate[:, THETA2:]]).reshape(states.shape)

    states, _ = shoot(ends, np.column_stack([was.q[:, 0], was.q_rate[:, 0, THETA2:]]))
    q, rates = states[:, :width], np.column_stack([twist, states[:, width:]])
    rows = Trajectory.empty(was.time_s, nsim=1, trailers=width - THETA2)
    rows.q[:, 0], rows.q_rate[:, 0] = q, q_rate(q, rates)
    rows.wheel_speed_rad_s[:, 0] = run.physics.wheel_speed_rad_s[:: scenario.steps_per_period]
    rows.wheel_command_rad_s[:] = was.wheel_command_rad_s
    return rows


def _check(outcome: Outcome, where: str) -> None:
    if outcome.status == "interrupted":
        raise KeyboardInterrupt
    if outcome.status != "ok":
        raise RunError(
            f"the run on {where} {outcome.status} at {outcome.time_s:.3f} s: {outcome.reason}; "
            "two plants can only be compared where both finish"
        )
