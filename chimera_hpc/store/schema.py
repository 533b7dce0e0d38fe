"""What a store holds: names, shapes, types and units of its arrays, and the room they take.

Light on purpose: a plan is printed without loading Zarr. Per block of points there is one chunk in
each array of `BLOCK_ARRAYS`; the coordinates, which a plan writes at once, have chunks of
`COORDINATE_CHUNK` points.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.status import Status
from chimera_hpc.job import Sweep
from chimera_hpc.job.axes import Values
from chimera_hpc.job.parameters import DELTA, DIRECTION, SEED
from chimera_hpc.job.registry import measures
from chimera_hpc.job.states import largest_state
from chimera_hpc.store.ledger import FIELDS

BLOCK_ARRAYS = ("u", "features", "scalars", "quality", "state", "ledger")
"""Arrays with one chunk per block, in the order in which a block is written."""
OPTIONAL = frozenset({"quality"})
"""Block arrays that a store may lack: versions before 0.2 did not plan them."""
QUALITY = ("samples_per_period", "r_squared")
"""How well each run is measured, see `measures.quality`."""
FEATURES = (
    "amplitude",
    "frequency",
    "phase",
    "baseline",
    "amplitude_std",
    "frequency_std",
    "phase_std",
    "baseline_std",
)
COORDINATE_CHUNK = 250_000
SCALE = 1e-4
"""Unit of the int16 series: u = SCALE * stored."""
MISSING = -32768
"""Stored value of an int16 sample that is missing or beyond +-3.2767."""
WHOLE_SERIES = 8_000_000
"""Bytes of a point's series up to which it is one inner chunk."""
SERIES_PIECE = 2_000_000
"""Most bytes of an inner chunk of a larger series."""
SMALL_FILE = 4096
"""Bytes that a metadata file takes, roughly."""
_OTHER_FILES = 3
"""Root metadata, its copy, one run."""

_FEATURE_UNITS = ("1", "1/time", "rad", "1") * 2
_FIELD_UNITS = ("1", "1", "1", "us", "1", "1", "1")


@dataclass(frozen=True)
class ArrayPlan:
    """One array of the template."""

    name: str
    dimensions: tuple[str, ...]
    shape: tuple[int, ...]
    chunks: tuple[int, ...]
    dtype: str
    fill: float
    attributes: Mapping[str, Any]
    inner: tuple[int, ...] | None = None
    """Inner chunks; `chunks` are then shards, whole multiples of them, and may exceed `shape`."""

    @property
    def n_chunks(self) -> int:
        """Number of chunk files when all are written."""
        return math.prod(-(-n // size) for n, size in zip(self.shape, self.chunks, strict=True))

    @property
    def row_bytes(self) -> int:
        """Bytes of one step along the first dimension, before compression."""
        return np.dtype(self.dtype).itemsize * math.prod(self.shape[1:])


@dataclass(frozen=True)
class Room:
    """What a sweep takes on the disk when every point is done."""

    blocks: int
    files: int
    """Files in the store, claims of running blocks left out."""
    bytes: int
    """Upper limit: as if nothing could be compressed."""


def scalar_labels(sweep: Sweep) -> tuple[str, ...]:
    """Return the names along `quantity`: the labels of the sweep's measures, in order."""
    panel = measures(sweep.measures.panel)
    return tuple(label for measure in panel for label in measure.labels(sweep.features))


def sample_times(sweep: Sweep) -> NDArray[np.float64]:
    """Return the times of the kept series: multiples of `t_step` from `start` to `t_end`."""
    step = sweep.integrator.t_step
    last = math.floor(sweep.integrator.t_end / step + 1e-9)
    return step * np.arange(last - sweep.n_samples + 1, last + 1, dtype=np.float64)


def series_mask(sweep: Sweep, seeds: NDArray[Any]) -> NDArray[np.bool_]:
    """Tell for points with these seeds whether their series is kept."""
    if sweep.keep.series == "first-seed":
        axis = sweep.axes["seed"]
        assert isinstance(axis, Values)
        return np.asarray(seeds == axis.values[0])
    return np.full(len(seeds), sweep.keep.series == "all")


def decode_series(stored: NDArray[Any]) -> NDArray[np.float64]:
    """Return a stored series as float64, NaN where a sample is missing."""
    if stored.dtype != np.int16:
        return stored.astype(np.float64)
    u = stored * SCALE
    u[stored == MISSING] = np.nan
    return np.asarray(u)


def series_plan(
    shape: tuple[int, ...], block_size: int, dtype: str, piece: tuple[int, ...] | None = None
) -> ArrayPlan:
    """Return the array `u` of shape (points, times, nodes), without attributes.

    piece: times and nodes of an inner chunk; default: as `series_piece` says.
    """
    n_times, n_nodes = piece or series_piece(shape[1], shape[2], np.dtype(dtype).itemsize)
    chunks = (block_size, -(-shape[1] // n_times) * n_times, -(-shape[2] // n_nodes) * n_nodes)
    dimensions = ("point", "time", "node")
    inner = (1, n_times, n_nodes)
    return ArrayPlan("u", dimensions, shape, chunks, dtype, fill_of(dtype), {}, inner)


def fill_of(dtype: str) -> float:
    """Return what stands for a missing sample in a series of this type."""
    return MISSING if dtype == "int16" else math.nan


def series_piece(n_times: int, n_nodes: int, itemsize: int) -> tuple[int, int]:
    """Return times and nodes of an inner chunk of `u`.

    A large series is cut about as often along time as along the nodes, so that one node and a
    stretch of time are both read with a small part of the rest.
    """
    size = n_times * n_nodes * itemsize
    if size <= WHOLE_SERIES:
        return n_times, n_nodes
    nodes = _even(n_nodes, n_nodes // math.ceil(math.sqrt(size / SERIES_PIECE)))
    times = _even(n_times, SERIES_PIECE // (nodes * itemsize))
    return times, _even(n_nodes, SERIES_PIECE // (times * itemsize))


def _even(n: int, most: int) -> int:
    """Return the length of as few equal parts of `n` as are no longer than `most`."""
    parts = -(-n // max(1, most))
    return -(-n // parts)


def array_plans(
    sweep: Sweep, columns: Mapping[str, NDArray[Any]], block_size: int
) -> tuple[ArrayPlan, ...]:
    """Return all arrays of a store for the points with these columns, coordinates first."""
    n_points = len(next(iter(columns.values())))
    others = [_coordinate(sweep, name, column) for name, column in columns.items()]
    names = " ".join(columns)
    return (*others, *block_plans(sweep, n_points, block_size, names, largest_state(sweep)))


def room(sweep: Sweep, columns: Mapping[str, NDArray[Any]], block_size: int) -> Room:
    """Return how many blocks, files and bytes a finished sweep has."""
    plans = array_plans(sweep, columns, block_size)
    blocks = next(plan.n_chunks for plan in plans if plan.name == "ledger")
    files = sum(plan.n_chunks + 1 for plan in plans) + _OTHER_FILES
    kept = int(series_mask(sweep, columns["seed"]).sum())
    size = sum((kept if plan.name == "u" else plan.shape[0]) * plan.row_bytes for plan in plans)
    return Room(blocks, files, size + SMALL_FILE * (len(plans) + _OTHER_FILES))


def block_plans(
    sweep: Sweep,
    n_points: int,
    block_size: int,
    coordinates: str = "",
    n_state: int = 0,
    undivided: bool = False,
) -> list[ArrayPlan]:
    """Return the arrays with one chunk per block, and `time` before them where series are kept.

    n_state: width of the array `state`, which sweeps with [continue] have.
    undivided: each series is one inner chunk, however large, as in stores of earlier versions.
    """

    def plan(
        name: str, others: tuple[tuple[str, int], ...], dtype: str, fill: float, **attributes: Any
    ) -> ArrayPlan:
        dimensions = ("point", *(dimension for dimension, _ in others))
        sizes = tuple(size for _, size in others)
        attributes = {"units": "1", **attributes, "coordinates": coordinates}
        shape, chunks = (n_points, *sizes), (block_size, *sizes)
        return ArrayPlan(name, dimensions, shape, chunks, dtype, fill, attributes)

    scalars = scalar_labels(sweep)
    node = (sweep.signals.removesuffix("s"), sweep.n_observed)
    tables = [
        plan(
            "features",
            (("feature", len(FEATURES)), node),
            "float64",
            math.nan,
            long_name="Fourier features of each node",
            labels=list(FEATURES),
            label_units=list(_FEATURE_UNITS),
        ),
        plan(
            "scalars",
            (("quantity", len(scalars)),),
            "float64",
            math.nan,
            long_name="one number per run: total variations, measures of incoherence",
            labels=list(scalars),
            label_units=["1"] * len(scalars),
        ),
        plan(
            "quality",
            (("mark", len(QUALITY)),),
            "float64",
            math.nan,
            long_name="samples per period of the fastest node, median R^2 of the fits of a run",
            labels=list(QUALITY),
            label_units=["1"] * len(QUALITY),
        ),
        plan(
            "ledger",
            (("field", len(FIELDS)),),
            "int64",
            Status.NEVER,
            long_name="what became of each point",
            labels=list(FIELDS),
            label_units=list(_FIELD_UNITS),
            status_values=[int(code) for code in Status],
            status_meanings=[code.sentence for code in Status],
        ),
    ]
    if sweep.continue_ is not None:
        text = "state (u, v) from which the next point of the chain starts"
        tables.append(plan("state", (("variable", n_state),), "float64", math.nan, long_name=text))
    if sweep.keep.series == "none":
        return tables
    times = sample_times(sweep)
    shape = (n_points, len(times), sweep.n_observed)
    attributes = {"units": "1", "long_name": "node variable u over the analysis interval"}
    attributes |= _series_attributes(sweep) | {"coordinates": coordinates}
    piece = shape[1:] if undivided else None
    series = replace(
        series_plan(shape, block_size, sweep.keep.dtype, piece),
        dimensions=("point", "time", node[0]),
        attributes=attributes,
    )
    return [_time(times), series, *tables]


def state_width(nodes: Mapping[str, Any]) -> int:
    """Return the width of the array `state` by the metadata of a store; 0 if there is none."""
    try:
        return int(nodes["state"]["shape"][1])
    except (KeyError, TypeError, ValueError, IndexError):
        return 0


def inner_chunk(node: Mapping[str, Any]) -> tuple[int, ...] | None:
    """Return the shape of an inner chunk by the metadata of an array; None if it has no shards."""
    try:
        return tuple(node["codecs"][0]["configuration"]["chunk_shape"])
    except (KeyError, TypeError, IndexError):
        return None


def is_undivided(nodes: Mapping[str, Any]) -> bool:
    """Whether each series is one inner chunk, by the metadata of a store."""
    try:
        return inner_chunk(nodes["u"]) == (1, *nodes["u"]["shape"][1:])
    except (KeyError, TypeError):
        return False


def _series_attributes(sweep: Sweep) -> dict[str, Any]:
    kept = {
        "all": "every point",
        "first-seed": "the first seed of each cell; the other points are missing throughout",
    }[sweep.keep.series]
    comment = f"kept for {kept}"
    if sweep.keep.dtype != "int16":
        return {"comment": comment}
    limit = -(MISSING + 1) * SCALE
    comment += f"; samples beyond +-{limit:.4f} do not fit and are stored as missing"
    return {"comment": comment, "scale_factor": SCALE, "add_offset": 0.0, "_FillValue": MISSING}


def _time(times: NDArray[np.float64]) -> ArrayPlan:
    attributes = {"units": "1", "long_name": "time of the samples of u"}
    return ArrayPlan("time", ("time",), times.shape, times.shape, "float64", math.nan, attributes)


def _coordinate(sweep: Sweep, name: str, column: NDArray[Any]) -> ArrayPlan:
    known = {"seed": SEED, "delta": DELTA, "direction": DIRECTION}.get(
        name
    ) or sweep.parameters.find(name)
    attributes = {"units": "1", "long_name": known.text.rstrip(".") if known else name}
    integer = column.dtype.kind == "i"
    kind, fill = ("int64", 0) if integer else ("float64", math.nan)
    chunks = (min(len(column), COORDINATE_CHUNK),)
    return ArrayPlan(name, ("point",), column.shape, chunks, kind, fill, attributes)
