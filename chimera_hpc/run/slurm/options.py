"""The options for SLURM: from the user's own file, the job's table [slurm], the command line."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.places import home_folder
from chimera_hpc.job.reading import one_line, parse_toml, read_text
from chimera_hpc.job.tables import Slurm, unknown_key

NAMES = ("partition", "account", "time", "mem", "workers", "array", "at_once", "interface")
"""Keys that the command line has too."""
_TABLE = "slurm"


def user_file() -> Path:
    """Return the file with the user's own defaults, which need not exist."""
    base = os.environ.get("XDG_CONFIG_HOME") or home_folder() / ".config"
    return Path(base) / "chimera_hpc" / "config.toml"


def slurm_options(table: Slurm, given: Mapping[str, Any]) -> Slurm:
    """Return what is asked of SLURM: the user's file, overridden by the job and the command line.

    Raises BadInput for a key that is none, or a value, naming the place.
    """
    base = _users_own()
    told = {name: given[name] for name in NAMES if given.get(name) is not None}
    values = base.model_dump(exclude_defaults=True) | table.model_dump(exclude_defaults=True)
    result = _checked(values | told, _TABLE)
    # It would make arrays of the other jobs, too.
    if any(option.startswith("--array") for option in result.extra):
        raise BadInput(f"{_TABLE}: extra: --array is said by the keys array and at_once")
    return result


def _users_own() -> Slurm:
    path = user_file()
    tables = parse_toml(read_text(path), str(path)) if path.is_file() else {}
    for name in tables:
        if name != _TABLE:
            raise BadInput(f"{path}: {unknown_key('', name, [_TABLE])}")
    return _checked(tables.get(_TABLE, {}), f"{path}: {_TABLE}")


def _checked(values: Any, where: str) -> Slurm:
    try:
        return Slurm.model_validate(values)
    except ValidationError as error:
        raise BadInput(f"{where}: {one_line(error, list(Slurm.model_fields))}") from None
