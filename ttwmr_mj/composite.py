"""Table I describes tractor and trailer as wholes; a chassis is what remains without its parts.

MuJoCo wants the parts: chassis, wheels, balls. With the remainder computed here, mass, COM and yaw
inertia of each composite equal Table I (or whatever a scenario sets instead).
"""

from dataclasses import dataclass
from decimal import ROUND_CEILING

from ttwmr_mj.errors import InputError, rounded
from ttwmr_mj.robot import RobotParameters


@dataclass(frozen=True, slots=True)
class Lump:
    """A rigid part seen from above."""

    mass_kg: float  # its mass
    x_m: float  # of its COM, along the long axis
    yaw_inertia_kg_m2: float  # about its own COM
    aside_m: float = 0.0  # distance of its COM from that axis; its twin is as far on the other side
    y_m: float = 0.0  # of the COM, to the left of that axis, of what has no twin


def wheel_inertia(robot: RobotParameters) -> tuple[float, float]:
    """(spin, diametral) inertia of a wheel as a solid cylinder [kg·m²]."""
    tractor = robot.tractor
    radius, half_width = tractor.wheel_radius_m, tractor.wheel_half_width_m
    spin = 0.5 * tractor.wheel_mass_kg * radius**2
    diametral = tractor.wheel_mass_kg * (3 * radius**2 + 4 * half_width**2) / 12
    return spin, diametral


def ball_inertia(robot: RobotParameters) -> float:
    """Inertia of a caster ball as a solid sphere [kg·m²]."""
    return 0.4 * robot.casters.mass_kg * robot.casters.radius_m**2


def chassis_remainder(whole: Lump, parts: list[Lump], table: str) -> Lump:
    """The chassis that makes the composite equal to `whole`.

    Args:
        whole: the composite; its inertia is about its own COM.
        parts: wheels and casters; each inertia about its own COM.
        table: where a scenario holds the composite's numbers, such as "robot.tractor".

    Raises:
        InputError: the parts leave no positive mass or yaw inertia for the chassis.
    """
    mass = whole.mass_kg - sum(part.mass_kg for part in parts)
    if mass <= 0:
        taken = whole.mass_kg - mass
        raise InputError.at(
            f"{table}.mass_kg",
            f"wheels and casters weigh {taken:g} kg and leave nothing for the chassis",
            got=f"{whole.mass_kg:g}",
            allowed=f"more than {rounded(taken, ROUND_CEILING)} kg, or lighter wheels and casters",
        )
    x = (whole.mass_kg * whole.x_m - sum(part.mass_kg * part.x_m for part in parts)) / mass
    y = whole.mass_kg * whole.y_m / mass  # the parts' middle is on the axis
    inertia = whole.yaw_inertia_kg_m2 - mass * ((x - whole.x_m) ** 2 + (y - whole.y_m) ** 2)
    for part in parts:
        # (a − y)² of one twin and (a + y)² of the other: a² + y² each
        lever_squared = (part.x_m - whole.x_m) ** 2 + part.aside_m**2 + whole.y_m**2
        inertia -= part.yaw_inertia_kg_m2 + part.mass_kg * lever_squared
    if inertia <= 0:
        needed = whole.yaw_inertia_kg_m2 - inertia
        raise InputError.at(
            f"{table}.yaw_inertia_kg_m2",
            f"the wheels and casters at their places already have {needed:g} kg·m²",
            got=f"{whole.yaw_inertia_kg_m2:g}",
            allowed="more than that, or lighter wheels and casters",
        )
    return Lump(mass, x, inertia, y_m=y)


def tractor_chassis(robot: RobotParameters) -> Lump:
    """Chassis of the tractor without wheels and caster."""
    tractor, casters = robot.tractor, robot.casters
    _, diametral = wheel_inertia(robot)
    wheel = Lump(tractor.wheel_mass_kg, 0.0, diametral, robot.half_track_m)
    caster = Lump(casters.mass_kg, casters.tractor_position_m, ball_inertia(robot))
    whole = Lump(tractor.mass_kg, tractor.com_offset_m, tractor.yaw_inertia_kg_m2)
    return chassis_remainder(whole, [wheel, wheel, caster], "robot.tractor")


def trailer_chassis(robot: RobotParameters, index: int = 0) -> Lump:
    """Chassis of a trailer (0: the first) without its two casters; x from its hitch."""
    trailer, casters = robot.trailers[index], robot.casters
    x = -trailer.com_offset_m
    caster = Lump(casters.mass_kg, x, ball_inertia(robot), casters.trailer_half_spacing_m)
    whole = Lump(trailer.mass_kg, x, trailer.yaw_inertia_kg_m2, y_m=trailer.com_lateral_m)
    table = f"robot.trailers.{index}" if index else "robot.trailer"
    return chassis_remainder(whole, [caster, caster], table)
