"""The job files of the tests: a few tables of keys, and the text that changes of them give."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

BARE = {"name": "x", "model": "topological_fhn", "grid.P": "2:4", "grid.Q": "P"}
"""As little as a job may say."""

SMALL = BARE | {
    "name": "small",
    "grid.seeds": 5,
    "fixed.n_nodes": 12,
    "integrator.t_end": 60.0,
    "integrator.t_step": 0.1,
    "features.start": 30.0,
    "features.n_peaks": 3,
    "features.n_overlap": 1,
    "run.block": 4,
}
"""15 points of small rings in blocks of 4, each computed in milliseconds."""


def job_text(base: Mapping[str, Any], changes: Mapping[str, Any] | None = None) -> str:
    """Return the TOML text of a job: `base` with changes, by ``table.key``; None leaves a key out.

    Tables come in the order in which they are named first.
    """
    keys = {key: value for key, value in {**base, **(changes or {})}.items() if value is not None}
    tables: dict[str, list[str]] = {"": []}
    for key, value in keys.items():
        table, _, name = key.rpartition(".")
        tables.setdefault(table, []).append(f"{name} = {_toml(value)}")
    parts = [[f"[{table}]", *lines] if table else lines for table, lines in tables.items()]
    return "".join(f"{line}\n" for lines in parts for line in lines)


def _toml(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{name} = {_toml(item)}" for name, item in value.items()) + " }"
    return json.dumps(value)
