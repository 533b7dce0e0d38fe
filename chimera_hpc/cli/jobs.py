"""What several commands take from their arguments: the job, its points, where the work is done."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.renaming import warn
from chimera_hpc.base.wording import short
from chimera_hpc.cli.arguments import store_path
from chimera_hpc.job import Points, Sweep
from chimera_hpc.job.models import try_networks
from chimera_hpc.job.parameters import DELTA, SEED
from chimera_hpc.job.reading import apply_overrides
from chimera_hpc.job.selection import parse_selection
from chimera_hpc.job.states import check_states
from chimera_hpc.job.tables import Slurm
from chimera_hpc.run.choice import ExecutorChoice
from chimera_hpc.run.fork_server import start_fork_server

if TYPE_CHECKING:
    from chimera_hpc.store.store import Store


def find_points(store: Store, words: Sequence[str]) -> list[int]:
    """Return the points of a store that words such as ``P=3 seed=7`` select.

    Raises BadInput for an unknown name, a value that is none, or when there is no such point.
    """
    text = " ".join(words)
    table = store.sweep.parameters
    values = parse_selection(text, "point", {p.name: p for p in (*table.parameters, DELTA, SEED)})
    found = store.points.find(**values).tolist()
    if not found:
        hint = _nearest_values(store.points, values)
        raise BadInput(f"point: {short(text)}: there is no such point in {store.path}; {hint}")
    return [int(i) for i in found]


def _nearest_values(points: Points, values: Mapping[str, int | float]) -> str:
    """Say which of these values does not occur, and the nearest that does."""
    for name, value in values.items():
        if not len(points.find(**{name: value})):
            # As Python's numbers: integers of 64 bits are subtracted exactly.
            near = min(points.columns[name].tolist(), key=lambda other: abs(other - value))
            return f"the nearest {name} is {near}"
    return "these values do not occur together"


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
    if args.memory is not None:
        warn("--memory", "--mem")
        args.mem = args.mem or args.memory
    workers = args.workers or sweep.run.workers
    slurm_options = (
        slurm_options_of(args, sweep) if args.cluster in ("slurm", "allocation") else None
    )
    if args.cluster == "slurm" and slurm_options is not None:
        from chimera_hpc.run.slurm.workers import check_options

        check_options(slurm_options, store)
    return ExecutorChoice(args.cluster, workers, args.scheduler_file, args.mem, slurm_options)


def start_early(args: Namespace) -> None:
    """Start what local workers are forked from: it imports while this process plans."""
    if args.cluster == "local":
        start_fork_server()


def slurm_options_of(args: Namespace, sweep: Sweep) -> Slurm:
    """Return what the user's file, the job and the arguments ask of SLURM."""
    from chimera_hpc.run.slurm.options import slurm_options

    return slurm_options(sweep.slurm, vars(args))


def load_job(job: Path, overrides: Sequence[str], block: int | None = None) -> Sweep:
    """Read a job file, or what the store in a sweep's folder says, with its overrides."""
    if block is not None:
        overrides = [*overrides, f"run.block={block}"]
    sweep = _of_store(job, overrides) if job.is_dir() else Sweep.load(job, overrides=overrides)
    if sweep.reduction.names != "triplet":
        from chimera_hpc.classify.naming import base_size

        base_size(sweep.reduction.names)
    if ":" in sweep.model:
        from chimera_hpc.run.check_model import check_user_model

        points = sweep.points()
        for i in {0, len(points) - 1}:
            check_user_model(sweep, points.row(i))
    elif sweep.network is not None and not job.is_dir():
        try_networks(sweep)
    check_states(sweep)
    if sweep.reduction.show or sweep.reduction.replay:
        from chimera_hpc.reduction.selection import check_selections

        check_selections(sweep, sweep.points())
    return sweep


def _of_store(folder: Path, overrides: Sequence[str]) -> Sweep:
    from chimera_hpc.store.store import Store

    data = Store.open(store_path(folder)).sweep.to_dict()
    return Sweep.from_dict(apply_overrides(data, overrides), where=str(folder))


def sweep_folder(out: Path | None, sweep: Sweep, job: Path) -> Path:
    """Return the folder of a sweep that may not exist yet, absolute; `job` may be that folder."""
    if out is None and job.is_dir():
        return store_path(job).parent.absolute()
    return (out or Path("results") / sweep.name).absolute()
