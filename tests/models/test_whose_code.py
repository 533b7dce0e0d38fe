"""Whose model a sweep runs: which file, which data, and stores whose model is gone."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job import Sweep, user_models
from chimera_hpc.job.models import build
from chimera_hpc.models.held import held_values
from chimera_hpc.models.source import source_files
from chimera_hpc.run.second_draw import check_in_second_process, drawn
from chimera_hpc.store.origin import stored_origin
from chimera_hpc.store.provenance import differences, model_source
from chimera_hpc.store.store import Store
from chimera_hpc.sweep import main

MODULE = """
import numpy as np
from pathlib import Path
from chimera_hpc import OwnModel, Parameter

HERE = Path(__file__).parent
{before}

def rhs(y, dy, p, ints):
    n = ints[0]
    for lane in range(y.shape[1]):
        for i in range(n):
            u, v = y[i, lane], y[n + i, lane]
            s = {size} - u * u - v * v
            dy[i, lane] = s * u - {omega} * v + p[0, lane] {more}
            dy[n + i, lane] = s * v + {omega} * u

MODEL = OwnModel(
    rhs,
    variables=("u", "v"),
    parameters=(Parameter("g", float, 0.0, "Forcing."),),
    n_nodes=6,
    initial={initial},
    {options}
)
"""
PARTS = {
    "before": "",
    "size": "1.0",
    "omega": "6.0",
    "more": "",
    "initial": "lambda rng, row, n: rng.uniform(-1.0, 1.0, (2, n))",
    "options": "",
}
JOB = """
name = "own"
model = "{module}:MODEL"
[grid]
g = [0.0, 0.1]
seeds = 2
[integrator]
t_end = 12.0
t_step = 0.02
[features]
start = 4.0
n_peaks = 3
n_overlap = 1
[run]
block = 2
"""
SERIAL = ("--cluster", "serial", "--no-figures")


def write(folder: Path, module: str = "mine_code", **parts: str) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / f"{module}.py").write_text(MODULE.format(**PARTS | parts))
    job = folder / "job.toml"
    job.write_text(JOB.format(module=module))
    return job


@pytest.fixture(autouse=True)
def apart(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    """Leave sys.path, the modules and the current folder as they were."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.chdir(tmp_path)
    yield
    edited()


def run(cwd: Path, *words: object) -> subprocess.CompletedProcess[str]:
    """Run a command line in a process and a folder of its own."""
    command = [sys.executable, "-m", "chimera_hpc.sweep", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, env=dict(os.environ))


def edited() -> None:
    """Forget the model, as a new process would."""
    user_models._imported.cache_clear()
    user_models._loaded.cache_clear()
    for name in [name for name in sys.modules if name.startswith("mine_")]:
        del sys.modules[name]


def refused(error: str, *texts: object) -> None:
    assert error.count("\n") == 1, error
    for text in texts:
        assert str(text) in error


def test_the_model_is_that_of_the_jobs_folder(tmp_path: Path) -> None:
    sweep = Sweep.load(write(tmp_path / "a"))
    shutil.copytree(tmp_path / "a", tmp_path / "b")
    assert sweep.origin.folders == (str(tmp_path / "a"),)
    held = model_source(sweep)
    other = Sweep.load(write(tmp_path / "b", before="K = 3"))
    assert model_source(other)["model"] != held["model"]
    assert model_source(sweep) == held


def test_two_different_modules_of_one_name_stop_a_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    job = write(tmp_path / "a")
    write(tmp_path / "b", omega="12.0")
    monkeypatch.chdir(tmp_path / "b")
    for words in (("plan",), ("run", *SERIAL, "--out", "o")):
        assert main([words[0], str(job), *words[1:]]) == 2
        both = (tmp_path / "a" / "mine_code.py", tmp_path / "b" / "mine_code.py")
        refused(capsys.readouterr().err, *both)
    assert not Path("o").exists()
    # On the Python path too; the same text twice is no question.
    monkeypatch.chdir(tmp_path)
    sys.path.append(str(tmp_path / "b"))
    with pytest.raises(BadInput, match="two different files"):
        Sweep.load(job)
    shutil.copy(job.with_name("mine_code.py"), tmp_path / "b")
    sys.path[-1] = f"{tmp_path}/./b"
    assert Sweep.load(job).parameters.find("g") is not None


def test_a_file_of_data_that_differs_is_another_candidate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in "ab":
        job = write(tmp_path / name, before='W = np.load(HERE / "W.npy")', more="* W[0]")
        np.save(tmp_path / name / "W.npy", np.full(6, float(name == "a")))
    monkeypatch.chdir(tmp_path / "a")
    with pytest.raises(BadInput, match=r"two different files.*b/W.npy.*a/W.npy"):
        Sweep.load(job)


@pytest.mark.parametrize(
    ("before", "more"),
    [
        ("W = np.load(HERE / 'W.npy')", "* W[0]"),
        ("W = (3, (np.load(HERE / 'W.npy'), 4))", "* W[1][0][0]"),
        ("import mine_helper", "* mine_helper.W[0]"),
        ("import numba\nW = np.load(HERE / 'W.npy')\n@numba.njit\ndef f(): return W[0]", "* f()"),
        (
            "import numba\ndef make():\n    w = np.load(HERE / 'W.npy')\n    @numba.njit\n"
            "    def f(): return w[0]\n    return f\nf = make()",
            "* f()",
        ),
        ("W = float(np.load(HERE / 'W.npy')[0])", "* W"),
    ],
)
def test_what_the_functions_hold_is_recorded(tmp_path: Path, before: str, more: str) -> None:
    records = []
    for value in (1.0, 1.0, 2.0):
        place = tmp_path / f"{len(records)}"
        place.mkdir()
        (place / "mine_helper.py").write_text(
            "import numpy as np\nfrom pathlib import Path\n"
            "W = np.load(Path(__file__).parent / 'W.npy')\n"
        )
        np.save(place / "W.npy", np.full(6, value))
        records.append(model_source(Sweep.load(write(place, before=before, more=more))))
    assert records[0] == records[1]
    names = {line.split(":")[0] for line in differences(records[0], records[2])}
    assert "W.npy" in names
    assert len(names) > 1, "the value that was read is recorded, too"


def test_a_file_that_is_read_point_by_point_is_recorded(tmp_path: Path) -> None:
    options = "reals=lambda row, n: np.load(HERE / f\"W{int(row['seed'])}.npy\"),"
    job = write(tmp_path / "a", options=options)
    for k in range(2):
        np.save(tmp_path / "a" / f"W{k}.npy", np.ones(1))
    before = model_source(Sweep.load(job))
    np.save(tmp_path / "a" / "W1.npy", np.zeros(1))
    lines = differences(before, model_source(Sweep.load(job)))
    assert [line.split(":")[0] for line in lines] == ["W1.npy"]


def test_source_is_the_modules_that_are_imported_and_all_of_their_packages(tmp_path: Path) -> None:
    (tmp_path / "pack").mkdir()
    files = ["mine.py", "one.py", "pack/__init__.py", "pack/part.py"]
    for name in (*files, "other.py"):
        (tmp_path / name).write_text("import one, pack" if name == "mine.py" else "")
    found = source_files(tmp_path / "mine.py", "mine")
    assert [str(file.relative_to(tmp_path)) for file in found.code] == files


def test_held_values_of_any_object() -> None:
    weights = np.arange(4.0)

    class Kind:
        table = weights

        def build(self) -> float:
            return float(weights[0])

    one = held_values(Kind(), "")
    assert one == held_values(Kind(), "")
    weights[2] = 7.0
    changed = held_values(Kind(), "")
    assert {name for name in one if one[name] != changed[name]} >= {"Kind"}


def test_held_values_of_defaults_by_position_and_by_name() -> None:
    def with_defaults(first: float, second: float) -> object:
        def slope(x: float, a: float = first, *, b: float = second) -> float:
            return a * x + b

        class Kind:
            build = staticmethod(slope)

        return Kind()

    one, *others = (
        held_values(with_defaults(*x), "") for x in ((1.0, 2.0), (3.0, 2.0), (1.0, 4.0))
    )
    for other in others:
        assert {name for name in one if one[name] != other[name]}


def test_packages_that_a_model_imports_are_recorded_with_their_versions(tmp_path: Path) -> None:
    job = write(tmp_path / "a", before="def f():\n    import scipy.sparse")
    import scipy

    packages = model_source(Sweep.load(job))["model_packages"]
    assert packages == {"numpy": np.__version__, "scipy": scipy.__version__}


@pytest.mark.slow
def test_changed_weights_are_said_and_strictly_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job = write(tmp_path / "a", before="W = np.load(HERE / 'W.npy')", more="* W[0]")
    np.save(tmp_path / "a" / "W.npy", np.zeros(6))
    words = ["run", str(job), "--out", str(tmp_path / "o"), *SERIAL]
    assert main(words) == 0
    store = Store.open(tmp_path / "o" / "store.zarr")
    store.discard_block(1)
    np.save(tmp_path / "a" / "W.npy", np.ones(6))
    before = store.ledger()["digest"].tolist()
    edited()
    capsys.readouterr()
    assert main([*words, "--strict"]) == 2
    error = capsys.readouterr().err
    assert "Traceback" not in error
    refused(error.splitlines(True)[-1], "--strict", "W.npy", "mine_code.W: float64 (6,)")
    assert store.ledger()["digest"].tolist() == before
    assert main(words) == 0
    found = capsys.readouterr()
    assert "warning: run 1 had other mine_code.W: float64 (6,) " in found.out + found.err


@pytest.mark.slow
def test_a_store_is_read_without_its_module(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    job, out = write(tmp_path / "a"), tmp_path / "out"
    assert main(["run", str(job), "--out", str(out), *SERIAL]) == 0
    shutil.rmtree(tmp_path / "a")
    monkeypatch.setattr("chimera_hpc.job.user_models._import", lambda *_: 1 / 0)
    capsys.readouterr()
    store = Store.open(out / "store.zarr")
    assert store.sweep.parameters.find("g") is not None
    for words in (
        ("status", out),
        ("reduce", out, "--no-figures"),
        ("verify", out, "--stored"),
        ("export", out, "--to", tmp_path / "o.csv"),
        ("merge", out, out, "--out", tmp_path / "merged"),
    ):
        assert main([str(word) for word in words]) == 0, capsys.readouterr().err
    assert Store.open(tmp_path / "merged" / "store.zarr").n_points == 4


def test_parameters_without_a_column_have_the_type_of_their_value(tmp_path: Path) -> None:
    spec = {"model": "mine:MODEL", "fixed": {"k": 2, "g": 0.5}, "grid": {"h": [0.1, 0.2]}}
    root = {
        "attributes": {"spec": spec | {"integrator": {"form": "reduced"}}},
        "consolidated_metadata": {"metadata": {"ledger": {"attributes": {"coordinates": "seed"}}}},
    }
    table = stored_origin(tmp_path / "store.zarr", root).table
    assert table is not None
    found = [(p.name, p.kind, p.default) for p in table.parameters]
    assert found == [("k", int, 2), ("g", float, 0.5), ("h", float, None)]


def test_what_a_model_prints_goes_to_stderr(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job = write(tmp_path / "a", before="print('hello')", options="reals=reals,")
    module = job.with_name("mine_code.py")
    text = module.read_text().replace(
        "MODEL =", "def reals(row, n):\n    print('row')\n    return [0.0]\n\nMODEL ="
    )
    module.write_text(text)
    sweep = Sweep.load(job)
    build(sweep, sweep.points().row(0))
    found = capsys.readouterr()
    assert found.out == ""
    assert found.err == "hello\nrow\n"


@pytest.mark.parametrize(
    ("parts", "text"),
    [
        (
            {"initial": "lambda rng, row, n: np.random.uniform(-1, 1, (2, n))"},
            "draws another state when it is called again",
        ),
        (
            {"before": "W = np.random.rand(6)", "more": "* W[0]"},
            "not the same in another process: mine_hidden_1.W",
        ),
        (
            {
                "before": "K = hash('text') % 1000",
                "initial": "lambda rng, row, n: np.full((2, n), 1.0 + K)",
            },
            "not the same in another process: mine_hidden_2.K, the initial state",
        ),
    ],
)
def test_a_model_that_is_another_one_in_each_process_is_refused_by_plan(
    parts: dict[str, str], text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    number = 0 if "again" in text else int(text.partition("hidden_")[2][0])
    job = write(tmp_path / "a", f"mine_hidden_{number}", **parts)
    assert main(["plan", str(job)]) == 2
    refused(capsys.readouterr().err, text)


def test_the_other_process_sees_the_same(tmp_path: Path) -> None:
    assert main(["plan", str(write(tmp_path / "a", "mine_sound"))]) == 0
    sweep = Sweep.load(tmp_path / "a" / "job.toml")
    assert drawn(sweep, [0, 3]) == drawn(sweep, [0, 3])


def test_float32_is_the_default_of_an_own_model(tmp_path: Path) -> None:
    job = write(tmp_path / "a")
    assert Sweep.load(job).keep.dtype == "float32"
    assert Sweep.load(job, ["keep.dtype=int16"]).keep.dtype == "int16"
    data = Sweep.load(job, ["keep.dtype=int16"]).to_dict()
    assert json.loads(json.dumps(data))["keep"]["dtype"] == "int16"


@pytest.mark.slow
def test_a_series_that_does_not_fit_ends_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job = write(tmp_path / "a", size="25.0")
    words = ("run", str(job), "--out", str(tmp_path / "o"), *SERIAL)
    assert main([*words, "--set", "keep.dtype=int16"]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith("error: g=0.0 seed=0: u reaches 5.0")
    assert "int16 holds it up to 3.2767" in error
    assert 'set keep.dtype = "float32"' in error
    # Nothing of it is stored, and the same with float32 is well.
    store = Store.open(tmp_path / "o" / "store.zarr")
    assert (store.ledger()["status"] == 255).all()
    assert main(["run", str(job), "--out", str(tmp_path / "p"), *SERIAL]) == 0
    series = Store.open(tmp_path / "p" / "store.zarr").series(0)
    assert np.isfinite(series).all()
    assert series.max() == pytest.approx(5.0, rel=1e-3)


@pytest.mark.slow
def test_a_store_of_int16_goes_on_where_the_job_says_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job, out = write(tmp_path / "a"), str(tmp_path / "o")
    assert main(["run", str(job), "--out", out, *SERIAL, "--set", "keep.dtype=int16"]) == 0
    assert main(["run", str(job), "--out", out, *SERIAL]) == 0
    assert main(["extend", str(job), "--out", out, "--set", "seeds=3"]) == 0
    assert Store.open(Path(out) / "store.zarr").sweep.keep.dtype == "int16"
    capsys.readouterr()
    assert main(["run", str(job), "--out", out, *SERIAL, "--set", "keep.dtype=float32"]) == 2
    assert "keep may not change" in capsys.readouterr().err


def test_a_sweep_of_one_point_is_drawn_twice_too(tmp_path: Path) -> None:
    job = write(tmp_path)
    check_in_second_process(Sweep.load(job, ["seeds=1", "g=0.1"]))


@pytest.mark.slow
def test_modules_of_the_current_folder_shadow_no_library(tmp_path: Path) -> None:
    for name in ("numpy", "json", "socket", "typing", "zarr", "colorsys", "numba"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('not the library')\n")
    done = run(tmp_path, "run", write(tmp_path), "--out", "o", "--workers", "1", "--no-figures")
    assert done.returncode == 0, done.stderr
    assert "4 of 4 points run" in done.stdout
