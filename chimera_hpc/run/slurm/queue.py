"""SLURM's own commands, repeated if the controller is busy: submit, query, cancel.

A controller that is busy or restarting refuses connections for a while; such answers are tried
again with growing pauses. All other errors give one line. Nothing here needs `sacct`, which many
sites do not run.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from chimera_hpc.base.errors import BadInput

TRIES = 5
KERNELS = "NUMBA_CACHE_DIR"
"""Environment variable: the folder of compiled kernels."""
_FIRST_PAUSE = 0.5
_LONGEST_PAUSE = 30.0
_COMMAND_SECONDS = 60.0
_TRANSIENT = re.compile(
    "unable to contact|socket timed out|connection (refused|timed out|reset)|zero bytes|"
    "temporarily un|resource temporarily|transport endpoint|try again|i/o error|send timeout",
    re.IGNORECASE,
)
_MAX_ARRAY = re.compile(r"^MaxArraySize\s*=\s*(\d+)", re.MULTILINE)
_ENDING = ("COMPLETING", "CANCELLED", "COMPLETED", "FAILED", "TIMEOUT", "NODE_FAIL", "PREEMPTED")


@dataclass(frozen=True)
class Job:
    """A job, or one element of an array, that is in the queue."""

    id: str
    state: str
    reason: str
    """Why it waits, in SLURM's words."""
    name: str


class SlurmFailed(RuntimeError):
    """A command of SLURM failed, and trying again did not help."""


def ask(*command: str, text: str | None = None, tries: int = TRIES) -> str:
    """Run a command of SLURM and return what it printed.

    Raises BadInput when the command is not there.
    Raises SlurmFailed when it refused, or the controller did not answer `tries` times.
    """
    return _ask(command, text, tries, lambda: None)


def _ask(
    command: Sequence[str], text: str | None, tries: int, settled: Callable[[], str | None]
) -> str:
    """Run a command; before each further try `settled` may tell that the last one had worked."""
    if shutil.which(command[0]) is None:
        raise BadInput(f"{command[0]}: not found: this is no machine of a SLURM cluster")
    pause = _FIRST_PAUSE
    for left in reversed(range(tries)):
        code, out, why = _run(command, text)
        if code == 0:
            return out
        if not left or not _TRANSIENT.search(why):
            break
        time.sleep(pause)
        pause = min(2 * pause, _LONGEST_PAUSE)
        answer = settled()
        if answer is not None:
            return answer
    raise SlurmFailed(f"{command[0]}: {one_line(why)}")


def _run(command: Sequence[str], text: str | None) -> tuple[int, str, str]:
    try:
        done = subprocess.run(
            command,
            input=text,
            stdin=subprocess.DEVNULL if text is None else None,
            capture_output=True,
            text=True,
            timeout=_COMMAND_SECONDS,
            env=environment(),
            check=False,
        )
    except subprocess.TimeoutExpired:
        return 1, "", f"socket timed out: no answer within {_COMMAND_SECONDS:.0f} s"
    return done.returncode, done.stdout.strip(), done.stderr.strip() or done.stdout.strip()


def environment() -> dict[str, str]:
    """Return the environment for SLURM's commands: a job that submits others hands on no limits."""
    kept = ("SLURM_CONF", "SLURM_CLUSTERS")
    chosen = {k: v for k, v in os.environ.items() if not k.startswith("SLURM_") or k in kept}
    if is_of_this_node(chosen.get(KERNELS, "")):
        del chosen[KERNELS]
    return chosen


def is_of_this_node(folder: str) -> bool:
    """Return whether a job's script chose this folder of kernels, for the node that it ran on."""
    node = os.environ.get("SLURMD_NODENAME")
    return node is not None and Path(folder).name == f"numba-{node}"


def one_line(text: str) -> str:
    """Return SLURM's complaint on one line, without its prefixes and without repetition."""
    lines = [re.sub(r"^\w+: (error: )?", "", line).strip() for line in text.splitlines()]
    return "; ".join(dict.fromkeys(line for line in lines if line)) or "no reason given"


def check(script: str, *options: str) -> None:
    """Ask SLURM whether it would take a batch script.

    Raises BadInput with SLURM's reason, when it refuses or does not answer.
    """
    try:
        ask("sbatch", "--test-only", *options, text=script)
    except SlurmFailed as error:
        raise _refusal(error) from None


def _refusal(error: SlurmFailed) -> BadInput:
    what = "does not answer" if _TRANSIENT.search(str(error)) else "refuses the job"
    return BadInput(f"SLURM {what}: {error}")


def submit(script: Path, *options: str, name: str | None = None) -> str:
    """Submit a batch script and return the job's number.

    When the controller fails in the middle, a job of this name that is in the queue is taken for
    the one that was being submitted.
    """

    def settled() -> str | None:
        found = jobs(name) if name else []
        return found[-1].id.partition("_")[0] if found else None

    named = () if name is None else (f"--job-name={name}",)
    try:
        answer = _ask(("sbatch", "--parsable", *named, *options, str(script)), None, TRIES, settled)
    except SlurmFailed as error:
        raise _refusal(error) from None
    return answer.partition(";")[0].strip()


def jobs(prefix: str = "") -> list[Job]:
    """Return this user's jobs in the queue whose names begin so; one each array element."""
    out = ask("squeue", "-h", "-r", "-u", str(os.getuid()), "-o", "%i|%T|%r|%j")
    found = [Job(*line.split("|", 3)) for line in out.splitlines() if line.count("|") >= 3]
    return [job for job in found if job.name.startswith(prefix) and job.state not in _ENDING]


def waits_for(job: str, name: str, seconds: float = 5.0) -> str | None:
    """Return why a job that was just submitted under a name waits; None when it has begun.

    SLURM needs a moment to look at it, which is waited for.
    """
    until = time.monotonic() + seconds
    while True:
        mine = [one for one in jobs(name) if one.id.partition("_")[0] == job]
        waiting = [one.reason for one in mine if one.state == "PENDING"]
        if len(waiting) < len(mine) or not mine:
            return None
        if waiting[0] != "None" or time.monotonic() > until:
            return waiting[0] if waiting[0] != "None" else "SLURM gives no reason yet"
        time.sleep(0.3)


def cancel(ids: Sequence[str]) -> None:
    """Cancel jobs; those that are gone already are no error."""
    for start in range(0, len(ids), 500):
        ask("scancel", "--quiet", *ids[start : start + 500])


def requeue(job: str) -> None:
    """Put a job back into the queue under its own number, so that what depends on it waits."""
    ask("scontrol", "requeue", job)


def most_array_elements() -> int | None:
    """Return how many elements a job array may have here; None when SLURM does not tell."""
    try:
        found = _MAX_ARRAY.search(ask("scontrol", "show", "config"))
    except (SlurmFailed, BadInput):
        return None
    # MaxArraySize is one more than the largest index.
    return int(found[1]) if found else None


def time_left(job: str) -> float | None:
    """Return the seconds until a job's time limit; None when it has none, or it is unknown."""
    try:
        out = ask("squeue", "-h", "-j", job, "-o", "%L", tries=3)
    except (SlurmFailed, BadInput):
        return None
    return seconds_of(out.splitlines()[0]) if out else None


def limit_seconds(text: str) -> float:
    """Return the seconds of a time limit as `sbatch --time` takes it.

    >>> limit_seconds("30"), limit_seconds("1:30"), limit_seconds("1-12"), limit_seconds("2:00:00")
    (1800.0, 90.0, 129600.0, 7200.0)
    """
    days, dash, rest = text.rpartition("-")
    parts = [float(part) for part in rest.split(":")]
    if dash or len(parts) == 3:
        hours, minutes, seconds = (*parts, 0.0, 0.0)[:3]
    else:
        hours, minutes, seconds = 0.0, *(*parts, 0.0)[:2]
    return ((float(days or 0) * 24 + hours) * 60 + minutes) * 60 + seconds


def seconds_of(text: str) -> float | None:
    """Return the seconds of ``days-hours:minutes:seconds``, SLURM's way to print a time.

    >>> seconds_of("1-02:03:04"), seconds_of("9:59"), seconds_of("UNLIMITED")
    (93784.0, 599.0, None)
    """
    found = re.fullmatch(r"(?:(\d+)-)?(?:(\d+):)?(\d+):(\d+)", text.strip())
    if not found:
        return None
    days, hours, minutes, seconds = (int(part or 0) for part in found.groups())
    return float(((days * 24 + hours) * 60 + minutes) * 60 + seconds)
