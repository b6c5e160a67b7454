"""The outdoor robot, derived from Table I's by similarity (docs/howto/ground.md)."""

from typing import Any

from ttwmr_mj.robot.bodies import Casters, Tractor, Trailer
from ttwmr_mj.robot.servo import Servo

OUTDOOR_SCALE = 0.060 / 0.026  # λ, of the wheels


def outdoor_robot() -> dict[str, Any]:
    """Table I's robot by similarity at equal gravity, but for its balls, which are larger still.

    Lengths grow with λ, masses with λ³, inertias with λ⁵, times with √λ (Froude), torques with λ⁴.
    """
    scale, tractor, trailer, casters = OUTDOOR_SCALE, Tractor(), Trailer(), Casters()
    servo = Servo.model_validate({"preset": "fast"})
    length, mass, inertia, time = scale, scale**3, scale**5, scale**0.5
    return {
        "looks_scale": scale,
        "tractor": {
            "mass_kg": mass * tractor.mass_kg,
            "yaw_inertia_kg_m2": inertia * tractor.yaw_inertia_kg_m2,
            "com_offset_m": length * tractor.com_offset_m,
            "wheel_radius_m": length * tractor.wheel_radius_m,
            "track_width_m": length * tractor.track_width_m,
            "wheel_mass_kg": mass * tractor.wheel_mass_kg,
            "wheel_half_width_m": length * tractor.wheel_half_width_m,
        },
        "trailers": [
            {
                "mass_kg": mass * trailer.mass_kg,
                "yaw_inertia_kg_m2": inertia * trailer.yaw_inertia_kg_m2,
                "com_offset_m": length * trailer.com_offset_m,
            }
        ],
        "hitches": [{"gimballed": True}],
        "casters": {
            "radius_m": 0.040,
            "mass_kg": mass * casters.mass_kg,
            "tractor_position_m": length * casters.tractor_position_m,
            "trailer_half_spacing_m": length * casters.trailer_half_spacing_m,
        },
        "servo": {
            "preset": "fast",
            "stall_torque_n_m": scale**4 * servo.stall_torque_n_m,
            "speed_limit_rad_s": servo.speed_limit_rad_s / time,
            "acceleration_limit_rad_s2": servo.acceleration_limit_rad_s2 / scale,
            "velocity_gain_n_m_s_rad": scale**4 * time * servo.velocity_gain_n_m_s_rad,
            "reflected_inertia_kg_m2": inertia * servo.reflected_inertia_kg_m2,
        },
    }
