"""A sweep's results for programs that know nothing of its store."""

from __future__ import annotations

import csv
import io
import json
import os
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.errors import BadInput
from chimera_hpc.files import temporary_name, write_atomically
from chimera_hpc.reduce.results import TRIPLET
from chimera_hpc.status import Status
from chimera_hpc.store import Store, open_sweep

_BUNDLED = ("results.json", "report.html", "run.log")


def to_csv(store: Store, target: Path, series: bool = False) -> None:
    """Write a line a point: parameters, status, triplet, class in each cut that was made."""
    write_atomically(target, table(store).encode())


def to_netcdf(store: Store, target: Path, series: bool = False) -> None:
    """Write features, scalars and ledger as NetCDF 4; the series too if `series`.

    Raises
    ------
    BadInput
        When no library for NetCDF 4 is there.
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
    temporary = temporary_name(target)
    try:
        dataset.to_netcdf(temporary, format="NETCDF4", engine=_engine())
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


def _engine() -> Any:
    for engine, module in (("netcdf4", "netCDF4"), ("h5netcdf", "h5netcdf")):
        try:
            __import__(module)
        except ImportError:
            continue
        return engine
    raise BadInput("NetCDF needs the package netCDF4 or h5netcdf: pip install netCDF4")


_PACKING = ("scale_factor", "add_offset", "_FillValue", "dtype")
