"""What the functions of a user's model hold: arrays, numbers, texts, in globals and closures."""

from __future__ import annotations

import functools
import sys
from collections.abc import Iterable, Mapping, Sequence, Set
from hashlib import blake2b
from pathlib import PurePath
from types import (
    BuiltinFunctionType,
    CodeType,
    FunctionType,
    MethodType,
    ModuleType,
    SimpleNamespace,
)
from typing import Any

import numpy as np

from chimera_hpc.models.custom import OwnModel
from chimera_hpc.models.source import is_library_file

_PLAIN = (bool, int, float, complex, bytes, type(None), type(Ellipsis), np.generic, range)
_TOLD = ("datetime", "decimal", "fractions", "enum", "array", "uuid")
"""Python's own modules whose objects tell all in their `repr`."""
_LONGEST = 40
_ROLES = ("function", "initial", "reals", "integers", "observed")
"""The functions of an `OwnModel`, by the names of its attributes."""


def held_values(model: object, folder: str) -> dict[str, str]:
    """Return what the functions of a model hold, by name.

    These are the globals that their code names and the variables of their closures, also of the
    functions that they call, and the values in the attributes of a model that is no `OwnModel`.
    Functions of libraries and of this package are left out, as are random generators.

    Parameters
    ----------
    model : object
        What a job's ``model`` names.
    folder : str
        The folder of the model's module; paths inside it count from there.

    Returns
    -------
    dict of str to str
        A number as text; for anything else a type, a shape, a digest of the contents.
    """
    found = _Held(folder)
    if isinstance(model, OwnModel):
        functions = [getattr(model, role) for role in _ROLES]
        for function in (*functions, *(limit.highest for limit in model.parameters.limits)):
            found.digest(function)
    else:
        found.note(type(model).__name__, model)
    return dict(sorted(found.values.items()))


class _Held:
    """A walk through all that can be reached."""

    def __init__(self, folder: str) -> None:
        self.folder, self.values = folder or "\0", dict[str, str]()
        self._known: dict[int, tuple[Any, bytes]] = {}

    def note(self, name: str, value: Any) -> None:
        """Record a value under a name, unless it is a function, which holds others."""
        digest = self.digest(value)
        if not _is_code(value):
            self.values[name] = self._shown(value, digest)

    def digest(self, value: Any) -> bytes:
        """Return a digest of a value; what is reached again, as in a cycle, counts once."""
        if isinstance(value, _PLAIN):
            return f"{type(value).__name__} {value!r}".encode()
        if id(value) not in self._known:
            self._known[id(value)] = (value, type(value).__name__.encode())
            total = blake2b(digest_size=8)
            for part in self._parts(value):
                total.update(f"{len(part)}:".encode())
                total.update(part)
            self._known[id(value)] = (value, total.digest())
        return self._known[id(value)][1]

    def _parts(self, value: Any) -> Iterable[bytes]:
        yield type(value).__name__.encode()
        if isinstance(value, str | PurePath):
            yield str(value).replace(self.folder, ".").encode()
        elif isinstance(value, np.ndarray) and value.dtype.hasobject:
            yield from map(self.digest, (value.shape, value.tolist()))
        elif isinstance(value, np.ndarray):
            yield f"{value.dtype.descr} {value.shape}".encode()
            yield np.ascontiguousarray(value).tobytes()
        elif _is_code(value):
            yield self._function(value)
        elif isinstance(value, np.random.Generator | np.random.RandomState):
            return
        elif isinstance(value, Mapping):
            yield from (self.digest(part) for item in value.items() for part in item)
        elif isinstance(value, Set):
            yield from sorted(map(self.digest, value))
        elif isinstance(value, Sequence):
            yield from map(self.digest, value)
        elif isinstance(value, bytearray | memoryview):
            yield bytes(value)
        else:
            yield from self._object(value)

    def _object(self, value: Any) -> Iterable[bytes]:
        """Yield the contents of an object of any class, and what its methods hold."""
        kind = type(value)
        module = kind.__module__.partition(".")[0]
        if hasattr(value, "__array__"):
            yield self.digest(np.asarray(value))
        elif module in _TOLD:
            yield repr(value).encode()
        if module in sys.stdlib_module_names and kind is not SimpleNamespace:
            # A lock, a logger: nothing that a number depends on, and other in each process.
            return
        for name in _attributes(value):
            yield name.encode() + self.digest(getattr(value, name, None))
        for each in kind.__mro__:
            if _is_own(each):
                yield from self._members(each)

    def _members(self, kind: type) -> Iterable[bytes]:
        for name, member in vars(kind).items():
            inner = getattr(member, "fget", getattr(member, "__func__", member))
            if not name.startswith("__") or isinstance(inner, FunctionType):
                yield name.encode() + self.digest(inner)

    def _function(self, value: Any) -> bytes:
        """Walk through what a function holds, and return its name."""
        if isinstance(value, functools.partial):
            self.note(f"{_name(value.func)}.arguments", (value.args, value.keywords))
            return self.digest(value.func)
        if isinstance(value, MethodType):
            return self.digest(value.__func__) + self.digest(value.__self__)
        inner = getattr(value, "py_func", getattr(value, "__wrapped__", value))
        if isinstance(inner, FunctionType) and not is_library_file(inner.__code__.co_filename):
            self._walk(inner)
        return _name(inner).encode()

    def _walk(self, function: FunctionType) -> None:
        code, scope = function.__code__, function.__globals__
        names = _names(code)
        for name in sorted(names & scope.keys()):
            value = scope[name]
            if isinstance(value, ModuleType | type):
                self._inside(value, names)
            else:
                self.note(f"{function.__module__}.{name}", value)
        where = f"{function.__module__}.{function.__qualname__}"
        for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
            self.note(f"{where}.{name}", _contents(cell))
        for name, value in (function.__kwdefaults__ or {}).items():
            self.note(f"{where}.{name}", value)
        if function.__defaults__:
            self.note(f"{where}.defaults", function.__defaults__)
        if code.co_filename.startswith("<"):
            self.note(f"{where}.code", code.co_code)

    def _inside(self, place: ModuleType | type, names: set[str]) -> None:
        """Note what is named of another module or a class of the user's, as in ``helper.W``."""
        if not _is_own(place):
            return
        for name in sorted(names & vars(place).keys()):
            value = vars(place)[name]
            if not isinstance(value, ModuleType):
                self.note(f"{place.__name__}.{name}", getattr(value, "__func__", value))

    def _shown(self, value: Any, digest: bytes) -> str:
        if isinstance(value, bool | int | float | str) and len(str(value)) <= _LONGEST:
            return str(value).replace(self.folder, ".")
        shape = getattr(value, "shape", "")
        kind = str(getattr(value, "dtype", type(value).__name__))
        return " ".join(filter(None, [kind, f"{shape}" if shape else "", digest.hex()]))


def _is_code(value: Any) -> bool:
    kinds = (FunctionType, BuiltinFunctionType, MethodType, functools.partial, type, ModuleType)
    return isinstance(value, (*kinds, np.ufunc)) or hasattr(value, "py_func") or _wraps(value)


def _wraps(value: Any) -> bool:
    return isinstance(getattr(value, "__wrapped__", None), FunctionType)


def _is_own(place: ModuleType | type) -> bool:
    """Whether a module or class is the user's: not of a library, not built in."""
    module = place if isinstance(place, ModuleType) else sys.modules.get(place.__module__)
    return not is_library_file(getattr(module, "__file__", None) or "<frozen")


def _name(value: Any) -> str:
    name = getattr(value, "__qualname__", getattr(value, "__name__", type(value).__name__))
    return f"{getattr(value, '__module__', '')}.{name}"


def _names(code: CodeType) -> set[str]:
    """Return the global names and attributes in a function's code and in functions inside it."""
    inner = [_names(part) for part in code.co_consts if isinstance(part, CodeType)]
    return set(code.co_names).union(*inner)


def _attributes(value: Any) -> list[str]:
    slots = [getattr(kind, "__slots__", ()) for kind in type(value).__mro__]
    named = [name for names in slots for name in ([names] if isinstance(names, str) else names)]
    return [n for n in (*getattr(value, "__dict__", {}), *named) if not n.startswith("__")]


def _contents(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:
        return None
