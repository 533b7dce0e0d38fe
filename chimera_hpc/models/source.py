"""The files that a user's model is made of, read without running any of them."""

from __future__ import annotations

import ast
import sys
import sysconfig
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from hashlib import blake2b
from importlib.machinery import PathFinder
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
_LIBRARIES = tuple(dict.fromkeys(sysconfig.get_paths().values()))


@dataclass(frozen=True)
class SourceFiles:
    """A module with what it imports or names from the same folder, and its other imports."""

    folder: Path
    """The folder that the names below begin in."""
    code: tuple[Path, ...]
    """The module, all of its package, and modules next to it that it imports."""
    data: tuple[Path, ...]
    """Files there whose names are texts in that code, such as "W.npy" or f"W{k}.npy"."""
    modules: tuple[str, ...]
    """Modules next to it that it imports."""
    packages: tuple[str, ...]
    """What else it imports, without Python's own library."""

    @property
    def digest(self) -> str:
        """16 hexadecimal digits over the names and contents of the code."""
        total = blake2b(digest_size=8)
        for file in self.code:
            total.update(f"{file.name}\0".encode() + file.read_bytes())
        return total.hexdigest()

    def data_digests(self) -> dict[str, str]:
        """Return a digest of each data file by its name."""
        return {self._name(file): _digest(file) for file in self.data}

    def versions(self) -> dict[str, str | None]:
        """Return the version of each package."""
        return {name: _version(name) for name in self.packages}

    def difference(self, other: SourceFiles) -> tuple[Path, Path] | None:
        """Return the first two files of one name but other contents; None without any."""
        theirs = {other._name(file): file for file in (*other.code, *other.data)}
        for file in (*self.code, *self.data):
            twin = theirs.get(self._name(file))
            if twin is not None and file.read_bytes() != twin.read_bytes():
                return file, twin
        return None

    def _name(self, file: Path) -> str:
        return file.relative_to(self.folder).as_posix()


def module_file(folder: str | Path, module: str) -> Path | None:
    """Return the file of a module ``a.b`` whose first part lies in this folder, or None."""
    place = Path(folder).joinpath(*module.split("."))
    for file in (place / "__init__.py", place.with_name(f"{place.name}.py")):
        if file.is_file():
            return file
    return None


def source_files(file: Path, module: str) -> SourceFiles:
    """Return the files of the module with this name in this file."""
    levels = module.count(".") + (file.name == "__init__.py")
    folder = file.parents[levels]
    top = module.partition(".")[0]
    pending = sorted((folder / top).rglob("*.py")) if levels else [file]
    alone = str(folder) in _LIBRARIES
    code: dict[Path, None] = {}
    texts: dict[str, None] = {}
    siblings: set[str] = set()
    packages: set[str] = set()
    while pending:
        path = pending.pop()
        code[path] = None
        tree = _parsed(path)
        texts |= dict.fromkeys(_texts(tree))
        for name in _imports(tree) - {top, *siblings}:
            beside = None if alone or is_library(name) else module_file(folder, name)
            if beside is None:
                packages.add(name)
                continue
            siblings.add(name)
            whole = beside.name == "__init__.py"
            pending += sorted(beside.parent.rglob("*.py")) if whole else [beside]
    data = () if alone else tuple(sorted(set(_named_files(folder, [*texts]))))
    packages -= {PACKAGE.name, *sys.stdlib_module_names}
    return SourceFiles(
        folder, tuple(sorted(code)), data, tuple(sorted(siblings)), tuple(sorted(packages))
    )


@cache
def is_library(name: str) -> bool:
    """Return whether a module is Python's own, this package, or installed."""
    if name in sys.stdlib_module_names or name == PACKAGE.name:
        return True
    return PathFinder.find_spec(name, _LIBRARIES) is not None


def is_library_file(file: str) -> bool:
    """Return whether a source file is Python's own, of this package, or installed."""
    return file.startswith(("<frozen", str(PACKAGE), *_LIBRARIES))


def _parsed(path: Path) -> ast.Module:
    try:
        return ast.parse(path.read_bytes())
    except (SyntaxError, ValueError, RecursionError):
        # Its import says what is wrong.
        return ast.Module([], [])


def _imports(tree: ast.Module) -> set[str]:
    names = [a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names]
    nodes = (n for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and not n.level)
    return {name.partition(".")[0] for name in (*names, *(n.module or "" for n in nodes))}


def _texts(tree: ast.Module) -> Iterator[str]:
    """Yield the texts in the code; where numbers or names are put in, there is a ``*``."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value
        elif isinstance(node, ast.JoinedStr):
            parts = (p.value if isinstance(p, ast.Constant) else "*" for p in node.values)
            yield "".join(map(str, parts))


def _named_files(folder: Path, texts: list[str]) -> Iterator[Path]:
    """Yield the files in a folder, or in its folders that are named too, with these names."""
    plain = [t for t in texts if 0 < len(t) < 200 and t.isprintable() and t.strip("*./\\ ")]
    plain = [t for t in plain if not t.startswith(("/", "~")) and ".." not in t]
    folders = [folder, *(folder / t for t in plain if "*" not in t and (folder / t).is_dir())]
    for place in folders:
        for text in plain:
            found = place.glob(text) if "*" in text else [place / text]
            yield from (f for f in found if f.suffix != ".py" and f.is_file())


def _digest(file: Path) -> str:
    total = blake2b(digest_size=8)
    with file.open("rb") as opened:
        while part := opened.read(1 << 20):
            total.update(part)
    return total.hexdigest()


def _version(name: str) -> str | None:
    found = getattr(sys.modules.get(name), "__version__", None)
    try:
        return str(found) if found is not None else version(name)
    except PackageNotFoundError:
        return None
