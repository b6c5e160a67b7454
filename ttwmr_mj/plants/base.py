"""What the closed loop needs of a plant: a state, and time that advances under a command."""

from abc import abstractmethod
from typing import Protocol

import numpy as np

from ttwmr_mj.dynamics.servo import Stretches, cut, ramp
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.footing import Footing
from ttwmr_mj.robot import Servo
from ttwmr_mj.state import BoolArray, FloatArray, RobotState


class Plant(Protocol):
    """A batch of robots that obey wheel-speed commands, or wheel torques if built for these.

    Attributes:
        nsim: simulations in the batch.
        time_step_s: the step in which the plant counts time.
    """

    nsim: int
    time_step_s: float

    def reset(self, initial: RobotState) -> None:
        """Put every robot at rest or in motion as `initial` says, servos at that wheel speed."""

    def state(self) -> RobotState:
        """The true state now, as fresh arrays."""

    def wheel_speed_rad_s(self) -> FloatArray:
        """(nsim, 2) true wheel speeds (right, left)."""

    def encoder_angle_rad(self) -> FloatArray:
        """(nsim, 2) angles the wheels have turned, as their encoders have them.

        Only plants that torques drive are asked.
        """

    def advance(self, command: FloatArray, steps: int) -> None:
        """Hold commanded wheel speeds or torques (nsim, 2) (right, left) for a number of steps."""

    def push(self, forces_n: dict[str, FloatArray]) -> None:
        """From now on, push bodies (`plants.model.names`): (2,) or (nsim, 2), world frame."""

    def joint_positions(self) -> FloatArray:
        """(nsim, nq) MuJoCo's generalized positions; nq = 0 where there is no such thing."""

    def contact_readings(self) -> FloatArray:
        """(nsim, ncontact, 15) contact sensors; ncontact = 0 where there are no contacts."""

    def stance(self) -> FloatArray:
        """(nsim, m) what `footing` tells from how the robots stand now.

        m = 0 where there is nothing to stand on.
        """

    def footing(self, stance: FloatArray) -> Footing:
        """How the robots stood, for any number of stances (..., nsim, m); only if m > 0."""

    def sound(self, stance: FloatArray) -> bool:
        """Whether it is plain at a glance that no simulation has failed, and all robots stand.

        If it is not, `failed` and `footing` know.
        """

    def failed(self) -> BoolArray:
        """(nsim,) simulations whose physics broke."""

    def fault(self, index: int) -> str:
        """What broke in one failed simulation, in words."""


class EquationPlant(Plant):
    """What plants made of equations have in common: no joints, contacts or pushes."""

    def push(self, forces_n: dict[str, FloatArray]) -> None:
        """Not supported: the tractor's motion is prescribed, so a force on it has no meaning here.

        Raises:
            InputError: always, if there is a force.
        """
        if forces_n:
            raise InputError.at("plant.pushes", "only plant.kind = 'contact' can be pushed")

    def joint_positions(self) -> FloatArray:
        """(nsim, 0): the model has no joints."""
        return np.empty((self.nsim, 0))

    def contact_readings(self) -> FloatArray:
        """(nsim, 0, 15): the model has no contacts."""
        return np.empty((self.nsim, 0, 15))

    def stance(self) -> FloatArray:
        """(nsim, 0): the model has no third dimension."""
        return np.empty((self.nsim, 0))

    def footing(self, stance: FloatArray) -> Footing:
        """Never asked: there is nothing to stand on."""
        raise NotImplementedError

    def sound(self, stance: FloatArray) -> bool:
        """Whether no simulation has failed."""
        del stance
        return not self.failed().any()

    def fault(self, index: int) -> str:
        """What broke in one failed simulation: there is one way to break."""
        return f"the state is not finite: {self.state().q[index].tolist()}"


class ModelPlant(EquationPlant):
    """What plants made of equations of motion under prescribed wheel speeds have in common.

    Wheels follow `dynamics.servo`, so under one command they are piecewise linear in time, with a
    kink where a setpoint arrives. The plant moves over stretches of time between these.

    Attributes:
        nsim: simulations in the batch.
        time_step_s: the step in which commands are held.
    """

    _setpoint: FloatArray  # (nsim, 2) of the wheels, as of `reset` and `follow`

    def __init__(
        self,
        servo: Servo,
        nsim: int,
        time_step_s: float,
        max_integration_step_s: float,
        physics_step_s: float = 0.0,
        *,
        trailers: int = 1,
    ) -> None:
        """Build the plant, at rest at the origin.

        Args:
            servo: its limits.
            nsim: simulations in the batch.
            time_step_s: duration of one step of `advance`.
            max_integration_step_s: upper bound of the Runge-Kutta step.
            physics_step_s: as of `servo.cut`.
            trailers: behind the tractor.
        """
        self.nsim = nsim
        self.time_step_s = time_step_s
        self._servo = servo
        self._longest_s = max_integration_step_s
        self._physics_step_s = physics_step_s
        self.reset(RobotState.at_rest(0.0, 0.0, 0.0, [0.0] * trailers, nsim))

    @abstractmethod
    def follow(self, stretches: Stretches, end_rad_s: FloatArray) -> None:
        """Turn the wheels as told, whatever the servo could do.

        Args:
            stretches: what the wheels do, from their speeds now on; none longer than the plant's
                integration step.
            end_rad_s: (nsim, 2) wheel speeds at their end, the new `_setpoint`.
        """

    def advance(self, command: FloatArray, steps: int) -> None:
        """Hold commanded wheel speeds for a time.

        Args:
            command: (nsim, 2) right, left; the servo's limits apply.
            steps: number of `time_step_s`, at least one.
        """
        change = self._setpoint, command, self._servo
        duration_s = steps * self.time_step_s
        stretches = cut(*change, duration_s, self._longest_s, self._physics_step_s)
        self.follow(stretches.lasting, ramp(*change, np.array([duration_s]))[:, 0])

    def encoder_angle_rad(self) -> FloatArray:
        """Never asked: wheel speeds drive these plants."""
        raise NotImplementedError

    def wheel_speed_rad_s(self) -> FloatArray:
        """(nsim, 2) wheel speeds (right, left), equal to the servos' setpoints."""
        return self._setpoint.copy()
