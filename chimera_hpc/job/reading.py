"""From text to plain data, and from errors to one line: TOML, KEY=VALUE overrides, messages."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from datetime import date, time
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import short
from chimera_hpc.job.tables import TABLES, unknown_key

_BARE = re.compile(r"[^\[{\"'\n\r=#]+")
_TOP = ("name", "title", "model")


def bad(where: str, text: str) -> BadInput:
    """Return the error with its message on one line: the place, then what is wrong there."""
    line = f"{where}: {text}" if where else text
    return BadInput("".join(char if char.isprintable() else " " for char in line))


def read_text(path: str | Path) -> str:
    """Return the text of a job file; BadInput when there is none to read."""
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        reason = "no such job file"
    except (OSError, ValueError) as error:
        reason = f"not a readable job file ({getattr(error, 'strerror', None) or error})"
    raise bad(str(path), reason)


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Return the tables of TOML text; BadInput with line and column when it is not valid."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise bad(where, f"not valid TOML: {error}") from None


def apply_overrides(data: Mapping[str, Any], overrides: Sequence[str]) -> dict[str, Any]:
    """Return the data with each KEY=VALUE put in its place.

    KEY is `table.key`, or a bare key: a parameter, which stays in [grid] when it is an axis and
    goes there when the value is one (a list, a range, a name), else into [fixed]; `seeds`; or name,
    title, model. VALUE is TOML, or bare text such as 3:8, P or sine-fit.
    """
    changed = {key: dict(v) if isinstance(v, dict) else v for key, v in data.items()}
    for override in overrides:
        key, equals, text = override.partition("=")
        if not equals or not key.strip():
            raise bad(f"--set {short(override)}", "KEY=VALUE is needed")
        _assign(changed, key.strip(), _parse_value(text.strip(), override), override)
    return changed


def _assign(data: dict[str, Any], dotted: str, value: Any, override: str) -> None:
    table, _, key = dotted.rpartition(".")
    if not table and key in _TOP:
        data[key] = value
        return
    for name in {table or "grid", "grid", "fixed"}:
        if not isinstance(data.setdefault(name, {}), dict):
            raise bad(f"--set {short(override)}", f"{name} is not a table")
    if table in ("", "grid", "fixed"):
        is_axis = isinstance(value, str | list | dict) or key == "seeds" or key in data["grid"]
        table = "grid" if table == "grid" or is_axis else "fixed"
        if table == "grid":
            data["fixed"].pop(key, None)
    data[table][key] = value


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
    """Return the most telling of pydantic's complaints as 'key: what is wrong', without the place.

    An unknown key comes first, since it is often the reason for a missing one. `known` are the keys
    at the top.
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
