"""The scenario: one experiment, every value of it, checked and frozen.

A scenario is a TOML file. Units stand in the names, unknown keys are errors, and what a file leaves
out has a documented default. `ttwmr export-schema` prints the same as JSON Schema.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from ttwmr_mj.plants.contact_options import ContactOptions
from ttwmr_mj.robot import Config, RobotParameters

SCHEMA_VERSION = 1
MAX_DURATION_S = 3600.0

# TOML has arrays where Python has tuples; their elements stay strict
Point = Annotated[tuple[float, float], Field(strict=False)]
Theta2Reference = Literal["aligned", "outward", "none"]
Coordinate = Annotated[float, Field(ge=-100.0, le=100.0)]
Angle = Annotated[float, Field(ge=-100.0, le=100.0)]


class _PathReference(Config):
    """What every moving reference has."""

    theta2: Theta2Reference = Field(
        default="none",
        description="reference of θ2: along the tractor, radially outward as a free trailer "
        "settles on a circle, or none",
    )
    ramp_s: float = Field(
        default=0.0, ge=0, le=600, description="smooth start from rest; 0 starts at full speed"
    )


class CircleReference(_PathReference):
    """Circle at constant speed (Eq. 37 and Eq. 72-73)."""

    kind: Literal["circle"]
    radius_m: float = Field(gt=0, le=100)
    angular_rate_rad_s: float = Field(ge=-50, le=50, description="positive: counter-clockwise")
    phase_rad: Angle = 0.0
    centre_m: Point = (0.0, 0.0)


class FigureEightReference(_PathReference):
    """A lying eight (the article's Fig. 19 gives no equation)."""

    kind: Literal["figure_eight"]
    half_width_m: float = Field(gt=0, le=100)
    half_height_m: float = Field(gt=0, le=100)
    period_s: float = Field(gt=0, le=3600)
    phase_rad: Angle = 0.0
    centre_m: Point = (0.0, 0.0)


class StraightLineReference(_PathReference):
    """A straight line at constant speed."""

    kind: Literal["straight_line"]
    start_m: Point = (0.0, 0.0)
    heading_rad: Angle = 0.0
    speed_m_s: float = Field(gt=0, le=100)


class WaypointsReference(_PathReference):
    """A smooth spline through waypoints."""

    kind: Literal["waypoints"]
    points_m: Annotated[tuple[Point, ...], Field(strict=False, min_length=3, max_length=10_000)]
    speed_m_s: float = Field(gt=0, le=100)
    closed: bool = False


class NoReference(Config):
    """Nothing to follow: open-loop experiments."""

    kind: Literal["none"]


Reference = Annotated[
    CircleReference
    | FigureEightReference
    | StraightLineReference
    | WaypointsReference
    | NoReference,
    Field(discriminator="kind"),
]


class LyapunovController(Config):
    """Law (32) with the gains of Table II."""

    kind: Literal["lyapunov"]
    alpha1: float = Field(default=25.0, gt=0, le=1e6, description="α1, on e1 = x − x_d")
    alpha2: float = Field(default=10.0, gt=0, le=1e6, description="α2, on e2 = ẋ − ẋ_d")
    alpha3: float = Field(default=25.0, gt=0, le=1e6, description="α3, on e3 = y − y_d")
    alpha4: float = Field(default=10.0, gt=0, le=1e6, description="α4, on e4 = ẏ − ẏ_d")
    singular_terms: Literal["omitted", "regularized", "published"] = Field(
        default="omitted",
        description="what becomes of e1²/e2 and e3²/e4, which Theorem 1 overlooks",
    )
    regularization_m_s: float = Field(
        default=0.01, gt=0, le=10, description="ε of e1²·e2/(e2² + ε²), when regularized"
    )


class WheelSegment(Config):
    """Constant wheel speeds for a while."""

    duration_s: float = Field(gt=0, le=MAX_DURATION_S)
    wheel_right_rad_s: float = Field(ge=-1e3, le=1e3)
    wheel_left_rad_s: float = Field(ge=-1e3, le=1e3)


class OpenLoopController(Config):
    """A list of wheel-speed segments, then standstill."""

    kind: Literal["open_loop"]
    segments: Annotated[tuple[WheelSegment, ...], Field(strict=False, min_length=1)]


class CustomController(Config):
    """A controller of the user's own, found on the Python path or beside the scenario file."""

    kind: Literal["custom"]
    target: str = Field(pattern=r"^[A-Za-z_][\w.]*:[A-Za-z_]\w*$", description="module:Class")
    options: dict[str, Any] = Field(default={}, description="keyword arguments of the class")


Controller = Annotated[
    LyapunovController | OpenLoopController | CustomController, Field(discriminator="kind")
]


class AtRest(Config):
    """Start standing still at a pose; Table II's (0.6, −0.3) m is the default."""

    kind: Literal["at_rest"] = "at_rest"
    x_m: Coordinate = 0.6
    y_m: Coordinate = -0.3
    theta1_rad: Angle = 0.0
    theta2_rad: Angle = 0.0


class OnReference(Config):
    """Start on the reference, moving with it, but for these offsets."""

    kind: Literal["on_reference"]
    x_offset_m: Coordinate = 0.0
    y_offset_m: Coordinate = 0.0
    theta1_offset_rad: Angle = 0.0
    theta2_offset_rad: Angle = Field(
        default=0.0, description="from θ2's reference, or from θ1 where there is none"
    )


Initial = Annotated[AtRest | OnReference, Field(discriminator="kind")]


class AnalyticOptions(Config):
    """Settings of the analytic plant."""

    max_step_s: float = Field(
        default=0.011, ge=1e-6, le=0.1, description="longest integration step"
    )
    published_spring: bool = Field(
        default=False, description="divide the hitch's spring torque by k as Eq. 41 prints it"
    )


class Plant(Config):
    """What is driven: contact physics or the analytic model."""

    kind: Literal["contact", "analytic"] = "contact"
    contact: ContactOptions = ContactOptions()
    analytic: AnalyticOptions = AnalyticOptions()


class TruthSensing(Config):
    """The true state, late and noisy if asked."""

    kind: Literal["truth"] = "truth"
    latency_s: float = Field(default=0.0, ge=0, le=10, description="whole control periods")
    position_noise_m: float = Field(default=0.0, ge=0, le=10, description="standard deviation")
    angle_noise_rad: float = Field(default=0.0, ge=0, le=10, description="standard deviation")
    velocity_noise_m_s: float = Field(default=0.0, ge=0, le=10, description="standard deviation")
    rate_noise_rad_s: float = Field(default=0.0, ge=0, le=100, description="standard deviation")


class Control(Config):
    """The sampled loop."""

    sampling_time_s: float = Field(default=0.033, gt=0, le=10, description="33 ms in Section 4")


class Output(Config):
    """Which files a run leaves beside its numbers."""

    recording: bool = Field(default=True, description="run.rrd for the Rerun viewer")
    figures: bool = Field(default=True, description="figures/*.png and *.svg")
    physics_rate: bool = Field(
        default=False, description="physics.parquet: the state at every physics step (contact)"
    )


class Scenario(Config):
    """One experiment."""

    schema_version: Literal[1] = 1
    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,63}$")
    description: str = ""
    seed: int = Field(default=0, ge=0, lt=2**32)
    duration_s: float = Field(gt=0, le=MAX_DURATION_S)
    robot: RobotParameters = RobotParameters()
    plant: Plant = Plant()
    initial: Initial = AtRest()
    reference: Reference
    control: Control = Control()
    controller: Controller
    sensing: TruthSensing = TruthSensing()
    output: Output = Output()

    @field_validator("initial", mode="before")
    @classmethod
    def _start_at_rest_unless_told(cls, given: Any) -> Any:
        return {"kind": "at_rest", **given} if isinstance(given, dict) else given

    @property
    def periods(self) -> int:
        """Whole control periods in the run."""
        return int(self.duration_s / self.control.sampling_time_s * (1 + 1e-12))

    @property
    def steps_per_period(self) -> int:
        """Physics steps in a control period; the loader made sure it is a whole number."""
        return round(self.control.sampling_time_s / self.plant.contact.timestep_s)
