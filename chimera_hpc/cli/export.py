"""``export``: results for programs that know nothing of the store."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.exits import Exit
from chimera_hpc.cli.arguments import add, flag, path_name, store_path, value

if TYPE_CHECKING:
    from collections.abc import Callable

    from chimera_hpc.store.store import Store

EPILOG = """examples:
  python -m chimera_hpc.sweep export results/quickstart --to quickstart.csv
  python -m chimera_hpc.sweep export results/quickstart --to quickstart.nc
  python -m chimera_hpc.sweep export results/quickstart --to quickstart.zip

.csv: one line per point: parameters, status, V_theta, V_a, V_Omega, class in each cut.
.nc: NetCDF of all features, scalars and the ledger, and of the series with --series.
.zip: job file, provenance of every run, results.json, table, figures and report.
"""


def add_arguments(parser: ArgumentParser) -> None:
    add(
        parser,
        "folder",
        to=value("FILE", path_name, ".csv, .nc or .zip", required=True),
        series=flag("also the series of u (.nc)"),
    )


def execute(args: Namespace) -> int:
    if args.series and args.to.suffix != ".nc":
        raise BadInput(f"--series: only for .nc, not for {args.to.name}")
    writer = _writer(args.to)
    path = store_path(args.folder)
    if args.to.is_dir():
        raise BadInput(f"{args.to}: a folder; the name of a file is needed")
    from chimera_hpc.store.blocks import DamagedChunk
    from chimera_hpc.store.store import Store

    try:
        writer(Store.open(path), args.to, args.series)
    except DamagedChunk as error:
        raise BadInput(f"{path}: {error}") from None
    except OSError as error:
        raise BadInput(f"{args.to}: can't be written: {error.strerror or error}") from None
    print(f"written: {args.to}")
    return Exit.COMPLETE


def _writer(target: Path) -> Callable[[Store, Path, bool], None]:
    if target.suffix not in (".csv", ".nc", ".zip"):
        raise BadInput(f"--to {target.name}: allowed endings are .csv, .nc and .zip")
    from chimera_hpc.reduction import export

    return {".csv": export.to_csv, ".nc": export.to_netcdf, ".zip": export.to_bundle}[target.suffix]
