"""What a plan may use of what a robot has, so that feedback keeps its share."""

from ttwmr_mj.dynamics.floor.ground import GRAVITY_M_S2
from ttwmr_mj.planning.transcription import Limits
from ttwmr_mj.robot import RobotParameters

SPEED, ACCELERATION, GRIP = 0.8, 0.3, 0.4  # shares
PICTURE_M = (1.8, 1.3)  # what the shipped camera sees of the floor, less a margin
HITCH_ANGLE_RAD = 2.0
# what may be asked for, least and most
DURATIONS_S, HITCH_ANGLES_DEG = (0.1, 3600.0), (0.1, 180.0)
SIDES_M, SCALES_M = (0.3, 1000.0), (1e-6, 1e3)  # of the workspace; of a drawing's unit


def limits_of(
    robot: RobotParameters,
    floor_friction: float,
    *,
    workspace_m: tuple[float, float] = PICTURE_M,
    hitch_angle_rad: float = HITCH_ANGLE_RAD,
) -> Limits:
    """The limits of a plan for a robot on a floor."""
    servo = robot.servo
    speed = servo.speed_limit_rad_s
    if (motor := servo.motor) is not None:  # without load, less what its gear takes
        volts = motor.gear_friction_n_m * motor.resistance_ohm / motor.torque_per_ampere
        per_speed = motor.volts_per_speed + (
            motor.gear_damping_n_m_s_rad * motor.resistance_ohm / motor.torque_per_ampere
        )
        speed = min(speed, (motor.supply_voltage_v - volts) / per_speed)
    return Limits(
        wheel_speed_rad_s=SPEED * speed,
        wheel_acceleration_rad_s2=ACCELERATION * servo.acceleration_limit_rad_s2,
        lateral_acceleration_m_s2=GRIP * floor_friction * GRAVITY_M_S2,
        hitch_angle_rad=hitch_angle_rad,
        workspace_m=workspace_m,
    )
