"""Arguments that several commands share."""

from __future__ import annotations

from argparse import ArgumentParser
from pathlib import Path

from chimera_hpc.errors import BadInput
from chimera_hpc.grid import Sweep

STORE = "store.zarr"


def add_job(parser: ArgumentParser) -> None:
    """Add the job file and what overrides it."""
    parser.add_argument("job", type=Path, metavar="JOB.toml", help="the job file")
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


def add_folder(parser: ArgumentParser) -> None:
    """Add the folder of a sweep that exists."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="the sweep's folder")


def load_job(job: Path, overrides: list[str], block: int | None = None) -> Sweep:
    """Read a job file with its overrides."""
    if block is not None:
        overrides = [*overrides, f"run.block={block}"]
    return Sweep.load(job, overrides=overrides)


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
