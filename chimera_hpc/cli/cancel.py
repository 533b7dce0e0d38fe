"""``cancel``: end the SLURM jobs of a sweep and clear up after a driver that was killed."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.exits import Exit
from chimera_hpc.cli.arguments import add, store_path
from chimera_hpc.run.slurm import queue, tls
from chimera_hpc.run.slurm.queue import SlurmFailed
from chimera_hpc.run.slurm.script import job_name

EPILOG = """examples:
  python -m chimera_hpc.sweep cancel results/quickstart

Your jobs are found by their name, which depends on the path of the store. Finished points stay, and
`run` or another job continues from there.
"""


def add_arguments(parser: ArgumentParser) -> None:
    add(parser, "folder")


def execute(args: Namespace) -> int:
    store = store_path(args.folder.absolute())
    try:
        jobs = queue.jobs(job_name(store))
        queue.cancel([job.id for job in jobs])
    except SlurmFailed as error:
        raise BadInput(str(error)) from None
    for job in jobs:
        print(f"cancelled job {job.id} ({job.name}, {job.state})")
    for folder in tls.remove_left_over(store, [job.id for job in jobs]):
        print(f"removed the certificate {folder}")
    if not jobs:
        print(f"no SLURM job works on {store}")
    return Exit.COMPLETE
