"""A certificate for each run: any process that reaches a Dask scheduler can run code as its user.

Scheduler, workers and client of a run hold the same certificate, signed by itself, and each asks
the others for it. It is in a folder that only the user can read, on the file system that all nodes
share (``~/.chimera_hpc`` or ``$CHIMERA_HPC_PRIVATE``), and is deleted at the end of the run.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.files import create_exclusively
from chimera_hpc.base.places import home_folder
from chimera_hpc.base.processes import is_gone, process_identity

if TYPE_CHECKING:
    from distributed.security import Security

PRIVATE = "CHIMERA_HPC_PRIVATE"
"""Environment variable: where the folders with the certificates lie."""
_VALID = timedelta(days=60)
_NOTE = "run.json"


@dataclass(frozen=True)
class Certificate:
    """The files of one run's certificate."""

    folder: Path

    @property
    def cert(self) -> Path:
        """The certificate, which is its own authority."""
        return self.folder / "cert.pem"

    @property
    def key(self) -> Path:
        return self.folder / "key.pem"

    def worker_arguments(self) -> list[str]:
        cert, key = str(self.cert), str(self.key)
        return ["--tls-ca-file", cert, "--tls-cert", cert, "--tls-key", key]

    def security(self) -> Security:
        from distributed.security import Security

        cert, key = str(self.cert), str(self.key)
        roles = {f"tls_{r}_{w}": p for r in _ROLES for w, p in (("cert", cert), ("key", key))}
        return Security(tls_ca_file=cert, require_encryption=True, **roles)


_ROLES = ("client", "scheduler", "worker")


@contextmanager
def fresh_certificate(name: str, store: Path) -> Iterator[Certificate]:
    """Make a certificate for one run on a store; it is deleted at the end."""
    folder = home() / name
    try:
        home().mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.mkdir(mode=0o700)
    except OSError as error:
        text = f"no place for the run's certificate: {error.strerror}; {PRIVATE} names another"
        raise BadInput(f"{folder}: {text}") from None
    try:
        certificate = Certificate(folder)
        _write(certificate)
        job = os.environ.get("SLURM_JOB_ID")
        note = {"store": str(store), "process": process_identity(), "job": job}
        create_exclusively(folder / _NOTE, json.dumps(note).encode())
        yield certificate
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def remove_left_over(store: Path, cancelled: Collection[str] = ()) -> list[Path]:
    """Delete the certificates of runs on a store whose driver is gone; return their folders.

    A driver in a cancelled job may still run, but has no time to clean up. A driver on another
    machine cannot be checked; its certificate is deleted too, which ends its run.
    """
    found = []
    for note in sorted(home().glob(f"*/{_NOTE}")):
        try:
            info = json.loads(note.read_bytes())
        except (OSError, ValueError):
            continue
        doomed = info.get("job") in cancelled or not _is_alive_here(str(info.get("process")))
        if info.get("store") == str(store) and doomed:
            shutil.rmtree(note.parent, ignore_errors=True)
            found.append(note.parent)
    return found


def home() -> Path:
    """Return the folder of the certificates' folders."""
    return Path(os.environ.get(PRIVATE) or home_folder() / ".chimera_hpc")


def _is_alive_here(mark: str) -> bool:
    here = process_identity().partition("-")[0]
    return mark.partition("-")[0] == here and not is_gone(mark)


def _write(certificate: Certificate) -> None:
    """Make a key and a certificate signed by itself, readable by the user only."""
    try:
        from cryptography import x509
        from cryptography.hazmat.primitives import hashes, serialization
        from cryptography.hazmat.primitives.asymmetric import ec
    except ImportError:
        raise BadInput("--cluster slurm needs the extra: pip install chimera_hpc[slurm]") from None
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "chimera_hpc")])
    # The machines' clocks may differ a little.
    begin = datetime.now(UTC) - timedelta(hours=1)
    signed = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(begin)
        .not_valid_after(begin + _VALID)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .sign(key, hashes.SHA256())
    )
    secret = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    for path, data in (
        (certificate.key, secret),
        (certificate.cert, signed.public_bytes(serialization.Encoding.PEM)),
    ):
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(data)
