"""Reads, prepares, measures and classifies time series of other models or experiments."""

from chimera_hpc.base.public import load_on_use

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

__getattr__, __dir__ = load_on_use(
    __name__, {name: (f"{__name__}.{home}", name) for name, home in _HOMES.items()}
)
