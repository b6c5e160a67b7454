"""What contact physics does that the model's equations do not know: slip, Eq. 3, Eq. 17, energy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ttwmr_mj.composite import wheel_inertia
from ttwmr_mj.dynamics.hitch import spring_damper_torque
from ttwmr_mj.dynamics.hybrid import sideways
from ttwmr_mj.dynamics.kinematics import constraint_residual, to_body
from ttwmr_mj.dynamics.kinetics import first_moments, kinetic_energy
from ttwmr_mj.plants.contact import read_contacts
from ttwmr_mj.plants.mjcf import CONTACTS
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import THETA1, THETA2, FloatArray
from ttwmr_mj.studies.compare.deviation import Numbers, rms
from ttwmr_mj.studies.compare.motion import ContactRun


@dataclass(frozen=True, slots=True)
class Residuals:
    """Slip and residuals of a contact run at the control samples.

    Attributes:
        time_s: (n,).
        slip_along_m_s: (n, 5) of the surfaces over the floor, forward, in the order of
            `mjcf.CONTACTS`; along the tractor for its wheels and its ball, else along the trailer.
        slip_aside_m_s: (n, 5) the same to the left.
        lateral_speed_m_s: (n,) Eq. 3: speed of P towards the tractor's right.
        trailer_torque_n_m: (n,) Eq. 17: torque about P that the trailer's motion lacks, mean over
            the period before; zero at the start.
        energy_lost_j: (n,) work of the servos minus kinetic energy gained (Eq. 13, wheels' spin
            included), minus what the hitch stores and burns: friction, slip, rolling resistance.
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
        rows, robot, every = run.trajectory, run.robot, run.scenario.steps_per_period
        slip = read_contacts(rows.contact_readings[:, 0]).slip_m_s
        owner = [THETA2 if "trailer" in name else THETA1 for name in CONTACTS]
        along, aside = to_body(rows.q[:, 0][:, owner], slip[..., 0], slip[..., 1])
        return cls(
            time_s=rows.time_s,
            slip_along_m_s=along,
            slip_aside_m_s=aside,
            lateral_speed_m_s=constraint_residual(rows.q[:, 0], rows.q_rate[:, 0]),
            trailer_torque_n_m=_trailer_torque(run, robot, every),
            energy_lost_j=_energy_lost(run, robot)[::every],
        )

    def numbers(self) -> Numbers:
        """Keys and numbers of compare.json."""
        numbers: Numbers = {
            "constraint_residual_max_m_s": float(np.abs(self.lateral_speed_m_s).max()),
            "constraint_residual_rms_m_s": rms(self.lateral_speed_m_s),
            "trailer_equation_residual_max_n_m": float(np.abs(self.trailer_torque_n_m).max()),
            "trailer_equation_residual_rms_n_m": rms(self.trailer_torque_n_m),
            "energy_residual_max_j": float(np.abs(self.energy_lost_j).max()),
            "energy_residual_final_j": float(self.energy_lost_j[-1]),
        }
        for i, name in enumerate(CONTACTS):
            numbers[f"{name}_slip_along_max_m_s"] = float(np.abs(self.slip_along_m_s[:, i]).max())
            numbers[f"{name}_slip_aside_max_m_s"] = float(np.abs(self.slip_aside_m_s[:, i]).max())
        return numbers


def _trailer_torque(run: ContactRun, robot: RobotParameters, every: int) -> FloatArray:
    """(J2 + m2·l²)·θ̈2 + m2·l·(ẍ sin θ2 − ÿ cos θ2) − T, averaged over each period (Eq. 17)."""
    physics, step = run.physics, run.scenario.plant.contact.timestep_s
    q, rate = physics.q, physics.q_rate
    acceleration = np.diff(rate, axis=0) / step
    theta2 = 0.5 * (q[1:, THETA2] + q[:-1, THETA2])
    _, tail = first_moments(robot)
    swing = robot.swing_inertia_kg_m2 * acceleration[:, THETA2]
    pull = tail * sideways(theta2, acceleration[:, 0], acceleration[:, 1])
    torque = swing - pull - _hitch_torque(run, robot)
    per_period = torque.reshape(-1, every).mean(axis=1)
    return np.concatenate([[0.0], per_period])


def _hitch_torque(run: ContactRun, robot: RobotParameters) -> FloatArray:
    """(steps,) torque of spring, damper and sliding friction on the trailer, mid-step."""
    q, rate = run.physics.q, run.physics.q_rate
    angle, speed = q[:, THETA2] - q[:, THETA1], rate[:, THETA2] - rate[:, THETA1]
    angle, speed = 0.5 * (angle[1:] + angle[:-1]), 0.5 * (speed[1:] + speed[:-1])
    elastic = spring_damper_torque(angle, speed, robot.hitch)
    return np.asarray(elastic - robot.hitch.coulomb_friction_n_m * np.sign(speed))


def _energy_lost(run: ContactRun, robot: RobotParameters) -> FloatArray:
    """(steps + 1,) energy that left the model's account since the start [J]."""
    physics, step = run.physics, run.scenario.plant.contact.timestep_s
    q, rate, wheels = physics.q, physics.q_rate, physics.wheel_speed_rad_s
    spin = wheel_inertia(robot)[0] + robot.servo.reflected_inertia_kg_m2
    kinetic = kinetic_energy(q, rate, robot) + 0.5 * spin * (wheels**2).sum(axis=1)
    # MuJoCo solves for a step's torque and moves by the speed at the step's end
    servo, end_speed = robot.servo, wheels[1:]
    torque = servo.velocity_gain_n_m_s_rad * (physics.setpoint_rad_s - end_speed)
    torque = np.clip(torque, -servo.stall_torque_n_m, servo.stall_torque_n_m)
    power = (torque * end_speed).sum(axis=1)
    hitch_rate = rate[:, THETA2] - rate[:, THETA1]
    power += _hitch_torque(run, robot) * 0.5 * (hitch_rate[1:] + hitch_rate[:-1])
    work = np.concatenate([[0.0], np.cumsum(step * power)])
    return np.asarray(work - (kinetic - kinetic[0]))
