"""Files of recordings, by the ending of their names.

For developers: a format is a function (path, choice) -> Recording and a line in `READERS`. It
loads no pickled object, whoever made the file.
"""

from __future__ import annotations

import struct
import warnings
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.recordings.columns import some_of, without
from chimera_hpc.recordings.dates import DATED, of_numbers
from chimera_hpc.recordings.recording import TIME, Choice, Recording, as_signals, as_times, turned
from chimera_hpc.recordings.tables import read_table

Reader = Callable[[Path, Choice], Recording]

_TIMES = ("t", "time", "times")
_SIGNALS = ("u", "x", "y", "data", "signal", "signals")
_SHEETS = (".xls", ".xlsx", ".xlsm", ".ods", ".numbers")
_BROKEN = (ValueError, TypeError, LookupError, ArithmeticError, AttributeError, AssertionError,
           RuntimeError, MemoryError, struct.error)  # fmt: skip
"""What libraries raise for files that are damaged or of another kind."""
_ZARR = ("zarr.json", ".zgroup", ".zarray", ".zmetadata")


def read_recording(path: Path, choice: Choice) -> Recording:
    """Read a time series, time by node.

    path: .npz, .npy, .csv (.tsv, .txt, .dat; also .gz), .mat, .h5 (.hdf5), .edf, .bdf, .nc
        (NetCDF), or the folder of a Zarr store.

    Raises BadInput: no such file, another format, a file with pickled objects, or one that leaves
    open what the signals or the times are.
    """
    try:
        if (path / "store.zarr").is_dir():
            path = path / "store.zarr"
        with _quiet():
            reader = _reader(path)
            _refuse_options(reader, choice)
            made = turned(reader(path, choice), choice)
        return made if reader is read_table else without(made, choice.drop)
    except BadInput as error:
        raise BadInput(f"{path}: {error}") from None
    except (OSError, EOFError, UnicodeDecodeError, zipfile.BadZipFile, zlib.error) as error:
        raise BadInput(f"{path}: can't be read: {_line(error)}") from None


def _reader(path: Path) -> Reader:
    if path.is_dir():
        if not is_zarr(path):
            raise BadInput("a folder that is no Zarr store")
        return _read_zarr
    if not path.exists():
        raise BadInput("no such file")
    if not path.is_file():  # reading one may never end
        raise BadInput("a pipe or a device, no file: save its data first")
    if not known_ending(path):
        sheet = "save the sheet as CSV; " if _ending(path) in _SHEETS else ""
        raise BadInput(
            f"{sheet}allowed are {', '.join(READERS)}, tables with .gz too, and Zarr stores"
        )
    return READERS[_ending(path)]


def is_zarr(path: Path) -> bool:
    """Tell whether a folder is a Zarr store, or a sweep's folder with one."""
    return any((path / name).is_file() for name in (*_ZARR, "store.zarr/zarr.json"))


def known_ending(path: Path) -> bool:
    """Tell whether a recording of this name can be read."""
    reader = READERS.get(_ending(path))
    return reader is not None and (reader is read_table or not path.name.lower().endswith(".gz"))


def _ending(path: Path) -> str:
    return Path(path.name.lower().removesuffix(".gz")).suffix


def _refuse_options(reader: Reader, choice: Choice) -> None:
    """Refuse what the user says of arrays or dimensions that a file of this kind has not."""
    labelled = reader in (_read_netcdf, _read_zarr)
    if choice.select and not labelled:
        raise BadInput(f"--select {choice.select[0][0]}: a file of this kind names no dimensions")
    if choice.variable and reader in (_read_npy, read_table, _read_edf):
        raise BadInput(f"--variable {choice.variable}: a file of this kind has no named arrays")


def _read_npy(path: Path, choice: Choice) -> Recording:
    u = as_signals("array", _load(path))
    if choice.time is None:
        return Recording(None, u)
    u = u.T if choice.transpose else u
    if not choice.time.isdecimal() or int(choice.time) >= u.shape[1]:
        raise BadInput(f"--time {choice.time}: columns are 0 to {u.shape[1] - 1}")
    column = int(choice.time)
    t, u = u[:, column], np.delete(u, column, axis=1)
    note = f"times: column {column}"
    return Recording(t, u.T if choice.transpose else u, (), (note,))


def _read_npz(path: Path, choice: Choice) -> Recording:
    with _load(path) as archive:
        return _arrays({name: archive[name] for name in _names(archive)}, choice)


def _read_mat(path: Path, choice: Choice) -> Recording:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        arrays = _flat(loadmat(path, simplify_cells=True, spmatrix=False))
    except NotImplementedError:
        arrays = _read_mat73(path)
    except (*_BROKEN, MatReadError) as error:
        raise BadInput(f"can't be read as a MATLAB file: {_line(error)}") from None
    plain = {name: array for name, array in arrays.items() if not name.startswith("_")}
    return _arrays({k: a for k, a in plain.items() if a.dtype.kind in "iufc"}, choice)


def _flat(values: dict[str, Any], above: str = "") -> dict[str, Any]:
    """Return the arrays of a structure and of those inside it, as ``outer.inner``."""
    found: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, dict):
            found |= _flat(value, f"{above}{name}.")
        else:
            found[above + name] = np.asarray(value)
    return found


def _read_mat73(path: Path) -> dict[str, Any]:
    # HDF5 has the axes of MATLAB in reverse.
    return {name: array.T for name, array in _hdf5_arrays(path, "a MATLAB 7.3 file").items()}


def _hdf5_arrays(path: Path, kind: str) -> dict[str, Any]:
    """Return the numbers in an HDF5 file, those of groups as ``group.name``."""
    try:
        import h5py
    except ImportError:
        raise _needs("h5py", kind) from None
    try:
        with h5py.File(path) as file:
            names: list[str] = []
            file.visit(names.append)
            arrays = {name: file[name] for name in names if not name.startswith("#")}
            return {k.replace("/", "."): np.asarray(a) for k, a in arrays.items()
                    if isinstance(a, h5py.Dataset) and a.dtype.kind in "iufc"}  # fmt: skip
    except _BROKEN as error:
        raise BadInput(f"can't be read as {kind}: {_line(error)}") from None


def _needs(package: str, kind: str) -> BadInput:
    return BadInput(f"is {kind}, which needs the package {package}: "
                    f"python -m pip install {package}")  # fmt: skip


def _read_hdf5(path: Path, choice: Choice) -> Recording:
    return _arrays(_hdf5_arrays(path, "an HDF5 file"), choice)


def _read_edf(path: Path, choice: Choice) -> Recording:
    """Read the signals of an EDF or BDF file that have the most samples per second."""
    try:
        import edfio
    except ImportError:
        raise _needs("edfio", "an EDF or BDF file") from None
    try:
        read = edfio.read_bdf if path.suffix.lower() == ".bdf" else edfio.read_edf
        signals = read(path).signals
    except _BROKEN as error:
        raise BadInput(f"can't be read as an EDF or BDF file: {_line(error)}") from None
    if not signals:
        raise BadInput("has no signal")
    rate = max(signal.sampling_frequency for signal in signals)
    kept = [signal for signal in signals if signal.sampling_frequency == rate]
    notes, said = (f"{rate:g} samples per second, by the file",), []
    if len(kept) < len(signals):
        slow = [signal.label for signal in signals if signal.sampling_frequency != rate]
        said.append(f"{some_of(slow, 'signal')}: fewer samples per second, left out")
    units = list(dict.fromkeys(signal.physical_dimension for signal in kept))
    if len(units) > 1:
        said.append(f"signals have different units: {', '.join(unit or 'none' for unit in units)}")
    u = as_signals("signals", np.stack([signal.data for signal in kept], axis=1))
    t = np.arange(len(u), dtype=np.float64) / rate
    names = tuple(signal.label for signal in kept)
    return Recording(None if choice.no_times else t, u, names, notes, tuple(said))


def _arrays(shapes: dict[str, Any], choice: Choice) -> Recording:
    """Return the recording in arrays with names; (T, 1) and (1, T) are vectors."""
    shapes = {k: a.ravel() if a.ndim == 2 and 1 in a.shape else a for k, a in shapes.items()}
    signals = {name: array for name, array in shapes.items() if array.ndim == 2}
    name = _choose("array", choice.variable, signals, list(shapes))
    time = choice.time
    if time is None:
        likely = [key for key, a in shapes.items() if key != name and a.ndim == 1
                  and TIME.search(key) and len(a) in np.shape(shapes[name])]  # fmt: skip
        time = min(likely, key=lambda key: key.rpartition(".")[2].lower() not in _TIMES,
                   default=None)  # fmt: skip
    elif time not in shapes:
        raise BadInput(f"--time {time}: the file has {', '.join(shapes)}")
    notes = [f"signals: array {name}"] + ([f"times: array {time}"] if time else [])
    u = as_signals(name, shapes[name])
    if choice.no_times:
        return Recording(None, u, (), tuple(notes))
    if time is None:
        _refuse_other_length(shapes, name)
        return Recording(None, u, (), tuple(notes))
    t, how, said = of_numbers(as_times(time, shapes[time]))
    if shapes[time].dtype.kind in "mM":
        how = [DATED]
    return Recording(t, u, (), (*notes, *how), tuple(said))


def _refuse_other_length(arrays: dict[str, Any], signals: str) -> None:
    """Raise BadInput for times that are not as many as the samples."""
    for key, array in arrays.items():
        if array.ndim == 1 and len(array) > 1 and key.rpartition(".")[2].lower() in _TIMES:
            raise BadInput(
                f"{len(array)} times in {key}, {signals} has the shape {arrays[signals].shape}; "
                "--step X gives the time between two samples instead"
            )


def _names(archive: Any) -> list[str]:
    """Return the names of an archive's arrays; BadInput when one holds objects."""
    try:
        return [name for name in archive.files if archive[name] is not None]
    except ValueError as error:
        raise _pickled(error) from None


def _load(path: Path) -> Any:
    with path.open("rb") as file:
        begin = file.read(6)
    if not begin.startswith((b"\x93NUMPY", b"PK")):
        raise BadInput("is no file of NumPy arrays; pickled objects are not read")
    if begin.startswith(b"PK") and not zipfile.is_zipfile(path):
        raise BadInput("can't be read: the archive is damaged or cut off")
    try:
        return np.load(path, allow_pickle=False)
    except ValueError as error:
        raise _pickled(error) from None


def _pickled(error: Exception) -> BadInput:
    if "pickle" in str(error):
        return BadInput("holds pickled objects, which can run any program: they are not read")
    return BadInput(f"can't be read: {_line(error)}")


def _read_netcdf(path: Path, choice: Choice) -> Recording:
    import xarray as xr

    try:
        with xr.open_dataset(path) as dataset:
            return _labelled(dataset, choice)
    except BadInput:
        raise
    except (*_BROKEN, ImportError) as error:
        if "engine" in str(error) or "backend" in str(error):
            needs = "is NetCDF 4 (or no NetCDF); that needs the package netCDF4 or h5netcdf"
            raise BadInput(needs) from None
        raise BadInput(f"can't be read: {_line(error)}") from None


def _read_zarr(path: Path, choice: Choice) -> Recording:
    import xarray as xr

    try:
        with xr.open_zarr(path, chunks=None) as dataset:
            return _labelled(dataset, choice)
    except BadInput:
        raise
    except (*_BROKEN, FileNotFoundError) as error:
        raise BadInput(
            f"can't be read as a group of arrays with named dimensions: {_line(error)}"
        ) from None


def _labelled(dataset: Any, choice: Choice) -> Recording:
    """Return the recording in an xarray Dataset."""
    chosen = dict(choice.select)
    for name, index in chosen.items():
        size = dataset.sizes.get(name)
        if size is None or not -size <= index < size:
            sizes = ", ".join(f"{key} ({n})" for key, n in dataset.sizes.items())
            raise BadInput(f"--select {name}={index}: its dimensions are {sizes}")
    variables = {str(name): dataset[name] for name in dataset.data_vars}
    usable = {
        name: array
        for name, array in variables.items()
        if len(set(array.dims) - set(chosen)) == 2 and array.dtype.kind in "iuf"
    }
    name = _choose("variable", choice.variable, usable, list(variables))
    array = variables[name].isel({k: i for k, i in chosen.items() if k in variables[name].dims})
    if array.ndim != 2:
        sizes = ", ".join(f"{key} ({n})" for key, n in array.sizes.items())
        raise BadInput(f"{name} has the dimensions {sizes}; --select NAME=INDEX until two are left")
    dims = [str(dim) for dim in array.dims]
    time = _time_dimension(array, dims, choice)
    (node,) = [dim for dim in dims if dim != time]
    u = as_signals(name, array.transpose(time, node).values)
    t = None
    if time in array.coords and not choice.no_times:
        t = as_times(time, array.coords[time].values)
    names = tuple(map(str, array.coords[node].values)) if node in array.coords else ()
    notes = [f"signals: variable {name}", f"times: {time}, nodes: {node}"]
    if t is not None and array.coords[time].dtype.kind in "mM":
        notes.append(DATED)
    return Recording(t, u, names, tuple(notes))


def _time_dimension(array: Any, dims: list[str], choice: Choice) -> str:
    if choice.time is not None:
        if choice.time not in dims:
            raise BadInput(f"--time {choice.time}: the dimensions are {', '.join(dims)}")
        return choice.time
    named = [dim for dim in dims if dim.lower() in _TIMES]
    dated = [d for d in dims if d in array.coords and array.coords[d].dtype.kind in "mM"]
    found = named or dated
    if len(found) != 1:
        raise BadInput(f"which of {', '.join(dims)} is time? --time NAME says it")
    return found[0]


def _choose(kind: str, asked: str | None, usable: Mapping[str, Any], known: list[str]) -> str:
    """Return the name of the array of signals."""
    if asked is not None:
        if asked not in known:
            raise BadInput(f"--variable {asked}: the file has {', '.join(known) or 'nothing'}")
        return asked
    if len(usable) == 1:
        return next(iter(usable))
    named = [name for name in usable if name.rpartition(".")[2].lower() in _SIGNALS]
    if len(named) == 1:
        return named[0]
    if not usable:
        many = ", ".join(known) or "nothing"
        hint = "; --variable NAME and --select DIMENSION=INDEX choose" if known else ""
        raise BadInput(f"no {kind} of times by nodes; the file has {many}{hint}")
    raise BadInput(f"which {kind}: {', '.join(usable)}? --variable NAME says it")


def _quiet() -> Any:
    """Keep the remarks of the libraries on how a file is made away from the user."""
    return warnings.catch_warnings(action="ignore")


def _line(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text if len(text) <= 200 else text[:197] + "..."


READERS: dict[str, Reader] = {
    ".npz": _read_npz,
    ".npy": _read_npy,
    ".csv": read_table,
    ".tsv": read_table,
    ".txt": read_table,
    ".dat": read_table,
    ".mat": _read_mat,
    ".h5": _read_hdf5,
    ".hdf5": _read_hdf5,
    ".edf": _read_edf,
    ".bdf": _read_edf,
    ".nc": _read_netcdf,
}
