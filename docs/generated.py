"""Reference tables that come from the code itself: the job file, the command line, the store."""

from __future__ import annotations

import json
import os
from argparse import ArgumentParser
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from chimera_hpc.base.status import Status
from chimera_hpc.cli import COMMANDS
from chimera_hpc.cli.main import parser
from chimera_hpc.job import Sweep
from chimera_hpc.job.models import built_in
from chimera_hpc.job.networks import KINDS, kind_parameters
from chimera_hpc.job.parameters import DELTA
from chimera_hpc.job.schema import job_schema
from chimera_hpc.job.shipped import job_file
from chimera_hpc.models.parameters import Parameter
from chimera_hpc.store.schema import array_plans

_TOP = ("name", "title", "model")
_WIDTH = "96"


def write_pages(folder: Path) -> None:
    """Write every table into the folder, leaving files alone that are right already."""
    folder.mkdir(exist_ok=True)
    pages = {
        "job-file.md": job_file_tables(),
        "command-line.md": command_line(),
        "store-arrays.md": store_arrays(),
        "status.md": statuses(),
    }
    for name, text in pages.items():
        file = folder / name
        if not file.is_file() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")


def job_file_tables() -> str:
    """Return the keys of a job file: type, default and meaning, from the schema."""
    schema = job_schema()
    properties, tables = schema["properties"], schema["$defs"]
    parts = [
        "## Top of the file",
        _keys({name: properties[name] for name in _TOP}),
        "## [grid] and [fixed]",
        f"`[grid]`: {properties['grid']['description']}",
        f"`[fixed]`: {properties['fixed']['description']}",
    ]
    for name, model in built_in().items():
        parts += [f"### {name}", _parameters((model.n_nodes, *model.parameters))]
        parts += [f"- {limit.text}" for limit in model.limits]
    for kind in KINDS:
        parts += [f'### network.kind = "{kind}"', _parameters(kind_parameters(kind))]
    parts.append(f"`{DELTA.name}` may be an axis of every model. {DELTA.text}")
    for name, entry in properties.items():
        if "$ref" in entry:
            table = tables[entry["$ref"].rpartition("/")[2]]
            parts += [f"## [{name}]", table["description"], _keys(table["properties"])]
    return _page(parts)


def _keys(entries: Mapping[str, Mapping[str, Any]]) -> str:
    rows = [
        (f"`{name}`", _allowed(entry), _default(entry), entry["description"])
        for name, entry in entries.items()
    ]
    return _table(("key", "value", "default", "meaning"), rows)


def _parameters(parameters: Iterable[Parameter]) -> str:
    rows = [
        (f"`{p.name}`", p.allowed, "required" if p.default is None else f"{p.default:.6g}", p.text)
        for p in parameters
    ]
    return _table(("key", "value", "default", "meaning"), rows)


_WORDS = {
    "integer": "integer",
    "number": "number",
    "string": "text",
    "boolean": "true or false",
    "object": "table",
}
_BOUNDS = {
    "minimum": "from {}",
    "exclusiveMinimum": "above {}",
    "maximum": "up to {}",
    "minItems": "at least {} of them",
}


def _allowed(entry: Mapping[str, Any]) -> str:
    """Return what a schema lets through, in words."""
    if "anyOf" in entry:
        kinds = [_allowed(kind) for kind in entry["anyOf"] if kind.get("type") != "null"]
        return " or ".join(dict.fromkeys(kinds))
    if "enum" in entry:
        return ", ".join(f"`{word}`" for word in entry["enum"])
    if "anyOf" in entry.get("items", {}):
        return "list of names"
    if "const" in entry:
        return f"`{json.dumps(entry['const'])}`"
    if "prefixItems" in entry:
        return f"list of {len(entry['prefixItems'])} numbers"
    if entry.get("type") == "array":
        return f"list of {_allowed(entry['items'])}"
    if entry.get("pattern") == ":":
        return f"`{entry.get('description', 'package.module:object')}`"
    bounds = [text.format(f"{entry[key]:g}") for key, text in _BOUNDS.items() if key in entry]
    return " ".join([_WORDS[entry["type"]], *bounds])


def _default(entry: Mapping[str, Any]) -> str:
    default = entry.get("default", "required")
    if default in (None, "required"):
        return default or "none"
    return f"`{json.dumps(default)}`"


def command_line() -> str:
    """Return the help text of the command line and of each of its commands."""
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = _WIDTH
    try:
        top = parser()
        parts = [_text(top.format_help())]
        for command in COMMANDS:
            parts += [f"## {command.name}", _text(_sub(top, command.name).format_help())]
    finally:
        del os.environ["COLUMNS"]
        if before is not None:
            os.environ["COLUMNS"] = before
    return _page(parts)


def _sub(top: ArgumentParser, name: str) -> ArgumentParser:
    choices = next(action.choices for action in top._actions if isinstance(action.choices, dict))
    found: ArgumentParser = choices[name]
    return found


def store_arrays() -> str:
    """Return the arrays of a store, those of the quickstart, and their labels."""
    sweep = Sweep.load(job_file("quickstart"))
    plans = array_plans(sweep, sweep.points().columns, block_size=58)
    named = {plan.name: plan for plan in plans}
    rows = [
        (
            f"`{plan.name}`",
            ", ".join(plan.dimensions),
            plan.dtype,
            " x ".join(map(str, plan.chunks)),
            plan.attributes["long_name"],
        )
        for plan in plans
    ]
    parts = [_table(("array", "dimensions", "type", "chunk", "what"), rows)]
    labelled = {"features": "feature", "scalars": "quantity", "quality": "mark", "ledger": "field"}
    for name, dimension in labelled.items():
        attributes = named[name].attributes
        labels = zip(attributes["labels"], attributes["label_units"], strict=True)
        words = ", ".join(f"`{label}`" + (f" ({u})" if u != "1" else "") for label, u in labels)
        parts.append(f"Along `{dimension}`: {words}.")
    return _page(parts)


def statuses() -> str:
    """Return the codes of the ledger with their sentences."""
    rows = [(str(int(code)), f"`{code.name.lower()}`", code.sentence) for code in Status]
    return _page([_table(("code", "name", "meaning"), rows)])


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(c.replace("|", "\\|") for c in row) + " |" for row in lines)


def _text(text: str) -> str:
    return f"```text\n{text.rstrip()}\n```"


def _page(parts: Iterable[str]) -> str:
    return "\n\n".join(parts) + "\n"
