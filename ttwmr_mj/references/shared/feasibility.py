"""Can a free trailer follow this reference, and the robot drive it?

Every requirement is a signal along the reference and a bound on its size; what exceeds its bound
does so in named spans of time. The checks, in order:

- defined: θ1 and θ2 are numbers everywhere.
- no side slip: P moves along the heading (Eq. 3).
- free trailer: the hitch torque J·(θ̈2 − P''·n/k), J = J2 + m2·l², that the reference demands
  (Eq. 17, 24), beyond what the hitch's own spring, damper and dry friction give.
- wheel speed, wheel acceleration: against the servo's limits (Eq. 8-9).
- wheel torque: from Eq. 23, with the motors' own inertia, against the stall torque or, of a motor
  with gear, its current limit, what the gear takes included.
- motor voltage: what that torque takes at that speed, R·i + N·K_e·ω, against the supply; without
  load that bounds the speed.
- grip: driving and lateral force of the two wheels (λ of Eq. 18) against friction times their
  share of the weight.
- workspace: P, the tractor's front label and the trailer's rear label, in a rectangle.
- flatness: |F''| above a floor, else θ2 cannot be read from F; a note, not a fault: plans may pass
  through, only the flatness-based law cannot.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from ttwmr_mj.dynamics.flatness import dot, flat_output_acceleration, trailer_axes
from ttwmr_mj.dynamics.floor.ground import GRAVITY_M_S2, LEVEL, Ground
from ttwmr_mj.dynamics.floor.influence import DRAG, GRAVITY, held_back_moving, influence_of
from ttwmr_mj.dynamics.kinematics import (
    constraint_residual,
    to_body,
    wheels_from_twist,
    workspace_rate,
)
from ttwmr_mj.dynamics.kinetics import lateral_force, reduced_bias, reduced_mass_matrix
from ttwmr_mj.dynamics.motor import Drive
from ttwmr_mj.dynamics.train import hitch_torques, swing_matrix, trailer_accelerations
from ttwmr_mj.references.shared.demand import Along, Demand, Feasibility
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA2, FloatArray, hitch_angles

SIDE_SLIP_M_S = 1e-3  # a hundredth of a slow robot's speed
# Of the first trailer's weight times its COM's distance from the hitch: 1e-5 N·m of Table I's, a
# hundredth of what a small dry friction gives.
HITCH_TORQUE_SHARE = 2.19e-5
FRONT_LABEL_M, REAR_LABEL_M = 0.103, 0.213  # far edges, from P, on Table I's robot
# |F''| that the flatness-based law needs. The slowest circle of 0.6 m that it can be told to follow
# takes 150 s; in a plan, F'' passes through zero.
LEAST_ACCELERATION_M_S2 = 1e-3
NOSE = ("robot", "casters", "tractor_position_m")
LEAST_PACE, PACES = 0.02, 12  # of `feasible_pace`: what is slower is no answer; halvings


# what is asked of an absurd robot may be beyond numbers; that is broken then, and no warning
@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def check_feasibility(
    reference: ReferencePath,
    robot: RobotParameters,
    *,
    floor_friction: float = 0.9,
    ground: Ground = LEVEL,
    workspace_m: tuple[float, float] | None = None,
) -> Feasibility:
    """Examine a reference at its samples; of a batch, the worst member counts.

    Args:
        reference: any; NaN in θ2 breaks "defined", and what needs it is then not judged there.
        robot: geometry, masses, hitch and servo.
        floor_friction: Coulomb coefficient of the tyres.
        ground: what else acts on one trailer; wheels are taken to drive on a level floor.
        workspace_m: width and height of a rectangle about the origin; None: no bound.
    """
    q, rate = reference.q, reference.q_rate
    along = Along(reference.time_s, reference.position_m)
    checks = [
        along.at_most("defined", "", np.isnan(reference.theta), 0.5),
        along.at_most("no side slip", "m/s", constraint_residual(q, rate), SIDE_SLIP_M_S),
        along.at_most(
            "free trailer",
            "N·m",
            _missing_torque(reference, robot, ground),
            _hitch_limit_n_m(robot),
            "robot",
            "hitch",
        ),
        *_drive(reference, robot, floor_friction),
    ]
    if workspace_m is not None:
        checks.append(along.at_most("workspace", "of half", _reach(q, workspace_m, robot), 1.0))
    if len(robot.trailers) == 1:
        checks.append(_flatness(reference, robot))
    return Feasibility(tuple(checks))


def feasible_pace(broken: Callable[[ReferencePath], bool], reference: ReferencePath) -> float:
    """The largest share of its pace at which a reference keeps a limit; 0: not at LEAST_PACE.

    All that is asked grows with the pace, but what a spring in the hitch asks for.

    Args:
        broken: whether a reference breaks it.
        reference: that does.
    """
    if broken(reference.at_pace(LEAST_PACE)):
        return 0.0
    low, high = LEAST_PACE, 1.0
    for _ in range(PACES):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if broken(reference.at_pace(middle)) else (middle, high)
    return low


def _drive(
    reference: ReferencePath, robot: RobotParameters, floor_friction: float
) -> Iterator[Demand]:
    """What is asked of servos and tyres."""
    along, servo = Along(reference.time_s, reference.position_m), robot.servo
    q, twist = reference.q, workspace_rate(reference.q, reference.q_rate)
    surge, _ = to_body(reference.theta1_rad, *np.moveaxis(reference.acceleration_m_s2, -1, 0))
    acceleration = np.concatenate([surge[..., None], reference.theta_acceleration], axis=-1)
    speed, change = (wheels_from_twist(v[..., :2], robot) for v in (twist, acceleration))
    torque, grip = _forces(q, twist, acceleration, robot)
    torque = torque + servo.reflected_inertia_kg_m2 * change
    key = ("robot", "servo")
    rates = {
        "wheel speed": ("rad/s", speed, "speed_limit_rad_s"),
        "wheel acceleration": ("rad/s²", change, "acceleration_limit_rad_s2"),
    }
    for name, (unit, values, limit) in rates.items():
        yield along.at_most(name, unit, values, getattr(servo, limit), *key, limit)
    if (motor := servo.motor) is None:
        largest = servo.largest_torque_n_m
        yield along.at_most("wheel torque", "N·m", torque, largest, *key, "stall_torque_n_m")
    else:
        torque = torque + np.sign(speed) * motor.gear_friction_n_m
        torque = torque + motor.gear_damping_n_m_s_rad * speed
        drive = Drive.of(servo)
        yield along.at_most(
            "wheel torque", "N·m", torque, drive.limit_n_m, *key, "motor", "current_limit_a"
        )
        # at no load: what is left of the supply once the back-EMF is taken off
        volts = torque / drive.gain + drive.back * speed
        supply = drive.input_limit
        yield along.at_most("motor voltage", "V", volts, supply, *key, "motor", "supply_voltage_v")
    weight = _weight_on_wheels(robot)
    source = ("plant", "contact", "floor_friction") if weight else NOSE
    yield along.at_most("grip", "N", grip, floor_friction * weight, *source)


def _flatness(reference: ReferencePath, robot: RobotParameters) -> Demand:
    theta2, rate = reference.theta2_rad, reference.theta_rate[..., 1]
    along = flat_output_acceleration(theta2, rate, reference.acceleration_m_s2, robot)
    least = np.fmin.reduce(np.hypot(along[..., 0], along[..., 1]), axis=1)
    where = Along(reference.time_s, reference.position_m)
    note = where.worst_of("flatness, least |F''|", "m/s²", -least, -LEAST_ACCELERATION_M_S2)
    return replace(note, worst=-note.worst, limit=-note.limit, binding=False)


def _hitch_limit_n_m(robot: RobotParameters) -> float:
    first = robot.trailers[0]
    return HITCH_TORQUE_SHARE * GRAVITY_M_S2 * first.mass_kg * first.com_offset_m


def _missing_torque(reference: ReferencePath, robot: RobotParameters, ground: Ground) -> FloatArray:
    """(n, batch, trailers) hitch torques that are demanded and that nothing provides [N·m]."""
    q, rate = reference.q, reference.q_rate
    theta, turn = q[..., THETA2:], rate[..., THETA2:]
    free = trailer_accelerations(theta, turn, reference.acceleration_m_s2, robot)
    missing = reference.theta_acceleration[..., 1:] - free
    if theta.shape[-1] == 1:
        missing = missing - _push(reference, robot, ground)[..., None]
        demand = robot.swing_inertia_kg_m2 * missing
    else:  # each hitch carries what is behind it
        load = (swing_matrix(theta, robot) @ missing[..., None])[..., 0]
        demand = load[..., ::-1].cumsum(axis=-1)[..., ::-1]
    demand = demand - hitch_torques(hitch_angles(q), hitch_angles(rate), robot)
    dry = np.array([hitch.coulomb_friction_n_m for hitch in robot.hitches])
    return np.asarray(np.maximum(np.abs(demand) - dry, 0.0))


def _push(reference: ReferencePath, robot: RobotParameters, ground: Ground) -> FloatArray:
    """(n, batch) θ̈2 of a slope and of balls that resist [rad/s²]."""
    influence, k = influence_of(robot, ground), robot.swing_length_m
    theta2, rate = reference.theta2_rad, reference.theta_rate[..., 1]
    pulled = -dot(influence[GRAVITY], trailer_axes(theta2 - robot.lean_rad)[1])
    if not influence[DRAG]:
        return np.asarray(pulled / k)
    held = held_back_moving(influence[DRAG], reference.velocity_m_s, theta2, rate, robot)
    return np.asarray((pulled + held) / k)


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
    """Normal force on both wheels at rest [N]; the nose's ball carries a1/position of the weight.

    All of it where the COM is not behind the ball.
    """
    tractor = robot.tractor
    share = 1.0 - tractor.com_offset_m / robot.casters.tractor_position_m
    return GRAVITY_M_S2 * tractor.mass_kg * max(0.0, share)


def labels_reach_m(robot: RobotParameters) -> tuple[float, float]:
    """How far labels reach ahead of P, and behind a trailer's hitch."""
    return robot.looks_scale * FRONT_LABEL_M, robot.looks_scale * REAR_LABEL_M


def _reach(q: FloatArray, workspace_m: tuple[float, float], robot: RobotParameters) -> FloatArray:
    """(n, batch) how far the robot reaches, in half workspaces; P alone where θ2 is undefined."""
    half = 0.5 * np.array(workspace_m)
    parts, hitch = [q[..., :2]], q[..., :2]
    ahead_m, behind_m = labels_reach_m(robot)
    reaches = [t.next_hitch_offset_m or 0.0 for t in robot.trailers]
    for column, reach in ((2, ahead_m), *((3 + i, -behind_m) for i in range(len(reaches)))):
        angle = q[..., column : column + 1]
        along = np.concatenate([np.cos(angle), np.sin(angle)], axis=-1)
        parts.append(hitch + reach * along)
        if column > 2:
            hitch = hitch - reaches[column - 3] * along
    return np.asarray(np.fmax.reduce([np.abs(part / half).max(axis=-1) for part in parts]))
