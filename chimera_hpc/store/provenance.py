"""Where results come from: code, versions, machine, user, job; gathered once per run."""

from __future__ import annotations

import contextlib
import os
import platform
import re
import socket
import subprocess
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import cache
from hashlib import blake2b
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from chimera_hpc import __version__
from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.places import user_name
from chimera_hpc.job import Sweep
from chimera_hpc.job.user_models import user_model, user_source
from chimera_hpc.models.source import PACKAGE, SourceFiles

_LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "zarr", "dask", "distributed", "scikit-learn")
_SLURM = (
    "SLURM_JOB_ID",
    "SLURM_ARRAY_JOB_ID",
    "SLURM_ARRAY_TASK_ID",
    "SLURM_JOB_NAME",
    "SLURM_JOB_PARTITION",
    "SLURM_CLUSTER_NAME",
    "SLURM_NODELIST",
    "SLURM_PROCID",
)
_GIT_SECONDS = 5.0


def gather(sweep: Sweep | None = None) -> dict[str, Any]:
    """Return what `runs/<number>.json` records of a run of this sweep: plain values for JSON.

    Keys: package (name, version), source (digest of the package's own code), git (commit, dirty;
    None outside a checkout), python, libraries, machine (host, CPU, cores, system), user, process,
    command, folder, started (UTC), slurm (those of its variables that are set), and what
    `model_source` tells.
    """
    return {
        "package": {"name": PACKAGE.name, "version": __version__},
        "source": package_digest(),
        "git": git_state(PACKAGE.parent),
        "python": platform.python_version(),
        "libraries": {name: _version_of(name) for name in _LIBRARIES},
        "machine": {
            "host": socket.gethostname(),
            "cpu": cpu_model(),
            "cores": os.cpu_count(),
            "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        },
        "user": user_name(),
        "process": os.getpid(),
        "command": list(sys.argv),
        "folder": os.getcwd(),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "slurm": {name: os.environ[name] for name in _SLURM if name in os.environ},
        **model_source(sweep),
    }


def differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Return a line for each thing that may change numbers and differs between two runs."""
    lines = []
    for key in ("package", "source", "model", "network", "python", "libraries"):
        lines += _lines(key, before.get(key), now.get(key))
    for key in ("model_holds", "model_packages", "network_holds", "network_packages"):
        # Version 0.1 recorded neither.
        if key in before and key in now:
            lines += _lines(key, before[key], now[key])
    machines = [run.get("machine") for run in (before, now)]
    cpus = [machine.get("cpu") if isinstance(machine, dict) else None for machine in machines]
    return lines + _lines("cpu", *cpus)


@cache
def package_digest() -> str:
    """Return 16 hexadecimal digits over the names and contents of all modules of the package."""
    total = blake2b(digest_size=8)
    for path in sorted(PACKAGE.rglob("*.py")):
        contents = path.read_bytes()
        total.update(f"{path.relative_to(PACKAGE).as_posix()}\0{len(contents)}\0".encode())
        total.update(contents)
    return total.hexdigest()


def git_state(folder: Path) -> dict[str, Any] | None:
    """Return commit and dirty flag of a checkout whose root is `folder`; None when it is not one.

    Dirty means that tracked files differ from the commit, or that the package holds untracked ones.
    """
    if not (folder / ".git").exists():
        return None
    command = ["git", "-C", str(folder), "status", "--porcelain=v2", "--branch", "--", PACKAGE.name]
    try:
        answer = subprocess.run(
            command, capture_output=True, text=True, timeout=_GIT_SECONDS, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    lines = answer.stdout.splitlines()
    oids = re.findall(r"^# branch\.oid ([0-9a-f]+)$", answer.stdout, re.MULTILINE)
    dirty = any(not line.startswith("#") for line in lines)
    return {"commit": oids[0] if oids else None, "dirty": dirty}


def cpu_model() -> str:
    """Return the processor's name as the system tells it."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def model_source(sweep: Sweep | None) -> dict[str, Any]:
    """Return what to record of a user's model and of a user's network; nothing of others.

    Keys: model (its name, and a digest of the files of its code), model_holds (the files of data
    that the code names, and the values that its functions hold, see `models.held`), model_packages
    (the versions of what it imports). A model that cannot be imported has its name alone. network,
    network_holds and network_packages tell the same of a function that makes networks.
    """
    if sweep is None:
        return {}
    return {**_model_source(sweep), **_network_source(sweep)}


def _model_source(sweep: Sweep) -> dict[str, Any]:
    if ":" not in sweep.model:
        return {}
    try:
        own, source = user_model(sweep.model, sweep.origin), user_source(sweep.model, sweep.origin)
    except BadInput:
        return {"model": f"{sweep.model}, which cannot be imported"}
    return _source("model", sweep.model, source, own.held)


def _network_source(sweep: Sweep) -> dict[str, Any]:
    if sweep.network is None or ":" not in sweep.network.kind:
        return {}
    try:
        own = sweep.own_network
    except BadInput:
        return {"network": f"{sweep.network.kind}, which cannot be imported"}
    assert own is not None
    return _source("network", own.kind, own.source, own.held)


def _source(
    key: str, name: str, source: SourceFiles | None, held: Mapping[str, str]
) -> dict[str, Any]:
    if source is None:
        return {key: name, f"{key}_holds": held}
    return {
        key: f"{name}, source {source.digest}",
        f"{key}_holds": {**source.data_digests(), **held},
        f"{key}_packages": source.versions(),
    }


def _lines(key: str, before: object, now: object) -> list[str]:
    if isinstance(before, dict) and isinstance(now, dict):
        names = [*before, *(name for name in now if name not in before)]
        return [line for n in names for line in _lines(n, before.get(n), now.get(n))]
    return [] if before == now else [f"{key}: {before} before, {now} now"]


def _version_of(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
