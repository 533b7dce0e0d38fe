"""What the package promises as a whole: light, one-way imports, strict kernels, clean files."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import chimera_hpc

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "chimera_hpc"
SOURCES = sorted(PACKAGE.rglob("*.py"))

# A folder imports only from itself and from folders before it; DESIGN.md shows the same list.
LAYERS = (
    "base",
    "network",
    "integrate",
    "models",
    "measures",
    "classify",
    "job",
    "pipeline",
    "plot",
    "store",
    "run",
    "reduction",
    "recordings",
    "report",
    "cli",
)
PRINTING = ("cli", "run.progress")
SCOREBOARD = sorted((ROOT / "jobs" / "paper" / "scoreboard").rglob("*.py"))
PRIVATE = re.compile(r"_[a-zA-Z]\w*")
OPTION = re.compile(r"_[a-z]\w*")
NAMED_TUPLE = {"_asdict", "_fields", "_field_defaults", "_make", "_replace"}
"""Underscored by collections.namedtuple so that no field hides them; documented as public."""
DOCUMENTED = NAMED_TUPLE | {"_exit"}
"""os._exit is public as well: it has this name to differ from sys.exit."""
PRIVATE_OPTIONS = {
    "_nrt": "numba's option, a keyword and no name; without it 1.6 times slower",
    "_fields_set": "pydantic's documented argument of model_construct",
}
MOST_PARAMETERS, MOST_LINES = 8, 400


def modules_loaded_by(statement: str) -> set[str]:
    """Top-level names in sys.modules after the statement, in a process of its own."""
    code = f"{statement}\nimport sys\nprint(*{{name.partition('.')[0] for name in sys.modules}})"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    return set(done.stdout.split())


def test_importing_the_package_loads_nothing_heavy():
    heavy = {"numba", "numpy", "scipy", "zarr", "dask", "distributed", "sklearn", "matplotlib"}
    assert modules_loaded_by("import chimera_hpc") & heavy == set()


def test_task_knows_neither_dask_nor_zarr():
    doors = {"dask", "distributed", "zarr"}
    assert modules_loaded_by("import chimera_hpc.run.block") & doors == set()


def test_ledger_knows_no_zarr():
    assert "zarr" not in modules_loaded_by("import chimera_hpc.store.ledger")


@pytest.mark.parametrize("name", chimera_hpc.__all__)
def test_every_public_name_can_be_imported(name):
    assert getattr(chimera_hpc, name) is not None
    assert name in dir(chimera_hpc)


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="has no attribute 'nothing_like_this'"):
        _ = chimera_hpc.nothing_like_this


@pytest.mark.parametrize(
    ("typed", "loaded"), [(["--help"], []), (["schema"], ["schema"]), (None, ["run", "schema"])]
)
def test_only_the_command_that_is_typed_is_loaded(typed, loaded):
    code = f"import sys; from chimera_hpc.cli.main import parser; parser(typed={typed})\n"
    code += "print(*[name for name in sys.modules if name.startswith('chimera_hpc.cli.')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    names = {name.removeprefix("chimera_hpc.cli.") for name in done.stdout.split()}
    assert {"run", "schema"} & names == set(loaded)


@cache
def parsed(source: Path) -> ast.Module:
    return ast.parse(source.read_text(encoding="utf-8"))


def module_name(source: Path) -> str:
    """Dotted name below chimera_hpc; empty for the package itself."""
    parts = source.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def layer(name: str) -> int:
    """Position in LAYERS of the folder that a module lies in."""
    return LAYERS.index(name.partition(".")[0])


def imported_modules(source: Path) -> Iterator[str]:
    """Dotted names below chimera_hpc that a file imports, wherever in the file."""
    here = ["chimera_hpc", *filter(None, module_name(source).split("."))]
    if source.name != "__init__.py":
        here.pop()
    for node in ast.walk(parsed(source)):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = here[: len(here) + 1 - node.level] if node.level else []
            base += node.module.split(".") if node.module else []
            names = [is_module_or_parent([*base, alias.name]) for alias in node.names]
        for name in names:
            if name.startswith("chimera_hpc."):
                yield name.removeprefix("chimera_hpc.")


def is_module_or_parent(parts: list[str]) -> str:
    """`from a import b` imports the module a.b if there is one, otherwise something inside a."""
    path = ROOT.joinpath(*parts)
    found = path.is_dir() or path.with_suffix(".py").is_file()
    return ".".join(parts if found else parts[:-1])


def test_top_level_holds_the_layers_and_two_files():
    names = {path.name for path in PACKAGE.iterdir() if not path.name.startswith(("_", "."))}
    assert names == {*LAYERS, "sweep.py", "py.typed"}


def test_every_folder_says_in_one_sentence_what_it_is():
    for name in LAYERS:
        text = ast.get_docstring(parsed(PACKAGE / name / "__init__.py"))
        assert text, name
        first = text.partition("\n\n")[0]
        assert first.endswith("."), name
        assert ". " not in first, name


def test_no_public_class_name_is_defined_in_two_modules():
    homes: dict[str, list[str]] = {}
    for source in SOURCES:
        for node in parsed(source).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes.setdefault(node.name, []).append(module_name(source))
    assert {name: places for name, places in homes.items() if len(places) > 1} == {}


def test_design_lists_the_layers():
    text = (ROOT / "DESIGN.md").read_text("utf-8")
    assert tuple(re.findall(r"^\| `(\w+)/` \|", text, flags=re.MULTILINE)) == LAYERS


@pytest.mark.parametrize(
    "source",
    [s for s in SOURCES if module_name(s) not in ("", "sweep")],
    ids=lambda s: module_name(s),
)
def test_imports_go_one_way_between_folders(source):
    own = layer(module_name(source))
    upward = [name for name in imported_modules(source) if layer(name) > own]
    assert upward == []


def test_zarr_and_clusters_have_one_door_each():
    doors = {"zarr": "store", "dask_jobqueue": "run"}
    for source in SOURCES:
        for node in ast.walk(parsed(source)):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.module and not node.level:
                names = [node.module]
            for name in names:
                door = doors.get(name.partition(".")[0])
                assert door in {None, module_name(source).partition(".")[0]}, f"{source}: {name}"


def test_no_kernel_states_fastmath():
    stated = [
        f"{source.relative_to(ROOT)}:{getattr(node, 'lineno', '?')}"
        for source in SOURCES
        for node in ast.walk(parsed(source))
        if (isinstance(node, ast.keyword) and node.arg == "fastmath")
        or (isinstance(node, ast.Constant) and node.value == "fastmath")
    ]
    assert stated == []


def test_only_the_command_line_prints():
    printing = [
        f"{source.relative_to(ROOT)}:{node.lineno}"
        for source in SOURCES
        if not f"{module_name(source)}.".startswith(tuple(f"{name}." for name in PRINTING))
        for node in ast.walk(parsed(source))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "print"
    ]
    assert printing == []


def trees(sources: list[Path]) -> list[tuple[Path, ast.Module]]:
    return [(source, parsed(source)) for source in sources]


def members(tree: ast.AST) -> Iterator[str]:
    """Names that the classes of a file give their objects."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):
            for part in node.body:
                targets = part.targets if isinstance(part, ast.Assign) else []
                targets = [part.target] if isinstance(part, ast.AnnAssign) else targets
                yield from (target.id for target in targets if isinstance(target, ast.Name))
                if isinstance(part, ast.FunctionDef | ast.AsyncFunctionDef):
                    yield part.name
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and is_own(node):
            yield node.attr


def is_own(node: ast.Attribute) -> bool:
    return isinstance(node.value, ast.Name) and node.value.id in {"self", "cls"}


def imported_from_elsewhere(node: ast.AST) -> list[str]:
    """Every part of the dotted names that a statement imports from other packages."""
    if isinstance(node, ast.Import):
        names = [alias.name for alias in node.names]
    elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
        names = [f"{node.module}.{alias.name}" for alias in node.names]
    else:
        names = []
    ours = ("chimera_hpc.", "scoreboard.")
    return [part for name in names if not name.startswith(ours) for part in name.split(".")]


def private_names(tree: ast.AST, own: set[str]) -> Iterator[tuple[int, str]]:
    """Private names of other packages that a file uses, each with its line."""
    aliases = {
        (alias.asname or alias.name).partition(".")[0]
        for node in ast.walk(tree)
        if imported_from_elsewhere(node)
        for alias in node.names
    }
    for node in ast.walk(tree):
        names = imported_from_elsewhere(node)
        if isinstance(node, ast.Attribute) and not is_own(node):
            root = node.value
            while isinstance(root, ast.Attribute):
                root = root.value
            foreign = isinstance(root, ast.Name) and root.id in aliases
            names = [node.attr] if foreign or node.attr not in own else []
            names = [name for name in names if name not in DOCUMENTED]
        yield from ((node.lineno, name) for name in names if PRIVATE.fullmatch(name))


def test_no_private_name_of_another_package():
    files = trees(SOURCES + SCOREBOARD)
    own: set[str] = set().union(*(members(tree) for _, tree in files))
    found = [
        f"{source.relative_to(ROOT)}:{line}: {name}"
        for source, tree in files
        for line, name in private_names(tree, own)
    ]
    assert found == []


def test_private_options_of_other_packages_are_those_that_are_listed():
    found = set()
    for _, tree in trees(SOURCES + SCOREBOARD):
        for node in ast.walk(tree):
            if isinstance(node, ast.Dict):
                found |= {key.value for key in node.keys if isinstance(key, ast.Constant)}
            elif isinstance(node, ast.Call):
                found |= {word.arg for word in node.keywords}
    options = {name for name in found if isinstance(name, str) and OPTION.fullmatch(name)}
    assert options == set(PRIVATE_OPTIONS)


def test_no_function_takes_many_positional_parameters():
    found = []
    for source, tree in trees(SOURCES):
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
                names = [arg.arg for arg in node.args.posonlyargs + node.args.args]
                if len(names) - (names[:1] in (["self"], ["cls"])) > MOST_PARAMETERS:
                    found.append(f"{source.relative_to(ROOT)}:{node.lineno}")
    assert found == []


def test_no_file_is_long():
    lines = {source: len(source.read_text("utf-8").splitlines()) for source in SOURCES}
    assert [str(s.relative_to(ROOT)) for s, n in lines.items() if n > MOST_LINES] == []


def project_files() -> list[Path]:
    """Files that git tracks or would add."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=True,
    ).stdout
    files = [ROOT / name for name in listed.split("\0") if name]
    assert files
    return [file for file in files if file.is_file()]


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a git checkout")
def test_no_file_names_a_registry_or_a_home_folder():
    # In pieces, so that this file does not find itself.
    hosts = [
        "py" + r"pi\.org",
        "python" + r"hosted\.org",
        "registry" + r"\.npmjs",
        "deb" + r"ian\.org",
    ]
    folders = ["/ro" + "ot/", "/ho" + r"me/\w", "/Us" + r"ers/\w", "/wo" + "rk/"]
    pattern = re.compile("|".join(hosts + folders).encode())
    found = [
        f"{file.relative_to(ROOT)}: {match.group().decode()}"
        for file in project_files()
        if (match := pattern.search(file.read_bytes()))
    ]
    assert found == []


def locked(name: str) -> tuple[dict[str, list[Requirement]], str]:
    """Requirements of a lock file by canonical name, and its text."""
    text = (ROOT / name).read_text(encoding="utf-8")
    entries: dict[str, list[Requirement]] = {}
    for line in re.findall(r"^[a-zA-Z].*(?= \\$)", text, flags=re.MULTILINE):
        requirement = Requirement(line)
        entries.setdefault(canonicalize_name(requirement.name), []).append(requirement)
    return entries, text


def declared(*extras: str) -> list[Requirement]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    optional = [line for extra in extras for line in project["optional-dependencies"][extra]]
    return [Requirement(line) for line in project["dependencies"] + optional]


@pytest.mark.parametrize(
    ("name", "extras"),
    [
        ("requirements.lock", ("slurm", "dev", "completion")),
        ("requirements-bench.lock", ("bench",)),
        ("requirements-docs.lock", ("docs",)),
    ],
)
def test_lock_file_pins_what_pyproject_declares(name, extras):
    entries, text = locked(name)
    for requirement in declared(*extras):
        pins = entries[canonicalize_name(requirement.name)]
        versions = [next(iter(pin.specifier)).version for pin in pins]
        assert all(requirement.specifier.contains(version) for version in versions), requirement
    assert not re.search(r"://|^\s*--(?!hash=sha256:[0-9a-f]{64})", text, flags=re.MULTILINE)


@pytest.mark.parametrize(
    "name", ["requirements.lock", "requirements-bench.lock", "requirements-docs.lock"]
)
def test_every_pin_has_a_hash(name):
    _, text = locked(name)
    pins = re.findall(r"^([a-zA-Z][^\n]*)((?:\n +--hash=\S+(?: \\)?)*)", text, flags=re.MULTILINE)
    assert [pin for pin, hashes in pins if not hashes] == []


@pytest.mark.parametrize("name", ["requirements-bench.lock", "requirements-docs.lock"])
def test_lock_files_agree(name):
    base, more = locked("requirements.lock")[0], locked(name)[0]
    different = {
        package
        for package in base.keys() & more.keys()
        if {str(pin.specifier) for pin in base[package]}
        != {str(pin.specifier) for pin in more[package]}
    }
    assert different == set()


def test_version_is_the_same_everywhere():
    version = chimera_hpc.__version__
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\n## [{version}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_wheel_carries_jobs_and_type_marker(tmp_path):
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    (wheel,) = tmp_path.glob("*.whl")
    names = set(zipfile.ZipFile(wheel).namelist())
    jobs = {
        f"chimera_hpc/{path.relative_to(ROOT).as_posix()}" for path in ROOT.glob("jobs/**/*.toml")
    }
    assert jobs
    assert names >= jobs | {"chimera_hpc/py.typed", "chimera_hpc/report/templates/report.html"}
    assert {name.partition("/")[0].partition("-")[0] for name in names} == {"chimera_hpc"}
