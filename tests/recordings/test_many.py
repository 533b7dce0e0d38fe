"""Many recordings: found, clustered among themselves, judged by an atlas, in all formats."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from chimera_hpc import classify_recordings
from chimera_hpc.base.errors import BadInput
from chimera_hpc.classify.agreement import adjusted_rand
from chimera_hpc.recordings import Choice, read_recording
from chimera_hpc.recordings.many import recording_files
from chimera_hpc.sweep import main

Array = NDArray[np.float64]
T = 0.02 * np.arange(1000)
N = 16


def kind_of_ring(kind: int, rng: np.random.Generator, n: int = N) -> Array:
    """A wave, a wave next to drifting nodes of all sizes, or random phases; with noise.

    3 and 4 differ from these in their phases only: half a wave, and neighbours in antiphase.
    """
    half = n // 2
    phase = 2 * np.pi * np.arange(n) / n + rng.normal(scale=0.05, size=n)
    speed, size = np.ones(n), np.ones(n)
    if kind == 1:
        phase[half:] = rng.uniform(-np.pi, np.pi, half)
        speed[half:] += rng.uniform(0.05, 0.4, half)
        size[half:] = rng.uniform(0.5, 1.5, half)
    elif kind == 2:
        phase = rng.uniform(-np.pi, np.pi, n)
    elif kind == 3:
        phase[half:] = rng.uniform(-np.pi, np.pi, half)
    elif kind == 4:
        phase = rng.normal(scale=0.05, size=n) + np.pi * (np.arange(n) % 2)
    noise = 0.02 * rng.normal(size=(len(T), n))
    return size * np.cos(2 * np.pi * speed * T[:, None] + phase) + noise


def write(folder: Path, kinds: list[int], seed: int = 7) -> list[Path]:
    rng = np.random.default_rng(seed)
    folder.mkdir(exist_ok=True)
    files = [folder / f"{i:03d}-{kind}.npz" for i, kind in enumerate(kinds)]
    for file, kind in zip(files, kinds, strict=True):
        np.savez(file, t=T, u=kind_of_ring(kind, rng))
    return files


def test_forty_recordings_of_three_kinds_are_three_classes(tmp_path: Path) -> None:
    files = write(tmp_path / "rings", [i % 3 for i in range(40)])
    found = classify_recordings(tmp_path / "rings")
    kinds = [file.stem[-1] for file in files]
    assert adjusted_rand(found["class"].values.tolist(), kinds) == 1.0
    assert found.sentence.startswith("40 of 40 recordings look like 3 classes (gap ")
    assert set(found["class"].values) == {"A", "B", "C"}
    assert found.recording.values.tolist() == list(map(str, files))
    assert found.value.dims == ("recording", "quantity")
    assert found.value.sel(quantity="frequency").values[::3] == pytest.approx(1.0, abs=0.03)
    assert float(found.confidence.min()) >= 0.0
    assert float(found.confidence.median()) > 0.6


@pytest.mark.parametrize("three", [(0, 3, 2), (0, 4, 2)])
def test_kinds_that_differ_in_phase_only_are_found(three: tuple[int, ...], tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    kinds = [three[i % 3] for i in range(40)]
    for i, kind in enumerate(kinds):
        np.savez(tmp_path / f"{i:02d}.npz", t=T, u=kind_of_ring(kind, rng, 50))
    found = classify_recordings(tmp_path)
    assert found.sentence.startswith("40 of 40 recordings look like 3 classes")
    assert adjusted_rand(found["class"].values.tolist(), kinds) > 0.9


def test_recordings_of_one_kind_are_one_class(tmp_path: Path) -> None:
    found = classify_recordings(write(tmp_path, [2] * 14))
    assert found.sentence.startswith("14 of 14 recordings look like one state (gap ")
    assert set(found["class"].values) == {"A"}
    assert np.isnan(found.confidence.values).all()


def test_few_recordings_are_one_class_unless_told(tmp_path: Path) -> None:
    files = write(tmp_path, [0, 0, 0, 1])
    np.savez(tmp_path / "still.npz", t=T, u=np.zeros((len(T), N)))
    found = classify_recordings(tmp_path, clusters=2)
    assert found["class"].values.tolist() == ["A", "A", "A", "B", "steady"]
    assert found.status.values.tolist() == ["done"] * 4 + ["steady"]
    few = classify_recordings(files)
    assert few.sentence == (
        "4 oscillating recordings are too few to count classes: 10 are needed, or --clusters N"
    )
    with pytest.raises(BadInput, match="--clusters 5: 4 of 5 recordings oscillate"):
        classify_recordings(tmp_path, clusters=5)


def test_variations_over_the_links_of_a_network(tmp_path: Path) -> None:
    (file,) = write(tmp_path, [2])
    ring, chain = tmp_path / "ring.csv", tmp_path / "two.csv"
    ring.write_text("".join(f"{i},{(i + 1) % N}\n" for i in range(N)))
    chain.write_text("0,1\n1,2\n")
    over_links = classify_recordings(file, links=ring).value.values
    np.testing.assert_allclose(over_links, classify_recordings(file).value.values, rtol=1e-12)
    with pytest.raises(BadInput, match=r"two.csv: a network of 3 nodes; the recording has 16"):
        classify_recordings(file, links=chain)


def test_files_are_found_in_folders_and_by_patterns(tmp_path: Path) -> None:
    files = write(tmp_path / "a", [0, 1])
    (tmp_path / "a" / ".hidden.npz").touch()
    (tmp_path / "a" / "notes.md").touch()
    left = [f"{tmp_path / 'a'}: file notes.md left out: no recordings"]
    assert recording_files([tmp_path / "a"]) == (files, left)
    again = tmp_path / "b" / ".." / "a" / files[0].name
    words: list[str | Path] = [f"{tmp_path}/a/*-1.npz", files[1], files[0], again]
    assert recording_files(words) == ([files[1], files[0]], [])
    links = tmp_path / "a" / "ring.csv"
    links.touch()
    for word in (tmp_path / "a", f"{tmp_path}/a/*[0-9g].*"):
        found = recording_files([word], [links])
        assert found.files == files
        assert "ring.csv left out" in found.left_out[0]
    assert recording_files([links], [links]).files == [links]
    deeper = r"no recording in this folder; '.*/\*/\*' names those in its folders"
    for wrong, said in ((f"{tmp_path}/*.csv", "no file matches"), (tmp_path, deeper)):
        with pytest.raises(BadInput, match=said):
            recording_files([wrong])


def test_what_speaks_against_a_comparison_is_said(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    u, few = kind_of_ring(1, rng), kind_of_ring(1, rng, 6)
    saved = {"a": (T, u), "b": (T, u), "c": (T, few), "d": (1e3 * T, 1e-3 * u[:, ::-1])}
    saved |= {"e": (T, 0 * u), "f": (T, 0 * u)}
    for name, (t, signals) in saved.items():
        np.savez(tmp_path / f"{name}.npz", t=t, u=signals)
    (tmp_path / "notes.md").touch()
    a, b, c, d = (str(tmp_path / f"{name}.npz") for name in "abcd")
    left, copy, nodes, step, frequency, amplitude = classify_recordings(tmp_path).warnings
    assert left == f"{tmp_path}: file notes.md left out: no recordings"
    assert copy == f"{b}: the same values as {a}; it counts twice"
    assert nodes.startswith(f"6 ({c}) to 16 nodes ({a}): along a smooth state, neighbours differ")
    assert step == (
        f"sampling steps of 0.02 ({a}) to 20 ({d}): other units of time? Noise makes more false "
        "maxima and larger variations the finer the step; --lowpass F damps it in all"
    )
    assert f"({d}) to " in frequency
    assert frequency.endswith("V_Omega has the unit of frequency; classify files of each unit "
                              "by themselves")  # fmt: skip
    assert amplitude.startswith("median amplitude of 0.00")
    assert f" ({d}) to 0.9" in amplitude or f" ({d}) to 1" in amplitude
    assert classify_recordings([a, tmp_path / "e.npz", tmp_path / "f.npz"]).warnings == []


def test_other_sampling_and_other_durations_are_said(tmp_path: Path) -> None:
    t = 0.02 * np.arange(3000)
    u = np.cos(2 * np.pi * (t[:, None] + np.arange(N) / N))
    files = [str(tmp_path / name) for name in ("all.npz", "fifth.npz", "short.npz")]
    for file, part in zip(files, np.s_[:, ::5, :600], strict=True):
        np.savez(file, t=t[part], u=u[part])
    every, fifth, short = files
    (step,) = classify_recordings([every, fifth]).warnings
    assert step.startswith(f"sampling steps of 0.02 ({every}) to 0.1 ({fifth}): other units")
    (periods,) = classify_recordings([every, short]).warnings
    assert periods.startswith(f"periods: 12 ({short}) to 59.8 ({every}): variations over few")


@pytest.mark.parametrize(("one", "other"), [("time (ms)", "time [s]"), ("t_min", "seconds")])
def test_units_of_time_are_not_mixed_in_silence(tmp_path: Path, one: str, other: str) -> None:
    u = kind_of_ring(0, np.random.default_rng(7))
    files = [str(tmp_path / name) for name in ("a.csv", "b.csv", "c.csv")]
    for i, (file, time) in enumerate(zip(files, (one, other, "time"), strict=True)):
        head = ",".join([time, *(f"ch{j}" for j in range(N))])
        rows = np.column_stack([T, np.roll(u, i, axis=1)])
        np.savetxt(file, rows, delimiter=",", header=head, comments="", fmt="%.6g")
    units = {"time (ms)": "ms", "t_min": "min"}[one]
    (said,) = classify_recordings(files).warnings
    assert said.startswith(f"times in {units} ({files[0]}) and s ({files[1]}), taken as they are")
    assert classify_recordings(files[1:]).warnings == []


def test_one_file_of_many_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    write(tmp_path, [0, 1])
    (tmp_path / "000-junk.csv").write_text("a note, no numbers\n")
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(BadInput, match=r"pipe.csv: a pipe or a device, no file"):
        classify_recordings(tmp_path / "pipe.csv")
    with pytest.raises(BadInput, match=r"-junk.csv: has no line .* \(file 2 of 4; none is class"):
        classify_recordings(tmp_path)


@pytest.mark.slow
def test_command_prints_one_table_and_draws_one_sheet(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path / "in", [0, 0, 0, 1])
    words = ["classify", str(tmp_path / "in"), "--clusters", "2", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    head, *rows, sentence, written = capsys.readouterr().out.splitlines()
    assert head.split() == [
        "file",
        "nodes",
        "samples",
        "V_theta",
        "V_a",
        "V_Omega",
        "class",
        "confidence",
    ]
    names = [row.split()[-2] for row in rows if not row.startswith("warning: ")]
    assert names == ["A", "A", "A", "B"]
    assert sentence == "4 of 4 recordings oscillate"
    assert written == f"written: {tmp_path / 'out' / 'recordings.png'}"
    assert main([*words, "--json", "--no-figures"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [one["class"] for one in found["recordings"]] == ["A", "A", "A", "B"]
    assert found["classes"] == {"A": 3, "B": 1}
    assert found["figures"] == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--clusters", "0"), "from 1 on, or auto, is needed"),
        (("--clusters", "2", "--atlas", "x"), "--clusters and --atlas: one of them"),
        (("--links", "x", "--open"), "--links and --open: one of them"),
        (("--links", "x.csv"), "x.csv: No such file or directory"),
    ],
)
def test_contradictions_are_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], said: str
) -> None:
    files = write(tmp_path, [0, 0])
    try:
        code = main(["classify", *map(str, files), *words, "--no-figures"])
    except SystemExit as stop:
        code = int(stop.code or 0)
    out, err = capsys.readouterr()
    assert code == 2
    assert out == ""
    assert said in err.splitlines()[-1]


@pytest.mark.parametrize("ending", [".nc", ".mat", ".h5", ".edf", ".npz", ".csv.gz"])
def test_damaged_files_are_refused_in_one_line(tmp_path: Path, ending: str) -> None:
    heads = {
        ".nc": b"CDF\1",
        ".mat": b"MATLAB 5.0".ljust(124) + b"\0\1IM",
        ".edf": b"0".ljust(300),
        ".h5": b"\x89HDF\r\n\x1a\n",
        ".npz": b"PK\3\4",
        ".csv.gz": b"\x1f\x8b\x08",
    }
    file = tmp_path / f"a{ending}"
    rng = np.random.default_rng(0)
    for _ in range(20):
        file.write_bytes(heads[ending] + rng.bytes(200))
        with pytest.raises(BadInput, match=r"^.*/a\.[a-z0-9.]+: [^\n]+$"):
            read_recording(file, Choice())


def test_names_that_are_no_text_are_printed_and_drawn(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (file,) = write(tmp_path, [0])
    name = os.fsdecode(b"b \xff$\n.npz")
    file.rename(tmp_path / name)
    assert main(["classify", str(tmp_path), "--out", str(tmp_path / "out")]) == 0
    assert "b \\udcff$\\n.npz  16" in capfd.readouterr().out
    assert (tmp_path / "out" / "recordings.png").exists()


def as_edf(edfio: object, file: Path, u: Array) -> None:
    signals = [
        edfio.EdfSignal(column, sampling_frequency=50, label=f"ch{i}")  # type: ignore[attr-defined]
        for i, column in enumerate(u.T)
    ]
    edfio.Edf(signals).write(file)  # type: ignore[attr-defined]


def test_signals_of_an_edf_file_that_differ_are_said(tmp_path: Path) -> None:
    edfio = pytest.importorskip("edfio")
    u = kind_of_ring(1, np.random.default_rng(0), 4)
    signals = [
        edfio.EdfSignal(column, 50, label=f"ch{i}", physical_dimension="uV" if i else "mV")
        for i, column in enumerate(u.T)
    ]
    edfio.Edf([*signals, edfio.EdfSignal(u[::5, 0], 10, label="breath")]).write(tmp_path / "a.edf")
    made = read_recording(tmp_path / "a.edf", Choice())
    assert made.names == ("ch0", "ch1", "ch2", "ch3")
    assert made.warnings == (
        "signal breath: fewer samples per second, left out",
        "signals have different units: mV, uV",
    )


def as_bdf(edfio: object, file: Path, u: Array) -> None:
    signals = [
        edfio.BdfSignal(column, sampling_frequency=50, label=f"ch{i}")  # type: ignore[attr-defined]
        for i, column in enumerate(u.T)
    ]
    edfio.Bdf(signals).write(file)  # type: ignore[attr-defined]


@pytest.mark.parametrize(("ending", "make"), [(".edf", as_edf), (".bdf", as_bdf)])
def test_edf_and_bdf(tmp_path: Path, ending: str, make: Callable[..., None]) -> None:
    edfio = pytest.importorskip("edfio")
    u = kind_of_ring(1, np.random.default_rng(0))
    np.savez(tmp_path / "a.npz", t=T, u=u)
    make(edfio, tmp_path / f"b{ending}", u)
    plain, read = classify_recordings([tmp_path / "a.npz", tmp_path / f"b{ending}"]).value.values
    np.testing.assert_allclose(read, plain, rtol=2e-3, atol=1e-3)
    (tmp_path / f"c{ending}").write_bytes(b"0       no header")
    with pytest.raises(BadInput, match=f"c{ending}: can't be read"):
        classify_recordings(tmp_path / f"c{ending}")


@pytest.mark.parametrize("ending", [".h5", ".mat"])
def test_hdf5_and_matlab_7_3(tmp_path: Path, ending: str) -> None:
    h5py = pytest.importorskip("h5py")
    u = kind_of_ring(1, np.random.default_rng(0))
    np.savez(tmp_path / "a.npz", t=T, u=u)
    with h5py.File(tmp_path / f"b{ending}", "w", userblock_size=512) as file:
        file["rec/u"] = u.T if ending == ".mat" else u
        file["rec/time"] = T
        file["note"] = "no numbers"
    if ending == ".mat":
        head = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
        with (tmp_path / "b.mat").open("r+b") as raw:
            raw.write(head)
    plain, read = classify_recordings([tmp_path / "a.npz", tmp_path / f"b{ending}"]).value.values
    np.testing.assert_array_equal(read, plain)


@pytest.mark.parametrize(
    ("ending", "package"), [(".h5", "h5py"), (".edf", "edfio"), (".bdf", "edfio")]
)
def test_missing_packages_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str, package: str
) -> None:
    monkeypatch.setitem(__import__("sys").modules, package, None)
    (tmp_path / f"a{ending}").touch()
    with pytest.raises(BadInput, match=f"needs the package {package}: python -m pip install"):
        classify_recordings(tmp_path / f"a{ending}")
