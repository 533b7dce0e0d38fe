"""Extends stores by new points, and repairs stores after an interrupted change."""

from __future__ import annotations

import contextlib
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.files import sync_tree, write_atomically
from chimera_hpc.job import Points, Sweep
from chimera_hpc.job.chains import followed
from chimera_hpc.job.points import point_keys
from chimera_hpc.job.states import largest_state
from chimera_hpc.job.together import points_of
from chimera_hpc.store.claims import claim_block
from chimera_hpc.store.ledger import METADATA
from chimera_hpc.store.schema import BLOCK_ARRAYS
from chimera_hpc.store.template import REDUCTION, root_attributes, write_coordinates, write_root

_CLAIM = "metadata"
_EXPIRY = 20.0
"""Seconds after which a change by another machine counts as broken off; it takes one or two."""
_PATIENCE = 30.0
"""Seconds to wait for others."""
SAME_TABLES = ("model", "network", "integrator", "continue_", "features", "keep")
"""What the points of one store have in common."""


@contextlib.contextmanager
def exclusive(path: Path) -> Iterator[None]:
    """Let only this process change the metadata of a store; BadInput if others take too long.

    What was read of the metadata before may be out of date by now.
    """
    deadline = time.monotonic() + _PATIENCE
    while (claim := claim_block(path, _CLAIM, run=0, expiry=_EXPIRY)) is None:
        if time.monotonic() > deadline:
            raise BadInput(f"{path}: another process keeps changing the store; try again later")
        time.sleep(0.1)
    try:
        yield
    finally:
        claim.release()


def extend(path: Path, sweeps: Sequence[Sweep], sweep: Sweep, block_size: int) -> None:
    """Add to a store the points of `sweep` that it does not have, behind the others.

    The arrays' own metadata and the coordinates come first; the root, which is what counts, last.
    So a reader sees the old store or the new one, and a killed extension has not happened.
    Raises BadInput unless `sweep` holds all points of the store and differs in its axes only.
    """
    if sweep.digest == sweeps[-1].digest:
        return
    old = points_of(sweeps)
    check_extension(path, sweeps[-1], old, sweep)
    new = points_of([*sweeps, sweep])
    stored = _stored_columns(path, new)
    for folder in (*stored, *BLOCK_ARRAYS):
        file = path / folder / METADATA
        if file.exists():
            node = json.loads(file.read_bytes())
            node["shape"][0] = len(new)
            write_atomically(file, json.dumps(node, indent=1).encode())
    write_coordinates(path, sweep, stored)
    for name in (*stored, "time"):
        sync_tree(path / name)
    write_root(path, root_attributes([*sweeps, sweep], len(new), block_size))


def repair_metadata(path: Path, root: Mapping[str, Any], sweep: Sweep, points: Points) -> list[str]:
    """Rewrite what differs from the root metadata of a store; return a line each.

    `root` are the metadata that count: those of the file, or of its copy when the file is damaged.
    """
    done = []
    if _json(path / METADATA) != root:
        write_atomically(path / METADATA, json.dumps(root, indent=1).encode())
        done.append(f"{METADATA} rewritten")
    for name, node in root["consolidated_metadata"]["metadata"].items():
        file = path / name / METADATA
        own = node if node["node_type"] == "array" else None
        if own is not None and name.partition("/")[0] != REDUCTION and _json(file) != own:
            file.parent.mkdir(exist_ok=True)
            write_atomically(file, json.dumps(own, indent=1).encode())
            done.append(f"{name}/{METADATA} rewritten")
    known = set(root["consolidated_metadata"]["metadata"])
    broken_off = [file for name in known for file in (path / name).glob("c.*.partial")]
    for file in broken_off:
        # Zarr's own temporary files; only one process at a time writes coordinates.
        file.unlink(missing_ok=True)
    columns = {name: column for name, column in points.columns.items() if name in known}
    if not _coordinates_hold(path, columns):
        write_coordinates(path, sweep, columns)
        done.append("coordinates rewritten")
    return done + ([f"{len(broken_off)} temporary files removed"] if broken_off else [])


def check_extension(path: Path, before: Sweep, old: Points, sweep: Sweep) -> None:
    """Raise BadInput unless `sweep` holds all points of a store and differs in its axes only."""
    changed = [name for name in SAME_TABLES if getattr(sweep, name) != getattr(before, name)]
    changed = [name.rstrip("_") for name in changed]
    if sweep.n_nodes != before.n_nodes:
        changed.append("fixed.n_nodes")
    elif sweep.n_observed != before.n_observed:
        changed.append(f"the largest number of {sweep.signals}")
    elif followed(sweep) != followed(before):
        changed.append("the axis of the chains")
    elif largest_state(sweep) != largest_state(before):
        changed.append("the largest number of variables")
    if changed:
        raise BadInput(f"{path}: an extension may change axes only, not {', '.join(changed)}")
    new = sweep.points()
    missing = np.flatnonzero(~np.isin(point_keys(old), point_keys(new, old)))
    if len(missing):
        rounds = before.added is not None and sweep.added is None
        row = ", ".join(f"{name}={value}" for name, value in old.row(int(missing[0])).items())
        hint = "; take the sweep's folder instead of its job file" if rounds else ""
        raise BadInput(
            f"{path}: an extension must hold all points of the store, not so {row}{hint}"
        )
    if sweep.keep.series == "first-seed" and new.row(0)["seed"] != old.row(0)["seed"]:
        raise BadInput(f"{path}: an extension may not change the first seed, whose series is kept")


def _stored_columns(path: Path, points: Points) -> dict[str, NDArray[Any]]:
    """Return the columns that the store has; a later version of a model may know more.

    Raises BadInput when the points differ in one that the store has not.
    """
    missing = [name for name in points.columns if not (path / name / METADATA).exists()]
    for name in missing:
        column = points.columns[name]
        if (column != column[0]).any():
            text = f"it was planned by an earlier version, which had no parameter {name}"
            raise BadInput(f"{path}: cannot be extended in {name}: {text}")
    return {name: column for name, column in points.columns.items() if name not in missing}


def _coordinates_hold(path: Path, columns: Mapping[str, NDArray[Any]]) -> bool:
    try:
        group = zarr.open_group(path, mode="r")
        return all(
            np.array_equal(np.asarray(group[name]), column) for name, column in columns.items()
        )
    except Exception:
        # However it fails, they cannot be read.
        return False


def _json(file: Path) -> Any:
    try:
        return json.loads(file.read_bytes())
    except (OSError, ValueError):
        return None
