"""The scenario: one experiment, every value of it, checked and frozen.

A scenario is a TOML file. Keys carry their units, unknown keys are errors, and what a file leaves
out has a documented default. `ttwmr export-schema` prints the same as JSON Schema.
"""

from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import Field, ModelWrapValidatorHandler, field_validator, model_validator

from ttwmr_mj.config import NAME, PATTERNS, Config
from ttwmr_mj.controllers.base import CONTROLLERS, ControllerOptions
from ttwmr_mj.dynamics.floor.ground import Ground
from ttwmr_mj.references.shared.reference import REFERENCES, Reference
from ttwmr_mj.results.accept import AcceptOptions
from ttwmr_mj.robot import RobotParameters, merged
from ttwmr_mj.scenario.tables.belief import BeliefOptions
from ttwmr_mj.scenario.tables.control import ControlOptions
from ttwmr_mj.scenario.tables.output import OutputOptions
from ttwmr_mj.scenario.tables.plant import (
    MAX_DURATION_S,
    AnalyticOptions,
    PlantOptions,
    PushOptions,
)
from ttwmr_mj.scenario.tables.start import AtRest, Initial, OnReference
from ttwmr_mj.scenario.tables.worlds import World, filled
from ttwmr_mj.sensing import TruthSensing
from ttwmr_mj.vision.camera.options import CameraOptions
from ttwmr_mj.vision.options import CameraSensing

__all__ = [
    "AnalyticOptions",
    "AtRest",
    "BeliefOptions",
    "ControlOptions",
    "Initial",
    "OnReference",
    "OutputOptions",
    "PlantOptions",
    "PushOptions",
    "Scenario",
    "Sensing",
]

SCHEMA_VERSION = 1
LOOKAHEAD_SAMPLES = 64  # reference samples beyond the end, for laws that look ahead

# The unions are as wide as the registries: a new kind is a new file, or another package's.
if TYPE_CHECKING:
    AnyReference = Reference
    AnyController = ControllerOptions
else:
    AnyReference = REFERENCES.one_of()
    AnyController = CONTROLLERS.one_of()

Sensing = Annotated[TruthSensing | CameraSensing, Field(discriminator="kind")]


class Scenario(Config):
    """One experiment."""

    schema_version: Literal[1] = Field(default=1, description="version of this file format")
    name: str = Field(pattern=NAME, description=f"name of results and recordings: {PATTERNS[NAME]}")
    description: str = Field(default="", description="one sentence, shown by `ttwmr list`")
    seed: int = Field(
        default=0,
        ge=0,
        lt=2**32,
        description="seed of everything random: noise, camera, controller",
    )
    duration_s: float = Field(
        ge=1e-12, le=MAX_DURATION_S, description="simulated time; typically 10 to 60"
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

    @model_validator(mode="wrap")
    @classmethod
    def _fill_from_world(cls, given: Any, validated: ModelWrapValidatorHandler[Self]) -> Self:
        told = validated(given)  # what is given is refused as it was given
        if not isinstance(given, dict) or told.world == "kind":
            return told
        return validated(filled(given, told))

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
