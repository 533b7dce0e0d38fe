"""A sweep's results for programs that know nothing of its store."""

from __future__ import annotations

import csv
import io
import json
import os
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.files import temporary_name
from chimera_hpc.base.status import Status
from chimera_hpc.reduction.netcdf3 import Layout, resized
from chimera_hpc.store.labelled import cuts_in, open_sweep, reductions
from chimera_hpc.store.store import Store
from chimera_hpc.store.strips import PackedSeries

if TYPE_CHECKING:
    import xarray as xr

_SLICE_BYTES = 32 * 10**6
"""Bytes of points that are written to NetCDF 3 at a time, or one point if it has more."""
_SLICE_ROWS = 10_000
_NETCDF_3: Literal["NETCDF3_64BIT"] = "NETCDF3_64BIT"
_STATUS_NAMES = np.array(
    [Status(code).name.lower() if code in set(Status) else "" for code in range(256)]
)
_BUNDLED = ("results.json", "report.html", "run.log")


def to_csv(store: Store, target: Path, series: bool = False) -> None:
    """Write one line per point: parameters, status, scalars, class in each cut that was made."""
    with _replaced(target) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        file.writelines(table(store))


def to_netcdf(store: Store, target: Path, series: bool = False) -> None:
    """Write features, scalars and ledger as NetCDF; the series too if `series`, packed as stored.

    NetCDF 4 where a library for it is there. NetCDF 3, which SciPy writes, has no 64-bit integers.
    Integers that need more than 32 bits are floats there, which hold 53 bits exactly; those that
    need still more are texts of decimal digits, and digests are texts of 16 hexadecimal digits.
    Points are written some at a time, and large series in pieces. With NetCDF 3, `point` is the
    unlimited dimension.
    """
    import dask

    if series and "u" not in store.files.shapes:
        raise BadInput(f"{store.path}: holds no series (keep.series = 'none')")
    packed = PackedSeries(store) if series else None
    dataset = _dataset(store, packed)
    engine: Any = next((name for name, module in _NETCDF_4 if find_spec(module)), "scipy")
    # Threads would each hold a block.
    with _replaced(target) as temporary, dask.config.set(scheduler="synchronous"):
        if engine == "scipy":
            _write_netcdf_3(_of_netcdf_3(dataset), packed, temporary)
        else:
            dataset.to_netcdf(temporary, format="NETCDF4", engine=engine)


@contextmanager
def _replaced(target: Path) -> Iterator[Path]:
    """Give the name of a file that takes the place of the target once it is whole."""
    temporary = temporary_name(target)
    try:
        yield temporary
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def _dataset(store: Store, series: PackedSeries | None) -> xr.Dataset:
    import xarray as xr

    dataset = open_sweep(store.path)
    dataset = dataset.drop_vars(["u"] if series is not None else ["u", "time"], errors="ignore")
    if series is not None:
        import dask.array as da

        stored = xr.open_zarr(store.path, chunks=None, mask_and_scale=False)["u"]
        attributes = dict(stored.attrs)
        if "_FillValue" in attributes:
            attributes["_FillValue"] = series.dtype.type(attributes["_FillValue"])
        values = da.from_array(series, series.chunks, name=False, meta=np.empty(0, series.dtype))
        dataset["u"] = (stored.dims, values, attributes)
    for variable in dataset.variables.values():
        # Chunks and codecs of the store mean nothing here.
        variable.encoding = {}
    dataset.attrs = {
        "title": store.sweep.title or store.sweep.name,
        "spec": json.dumps(store.sweep.to_dict()),
        "digest": store.sweep.digest,
    }
    return dataset


def _write_netcdf_3(dataset: xr.Dataset, series: PackedSeries | None, path: Path) -> None:
    """Write NetCDF 3, some points at a time; `point` is the unlimited dimension."""
    first = {name: slice(0, 1) for name in dataset.dims}
    tiny = dataset.isel(first).to_netcdf(format=_NETCDF_3, engine="scipy", unlimited_dims=["point"])
    n_points = dataset.sizes["point"]
    layout = resized(bytes(tiny), {str(n): size for n, size in dataset.sizes.items()}, n_points)
    tables = dataset.drop_vars("u", errors="ignore")
    kind = _record_of(layout, tables)
    begin = layout.places[kind.names[0]].begin if kind.names else len(layout.head)
    step = max(1, _SLICE_BYTES // kind.itemsize)
    with path.open("wb") as file:
        file.write(layout.head)
        for name in tables.variables.keys() - set(kind.names or ()):
            file.seek(layout.places[str(name)].begin)
            file.write(_big_endian(tables[name].values).tobytes())
        for start in range(0, n_points, step):
            part = tables.isel(point=slice(start, start + step)).load()
            records = np.zeros(part.sizes["point"], kind)
            for name in kind.names or ():
                records[name] = part[name].values
            file.seek(begin + start * layout.record)
            if series is None:
                file.write(records.tobytes())
                continue
            for row, record in enumerate(records, start):
                file.seek(begin + row * layout.record)
                file.write(record.tobytes())
                _write_series(file, begin + row * layout.record + kind.itemsize, series, row)
        file.truncate(begin + n_points * layout.record)


def _record_of(layout: Layout, tables: xr.Dataset) -> np.dtype[np.void]:
    """Return the type of a record without u, which is its end."""
    names = [str(name) for name, v in tables.variables.items() if "point" in v.dims]
    places = {name: layout.places[name] for name in names}
    first = min(place.begin for place in places.values())
    size = layout.places["u"].begin - first if "u" in layout.places else layout.record
    formats = [
        (tables.variables[name].dtype.newbyteorder(">"), tables.variables[name].shape[1:])
        for name in names
    ]
    offsets = [places[name].begin - first for name in names]
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": size})


def _write_series(file: BinaryIO, begin: int, series: PackedSeries, point: int) -> None:
    """Write u of a point from a place of the file on, a piece at a time."""
    _, n_times, n_nodes = series.shape
    for i, j in product(range(0, n_times, series.chunks[1]), range(0, n_nodes, series.chunks[2])):
        times, nodes = (
            slice(k, k + size) for k, size in zip((i, j), series.chunks[1:], strict=True)
        )
        part = _big_endian(series[point : point + 1, times, nodes][0])
        data, row = memoryview(part.tobytes()), part[0].nbytes
        size = len(data) if part.shape[1] == n_nodes else row
        for start in range(0, len(data), size):
            file.seek(begin + (i + start // row) * n_nodes * part.itemsize + j * part.itemsize)
            file.write(data[start : start + size])


def _big_endian(values: NDArray[Any]) -> NDArray[Any]:
    return np.ascontiguousarray(values, values.dtype.newbyteorder(">"))


def to_bundle(store: Store, target: Path, series: bool = False) -> None:
    """Write a zip of the job, the provenance of every run, results, table, figures and report."""
    folder = store.path.parent
    with (
        _replaced(target) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as bundle,
    ):
        bundle.writestr("job.json", json.dumps(store.sweep.to_dict(), indent=1))
        with bundle.open("table.csv", "w") as file:
            file.writelines(line.encode() for line in table(store))
        for path in _files(store, folder):
            bundle.write(path, path.relative_to(folder).as_posix().replace("store.zarr/", ""))


def table(store: Store) -> Iterator[str]:
    """Yield the table of `to_csv` as text, some lines at a time."""
    columns: dict[str, NDArray[Any]] = dict(store.points.columns)
    columns["status"] = _STATUS_NAMES[store.ledger()["status"]]
    columns |= {name: _spoken(name, values) for name, values in store.scalars().items()}
    columns |= _classes(store)
    yield _lines([[*columns]])
    for first in range(0, store.n_points, _SLICE_ROWS):
        some = [_plain(column[first : first + _SLICE_ROWS]) for column in columns.values()]
        yield _lines(zip(*some, strict=True))


def _lines(rows: Iterable[Iterable[Any]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _spoken(name: str, values: NDArray[np.float64]) -> NDArray[Any]:
    """Return a scalar as it is, the status under another convention in words."""
    return _STATUS_NAMES[np.nan_to_num(values, nan=255).astype(int)] if "status" in name else values


def _classes(store: Store) -> dict[str, NDArray[Any]]:
    """Return each point's class in each cut of the last reductions."""
    classes = {}
    for suffix, reduction in reductions(store):
        for cut in cuts_in(reduction):
            # The label -1 of points without a class takes the last name.
            names = np.array([*reduction.attributes[f"names_{cut}"], ""])
            labels = reduction.arrays[f"labels_{cut}"]
            classes[f"class_{cut}{suffix}"] = names[np.maximum(labels, -1)]
    return classes


def _plain(column: NDArray[Any]) -> list[Any]:
    """Return values as they stand in a CSV file: floats with all their digits, NaN as nothing."""
    return ["" if value != value else value for value in column.tolist()]


def _files(store: Store, folder: Path) -> Iterator[Path]:
    yield from (folder / name for name in _BUNDLED if (folder / name).is_file())
    yield from sorted((folder / "figures").glob("*.p[nd][gf]"))
    yield from sorted((store.path / "runs").glob("*.json"))


def _of_netcdf_3(dataset: xr.Dataset) -> xr.Dataset:
    """Replace types that NetCDF 3 lacks: 64-bit integers, and texts, which get a fixed width."""
    for name, variable in dataset.variables.items():
        # The packed series is narrow, and not to be loaded.
        if variable.dtype != np.int64 and variable.dtype.kind != "U":
            continue
        new, attributes = _narrow(str(name), variable.values), variable.attrs
        if new.dtype.kind == "U":
            new, attributes = np.char.encode(new, "utf-8"), {**attributes, "_Encoding": "utf-8"}
        dataset[name] = (variable.dims, new, attributes)
    return dataset


def _narrow(name: str, values: NDArray[Any]) -> NDArray[Any]:
    """Return integers in a type that holds them all: int32, float64, or text."""
    if values.dtype != np.int64:
        return values
    if name == "digest":
        return np.array([f"{value & (2**64 - 1):016x}" for value in values.tolist()], dtype="U16")
    largest = max(abs(int(values.max(initial=0))), abs(int(values.min(initial=0))))
    if largest < 2**31:
        return values.astype(np.int32)
    return values.astype(np.float64 if largest <= 2**53 else np.str_)


_NETCDF_4: tuple[tuple[str, str], ...] = (("netcdf4", "netCDF4"), ("h5netcdf", "h5netcdf"))
