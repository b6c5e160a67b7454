"""Can a free trailer follow this reference, and the robot drive it?

Every requirement is a signal along the reference and a bound on its size; what exceeds its bound
does so in named spans of time. The checks, in order:

- defined: θ1 and θ2 are numbers everywhere.
- no side slip: P moves along the heading (Eq. 3).
- free trailer: the hitch torque J·(θ̈2 − P''·n/k), J = J2 + m2·l², that the reference demands
  (Eq. 17, 24), beyond what the hitch's own spring, damper and dry friction give.
- wheel speed, wheel acceleration: against the servo's limits (Eq. 8-9).
- wheel torque: from Eq. 23, with the motors' own inertia, against the stall torque.
- grip: driving and lateral force of the two wheels (λ of Eq. 18) against friction times their
  share of the weight.
- workspace: P, the tractor's front label and the trailer's rear label, in a rectangle.
- flatness: |F''| above a floor, else θ2 cannot be read from F; a note, not a fault: plans may pass
  through, only the flatness-based law cannot.
"""

from dataclasses import dataclass, replace

import numpy as np

from ttwmr_mj.dynamics.flatness import flat_output_acceleration
from ttwmr_mj.dynamics.ground import GRAVITY_M_S2
from ttwmr_mj.dynamics.kinematics import (
    constraint_residual,
    to_body,
    wheels_from_twist,
    workspace_rate,
)
from ttwmr_mj.dynamics.kinetics import lateral_force, reduced_bias, reduced_mass_matrix
from ttwmr_mj.dynamics.train import hitch_torques, swing_matrix, trailer_accelerations
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA2, BoolArray, FloatArray, hitch_angles

SIDE_SLIP_M_S = 1e-3  # a hundredth of a slow robot's speed
HITCH_TORQUE_N_M = 1e-5  # a hundredth of what a small dry friction gives
FRONT_LABEL_M, REAR_LABEL_M = 0.103, 0.213  # far edges, from P
# |F''| that the flatness-based law needs. The slowest circle of 0.6 m that it can be told to follow
# takes 150 s; in a plan, F'' passes through zero.
LEAST_ACCELERATION_M_S2 = 1e-3
MOMENT_S = 0.1  # three control periods: what servos are late by in them, a law works off
# what the robot needs to move so at all, whatever its trailer does; in words
DRIVES = {
    "wheel speed": "turns a wheel at {}",
    "wheel acceleration": "accelerates a wheel by {}",
    "wheel torque": "asks a wheel for {}",
    "grip": "asks the tyres for {}",
}


@dataclass(frozen=True, slots=True)
class Demand:
    """One requirement along a reference."""

    name: str  # what is required
    unit: str  # of the values
    worst: float  # the largest value, at `worst_time_s`; NaN where the reference defines none
    worst_time_s: float
    limit: float  # its bound
    spans_s: tuple[tuple[float, float], ...]  # (start, end) of every stretch of time over the bound
    binding: bool = True  # whether breaking it makes the reference infeasible

    @property
    def kept(self) -> bool:
        """Whether the bound holds everywhere."""
        return not self.spans_s

    @property
    def broken_for_s(self) -> float:
        """How long the bound is exceeded, all stretches together."""
        return sum(end - start for start, end in self.spans_s)

    @property
    def sentence(self) -> str:
        """What the reference asks of the drive, against what there is."""
        asked, limit = (f"{value:.3g} {self.unit}" for value in (self.worst, self.limit))
        return f"the reference {DRIVES[self.name].format(asked)} (limit {limit})"

    def __str__(self) -> str:
        mark = "ok  " if self.kept else "FAIL" if self.binding else "note"
        text = f"{mark} {self.name}: {self.worst:.4g} of {self.limit:.4g} {self.unit}".rstrip()
        text += f" at {self.worst_time_s:.4g} s"
        if self.kept:
            return text
        first, last = self.spans_s[0]
        more = f" and {len(self.spans_s) - 1} more" if len(self.spans_s) > 1 else ""
        return f"{text}; broken from {first:.4g} s to {last:.4g} s{more}"


@dataclass(frozen=True, slots=True)
class Feasibility:
    """The verdict on a reference."""

    checks: tuple[Demand, ...]

    @property
    def feasible(self) -> bool:
        """Whether every binding check is kept."""
        return all(check.kept for check in self.checks if check.binding)

    @property
    def undrivable(self) -> tuple[Demand, ...]:
        """What is asked of servo and tyres beyond their limits for more than a moment."""
        driven = (check for check in self.checks if check.name in DRIVES)
        return tuple(check for check in driven if check.broken_for_s > MOMENT_S)

    def __getitem__(self, name: str) -> Demand:
        """A check by its name."""
        return next(check for check in self.checks if check.name == name)

    def __str__(self) -> str:
        return "\n".join([f"feasible: {'yes' if self.feasible else 'no'}", *map(str, self.checks)])


def check_feasibility(
    reference: ReferencePath,
    robot: RobotParameters,
    *,
    floor_friction: float = 0.9,
    workspace_m: tuple[float, float] | None = None,
) -> Feasibility:
    """Examine a reference at its samples; of a batch, the worst member counts.

    Args:
        reference: any; NaN in θ2 breaks "defined", and what needs it is then not judged there.
        robot: geometry, masses, hitch and servo.
        floor_friction: Coulomb coefficient of the tyres.
        workspace_m: width and height of a rectangle about the origin; None: no bound.
    """
    q, rate = reference.q, reference.q_rate
    twist = workspace_rate(q, rate)
    surge, _ = to_body(reference.theta1_rad, *np.moveaxis(reference.acceleration_m_s2, -1, 0))
    acceleration = np.concatenate([surge[..., None], reference.theta_acceleration], axis=-1)
    servo = robot.servo
    wheel_rate = wheels_from_twist(acceleration[..., :2], robot)
    torque, grip = _forces(q, twist, acceleration, robot)
    torque = torque + servo.reflected_inertia_kg_m2 * wheel_rate

    def at_most(name: str, unit: str, values: FloatArray, limit: float) -> Demand:
        size = np.fmax.reduce(np.abs(values).reshape(len(q), -1), axis=1)  # NaN: all are
        return _check(reference.time_s, name, unit, size, limit)

    checks = [
        at_most("defined", "", np.isnan(reference.theta), 0.5),
        at_most("no side slip", "m/s", constraint_residual(q, rate), SIDE_SLIP_M_S),
        at_most("free trailer", "N·m", _missing_torque(reference, robot), HITCH_TORQUE_N_M),
        at_most("wheel speed", "rad/s", wheels_from_twist(twist, robot), servo.speed_limit_rad_s),
        at_most("wheel acceleration", "rad/s²", wheel_rate, servo.acceleration_limit_rad_s2),
        at_most("wheel torque", "N·m", torque, servo.largest_torque_n_m),
        at_most("grip", "N", grip, floor_friction * _weight_on_wheels(robot)),
    ]
    if workspace_m is not None:
        checks.append(at_most("workspace", "of half", _reach(q, workspace_m, robot), 1.0))
    if len(robot.trailers) == 1:
        checks.append(_flatness(reference, robot))
    return Feasibility(tuple(checks))


def _flatness(reference: ReferencePath, robot: RobotParameters) -> Demand:
    theta2, rate = reference.theta2_rad, reference.theta_rate[..., 1]
    along = flat_output_acceleration(theta2, rate, reference.acceleration_m_s2, robot)
    least = np.fmin.reduce(np.hypot(along[..., 0], along[..., 1]), axis=1)
    note = _check(
        reference.time_s, "flatness, least |F''|", "m/s²", -least, -LEAST_ACCELERATION_M_S2
    )
    return replace(note, worst=-note.worst, limit=-note.limit, binding=False)


def _missing_torque(reference: ReferencePath, robot: RobotParameters) -> FloatArray:
    """(n, batch, trailers) hitch torques that are demanded and that nothing provides [N·m]."""
    q, rate = reference.q, reference.q_rate
    theta, turn = q[..., THETA2:], rate[..., THETA2:]
    free = trailer_accelerations(theta, turn, reference.acceleration_m_s2, robot)
    missing = reference.theta_acceleration[..., 1:] - free
    if theta.shape[-1] == 1:
        demand = robot.swing_inertia_kg_m2 * missing
    else:  # each hitch carries what is behind it
        load = (swing_matrix(theta, robot) @ missing[..., None])[..., 0]
        demand = load[..., ::-1].cumsum(axis=-1)[..., ::-1]
    demand = demand - hitch_torques(hitch_angles(q), hitch_angles(rate), robot)
    dry = np.array([hitch.coulomb_friction_n_m for hitch in robot.hitches])
    return np.asarray(np.maximum(np.abs(demand) - dry, 0.0))


def _forces(
    q: FloatArray, twist: FloatArray, acceleration: FloatArray, robot: RobotParameters
) -> tuple[FloatArray, FloatArray]:
    """Wheel torques (n, batch, 2) [N·m], and the force of the floor on both wheels (n, batch) [N].

    Where θ2 is undefined the trailer counts as in line with the tractor.
    """
    q, twist, acceleration = q.copy(), twist.copy(), acceleration.copy()
    for values, stand_in in ((q, 2), (twist, 1), (acceleration, 1)):
        behind = values[..., stand_in + 1 :]
        ahead = values[..., stand_in, None]
        values[..., stand_in + 1 :] = np.where(np.isnan(behind), ahead, behind)
    load = np.einsum("...ij,...j", reduced_mass_matrix(q, robot), acceleration)
    load = load + reduced_bias(q, twist, robot)
    drive = 0.5 * load[..., 0]
    turn = load[..., 1] / robot.tractor.track_width_m
    torque = robot.tractor.wheel_radius_m * np.stack([drive + turn, drive - turn], axis=-1)
    sideways = lateral_force(q, twist, acceleration, robot)
    return torque, np.hypot(np.abs(load[..., 0]) + 2.0 * np.abs(turn), sideways)


def _weight_on_wheels(robot: RobotParameters) -> float:
    """Normal force on both wheels at rest [N]; the nose caster carries a1/position of the rest."""
    tractor = robot.tractor
    share = 1.0 - tractor.com_offset_m / robot.casters.tractor_position_m
    return GRAVITY_M_S2 * tractor.mass_kg * share


def _reach(q: FloatArray, workspace_m: tuple[float, float], robot: RobotParameters) -> FloatArray:
    """(n, batch) how far the robot reaches, in half workspaces; P alone where θ2 is undefined."""
    half = 0.5 * np.array(workspace_m)
    parts, hitch = [q[..., :2]], q[..., :2]
    reaches = [t.next_hitch_offset_m or 0.0 for t in robot.trailers]
    for column, reach in (
        (2, FRONT_LABEL_M),
        *((3 + i, -REAR_LABEL_M) for i in range(len(reaches))),
    ):
        angle = q[..., column : column + 1]
        along = np.concatenate([np.cos(angle), np.sin(angle)], axis=-1)
        parts.append(hitch + reach * along)
        if column > 2:
            hitch = hitch - reaches[column - 3] * along
    return np.asarray(np.fmax.reduce([np.abs(part / half).max(axis=-1) for part in parts]))


def _check(time_s: FloatArray, name: str, unit: str, values: FloatArray, limit: float) -> Demand:
    """The largest of values (n,), and where they exceed their limit; NaN does not."""
    k = int(np.argmax(np.nan_to_num(values, nan=-np.inf)))
    worst, when = float(values[k]), float(time_s[k])
    return Demand(name, unit, worst, when, limit, _spans(time_s, values > limit))


def _spans(time_s: FloatArray, broken: BoolArray) -> tuple[tuple[float, float], ...]:
    """First and last sample of every stretch of broken samples."""
    edges = np.diff(np.concatenate([[0], broken.astype(np.int8), [0]]))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    return tuple((float(time_s[i]), float(time_s[j])) for i, j in zip(starts, ends, strict=True))
