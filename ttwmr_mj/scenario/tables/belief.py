"""What the controller is told: `[belief]`."""

from collections.abc import Callable
from typing import Annotated, Any

from pydantic import Field, GetCoreSchemaHandler, GetPydanticSchema
from pydantic_core import core_schema

from ttwmr_mj.dynamics.floor.ground import Ground
from ttwmr_mj.robot import Config, RobotParameters
from ttwmr_mj.sensing import UpTo10
from ttwmr_mj.vision.camera.options import CameraOptions


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
