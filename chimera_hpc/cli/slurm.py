"""``slurm``: batch scripts for a sweep, printed or submitted."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from dataclasses import replace
from typing import TYPE_CHECKING

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.exits import Exit
from chimera_hpc.base.files import write_atomically
from chimera_hpc.cli.arguments import STORE, add, add_slurm, flag, value
from chimera_hpc.cli.jobs import load_job, slurm_options_of, sweep_folder
from chimera_hpc.cli.run import open_or_plan
from chimera_hpc.job.tables import Slurm
from chimera_hpc.run.slurm import queue
from chimera_hpc.run.slurm.queue import SlurmFailed, limit_seconds
from chimera_hpc.run.slurm.script import ARRAY, LOGS, MODES, SCRIPTS, TIME, Target, job_name

if TYPE_CHECKING:
    from chimera_hpc.job import Sweep

EPILOG = """examples:
  python -m chimera_hpc.sweep slurm jobs/quickstart.toml --mode array
  python -m chimera_hpc.sweep slurm jobs/quickstart.toml --mode array --array 16 --submit
  python -m chimera_hpc.sweep slurm jobs/quickstart.toml --mode allocation --workers 64 --submit

array: each element of a job array computes its share, without a scheduler; allocation: driver,
scheduler and workers in one job; jobqueue: a small job that submits a job for each worker, for
sites without long programs on login nodes (elsewhere: run JOB.toml --cluster slurm). A sweep that
was started in one way can be finished in any other, or with `run` on a laptop. --submit plans the
store, asks SLURM whether it would accept the job (sbatch --test-only), and submits it; after an
array, a second job reduces the sweep.
"""


def add_arguments(parser: ArgumentParser) -> None:
    """Declare the command's arguments."""
    add(parser, "job", "--set", "--out", "--block", "--yes", "--mem", "--resubmit")
    mode = "how the sweep is run (default: array)"
    parser.add_argument("--mode", choices=MODES, default="array", help=mode)
    add_slurm(parser)
    add(
        parser,
        workers=value("N", int, "worker processes in all"),
        array=value("N", int, "elements of the job array"),
        at_once=value("N", int, "most elements that run at a time"),
        drain=value("S", float, "stop S seconds before a job's time limit"),
        submit=flag("submit the script"),
        no_reduce=flag("no second job that reduces the sweep"),
    )


def execute(args: Namespace) -> int:
    sweep = load_job(args.job, args.overrides, args.block)
    slurm_options = slurm_options_of(args, sweep)
    _check_times(args, slurm_options)
    target = _target(args, sweep)
    if not args.submit:
        print(SCRIPTS[args.mode](target, slurm_options), end="")
        return Exit.COMPLETE
    try:
        return _submit_all(args, sweep, target, slurm_options)
    except SlurmFailed as error:
        raise BadInput(str(error)) from None


def _check_times(args: Namespace, slurm_options: Slurm) -> None:
    if args.resubmit < 0:
        raise BadInput(f"--resubmit {args.resubmit}: allowed is 0 or more")
    limit = limit_seconds(slurm_options.time or TIME)
    # A job that is over before it begins would be put back into the queue for nothing.
    if args.drain is not None and not 0 <= args.drain < limit:
        raise BadInput(f"--drain {args.drain:g}: allowed is 0 up to the time limit, {limit:g} s")


def _target(args: Namespace, sweep: Sweep) -> Target:
    folder = sweep_folder(args.out, sweep, args.job)
    overrides = [*args.overrides, *([f"run.block={args.block}"] if args.block else [])]
    planned = args.submit or (folder / LOGS).is_dir()
    return Target(
        job=args.job.absolute(),
        folder=folder,
        name=job_name(folder / STORE, args.mode),
        # SLURM makes no folders: a job whose log has no place fails without a word.
        logs=folder / LOGS if planned else None,
        resubmit=args.resubmit,
        drain=args.drain,
        overrides=tuple(overrides),
        planned=planned,
    )


def _submit_all(args: Namespace, sweep: Sweep, target: Target, slurm_options: Slurm) -> int:
    queue.check(SCRIPTS[args.mode](target, slurm_options.model_copy(update={"array": 1})))
    store = open_or_plan(target.folder, sweep, args.yes)
    if args.mode == "array":
        slurm_options = _fitting(slurm_options, store.n_blocks)
    first = job = _submit(target, args.mode, slurm_options)
    print(f"submitted job {job} ({args.mode}); logs in {target.logs}")
    if args.mode == "array" and not args.no_reduce:
        last = replace(target, name=job_name(store.path, "reduce"))
        job = _submit(last, "reduce", slurm_options, f"--dependency=afterany:{job}")
        print(f"submitted job {job} (reduce)")
    reason = queue.waits_for(first, target.name)
    if reason is not None:
        print(f"job {first} waits: {reason}")
    return Exit.COMPLETE


def _submit(target: Target, mode: str, slurm_options: Slurm, *options: str) -> str:
    # The same job twice would do no harm, and no good either.
    working = queue.jobs(target.name)
    if working:
        raise BadInput(f"job {working[0].id} does this already; the command cancel ends it")
    path = target.folder / LOGS / f"{mode}.sbatch"
    path.parent.mkdir(exist_ok=True)
    write_atomically(path, SCRIPTS[mode](target, slurm_options).encode())
    queue.check(path.read_text(), *options)
    return queue.submit(path, *options, name=target.name)


def _fitting(slurm_options: Slurm, n_blocks: int) -> Slurm:
    """Return the options with no more array elements than there are blocks and SLURM allows."""
    wanted = slurm_options.array or ARRAY
    most = min(n_blocks, queue.most_array_elements() or n_blocks)
    if wanted > most:
        why = f"there are {n_blocks} blocks" if most == n_blocks else "SLURM allows no more"
        print(f"{most} elements in place of {wanted}: {why}")
    return slurm_options.model_copy(update={"array": min(wanted, most)})
