"""Files of recordings: what is read, and what is refused."""

from __future__ import annotations

import gzip
import pickle
from pathlib import Path

import numpy as np
import pytest

from chimera_hpc.base.errors import BadInput
from chimera_hpc.recordings.read import read_recording
from chimera_hpc.recordings.recording import Choice, Recording

T = np.array([0.0, 0.5, 1.0, 1.5])
U = np.arange(12.0).reshape(4, 3)


def read(path: Path, **choice: object) -> Recording:
    return read_recording(path, Choice(**choice))


def test_npy_has_no_times_and_rows_are_times(tmp_path: Path):
    np.save(tmp_path / "u.npy", U.astype(np.int16))
    found = read(tmp_path / "u.npy")
    assert found.t is None
    assert found.u.tolist() == U.tolist()
    assert found.names == ("0", "1", "2")
    assert read(tmp_path / "u.npy", transpose=True).u.tolist() == U.T.tolist()


def test_npz_without_times_or_with_times_left_out_has_none(tmp_path: Path):
    np.savez(tmp_path / "u.npz", u=U)
    assert read(tmp_path / "u.npz").t is None
    np.savez(tmp_path / "timed.npz", u=U, time=T)
    assert read(tmp_path / "timed.npz", no_times=True).t is None


def test_npz_takes_the_only_matrix_and_turns_it_by_the_number_of_times(tmp_path: Path):
    np.savez(tmp_path / "u.npz", anything=U.T, time=T, note=np.array(3))
    found = read(tmp_path / "u.npz")
    assert found.u.tolist() == U.tolist()
    assert found.t is not None
    assert found.t.tolist() == T.tolist()
    assert "rows are nodes: 3 nodes, 4 times" in found.notes


def test_npz_with_two_matrices_asks_which(tmp_path: Path):
    np.savez(tmp_path / "u.npz", a=U, b=U + 1, t=T)
    with pytest.raises(BadInput, match=r"which array: a, b\? --variable NAME says it"):
        read(tmp_path / "u.npz")
    assert read(tmp_path / "u.npz", variable="b").u[0, 0] == 1.0


@pytest.mark.parametrize("name", ["u.npy", "u.npz"])
def test_pickled_objects_are_refused_and_not_loaded(name: str, tmp_path: Path):
    class Trap:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "sprung",))

    values = np.array([Trap(), None], dtype=object)
    if name == "u.npy":
        np.save(tmp_path / name, values, allow_pickle=True)
    else:
        np.savez(tmp_path / name, u=values)
    with pytest.raises(BadInput, match="holds pickled objects"):
        read(tmp_path / name)
    # A pickle under the name of an array is none either.
    (tmp_path / "v.npy").write_bytes(pickle.dumps(Trap()))
    with pytest.raises(BadInput, match="pickled objects are not read"):
        read(tmp_path / "v.npy")
    assert not (tmp_path / "sprung").exists()


@pytest.mark.parametrize(
    ("text", "times", "names"),
    [
        ("time,a,b\n0,1,2\n0.5,3,4\n1,5,6\n", [0, 0.5, 1], ("a", "b")),
        ("# made by hand\na\ttime (s)\tb\n1\t0\t2\n3\t0.5\t4\n5\t1\t6\n", [0, 0.5, 1], ("a", "b")),
        ("0;1;2\n0,5;3;4\n1,0;5;6\n", [0, 0.5, 1], ("0", "1")),
        ("0 1 2\n0.5 3 4\n1 5 6\n", [0, 0.5, 1], ("0", "1")),
        ("a,b\n1,2\n3,4\n5,6\n", None, ("a", "b")),
        ("\ufeffdate,a,b\n2026-01-01 00:00:00,1,2\n2026-01-01 00:00:30,3,4\n"
         "2026-01-01 00:01:00,5,6\n", [0, 30, 60], ("a", "b")),
    ],
)  # fmt: skip
def test_tables_are_read_with_their_times_and_names(
    text: str, times: list[float] | None, names: tuple[str, ...], tmp_path: Path
):
    (tmp_path / "u.csv").write_text(text, encoding="utf-8")
    found = read(tmp_path / "u.csv")
    assert found.u.tolist() == [[1, 2], [3, 4], [5, 6]]
    assert found.names == names
    assert (None if found.t is None else found.t.tolist()) == times


def test_holes_in_a_table_are_missing_values(tmp_path: Path):
    (tmp_path / "u.csv").write_text("t,a,b\n0,1,\n1,NaN,4\n2,5,inf\n3,7,8\n")
    found = read(tmp_path / "u.csv")
    assert np.isnan(found.u).tolist() == [[0, 1], [1, 0], [0, 1], [0, 0]]


def test_column_of_times_can_be_named_or_denied(tmp_path: Path):
    (tmp_path / "u.csv").write_text("a,clock,b\n1,0,2\n3,1,4\n")
    assert read(tmp_path / "u.csv", time="clock").names == ("a", "b")
    (tmp_path / "v.csv").write_text("1.5,7\n2,5\n2.5,6\n")
    assert read(tmp_path / "v.csv").u.shape == (3, 1)
    with pytest.raises(BadInput, match="column 0 holds times: leave --step out, or --drop 0"):
        read(tmp_path / "v.csv", no_times=True)


def test_labelled_arrays_are_turned_and_cut_by_the_names_of_their_dimensions(tmp_path: Path):
    import xarray as xr

    trials = np.stack([U, U + 100.0])
    data = xr.Dataset(
        {"volt": (("trial", "channel", "time"), trials.transpose(0, 2, 1))},
        coords={"time": T, "channel": [10, 20, 30]},
    )
    data.to_netcdf(tmp_path / "u.nc", engine="scipy")
    with pytest.raises(BadInput, match=r"the file has volt; --variable NAME and --select"):
        read(tmp_path / "u.nc")
    found = read(tmp_path / "u.nc", select=(("trial", 1),))
    assert found.u.tolist() == (U + 100.0).tolist()
    assert found.names == ("10", "20", "30")
    with pytest.raises(BadInput, match=r"its dimensions are trial \(2\)"):
        read(tmp_path / "u.nc", select=(("trial", 2),))


def test_dates_become_seconds(tmp_path: Path):
    import xarray as xr

    dates = np.datetime64("2026-01-01") + np.arange(4) * np.timedelta64(250, "ms")
    data = xr.Dataset({"u": (("when", "node"), U)}, coords={"when": dates})
    data.to_netcdf(tmp_path / "u.nc", engine="scipy")
    found = read(tmp_path / "u.nc")
    assert found.t is not None
    assert found.t.tolist() == [0.0, 0.25, 0.5, 0.75]


def test_zarr_store_is_read(tmp_path: Path):
    from store_tools import fill, make_store

    store = fill(make_store(tmp_path))
    found = read(tmp_path, select=(("point", 4),))
    assert found.u.tolist() == store.series(4).tolist()
    assert found.t is not None
    assert found.t[0] == 10.0


@pytest.mark.parametrize(
    ("name", "contents", "said"),
    [
        ("u.xyz", b"", "allowed are .npz, .npy, .csv"),
        ("u.csv", b"", "is empty"),
        ("u.csv", b"a,b\n", "no line of numbers"),
        ("u.csv", b"t,a\n0,1\n1,one\n", "column a: 'one' is not a number"),
        ("u.csv", b"\xff\xfe\x00", "can't be read"),
        ("u.csv", b"1,2\n3,4,5,6\n7,8\n", "can't be read as a table"),
        ("u.npy", b"rubbish", "is no file of NumPy arrays"),
        ("u.npz", b"PK rubbish", ""),
        ("u.nc", b"\x89HDF\r\n\x1a\nrubbish", ""),
        ("u.nc", b"rubbish", ""),
    ],
)
def test_broken_files_are_refused_on_one_line(
    name: str, contents: bytes, said: str, tmp_path: Path
):
    (tmp_path / name).write_bytes(contents)
    with pytest.raises(BadInput) as caught:
        read(tmp_path / name)
    assert said in str(caught.value)
    assert str(tmp_path / name) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_folder_and_missing_file_are_refused(tmp_path: Path):
    with pytest.raises(BadInput, match="no Zarr store"):
        read(tmp_path)
    with pytest.raises(BadInput, match="no such file"):
        read(tmp_path / "none.npy")


@pytest.mark.parametrize(
    "values",
    [np.zeros(5), np.zeros((2, 2, 2)), np.zeros((3, 2), complex), np.array([["a", "b"]])],
)
def test_arrays_of_other_shapes_and_types_are_refused(values: np.ndarray, tmp_path: Path):
    np.save(tmp_path / "u.npy", values)
    with pytest.raises(BadInput, match=r"is needed|are not real numbers"):
        read(tmp_path / "u.npy")


def test_matlab_file_is_read_by_the_names_of_its_arrays(tmp_path: Path):
    from scipy.io import savemat

    savemat(tmp_path / "u.mat", {"signal": U.T, "time": T[:, None], "gain": 2.0, "note": "by hand"})
    found = read(tmp_path / "u.mat")
    assert found.u.tolist() == U.tolist()
    assert found.t is not None
    assert found.t.tolist() == T.tolist()
    assert "signals: array signal" in found.notes


def test_compressed_table_is_the_table(tmp_path: Path):
    (tmp_path / "u.csv.gz").write_bytes(gzip.compress(b"time,a,b\n0,1,2\n0.5,3,4\n1,5,6\n"))
    found = read(tmp_path / "u.csv.gz")
    assert found.u.tolist() == [[1, 2], [3, 4], [5, 6]]
    assert found.names == ("a", "b")
    (tmp_path / "u.npy.gz").write_bytes(gzip.compress(b"rubbish"))
    with pytest.raises(BadInput, match=r"tables with \.gz too"):
        read(tmp_path / "u.npy.gz")


@pytest.mark.parametrize(
    ("words", "seconds"),
    [
        # The last day of a month and the first of the next are a day apart, not 70 numbers.
        (("20260131", "20260201", "20260202"), [0, 86400, 172800]),
        (("20260131235959", "20260201000000", "20260201000001"), [0, 1, 2]),
        # No month 13: these are numbers.
        (("20261301", "20261302", "20261303"), [20261301, 20261302, 20261303]),
    ],
)
def test_dates_in_one_number_become_seconds(
    words: tuple[str, ...], seconds: list[float], tmp_path: Path
):
    rows = [f"{word},{i},{i * i}" for i, word in enumerate(words)]
    (tmp_path / "u.csv").write_text("\n".join(["time,a,b", *rows]))
    found = read(tmp_path / "u.csv")
    assert found.t is not None
    assert found.t.tolist() == seconds


def test_second_column_of_one_name_gets_a_number(tmp_path: Path):
    (tmp_path / "u.csv").write_text("time,ch,ch,b\n0,1,2,7\n1,3,4,5\n2,5,3,6\n")
    found = read(tmp_path / "u.csv")
    assert found.names == ("ch", "ch.1", "b")
    assert found.u[:, 1].tolist() == [2, 4, 3]
    assert "two columns are called ch: the later is ch.1" in found.notes
    assert read(tmp_path / "u.csv", drop=("ch",)).names == ("ch.1", "b")


def test_times_of_another_number_are_named_and_a_step_replaces_them(tmp_path: Path):
    np.savez(tmp_path / "u.npz", t=T[:2], u=U)
    with pytest.raises(BadInput, match=r"^.*u.npz: 2 times in t, u has the shape \(4, 3\); --step"):
        read(tmp_path / "u.npz")
    assert read(tmp_path / "u.npz", no_times=True).t is None
