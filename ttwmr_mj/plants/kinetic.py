"""The kinetic model (Eq. 11-23, corrected) as a plant: wheel torques drive it.

The wheels roll without slip. Dry friction of the hitch and of balls fades near standstill; the
integration step is short enough for the fastest of spring, damper and friction.
"""

import math
from itertools import product

import numpy as np

from ttwmr_mj.dynamics.floor.balls import all_held_back, held_back
from ttwmr_mj.dynamics.floor.ground import LEVEL, Ground
from ttwmr_mj.dynamics.integrate import runge_kutta
from ttwmr_mj.dynamics.kinematics import q_rate, wheels_from_twist, workspace_rate
from ttwmr_mj.dynamics.kinetics import first_moments
from ttwmr_mj.dynamics.torques import FADING_M_S, FADING_RAD_S, acceleration, spun_mass_matrix
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.base import EquationPlant
from ttwmr_mj.plants.swing import RK4_STABLE_RADIUS
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA1, BoolArray, FloatArray, RobotState

LEAST_STEP_S = 5e-5  # 660 in a control period, which take several times as long as they simulate


class KineticPlant(EquationPlant):
    """A batch of robots that obey wheel torques, within what the servos can give at standstill.

    A simulation's numbers do not depend on the batch it runs in, and mirrored torques give exactly
    mirrored motion.
    """

    def __init__(
        self,
        robot: RobotParameters,
        nsim: int,
        time_step_s: float,
        max_integration_step_s: float,
        ground: Ground = LEVEL,
    ) -> None:
        """Build the plant, at rest at the origin.

        Args:
            robot: every number of it; of its servo the largest torque and the inertia.
            nsim: simulations in the batch.
            time_step_s: duration of one step of `advance`.
            max_integration_step_s: upper bound of the Runge-Kutta step.
            ground: the floor.

        Raises:
            InputError: the steps that hitch and balls need are too short to be taken.
        """
        stable_s = _stable_step_s(robot, ground)
        if stable_s < LEAST_STEP_S:
            raise InputError.at(
                "robot",
                "springs, dampers and friction of the hitches, and what the balls resist with, "
                f"need steps of {stable_s:.2g} s where wheel torques drive the analytic plant",
                allowed=f"at least {LEAST_STEP_S:g} s",
                hint="lower robot.hitch.* or robot.casters.*, or drive contact physics",
            )
        self.nsim, self.time_step_s = nsim, time_step_s
        self._robot, self._ground = robot, ground
        self._longest_s = min(max_integration_step_s, stable_s)
        self.reset(RobotState.at_rest(0.0, 0.0, 0.0, [0.0] * len(robot.trailers), nsim))

    def reset(self, initial: RobotState) -> None:
        """Take over pose and motion; a sideways velocity of P is dropped (Eq. 3)."""
        rate = workspace_rate(initial.q, initial.q_rate)
        self._theta1 = initial.q[:, THETA1]  # where the wheels' angles are zero
        path = np.zeros((self.nsim, 1))
        self._state: FloatArray = np.concatenate([initial.q, rate, path], axis=-1)

    def state(self) -> RobotState:
        """The state now, as fresh arrays."""
        q, rate, _ = self._parts(self._state)
        return RobotState(q=q.copy(), q_rate=q_rate(q, rate))

    def wheel_speed_rad_s(self) -> FloatArray:
        """(nsim, 2) wheel speeds (right, left): they roll."""
        return wheels_from_twist(self._parts(self._state)[1][:, :2], self._robot)

    def encoder_angle_rad(self) -> FloatArray:
        """(nsim, 2) angles of the wheels, exactly."""
        turned = np.stack([self._state[:, -1], self._state[:, THETA1] - self._theta1], axis=-1)
        return wheels_from_twist(turned, self._robot)

    def failed(self) -> BoolArray:
        """(nsim,) simulations with a state that is not finite."""
        return np.asarray(~np.isfinite(self._state.sum(axis=1)))

    def advance(self, command: FloatArray, steps: int) -> None:
        """Hold wheel torques (nsim, 2) (right, left) [N·m] for a number of steps."""
        limit = self._robot.servo.largest_torque_n_m
        torque = np.clip(command, -limit, limit)

        def rate(_: float, state: FloatArray) -> FloatArray:
            q, xi, _path = self._parts(state)
            change = acceleration(q, xi, torque, self._robot, self._ground)
            return np.concatenate([q_rate(q, xi), change, xi[:, :1]], axis=-1)

        duration_s = steps * self.time_step_s
        count = max(1, math.ceil(duration_s / self._longest_s - 1e-9))  # 0.033/0.011 is three
        for _ in range(count):
            self._state = runge_kutta(rate, self._state, duration_s / count)

    def _parts(self, state: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Views of q (nsim, 3 + n), ξ̇ (nsim, 2 + n) and the path of P (nsim, 1) in states."""
        width = 3 + len(self._robot.trailers)
        return state[:, :width], state[:, width:-1], state[:, -1:]


def _stable_step_s(robot: RobotParameters, ground: Ground) -> float:
    """Longest stable step for the hitch, as an oscillator of its two halves' inertias."""
    if len(robot.trailers) > 1:
        return _train_step_s(robot, ground)
    mass = spun_mass_matrix(np.zeros(4), robot)
    # the trailer swings most easily with the tractor free to yield along the heading
    swinging = mass[2, 2] - first_moments(robot)[1] ** 2 / mass[0, 0]
    inertia = 1.0 / (1.0 / mass[1, 1] + 1.0 / swinging)
    hitch, casters = robot.hitch, robot.casters
    forces = held_back(robot, casters.rolling_resistance_m, ground.normal_gravity_m_s2)
    lever = robot.trailer.com_offset_m**2 + casters.trailer_half_spacing_m**2
    balls = forces.nose * casters.tractor_position_m**2 + (forces.right + forces.left) * lever
    damping = hitch.damping_n_m_s_rad + balls / FADING_M_S
    damping += hitch.coulomb_friction_n_m / FADING_RAD_S
    linear = np.array([[0.0, 1.0], [-hitch.stiffness_n_m_rad / inertia, -damping / inertia]])
    fastest = float(np.abs(np.linalg.eigvals(linear)).max())
    return RK4_STABLE_RADIUS / fastest if fastest else math.inf


def _train_step_s(robot: RobotParameters, ground: Ground) -> float:
    """The same for a train, by eigenvalues, over all that trailers may be turned around."""
    width = 3 + len(robot.trailers)
    stiffness, damping = (np.zeros((width - 1, width - 1)) for _ in range(2))
    casters = robot.casters
    for i, (hitch, forces) in enumerate(
        zip(robot.hitches, all_held_back(robot, ground.normal_gravity_m_s2), strict=True)
    ):
        between = np.zeros(width - 1)
        between[i + 1 : i + 3] = -1.0, 1.0
        dry = hitch.coulomb_friction_n_m / FADING_RAD_S
        stiffness += hitch.stiffness_n_m_rad * np.outer(between, between)
        damping += (hitch.damping_n_m_s_rad + dry) * np.outer(between, between)
        # a ball moves by the lengths of all before it at most
        lever = np.zeros(width - 1)
        lever[2 : i + 2] = [trailer.next_hitch_offset_m for trailer in robot.trailers[:i]]
        lever[i + 2] = np.hypot(robot.trailers[i].com_offset_m, casters.trailer_half_spacing_m)
        lever[0] = 1.0
        damping += (forces.right + forces.left) / FADING_M_S * np.outer(lever, lever)
    damping[1, 1] += forces.nose * casters.tractor_position_m**2 / FADING_M_S
    longest = math.inf
    for turned in product((0.0, 0.5 * np.pi, np.pi), repeat=width - 3):
        mass = spun_mass_matrix(np.array([0.0, 0.0, 0.0, *turned]), robot)
        inverse, zero = np.linalg.inv(mass), np.zeros_like(mass)
        linear = np.block([[zero, np.eye(width - 1)], [-inverse @ stiffness, -inverse @ damping]])
        fastest = float(np.abs(np.linalg.eigvals(linear)).max())
        longest = min(longest, RK4_STABLE_RADIUS / fastest) if fastest > 0.0 else longest
    return longest
