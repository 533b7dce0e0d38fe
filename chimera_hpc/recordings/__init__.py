"""Other people's time series: read, prepared, measured, judged or clustered."""

from importlib import import_module

TYPE_CHECKING = False

if TYPE_CHECKING:
    from chimera_hpc.recordings.file import Treatment, measure_file
    from chimera_hpc.recordings.judge import Judge, measure
    from chimera_hpc.recordings.many import classify_recordings
    from chimera_hpc.recordings.preparing import prepare, with_times
    from chimera_hpc.recordings.read import read_recording
    from chimera_hpc.recordings.recording import Choice, Recording

_HOMES = {
    "Choice": "recording",
    "Judge": "judge",
    "Recording": "recording",
    "Treatment": "file",
    "classify_recordings": "many",
    "measure": "judge",
    "measure_file": "file",
    "prepare": "preparing",
    "read_recording": "read",
    "with_times": "preparing",
}

__all__ = [
    "Choice",
    "Judge",
    "Recording",
    "Treatment",
    "classify_recordings",
    "measure",
    "measure_file",
    "prepare",
    "read_recording",
    "with_times",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
