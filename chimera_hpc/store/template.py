"""The template of a store: arrays, attributes and coordinates, before any point is run."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import zarr
from numpy.typing import NDArray
from zarr.codecs import BloscCodec, Crc32cCodec, TransposeCodec, ZstdCodec
from zarr.core.metadata.v3 import ArrayV3Metadata
from zarr.storage import StoreLike

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.files import (
    remove_leftovers,
    sync_folder,
    sync_tree,
    temporary_name,
    write_atomically,
)
from chimera_hpc.base.streams import STREAM_TAG
from chimera_hpc.job import Points, Sweep, block_size
from chimera_hpc.job.digest import spec_digest
from chimera_hpc.job.models import model_folder
from chimera_hpc.job.user_models import Origin
from chimera_hpc.store.ledger import (
    METADATA,
    METADATA_COPY,
    SEPARATOR,
    metadata_copy,
    read_metadata,
)
from chimera_hpc.store.origin import stored_origin
from chimera_hpc.store.schema import (
    BLOCK_ARRAYS,
    OPTIONAL,
    ArrayPlan,
    array_plans,
    block_plans,
    inner_chunk,
    is_undivided,
    sample_times,
    state_width,
)

SCHEMA = 1
"""Version of the store's layout, in its root attributes."""
REDUCTION = "reduction"
"""Group of what was made of the points."""


def write_template(path: Path, sweep: Sweep) -> None:
    """Create the store of a sweep, as `create_whole` does."""
    points = sweep.points()
    size = block_size(sweep, len(points))
    create_whole(path, lambda temporary: build(temporary, [sweep], points, size))


def create_whole(path: Path, make: Callable[[Path], None]) -> None:
    """Create a store, completely or not at all.

    `make` builds it under a temporary name in the same folder, then it is flushed to the disk and
    renamed. Raises BadInput when the path exists or cannot be written.
    """
    if path.exists():
        raise BadInput(f"{path}: exists already, a new store needs a new name")
    temporary = temporary_name(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        remove_leftovers(path.parent)
        make(temporary)
        sync_tree(temporary)
        os.rename(temporary, path)
        sync_folder(path.parent)
    except OSError as error:
        # Where another process was faster, the rename fails: that folder is not empty.
        raise BadInput(f"{path}: no store can be made here: {_reason(error)}") from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def build(path: Path, sweeps: Sequence[Sweep], points: Points, size: int) -> None:
    """Write arrays without chunks, coordinates and root metadata for these points."""
    zarr.create_group(path)
    for plan in array_plans(sweeps[-1], points.columns, size):
        create_array(path, plan)
    write_coordinates(path, sweeps[-1], points.columns)
    write_root(path, root_attributes(sweeps, len(points), size))


def root_attributes(sweeps: Sequence[Sweep], n_points: int, size: int) -> dict[str, Any]:
    """Return the attributes of the whole store; `sweeps` are the first plan and its extensions."""
    latest = sweeps[-1]
    folder = model_folder(latest)
    return {
        "title": latest.title or latest.name,
        "schema": SCHEMA,
        "spec": latest.to_dict(),
        "digest": latest.digest,
        "specs": [sweep.to_dict() for sweep in sweeps],
        "stream_tag": STREAM_TAG,
        "n_points": n_points,
        "block_size": size,
        **({} if folder is None else {"model_folder": folder}),
    }


def write_root(path: Path, attributes: Mapping[str, Any]) -> None:
    """Write the root metadata with the metadata of all arrays as they are now.

    A plan or an extension is valid from this moment on.
    """
    _write_root(path, attributes, _nodes(path, "*") | _nodes(path, f"{REDUCTION}/*"))


def consolidate(path: Path, attributes: Mapping[str, Any] | None = None) -> None:
    """Rewrite the root metadata, with the present reduction and with new attributes if given.

    What is known of the other arrays stays: an extension that was killed has altered their own
    files already, but does not count.
    """
    root = read_metadata(path)
    known = root["consolidated_metadata"]["metadata"]
    nodes = {n: node for n, node in known.items() if n.partition("/")[0] != REDUCTION}
    nodes |= _nodes(path, REDUCTION) | _nodes(path, f"{REDUCTION}/*")
    _write_root(path, root["attributes"] if attributes is None else attributes, nodes)


def check_root(path: Path, root: Mapping[str, Any], origin: Origin | None = None) -> Sweep:
    """Return the sweep that root metadata describe; BadInput when they contradict themselves.

    `origin` tells where a user's model comes from; without it `stored_origin` does.
    """
    attributes, nodes = root["attributes"], root["consolidated_metadata"]["metadata"]
    origin = origin or stored_origin(path, root)
    sweep = Sweep.from_dict(attributes["spec"], str(path), origin)
    specs = attributes.get("specs")
    if _digest(attributes) != attributes["digest"] or not isinstance(specs, list) or not specs:
        raise BadInput(f"{path}: the attributes spec, specs and digest do not belong together")
    for spec in specs:
        Sweep.from_dict(spec, str(path), origin)
    n_points = attributes["n_points"]
    damaged = [name for name, node in nodes.items() if not _is_sound(name, node, n_points)]
    kept: dict[str, Any] = {"n_state": state_width(nodes), "undivided": is_undivided(nodes)}
    for plan in block_plans(sweep, n_points, attributes["block_size"], **kept):
        missing = plan.name in OPTIONAL and plan.name not in nodes
        if not missing and not _matches(nodes.get(plan.name), plan):
            damaged.append(plan.name)
    if damaged:
        raise BadInput(f"{path}: the metadata of {damaged[0][:100]!r} are damaged")
    return sweep


def create_array(store: StoreLike, plan: ArrayPlan) -> zarr.Array[Any]:
    """Create an empty array as planned, with a checksum in every chunk, inside shards too."""
    options: dict[str, Any] = {"chunks": plan.chunks, "filters": None}
    if plan.inner is not None:
        # Time runs fastest and the bytes of a number are split, else hardly anything is gained.
        shuffled = BloscCodec(cname="lz4", clevel=5, shuffle="shuffle")
        options = {"chunks": plan.inner, "shards": plan.chunks}
        options["filters"] = [TransposeCodec(order=(0, 2, 1))]
        options["compressors"] = [shuffled, Crc32cCodec()]
    elif plan.name in BLOCK_ARRAYS:
        options["compressors"] = [Crc32cCodec()]
    else:
        options["compressors"] = [ZstdCodec(level=3), Crc32cCodec()]
    return zarr.create_array(
        store,
        name=plan.name,
        shape=plan.shape,
        dtype=plan.dtype,
        fill_value=plan.fill,
        dimension_names=plan.dimensions,
        attributes=dict(plan.attributes),
        chunk_key_encoding={"name": "default", "separator": SEPARATOR},
        **options,
    )


def write_coordinates(path: Path, sweep: Sweep, columns: Mapping[str, NDArray[Any]]) -> None:
    """Write the coordinates over `point`, and the sampling times where series are kept."""
    group = zarr.open_group(path, mode="r+", use_consolidated=False)
    for name, column in columns.items():
        _array(group, name)[:] = column
    if sweep.keep.series != "none":
        _array(group, "time")[:] = sample_times(sweep)


def _reason(error: OSError) -> str:
    return f"{error.strerror} ({error.filename})" if error.filename else str(error.strerror)


def _digest(attributes: Mapping[str, Any]) -> str | None:
    """Return the digest of the spec as it is stored; None where it lacks a table."""
    try:
        return spec_digest(attributes["spec"])
    except (KeyError, TypeError, ValueError, AttributeError):
        return None


def _is_sound(name: str, node: Any, n_points: int) -> bool:
    """Whether this is the metadata of a group, or of an array with as many points as there are.

    A reduction may be older than the last extension.
    """
    try:
        if node["node_type"] == "group":
            return True
        array = ArrayV3Metadata.from_dict(dict(node))
        # Zarr lets chunks of size 0 through, and divides by it later.
        if not all(node["chunk_grid"]["configuration"]["chunk_shape"]):
            return False
        is_coordinate = array.dimension_names == ("point",) and "/" not in name
        return array.shape == (n_points,) if is_coordinate else True
    except Exception:
        # Each part of the metadata has its own way to say that it is not one.
        return False


def _matches(node: Any, plan: ArrayPlan) -> bool:
    try:
        chunks = node["chunk_grid"]["configuration"]["chunk_shape"]
        found = (tuple(node["shape"]), tuple(chunks), node["data_type"], node["dimension_names"])
    except (KeyError, TypeError):
        return False
    wanted = (plan.shape, plan.chunks, plan.dtype, list(plan.dimensions))
    return found == wanted and plan.inner in (None, inner_chunk(node))


def _array(group: zarr.Group, name: str) -> zarr.Array[Any]:
    found = group[name]
    assert isinstance(found, zarr.Array)
    # Left to itself zarr skips chunks full of the fill value: no telling them from lost ones.
    array: zarr.Array[Any] = found.with_config({"write_empty_chunks": True})
    return array


def _nodes(path: Path, pattern: str) -> dict[str, dict[str, Any]]:
    """Return the metadata of the groups and arrays that match, by their path in the store."""
    files = path.glob(f"{pattern}/{METADATA}")
    return {file.parent.relative_to(path).as_posix(): _node(file) for file in files}


def _node(file: Path) -> dict[str, Any]:
    node: dict[str, Any] = json.loads(file.read_bytes())
    if node["node_type"] == "group":
        node["consolidated_metadata"] = _consolidated({})
    return node


def _write_root(path: Path, attributes: Mapping[str, Any], nodes: Mapping[str, Any]) -> None:
    """Replace the root metadata in one step.

    They are what `zarr.consolidate_metadata` makes, which would look into `runs` and `claims` too:
    these are no part of the Zarr hierarchy. A checksummed copy is written first, from which a
    damaged root is found out and restored.
    """
    root = {
        "attributes": dict(attributes),
        "zarr_format": 3,
        "consolidated_metadata": _consolidated(dict(sorted(nodes.items()))),
        "node_type": "group",
    }
    data = json.dumps(root, indent=1).encode()
    file = path / METADATA
    before = file.read_bytes() if file.exists() else b""
    write_atomically(path / METADATA_COPY, metadata_copy(data, before))
    write_atomically(file, data)


def _consolidated(nodes: Mapping[str, Any]) -> dict[str, Any]:
    return {"kind": "inline", "must_understand": False, "metadata": nodes}
