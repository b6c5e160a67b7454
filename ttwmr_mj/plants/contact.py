"""The robot in MuJoCo contact physics, a batch of simulations on `mujoco.batch.Batch`."""

import copy
import os
from functools import partial

import numpy as np

from ttwmr_mj.config import column, columns, each, rows_of
from ttwmr_mj.dynamics.floor.ground import LEVEL, Ground
from ttwmr_mj.dynamics.floor.regions import friction_at
from ttwmr_mj.dynamics.kinematics import wheels_from_twist, workspace_rate
from ttwmr_mj.dynamics.motor import Drive, Firmware
from ttwmr_mj.dynamics.servo import Ramp
from ttwmr_mj.plants.base import Plant
from ttwmr_mj.plants.contact_readings import contact_columns, joined, read_contacts
from ttwmr_mj.plants.footing import Footing
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.engine import Faults, batch, mujoco
from ttwmr_mj.plants.model.joints import HEIGHT, Joints, as_slice
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.plants.model.names import WHEELS, casters, contacts, trailer_part
from ttwmr_mj.plants.model.relief import Relief
from ttwmr_mj.plants.model.settled import settled_qpos
from ttwmr_mj.plants.stance import Stance, Tyres
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA1, THETA2, BoolArray, FloatArray, RobotState, unwrap_near

LET_DOWN_S = 1.0  # on uneven ground: a fall of a few mm, and what rattles after it
_RINGS = np.linspace(0.0, 1.0, 11)[:, None, None]
_AROUND = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
AROUND: FloatArray = (_RINGS * np.stack([np.cos(_AROUND), np.sin(_AROUND)], axis=-1)).reshape(-1, 2)


class ContactPlant(Plant):
    """MuJoCo rigid bodies, contacts and servos behind the `Plant` protocol.

    A single run is a batch of one, so there is one code path; results are the same bits at any
    thread count and batch size. Robot, options and ground may be those of every simulation
    (`config.stacked`): each then runs on a compiled model of its own.

    Attributes:
        models: of each simulation, equal ones once.
        model: the first of them; all have the same parts in the same places.
    """

    def __init__(
        self,
        robot: RobotParameters,
        options: ContactOptions,
        nsim: int = 1,
        nthread: int = 0,
        *,
        ground: Ground = LEVEL,
        torque_input: bool = False,
    ) -> None:
        log = mujoco.MjLogConfig.get()
        # warnings are counted and told by `fault`; MuJoCo would also litter the working directory
        log.logto_file = log.logto_console = False
        mujoco.MjLogConfig.set(log)
        self.nsim = nsim
        self.time_step_s = options.timestep_s
        built = [rows_of(part, nsim) for part in (robot, options, ground)]
        self.models = _compiled(list(zip(*built, strict=True)), torque_input=torque_input)
        self.model = self.models[0]
        self._joints = Joints(self.model)
        self._drives = as_slice([int(self.model.actuator(name).id) for name in WHEELS])
        self._robot, self._torque_input = robot, torque_input
        drive = each(partial(Drive.of, torque_input=torque_input), robot.servo)
        self._back = column(drive.back)
        self._firmware = Firmware(columns(motor)) if (motor := robot.servo.motor) else None
        self._regions, self._elsewhere = columns(ground).regions, column(options.floor_friction)
        leans = any(np.any(trailer.com_lateral_m) for trailer in robot.trailers)
        threads = nthread or min(nsim, os.cpu_count() or 1)
        in_own_scene = [row.model_path is not None for row in rows_of(options, nsim)]
        self._settled_qpos = settled_qpos(self.models, in_own_scene, threads, leans=leans)
        self._batch = batch.Batch(self.model, nsim, threads)
        self._own_models: list[mujoco.MjModel] = []
        if any(model is not self.model for model in self.models):
            # whose floor is written to as it drives needs a model of its own
            own = [copy.copy(m) for m in self.models] if self._regions else self.models
            self._batch.set_models(own)
            self._own_models = own
        self._qpos, self._qvel = self._batch.bind("qpos"), self._batch.bind("qvel")
        self._sensordata = self._batch.bind("sensordata")
        self._control = self._batch.bind("ctrl")
        self._forces = self._batch.bind("xfrc_applied")
        self._faults = Faults(self._batch)
        self._body_position = self._batch.bind("xpos")
        self._body_axes = self._batch.bind("xmat")
        self._find_bodies(self._joints.trailers)
        self._theta1: FloatArray = np.zeros(nsim)
        self._first_theta1 = self._theta1
        reliefs = {id(model): Relief(model) for model in self.models}
        self._reliefs = [reliefs[id(model)] for model in self.models]
        self._stance = self._standing_on(self._reliefs)
        self._reach_m = max(map(_reach_m, rows_of(robot, nsim)))
        self._setpoint: FloatArray = np.zeros((nsim, 2))
        self._ramp = Ramp(robot.servo, np.zeros(0))
        self._record: tuple[str, ...] = ()
        self._passed: list[tuple[FloatArray, FloatArray, FloatArray]] = []

    def _find_bodies(self, trailers: int) -> None:
        """Where the model has the bodies that are pushed, roll or touch the ground."""
        names = ("tractor", *(trailer_part("trailer", i) for i in range(trailers)))
        self._chassis = {name: int(self.model.body(name).id) for name in names}
        self._balls = [int(self.model.body(name).id) for name in casters(trailers)]
        touching = contacts(trailers)
        self._touching = [int(self.model.body(name).id) for name in touching]
        self._touching_geoms = [int(self.model.geom(name).id) for name in touching]
        self._contact_columns = contact_columns(self.model, touching)

    def _standing_on(self, reliefs: list[Relief]) -> Stance:
        """What tells how the robots stand on their grounds."""
        geoms, bodies = self._touching_geoms[: len(WHEELS)], self._touching[: len(WHEELS)]
        cylinder = mujoco.mjtGeom.mjGEOM_CYLINDER
        tyres = [
            Tyres(
                model.geom_size[geoms, 0],
                model.geom_size[geoms, 1],
                model.geom_type[geoms] == cylinder,
                model.body_pos[bodies],
            )
            for model in self.models
        ]
        settled = self._settled_qpos[:, self._joints.free_qpos + HEIGHT]
        columns = self._contact_columns[: len(WHEELS), 0]  # of the strongest contacts
        return Stance(reliefs, self._joints, settled, tyres, columns)

    def reset(self, initial: RobotState) -> None:
        """Stand the robots, settled in their contacts, at the initial pose and velocity.

        On uneven ground they are settled where they come to rest, as `_settled_on_relief` says.
        """
        self._batch.reset()
        self._faults.forget()
        standing = self._settled_qpos
        if not all(relief.flat for relief in self._reliefs):
            standing = self._settled_on_relief(initial)
        # servos at the wheel speeds that roll without slip
        twist = workspace_rate(initial.q, initial.q_rate)[:, :2]
        self._setpoint = wheels_from_twist(twist, self._robot)
        self._qpos[:] = self._joints.standing(standing, initial.q)
        self._qvel[:] = self._joints.moving(initial.q_rate, self._setpoint, self.model.nv)
        self._theta1 = self._first_theta1 = np.array(initial.q[:, THETA1])
        if self._firmware:
            given = np.zeros_like(self._setpoint) if self._torque_input else self._setpoint
            angles = np.array(self._qpos[:, self._joints.wheel_qpos])
            self._firmware.reset(angles, self._setpoint, given)
        self._passed.clear()
        # inputs that give no torque: of zero, servos would brake in the first readings
        self._control[:, self._drives] = self._back * self._setpoint
        with self._faults.kept():
            self._batch.forward()
        if self._regions:
            self._feel_floor()
        self._roll_balls()

    def _settled_on_relief(self, initial: RobotState) -> FloatArray:
        """(nsim, nq) patterns of yaw 0 of robots that were let down on uneven ground at q.

        They are held at q meanwhile, free to sink, tilt and roll: what would slide off the edge of
        a plate, or turn downhill, does so from there once the run begins.
        """
        joints = self._joints
        pattern = joints.standing(self._settled_qpos, initial.q)
        for i, relief in enumerate(self._reliefs):
            around = initial.q[i, :2] + self._reach_m * AROUND
            pattern[i, joints.free_qpos + HEIGHT] += relief.at(around).max()
        self._qpos[:], self._qvel[:] = pattern, 0.0
        for _ in range(round(LET_DOWN_S / self.time_step_s)):
            with self._faults.kept():
                self._batch.rollout(1, np.zeros((self.nsim, 1, 2)))
            pattern = joints.turned_back(self._qpos)
            self._qpos[:] = joints.standing(pattern, initial.q)
            joints.stop(self._qvel)
        self._batch.reset()
        return pattern

    def stance(self) -> FloatArray:
        """(nsim, 19) of how the robots stand on the ground, for `footing`."""
        return self._stance.read(self._qpos, self._qvel, self._sensordata)

    def footing(self, stance: FloatArray) -> Footing:
        """How the robots stood, for stances (..., nsim, 19)."""
        return self._stance.footing(stance)

    def sound(self, stance: FloatArray) -> bool:
        """Whether nothing failed in MuJoCo, and the robots plainly stand."""
        return not self._faults.any() and self._stance.stands(stance)

    def _roll_balls(self) -> None:
        """Spin the casters' balls so that they roll: their points of contact are at rest."""
        contacts = read_contacts(self.contact_readings())
        slip = contacts.slip_m_s[:, len(WHEELS) :]  # without spin, the velocity of the centre
        if not slip.any():
            return
        lever = self._body_position[:, self._balls] - contacts.position_m[:, len(WHEELS) :]
        spin = np.cross(lever, slip) / (lever**2).sum(axis=-1, keepdims=True)
        axes = self._body_axes[:, self._balls].reshape(*spin.shape, 3)
        local = np.einsum("...ji,...j->...i", axes, spin)  # MuJoCo wants it in the ball's axes
        for ball, start in enumerate(self._joints.ball_qvel):
            self._qvel[:, start : start + 3] += local[:, ball]
        with self._faults.kept():
            self._batch.forward()

    def state(self) -> RobotState:
        """Pose and velocity of P and of both halves, read from the joints."""
        q, q_rate = self._joints.planar(self._qpos, self._qvel)
        theta1 = unwrap_near(q[:, THETA1], self._theta1)
        q[:, THETA2:] += (theta1 - q[:, THETA1])[:, None]
        q[:, THETA1] = self._theta1 = theta1
        return RobotState(q=q, q_rate=q_rate)

    def wheel_speed_rad_s(self) -> FloatArray:
        """(nsim, 2) wheel speeds (right, left) relative to the chassis."""
        return np.array(self._qvel[:, self._joints.wheel_qvel])

    def encoder_angle_rad(self) -> FloatArray:
        """(nsim, 2) angles of the wheels, to a count of a motor's encoder."""
        angles = np.array(self._qpos[:, self._joints.wheel_qpos])
        return self._firmware.counted(angles) if self._firmware else angles

    def joint_positions(self) -> FloatArray:
        """(nsim, nq) MuJoCo generalized positions, for drawing the robot."""
        return np.array(self._qpos)

    def contact_readings(self) -> FloatArray:
        """(nsim, 3 + 2n, 15) contact sensors of the last physics step, for `read_contacts`."""
        return joined(self._sensordata[:, self._contact_columns])

    def advance(self, command: FloatArray, steps: int) -> None:
        """Hold a command (nsim, 2) (right, left) for a number of physics steps.

        Wheel speeds [rad/s] are reached by the servos' ramp; wheel torques [N·m] act at once.
        """
        if self._regions:
            self._feel_floor()
        if self._torque_input:
            control = np.repeat(command[:, None], steps, axis=1)
        else:
            if self._ramp.time_s.size != steps:
                time_s = self.time_step_s * np.arange(1, steps + 1, dtype=np.float64)
                self._ramp = Ramp(self._robot.servo, time_s)
            control = self._ramp(self._setpoint, command)
            self._setpoint = control[:, -1]
        if self._firmware is None:
            self._step(control)
            return
        voltage = (
            self._firmware.torque_voltage if self._torque_input else self._firmware.speed_voltage
        )
        every = round(self._firmware.period_s / self.time_step_s)
        for start in range(0, steps, every):
            angles = np.array(self._qpos[:, self._joints.wheel_qpos])
            chunk = control[:, start : start + every]
            self._step(np.repeat(voltage(angles, chunk[:, -1])[:, None], chunk.shape[1], axis=1))

    def _step(self, inputs: FloatArray) -> None:
        """Physics steps under inputs (nsim, n, 2) of the wheels' drives, as of `Drive`."""
        with self._faults.kept():
            passed = self._batch.rollout(
                inputs.shape[1], inputs[..., self._drives], record=self._record
            )
            if passed:
                self._passed.append((passed["qpos"], passed["qvel"], inputs))

    def _feel_floor(self) -> None:
        """Give wheels and balls the friction of where they are now, until this is called again."""
        places = self._body_position[:, self._touching, :2]
        friction = friction_at(self._regions, places, self._elsewhere)
        if not self._own_models:
            self._batch.expand("geom_friction")[:, self._touching_geoms, 0] = friction
        for model, values in zip(self._own_models, friction, strict=False):
            model.geom_friction[self._touching_geoms, 0] = values

    def push(self, forces_n: dict[str, FloatArray]) -> None:
        """From now on, push bodies at their chassis' centres of mass.

        Args:
            forces_n: "tractor", "trailer", "trailer_2/trailer", … → (2,) or (nsim, 2) force, world
                frame; a body that is not named is left alone.
        """
        self._forces[:] = 0.0
        for body, force in forces_n.items():
            self._forces[:, self._chassis[body], :2] = force

    def keep_physics_rate(self) -> None:
        """From now on, keep the state after every physics step, for `physics_rate_states`."""
        self._record = ("qpos", "qvel")

    def physics_rate_states(self) -> tuple[FloatArray, RobotState, FloatArray]:
        """Times (n,), q and rates (nsim, n, 3 + trailers), wheel speeds (nsim, n, 2) as kept."""
        qpos, qvel, _ = self._kept()
        q, q_rate = self._joints.planar(qpos, qvel)
        wrapped = np.concatenate([self._first_theta1[:, None], q[..., THETA1]], axis=1)
        turns = np.unwrap(wrapped, axis=1)[:, 1:] - q[..., THETA1]
        q[..., THETA1:] += turns[..., None]
        time_s = self.time_step_s * np.arange(1, q.shape[1] + 1, dtype=np.float64)
        return time_s, RobotState(q=q, q_rate=q_rate), qvel[..., self._joints.wheel_qvel]

    def physics_rate_inputs(self) -> FloatArray:
        """(nsim, n, 2) inputs of the wheels' drives in each of these steps, as of `Drive`."""
        return self._kept()[2]

    def _kept(self) -> list[FloatArray]:
        return [np.concatenate(parts, axis=1) for parts in zip(*self._passed, strict=True)]

    def failed(self) -> BoolArray:
        """(nsim,) simulations in which MuJoCo warned or raised an error."""
        return self._faults.failed()

    def fault(self, index: int) -> str:
        """MuJoCo's warnings and errors of one simulation, in its words."""
        return self._faults.of(index)


def _compiled(
    robots: list[tuple[RobotParameters, ContactOptions, Ground]], *, torque_input: bool
) -> list[mujoco.MjModel]:
    """A model for each robot in its laboratory, equal ones only once."""
    models = {
        robot: build_model(*robot, torque_input=torque_input) for robot in dict.fromkeys(robots)
    }
    return [models[robot] for robot in robots]


def _reach_m(robot: RobotParameters) -> float:
    """No part of a robot is further from P than that."""
    towed = sum(trailer.next_hitch_offset_m or 0.0 for trailer in robot.trailers)
    last = robot.trailers[-1].com_offset_m + robot.casters.trailer_half_spacing_m
    return max(robot.casters.tractor_position_m, towed + last) + robot.casters.radius_m
