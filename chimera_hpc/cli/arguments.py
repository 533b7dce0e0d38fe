"""Arguments that several commands share, and what they mean."""

from __future__ import annotations

import re
from argparse import SUPPRESS, ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.renaming import warn
from chimera_hpc.base.wording import short
from chimera_hpc.job import Points, Sweep
from chimera_hpc.job.models import try_networks
from chimera_hpc.job.parameters import DELTA, SEED
from chimera_hpc.job.reading import apply_overrides
from chimera_hpc.job.selection import parse_selection
from chimera_hpc.job.shipped import job_file
from chimera_hpc.job.states import check_states
from chimera_hpc.job.tables import Slurm
from chimera_hpc.run.choice import CLUSTERS, ExecutorChoice
from chimera_hpc.run.fork_server import start_fork_server

if TYPE_CHECKING:
    from chimera_hpc.store.store import Store

STORE = "store.zarr"
_SIZE = re.compile(r"([1-9][0-9]{0,9}[KMGT]?)(i?B)?", re.ASCII | re.IGNORECASE)


@contextmanager
def errors_in_one_line(place: Path) -> Iterator[None]:
    """Raise BadInput for a damaged store, and for a file that cannot be written, at `place`."""
    try:
        yield
    except OSError as error:
        where = error.filename or place
        raise BadInput(f"{where}: can't be written: {error.strerror or error}") from None
    except RuntimeError as error:
        from chimera_hpc.store.blocks import DamagedChunk

        if isinstance(error, DamagedChunk):
            raise BadInput(f"{place}: {error}") from None
        raise


def path_name(text: str) -> Path:
    """Return the file or folder that an argument names."""
    if not text.strip():
        raise ArgumentTypeError("empty; the name of a file or folder is needed")
    return Path(text)


def job_name(text: str) -> Path:
    """Return the job file that an argument names."""
    return job_file(str(path_name(text)))


def memory_size(text: str) -> str:
    """Return a size as SLURM writes it: 2G for 2G, 2GB and 2GiB."""
    found = _SIZE.fullmatch(text)
    if found is None or (found[2] and found[1].isdigit()):
        raise ArgumentTypeError(f"{short(text)}: a size such as 800M or 2G is needed")
    return found[1].upper()


def flag(text: str) -> dict[str, Any]:
    """Return an option without a value, as `ArgumentParser.add_argument` takes it."""
    return {"action": "store_true", "help": text}


def value(metavar: str, kind: Callable[[str], Any], text: str, **more: Any) -> dict[str, Any]:
    """Return an argument with a value, as `ArgumentParser.add_argument` takes it."""
    return {"metavar": metavar, "type": kind, "help": text, **more}


_SET = "override a key of the job, e.g. P=3:8, seeds=4, features.start=900; may be repeated"
_CLUSTER = (
    "serial: this process; local: worker processes here (default); scheduler-file: a Dask cluster "
    "that is running already; slurm: worker jobs that this process submits; allocation: the tasks "
    "of the SLURM job that this process is in"
)
_RESUBMIT = "go on up to N times, as the same SLURM job, when its time limit stopped it"
_STRICT = "refuse to go on with other code, libraries or processors than the results there have"
_JOB = "the job file; quickstart, paper/plane and others come with the package"
_MEMORY = (
    "memory of a worker, e.g. 800M or 2G: a local one is ended beyond it (default: the machine's "
    "memory divided by the workers), SLURM is asked for it (default: 1G)"
)
_SHARED = {
    "job": value("JOB.toml", job_name, _JOB),
    "folder": value("DIR", path_name, "the sweep's folder"),
    "point": value("NAME=VALUE", str, "such as P=3 Q=5 seed=7", nargs="+"),
    "--set": value("KEY=VALUE", str, _SET, dest="overrides", action="append", default=[]),
    "--out": value("DIR", path_name, "the sweep's folder (default: results/NAME)"),
    "--block": value("N", int, "points per block (default: chosen from the cost)"),
    "--yes": flag("accept a plan of absurd size"),
    "--json": flag("print one JSON object"),
    "--cluster": {"default": "local", "choices": CLUSTERS, "help": _CLUSTER},
    "--scheduler-file": value("FILE", path_name, "file that its scheduler wrote"),
    "--workers": value("N", int, "worker processes (default: one per core)"),
    "--mem": value("SIZE", memory_size, _MEMORY),
    "--memory": value("SIZE", memory_size, SUPPRESS),
    "--resubmit": value("N", int, _RESUBMIT, default=0),
    "--no-figures": flag("results.json, but no figures and no report"),
    "--strict": flag(_STRICT),
}
_SLURM = {
    "--partition": value("NAME", str, "partition of the jobs"),
    "--account": value("NAME", str, "account that they are charged to"),
    "--time": value("LIMIT", str, "time limit of a job, e.g. 30 or 1-12:00:00"),
    "--interface": value("NAME", str, "network of scheduler and workers"),
}
EXECUTOR = ("--cluster", "--scheduler-file", "--workers", "--mem", "--memory")
"""Arguments for where the work is done."""


def add(parser: ArgumentParser, *shared: str, **own: dict[str, Any]) -> None:
    """Add arguments that several commands share, by name, then options of the command's own.

    ``no_map=flag(...)`` declares ``--no-map``.
    """
    arguments = {name: _SHARED[name] for name in shared}
    for name, options in (arguments | _options(own)).items():
        parser.add_argument(name, **options)


def add_group(parser: ArgumentParser, title: str, **own: dict[str, Any]) -> None:
    """Add a group of options, as `add` does."""
    group = parser.add_argument_group(title)
    for name, options in _options(own).items():
        group.add_argument(name, **options)


def _options(own: Mapping[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    return {f"--{name.replace('_', '-')}": options for name, options in own.items()}


def add_slurm(parser: ArgumentParser) -> None:
    """Add the options for SLURM."""
    group = parser.add_argument_group("SLURM", "override the table [slurm] of the job")
    for name, options in _SLURM.items():
        group.add_argument(name, **options)


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


def store_path(folder: Path) -> Path:
    """Return the store in a sweep's folder. Raises BadInput when there is none."""
    store = folder if (folder / "zarr.json").is_file() else folder / STORE
    if not store.is_dir():
        raise BadInput(f"{folder}: not a sweep's folder: it holds no {STORE}")
    return store
