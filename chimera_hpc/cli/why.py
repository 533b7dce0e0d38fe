"""``why``: the outcome of one point, and which run, code and machine computed it."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.exits import Exit
from chimera_hpc.base.status import Status
from chimera_hpc.cli.arguments import add, store_path
from chimera_hpc.cli.ending import name_of
from chimera_hpc.cli.jobs import find_points
from chimera_hpc.store.claims import live_claims

if TYPE_CHECKING:
    from chimera_hpc.store.store import Store

EPILOG = """examples:
  python -m chimera_hpc.sweep why results/quickstart P=3 Q=3 seed=7
"""
_MOST = 10


def add_arguments(parser: ArgumentParser) -> None:
    add(parser, "folder", "point")


def execute(args: Namespace) -> int:
    path = store_path(args.folder)
    from chimera_hpc.store.store import Store

    store = Store.open(path)
    found = find_points(store, args.point)
    for i in found[:_MOST]:
        _explain(store, i)
    if len(found) > _MOST:
        print(f"and {len(found) - _MOST} more points with these values")
    return Exit.COMPLETE


def _explain(store: Store, i: int) -> None:
    ledger = {name: int(column[i]) for name, column in store.ledger().items()}
    status, block = Status(ledger["status"]), i // store.block_size
    print(f"{name_of(store, i)}  (point {i}, block {block})")
    print(f"  {status.reason(ledger['steps'])}")
    owner = live_claims(store.path).get(block)
    if owner is not None:
        print(f"  in work now: run {owner.get('run')}, {owner.get('host')}, {owner.get('pid')}")
    for damage in store.find_damaged():
        if damage.block == block:
            print(f"  damaged: {damage}")
    if status == Status.NEVER:
        return
    seconds = ledger["elapsed_us"] / 1e6
    tries = f"{ledger['attempts']} tries" if ledger["attempts"] > 1 else "1 try"
    print(f"  {tries}, {ledger['steps']} steps, {seconds:.3g} s, {ledger['n_windows']} windows")
    print(f"  digest {ledger['digest'] & (2**64 - 1):016x}")
    for line in _provenance(store, ledger["run"]):
        print(f"  {line}")
    hint = _HINTS.get(status)
    if hint:
        print(f"  {hint}")


def _provenance(store: Store, run: int) -> list[str]:
    from chimera_hpc.store.provenance import differences, gather
    from chimera_hpc.store.runs import read_run, read_work

    try:
        info = read_run(store.path, run)
    except BadInput as error:
        return [str(error)]
    git = _table(info, "git")
    package = _table(info, "package")
    code = f"{package.get('name')} {package.get('version')}, source {info.get('source')}"
    if git:
        code += f", commit {git.get('commit')}" + (" with changes" if git.get("dirty") else "")
    lines = [f"run {run}, started {info.get('started')}, {code}"]
    machine = _table(info, "machine")
    names = read_work(store.path, run).get("machines")
    names = names if isinstance(names, list) else [f"{machine.get('host')}: {machine.get('cpu')}"]
    lines += [f"on {name}" for name in names]
    return lines + [f"since then: {line}" for line in differences(info, gather(store.sweep))]


def _table(info: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = info.get(key)
    return value if isinstance(value, dict) else {}


_HINTS = {
    Status.TIME_OUT: "`retry --status time_out --time-out SECONDS` gives it more time",
    Status.STEP_BUDGET: "`retry --status step_budget --max-steps N` gives it more steps",
    Status.OUT_OF_MEMORY: "`retry --status out_of_memory --mem SIZE` gives it more memory",
    Status.WORKER_LOST: "`retry --status worker_lost` tries it again; look into the system's log",
    Status.NON_FINITE: "`retry --status non_finite --set run.tighten=0.01` asks for more accuracy",
    Status.NOT_STARTED: "`retry` does it together with the point of its chain that failed",
    Status.STEP_TOO_SMALL: "integrator.atol may be too small for this point",
}
