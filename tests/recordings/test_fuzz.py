"""Tables with known oscillations in the many forms of text: read right, or refused by name."""

from __future__ import annotations

import datetime
import gzip
import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, note, settings
from hypothesis import strategies as st

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job.tables import Features
from chimera_hpc.recordings.judge import measure
from chimera_hpc.recordings.preparing import prepare, with_times
from chimera_hpc.recordings.read import read_recording
from chimera_hpc.recordings.recording import Choice

ORDERS = ["".join(order) for order in itertools.permutations("dmY")]
FORMS = ("seconds", "mm:ss", "hh:mm:ss", "iso", "zoned", "compact", "compact ms", "epoch",
         "date and time", "none", *(f"{o}{mark}" for o in ORDERS for mark in "./-"))  # fmt: skip
DAY = 86400.0
N_PEAKS = 8
# An example is a whole table.
pytestmark = pytest.mark.filterwarnings("ignore:Generating overly large repr")


@dataclass(frozen=True)
class Written:
    """A table and what is true of it."""

    text: str
    encoding: str
    packed: bool
    step: float | None  # what the user gives
    frequency: float
    amplitude: float
    n_nodes: int
    fault: str
    node: str  # the faulty one
    may_refuse: bool


def words(form: str, step: float, count: int, start: datetime.datetime) -> list[list[str]]:
    """Return the cells of time of each line."""
    seconds = [i * step for i in range(count)]
    whens = [start + datetime.timedelta(seconds=s) for s in seconds]
    made = {
        "seconds": lambda: [f"{s:.3f}" for s in seconds],
        "mm:ss": lambda: [f"{int(s) // 60:02d}:{s % 60:06.3f}" for s in seconds],
        "hh:mm:ss": lambda: [w.strftime("%H:%M:%S.%f")[:-3] for w in whens],
        "iso": lambda: [w.isoformat() for w in whens],  # no fraction at whole seconds
        "zoned": lambda: [w.isoformat(" ") + "+02:00" for w in whens],
        "compact": lambda: [w.strftime("%Y%m%d%H%M%S") for w in whens],
        "compact ms": lambda: [w.strftime("%Y%m%d%H%M%S.%f")[:-3] for w in whens],
        "epoch": lambda: [f"{1.6e9 + s:.3f}" for s in seconds],
        "date and time": lambda: [w.strftime("%d.%m.%Y|%H:%M:%S") for w in whens],
        "none": lambda: [""] * count,
    }
    if form in made:
        return [[cell for cell in word.split("|") if cell] for word in made[form]()]
    pattern = form[3].join(f"%{key}" for key in form[:3])
    return [[w.strftime(f"{pattern} %H:%M:%S" if step < DAY else pattern)] for w in whens]


def steps_of(form: str) -> tuple[float, ...]:
    if form in ("seconds", "epoch", "none", "iso", "zoned", "compact ms", "mm:ss"):
        return (0.02, 0.04, 0.25)
    return (1.0, 7.0, 60.0) if form == "hh:mm:ss" else (1.0, 60.0, 600.0, 3600.0, DAY)


@st.composite
def tables(draw: st.DrawFn) -> Written:
    form = draw(st.sampled_from(FORMS))
    step = draw(st.sampled_from(steps_of(form)))
    if form == "date and time" and step == DAY:
        step = 3600.0
    n_nodes, period = draw(st.integers(3, 7)), draw(st.floats(25.0, 40.0))
    amplitude = draw(st.sampled_from([1e-6, 0.3, 1.0, 47.0, 5e4]))
    offset = draw(st.sampled_from([0.0, 0.0, 3.0, -100.0])) * amplitude
    count = int((N_PEAKS + 2.5) * period)
    u = offset + amplitude * np.cos(
        2 * np.pi * (np.arange(count)[:, None] / period + np.arange(n_nodes) / n_nodes)
    )
    fault = draw(st.sampled_from(["", "", "", "dead", "noisy", "rising", "twin", "holes", "empty"]))
    bad = draw(st.integers(1, n_nodes - 1))
    rng = np.random.default_rng(draw(st.integers(0, 99)))
    if fault:
        u[:, bad] = {
            "dead": lambda: np.full(count, offset),
            "noisy": lambda: offset + 1e-3 * amplitude * rng.normal(size=count),
            "rising": lambda: amplitude * (np.linspace(0, 9, count) + 0.1 * rng.random(count)),
            "twin": lambda: u[:, 0],
            "holes": lambda: np.where(rng.random(count) < 0.02, np.nan, u[:, bad]),
            "empty": lambda: np.full(count, np.nan),
        }[fault]()  # fmt: skip
    start = draw(st.datetimes(datetime.datetime(2001, 1, 1), datetime.datetime(2030, 1, 1)))
    times = words(form, step, count, start.replace(microsecond=0))
    sep = draw(st.sampled_from([",", ";", "\t", " "]))
    sep = ";" if sep == " " and (fault in ("holes", "empty") or " " in times[0][:1]) else sep
    sep = "\t" if sep == " " and any(" " in cell for cell in times[0]) else sep
    comma = sep != "," and draw(st.booleans())
    index = draw(st.sampled_from([None, None, 0, 1, 1000]))
    named = draw(st.booleans()) or index is not None or form == "date and time"
    word = draw(st.sampled_from(["ch", "Fz", "Ø", "$x_", "I ^"]))
    names = [f"{word}{i}" for i in range(n_nodes)]
    names = [name.replace(" ", "") if sep == " " else name for name in names]
    digits = draw(st.sampled_from([6, 9]))
    hole = draw(st.sampled_from(["", "NaN", "#N/A"]))
    cells = [[f"{x:.{digits}g}" if np.isfinite(x) else hole for x in row] for row in u]
    lines = [
        [*([str(index + i)] if index is not None else []), *t, *row]
        for i, (t, row) in enumerate(zip(times, cells, strict=True))
    ]
    body = [sep.join(line) for line in lines]
    if comma:
        dated = len(times[0]) and form not in ("seconds", "mm:ss", "epoch", "compact ms")
        first = (index is not None) + len(times[0])
        body = [sep.join([*(c if k < first and dated else c.replace(".", ",")
                            for k, c in enumerate(line))]) for line in lines]  # fmt: skip
    clock = {"date and time": ["Datum", "Zeit"], "none": []}.get(form)
    clock = [draw(st.sampled_from(["time", "t", "Zeit", "timestamp"]))] if clock is None else clock
    first_name = draw(st.sampled_from(["", "index"])) if sep != " " else "index"
    head = [*([first_name] if index is not None else []), *clock, *names]
    units = [["s"] * (len(head) - n_nodes) + ["mV"] * n_nodes] if draw(st.booleans()) else []
    above = [sep.join(line) for line in [head, *units]] if named else []
    daily = step >= DAY and len(form) == 4
    return Written(
        "\n".join([*above, *body]) + "\n",
        draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"])),
        draw(st.booleans()),
        step if form == "none" else None,
        1.0 / (period * step),
        amplitude,
        n_nodes,
        fault,
        names[bad] if named else str(bad),
        fault == "empty" or (daily and form[3] != ".") or (sep == " " and comma),
    )


def check(made: Written, folder: Path) -> None:
    """Assert that a table is measured right, or that what is wrong with it is named."""
    raw = made.text.encode(made.encoding)
    path = folder / ("u.csv.gz" if made.packed else "u.csv")
    path.write_bytes(gzip.compress(raw, 1) if made.packed else raw)
    note(made.text[:400])
    try:
        read = read_recording(path, Choice(no_times=made.step is not None))
        ready = prepare(with_times(read, made.step), None)
        found = measure(ready, Features(n_peaks=N_PEAKS), True, None)
    except BadInput as error:
        if made.may_refuse and "\n" not in str(error):
            return
        raise
    said = (*ready.notes, *ready.warnings, *found.warnings)
    if made.fault in ("dead", "noisy", "rising", "twin"):
        assert any(f"node {made.node}:" in line for line in ready.warnings + found.warnings), said
    if made.fault == "holes":
        assert ready.gaps
    assert len(ready.names) == made.n_nodes, said
    bad = made.fault in ("dead", "noisy", "rising")
    good = np.array([not (bad and name == _position(ready.names, made)) for name in ready.names])
    features = found.features
    # Windows of seven periods of a pure sine place its line up to 1.4 % off.
    assert features.frequency[good] == pytest.approx(made.frequency, rel=0.02), said
    assert features.amplitude[good] == pytest.approx(made.amplitude, rel=0.02), said


def _position(names: tuple[str, ...], made: Written) -> str:
    """Return the name that the faulty node has among those read."""
    if made.node in names:
        return made.node
    return names[int(made.node)]


# A failing example is as long as any other: nothing is gained by shrinking it.
QUICK = settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
    phases=[Phase.generate],
)


@QUICK
@given(made=tables())
def test_tables_are_read_right_or_refused(made: Written, tmp_path_factory: pytest.TempPathFactory):
    check(made, tmp_path_factory.getbasetemp())


@pytest.mark.slow
@pytest.mark.timeout(1800)
@settings(QUICK, max_examples=2000)
@given(made=tables())
def test_two_thousand_tables_are_read_right_or_refused(
    made: Written, tmp_path_factory: pytest.TempPathFactory
):
    check(made, tmp_path_factory.getbasetemp())
