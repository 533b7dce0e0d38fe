"""The job files that come with the package: next to it in a source tree, inside it in a wheel."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def jobs_folder() -> Path:
    """Return the folder that holds quickstart.toml, paper/ and job.schema.json."""
    inside = _PACKAGE / "jobs"
    return inside if inside.is_dir() else _PACKAGE.parent / "jobs"


def job_file(name: str) -> Path:
    """Return the job file that a user means by `name`.

    It is the file at this path, if it exists, else one that comes with the package:
    ``quickstart``, ``jobs/quickstart.toml`` and ``paper/plane`` name those from any folder. If
    neither exists, the path is returned unchanged, for the error message.
    """
    path = Path(name)
    if path.is_file() or path.is_absolute() or ".." in path.parts:
        return path
    inner = path.relative_to("jobs") if path.parts[:1] == ("jobs",) else path
    shipped = jobs_folder() / inner.with_suffix(".toml")
    return shipped if inner.suffix in ("", ".toml") and shipped.is_file() else path
