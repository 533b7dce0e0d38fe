"""``retry``: compute failed points once more."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.base.wording import nearest, short
from chimera_hpc.cli.arguments import EXECUTOR, add, store_path, value
from chimera_hpc.cli.ending import end, interrupted
from chimera_hpc.cli.jobs import executor_of, start_early
from chimera_hpc.cli.reporting import load_reduction
from chimera_hpc.job import Sweep
from chimera_hpc.job.reading import apply_overrides
from chimera_hpc.run.driver import Driver
from chimera_hpc.run.signals import stop_request
from chimera_hpc.store.ledger import NO_LIMIT

if TYPE_CHECKING:
    from chimera_hpc.store.store import Store

EPILOG = """examples:
  python -m chimera_hpc.sweep retry results/quickstart
  python -m chimera_hpc.sweep retry results/quickstart --status time_out --time-out 7200
  python -m chimera_hpc.sweep retry results/quickstart --status non_finite,step_too_small \\
      --set run.attempts=5 --set run.tighten=0.01

Statuses: non_finite, step_too_small, step_budget, time_out, worker_lost, out_of_memory, not_started
(after a failed point of a chain; computed together with that point). Each failed point is computed
once. A point that fails again stays failed; results never change. For this run, --time-out and
--max-steps replace the sweep's own limits, which do not change the results of points that finish.
"""
_FAILURES = {code.name.lower(): code for code in Status if code.is_failure}


def add_arguments(parser: ArgumentParser) -> None:
    failures = "only points that failed in these ways (default: all failed points)"
    add(
        parser,
        *("folder", "--set", *EXECUTOR, "--no-figures", "--strict"),
        status=value("NAME[,NAME]", str, failures),
        time_out=value("S", float, "seconds of wall time per point"),
        max_steps=value("N", int, "steps per point"),
    )


def execute(args: Namespace) -> int:
    statuses = statuses_of(args.status)
    for name in ("time_out", "max_steps"):
        value = getattr(args, name)
        if value is not None and not value > 0:
            raise BadInput(f"--{name.replace('_', '-')} {value}: must be above 0")
    with stop_request() as stop:
        try:
            start_early(args)
            path = store_path(args.folder)
            from chimera_hpc.run.messages import RetryPolicy

            store = _store(path, args.overrides)
            retry = RetryPolicy(
                attempts=NO_LIMIT,
                statuses=statuses,
                earlier_only=True,
                time_out=args.time_out,
                max_steps=args.max_steps,
            )
            executor = executor_of(args, store.sweep, path)
            driver = Driver(store, executor, stop, path.parent / "run.log", retry, args.strict)
            driver.program = args.program
            driver.meanwhile = load_reduction
            driver.work()
            return end(driver, path.parent, args)
        except BaseException:
            if not stop.broke_off:
                raise
            return interrupted(stop, args)


def statuses_of(text: str | None) -> tuple[Status, ...]:
    """Return the failures that a list of names means; all of them without a list."""
    if text is None:
        return tuple(_FAILURES.values())
    names = [name.strip().lower() for name in text.split(",")]
    for name in names:
        if name not in _FAILURES:
            raise BadInput(f"--status: {short(name)} is no failure{nearest(name, [*_FAILURES])}")
    return tuple(_FAILURES[name] for name in names)


def _store(path: Path, overrides: list[str]) -> Store:
    from chimera_hpc.store.store import Store

    store = Store.open(path)
    if not overrides:
        return store
    origin = store.sweep.origin
    data = apply_overrides(store.sweep.to_dict(), overrides, origin)
    return store.adopt(Sweep.from_dict(data, str(path), origin))
