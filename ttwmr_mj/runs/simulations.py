"""A batch of simulations made ready to run: their references, one plant, one sensor, laws."""

from __future__ import annotations

import copy
from collections import defaultdict
from collections.abc import Callable, Hashable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from ttwmr_mj.config import frozen, stacked
from ttwmr_mj.controllers.base import Controller, Task
from ttwmr_mj.plants.base import Plant
from ttwmr_mj.references.shared.demand import Feasibility
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs import build
from ttwmr_mj.runs.closed_loop.actuation import Actuation
from ttwmr_mj.runs.closed_loop.loop import Loop, Report
from ttwmr_mj.runs.closed_loop.pace import Pace
from ttwmr_mj.runs.judgement.verdict import demands_of
from ttwmr_mj.runs.law.laws import Laws, NoRandomNumbers, Part
from ttwmr_mj.runs.pushes import Push
from ttwmr_mj.scenario.motion import believed_reference, initial_state, sample_reference
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.sensing import Sensor
from ttwmr_mj.state import RobotState

T = TypeVar("T")


class Simulations:
    """Scenarios that share a batch (`batch.batch_key`), made ready to run.

    Attributes:
        scenarios: of each simulation.
        references: the sampled reference that each is judged by, equal ones once, or None.
        plant: the plant, reset at every run.
        sensor: made anew at every run; None before the first.
    """

    def __init__(
        self,
        scenarios: Sequence[Scenario],
        folder: Path,
        *,
        draws: Sequence[int] | None = None,
        nthread: int = 0,
        controller: Controller | None = None,
    ) -> None:
        """Build it.

        Args:
            scenarios: what to run.
            folder: where a custom controller is looked for first.
            draws: of one scenario, repeated: which of its seed's random numbers each gets: 0 those
                of a run alone, 1 others, and so on; None: they are several, and each gets 0.
            nthread: threads of contact physics; 0: one per processor.
            controller: drives all of them instead of the scenarios' own.

        Raises:
            InputError: they cannot be built.
        """
        self.scenarios, self._folder = tuple(scenarios), folder
        self._draws, self._repeats = draws or [0] * len(scenarios), draws is not None
        self._one = stacked(self.scenarios)
        self.references = _once(sample_reference, self.scenarios, _judged_by)
        self.plant: Plant = build.make_plant(self._one, self.nsim, nthread)
        self.sensor: Sensor | None = None
        self._told = _once(believed_reference, self.scenarios, _told_by)
        if controller is None:
            self._laws = self._grouped_laws()
        else:
            law = build.in_inner_loop(controller, self._one)
            self._laws = [(law, [*range(self.nsim)])]

    @cached_property
    def demands(self) -> list[Feasibility | None]:
        """What its reference asks of each robot."""
        known: dict[Hashable, Feasibility | None] = {}
        keys = [
            (id(reference), frozen((row.robot, row.ground, row.plant.contact.floor_friction)))
            for row, reference in zip(self.scenarios, self.references, strict=True)
        ]
        for i, key in enumerate(keys):
            if key not in known:
                known[key] = demands_of(self.scenarios[i], self.references[i])
        return [known[key] for key in keys]

    @property
    def nsim(self) -> int:
        """Simulations in the batch."""
        return len(self.scenarios)

    def run(
        self,
        report: Report | None = None,
        initial: RobotState | None = None,
        pushes: tuple[Push, ...] | None = None,
        pace: Pace | None = None,
        *,
        drawable: bool = True,
        frames_every: int = 1,
    ) -> Loop:
        """Run from the initial states to the end, or until all have failed.

        Args:
            report: called with the rows that are new, every now and then and at the end.
            initial: where every simulation starts; None: where its scenario says.
            pushes: on each simulation; None: what the scenarios say, drawn by their seeds.
            pace: how fast; None: as fast as it can.
            drawable: keep joints and contacts, which only drawings need.
            frames_every: of a camera, keep one frame in this many for the report; 0: none.

        Returns:
            the loop, over.

        Raises:
            InputError: a law cannot start.
        """
        one, plant, control = self._one, self.plant, self._one.control
        rngs = [
            build.generator(seed, "sensor", *([draw] if draw else [])) for seed, draw in self._seeds
        ]
        self.sensor = build.make_sensor(one, plant, rngs, self._folder)
        if report:
            self.sensor.keep_log(frames_every)
        plant.reset(initial or self._initial())
        rows = self._blank_rows(drawable=drawable)
        limits_s = control.controller_start_limit_s, control.controller_time_limit_s
        commands = [build.generator(seed, "commands", draw) for seed, draw in self._seeds]
        loop = Loop(
            one,
            plant,
            self.sensor,
            Laws(self._parts(), self.nsim, limits_s, torque_input=control.torque_input),
            rows,
            report,
            Actuation(control, one.steps_per_period, commands),
            self._pushes() if pushes is None else pushes,
            pace or Pace(),
        )
        loop.run()
        return loop

    @property
    def _seeds(self) -> list[tuple[int, int]]:
        return [(s.seed, draw) for s, draw in zip(self.scenarios, self._draws, strict=True)]

    def _grouped_laws(self) -> list[tuple[Controller, list[int]]]:
        """Laws, not yet started, and the simulations of each."""
        who = defaultdict[Hashable, list[int]](list)
        for i, scenario in enumerate(self.scenarios):
            who[self._law_key(scenario)].append(i)
        return [(self._law(group), group) for group in who.values()]

    def _law_key(self, scenario: Scenario) -> Hashable:
        """Equal for simulations that one law can drive."""
        if scenario.controller.alone:  # then it is one scenario, repeated
            return None
        # computed torque inverts the equations of one robot
        if scenario.controller.takes_stacks and not scenario.control.torque_input:
            return scenario.believed_command_latency_s
        law = frozen(scenario.controller)
        return law, _told_by(scenario), scenario.believed_command_latency_s

    def _law(self, group: list[int]) -> Controller:
        """The law of these simulations, which all must be able to have."""
        different = {(id(self._told[i]), id(self.scenarios[i].controller)): i for i in group}
        for i in different.values():
            build.refuse_reference(self.scenarios[i], self._told[i])
        return build.make_controller(stacked([self.scenarios[i] for i in group]), self._folder)

    def _parts(self) -> list[Part]:
        """The laws with their tasks."""
        parts = []
        for law, group in self._laws:
            one = stacked([self.scenarios[i] for i in group])
            paths = [self._told[i] for i in group]
            path = None if paths[0] is None else ReferencePath.beside(cast("Any", paths))
            # a law may change what it is given
            believed = copy.deepcopy((one.believed_robot, one.believed_ground))
            task = Task(
                believed[0],
                path.copy() if path is paths[0] and path is not None else path,
                one.control.sampling_time_s,
                len(group),
                self._rng(group),
                believed[1],
                one.believed_command_latency_s,
            )
            parts.append(Part(law, task, np.array(group)))
        return parts

    def _rng(self, group: list[int]) -> np.random.Generator:
        """Random numbers of a law: what several scenarios draw together, none would draw alone."""
        if len(group) > 1 and not self._repeats:
            return cast("np.random.Generator", NoRandomNumbers())
        return build.generator(self.scenarios[group[0]].seed, "controller")

    def _initial(self) -> RobotState:
        """Where every simulation starts."""
        pairs = zip(self.scenarios, self.references, strict=True)
        states = [initial_state(scenario, reference) for scenario, reference in pairs]
        return RobotState(
            *(np.concatenate([getattr(s, n) for s in states]) for n in ("q", "q_rate"))
        )

    def _pushes(self) -> tuple[Push, ...]:
        return Push.beside(
            [
                Push.drawn(scenario.plant.pushes, [build.generator(scenario.seed, "pushes", draw)])
                for scenario, draw in zip(self.scenarios, self._draws, strict=True)
            ]
        )

    def _blank_rows(self, *, drawable: bool) -> Trajectory:
        """Rows for the whole run with times and references filled in."""
        count = self._one.periods + 1
        time_s = self._one.control.sampling_time_s * np.arange(count, dtype=np.float64)
        nq = self.plant.joint_positions().shape[-1] if drawable else 0
        ncontact = self.plant.contact_readings().shape[1] if drawable else 0
        trailers = len(self._one.robot.trailers)
        rows = Trajectory.empty(time_s, self.nsim, nq, ncontact, trailers=trailers)
        for i, reference in enumerate(self.references):
            if reference is not None:
                rows.ref_q[:, i] = reference.q[:count, 0]
                rows.ref_q_rate[:, i] = reference.q_rate[:count, 0]
        return rows


def _judged_by(scenario: Scenario) -> Hashable:
    """All that the reference a scenario is judged by depends on."""
    robots = scenario.robot, scenario.believed_robot
    return frozen((scenario.reference, *robots, scenario.ground))


def _told_by(scenario: Scenario) -> Hashable:
    """All that the reference a law is told depends on."""
    return frozen((scenario.reference, scenario.believed_robot, scenario.believed_ground))


def _once(
    function: Callable[[Scenario], T],
    scenarios: Sequence[Scenario],
    key_of: Callable[[Scenario], Hashable],
) -> list[T]:
    """What a function says of each scenario, asked once for each key."""
    known: dict[Hashable, T] = {}
    by_object: dict[int, T] = {}
    for scenario in scenarios:
        if id(scenario) not in by_object:
            key = key_of(scenario)
            if key not in known:
                known[key] = function(scenario)
            by_object[id(scenario)] = known[key]
    return [by_object[id(scenario)] for scenario in scenarios]
