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
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.files import temporary_name
from chimera_hpc.base.status import Status
from chimera_hpc.reduction.results import TRIPLET
from chimera_hpc.store.labelled import open_sweep
from chimera_hpc.store.store import Store

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
    """Write one line per point: parameters, status, triplet, class in each cut that was made."""
    with _replaced(target) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        file.writelines(table(store))


def to_netcdf(store: Store, target: Path, series: bool = False) -> None:
    """Write features, scalars and ledger as NetCDF; the series too if `series`, packed as stored.

    NetCDF 4 where a library for it is there. NetCDF 3, which SciPy writes, has no 64-bit integers.
    Integers that need more than 32 bits are floats there, which hold 53 bits exactly; those that
    need still more are texts of decimal digits, and digests are texts of 16 hexadecimal digits.
    Points are written some at a time. With NetCDF 3, `point` is then the unlimited dimension.
    """
    import dask

    dataset = _dataset(store, series)
    engine: Any = next((name for name, module in _NETCDF_4 if find_spec(module)), "scipy")
    # Threads would each hold a block.
    with _replaced(target) as temporary, dask.config.set(scheduler="synchronous"):
        if engine == "scipy":
            _write_netcdf_3(_of_netcdf_3(dataset), temporary, store.block_size)
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


def _dataset(store: Store, series: bool) -> xr.Dataset:
    import xarray as xr

    dataset = open_sweep(store.path)
    if series:
        packed = xr.open_zarr(store.path, chunks={}, mask_and_scale=False)["u"]
        packed.attrs["_FillValue"] = packed.dtype.type(packed.attrs["_FillValue"])
        dataset["u"] = packed
    else:
        dataset = dataset.drop_vars(["u", "time"], errors="ignore")
    for variable in dataset.variables.values():
        # Chunks and codecs of the store mean nothing here.
        variable.encoding = {}
    dataset.attrs = {
        "title": store.sweep.title or store.sweep.name,
        "spec": json.dumps(store.sweep.to_dict()),
        "digest": store.sweep.digest,
    }
    return dataset


def _write_netcdf_3(dataset: xr.Dataset, path: Path, block_size: int) -> None:
    """Write NetCDF 3; some points at a time if there are many bytes.

    The records of an unlimited dimension are the end of the file. So the records of further files,
    of the same variables, can be put behind those of the first one.
    """
    n_points = dataset.sizes["point"]
    step = max(1, _SLICE_BYTES * n_points // max(1, dataset.nbytes))
    step -= step % block_size if step > block_size else 0
    if step >= n_points:
        dataset.to_netcdf(path, format=_NETCDF_3, engine="scipy")
        return

    def some(first: int, last: int) -> memoryview:
        part = dataset.isel(point=slice(first, last)).load()
        data = part.to_netcdf(format=_NETCDF_3, engine="scipy", unlimited_dims=["point"])
        return memoryview(data)

    one = some(0, 1)
    head = len(one) - _record_bytes(dataset)
    with path.open("wb") as file:
        file.write(bytes(one[:4]) + n_points.to_bytes(4, "big") + bytes(one[8:head]))
        for first in range(0, n_points, step):
            file.write(some(first, first + step)[head:])


def _record_bytes(dataset: xr.Dataset) -> int:
    """Return the bytes of one point; NetCDF 3 pads each variable to a multiple of four."""
    points = [v for v in dataset.variables.values() if "point" in v.dims]
    return sum(-(-v.nbytes // v.sizes["point"] // 4) * 4 for v in points)


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
    ledger, scalars = store.ledger(), store.scalars()
    columns["status"] = _STATUS_NAMES[ledger["status"]]
    columns |= {name: scalars[name] for name in TRIPLET}
    columns |= _classes(store)
    yield _lines([[*columns]])
    for first in range(0, store.n_points, _SLICE_ROWS):
        some = [_plain(column[first : first + _SLICE_ROWS]) for column in columns.values()]
        yield _lines(zip(*some, strict=True))


def _lines(rows: Iterable[Iterable[Any]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def _classes(store: Store) -> dict[str, NDArray[Any]]:
    """Return each point's class in each cut of the last reduction, if that covers all points."""
    try:
        reduction = store.reduction()
    except BadInput:
        return {}
    classes = {}
    for cut in reduction.attributes.get("cuts", []):
        labels = reduction.arrays[f"labels_{cut}"]
        # The label -1 of points without a class takes the last name.
        names = np.array([*reduction.attributes[f"names_{cut}"], ""])
        if len(labels) == store.n_points:
            classes[f"class_{cut}"] = names[np.maximum(labels, -1)]
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
