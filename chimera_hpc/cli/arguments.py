"""Arguments that several commands share.

Light on purpose: neither jobs nor stores are loaded, so that `status` answers at once.
"""

from __future__ import annotations

import re
from argparse import SUPPRESS, ArgumentParser, ArgumentTypeError
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import short
from chimera_hpc.run.choice import CLUSTERS

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
    from chimera_hpc.job.shipped import job_file

    return job_file(str(path_name(text)))


def memory_size(text: str) -> str:
    """Return a size as SLURM writes it: 2G for 2G, 2GB and 2GiB."""
    found = _SIZE.fullmatch(text)
    if found is None or (found[2] and found[1].isdigit()):
        raise ArgumentTypeError(f"{short(text)}: a size such as 800M or 2G is needed")
    return found[1].upper()


def bytes_of(size: str) -> int:
    """Return the bytes of a size as SLURM writes it, where 800 means 800M."""
    unit = size[-1] if size[-1] in "KMGT" else "M"
    return int(size.rstrip("KMGT")) << 10 * ("KMGT".index(unit) + 1)


def flag(text: str) -> dict[str, Any]:
    """Return an option without a value, as `ArgumentParser.add_argument` takes it."""
    return {"action": "store_true", "help": text}


def value(metavar: str, kind: Callable[[str], Any], text: str, **more: Any) -> dict[str, Any]:
    """Return an argument with a value, as `ArgumentParser.add_argument` takes it."""
    return {"metavar": metavar, "type": kind, "help": text, **more}


_SET = "override a key of the job, e.g. P=3:8, seeds=4, features.start=900; may be repeated"
_CLUSTER = (
    "serial: this process; local: worker processes here (default); scheduler-file: a Dask cluster "
    "that already runs; slurm: worker jobs that this process submits; allocation: the tasks "
    "of the SLURM job that this process is in"
)
_RESUBMIT = "requeue the SLURM job up to N times when its time limit stops it"
_STRICT = "refuse to continue with other code, libraries or processors than the stored results have"
_JOB = "the job file; quickstart, paper/plane and others come with the package"
_MEMORY = (
    "memory of a worker, e.g. 800M or 2G; a local worker that exceeds it is ended (default: the "
    "machine's memory divided by the workers), a SLURM job requests it (default: 1G)"
)
_SHARED = {
    "job": value("JOB.toml", job_name, _JOB),
    "folder": value("DIR", path_name, "the sweep's folder"),
    "point": value("NAME=VALUE", str, "such as P=3 Q=5 seed=7", nargs="+"),
    "--set": value("KEY=VALUE", str, _SET, dest="overrides", action="append", default=[]),
    "--out": value("DIR", path_name, "the sweep's folder (default: results/NAME)"),
    "--block": value("N", int, "points per block (default: chosen from the cost)"),
    "--yes": flag("accept a very large plan"),
    "--json": flag("print one JSON object"),
    "--cluster": {"default": "local", "choices": CLUSTERS, "help": _CLUSTER},
    "--scheduler-file": value("FILE", path_name, "file that the running scheduler wrote"),
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
    "--interface": value("NAME", str, "network interface of scheduler and workers"),
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


def store_path(folder: Path) -> Path:
    """Return the store in a sweep's folder. Raises BadInput when there is none."""
    store = folder if (folder / "zarr.json").is_file() else folder / STORE
    if not store.is_dir():
        raise BadInput(f"{folder}: not a sweep's folder: it holds no {STORE}")
    return store
