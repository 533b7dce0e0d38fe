"""A user's object, ``package.module:object``: which file it comes from, and its import.

The folders of `Origin` come first, then the current folder, then the Python path. If two of these
places have different modules of the name, nothing is imported.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import dataclass
from functools import cache
from importlib import import_module, invalidate_caches
from importlib.machinery import PathFinder
from importlib.util import module_from_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import short
from chimera_hpc.models.parameters import ModelParameters
from chimera_hpc.models.source import SourceFiles, module_file, source_files

_MODULE = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", re.ASCII)
_appended: list[str] = []
"""The folder of the last imported model, if its import appended it to the Python path."""
_WHERE = "it must be in the job's folder, the current one, or on PYTHONPATH"


@dataclass(frozen=True)
class Origin:
    """Where a sweep's model comes from; built-in models need none."""

    folders: tuple[str, ...] = ()
    """Folders in which the module of a user's model is looked for first."""
    table: ModelParameters | None = None
    """Its parameters as a store keeps them. The module is then imported only to compute points."""

    def before(self, other: Origin) -> Origin:
        """Return a copy with the folders of `other` after its own."""
        return Origin(tuple(dict.fromkeys((*self.folders, *other.folders))), self.table)


@dataclass(frozen=True, eq=False)
class UserModel:
    """A user's model as it was imported."""

    kind: Any
    """The object, with ``parameters`` and ``build(sweep, row)``."""
    file: Path | None
    """The file of its module."""
    held: dict[str, str]
    """What its functions hold, see `models.held`, right after the import."""


def user_model(name: str, origin: Origin | None = None) -> UserModel:
    """Return the model that ``package.module:object`` names.

    The object has ``parameters``, a `ModelParameters`, and ``build(sweep, row)``, which returns a
    `chimera_hpc.models.protocol.Model` for the point with this row of columns.
    `chimera_hpc.models.custom.OwnModel` provides both. What the module prints goes to stderr.

    Raises
    ------
    BadInput
        The module does not exist, is there twice with different contents, or cannot be imported;
        or the object is not a model.
    """
    return _loaded(name, () if origin is None else origin.folders, _current_folder())


def user_object(key: str, name: str, origin: Origin | None = None) -> tuple[Any, Path | None]:
    """Return the object that ``package.module:object`` names, and the file of its module.

    Raises BadInput as `user_model` does for a module; `key` is the key of the job that names it.
    """
    return _imported(key, name, () if origin is None else origin.folders, _current_folder())


def user_source(name: str, origin: Origin) -> SourceFiles | None:
    """Return the files of a user's model as they are now; None where there are none."""
    file = user_model(name, origin).file
    return None if file is None else source_files(file, name.partition(":")[0])


@contextmanager
def prints_to_stderr() -> Iterator[None]:
    """Redirect the output of a user's code to stderr, because stdout is for results."""
    with redirect_stdout(sys.stderr):
        yield


@cache
def _imported(key: str, name: str, folders: tuple[str, ...], here: str) -> tuple[Any, Path | None]:
    module, _, attribute = name.partition(":")
    where = f"{key}: {short(name)}"
    if not (_MODULE.fullmatch(module) and attribute.isidentifier()):
        raise BadInput(f"{where} is not of the form package.module:object")
    found = _find(where, module, tuple(filter(None, (*folders, here))))
    made = _attribute(where, module, attribute, found)
    if found is not None:
        _check_siblings(where, found)
    return made, _file_of(module)


@cache
def _loaded(name: str, folders: tuple[str, ...], here: str) -> UserModel:
    where = f"model: {short(name)}"
    kind, file = _imported("model", name, folders, here)
    if not isinstance(getattr(kind, "parameters", None), ModelParameters):
        raise BadInput(f"{where} has no attribute parameters of type ModelParameters")
    if not callable(getattr(kind, "build", None)):
        raise BadInput(f"{where} has no method build(sweep, row)")
    from chimera_hpc.models.held import held_values

    return UserModel(kind, file, held_values(kind, "" if file is None else str(file.parent)))


def _attribute(where: str, module: str, attribute: str, found: SourceFiles | None) -> Any:
    try:
        with prints_to_stderr():
            return getattr(_import(module, found), attribute)
    except Exception as error:
        # The import of a user's module may raise any exception.
        text = " ".join(f"{type(error).__name__}: {error}".split())
        if isinstance(error, ModuleNotFoundError) and error.name == module.partition(".")[0]:
            text += f"; {_WHERE}"
        raise BadInput(f"{where} can't be imported: {text}") from None


def _find(where: str, module: str, first: tuple[str, ...]) -> SourceFiles | None:
    """Return the files of the module in the first folder that has it; None where none has.

    Raises BadInput if another folder has a module of the name with other contents.
    """
    path = [folder for folder in sys.path if folder and folder not in _appended]
    files = (module_file(folder, module) for folder in dict.fromkeys((*first, *path)))
    places: dict[Path, Path] = {}
    for file in filter(None, files):
        places.setdefault(file.resolve(), file.absolute())
    if not places:
        return None
    chosen, *others = (source_files(file, module) for file in places.values())
    for other in others:
        if (pair := chosen.difference(other)) is not None:
            raise _two(where, *pair)
    return chosen


def _two(where: str, one: Path, other: Path) -> BadInput:
    return BadInput(
        f"{where}: two different files may be meant, {one} and {other}: "
        "rename or remove one, or start in another folder"
    )


def _check_siblings(where: str, found: SourceFiles) -> None:
    """Raise BadInput if a module next to the model was imported from elsewhere, with other text."""
    for name in found.modules:
        wanted, got = module_file(found.folder, name), _file_of(name)
        if wanted and got and got.read_bytes() != wanted.read_bytes():
            raise _two(where, wanted, got)


def _import(module: str, found: SourceFiles | None) -> ModuleType:
    """Import a module without writing its bytecode to the disk.

    Python detects stale bytecode by the time of the last change, in whole seconds, and the size of
    the source. It may miss an edit.
    """
    before = sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    try:
        invalidate_caches()
        if found is not None:
            _import_top(module.partition(".")[0], found)
        return import_module(module)
    finally:
        sys.dont_write_bytecode = before


def _import_top(top: str, found: SourceFiles) -> None:
    """Import the first part of a module's name from its folder and no other.

    Modules next to it are found at the end of the Python path, behind all libraries.
    """
    folder = str(found.folder)
    for other in _appended:
        with suppress(ValueError):
            sys.path.remove(other)
    _appended.clear()
    if folder not in sys.path:
        sys.path.append(folder)
        _appended.append(folder)
    if top in sys.modules:
        present = _file_of(top)
        if present is not None and present.is_relative_to(found.folder):
            return
        _forget(top, present)
    spec = PathFinder.find_spec(top, [folder])
    if spec is None or spec.loader is None:
        return
    made = sys.modules[top] = module_from_spec(spec)
    try:
        spec.loader.exec_module(made)
    except BaseException:
        sys.modules.pop(top, None)
        raise


def _forget(top: str, file: Path | None) -> None:
    """Remove the imported modules of this name, and those next to the model, from `sys.modules`."""
    beside = set() if file is None else set(source_files(file, top).modules)
    for name in [*sys.modules]:
        if name.partition(".")[0] in {top, *beside}:
            del sys.modules[name]


def _file_of(module: str) -> Path | None:
    file = getattr(sys.modules.get(module), "__file__", None)
    return None if file is None else Path(file).absolute()


def _current_folder() -> str:
    with suppress(OSError):
        return os.getcwd()
    return ""
