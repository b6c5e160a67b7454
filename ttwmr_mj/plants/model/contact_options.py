"""How contact physics is solved, and the floor: chosen by measurement (models/README.md)."""

from typing import Annotated, ClassVar

from pydantic import Field

from ttwmr_mj.files import input_file
from ttwmr_mj.robot import Config

SCENE = "give a scene file, relative to the scenario, or leave the key out for the shipped one"


class ContactOptions(Config):
    """Settings of the MuJoCo plant."""

    same_in_batch: ClassVar[frozenset[str]] = frozenset({"timestep_s"})

    timestep_s: float = Field(
        default=0.0005,
        ge=1e-5,
        le=0.01,
        description="physics step; the contact error is proportional to it; typically 5e-4",
    )
    contact_time_constant_s: float = Field(
        default=0.001,
        ge=1e-5,
        le=0.1,
        description="time constant of the contacts (solref): smaller is stiffer and creeps "
        "less, at least two steps; typically 1e-3",
    )
    friction_impedance_ratio: float = Field(
        default=10.0,
        ge=1,
        le=1e5,
        description="stiffness of friction relative to the normal direction (impratio): "
        "larger slips less; typically 1 to 100",
    )
    floor_friction: float = Field(
        default=0.9,
        ge=1e-12,
        le=10,
        description="Coulomb coefficient of tyres and balls on the floor; typically 0.9",
    )
    model_path: Annotated[str, input_file(SCENE)] | None = Field(
        default=None,
        description="another scene file that includes models/ttwmr.xml, relative to the "
        "scenario: it may add to the laboratory, but change neither the robot nor how physics is "
        "solved (howto/scenarios); recordings of analytic runs show it too",
    )
