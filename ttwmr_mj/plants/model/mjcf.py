"""XML and parameters make one MjModel, whose halves weigh exactly what the parameters say."""

from pathlib import Path

import numpy as np

from ttwmr_mj.assets import models_folder
from ttwmr_mj.composite import Lump, ball_inertia, tractor_chassis, trailer_chassis, wheel_inertia
from ttwmr_mj.dynamics.floor.balls import all_held_back
from ttwmr_mj.dynamics.floor.ground import LEVEL, Ground
from ttwmr_mj.dynamics.motor import Drive
from ttwmr_mj.errors import InputError
from ttwmr_mj.files import resolved
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.engine import mujoco, warnings_kept
from ttwmr_mj.plants.model.names import CASTERS, WHEELS, casters, contacts, trailer_part
from ttwmr_mj.plants.model.relief import add_relief
from ttwmr_mj.plants.model.runners import add_runner
from ttwmr_mj.plants.model.scene.files import refuse_what_leads_away
from ttwmr_mj.plants.model.scene.likeness import refuse_another_robot
from ttwmr_mj.plants.model.scene.trial import refuse_what_takes_too_much
from ttwmr_mj.plants.model.train_parts import add_trailers
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import LEFT, RIGHT

# A flat chassis: its roll and pitch inertia as a share of its yaw inertia. A planar robot feels
# neither; more than half satisfies the triangle inequality.
ROLL_SHARE = 0.55
GIMBAL_DAMPING = 2.0  # 1/s, of the swing inertia: a rattle in pitch and roll dies away in 0.5 s
VISUAL_GROUP = 2
# what MuJoCo raises where a scene is at fault; the last two are C++'s own, without a reason
REFUSED = (ValueError, OSError, RuntimeError, MemoryError)


def build_spec(
    robot: RobotParameters,
    options: ContactOptions,
    ground: Ground = LEVEL,
    *,
    torque_input: bool = False,
) -> mujoco.MjSpec:
    """The laboratory with this robot in it, still editable.

    Args:
        robot: every number of the robot.
        options: how contact physics is solved, and in which scene.
        ground: how its floor slopes.
        torque_input: as of `Drive.of`.

    Raises:
        InputError: the scene cannot be read, leads to what is no data of its own, lacks a named
            part, or the inertia is impossible.
    """
    path = _path(options)
    if options.model_path:
        files = refuse_what_leads_away(path, "plant", "contact", "model_path")
        refuse_what_takes_too_much(path, files)
    spec = _read(path)
    for key in spec.keys:
        spec.delete(key)
    spec.add_key(name="home")  # the only one: `qpos0`, at the origin and straight
    try:
        add_trailers(spec, path, robot, options.contact_time_constant_s)
        _set_inertia(spec, robot)
        _set_geometry(spec, robot)
        _set_joints(spec, robot, options)
        _set_drives(spec, Drive.of(robot.servo, torque_input=torque_input))
        _set_contact(spec, robot, options, ground)
        _hold_back(spec, robot, options, ground)
        add_relief(spec, ground)
        _scale_looks(spec, robot)
        _gimbal(spec, robot)
        if robot.hitch.play_m > 0:
            _loosen_pin(spec, robot.hitch.play_m, options.contact_time_constant_s)
    except AttributeError as error:
        if error.obj is not None:  # only of a part that is missing there is nothing
            raise
        raise InputError.at(
            "plant.contact.model_path",
            f"a part of the robot is missing ({error})",
            got=repr(path),
            hint="the scene must include models/ttwmr.xml and have a geom named floor",
        ) from error
    return spec


def _read(path: str) -> mujoco.MjSpec:
    """A scene as the user wrote it.

    Raises:
        InputError: MuJoCo cannot read it, or warns of it.
    """
    key, got = "plant.contact.model_path", repr(path)
    try:
        with warnings_kept() as warned:
            spec = mujoco.MjSpec.from_file(path)
    except REFUSED as error:
        raise InputError.at(key, f"MuJoCo cannot read it: {_reason(error)}", got=got) from error
    if warned:
        raise InputError.at(key, f"MuJoCo warns: {'; '.join(warned[:3])}", got=got)
    return spec


def build_model(
    robot: RobotParameters,
    options: ContactOptions,
    ground: Ground = LEVEL,
    *,
    torque_input: bool = False,
) -> mujoco.MjModel:
    """The compiled laboratory with this robot in it; arguments and errors as of `build_spec`."""
    spec = build_spec(robot, options, ground, torque_input=torque_input)
    try:
        with warnings_kept() as warned:
            model = spec.compile()
        if warned:
            raise ValueError("; ".join(warned[:3]))
    except REFUSED as error:
        key, what = "plant.contact", "this robot"
        if options.model_path:
            key, what = "plant.contact.model_path", "this robot in this scene"
        got = repr(options.model_path) if options.model_path else ""
        raise InputError.at(key, f"MuJoCo rejects {what}: {_reason(error)}", got=got) from error
    if options.model_path:
        in_shipped = options.model_copy(update={"model_path": None})
        shipped = build_model(robot, in_shipped, ground, torque_input=torque_input)
        stated, by_default = _read(_path(options)), _read(_shipped())
        refuse_another_robot(model, shipped, stated.option, by_default.option)
    return model


def _reason(error: Exception) -> str:
    """MuJoCo's words, and where it has none, what is most likely."""
    if isinstance(error, RuntimeError | MemoryError):
        return f"{error} Is a size or a count in it beyond all memory?"
    return str(error)


def _path(options: ContactOptions) -> str:
    """The scene's file without links: MuJoCo looks beside it for others."""
    return str(resolved(Path(options.model_path))) if options.model_path else _shipped()


def _shipped() -> str:
    return str(models_folder() / "scene.xml")


def _set_body(spec: mujoco.MjSpec, name: str, lump: Lump) -> None:
    body = spec.body(name)
    body.mass = lump.mass_kg
    body.ipos = [lump.x_m, lump.y_m, 0.0]
    body.inertia = lump.yaw_inertia_kg_m2 * np.array([ROLL_SHARE, ROLL_SHARE, 1.0])


def _set_inertia(spec: mujoco.MjSpec, robot: RobotParameters) -> None:
    _set_body(spec, "tractor", tractor_chassis(robot))
    for i in range(len(robot.trailers)):
        _set_body(spec, trailer_part("trailer", i), trailer_chassis(robot, i))
    spin, diametral = wheel_inertia(robot)
    for name in WHEELS:
        spec.body(name).mass = robot.tractor.wheel_mass_kg
        spec.body(name).inertia = [diametral, spin, diametral]
    for name in casters(len(robot.trailers)):
        spec.body(name).mass = robot.casters.mass_kg
        spec.body(name).inertia = [ball_inertia(robot)] * 3


def _set_geometry(spec: mujoco.MjSpec, robot: RobotParameters) -> None:
    tractor, balls = robot.tractor, robot.casters
    axle_height, half_track = tractor.wheel_radius_m, robot.half_track_m
    spec.body("tractor").pos = [0.0, 0.0, axle_height]
    # each axle at its own wheel's radius: the robot stands level
    heights = [radius - axle_height for radius in tractor.wheel_radii_m]
    spec.body("wheel_right").pos = [0.0, -half_track, heights[RIGHT]]
    spec.body("wheel_left").pos = [0.0, half_track, heights[LEFT]]
    ball_height = balls.radius_m - axle_height
    spec.body(CASTERS[0]).pos = [balls.tractor_position_m, 0.0, ball_height]
    for i, trailer in enumerate(robot.trailers):
        behind, aside = -trailer.com_offset_m, balls.trailer_half_spacing_m
        for name, y in zip(CASTERS[1:], (-aside, aside), strict=True):
            spec.body(trailer_part(name, i)).pos = [behind, y, ball_height]
        spec.site(trailer_part("trailer_com", i)).pos = [behind, trailer.com_lateral_m, 0.0]
    half_width = tractor.wheel_half_width_m
    for name, radius in zip(WHEELS, tractor.wheel_radii_m, strict=True):
        geom = spec.geom(name)
        if tractor.wheel_shape == "cylinder":
            geom.type = mujoco.mjtGeom.mjGEOM_CYLINDER
            geom.size = [radius, half_width, 0.0]
            # both axes point outward: MuJoCo sorts a cylinder's contacts by its axis, and left
            # shall mirror right
            outward = -np.sign(spec.body(name).pos[1])
            geom.quat = [np.sqrt(0.5), outward * np.sqrt(0.5), 0.0, 0.0]
        else:
            geom.size = [radius, half_width, radius]
        side = name.removeprefix("wheel_")
        spec.geom(f"tyre_{side}").size = [radius, half_width, 0.0]
    for name in casters(len(robot.trailers)):
        spec.geom(name).size = [balls.radius_m, 0.0, 0.0]
        spec.geom(name.replace("caster", "ball")).size = [balls.radius_m, 0.0, 0.0]


def _set_joints(spec: mujoco.MjSpec, robot: RobotParameters, options: ContactOptions) -> None:
    servo = robot.servo
    for i, values in enumerate(robot.hitches):
        hitch = spec.joint(trailer_part("hitch", i))
        hitch.stiffness[0] = values.stiffness_n_m_rad  # [1:] are the cubic spring's terms
        hitch.damping[0] = values.damping_n_m_s_rad
        hitch.frictionloss = values.coulomb_friction_n_m
    for name in WHEELS:
        wheel = spec.joint(name)
        wheel.armature = servo.reflected_inertia_kg_m2
        if servo.motor is not None:
            wheel.damping[0] = servo.motor.gear_damping_n_m_s_rad
            wheel.frictionloss = servo.motor.gear_friction_n_m
            wheel.solref_friction = [options.contact_time_constant_s, 1.0]
            wheel.solimp_friction = hitch.solimp_friction


def _set_drives(spec: mujoco.MjSpec, drive: Drive) -> None:
    for name in WHEELS:
        actuator = spec.actuator(name)
        actuator.gainprm[0], actuator.biasprm[2] = drive.gain, -drive.gain * drive.back
        actuator.forcerange = [-drive.limit_n_m, drive.limit_n_m]
        actuator.ctrlrange = [-drive.input_limit, drive.input_limit]


def _set_contact(
    spec: mujoco.MjSpec, robot: RobotParameters, options: ContactOptions, ground: Ground
) -> None:
    x, y = ground.gravity_m_s2
    spec.option.gravity = [x, y, -ground.normal_gravity_m_s2]
    spec.option.timestep = options.timestep_s
    spec.option.impratio = options.friction_impedance_ratio
    solref = [options.contact_time_constant_s, 1.0]
    count = len(robot.trailers)
    for i in range(count):
        spec.joint(trailer_part("hitch", i)).solref_friction = solref
    for name in contacts(count):
        geom = spec.geom(name)
        geom.solref = solref
        geom.friction[0] = options.floor_friction
        if name not in WHEELS:
            geom.friction[1] = geom.friction[2] = 0.0
    spec.geom("floor").friction[0] = options.floor_friction


def _hold_back(
    spec: mujoco.MjSpec, robot: RobotParameters, options: ContactOptions, ground: Ground
) -> None:
    each = all_held_back(robot, ground.normal_gravity_m_s2)
    forces = [each[0].nose, *(force for _, right, left in each for force in (right, left))]
    for name, force in zip(casters(len(robot.trailers)), forces, strict=True):
        if force > 0:
            add_runner(spec, name, float(force), options.contact_time_constant_s)


def _gimbal(spec: mujoco.MjSpec, robot: RobotParameters) -> None:
    """Let trailers pitch and roll on their hitches, after they have turned."""
    for i, hitch in enumerate(robot.hitches):
        if hitch.gimballed:
            for name, axis in (("pitch", [0.0, 1.0, 0.0]), ("roll", [1.0, 0.0, 0.0])):
                spec.body(trailer_part("trailer", i)).add_joint(
                    name=trailer_part(f"hitch_{name}", i),
                    type=mujoco.mjtJoint.mjJNT_HINGE,
                    axis=axis,
                    damping=[GIMBAL_DAMPING * robot.trailers[i].swing_inertia_kg_m2, 0.0, 0.0],
                )


def _scale_looks(spec: mujoco.MjSpec, robot: RobotParameters) -> None:
    """Draw a larger robot larger; wheels and balls have their own sizes."""
    if (scale := robot.looks_scale) == 1.0:
        return
    bodies = ["tractor", *(trailer_part("trailer", i) for i in range(len(robot.trailers)))]
    for name in (*bodies, *WHEELS):
        for geom in spec.body(name).geoms:
            seen = geom.group == VISUAL_GROUP and not geom.name.startswith("tyre")
            if seen or geom.name.endswith("_hull"):
                geom.size, geom.pos = scale * geom.size, scale * geom.pos
        for site in spec.body(name).sites:
            if site.name.rpartition("/")[2].startswith("label_"):
                site.pos = scale * site.pos


def _loosen_pin(spec: mujoco.MjSpec, play_m: float, time_constant_s: float) -> None:
    """Let the trailer's pin move in its hole, as far from P as a slack string would."""
    trailer = spec.body("trailer")
    for name, axis in (("play_x", [1.0, 0.0, 0.0]), ("play_y", [0.0, 1.0, 0.0])):
        trailer.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    trailer.add_site(name="pin")
    # a lower limit of zero length would pull, in no direction
    limits = [-1.0, play_m]
    string = spec.add_tendon(
        name="play", limited=True, range=limits, solref_limit=[time_constant_s, 1.0]
    )
    string.wrap_site("P")
    string.wrap_site("pin")
