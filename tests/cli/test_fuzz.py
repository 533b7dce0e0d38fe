"""Bad input by the thousand, through the command line: never a traceback, never a partial store."""

from __future__ import annotations

import contextlib
import io
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job.models import built_in
from chimera_hpc.job.tables import TABLES
from chimera_hpc.reduction.results import read_results
from chimera_hpc.store.ledger import FIELDS, seal
from chimera_hpc.sweep import main

QUICKSTART = (Path(__file__).resolve().parents[2] / "jobs" / "quickstart.toml").read_text()
MANY = settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])

KEYS = sorted(
    {"name", "title", "model", "seeds", "delta", "n_nodes", *TABLES, "grid", "fixed"}
    | {key for table in TABLES.values() for key in table.model_fields}
    | {p.name for model in built_in().values() for p in model.parameters}
)
WORDS = [
    *built_in(),
    "json:loads",
    "no.such:thing",
    "P",
    "0:P",
    "3:8",
    "1:0",
    "auto",
    "none",
    "2",
    "-1",
]
leaves = (
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.sampled_from(WORDS)
)
values = st.recursive(
    leaves,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(KEYS) | st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=8,
)
overrides = st.text() | st.builds(
    lambda table, key, value: f"{table}{key}={value}",
    st.sampled_from(["", *(f"{name}." for name in (*TABLES, "grid", "fixed", "slurm"))]),
    st.sampled_from(KEYS) | st.text(max_size=5),
    st.sampled_from(WORDS) | st.floats().map(str) | values.map(repr),
)


def call(*words: object) -> tuple[int, str]:
    """Run a command line in this process; return its exit status and what it said on stderr."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main([str(word) for word in words])
        except SystemExit as stop:
            # argparse ends the process itself.
            return int(str(stop.code)), err.getvalue()
    return code, err.getvalue()


def is_clean(code: int, said: str, allowed: tuple[int, ...] = (0, 2)) -> bool:
    """Whether a command ended as it may: bad input is one line that can be printed."""
    if code == 2:
        return said.startswith("error: ") and said.endswith("\n") and said[:-1].isprintable()
    return code in allowed


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "work").mkdir()
    return tmp_path / "work"


def refused_without_a_trace(folder: Path, *words: object) -> bool:
    """Plan; what `plan` refuses `run` must refuse in the same words, and write nothing."""
    planned = call("plan", *words)
    if planned[0] == 0:
        return True
    before = sorted(folder.rglob("*"))
    ran = call("run", *words, "--out", folder / "out", "--cluster", "serial")
    return is_clean(*planned) and ran[0] == 2 and sorted(folder.rglob("*")) == before


@MANY
@given(st.binary(max_size=300) | st.text(max_size=300).map(lambda text: text.encode()))
@example(b"")
@example(b"\xff\xfe")
@example(b'name = "x"\nmodel = "os:system"\n')
def test_any_bytes_as_a_job(folder: Path, data: bytes) -> None:
    (folder / "job.toml").write_bytes(data)
    assert refused_without_a_trace(folder, folder / "job.toml")


@pytest.mark.slow
@MANY
@given(st.data())
def test_any_damaged_job(folder: Path, choose: st.DataObject) -> None:
    lines = QUICKSTART.splitlines()
    for _ in range(choose.draw(st.integers(1, 3))):
        i = choose.draw(st.integers(0, len(lines) - 1))
        key = lines[i].partition("=")[0]
        lines[i] = choose.draw(
            st.sampled_from(["", lines[i][: len(lines[i]) // 2], lines[i] * 2])
            | st.builds(lambda value, key=key: f"{key}= {json.dumps(value)}", values)
            | st.text(max_size=20)
        )
    # A lone half of a surrogate pair can be typed, but not be encoded.
    (folder / "job.toml").write_text("\n".join(lines), encoding="utf-8", errors="replace")
    assert refused_without_a_trace(folder, folder / "job.toml")


@MANY
@given(st.lists(overrides, min_size=1, max_size=3))
@example(["seeds=99999999999"])
@example(["model=json:loads"])
@example(["name=../up"])
def test_any_setting(folder: Path, settings: list[str]) -> None:
    (folder / "job.toml").write_text(QUICKSTART)
    words = [word for setting in settings for word in ("--set", setting)]
    assert refused_without_a_trace(folder, folder / "job.toml", *words)


def paths(node: Any, here: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the way to each value in a JSON document."""
    yield here
    if isinstance(node, dict | list):
        for key, value in node.items() if isinstance(node, dict) else enumerate(node):
            yield from paths(value, (*here, key))


def spoilt(choose: st.DataObject, text: bytes) -> bytes:
    """Return a JSON document with one value changed or gone, or with other bytes."""
    kind = choose.draw(st.sampled_from(["value", "value", "gone", "cut", "byte"]))
    if kind == "cut":
        return text[: choose.draw(st.integers(0, len(text) - 1))]
    if kind == "byte":
        i = choose.draw(st.integers(0, len(text) - 1))
        return text[:i] + choose.draw(st.binary(min_size=1, max_size=1)) + text[i + 1 :]
    document = json.loads(text)
    way = choose.draw(st.sampled_from(list(paths(document))[1:]))
    node = document
    for key in way[:-1]:
        node = node[key]
    if kind == "gone":
        del node[way[-1]]
    else:
        node[way[-1]] = choose.draw(values)
    return json.dumps(document).encode()


COMMANDS = [
    ("status", "{}", "--json"),
    ("status", "{}", "--failures"),
    ("why", "{}", "P=3", "seed=1"),
    ("verify", "{}", "--stored"),
    ("reduce", "{}", "--no-figures"),
    ("export", "{}", "--to", "{}/table.csv"),
    ("retry", "{}", "--cluster", "serial", "--no-figures"),
    ("extend", "{}/../job.toml", "--set", "seeds=6", "--out", "{}"),
    ("merge", "{}", "{}", "--out", "{}/merged"),
    ("run", "{}/../job.toml", "--out", "{}", "--cluster", "serial", "--no-figures"),
]


@pytest.mark.slow
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_any_damage_to_the_attributes_of_a_store(
    job: Path, finished: Path, choose: st.DataObject
) -> None:
    folder, copied = restored(finished), choose.draw(st.sampled_from([True, False, False]))
    root = folder / "store.zarr" / "zarr.json"
    root.write_bytes(spoilt(choose, root.read_bytes()))
    if not copied:
        root.with_name("zarr.json.copy").unlink()
    command = choose.draw(st.sampled_from(COMMANDS))
    code, said = call(*(word.replace("{}", str(folder)) for word in command))
    assert is_clean(code, said, (0, 1, 2))
    if copied:
        assert code == 0
    assert not list(folder.glob(".*.partial"))


def restored(finished: Path) -> Path:
    """Return the folder as it was before the example that went before."""
    sound = finished.parent / "sound"
    if not sound.exists():
        shutil.copytree(finished, sound)
    shutil.rmtree(finished)
    return shutil.copytree(sound, finished)


FEW = settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
LOOKS = [
    ("status", "{}", "--json"),
    ("status", "{}", "--failures"),
    ("why", "{}", "P=2"),
    ("verify", "{}", "--stored"),
]
chunks = st.binary(max_size=300) | st.lists(
    st.sampled_from([0, 1, 2, 3, 4, 9, 10, 255, 256]) | st.integers(-(2**63), 2**63 - 1),
    min_size=28,
    max_size=28,
).map(lambda numbers: seal(np.array(numbers, dtype="<i8").tobytes()))


@FEW
@given(chunks, st.sampled_from(LOOKS))
@example(seal(np.full(28, 2**40, dtype="<i8").tobytes()), LOOKS[0])
@example(seal(np.full(28, -1, dtype="<i8").tobytes()), LOOKS[2])
def test_any_bytes_as_a_ledger_chunk(finished: Path, data: bytes, command: tuple[str, ...]) -> None:
    (finished / "store.zarr" / "ledger" / "c.0.0").write_bytes(data)
    code, said = call(*(word.replace("{}", str(finished)) for word in command))
    assert is_clean(code, said, (0, 1, 75))


@pytest.mark.slow
@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(chunks)
def test_any_ledger_chunk_is_mended_by_run(job: Path, finished: Path, data: bytes) -> None:
    ledger = restored(finished) / "store.zarr" / "ledger"
    known = [path.read_bytes() for path in sorted(ledger.glob("c.*"))]
    (ledger / "c.0.0").write_bytes(data)
    words = ("--cluster", "serial", "--no-figures")
    assert call("verify", finished, "--stored", "--forget")[0] in (0, 1)
    assert call("run", job, "--out", finished, *words)[0] == 0
    assert call("verify", finished, "--stored")[0] == 0
    mended = [path.read_bytes() for path in sorted(ledger.glob("c.*"))]
    assert mended[1:] == known[1:]
    digest = FIELDS.index("digest")
    rows = [np.frombuffer(chunk[:-4], "<i8").reshape(4, -1) for chunk in (mended[0], known[0])]
    assert rows[0][:, digest].tolist() == rows[1][:, digest].tolist()


@FEW
@given(st.data())
def test_any_damage_to_the_record_of_a_run(finished: Path, choose: st.DataObject) -> None:
    name = choose.draw(st.sampled_from(["1.json", "1.work.json"]))
    file = finished / "store.zarr" / "runs" / name
    sound = file.read_bytes()
    look = choose.draw(st.sampled_from([("why", "P=3", "seed=1"), ("verify", "--sample", "0.1")]))
    try:
        file.write_bytes(spoilt(choose, sound))
        assert is_clean(*call(look[0], finished, *look[1:]), (0,))
    finally:
        file.write_bytes(sound)


@MANY
@given(st.data())
def test_any_damage_to_results_json(folder: Path, choose: st.DataObject) -> None:
    text = json.dumps(
        {
            "schema": 1,
            "sweep": "x",
            "points": dict.fromkeys(
                ("total", "done", "steady", "no_window", "failed", "pending"), 3
            ),
            "cuts": {
                "3": {
                    "clusters": [{"name": "ordered", "size": 3, "centroid": {"V_a": 0.1}}],
                    "cells": [{"P": 3, "class": "ordered", "votes": {"ordered": 3}}],
                }
            },
            "curves": {},
            "claims": [],
        }
    ).encode()
    file = folder / "results.json"
    file.write_bytes(choose.draw(st.just(spoilt(choose, text)) | st.binary(max_size=50)))
    found: Any = None
    message = "fine"
    try:
        found = read_results(file)
    except BadInput as error:
        message = str(error)
    assert message.isprintable()
    if found is not None:
        assert isinstance(found["points"]["pending"], int)
        for cut in found["cuts"].values():
            assert sum(sum(cell["votes"].values()) for cell in cut["cells"]) >= 0
