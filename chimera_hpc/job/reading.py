"""From text to plain data, and from errors to one line: TOML, KEY=VALUE overrides, messages."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from datetime import date, time
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from chimera_hpc.base import renaming
from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import short
from chimera_hpc.job.models import parameters_of
from chimera_hpc.job.tables import TABLES, unknown_key
from chimera_hpc.job.user_models import Origin
from chimera_hpc.measures.conventions import PRESETS

_BARE = re.compile(r"[^\[{\"'\n\r=#]+")
_PRESET_KEYS = frozenset(PRESETS["default"])
_TOP = ("name", "title", "model")


def bad(where: str, text: str) -> BadInput:
    """Return the error with its message on one line: the place, then what is wrong there."""
    line = f"{where}: {text}" if where else text
    return BadInput("".join(char if char.isprintable() else " " for char in line))


def read_text(path: str | Path) -> str:
    """Return the text of a job file. Raises BadInput if it cannot be read."""
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        reason = "no such job file"
    except (OSError, ValueError) as error:
        reason = f"not a readable job file ({getattr(error, 'strerror', None) or error})"
    raise bad(str(path), reason)


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Return the tables of TOML text. Raises BadInput with line and column if it is invalid."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise bad(where, f"not valid TOML: {error}") from None


def apply_overrides(
    data: Mapping[str, Any], overrides: Sequence[str], origin: Origin | None = None
) -> dict[str, Any]:
    """Return the data with each KEY=VALUE applied.

    KEY is `table.key`, or a bare key: name, title, model; `seeds`; a parameter of the model; or a
    key of exactly one other table but [decide]. A parameter is set in [grid] if it is already an
    axis or if the value describes one (a list, a range, a name), else in [fixed]. A preset replaces
    the settings that it defines. VALUE is TOML, or bare text such as 3:8, P or sine-fit. `origin`
    tells where a user's model comes from.
    """
    changed = {key: dict(v) if isinstance(v, dict) else v for key, v in data.items()}
    for override in overrides:
        key, equals, text = override.partition("=")
        if not equals or not key.strip():
            raise bad(f"--set {short(override)}", "KEY=VALUE is needed")
        table, name = _place(changed, key.strip(), override, origin)
        value = _parse_value(text.strip(), override)
        if not table:
            changed[name] = value
        elif table == "grid" or (table == "fixed" and _is_axis(value)):
            changed["grid"][name] = value
            changed["fixed"].pop(name, None)
        else:
            changed[table][name] = value
            if (table, name) == ("features", "preset"):
                changed[table] = {k: v for k, v in changed[table].items() if k not in _PRESET_KEYS}
    return changed


def _is_axis(value: Any) -> bool:
    return isinstance(value, str | list | dict)


def _place(
    data: dict[str, Any], dotted: str, override: str, origin: Origin | None
) -> tuple[str, str]:
    """Return the table (created if missing) and the key that an override sets."""
    table, _, key = dotted.rpartition(".")
    if not table and key in _TOP:
        return "", key
    for name in ("grid", "fixed", *([table] if table else [])):
        if not isinstance(data.setdefault(name, {}), dict):
            raise bad(f"--set {short(override)}", f"{name} is not a table")
    if not table:
        table = _table_of(data, key, origin)
    if table == "features" and key in renaming.FEATURES:
        new = renaming.FEATURES[key]
        renaming.warn(f"features.{key}", f"features.{new}")
        key = new
    if table in ("", "fixed"):
        table = "grid" if key == "seeds" or key in data["grid"] else "fixed"
    data.setdefault(table, {})
    return table, key


def _table_of(data: Mapping[str, Any], key: str, origin: Origin | None) -> str:
    """Return the table, other than [grid] and [fixed], that has this bare key, if any."""
    new = renaming.FEATURES.get(key, key)
    homes = [name for name, t in TABLES.items() if new in t.model_fields and name != "decide"]
    if len(homes) != 1 or key in {*data["grid"], *data["fixed"], "delta"}:
        return ""
    try:
        known = parameters_of(str(data.get("model", "")), origin)
    except BadInput:
        return ""
    return "" if known.find(key) else homes[0]


def _parse_value(text: str, override: str) -> Any:
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        parsed = {}
    if set(parsed) == {"value"} and not isinstance(parsed["value"], date | time):
        return parsed["value"]
    if not _BARE.fullmatch(text):
        raise bad(f"--set {short(override)}", "the value is neither TOML nor a bare word or range")
    return text


def one_line(error: ValidationError, known: list[str]) -> str:
    """Return the most useful of pydantic's errors as 'key: what is wrong', without the place.

    An unknown key comes first, since it is often the reason for a missing one. `known` holds the
    keys at the top level.
    """
    complaints = error.errors(include_url=False)
    first = min(complaints, key=lambda complaint: complaint["type"] != "extra_forbidden")
    path = [str(part) for part in first["loc"]]
    if first["type"] == "extra_forbidden":
        table = TABLES[path[0]].model_fields if len(path) > 1 else known
        return unknown_key(".".join(path[:-1]), path[-1], list(table))
    if isinstance(cause := first.get("ctx", {}).get("error"), BadInput):
        return str(cause)
    key = ".".join(path) or "the whole"
    if first["type"] == "missing":
        return f"{key}: missing"
    text = first["msg"].replace("Input should", "it should")
    return f"{key} = {short(first['input'])}: {text}"
