"""The robot's numbers: Table I of the article and what it leaves open, each with its source.

Every model in this package, analytic or MuJoCo, is built from one `RobotParameters`. Values are
checked here, on input; the rest of the package trusts them.
"""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import (
    BaseModel,
    Field,
    GetJsonSchemaHandler,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError

from ttwmr_mj.config import Config as Config  # whoever knows the robot knows it from here
from ttwmr_mj.motor import Motor


class Tractor(Config):
    """The differential-drive tractor (Table I), chassis, wheels and caster together."""

    mass_kg: float = Field(
        default=0.9, gt=0, le=1e3, description="m1: mass of the whole tractor; Table I: 0.9"
    )
    yaw_inertia_kg_m2: float = Field(
        default=0.0035,
        gt=0,
        le=1e3,
        description="J1: yaw inertia about the tractor's own COM; Table I: 0.0035",
    )
    com_offset_m: float = Field(
        default=0.029,
        gt=0,
        le=10,
        description="a1: distance from P forward to the COM; Table I: 0.029",
    )
    wheel_radius_m: float = Field(
        default=0.026, gt=0, le=1, description="r: mean radius of the wheels; Table I: 0.026"
    )
    wheel_radius_difference_m: float = Field(
        default=0.0,
        ge=-1,
        le=1,
        description="radius of the right wheel less that of the left, at most r; typically 1e-4",
    )
    track_width_m: float = Field(
        default=0.119, gt=0, le=10, description="2b: distance between the wheels; Table I: 0.119"
    )
    wheel_mass_kg: float = Field(
        default=0.03, gt=0, le=100, description="mass of one wheel, included in m1; assumed: 0.03"
    )
    wheel_half_width_m: float = Field(
        default=0.006, gt=0, le=1, description="half the width of a tyre; assumed: 0.006"
    )
    wheel_shape: Literal["ellipsoid", "cylinder"] = Field(
        default="ellipsoid",
        description="shape of the tyres: an ellipsoid touches the floor at a point, a "
        "cylinder along a line, which scrubs in turns",
    )

    @property
    def wheel_radii_m(self) -> tuple[float, float]:
        """Of the right wheel and of the left."""
        half = 0.5 * self.wheel_radius_difference_m
        return self.wheel_radius_m + half, self.wheel_radius_m - half


class Trailer(Config):
    """A trailer (Table I), with its two spherical wheels."""

    mass_kg: float = Field(
        default=0.33, ge=1e-9, le=1e3, description="m2: mass of the whole trailer; Table I: 0.33"
    )
    yaw_inertia_kg_m2: float = Field(
        default=0.00078,
        gt=0,
        le=1e3,
        description="J2: yaw inertia about the trailer's own COM; Table I: 0.00078",
    )
    com_offset_m: float = Field(
        default=0.141,
        ge=1e-9,
        le=10,
        description="l: distance from its hitch backward to the COM; Table I: 0.141",
    )
    com_lateral_m: float = Field(
        default=0.0,
        ge=-10,
        le=10,
        description="distance of the COM from the trailer's axis to its left; at most to a "
        "caster, typically 0.005",
    )
    next_hitch_offset_m: float | None = Field(
        default=None,
        gt=0,
        le=10,
        description="distance from its hitch backward to the next trailer's hitch; required "
        "if another trailer follows",
    )

    @property
    def swing_length_m(self) -> float:
        """K = l + J2/(m2·l) (Eq. 24): from its hitch to its centre of oscillation."""
        return self.com_distance_m + self.yaw_inertia_kg_m2 / (self.mass_kg * self.com_distance_m)

    @property
    def swing_inertia_kg_m2(self) -> float:
        """J2 + m2·l² = m2·l·k (Eq. 17): its yaw inertia about its hitch."""
        return self.yaw_inertia_kg_m2 + self.mass_kg * self.com_distance_m**2

    @property
    def com_distance_m(self) -> float:
        """From its hitch to its COM: l of every equation, where the load is not on the axis."""
        return math.hypot(self.com_offset_m, self.com_lateral_m)

    @property
    def lean_rad(self) -> float:
        """β: the COM is on the line from the hitch in the direction of θ2 − β, behind it."""
        return math.atan2(self.com_lateral_m, self.com_offset_m)


class Hitch(Config):
    """A trailer's revolute joint, the first at P.

    It may have a torsion spring and damper (Eq. 38-43), and friction.
    """

    stiffness_n_m_rad: float = Field(
        default=0.0,
        ge=0,
        le=1e4,
        description="k_t: stiffness of a torsion spring that is relaxed when the trailer is "
        "aligned; typically 0 to 10",
    )
    damping_n_m_s_rad: float = Field(
        default=0.0,
        ge=0,
        le=1e4,
        description="c_t: coefficient of damper and viscous friction; typically 0.001",
    )
    play_m: float = Field(
        default=0.0,
        ge=0,
        le=0.1,
        description="radial clearance of the pin in its hole (contact plant only); typically 2e-4",
    )
    gimballed: bool = Field(
        default=False,
        description="the trailer may also pitch and roll on it (contact plant only), so that "
        "wheels and balls all touch uneven ground",
    )
    coulomb_friction_n_m: float = Field(
        default=0.0,
        ge=0,
        le=1e3,
        description="torque of dry friction, independent of the rate; typically 0.001",
    )


SERVO_PRESETS: dict[str, dict[str, float]] = {
    # The article names 1.62 N·m holding torque at 12 V and no speed. Servos of that torque class
    # turn 60° in about 0.16 s without load: 6.5 rad/s, 0.17 m/s at the rim. Reaching it in 0.13 s
    # is assumed.
    "lab": {"speed_limit_rad_s": 6.5, "acceleration_limit_rad_s2": 50.0},
    # The article's simulated circle (R = 1 m, 0.5 rad/s) needs 19 rad/s, which no such servo
    # reaches. 100 rad/s² is 2.6 m/s² at the rim, inside the tyres' grip.
    "fast": {"speed_limit_rad_s": 40.0, "acceleration_limit_rad_s2": 100.0},
}


class Servo(Config):
    """One wheel's velocity servo. A preset fills in the limits that are not given."""

    preset: Literal["lab", "fast"] = Field(
        default="lab",
        description="speed and acceleration limits; lab: 6.5 rad/s and 50 rad/s²; fast: 40 "
        "rad/s and 100 rad/s², for the simulated circle",
    )
    stall_torque_n_m: float = Field(
        default=1.62,
        gt=0,
        le=1e3,
        description="largest torque of the servo (at stall); Section 4: 1.62",
    )
    speed_limit_rad_s: float = Field(
        default=6.5, gt=0, le=1e3, description="largest wheel speed; default: the preset's"
    )
    acceleration_limit_rad_s2: float = Field(
        default=50.0,
        gt=0,
        le=1e5,
        description="largest rate of change of the speed setpoint; default: the preset's",
    )
    velocity_gain_n_m_s_rad: float = Field(
        default=10.0,
        gt=0,
        le=1e4,
        description="torque per rad/s of speed error, up to the stall torque; typically 10",
    )
    reflected_inertia_kg_m2: float = Field(
        default=2e-4,
        ge=0,
        le=10,
        description="inertia of motor and gears reflected to the wheel (armature); typically 2e-4",
    )
    motor: Motor | None = Field(
        default=None,
        description="a motor with gear and firmware; left out: an ideal velocity servo",
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_from_preset(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        preset, motor = given.get("preset"), given.get("motor")
        if preset and isinstance(motor, dict):
            given = {**given, "motor": {"preset": preset, **motor}}
        return {**SERVO_PRESETS.get(str(preset), {}), **given}

    @property
    def largest_torque_n_m(self) -> float:
        """What a standing wheel can get, from the motor if there is one."""
        return self.motor.stall_torque_n_m if self.motor else self.stall_torque_n_m


class Casters(Config):
    """The spherical wheels: one under the tractor's nose, two under the trailer."""

    radius_m: float = Field(
        default=0.008, gt=0, le=1, description="radius of one ball; assumed: 0.008"
    )
    mass_kg: float = Field(
        default=0.001,
        gt=0,
        le=10,
        description="mass of one ball, included in its body's mass; assumed: 0.001",
    )
    rolling_resistance_m: float = Field(
        default=0.0, ge=0, le=0.1, description="resisting torque per normal force; typically 1e-4"
    )
    socket_friction_n_m: float = Field(
        default=0.0, ge=0, le=10, description="dry torque of a ball in its socket; typically 1e-4"
    )
    tractor_position_m: float = Field(
        default=0.075,
        gt=0,
        le=10,
        description="distance from P forward to the tractor's caster; assumed: 0.075",
    )
    trailer_half_spacing_m: float = Field(
        default=0.05,
        gt=0,
        le=10,
        description="distance from the trailer's axis to each of its casters; assumed: 0.05",
    )


MOST_TRAILERS = 5  # a longer train has no room on its circles, and nothing is measured of it
OUTDOOR_SCALE = 0.060 / 0.026  # λ, of the wheels


def _outdoor() -> dict[str, Any]:
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


class RobotParameters(Config):
    """All numbers of the robot, SI units (Table I and stated assumptions).

    The first trailer and its hitch may be called `trailer` and `hitch`, in files and in Python.
    Given beside the lists, these replace values of the first entry.
    """

    FIRST: ClassVar[dict[str, str]] = {"trailer": "trailers", "hitch": "hitches"}

    preset: Literal["table", "outdoor"] = Field(
        default="table",
        description="where values that are not given come from: Table I, or Table I scaled to "
        "wheels of 60 mm with balls of 40 mm (radii), with one trailer",
    )
    looks_scale: float = Field(
        default=1.0,
        gt=0,
        le=100,
        description="size of decks, posts and labels relative to Table I's robot; default: the "
        "preset's",
    )
    tractor: Tractor = Tractor()
    trailers: Annotated[tuple[Trailer, ...], Field(strict=False)] = Field(
        default=(Trailer(),),
        min_length=1,
        max_length=MOST_TRAILERS,
        description="the trailers, at most five, front to back; [robot.trailer] is the first",
    )
    hitches: Annotated[tuple[Hitch, ...], Field(strict=False)] = Field(
        default=(Hitch(),),
        description="the hitches, one in front of each trailer; [robot.hitch] is the first",
    )
    servo: Servo = Servo()
    casters: Casters = Casters()

    if TYPE_CHECKING:  # pydantic's own knows no `trailer` and `hitch`

        def __init__(
            self,
            *,
            preset: Literal["table", "outdoor"] = ...,
            looks_scale: float = ...,
            tractor: Tractor = ...,
            trailer: Trailer = ...,
            hitch: Hitch = ...,
            trailers: tuple[Trailer, ...] = ...,
            hitches: tuple[Hitch, ...] = ...,
            servo: Servo = ...,
            casters: Casters = ...,
        ) -> None: ...

    @property
    def trailer(self) -> Trailer:
        """The first trailer."""
        return self.trailers[0]

    @property
    def hitch(self) -> Hitch:
        """The first hitch, at P."""
        return self.hitches[0]

    @property
    def swing_length_m(self) -> float:
        """The first trailer's K (Eq. 24)."""
        return self.trailer.swing_length_m

    @property
    def swing_inertia_kg_m2(self) -> float:
        """The first trailer's yaw inertia about P (Eq. 17)."""
        return self.trailer.swing_inertia_kg_m2

    @property
    def lean_rad(self) -> float:
        """The first trailer's β: its load swings as if it were at θ2 − β."""
        return self.trailer.lean_rad

    @property
    def half_track_m(self) -> float:
        """b: half the distance between the wheels (Table I)."""
        return 0.5 * self.tractor.track_width_m

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """As pydantic's; `trailer` and `hitch` replace the first of their list."""
        changes = dict(update or {})
        for first, name in self.FIRST.items():
            if first in changes:
                rest = changes.get(name, getattr(self, name))[1:]
                changes[name] = (changes.pop(first), *rest)
        return super().model_copy(update=changes, deep=deep)

    def overridden(self, changes: Mapping[str, Any]) -> Self:
        """This robot with other values: any part of what a file's [robot] may hold.

        Raises:
            ValidationError: a value is refused.
        """
        given = self.model_validate(changes).model_dump(exclude_unset=True)
        return self.model_validate(merged(_as_lists(self.model_dump()), given))

    @model_validator(mode="before")
    @classmethod
    def _fold_first(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        lists = _as_lists(given)
        return merged(_outdoor(), lists) if lists.get("preset") == "outdoor" else lists

    @model_validator(mode="after")
    def _hangs_together(self) -> Self:
        for i, trailer in enumerate(self.trailers[:-1]):
            if trailer.next_hitch_offset_m is None:
                raise _refused(("trailers", i, "next_hitch_offset_m"), None)
        radius, spacing = self.tractor.wheel_radius_m, self.casters.trailer_half_spacing_m
        _within(
            radius, self.tractor.wheel_radius_difference_m, "tractor", "wheel_radius_difference_m"
        )
        for i, trailer in enumerate(self.trailers):
            _within(spacing, trailer.com_lateral_m, "trailers", i, "com_lateral_m")
        if len(self.hitches) != (count := len(self.trailers)):
            allowed = f"as many as there are trailers, {count}"
            raise _refused(("hitches",), len(self.hitches), allowed)
        return self

    @model_serializer(mode="wrap")
    def _unfold_first(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """A single trailer is written as it is in nearly every file: [robot.trailer]."""
        data: dict[str, Any] = dump(self)
        if len(self.trailers) > 1:
            return data
        short = {name: first for first, name in self.FIRST.items()}
        return {
            short.get(key, key): value[0] if key in short else value for key, value in data.items()
        }

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Both forms: the lists, and the first by its name."""
        schema = handler(core_schema)
        properties = handler.resolve_ref_schema(schema)["properties"]
        for first, name in cls.FIRST.items():
            properties[first] = properties[name]["items"]
        return schema


def _as_lists(given: dict[str, Any]) -> dict[str, Any]:
    """A robot's table with `trailer` and `hitch` moved into the first entry of their lists."""
    lists = dict(given)
    for first, name in RobotParameters.FIRST.items():
        if first not in lists:
            continue
        value, entries = lists.pop(first), lists.get(name, ())
        if isinstance(entries, list | tuple):  # else its own fault is enough
            lists[name] = [merged(entries[0], value) if entries else value, *entries[1:]]
    return lists


def merged(under: Any, over: Any) -> Any:
    """Tables merged key by key, lists of tables of one length entry by entry; else `over`."""
    match under, over:
        case BaseModel(), dict():
            return merged(under.model_dump(), over)
        case dict(), dict():
            return under | {key: merged(under.get(key), over[key]) for key in over}
        case (list() | tuple(), list() | tuple()) if len(under) == len(over):
            return [merged(*pair) for pair in zip(under, over, strict=True)]
    return over


def _within(most: float, value: float, *place: str | int) -> None:
    if abs(value) > most:
        raise _refused(place, value, f"between -{most:g} and {most:g}")


def _refused(place: tuple[str | int, ...], got: Any, allowed: str = "") -> ValidationError:
    """An error at a place in the robot; with nothing allowed: the value is missing."""
    custom = PydanticCustomError("robot", "{allowed}", {"allowed": allowed})
    kind = custom if allowed else "missing"
    return ValidationError.from_exception_data(
        "robot", [{"type": kind, "loc": place, "input": got}]
    )
