"""All of the robot's numbers together, and the forms in which a file may give them."""

from collections.abc import Mapping
from decimal import ROUND_FLOOR
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

from ttwmr_mj.config import Config
from ttwmr_mj.errors import rounded
from ttwmr_mj.robot.bodies import Casters, Hitch, Tractor, Trailer
from ttwmr_mj.robot.outdoor import outdoor_robot
from ttwmr_mj.robot.servo import Servo

MOST_TRAILERS = 5  # a longer train has no room on its circles, and nothing is measured of it
WhichTrailer = Annotated[
    int, Field(ge=1, le=MOST_TRAILERS, description="which trailer is meant, counted from the front")
]


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
        ge=1e-3,
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
        return merged(outdoor_robot(), lists) if lists.get("preset") == "outdoor" else lists

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
        value, entries = lists.pop(first), lists.get(name, [{}])
        match entries:  # of what is no list of tables, its own fault is enough
            case list() | tuple() if entries and isinstance(entries[0], dict | BaseModel):
                lists[name] = [merged(entries[0], value), *entries[1:]]
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
        limit = rounded(most, ROUND_FLOOR, 6)
        raise _refused(place, value, f"between -{limit} and {limit}")


def _refused(place: tuple[str | int, ...], got: Any, allowed: str = "") -> ValidationError:
    """An error at a place in the robot; with nothing allowed: the value is missing."""
    custom = PydanticCustomError("robot", "{allowed}", {"allowed": allowed})
    kind = custom if allowed else "missing"
    return ValidationError.from_exception_data(
        "robot", [{"type": kind, "loc": place, "input": got}]
    )
