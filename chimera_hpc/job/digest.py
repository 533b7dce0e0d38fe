"""The digest of a sweep: of everything that determines its points and their results."""

from __future__ import annotations

import json
from collections.abc import Mapping
from hashlib import blake2b
from typing import Any

from chimera_hpc.base import renaming
from chimera_hpc.job.tables import Measures

_OLD_NAMES = {new: old for old, new in renaming.FEATURES.items()}
_DIGESTED = ("model", "grid", "fixed", "integrator", "features")
_DIGESTED_IF_THERE = ("network", "added", "continue")
"""Digests from before these tables existed must not change."""
# Digests from before these keys existed must not change.
_NEWER_FEATURES = {"max_windows": 0, "prominence": 0.0, "steady": "apart"}


def spec_digest(spec: Mapping[str, Any]) -> str:
    """Return the digest of a sweep as `Sweep.to_dict` gave it.

    The sweep may be from an earlier version of the package: newer keys do not enter the digest, and
    renamed settings enter it under their old names.
    """
    data = _digested(spec)
    data["features"] = {
        _OLD_NAMES.get(key, key): value
        for key, value in data["features"].items()
        if _NEWER_FEATURES.get(key) != value
    }
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return blake2b(text.encode(), digest_size=8).hexdigest()


def explain_difference(spec: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """Return one line per digested key with a different value in `other`, a stored sweep."""
    here, there = (_flat({**_digested(x), "measures": x["measures"]}) for x in (spec, other))
    return [
        f"{key}: {_shown(here.get(key))} here, {_shown(there.get(key))} in the store"
        for key in {**here, **there}
        if here.get(key) != there.get(key)
    ]


def _digested(spec: Mapping[str, Any]) -> dict[str, Any]:
    data = {key: spec[key] for key in _DIGESTED}
    data["features"] = {k: v for k, v in spec["features"].items() if k != "preset"}
    if "delta" in spec["grid"]:
        integrator = {key: value for key, value in spec["integrator"].items() if key != "delta"}
        data["integrator"] = integrator
    data["integrator"] = {k: v for k, v in data["integrator"].items() if k != "initial"}
    for name in _DIGESTED_IF_THERE:
        if name in spec:
            data[name] = {k: v for k, v in spec[name].items() if (name, k) != ("network", "file")}
    default = Measures().model_dump(mode="json", exclude_none=True)
    if spec.get("measures", default) != default:
        data["measures"] = spec["measures"]
    return {**data, "order of axes": list(spec["grid"])}


def _flat(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return every key as table.key with its value."""
    flat: dict[str, Any] = {}
    for key, value in data.items():
        inner = value if isinstance(value, dict) else {"": value}
        flat |= {f"{key}.{name}".rstrip("."): item for name, item in inner.items()}
    return flat


def _shown(value: Any) -> str:
    """Return a value as text. A long list is shortened to its ends."""
    if value is None:
        return "nothing"
    if isinstance(value, list):
        few = value if len(value) <= 6 else [*value[:2], "...", value[-1]]
        return f"[{', '.join(map(str, few))}]"
    return str(value)
