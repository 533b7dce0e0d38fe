"""Arguments that several commands share, and what they mean."""

from __future__ import annotations

import re
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import short
from chimera_hpc.job import Sweep
from chimera_hpc.job.models import parameters_of
from chimera_hpc.job.parameters import DELTA, SEED
from chimera_hpc.job.selection import parse_selection
from chimera_hpc.job.shipped import job_file
from chimera_hpc.job.tables import Slurm
from chimera_hpc.run.choice import CLUSTERS, ExecutorChoice
from chimera_hpc.run.fork_server import start_fork_server

if TYPE_CHECKING:
    from chimera_hpc.store.store import Store

STORE = "store.zarr"
_SIZE = re.compile(r"[1-9][0-9]{0,9}([kMGT]i?)?B", re.ASCII)


def add_job(parser: ArgumentParser) -> None:
    """Add the job file and what overrides it."""
    parser.add_argument(
        "job",
        type=job_file,
        metavar="JOB.toml",
        help="the job file; quickstart, paper/plane and others come with the package",
    )
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
        "--out", type=folder_name, metavar="DIR", help="the sweep's folder (default: results/NAME)"
    )


def add_yes(parser: ArgumentParser) -> None:
    """Add the consent to an absurd plan."""
    parser.add_argument("--yes", action="store_true", help="accept a plan of absurd size")


def add_folder(parser: ArgumentParser) -> None:
    """Add the folder of a sweep that exists."""
    parser.add_argument("folder", type=Path, metavar="DIR", help="the sweep's folder")


def add_point(parser: ArgumentParser) -> None:
    """Add the selection of points by their values."""
    parser.add_argument("point", nargs="+", metavar="NAME=VALUE", help="such as P=3 Q=5 seed=7")


def find_points(store: Store, words: Sequence[str]) -> list[int]:
    """Return the points of a store that words such as ``P=3 seed=7`` select.

    Raises BadInput for an unknown name, a value that is none, or when there is no such point.
    """
    from chimera_hpc.reduction.selection import find_points as find

    text = " ".join(words)
    table = parameters_of(store.sweep.model)
    values = parse_selection(text, "point", {p.name: p for p in (*table.parameters, DELTA, SEED)})
    found = find(store.points, values)
    if not len(found):
        raise BadInput(f"point: {short(text)}: there is no such point in {store.path}")
    return [int(i) for i in found]


def add_executor(parser: ArgumentParser) -> None:
    """Add where the work is done."""
    parser.add_argument(
        "--cluster",
        default="local",
        choices=CLUSTERS,
        help="serial: this process; local: worker processes here (default); "
        "scheduler-file: a Dask cluster that is running already; slurm: worker jobs that this "
        "process submits; allocation: the tasks of the SLURM job that this process is in",
    )
    parser.add_argument(
        "--scheduler-file", type=Path, metavar="FILE", help="file that its scheduler wrote"
    )
    parser.add_argument(
        "--workers", type=int, metavar="N", help="worker processes (default: one a core)"
    )
    parser.add_argument(
        "--memory",
        metavar="SIZE",
        help="memory at which a local worker is ended, e.g. 2GB (default: a fair share)",
    )


def add_slurm(parser: ArgumentParser) -> None:
    """Add what is asked of SLURM; each overrides the job's table [slurm]."""
    group = parser.add_argument_group("SLURM", "override the table [slurm] of the job")
    group.add_argument("--partition", metavar="NAME", help="partition of the jobs")
    group.add_argument("--account", metavar="NAME", help="account that they are charged to")
    group.add_argument("--time", metavar="LIMIT", help="time limit of a job, e.g. 30 or 1-12:00:00")
    group.add_argument("--mem", metavar="SIZE", help="memory of a worker, e.g. 800M or 2G")
    group.add_argument("--interface", metavar="NAME", help="network of scheduler and workers")


def add_resubmit(parser: ArgumentParser) -> None:
    """Add going on after the time limit."""
    parser.add_argument(
        "--resubmit",
        type=int,
        default=0,
        metavar="N",
        help="go on up to N times, as the same SLURM job, when its time limit stopped it",
    )


def add_reduction(parser: ArgumentParser) -> None:
    """Add how a run ends, and whether it may begin."""
    parser.add_argument(
        "--no-figures", action="store_true", help="results.json, but no figures and no report"
    )
    parser.add_argument(
        "--strict",
        action="store_true",
        help="refuse to go on with other code, libraries or processors than the results there have",
    )


def executor_of(args: Namespace, sweep: Sweep, store: Path) -> ExecutorChoice:
    """Return what the arguments say of where the work is done.

    SLURM is asked at once whether it would take the jobs of workers on this store.
    """
    if args.workers is not None and args.workers < 1:
        raise BadInput(f"--workers {args.workers}: allowed is 1 or more")
    if (args.cluster == "scheduler-file") != (args.scheduler_file is not None):
        raise BadInput("--cluster scheduler-file and --scheduler-file FILE go together")
    if args.scheduler_file is not None and not args.scheduler_file.is_file():
        raise BadInput(
            f"{args.scheduler_file}: no such file; dask scheduler --scheduler-file makes it"
        )
    if args.memory is not None and not _SIZE.fullmatch(args.memory):
        raise BadInput(f"--memory {args.memory}: a size such as 800MB or 2GB is needed")
    workers = args.workers or sweep.run.workers
    slurm_options = (
        slurm_options_of(args, sweep) if args.cluster in ("slurm", "allocation") else None
    )
    if args.cluster == "slurm" and slurm_options is not None:
        from chimera_hpc.run.slurm.workers import check_options

        check_options(slurm_options, store)
    return ExecutorChoice(args.cluster, workers, args.scheduler_file, args.memory, slurm_options)


def start_early(args: Namespace) -> None:
    """Start what local workers are forked from: it imports while this process plans."""
    if args.cluster == "local":
        start_fork_server()


def slurm_options_of(args: Namespace, sweep: Sweep) -> Slurm:
    """Return what the user's file, the job and the arguments ask of SLURM."""
    from chimera_hpc.run.slurm.options import slurm_options

    return slurm_options(sweep.slurm, vars(args))


def load_job(job: Path, overrides: Sequence[str], block: int | None = None) -> Sweep:
    """Read a job file with its overrides."""
    if block is not None:
        overrides = [*overrides, f"run.block={block}"]
    sweep = Sweep.load(job, overrides=overrides)
    if ":" in sweep.model:
        from chimera_hpc.run.check_model import check_user_model

        points = sweep.points()
        for i in {0, len(points) - 1}:
            check_user_model(sweep, points.row(i))
    if sweep.reduction.show or sweep.reduction.replay:
        from chimera_hpc.reduction.selection import check_selections

        check_selections(sweep, sweep.points())
    return sweep


def folder_name(text: str) -> Path:
    """Return the folder that an option names."""
    if not text.strip():
        raise ArgumentTypeError("empty; the name of a folder is needed")
    return Path(text)


def sweep_folder(out: Path | None, sweep: Sweep) -> Path:
    """Return the folder of a sweep that may not exist yet, absolute."""
    return (out or Path("results") / sweep.name).absolute()


def store_path(folder: Path) -> Path:
    """Return the store in a sweep's folder.

    Raises BadInput when there is none.
    """
    store = folder if (folder / "zarr.json").is_file() else folder / STORE
    if not store.is_dir():
        raise BadInput(f"{folder}: not a sweep's folder: it holds no {STORE}")
    return store
