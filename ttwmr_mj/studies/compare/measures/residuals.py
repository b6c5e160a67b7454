"""What contact physics does that the model's equations do not know: slip, Eq. 3, Eq. 17, energy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ttwmr_mj.dynamics.extended.parameters import driven_inertia
from ttwmr_mj.dynamics.kinematics import constraint_residual, to_body
from ttwmr_mj.dynamics.kinetics import gravity, kinetic_energy
from ttwmr_mj.dynamics.motor import Drive
from ttwmr_mj.dynamics.train import (
    hitch_torques,
    on_trailers,
    pivot_torque,
    swing_bias,
    swing_matrix,
)
from ttwmr_mj.plants.contact_readings import read_contacts
from ttwmr_mj.plants.model.names import CONTACTS, contacts
from ttwmr_mj.state import THETA1, THETA2, ArrayFields, FloatArray, hitch_angles
from ttwmr_mj.studies.compare.measures.deviation import Numbers, largest, rms
from ttwmr_mj.studies.compare.motion import ContactRun

# a hitch below this rate sticks: in contact physics, where nothing is quite at rest, hitches with
# friction of 0.01 N·m that held crept at 3e-5 rad/s at most (two_trailers_turn)
STICKS_RAD_S = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Residuals(ArrayFields):
    """Slip and residuals of a contact run at the control samples.

    Attributes:
        time_s: (n,).
        slip_along_m_s: (n, 3 + 2·trailers) of the surfaces over the floor, forward, in the order of
            `names.contacts`; along the tractor for its wheels and its ball, else along the trailer.
        slip_aside_m_s: (n, 3 + 2·trailers) the same to the left.
        lateral_speed_m_s: (n,) Eq. 3: speed of P towards the tractor's right.
        trailer_torque_n_m: (n,) Eq. 17: torque about P that the trailer's motion lacks, mean over
            the period before; zero at the start. Dry friction of a hitch that sticks explains what
            it can.
        energy_lost_j: (n,) work of the servos and of gravity along the floor minus kinetic energy
            gained (Eq. 13, wheels' spin included), minus what the hitch stores and burns: friction,
            slip, rolling resistance, and what a motor's gear burns.
    """

    time_s: FloatArray
    slip_along_m_s: FloatArray
    slip_aside_m_s: FloatArray
    lateral_speed_m_s: FloatArray
    trailer_torque_n_m: FloatArray
    energy_lost_j: FloatArray

    @classmethod
    def of(cls, run: ContactRun) -> Residuals:
        """The residuals of a run."""
        rows = run.trajectory
        slip = read_contacts(rows.contact_readings[:, 0]).slip_m_s
        names = contacts(len(run.robot.trailers))
        balls = len(CONTACTS) - 2
        owner = [THETA1] * balls + [THETA2 + i // 2 for i in range(len(names) - balls)]
        along, aside = to_body(rows.q[:, 0][:, owner], slip[..., 0], slip[..., 1])
        return cls(
            time_s=rows.time_s,
            slip_along_m_s=along,
            slip_aside_m_s=aside,
            lateral_speed_m_s=constraint_residual(rows.q[:, 0], rows.q_rate[:, 0]),
            trailer_torque_n_m=_trailer_torque(run),
            energy_lost_j=_energy_lost(run)[:: run.scenario.steps_per_period],
        )

    def numbers(self) -> Numbers:
        """Keys and numbers of compare.json."""
        numbers: Numbers = {
            "constraint_residual_max_m_s": largest(self.lateral_speed_m_s),
            "constraint_residual_rms_m_s": rms(self.lateral_speed_m_s),
            "trailer_equation_residual_max_n_m": largest(self.trailer_torque_n_m),
            "trailer_equation_residual_rms_n_m": rms(self.trailer_torque_n_m),
            "energy_residual_max_j": largest(self.energy_lost_j),
            "energy_residual_final_j": float(self.energy_lost_j[-1]),
        }
        for i, name in enumerate(contacts((self.slip_along_m_s.shape[1] - 3) // 2)):
            numbers[f"{name}_slip_along_max_m_s"] = largest(self.slip_along_m_s[:, i])
            numbers[f"{name}_slip_aside_max_m_s"] = largest(self.slip_aside_m_s[:, i])
        return numbers


def _trailer_torque(run: ContactRun) -> FloatArray:
    """What Eq. 17 misses, averaged over each period [N·m]; of a train the row that misses most.

    (J2 + m2·l²)·θ̈2 + m2·l·(ẍ sin θ2 − ÿ cos θ2) − T for one trailer. On a slope, gravity's pull is
    taken off ẍ and ÿ.
    """
    robot, step = run.robot, run.scenario.plant.contact.timestep_s
    acceleration = np.diff(run.physics.q_rate, axis=0) / step
    acceleration[:, :2] -= run.scenario.ground.gravity_m_s2
    theta, rate = (_mid_step(q[:, THETA2:]) for q in (run.physics.q, run.physics.q_rate))
    swing = (swing_matrix(theta, robot) @ acceleration[:, THETA2:, None])[..., 0]
    swing = swing + swing_bias(theta, rate, robot)
    missing = swing - pivot_torque(theta, acceleration[:, :2], robot)
    # of each hitch, of the trailer before it those of all behind
    asked = np.cumsum(missing[:, ::-1], axis=1)[:, ::-1]
    missing = missing - on_trailers(_hitch_torques(run, asked))
    means = missing.reshape(-1, run.scenario.steps_per_period, theta.shape[1]).mean(axis=1)
    worst = np.abs(means).argmax(axis=1)
    return np.append(0.0, means[np.arange(len(means)), worst])


def _hitch_torques(run: ContactRun, asked: FloatArray | float = 0.0) -> FloatArray:
    """(steps, trailers) torques of springs, dampers and dry friction, mid-step.

    Args:
        run: whose hitches.
        asked: (steps, trailers) what would explain the motion. Friction that sticks takes any value
            up to that at which it slides, so it gives of this what it can.
    """
    robot = run.robot
    angle, rate = (_mid_step(hitch_angles(q)) for q in (run.physics.q, run.physics.q_rate))
    dry = np.array([hitch.coulomb_friction_n_m for hitch in robot.hitches])
    smooth = hitch_torques(angle, rate, robot)
    stuck = np.clip(asked - smooth, -dry, dry)
    return np.asarray(smooth + np.where(np.abs(rate) < STICKS_RAD_S, stuck, -dry * np.sign(rate)))


def _energy_lost(run: ContactRun) -> FloatArray:
    """(steps + 1,) energy that left the model's account since the start [J]."""
    physics, step, robot = run.physics, run.scenario.plant.contact.timestep_s, run.robot
    q, rate, wheels = physics.q, physics.q_rate, physics.wheel_speed_rad_s
    kinetic = kinetic_energy(q, rate, robot) + 0.5 * driven_inertia(robot) * (wheels**2).sum(axis=1)
    # MuJoCo solves for a step's torque and moves by the speed at the step's end
    drive = Drive.of(robot.servo, torque_input=run.scenario.control.torque_input)
    end_speed = wheels[1:]
    power = (drive.torque(physics.inputs, end_speed) * end_speed).sum(axis=1)
    power += (_hitch_torques(run) * _mid_step(hitch_angles(rate))).sum(axis=1)
    weight = gravity(q, run.scenario.ground.gravity_m_s2, robot)
    power -= _mid_step((weight * rate).sum(axis=1))
    return np.asarray(np.append(0.0, np.cumsum(step * power)) - (kinetic - kinetic[0]))


def _mid_step(values: FloatArray) -> FloatArray:
    """(steps,) means of neighbours (steps + 1,)."""
    return 0.5 * (values[1:] + values[:-1])
