"""The scenario: one experiment, every value of it, checked and frozen.

A scenario is a TOML file. Units stand in the names, unknown keys are errors, and what a file leaves
out has a documented default. `ttwmr export-schema` prints the same as JSON Schema.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, GetCoreSchemaHandler, GetPydanticSchema, field_validator
from pydantic_core import core_schema

from ttwmr_mj.controllers.base import CONTROLLERS, ControllerOptions
from ttwmr_mj.dynamics.extended import ExtendedParameters
from ttwmr_mj.dynamics.ground import Ground
from ttwmr_mj.plants.contact_options import ContactOptions
from ttwmr_mj.references.shared.reference import REFERENCES, Angle, Point, Reference
from ttwmr_mj.robot import Config, RobotParameters
from ttwmr_mj.sensing import TruthSensing
from ttwmr_mj.vision.options import CameraSensing

SCHEMA_VERSION = 1
MAX_DURATION_S = 3600.0
LOOKAHEAD_SAMPLES = 64  # reference samples beyond the end, for laws that look ahead

Coordinate = Annotated[float, Field(ge=-100.0, le=100.0)]

# The unions are as wide as the registries: a new kind is a new file, or another package's.
if TYPE_CHECKING:
    AnyReference = Reference
    AnyController = ControllerOptions
else:
    AnyReference = REFERENCES.one_of()
    AnyController = CONTROLLERS.one_of()


class AtRest(Config):
    """Start standing still at a pose; Table II's (0.6, −0.3) m is the default."""

    kind: Literal["at_rest"] = "at_rest"
    x_m: Coordinate = Field(default=0.6, description="of P; typically within 1")
    y_m: Coordinate = Field(default=-0.3, description="of P; typically within 1")
    theta1_rad: Angle = Field(default=0.0, description="heading of the tractor, from +x")
    theta2_rad: Angle = Field(
        default=0.0, description="heading of the trailer; theta1_rad where aligned"
    )


class OnReference(Config):
    """Start on the reference, moving with it, but for these offsets."""

    kind: Literal["on_reference"]
    x_offset_m: Coordinate = Field(default=0.0, description="of P; typically 0.1")
    y_offset_m: Coordinate = Field(default=0.0, description="of P; typically 0.1")
    theta1_offset_rad: Angle = Field(default=0.0, description="of the tractor; typically 0.2")
    theta2_offset_rad: Angle = Field(
        default=0.0, description="from θ2's reference, or from θ1 where there is none"
    )


Initial = Annotated[AtRest | OnReference, Field(discriminator="kind")]


class AnalyticOptions(Config):
    """Settings of the analytic plant."""

    max_step_s: float = Field(
        default=0.011, ge=1e-6, le=0.1, description="longest integration step; typically 0.01"
    )
    published_spring: bool = Field(
        default=False, description="divide the hitch's spring torque by k as Eq. 41 prints it"
    )
    extended: ExtendedParameters | None = Field(
        default=None,
        description="a fitted model instead of the plain one, as `ttwmr compare --fit` writes it",
    )


class PushOptions(Config):
    """A force on one half of the robot for a while (contact plant only).

    It acts at that chassis' centre of mass, in every control period that starts within its time.
    """

    on: Literal["tractor", "trailer"] = Field(default="trailer", description="which half is pushed")
    start_s: float = Field(ge=0, le=MAX_DURATION_S, description="simulated time at which it starts")
    duration_s: float = Field(
        gt=0, le=MAX_DURATION_S, description="how long it lasts; typically 0.1 to 1"
    )
    force_n: Point = Field(description="x, y in the world; the robot's weight is 12 N")


class PlantOptions(Config):
    """What is driven: contact physics or the analytic model, and what disturbs it."""

    kind: Literal["contact", "analytic"] = Field(
        default="contact", description="MuJoCo's contact physics, or the article's equations"
    )
    pushes: Annotated[tuple[PushOptions, ...], Field(strict=False)] = Field(
        default=(), description="forces that disturb the robot (contact plant only)"
    )
    contact: ContactOptions = ContactOptions()
    analytic: AnalyticOptions = AnalyticOptions()


Sensing = Annotated[TruthSensing | CameraSensing, Field(discriminator="kind")]


class ControlOptions(Config):
    """The sampled loop."""

    sampling_time_s: float = Field(
        default=0.033, gt=0, le=10, description="time between commands; 33 ms in Section 4"
    )
    controller_time_limit_s: float = Field(
        default=2.0,
        gt=0,
        le=3600,
        description="CPU time for one command, after which the run ends as failed; typically 2. "
        "A controller that waits has 15 times as much wall time",
    )


class OutputOptions(Config):
    """Which files a run leaves beside its numbers."""

    recording: bool = Field(default=True, description="run.rrd for the Rerun viewer")
    figures: bool = Field(default=True, description="figures/*.png and *.svg")
    save_frames: bool = Field(
        default=False, description="frames/: the camera's pictures with COCO annotations"
    )
    physics_rate: bool = Field(
        default=False, description="physics.parquet: the state at every physics step (contact)"
    )


def _part_of(model: type[Config]) -> Callable[[Any, GetCoreSchemaHandler], core_schema.CoreSchema]:
    """A table checked like the model, and kept as it was given."""

    def schema(_: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_after_validator_function(
            lambda given: given.model_dump(exclude_unset=True),
            handler(model),
            serialization=core_schema.plain_serializer_function_ser_schema(dict),
        )

    return schema


class BeliefOptions(Config):
    """What controller, reference and camera tracker take for true, where it is not."""

    robot: Annotated[dict[str, Any], GetPydanticSchema(_part_of(RobotParameters))] = Field(
        default={}, description="any part of [robot]; what is left out is believed as it is"
    )
    ground: Annotated[dict[str, Any], GetPydanticSchema(_part_of(Ground))] = Field(
        default={}, description="any part of [ground]; what is left out is believed as it is"
    )


class Scenario(Config):
    """One experiment."""

    schema_version: Literal[1] = Field(default=1, description="of this file format")
    name: str = Field(
        pattern=r"^[a-z0-9][a-z0-9_-]{0,63}$",
        description="names results and recordings: lower-case letters, digits, - and _",
    )
    description: str = Field(default="", description="one sentence, as `ttwmr list` prints it")
    seed: int = Field(
        default=0, ge=0, lt=2**32, description="of everything random: noise, camera, controller"
    )
    duration_s: float = Field(
        gt=0, le=MAX_DURATION_S, description="simulated time; typically 10 to 60"
    )
    robot: RobotParameters = RobotParameters()
    ground: Ground = Ground()
    belief: BeliefOptions = BeliefOptions()
    plant: PlantOptions = PlantOptions()
    initial: Initial = Field(default=AtRest(), description="where the robot starts")
    reference: AnyReference = Field(description="the motion to follow")
    control: ControlOptions = ControlOptions()
    controller: AnyController = Field(description="the control law")
    sensing: Sensing = Field(
        default=TruthSensing(), description="how the controller learns where the robot is"
    )
    output: OutputOptions = OutputOptions()

    @field_validator("initial", mode="before")
    @classmethod
    def _start_at_rest_unless_told(cls, given: Any) -> Any:
        return {"kind": "at_rest", **given} if isinstance(given, dict) else given

    @field_validator("sensing", mode="before")
    @classmethod
    def _truth_unless_told(cls, given: Any) -> Any:
        return {"kind": "truth", **given} if isinstance(given, dict) else given

    @property
    def believed_robot(self) -> RobotParameters:
        """The robot as controller, reference and camera tracker know it; `robot` is driven."""
        return self.robot.overridden(self.belief.robot) if self.belief.robot else self.robot

    @property
    def believed_ground(self) -> Ground:
        """The floor as the controller knows it; `ground` is driven on."""
        return Ground(**self.ground.model_dump() | self.belief.ground)

    @property
    def periods(self) -> int:
        """Whole control periods in the run."""
        return int(self.duration_s / self.control.sampling_time_s * (1 + 1e-12))

    @property
    def samples(self) -> int:
        """Control samples that the reference is known at: those of the run and a little beyond."""
        return self.periods + 1 + LOOKAHEAD_SAMPLES

    @property
    def steps_per_period(self) -> int:
        """The plant's steps in a control period; the loader made sure it is a whole number.

        The analytic plants solve a whole period at once.
        """
        if self.plant.kind == "analytic":
            return 1
        return round(self.control.sampling_time_s / self.plant.contact.timestep_s)
