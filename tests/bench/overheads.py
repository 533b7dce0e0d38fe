"""What a block costs beside its points: on the worker, in the scheduler, in the ledger."""

from __future__ import annotations

import time
from pathlib import Path
from types import ModuleType

import psutil
from programs import SCALE, load_program
from projection import Costs

from chimera_hpc.job import Sweep
from chimera_hpc.run.block import run_block, warm_up
from chimera_hpc.run.executors import run_dask
from chimera_hpc.run.messages import RunMessage
from chimera_hpc.store.ledger import read_ledger
from chimera_hpc.store.store import Store

QUICKSTART = Path(__file__).parents[2] / "jobs" / "quickstart.toml"


def measure_costs(folder: Path, n_points: int, tiny: bool) -> Costs:
    """Measure the costs that the projection is fed with."""
    scale = load_program(SCALE, "scale_measurements")
    path: Path = scale.plan(folder, "overheads", n_points).path
    worker, scheduler = _dask_costs(scale, folder, path)
    began = time.perf_counter()
    ledger = read_ledger(path)
    seconds = time.perf_counter() - began
    return Costs(_point(tiny), worker, scheduler, seconds / len(ledger["status"]))


def _point(tiny: bool) -> float:
    settings = ["P=12", "seeds=16"] + (["integrator.t_end=20", "features.start=10"] if tiny else [])
    sweep = Sweep.load(QUICKSTART, settings)
    points = sweep.points()
    warm_up(sweep, points)
    began = time.perf_counter()
    run_block(sweep, points)
    return (time.perf_counter() - began) / len(points)


def _dask_costs(scale: ModuleType, folder: Path, path: Path) -> tuple[float, float]:
    """Return seconds of a block on a worker and of the scheduler's processor time."""
    from distributed import Client

    store = Store.open(path)
    spent: list[float] = []
    with scale._dask(folder) as (scheduler, address), Client(address) as client:
        process = psutil.Process(scheduler.pid)
        before = sum(process.cpu_times()[:2])
        blocks = range(store.n_blocks)
        run_dask(
            client, RunMessage(path, 1), blocks, lambda r: spent.append(r.seconds), lambda: False
        )
        after = sum(process.cpu_times()[:2])
    return sum(spent) / len(spent), (after - before) / len(spent)
