"""From a scenario's words to the objects of a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ttwmr_mj.controllers.base import Controller
from ttwmr_mj.controllers.custom import load_controller
from ttwmr_mj.controllers.flatness import Flatness
from ttwmr_mj.controllers.lyapunov import Lyapunov
from ttwmr_mj.controllers.lyapunov_pid import LyapunovPid
from ttwmr_mj.controllers.mpc import Mpc
from ttwmr_mj.controllers.open_loop import OpenLoop
from ttwmr_mj.controllers.options import FlatnessController, MpcController, TvlqrController
from ttwmr_mj.controllers.tvlqr import Tvlqr
from ttwmr_mj.plants.base import Plant
from ttwmr_mj.references.circle import Circle
from ttwmr_mj.references.figure_eight import FigureEight
from ttwmr_mj.references.flat_arc import FlatArc
from ttwmr_mj.references.flat_circle import FlatCircle
from ttwmr_mj.references.flat_ellipse import FlatEllipse
from ttwmr_mj.references.planned import Planned
from ttwmr_mj.references.shared.flat_reference import FlatReference
from ttwmr_mj.references.shared.path import ReferencePath, Samples
from ttwmr_mj.references.shared.path_reference import Reference
from ttwmr_mj.references.straight_line import StraightLine
from ttwmr_mj.references.waypoints import Waypoints
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.scenario.schema import (
    AtRest,
    LyapunovController,
    LyapunovPidController,
    OpenLoopController,
    Scenario,
)
from ttwmr_mj.sensing import Sensor, TruthSensor
from ttwmr_mj.state import RobotState

LOOKAHEAD_SAMPLES = 64  # reference samples beyond the run's end, for laws that look ahead

_REFERENCES: dict[str, type[Reference]] = {
    "circle": Circle,
    "figure_eight": FigureEight,
    "straight_line": StraightLine,
    "waypoints": Waypoints,
}
_FLAT_REFERENCES: dict[str, type[FlatReference]] = {
    "flat_circle": FlatCircle,
    "flat_ellipse": FlatEllipse,
    "flat_arc": FlatArc,
}


def make_reference(scenario: Scenario) -> Samples | None:
    """The reference trajectory, or None for open-loop experiments."""
    section = scenario.reference
    if section.kind == "none":
        return None
    if section.kind == "planned":
        return Planned(plan=section.plan, robot=scenario.robot)
    if section.kind in _FLAT_REFERENCES:
        settings = dict(section.model_dump(exclude={"kind"}))
        return _FLAT_REFERENCES[section.kind](robot=scenario.robot, **settings)
    return _REFERENCES[section.kind](**dict(section.model_dump(exclude={"kind"})))


def sample_reference(scenario: Scenario) -> ReferencePath | None:
    """The reference at every control sample of the run and a little beyond."""
    reference = make_reference(scenario)
    if reference is None:
        return None
    count = scenario.periods + 1 + LOOKAHEAD_SAMPLES
    return reference.sample(scenario.control.sampling_time_s * np.arange(count, dtype=np.float64))


def driven_robot(scenario: Scenario) -> RobotParameters:
    """The robot that is driven, which may be heavier than the one the controller believes in."""
    factor, robot = scenario.plant.tractor_mass_factor, scenario.robot
    if factor == 1.0:
        return robot
    changed = {
        "mass_kg": factor * robot.tractor.mass_kg,
        "yaw_inertia_kg_m2": factor * robot.tractor.yaw_inertia_kg_m2,
    }
    return robot.model_copy(update={"tractor": robot.tractor.model_copy(update=changed)})


def make_plant(scenario: Scenario, nsim: int = 1) -> Plant:
    """The plant, not yet reset."""
    options, robot = scenario.plant, driven_robot(scenario)
    if options.kind == "analytic" and options.analytic.extended is not None:
        from ttwmr_mj.dynamics.extended import ExtendedModel
        from ttwmr_mj.plants.extended import ExtendedPlant

        model = ExtendedModel(robot, options.analytic.extended.model_dump())
        return ExtendedPlant(model, nsim, options.contact.timestep_s, options.analytic.max_step_s)
    if options.kind == "analytic":
        from ttwmr_mj.plants.analytic import AnalyticPlant

        return AnalyticPlant(
            robot,
            nsim=nsim,
            time_step_s=options.contact.timestep_s,
            max_integration_step_s=options.analytic.max_step_s,
            published_spring=options.analytic.published_spring,
        )
    # MuJoCo takes time to import, and may be unable to: only when it is needed
    from ttwmr_mj.plants.contact import ContactPlant

    return ContactPlant(robot, options.contact, nsim=nsim)


def make_controller(scenario: Scenario, folder: Path) -> Controller:
    """The controller, not yet started; `folder` is where a custom one is looked for first."""
    section = scenario.controller
    if isinstance(section, LyapunovPidController):  # before its base class
        return LyapunovPid(section)
    if isinstance(section, LyapunovController):
        return Lyapunov(section)
    if isinstance(section, FlatnessController):
        return Flatness(section)
    if isinstance(section, MpcController):  # before its base class
        return Mpc(section)
    if isinstance(section, TvlqrController):
        return Tvlqr(section)
    if isinstance(section, OpenLoopController):
        return OpenLoop(section)
    return load_controller(section, folder)


def make_sensor(scenario: Scenario, plant: Plant, rng: np.random.Generator, folder: Path) -> Sensor:
    """The sensor with its latency; `folder` is where a calibration file is looked for.

    Raises:
        InputError: the calibration cannot be used.
        MachineError: a camera is asked for and there is no OpenGL.
    """
    section, period = scenario.sensing, scenario.control.sampling_time_s
    if section.kind == "truth":
        return TruthSensor(section, period, plant.nsim, rng)
    # MuJoCo, OpenGL and OpenCV are loaded only when there is something to see
    from ttwmr_mj.plants.mjcf import build_model
    from ttwmr_mj.vision.sensor import CameraSensor
    from ttwmr_mj.vision.setup import find_calibration

    calibration_rng, camera_rng = rng.spawn(2)
    contact = scenario.plant.contact
    scene = Path(contact.model_path) if contact.model_path else None
    return CameraSensor(
        section,
        find_calibration(section, calibration_rng, folder).camera,
        scenario.robot,
        build_model(scenario.robot, contact, scene),
        period_s=period,
        nsim=plant.nsim,
        rng=camera_rng,
        joint_positions=plant.joint_positions,
        segmentation=scenario.output.save_frames,
    )


def initial_state(scenario: Scenario, reference: ReferencePath | None, nsim: int = 1) -> RobotState:
    """Where every simulation starts."""
    start = scenario.initial
    if isinstance(start, AtRest):
        return RobotState.at_rest(start.x_m, start.y_m, start.theta1_rad, start.theta2_rad, nsim)
    if reference is None:
        raise AssertionError("the loader refuses on_reference without a reference")
    q, rate = reference.q[0, 0].copy(), reference.q_rate[0, 0].copy()
    if np.isnan(q[3]):
        q[3], rate[3] = q[2], rate[2]
    q += [start.x_offset_m, start.y_offset_m, start.theta1_offset_rad, start.theta2_offset_rad]
    return RobotState(q=np.tile(q, (nsim, 1)), q_rate=np.tile(rate, (nsim, 1)))


def generators(seed: int, names: tuple[str, ...]) -> dict[str, np.random.Generator]:
    """One independent random generator per name; adding a name leaves the others as they were."""
    return {
        name: np.random.default_rng(np.random.SeedSequence([seed, *name.encode()]))
        for name in names
    }
