"""From a scenario to the objects of a run."""

import copy
import os
from pathlib import Path

import numpy as np

from ttwmr_mj.config import rows_of
from ttwmr_mj.controllers.base import Controller, ControllerOptions, law_faults
from ttwmr_mj.deadline import limited
from ttwmr_mj.errors import InputError, Overrun
from ttwmr_mj.plants.base import Plant
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.registry import guarded
from ttwmr_mj.runs.law.laws import leave_if_forked, more_time
from ttwmr_mj.scenario.equations import plant_of_equations
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.sensing import Sensor, TruthSensor

_kept: list[Controller] | None = None


def keep_laws() -> None:
    """Keep every law that is made from now on until this process ends.

    Its `__del__` may not come to its end. So nothing that is left to do waits for it.
    """
    global _kept
    _kept = []


def make_plant(scenario: Scenario, nsim: int = 1, nthread: int = 0) -> Plant:
    """The plant, not yet reset.

    Args:
        scenario: the scenario, or those of as many simulations (`config.stacked`).
        nsim: simulations in the batch.
        nthread: threads of contact physics; 0: one per processor.

    Raises:
        InputError: no plant can drive this robot.
    """
    options, robot = scenario.plant, scenario.robot
    if options.kind == "analytic":
        return plant_of_equations(scenario, nsim)
    # MuJoCo takes time to import, and may be unable to: only when it is needed
    from ttwmr_mj.plants.contact import ContactPlant

    torque, ground = scenario.control.torque_input, scenario.ground
    return ContactPlant(robot, options.contact, nsim, nthread, torque_input=torque, ground=ground)


def refuse_reference(scenario: Scenario, reference: ReferencePath | None) -> None:
    """What the controller cannot follow.

    Raises:
        InputError: this reference, as the controller is told it.
    """
    faults = law_faults(scenario.controller, scenario.reference, reference)
    if faults:
        raise InputError(*faults)


def make_controller(scenario: Scenario, folder: Path) -> Controller:
    """The controller, not yet started.

    Args:
        scenario: the scenario, or those of several simulations (`config.stacked`).
        folder: where a custom controller is looked for first.

    Raises:
        InputError: it is a custom one that cannot be made.
    """
    process, limit_s = os.getpid(), scenario.control.controller_start_limit_s
    try:
        with limited(limit_s):
            law = _made(scenario.controller, folder)
    except Overrun:
        problem = f"importing and making the law timed out after {limit_s:g} s"
        raise InputError.at("controller", problem, hint=more_time(limit_s)) from None
    finally:
        leave_if_forked(process)
    return in_inner_loop(law, scenario)


def in_inner_loop(law: Controller, scenario: Scenario) -> Controller:
    """The law as the scenario's inner loop needs it."""
    if scenario.control.inner_loop != "computed_torque":
        return law
    from ttwmr_mj.controllers.shared.computed_torque import ComputedTorque

    return ComputedTorque(law, scenario.control.rate_gain_1_s)


def _made(options: ControllerOptions, folder: Path) -> Controller:
    first = rows_of(options, 1)[0]
    with guarded(type(first), "controller.kind", "make()", has_limit=True):
        law = copy.deepcopy(options).make(folder)  # a law may change what it is given
        if not isinstance(law, Controller):
            raise TypeError("it must return a Controller")
        if _kept is not None:
            _kept.append(law)
        return law


def make_sensor(
    scenario: Scenario, plant: Plant, rngs: list[np.random.Generator], folder: Path
) -> Sensor:
    """The sensor with its latency.

    Args:
        scenario: the scenario; with truth, or those of as many simulations (`config.stacked`).
        plant: what is looked at.
        rngs: one per simulation; a camera uses the first.
        folder: where a calibration file is looked for.

    Raises:
        InputError: the camera or its calibration cannot be used.
        MachineError: the scenario needs a camera and there is no OpenGL.
    """
    section, period = scenario.sensing, scenario.control.sampling_time_s
    if section.kind == "truth":
        return TruthSensor(section, period, rngs, scenario.belief.latency_s)
    # MuJoCo, OpenGL and OpenCV are loaded only when there is something to see
    from ttwmr_mj.vision.camera.rendering.drawn import build_drawn_model
    from ttwmr_mj.vision.sensor import CameraSensor, find_calibration, refuse_unusable

    model = build_drawn_model(scenario.robot, scenario.plant.contact)
    refuse_unusable(section, scenario.believed_camera, model, folder)
    calibration_rng, camera_rng = rngs[0].spawn(2)
    return CameraSensor(
        section,
        find_calibration(section, scenario.believed_camera, calibration_rng, folder).camera,
        scenario.believed_robot,
        model,
        period_s=period,
        nsim=plant.nsim,
        rng=camera_rng,
        joint_positions=plant.joint_positions,
        told_latency_s=scenario.belief.latency_s,
        told_command_latency_s=scenario.believed_command_latency_s,
        segmentation=scenario.output.save_frames,
    )


def refuse_unbuildable(scenario: Scenario, folder: Path) -> None:
    """Build what a run needs before it starts, but for references, laws and pictures.

    Raises:
        InputError: the run would refuse it.
    """
    make_plant(scenario, nthread=1)
    if scenario.sensing.kind == "camera":
        from ttwmr_mj.vision.camera.rendering.drawn import build_drawn_model
        from ttwmr_mj.vision.sensor import refuse_unusable

        model = build_drawn_model(scenario.robot, scenario.plant.contact)
        refuse_unusable(scenario.sensing, scenario.believed_camera, model, folder)


def generators(seed: int, names: tuple[str, ...]) -> dict[str, np.random.Generator]:
    """One independent random generator per name; adding a name leaves the others as they were."""
    return {name: generator(seed, name) for name in names}


def generator(seed: int, name: str, *key: int) -> np.random.Generator:
    """The generator of one name, or its child of a number."""
    sequence = np.random.SeedSequence([seed, *name.encode()], spawn_key=key)
    return np.random.default_rng(sequence)
