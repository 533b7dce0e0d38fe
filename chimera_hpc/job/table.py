"""What the tables of a job have in common."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, StringConstraints

Line = Annotated[str, StringConstraints(pattern=r"^[^\x00-\x1f\x7f]+$", max_length=500)]
"""Text on one line."""


def as_tuple(value: Any) -> Any:
    """Convert a list (from TOML or JSON) to a tuple, because a frozen value holds no list."""
    return tuple(value) if isinstance(value, list) else value


def found_in(name: str, origin: Any) -> Path:
    """Return the path of a file that a job names: in the folders of its origin, or the current."""
    places = [Path(folder, name) for folder in (*getattr(origin, "folders", ()), "")]
    return next((place for place in places if place.is_file()), places[0]).absolute()


class Table(BaseModel):
    """Frozen; unknown keys, other types and NaN or infinity are errors."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        defer_build=True,  # building the validators is a fifth of the time of the import
    )
