"""A sweep's results for programs that know nothing of its store."""

from __future__ import annotations

import csv
import io
import json
import os
import zipfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.files import temporary_name, write_atomically
from chimera_hpc.base.status import Status
from chimera_hpc.reduction.results import TRIPLET
from chimera_hpc.store.labelled import open_sweep
from chimera_hpc.store.store import Store

if TYPE_CHECKING:
    import xarray as xr

_BUNDLED = ("results.json", "report.html", "run.log")


def to_csv(store: Store, target: Path, series: bool = False) -> None:
    """Write one line per point: parameters, status, triplet, class in each cut that was made."""
    write_atomically(target, table(store).encode())


def to_netcdf(store: Store, target: Path, series: bool = False) -> None:
    """Write features, scalars and ledger as NetCDF; the series too if `series`.

    NetCDF 4 where a library for it is there. NetCDF 3, which SciPy writes, has no 64-bit integers.
    Integers that need more than 32 bits are floats there, which hold 53 bits exactly; those that
    need still more are texts of decimal digits, and digests are texts of 16 hexadecimal digits.
    """
    dataset = open_sweep(store.path)
    if not series:
        dataset = dataset.drop_vars(["u", "time"], errors="ignore")
    for variable in dataset.variables.values():
        # Chunks and codecs of the store mean nothing here.
        variable.encoding = {k: v for k, v in variable.encoding.items() if k in _PACKING}
    dataset.attrs = {
        "title": store.sweep.title or store.sweep.name,
        "spec": json.dumps(store.sweep.to_dict()),
        "digest": store.sweep.digest,
    }
    engine: Any = next((name for name, module in _NETCDF_4 if find_spec(module)), "scipy")
    if engine == "scipy":
        _without_large_integers(dataset)
    kind: Any = "NETCDF3_64BIT" if engine == "scipy" else "NETCDF4"
    temporary = temporary_name(target)
    try:
        dataset.to_netcdf(temporary, format=kind, engine=engine)
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def to_bundle(store: Store, target: Path, series: bool = False) -> None:
    """Write a zip of the job, the provenance of every run, results, table, figures and report."""
    folder = store.path.parent
    temporary = temporary_name(target)
    try:
        with zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as bundle:
            bundle.writestr("job.json", json.dumps(store.sweep.to_dict(), indent=1))
            bundle.writestr("table.csv", table(store))
            for path in _files(store, folder):
                bundle.write(path, path.relative_to(folder).as_posix().replace("store.zarr/", ""))
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def table(store: Store) -> str:
    """Return the table of `to_csv` as text."""
    columns: dict[str, Any] = dict(store.points.columns)
    ledger, scalars = store.ledger(), store.scalars()
    columns["status"] = [Status(code).name.lower() for code in ledger["status"].tolist()]
    columns |= {name: scalars[name] for name in TRIPLET}
    columns |= _classes(store)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(_plain(column) for column in columns.values()), strict=True))
    return text.getvalue()


def _classes(store: Store) -> dict[str, list[str]]:
    """Return each point's class in each cut of the last reduction, if that covers all points."""
    try:
        reduction = store.reduction()
    except BadInput:
        return {}
    classes = {}
    for cut in reduction.attributes.get("cuts", []):
        labels, names = reduction.arrays[f"labels_{cut}"], reduction.attributes[f"names_{cut}"]
        if len(labels) == store.n_points:
            classes[f"class_{cut}"] = [names[k] if k >= 0 else "" for k in labels.tolist()]
    return classes


def _plain(column: NDArray[Any] | list[str]) -> list[Any]:
    """Return values as they stand in a CSV file: floats with all their digits, NaN as nothing."""
    if isinstance(column, np.ndarray):
        return ["" if value != value else value for value in column.tolist()]
    return column


def _files(store: Store, folder: Path) -> Iterator[Path]:
    yield from (folder / name for name in _BUNDLED if (folder / name).is_file())
    yield from sorted((folder / "figures").glob("*.p[nd][gf]"))
    yield from sorted((store.path / "runs").glob("*.json"))


def _without_large_integers(dataset: xr.Dataset) -> None:
    for name, variable in dataset.variables.items():
        values = variable.values if variable.dtype == np.int64 else np.zeros(0, np.int64)
        largest = max(abs(int(values.max(initial=0))), abs(int(values.min(initial=0))))
        if largest < 2**31:
            continue
        new: NDArray[Any] = values.astype(np.float64)
        if name == "digest":
            new = np.array([f"{value & (2**64 - 1):016x}" for value in values.tolist()])
        elif largest > 2**53:
            new = values.astype(np.str_)
        dataset[name] = (variable.dims, new, variable.attrs)


_PACKING = ("scale_factor", "add_offset", "_FillValue", "dtype")
_NETCDF_4: tuple[tuple[str, str], ...] = (("netcdf4", "netCDF4"), ("h5netcdf", "h5netcdf"))
