"""The job files that come with the package: in a source tree beside it, in a wheel inside of it."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def jobs_folder() -> Path:
    """Return the folder that holds quickstart.toml, paper/ and job.schema.json."""
    inside = _PACKAGE / "jobs"
    return inside if inside.is_dir() else _PACKAGE.parent / "jobs"


def job_file(name: str) -> Path:
    """Return the job file that a user means by `name`.

    That is the file of this path if there is one, else one that comes with the package:
    ``quickstart``, ``jobs/quickstart.toml`` and ``paper/plane`` name those from any folder. Where
    there is neither, the path as it stands, for the message about it.
    """
    path = Path(name)
    if path.is_file() or path.is_absolute() or ".." in path.parts:
        return path
    inner = path.relative_to("jobs") if path.parts[:1] == ("jobs",) else path
    shipped = jobs_folder() / inner.with_suffix(".toml")
    return shipped if inner.suffix in ("", ".toml") and shipped.is_file() else path
