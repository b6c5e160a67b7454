"""The scenario: one experiment, every value of it, checked and frozen.

A scenario is a TOML file. Units stand in the names, unknown keys are errors, and what a file leaves
out has a documented default. `ttwmr export-schema` prints the same as JSON Schema.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from ttwmr_mj.controllers.options import FlatnessController, MpcController, TvlqrController
from ttwmr_mj.dynamics.extended import ExtendedParameters
from ttwmr_mj.plants.contact_options import ContactOptions
from ttwmr_mj.references.options import (
    FlatArcReference,
    FlatCircleReference,
    FlatEllipseReference,
    PlannedReference,
)
from ttwmr_mj.robot import Config, RobotParameters
from ttwmr_mj.sensing import TruthSensing
from ttwmr_mj.vision.options import CameraSensing

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
    | FlatCircleReference
    | FlatArcReference
    | FlatEllipseReference
    | PlannedReference
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


class LyapunovPidController(LyapunovController):
    """Laws (47) and (70): law (32) and a correction for θ2, with the gains of Table II.

    The defaults are what the article prints, but for `singular_terms`.
    """

    kind: Literal["lyapunov_pid"]  # type: ignore[assignment]  # the tag of another law
    correction: Literal["pid", "spring_damper"] = Field(
        default="pid", description="what γ aims at: PID about θ2d (Eq. 61), or Eq. 60"
    )
    gamma: Literal["exact", "constant", "regularized"] = Field(
        default="constant", description="1/D as in Eq. 48, constant ρ (Eq. 71), or D/(D² + ε²)"
    )
    rho: float = Field(default=2.5, ge=-1e6, le=1e6, description="ρ of Eq. 69, Table II")
    gamma_regularization_m_s2: float = Field(
        default=0.1, gt=0, le=1e3, description="ε of D/(D² + ε²), when regularized"
    )
    gamma_limit: float | None = Field(
        default=None, gt=0, le=1e12, description="|γ| is cut to this; left out: never"
    )
    k_p: float = Field(default=48.0, ge=0, le=1e6, description="Table II [1/s²]")
    k_i: float = Field(default=64.0, ge=0, le=1e6, description="Table II [1/s³]")
    k_d: float = Field(default=12.0, ge=0, le=1e6, description="Table II [1/s]")
    k_t: float = Field(default=200.0, ge=0, le=1e6, description="virtual spring of Eq. 60")
    c_t: float = Field(default=200.0, ge=0, le=1e6, description="virtual damper of Eq. 60")
    theta2_reference: Literal["reference", "tractor"] = Field(
        default="reference", description="θ2d: the reference's θ2, or the tractor's θ1"
    )
    anti_windup: Literal["none", "conditional"] = Field(
        default="none",
        description="conditional: the integral holds while γ is cut or a wheel saturates",
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
    LyapunovController
    | LyapunovPidController
    | FlatnessController
    | TvlqrController
    | MpcController
    | OpenLoopController
    | CustomController,
    Field(discriminator="kind"),
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
    extended: ExtendedParameters | None = Field(
        default=None,
        description="a fitted model instead of the plain one, as `ttwmr compare --fit` writes it",
    )


class Push(Config):
    """A force on one half of the robot for a while (contact plant only).

    It acts at that chassis' centre of mass, in every control period that starts within its time.
    """

    on: Literal["tractor", "trailer"] = "trailer"
    start_s: float = Field(ge=0, le=MAX_DURATION_S)
    duration_s: float = Field(gt=0, le=MAX_DURATION_S)
    force_n: Point = Field(description="x, y in the world")


class Plant(Config):
    """What is driven: contact physics or the analytic model, and what disturbs it."""

    kind: Literal["contact", "analytic"] = "contact"
    tractor_mass_factor: float = Field(
        default=1.0,
        gt=0.1,
        le=10,
        description="mass and inertia of the driven tractor, as a share of what robot.* says and "
        "the controller believes",
    )
    pushes: Annotated[tuple[Push, ...], Field(strict=False)] = ()
    contact: ContactOptions = ContactOptions()
    analytic: AnalyticOptions = AnalyticOptions()


Sensing = Annotated[TruthSensing | CameraSensing, Field(discriminator="kind")]


class Control(Config):
    """The sampled loop."""

    sampling_time_s: float = Field(default=0.033, gt=0, le=10, description="33 ms in Section 4")
    controller_time_limit_s: float = Field(
        default=2.0,
        gt=0,
        le=3600,
        description="CPU time after which the command of a sample counts as never coming and the "
        "run ends as failed; 15 times as much wall time, for a controller that waits",
    )


class Output(Config):
    """Which files a run leaves beside its numbers."""

    recording: bool = Field(default=True, description="run.rrd for the Rerun viewer")
    figures: bool = Field(default=True, description="figures/*.png and *.svg")
    save_frames: bool = Field(
        default=False, description="frames/: the camera's pictures with COCO annotations"
    )
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
    sensing: Sensing = TruthSensing()
    output: Output = Output()

    @field_validator("initial", mode="before")
    @classmethod
    def _start_at_rest_unless_told(cls, given: Any) -> Any:
        return {"kind": "at_rest", **given} if isinstance(given, dict) else given

    @field_validator("sensing", mode="before")
    @classmethod
    def _truth_unless_told(cls, given: Any) -> Any:
        return {"kind": "truth", **given} if isinstance(given, dict) else given

    @property
    def periods(self) -> int:
        """Whole control periods in the run."""
        return int(self.duration_s / self.control.sampling_time_s * (1 + 1e-12))

    @property
    def steps_per_period(self) -> int:
        """The plant's steps in a control period; the loader made sure it is a whole number.

        The analytic plants solve a whole period at once.
        """
        if self.plant.kind == "analytic":
            return 1
        return round(self.control.sampling_time_s / self.plant.contact.timestep_s)
