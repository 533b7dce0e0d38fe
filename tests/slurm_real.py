"""A real, throw-away SLURM on loopback: its own daemons, ports, key and folder."""

from __future__ import annotations

import getpass
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

CONF = """\
ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={ports[0]}
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
AuthType=auth/munge
CredType=cred/munge
AuthInfo=socket={d}/munge.sock,cred_expire=5
SlurmUser={user}
SlurmdUser={user}
SlurmctldPidFile={d}/slurmctld.pid
SlurmdPidFile={d}/slurmd-%n.pid
StateSaveLocation={d}/state
SlurmdSpoolDir={d}/spool-%n
SlurmctldLogFile={d}/slurmctld.log
SlurmdLogFile={d}/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
MailProg=/bin/true
SchedulerType=sched/backfill
SchedulerParameters=batch_sched_delay=0,sched_interval=1,bf_interval=1
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SlurmdParameters=config_overrides
EnforcePartLimits=ALL
DefMemPerCPU=500
ReturnToService=2
KillWait=4
MinJobAge=300
SlurmdTimeout=30
MaxArraySize=9
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
{nodes}
PartitionName=debug Nodes=ALL Default=YES MaxTime=60 State=UP
PartitionName=urgent Nodes=ALL PriorityTier=9 MaxTime=60 State=UP
PartitionName=closed Nodes=ALL MaxTime=60 State=DOWN
"""


class Slurm:
    """Two nodes of two processors and 8 GB each, all of them this machine."""

    def __init__(self, nodes: int = 2) -> None:
        # Sockets need short paths, and every folder above them open to all.
        self.dir = Path(tempfile.mkdtemp(prefix="slurm-", dir="/tmp"))
        self.dir.chmod(0o755)
        self.daemons: list[subprocess.Popen[bytes]] = []
        self.nodes = nodes
        self.conf = self.dir / "slurm.conf"
        dropped = ("SLURM_", "SBATCH_", "SRUN_", "SQUEUE_", "SINFO_")
        clean = {k: v for k, v in os.environ.items() if not k.startswith(dropped)}
        self.environment = {**clean, "SLURM_CONF": str(self.conf)}
        try:
            self._start(_free_ports(1 + nodes))
        except BaseException:
            self.stop()
            raise

    def _start(self, ports: list[int]) -> None:
        host = socket.gethostname().split(".")[0]
        lines = [
            f"NodeName=n{i} NodeHostname={host} NodeAddr=127.0.0.1 Port={ports[i]} CPUs=2 Boards=1 "
            "SocketsPerBoard=1 CoresPerSocket=2 ThreadsPerCore=1 RealMemory=8000 State=UNKNOWN"
            for i in range(1, self.nodes + 1)
        ]
        values = {"host": host, "ports": ports, "d": self.dir, "user": getpass.getuser()}
        self.conf.write_text(CONF.format(**values, nodes="\n".join(lines)))
        (self.dir / "state").mkdir(mode=0o700)
        private = self.dir / "munge"
        private.mkdir(mode=0o700)
        key = private / "key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        self._daemon(
            *("munged", "-F", f"--key-file={key}", f"--socket={self.dir}/munge.sock"),
            *(f"--pid-file={private}/pid", f"--log-file={private}/log"),
            f"--seed-file={private}/seed",
        )
        self.until((self.dir / "munge.sock").exists, 10, "munged made no socket")
        self._daemon("slurmctld", "-D", "-c", "-f", str(self.conf))
        self.until(lambda: _accepts(ports[0]), 20, "slurmctld does not listen")
        for i in range(1, self.nodes + 1):
            (self.dir / f"spool-n{i}").mkdir()
            self._daemon("slurmd", "-D", "-N", f"n{i}", "-f", str(self.conf))
        self.until(lambda: self.idle_nodes() == self.nodes, 30, "nodes do not become idle")

    def _daemon(self, name: str, *arguments: str) -> None:
        path = shutil.which(name, path=os.environ.get("PATH", "") + ":/usr/sbin:/usr/local/sbin")
        with (self.dir / f"{name}.out").open("ab") as out:
            self.daemons.append(
                subprocess.Popen(
                    [path or name, *arguments],
                    stdin=subprocess.DEVNULL,
                    stdout=out,
                    stderr=out,
                    env=self.environment,
                    cwd=self.dir,
                    start_new_session=True,
                )
            )

    def until(self, true: Callable[[], object], seconds: float, what: str) -> None:
        """Wait for something; RuntimeError says what did not happen."""
        end = time.monotonic() + seconds
        while not true():
            if time.monotonic() > end:
                raise RuntimeError(f"{what} within {seconds} s; logs in {self.dir}")
            for daemon in self.daemons:
                if daemon.poll() is not None:
                    raise RuntimeError(f"{daemon.args!r} ended; logs in {self.dir}")
            time.sleep(0.05)

    def idle_nodes(self) -> int:
        """Return how many nodes wait for work."""
        out = self.sh("sinfo", "-h", "-N", "-p", "debug", "-t", "idle", "-o", "%N", check=False)
        return len(out.split())

    def sh(self, *command: str, check: bool = True, cwd: Path | None = None) -> str:
        """Run a command with this SLURM's configuration and return what it printed."""
        done = subprocess.run(
            command,
            env=self.environment | {k: os.environ[k] for k in _PASSED if k in os.environ},
            capture_output=True,
            text=True,
            timeout=60,
            cwd=cwd,
            check=False,
        )
        if check and done.returncode:
            raise RuntimeError(f"{command}: {done.returncode}: {done.stderr}")
        return done.stdout.strip()

    def queue(self) -> list[list[str]]:
        """Return number, state, name of everything in the queue."""
        lines = self.sh("squeue", "-h", "-r", "-o", "%i %T %j").splitlines()
        return [line.split() for line in lines]

    def exit_code(self, job: str) -> int:
        """Return the exit code of a job that has ended."""
        return int(self.told(job, "ExitCode").split(":")[0])

    def told(self, job: str, key: str) -> str:
        """Return what SLURM says of a job under a key such as ``RunTime``."""
        text = self.sh("scontrol", "show", "job", job)
        return text.split(f" {key}=")[1].split()[0]

    def wait(self, seconds: float = 240) -> None:
        """Wait until the queue is empty."""
        self.until(lambda: not self.queue(), seconds, "the queue did not become empty")

    def drain(self) -> None:
        """Cancel everything and put the nodes back in order."""
        ids = [line[0] for line in self.queue()]
        if ids:
            self.sh("scancel", *ids, check=False)
        for i in range(1, self.nodes + 1):
            self.sh("scontrol", "update", f"nodename=n{i}", "state=resume", check=False)
        self.wait(30)

    def stop(self) -> None:
        """End the daemons and remove their folder."""
        with suppress(RuntimeError, subprocess.SubprocessError, IndexError):
            self.drain()
        for daemon in reversed(self.daemons):
            if daemon.poll() is None:
                daemon.send_signal(signal.SIGTERM)
        for daemon in reversed(self.daemons):
            try:
                daemon.wait(10)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()
        shutil.rmtree(self.dir, ignore_errors=True)


_PASSED = ("PATH", "PYTHONPATH", "NUMBA_CACHE_DIR")
"""Variables that a test may change after the start."""


def _free_ports(n: int) -> list[int]:
    sockets = [socket.socket() for _ in range(n)]
    try:
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return [one.getsockname()[1] for one in sockets]
    finally:
        for one in sockets:
            one.close()


def _accepts(port: int) -> bool:
    with socket.socket() as one:
        return one.connect_ex(("127.0.0.1", port)) == 0
