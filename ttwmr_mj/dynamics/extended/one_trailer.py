"""The hybrid model (Eq. 24-29) with what a real robot adds to it, in closed form.

Droop and lag of the servo, side slip, hitch friction, rolling balls. All are small, so what they
cost is computed from the motion of the ideal robot and taken off it: there are no new states and
nothing stiff. What jumps with the wheels' acceleration, as their lag does, would be an impulse on
the trailer; integrated by parts it becomes a kick κ of θ̇2, and the state is the swing rate θ̇2 − κ.

- A wheel that pushes with F and speeds up at ω̇ needs the torque r·F + I·ω̇, which a speed loop of
  gain I/T gives for a speed error of that torque times T/I. T is the servo's time constant without
  load, I the inertia of wheel and gears.
- Side slip is s times the centripetal acceleration u1·u2: what soft contacts let through before
  they push back. It points outward.
- A ball that rolls resists acceleration with 2/5 of its mass, at its place on the floor, and its
  motion with δ/ρ of its load and the friction of its socket (`dynamics.floor.balls`).
- On a slope, gravity's pull along the floor is taken off the accelerations where these stand for
  forces. It causes no side slip, which is the contacts' lag behind a turning wheel.

The state is x, y, θ1, θ2 and the swing rate.

Arrays have a leading axis of nsim simulations; every parameter is a number or (nsim,), those of
robot and ground too (`config.stacked`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from ttwmr_mj.config import column, each, picked
from ttwmr_mj.dynamics.extended.dry import dry_step
from ttwmr_mj.dynamics.extended.parameters import ExtendedParameters, driven_inertia
from ttwmr_mj.dynamics.floor.balls import (
    FADING_M_S,
    Forces,
    direction,
    held_back,
    resisting_torque,
    slowing,
)
from ttwmr_mj.dynamics.floor.ground import LEVEL, Ground, Pull
from ttwmr_mj.dynamics.hybrid import sideways
from ttwmr_mj.dynamics.integrate import runge_kutta
from ttwmr_mj.dynamics.kinematics import Value, rolling, rolling_wheels, to_world
from ttwmr_mj.dynamics.kinetics import first_moments, total_mass
from ttwmr_mj.dynamics.servo import Stretches
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import BoolArray, FloatArray

ROLLING_SHARE = 0.4  # inertia of a solid sphere per m·ρ²


class Motion(NamedTuple):
    """How the robot moves, (nsim,) each, in SI units.

    Of several trailers (nsim, n): θ2 − θ1, θ3 − θ1, … and their rates.
    """

    u1: FloatArray  # of P, ahead
    u2: FloatArray  # θ̇1
    u1_rate: FloatArray
    u2_rate: FloatArray
    hitch: FloatArray  # θ2 − θ1
    trailer_rate: FloatArray  # θ̇2
    pull: Pull  # of gravity, seen from the tractor


@dataclass(frozen=True, slots=True)
class ExtendedModel:
    """The equations of motion."""

    robot: RobotParameters  # Table I, spring, geometry of the balls
    values: dict[str, Value]  # parameter name of `ExtendedParameters` → number or (nsim,)
    physics_step_s: float  # the one parameter that is the same for all simulations
    ground: Ground = LEVEL
    fading_m_s: Value = FADING_M_S  # a slower ball is held back by less

    @classmethod
    def of(
        cls, robot: RobotParameters, parameters: ExtendedParameters, ground: Ground | None = None
    ) -> ExtendedModel:
        """The model with one set of parameters, on level floor where no ground is given."""
        values = {name: getattr(parameters, name) for name in ExtendedParameters.model_fields}
        return cls(robot, values, parameters.physics_step_s, ground or LEVEL)

    def softened(self, longest_s: float) -> Self:
        """The same for steps up to a length: a ball that is nearly at rest does not chatter."""
        return replace(self, fading_m_s=np.maximum(FADING_M_S, self._slowing * longest_s))

    @property
    def _slowing(self) -> Value:
        """By what balls slow each other at most [m/s²], swinging about P."""
        length, inertia = self.robot.trailer.com_offset_m, self.swing_inertia_kg_m2
        return slowing(self._held_back, length, inertia)

    @property
    def swing_inertia_kg_m2(self) -> Value:
        """J2 + m2·l² (Eq. 17) and the trailer's rolling balls, about P."""
        return self.robot.swing_inertia_kg_m2 + self._balls * each(_ball_lever_squared, self.robot)

    def rate(
        self, state: FloatArray, wheels: FloatArray, wheels_rate: FloatArray, lead_s: FloatArray
    ) -> FloatArray:
        """The state's rates (5, nsim), without dry friction.

        Args:
            state: (5, nsim) x, y, θ1, θ2, swing rate.
            wheels: (nsim, 2) setpoints (right, left) [rad/s].
            wheels_rate: (nsim, 2) their rates [rad/s²].
            lead_s: (nsim, 2) how far the wheels are ahead of their setpoints.
        """
        _, _, theta1, theta2, swing_rate = state
        hitch = theta2 - theta1
        # once with the ideal speeds for the forces, once with what these leave of them
        pull = self.ground.pull(theta1)
        ideal = Motion(*self.twist(wheels), *self.twist(wheels_rate), hitch, swing_rate, pull)
        push = self._push(ideal, self._theta2_acceleration(ideal))
        u1, u2 = self.twist(wheels + lead_s * wheels_rate + self._shortfall(push, wheels_rate))
        tail, lean = self._tail
        reach = tail / self.swing_inertia_kg_m2 * (u1 - ideal.u1)
        theta2_rate = swing_rate - reach * np.sin(hitch - lean)
        turning = self._theta2_acceleration(ideal._replace(u1=u1, u2=u2, trailer_rate=theta2_rate))
        turning += reach * np.cos(hitch - lean) * (theta2_rate - u2)
        velocity = to_world(theta1, u1, -self.values["slip_time_s"] * u1 * u2)
        return np.stack([*velocity, u2, theta2_rate, turning])

    def step(self, state: FloatArray, stretch: Stretches) -> FloatArray:
        """The state after one Runge-Kutta step over a stretch of each simulation.

        Of several, where dry friction stops or holds a hitch.
        """
        if self.dry:
            return dry_step(self, state, stretch)
        duration_s, start, rate, lead_s = stretch
        change = duration_s[:, None] * rate

        def slope(share: float, now: FloatArray) -> FloatArray:
            return self.rate(now, start + share * change, rate, lead_s)

        return runge_kutta(slope, state, duration_s)

    def rows(self, which: BoolArray) -> Self:
        """The equations of some of the simulations (nsim,)."""
        return replace(
            self,
            robot=picked(self.robot, which),
            values={name: picked(value, which) for name, value in self.values.items()},
            ground=picked(self.ground, which),
            fading_m_s=picked(self.fading_m_s, which),
        )

    def yielding(self, state: FloatArray) -> FloatArray:
        """(nsim or 1, n, n) each hitch's acceleration [rad/s²] per torque [N·m] in each."""
        del state  # one trailer's inertia is the same however it is turned
        return np.reshape(1.0 / self.swing_inertia_kg_m2, (-1, 1, 1))

    @property
    def dry(self) -> bool:
        """Whether any simulation's hitch has dry friction."""
        return bool(np.any(np.asarray(self.values["hitch_coulomb_friction_n_m"]) > 0.0))

    def twist(self, wheels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(u1, u2) by Eq. 8-9 with the effective radius and track."""
        return rolling(wheels, *self._wheel_geometry)

    def wheels(self, twist: FloatArray) -> FloatArray:
        """(nsim, 2) setpoints that drive at a twist (nsim, 2): the inverse of `twist`."""
        return rolling_wheels(twist, *self._wheel_geometry)

    @property
    def _wheel_geometry(self) -> tuple[Value, Value, float]:
        """Effective radius and track, and the difference of the radii."""
        difference = self.robot.tractor.wheel_radius_difference_m
        return self.values["wheel_radius_m"], self.values["track_width_m"], difference

    @property
    def _balls(self) -> Value:
        """Mass [kg] that the trailer's two balls resist acceleration with."""
        return 2.0 * ROLLING_SHARE * self.values["caster_mass_kg"]

    @property
    def _tail(self) -> tuple[Value, Value]:
        """First moment about P that the trailer and its rolling balls pull with [kg·m].

        And the angle off the trailer's axis that it acts at (`robot.lean_rad`, without the balls).
        """
        trailer = self.robot.trailer
        along = (trailer.mass_kg + self._balls) * trailer.com_offset_m
        aside = trailer.mass_kg * trailer.com_lateral_m
        return np.hypot(along, aside), np.arctan2(aside, along)

    @property
    def _held_back(self) -> Forces:
        """What holds back the balls."""
        lever, weight = self.values["rolling_resistance_m"], self.ground.normal_gravity_m_s2
        return held_back(self.robot, lever, weight)

    def _hitch_torque(self, motion: Motion) -> FloatArray:
        """(nsim,) torque of spring and damper on the trailer [N·m]."""
        damping = self.values["hitch_damping_n_m_s_rad"] * (motion.trailer_rate - motion.u2)
        return np.asarray(-self.robot.hitch.stiffness_n_m_rad * motion.hitch - damping)

    def _theta2_acceleration(self, motion: Motion) -> FloatArray:
        """θ̈2 (Eq. 17) under spring, damper and rolling balls."""
        u1, u2, _, _, hitch, _, pull = motion
        slip = self.values["slip_time_s"]
        ahead, left = self._p_acceleration(motion)
        tail, lean = self._tail
        torque = tail * sideways(hitch - lean, ahead, left)
        torque -= first_moments(self.robot)[1] * sideways(hitch - self.robot.lean_rad, *pull)
        p_speed = u1, -slip * u1 * u2
        torque += self._hitch_torque(motion)
        balls = self.robot, self._held_back, self.fading_m_s
        torque += resisting_torque(hitch, p_speed, motion.trailer_rate, *balls)
        return np.asarray(torque / self.swing_inertia_kg_m2)

    def _p_acceleration(self, motion: Motion) -> tuple[FloatArray, FloatArray]:
        """(nsim,) of P, which slips, ahead and to the left."""
        u1, u2, u1_rate, u2_rate, *_ = motion
        slip = self.values["slip_time_s"]
        ahead = u1_rate + slip * u1 * u2**2
        return ahead, u1 * u2 - slip * (u1_rate * u2 + u1 * u2_rate)

    def _push(self, motion: Motion, swing: FloatArray) -> FloatArray:
        """(nsim, 2) force of each wheel on the floor (right, left) [N]: f and τ of Eq. 23."""
        u1, _, _, _, hitch, theta2_rate, _ = motion
        tail = first_moments(self.robot)[1]
        cos, sin = np.cos(hitch), np.sin(hitch)
        swung = hitch - self.robot.lean_rad
        towed = tail * (np.sin(swung) * swing + np.cos(swung) * theta2_rate**2)
        # what holds back the trailer's two balls, as far as they drag P along
        drag, length = self._held_back, self.robot.trailer.com_offset_m
        along, across = direction(u1 * cos, u1 * sin + length * theta2_rate, self.fading_m_s)
        towed += (drag.right + drag.left) * (along * cos + across * sin)
        return self._on_wheels(motion, towed, self._hitch_torque(motion))

    def _on_wheels(
        self, motion: Motion, towed_n: FloatArray, hitch_torque_n_m: FloatArray
    ) -> FloatArray:
        """Force of each wheel, for what swinging trailers and their balls pull P back with."""
        u1, u2, u1_rate, u2_rate, *_, pull = motion
        tractor, casters = self.robot.tractor, self.robot.casters
        nose = tractor.mass_kg * tractor.com_offset_m
        force = total_mass(self.robot) * (u1_rate - pull.ahead) - nose * u2**2 + towed_n
        yaw = tractor.yaw_inertia_kg_m2 + nose * tractor.com_offset_m
        torque = yaw * u2_rate + nose * (u1 * u2 - pull.left) + hitch_torque_n_m
        drag = self._held_back.nose
        ahead, aside = direction(u1, casters.tractor_position_m * u2, self.fading_m_s)
        force += drag * ahead
        torque += drag * casters.tractor_position_m * aside
        share = torque / self.values["track_width_m"]
        return np.stack([0.5 * force + share, 0.5 * force - share], axis=-1)

    def _shortfall(self, push: FloatArray, wheels_rate: FloatArray) -> FloatArray:
        """(nsim, 2) wheel speed minus setpoint [rad/s]."""
        lag, radius = (
            np.reshape(self.values[name], (-1, 1))
            for name in ("servo_time_constant_s", "wheel_radius_m")
        )
        inertia = column(each(driven_inertia, self.robot))
        return np.asarray(-lag * (wheels_rate + radius / inertia * push))


def _ball_lever_squared(robot: RobotParameters) -> float:
    """Of the trailer's balls about P [m²]."""
    return robot.trailer.com_offset_m**2 + robot.casters.trailer_half_spacing_m**2
