"""What every configuration is: frozen, strict and closed to unknown keys."""

from pydantic import BaseModel, ConfigDict


class Config(BaseModel):
    """Base of every configuration: frozen, strict about types, closed to unknown keys."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, validate_default=True
    )

    @classmethod
    def summary(cls) -> str:
        """The first sentence of its description."""
        return " ".join((cls.__doc__ or "").split("\n\n")[0].split()).rstrip(".")
