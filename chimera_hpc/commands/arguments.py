"""Arguments that several commands share, and what they mean."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path

from chimera_hpc.commands.driving import CLUSTERS, Place
from chimera_hpc.errors import BadInput
from chimera_hpc.grid import Sweep

STORE = "store.zarr"


def add_job(parser: ArgumentParser) -> None:
    """Add the job file and what overrides it."""
    parser.add_argument("job", type=Path, metavar="JOB.toml", help="the job file")
    add_overrides(parser)


def add_overrides(parser: ArgumentParser) -> None:
    """Add what overrides keys of a job."""
    parser.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="override a key of the job, e.g. P=3:8, seeds=4, features.start=900; may be repeated",
    )


def add_block(parser: ArgumentParser) -> None:
    """Add the size of a block."""
    parser.add_argument(
        "--block", type=int, metavar="N", help="points a block (default: chosen from the cost)"
    )


def add_out(parser: ArgumentParser) -> None:
    """Add the folder of a sweep that may not exist yet."""
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help="the sweep's folder (default: results/NAME)"
    )


def add_yes(parser: ArgumentParser) -> None:
    """Add the consent to an absurd plan."""
    parser.add_argument("--yes", action="store_true", help="accept a plan of absurd size")


def add_folder(parser: ArgumentParser) -> None:
    """Add the folder of a sweep that exists."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="the sweep's folder")


def add_place(parser: ArgumentParser) -> None:
    """Add where the work is done."""
    parser.add_argument(
        "--cluster",
        default="local",
        choices=CLUSTERS,
        help="serial: this process; local: worker processes here (default); "
        "scheduler-file: a Dask cluster that is running already",
    )
    parser.add_argument(
        "--scheduler-file", type=Path, metavar="FILE", help="file that its scheduler wrote"
    )
    parser.add_argument(
        "--workers", type=int, metavar="N", help="worker processes (default: one a core)"
    )


def place_of(args: Namespace, sweep: Sweep) -> Place:
    """Return what the arguments say of where the work is done."""
    if args.workers is not None and args.workers < 1:
        raise BadInput(f"--workers {args.workers}: allowed is 1 or more")
    if (args.cluster == "scheduler-file") != (args.scheduler_file is not None):
        raise BadInput("--cluster scheduler-file and --scheduler-file FILE go together")
    return Place(args.cluster, args.workers or sweep.run.workers, args.scheduler_file)


def load_job(job: Path, overrides: Sequence[str], block: int | None = None) -> Sweep:
    """Read a job file with its overrides."""
    if block is not None:
        overrides = [*overrides, f"run.block={block}"]
    sweep = Sweep.load(job, overrides=overrides)
    if ":" in sweep.model:
        from chimera_hpc.models import check_user_model

        check_user_model(sweep, sweep.points().row(0))
    return sweep


def sweep_folder(out: Path | None, sweep: Sweep) -> Path:
    """Return the folder of a sweep that may not exist yet, absolute."""
    return (out or Path("results") / sweep.name).absolute()


def store_path(folder: Path) -> Path:
    """Return the store in a sweep's folder.

    Raises
    ------
    BadInput
        When there is none.
    """
    store = folder if (folder / "zarr.json").is_file() else folder / STORE
    if not store.is_dir():
        raise BadInput(f"{folder}: not a sweep's folder: it holds no {STORE}")
    return store
