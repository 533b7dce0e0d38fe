"""Tables of the same eight signals in the forms that people's files have: the truth comes out."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job.tables import Features
from chimera_hpc.recordings.judge import Measured, measure
from chimera_hpc.recordings.preparing import in_order, prepare, with_times
from chimera_hpc.recordings.read import read_recording
from chimera_hpc.recordings.recording import Choice, Recording

T = 0.02 * np.arange(1501)
U = np.cos(2 * np.pi * T[:, None] + np.pi / 4 * np.arange(8))
NAMES = [f"ch{i}" for i in range(8)]
CELLS = [[f"{x:.6f}" for x in row] for row in U]
TIMES = [f"{t:.2f}" for t in T]


def table(times: list[str], names: list[str], sep: str = ",", comma: bool = False) -> str:
    cells = [[x.replace(".", ",") for x in row] for row in CELLS] if comma else CELLS
    rows = [sep.join([*([t] if t else []), *row]) for t, row in zip(times, cells, strict=True)]
    return "\n".join([sep.join(names), *rows]) + "\n"


def measured(path: Path, step: float | None = None, **choice: object) -> Measured:
    recording = with_times(read_recording(path, Choice(**choice)), step)
    return measure(prepare(recording, None), Features(), True, None)


def clock(t: float) -> str:
    return f"{int(t) // 60:02d}:{t % 60:05.2f}"


@pytest.mark.parametrize(
    "text",
    [
        table(TIMES, ["time", *NAMES]),
        table(TIMES, ["time_s", *NAMES]),
        table(TIMES, ["Zeit", *NAMES]),
        table(TIMES, ["t [s]", *NAMES]),
        table([f"{i},{t}" for i, t in enumerate(TIMES)], ["", "time", *NAMES]),
        table([t.replace(".", ",") for t in TIMES], ["time", *NAMES], "\t", comma=True),
        table([t.replace(".", ",") for t in TIMES], ["time", *NAMES], ";", comma=True),
        table([t.replace(".", ",") for t in TIMES], ["time", *NAMES], " ", comma=True),
        table(TIMES, ["time", *NAMES]).replace("\n", "\n" + ",".join("s" + "V" * 8) + "\n", 1),
        table([clock(t) for t in T], ["time", *NAMES]),
        table([f"01.02.2023 00:{clock(t)}" for t in T], ["time", *NAMES]),
        table([f"2023-02-01T00:{clock(t)}+02:00" for t in T], ["time", *NAMES]),
        table([f"2023-02-01 00:{clock(t)} UTC" for t in T], ["time", *NAMES]),
        table([f"0 days 00:{clock(t)}" for t in T], ["time", *NAMES]),
        table([f"2023020100{clock(t)}".replace(":", "") for t in T], ["time", *NAMES]),
        table([f"01.02.2023;00:{clock(t)}" for t in T], ["Datum", "Zeit", *NAMES], ";"),
        table([f"{2 * i},{t}" for i, t in enumerate(TIMES)], ["", "time", *NAMES]),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
def test_the_truth_comes_out_whatever_the_form(text: str, encoding: str, tmp_path: Path):
    (tmp_path / "u.csv").write_text(text, encoding=encoding)
    found = measured(tmp_path / "u.csv").features
    assert found.frequency == pytest.approx(np.ones(8), rel=0.01)
    assert found.amplitude == pytest.approx(np.ones(8), rel=0.01)


def test_dotted_dates_have_the_day_first(tmp_path: Path):
    days = np.datetime64("2023-02-01") + np.arange(1501) * np.timedelta64(10, "m")
    words = [f"{s[8:10]}.{s[5:7]}.{s[:4]} {s[11:16]}" for s in map(str, days)]
    (tmp_path / "u.csv").write_text(table(words, ["time", *NAMES]))
    found = read_recording(tmp_path / "u.csv", Choice())
    assert found.t == pytest.approx(600.0 * np.arange(1501))


def test_microvolts_are_not_steady(tmp_path: Path):
    np.savez(tmp_path / "u.npz", t=T, u=1e-6 * U)
    assert measured(tmp_path / "u.npz").features.amplitude == pytest.approx(
        np.full(8, 1e-6), rel=0.01
    )


def test_samples_per_period_are_those_of_the_recording_not_of_its_grid():
    found = measure(prepare(Recording(T, U), 0.025), Features(), True, None)
    assert found.samples_a_period == pytest.approx(50.0, rel=0.01)


def test_times_of_the_file_and_a_step_exclude_each_other(tmp_path: Path):
    (tmp_path / "u.csv").write_text(table(TIMES, ["time_s", *NAMES]))
    with pytest.raises(BadInput, match="leave --step out, or --drop time_s"):
        measured(tmp_path / "u.csv", 0.02, no_times=True)
    left = measured(tmp_path / "u.csv", 0.02, no_times=True, drop=("time_s",))
    assert len(left.features.frequency) == 8


def test_dead_channel_is_named(tmp_path: Path):
    u = U.copy()
    u[:, 3] = 0.0
    np.savez(tmp_path / "u.npz", t=T, u=u)
    made = prepare(with_times(read_recording(tmp_path / "u.npz", Choice()), None), None)
    assert any("node 3: hardly varies" in line and "--drop 3" in line for line in made.warnings)


def test_node_with_the_values_of_another_is_named():
    u = U.copy()
    u[:, 5] = u[:, 2]
    made = prepare(Recording(T, u), None)
    wanted = "node 5: has the same values as another node; --drop 5 leaves it out"
    assert made.warnings == (wanted,)


def test_a_constant_channel_is_named_once(tmp_path: Path):
    u = U.copy()
    u[:, 3] = 3.2  # its mean is not exact, so that its spread is not 0
    np.savez(tmp_path / "u.npz", t=T, u=u)
    made = prepare(with_times(read_recording(tmp_path / "u.npz", Choice()), None), None)
    (line,) = [line for line in made.warnings if "--drop 3" in line]
    assert "hardly varies" in line


def test_rows_of_nodes_are_refused_until_turned(tmp_path: Path):
    np.save(tmp_path / "u.npy", U.T)
    with pytest.raises(BadInput, match="--transpose turns them"):
        measured(tmp_path / "u.npy", 0.02)
    assert len(measured(tmp_path / "u.npy", 0.02, transpose=True).features.frequency) == 8


def test_order_is_by_names_or_by_numbers_never_both():
    recording = Recording(T, U, tuple("12345678"))
    assert in_order(recording, "0,3,5").names == ("1", "4", "6")
    assert in_order(recording, "1,2,3").names == ("1", "2", "3")
    many = Recording(T[:3], np.ones((3, 2000)))
    assert in_order(many, ",".join(map(str, range(2000)))).names == many.names


def test_steps_of_a_solver_are_resampled_and_no_gaps(tmp_path: Path):
    steps = np.repeat([0.002, 0.05, 0.002, 0.05], [2000, 300, 2000, 300])
    t = np.cumsum(steps)
    u = np.cos(2 * np.pi * t[:, None] + np.pi / 4 * np.arange(8))
    made = prepare(Recording(t, u), None)
    assert made.gaps == ()
    assert made.t[-1] == pytest.approx(t[-1], abs=0.01)
    assert any("uneven times" in note for note in made.notes)


def test_words_for_what_is_missing_are_read_and_cut_nothing(tmp_path: Path):
    text = table(TIMES, ["time", *NAMES]).splitlines()
    words = ("#N/A", "#NV", "#WERT!", "---", "-", ".", "<NA>", "null")
    for i, word in enumerate(words, start=700):
        text[i] = ",".join([TIMES[i - 1], word, *text[i].split(",")[2:]])
    (tmp_path / "u.csv").write_text("\n".join(text))
    missing = np.isnan(read_recording(tmp_path / "u.csv", Choice()).u)
    assert np.argwhere(missing).tolist() == [[i, 0] for i in range(699, 699 + len(words))]


def test_exponents_of_fortran_are_read(tmp_path: Path):
    rows = [f"{i / 50:14.6E}{i % 7 / 3:14.6E}{-i % 5:14.6E}" for i in range(9)]
    (tmp_path / "u.dat").write_text("\n".join(["t a1d-2 b", *rows]).replace("E", "D"))
    read = read_recording(tmp_path / "u.dat", Choice())
    assert read.names == ("a1d-2", "b")
    np.testing.assert_allclose(read.u[:, 0], [i % 7 / 3 for i in range(9)], rtol=1e-6)


@pytest.mark.parametrize(
    ("cell", "said"),
    [("b", "column b: 'b' is not a number (sample 4, from 0); the line of names again? save each"),
     ("x1", "column b: 'x1' is not a number (sample 4, from 0); --drop leaves columns out")],
)  # fmt: skip
def test_a_word_among_numbers_is_named_with_its_sample(cell: str, said: str, tmp_path: Path):
    rows = [f"{i},{i % 7},{cell if i == 4 else i % 5}" for i in range(9)]
    (tmp_path / "u.csv").write_text("\n".join(["t,a,b", *rows]))
    with pytest.raises(BadInput, match=re.escape(said)):
        read_recording(tmp_path / "u.csv", Choice())


def read_times(times: list[str], name: str, tmp_path: Path) -> Recording:
    rows = [f"{t};{i % 7};{i * i % 5}" for i, t in enumerate(times)]
    (tmp_path / "u.csv").write_text("\n".join([f"{name};a;b", *rows]))
    return read_recording(tmp_path / "u.csv", Choice())


@pytest.mark.parametrize(
    ("times", "name", "seconds"),
    [
        (["202601312358", "202601312359", "202602010000"], "time", [0, 60, 120]),
        (["20260131235959500", "20260201000000000"], "time", [0, 0.5]),
        (["01-2026-31", "02-2026-01", "02-2026-02"], "time", [0, 86400, 172800]),
        (["26.01.31", "26.02.01", "26.02.02"], "time", [0, 86400, 172800]),
        (["28.02.00", "29.02.00", "01.03.00"], "time", [0, 86400, 172800]),  # of 2000, not 1900
        (["30:00", "30:01", "30:02"], "time hh:mm", [0, 60, 120]),
        (["00:01", "00:02"], "time mm:ss", [0, 1]),
    ],
)
def test_forms_of_dates(times: list[str], name: str, seconds: list[float], tmp_path: Path):
    found = read_times(times, name, tmp_path)
    assert found.t == pytest.approx(seconds)
    assert [line for line in found.warnings if "--transpose" not in line] == []


@pytest.mark.parametrize(
    ("times", "said"),
    [
        (["30:00", "30:01", "30:02"], "'30:02' was taken for mm:ss; if it is hh:mm"),
        (["1675209600000", "1675209600020"], "milliseconds since 1970.* --factors 0.001,1"),
        (["1675209600000000000", "1675209600020000000"], "nanoseconds since 1970"),
        (["45012.25", "45012.2501", "45012.2502"], "dates as a spreadsheet counts.* 86400,1"),
        (["738972,25", "738972,2501"], "dates as MATLAB counts.* 86400,1"),
    ],
)
def test_doubtful_units_of_time_are_warned_of(times: list[str], said: str, tmp_path: Path):
    line = read_times(times, "time", tmp_path).warnings[0]
    assert re.search(said, line)


def test_several_lines_for_one_time_are_refused(tmp_path: Path):
    made = read_times(["0", "0", "1"], "time", tmp_path)
    with pytest.raises(BadInput, match="one line per time and one column per node are needed"):
        prepare(with_times(made, None), None)


@pytest.mark.parametrize("turn", [2 * np.pi, 360.0])
def test_phases_are_named(turn: float):
    phases = turn * ((T[:, None] + np.arange(8) / 8) % 1.0)
    assert any("phases? save their cosine" in line for line in prepare(
        Recording(T, phases), None).warnings)  # fmt: skip
    assert prepare(Recording(T, 0.5 * turn * U), None).warnings == ()
    with pytest.raises(BadInput, match="phases that grow"):
        with_times(Recording(T, turn * T[:, None] + np.arange(8)), None)


@pytest.mark.parametrize(
    ("name", "said"),
    [("u.xlsx", "save the sheet as CSV"), ("u.dat", "no line of numbers: '1.0D0 2.0D0' stands")],
)
def test_files_without_numbers_are_refused_with_what_to_do(name: str, said: str, tmp_path: Path):
    (tmp_path / name).write_text("1.0D0 2.0D0\n")
    with pytest.raises(BadInput, match=said):
        read_recording(tmp_path / name, Choice())


@pytest.mark.parametrize("time", ["00:00:98", "24:00:00x", "2026-01-31 25:00:00"])
def test_impossible_times_are_refused(time: str, tmp_path: Path):
    with pytest.raises(BadInput, match="is no time"):
        read_times([time, time], "time", tmp_path)


@pytest.mark.parametrize("first", ["0,02", "2"])
def test_points_that_separate_thousands_are_refused(first: str, tmp_path: Path):
    rows = [f"{first};1.500;628", "3;7;-7", "4;2.250;9"]
    (tmp_path / "u.csv").write_text("\n".join(["time;a;b", *rows]))
    with pytest.raises(BadInput, match=r"column a: '1.500': does the point separate thousands"):
        read_recording(tmp_path / "u.csv", Choice())


def test_two_columns_of_times_without_names_are_refused(tmp_path: Path):
    text = table([f"{2 * i},{t}" for i, t in enumerate(TIMES)], [])
    (tmp_path / "u.csv").write_text(text.lstrip("\n"))
    with pytest.raises(BadInput, match="columns 0 and 1 rise as evenly as times do: --time 1"):
        read_recording(tmp_path / "u.csv", Choice())


@pytest.mark.parametrize(
    ("column", "said"),
    [
        (T / 10 + 0.01 * np.sin(37 * T), "fewer than 1.5 turns in a window"),
        (np.cos(2 * np.pi * T) + T, "fewer than 1.5 turns in a window"),
        (np.where(np.arange(1501) == 700, 1e6, U[:, 3]), "a sine holds less than 30%"),
        (np.clip(U[:, 3], -0.5, 0.5), "keeps its value in many steps"),
        ((np.arange(1501) % 100 < 3).astype(float), "keeps its value in many steps"),
    ],
)
def test_node_that_is_no_oscillator_is_named(column: np.ndarray, said: str):
    u = U.copy()
    u[:, 3] = column
    made = prepare(Recording(T, u), None)
    found = measure(made, Features(), True, None)
    lines = [line for line in (*made.warnings, *found.warnings) if line.startswith("node 3:")]
    assert any(said in line and "--drop 3" in line for line in lines)


def test_faint_signals_on_a_high_level_are_measured_and_said():
    made = prepare(Recording(T, 1e6 + U), None)
    found = measure(made, Features(), True, None)
    assert found.features.amplitude == pytest.approx(np.ones(8), rel=0.02)
    assert any("round a level of 1e+06" in line for line in found.warnings)


def test_short_slopes_are_nodes():
    recording = with_times(Recording(T[:15], U[:15]), None)
    assert recording.u.shape == (15, 8)


def test_signals_out_of_range_and_endless_filters_are_refused():
    for factor in (1e200, 1e-200):
        with pytest.raises(BadInput, match="leave the range of numbers"):
            prepare(Recording(T, factor * U), None)
    with pytest.raises(BadInput, match="--lowpass: 1e-09 per unit of time is too low"):
        prepare(Recording(T, U), None, lowpass=1e-9)
    with pytest.raises(BadInput, match="--lowpass: 12 samples are too few, 16 are needed"):
        prepare(Recording(T[:12], U[:12]), None, lowpass=5.0)


def test_structure_of_matlab_is_looked_into(tmp_path: Path):
    from scipy.io import savemat

    savemat(tmp_path / "u.mat", {"EEG": {"data": U.T, "times": T, "srate": 50.0}})
    assert measured(tmp_path / "u.mat").features.frequency == pytest.approx(np.ones(8), rel=0.01)


def test_order_is_read_from_a_file_with_a_byte_order_mark(tmp_path: Path):
    (tmp_path / "order.txt").write_text("3\n1\n0\n", encoding="utf-16")
    assert in_order(Recording(T, U), str(tmp_path / "order.txt")).names == ("3", "1", "0")


def test_order_may_be_longer_than_the_name_of_a_file():
    names = tuple(f"electrode {i}" for i in range(100))
    wide = Recording(T[:9], np.tile(U[:9], 13)[:, :100], names)
    assert in_order(wide, ",".join(map(str, range(100)))).names == names
    assert in_order(wide, ",".join(names[::-1])).names == names[::-1]
