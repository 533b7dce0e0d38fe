"""What is wished of SLURM: the user's own file, the job's table [slurm], the command line."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from chimera_hpc.errors import BadInput
from chimera_hpc.grid.parameters import nearest
from chimera_hpc.grid.reading import parse_toml, read_text
from chimera_hpc.grid.tables import Slurm

NAMES = ("partition", "account", "time", "mem", "workers", "array", "interface")
"""Keys that the command line has too."""


def user_file() -> Path:
    """Return the file with the user's own defaults, which need not exist."""
    base = os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config"
    return Path(base) / "chimera_hpc" / "config.toml"


def wishes(table: Slurm, given: Mapping[str, Any]) -> Slurm:
    """Return the wishes of the user's file, overridden by the job's and the command line's.

    Raises
    ------
    BadInput
        For a value that is none, naming the place.
    """
    path = user_file()
    own = parse_toml(read_text(path), str(path)).get("slurm", {}) if path.is_file() else {}
    base = _checked(own, f"{path}: slurm")
    told = {name: given[name] for name in NAMES if given.get(name) is not None}
    values = base.model_dump(exclude_defaults=True) | table.model_dump(exclude_defaults=True)
    return _checked(values | told, "slurm")


def _checked(values: Any, where: str) -> Slurm:
    try:
        return Slurm.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        if first["type"] == "extra_forbidden":
            hint = nearest(key, list(Slurm.model_fields))
            raise BadInput(f"{where}.{key}: unknown key{hint}") from None
        raise BadInput(f"{where}.{key}: {first['msg']}: {first['input']!r}") from None
