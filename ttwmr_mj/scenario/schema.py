"""The scenario: one experiment, every value of it, checked and frozen.

A scenario is a TOML file. Keys carry their units, unknown keys are errors, and what a file leaves
out has a documented default. `ttwmr export-schema` prints the same as JSON Schema.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import (
    Field,
    GetCoreSchemaHandler,
    GetPydanticSchema,
    field_validator,
    model_validator,
)
from pydantic_core import core_schema

from ttwmr_mj.controllers.base import CONTROLLERS, ControllerOptions
from ttwmr_mj.dynamics.extended import ExtendedParameters
from ttwmr_mj.dynamics.ground import Ground
from ttwmr_mj.plants.contact_options import ContactOptions
from ttwmr_mj.references.shared.reference import REFERENCES, Angle, Point, Reference
from ttwmr_mj.results.accept import AcceptOptions
from ttwmr_mj.robot import Config, RobotParameters, merged
from ttwmr_mj.scenario.worlds import World, filled
from ttwmr_mj.sensing import Lost, TruthSensing, UpTo10
from ttwmr_mj.vision.camera.options import CameraOptions
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
    x_m: Coordinate = Field(default=0.6, description="x of P at the start; typically -1 to 1")
    y_m: Coordinate = Field(default=-0.3, description="y of P at the start; typically -1 to 1")
    theta1_rad: Angle = Field(
        default=0.0, description="heading of the tractor at the start, from +x"
    )
    theta2_rad: Angle = Field(
        default=0.0,
        description="heading of the trailer at the start; equal to theta1_rad if aligned",
    )
    more_trailers_rad: Annotated[tuple[Angle, ...], Field(strict=False)] = Field(
        default=(),
        description="headings of the trailers behind the first; left out: theta2_rad, all of them",
    )


class OnReference(Config):
    """Start on the reference, moving with it, except for these offsets."""

    kind: Literal["on_reference"]
    x_offset_m: Coordinate = Field(
        default=0.0, description="offset of P in x from the reference; typically 0.1"
    )
    y_offset_m: Coordinate = Field(
        default=0.0, description="offset of P in y from the reference; typically 0.1"
    )
    theta1_offset_rad: Angle = Field(
        default=0.0, description="offset of the tractor's heading from the reference; typically 0.2"
    )
    theta2_offset_rad: Angle = Field(
        default=0.0,
        description="offset of the trailer's heading from the reference of θ2, or from θ1 if "
        "there is none; typically 0.2",
    )
    more_trailers_offset_rad: Annotated[tuple[Angle, ...], Field(strict=False)] = Field(
        default=(), description="the same of the trailers behind the first; left out: none"
    )


Initial = Annotated[AtRest | OnReference, Field(discriminator="kind")]


class AnalyticOptions(Config):
    """Settings of the analytic plant."""

    same_in_batch: ClassVar[frozenset[str]] = frozenset({"max_step_s"})

    max_step_s: float = Field(
        default=0.011, ge=1e-6, le=0.1, description="longest integration step; typically 0.01"
    )
    published_spring: bool = Field(
        default=False,
        description="divide the torque of the hitch's spring and damper by k, as Eq. 41 is printed",
    )
    extended: ExtendedParameters | None = Field(
        default=None,
        description="a fitted model used instead of the plain one, as `ttwmr compare --fit` "
        "writes it",
    )


class PushOptions(Config):
    """A temporary force on the tractor or the trailer (contact plant only).

    It acts at that chassis' centre of mass, in every control period that starts within its time.
    """

    on: Literal["tractor", "trailer"] = Field(
        default="trailer", description="the body that is pushed"
    )
    start_s: float = Field(
        ge=0,
        le=MAX_DURATION_S,
        description="simulated time at which the push starts; typically 5 to 15",
    )
    duration_s: float = Field(
        gt=0, le=MAX_DURATION_S, description="duration of the push; typically 0.1 to 1"
    )
    force_n: Point = Field(
        description="force (x, y) in the world frame; typically 0.5, the robot's weight is 12 N"
    )
    random_within_s: float = Field(
        default=0.0,
        ge=0,
        le=MAX_DURATION_S,
        description="the start is delayed by a random time, uniform between 0 and this value; the "
        "time of one lap makes all phases equally likely; typically 6",
    )
    random_direction: bool = Field(
        default=False, description="rotate the force by a random angle, uniform over the full turn"
    )


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
        default=0.033,
        gt=0,
        le=10,
        description="control period, the time between commands; Section 4: 0.033",
    )
    controller_time_limit_s: float = Field(
        default=10.0,
        gt=0,
        le=3600,
        description="CPU time after which a command times out and the run ends as failed; "
        "a law that plans may take a second, several on a busy machine. "
        "The limit in wall time is 15 times as long, for a controller that waits",
    )
    inner_loop: Literal["velocity_servo", "computed_torque", "torque"] = Field(
        default="velocity_servo",
        description="what drives the wheels; velocity_servo: servos that follow the law's wheel "
        "speeds; computed_torque: torques that Eq. 23 asks for these speeds; torque: torques that "
        "a user's own law gives",
    )
    rate_gain_1_s: float = Field(
        default=20.0,
        ge=0,
        le=1e4,
        description="λ of computed_torque: rate at which the wheels return to the angles they "
        "should have; typically 20, stable below 1.4 / sampling_time_s",
    )
    command_latency_s: float = Field(
        default=0.0,
        ge=0,
        le=10,
        description="time from a sample until the servos receive its command, a whole number of "
        "physics steps (plant.contact.timestep_s) on both plants; typically 0.01",
    )
    command_jitter_s: float = Field(
        default=0.0,
        ge=0,
        le=10,
        description="largest additional latency of a command; the value is a random whole number "
        "of control periods, uniform from 0; overtaken commands are discarded; typically 0.033",
    )
    command_drop_probability: Lost = Field(
        default=0.0,
        description="probability that a command is lost, so that the servos hold the last one; "
        "typically 0.02",
    )

    @property
    def torque_input(self) -> bool:
        """Whether wheel torques drive the robot, not wheel speeds."""
        return self.inner_loop != "velocity_servo"


class OutputOptions(Config):
    """Which files a run writes in addition to its numbers."""

    recording: bool = Field(default=True, description="write run.rrd for the Rerun viewer")
    figures: bool = Field(
        default=True,
        description="write summary.png, .svg and .pdf, the run in one figure; compare: figures/",
    )
    paper_plots: bool = Field(
        default=False,
        description="write figures/*.png and *.svg: the article's plots, one quantity each",
    )
    save_frames: bool = Field(
        default=False, description="write frames/: the camera's images with COCO annotations"
    )
    physics_rate: bool = Field(
        default=False,
        description="write physics.parquet: the state at every physics step (contact plant only)",
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
    """What the controller, the reference and the camera tracker assume, where it differs."""

    robot: Annotated[dict[str, Any], GetPydanticSchema(_part_of(RobotParameters))] = Field(
        default={},
        description="robot parameters that the controller, the reference and the camera "
        "tracker assume: any part of [robot]; keys left out keep their true values",
    )
    ground: Annotated[dict[str, Any], GetPydanticSchema(_part_of(Ground))] = Field(
        default={},
        description="the floor that they assume: any part of [ground]; keys left out keep their "
        "true values",
    )
    camera: Annotated[dict[str, Any], GetPydanticSchema(_part_of(CameraOptions))] = Field(
        default={},
        description="the camera when it was calibrated before the run: any part of "
        "[sensing.camera]; keys left out keep their true values",
    )
    latency_s: UpTo10 | None = Field(
        default=None,
        description="the latency of measurements that the controller and the camera tracker "
        "assume; default: the true sensing.latency_s; typically 0.033",
    )
    command_latency_s: UpTo10 | None = Field(
        default=None,
        description="the latency of commands that the controller and the camera tracker assume; "
        "default: the true control.command_latency_s; typically 0.01",
    )


class Scenario(Config):
    """One experiment."""

    schema_version: Literal[1] = Field(default=1, description="version of this file format")
    name: str = Field(
        pattern=r"^[a-z0-9][a-z0-9_-]{0,63}$",
        description="name of results and recordings: lower-case letters, digits, - and _",
    )
    description: str = Field(default="", description="one sentence, shown by `ttwmr list`")
    seed: int = Field(
        default=0,
        ge=0,
        lt=2**32,
        description="seed of everything random: noise, camera, controller",
    )
    duration_s: float = Field(
        gt=0, le=MAX_DURATION_S, description="simulated time; typically 10 to 60"
    )
    world: World = Field(
        default="kind",
        description="where values that are not given come from, which the controller is not told; "
        "kind: nowhere; lab: our estimate of the article's laboratory; unkind: drawn by the seed",
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
    accept: AcceptOptions = AcceptOptions()

    @model_validator(mode="before")
    @classmethod
    def _fill_from_world(cls, given: Any) -> Any:
        return filled(given) if isinstance(given, dict) else given

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
    def believed_camera(self) -> CameraOptions:
        """The camera as it was when calibrated; before a calibration file nobody had moved it.

        Raises:
            AssertionError: the scenario has no camera.
        """
        assert self.sensing.kind == "camera", "asked of a scenario without a camera"
        camera = self.sensing.camera
        if self.belief.camera:
            return CameraOptions(**merged(camera, self.belief.camera))
        return camera.unmoved if self.sensing.calibration_path else camera

    @property
    def believed_command_latency_s(self) -> float:
        """`control.command_latency_s` as controller and camera tracker know it."""
        told = self.belief.command_latency_s
        return self.control.command_latency_s if told is None else told

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

        The analytic plants solve a whole period at once, unless a command may come within it.
        """
        if self.plant.kind == "analytic" and not self.control.command_latency_s:
            return 1
        return round(self.control.sampling_time_s / self.plant.contact.timestep_s)
