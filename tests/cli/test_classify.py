"""``classify``: recordings of one's own, in all formats, by the atlas of a sweep."""

from __future__ import annotations

import json
from argparse import ArgumentTypeError
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from chimera_hpc.cli.classify import _number_of_clusters
from chimera_hpc.store.schema import sample_times
from chimera_hpc.store.store import Store

Sweep = Callable[..., tuple[int, str, str]]
RATE = 0.01


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")


def ring(n: int = 8, length: float = 30.0) -> tuple[np.ndarray, np.ndarray]:
    """Signals of frequency 1, amplitude 1 and 2 in turn, phase falling by pi / 4 a node."""
    t = RATE * np.arange(round(length / RATE) + 1)
    node = np.arange(n)
    u = (1 + node % 2) * np.cos(2.0 * np.pi * t[:, None] - np.pi / 4 * node)
    return t, u


def as_json(sweep: Sweep, *words: object) -> dict:
    code, out, error = sweep("classify", *words, "--json", "--no-figures")
    assert code == 0, error
    return json.loads(out)


def test_variations_are_those_of_the_hand_computed_signal(sweep: Sweep):
    t, u = ring()
    np.savez("run.npz", t=t, u=u)
    found = as_json(sweep, "run.npz")
    # Every neighbour is pi / 4 off and has the other amplitude.
    assert found["variations"]["V_theta"] == pytest.approx(0.25, abs=2e-3)
    assert found["variations"]["V_a"] == pytest.approx(1.0, abs=2e-3)
    assert found["variations"]["V_Omega"] == pytest.approx(0.0, abs=1e-4)
    assert found["features"]["amplitude"] == pytest.approx([1.0, 2.0] * 4, rel=2e-3)
    assert found["features"]["frequency"] == pytest.approx([1.0] * 8, rel=2e-3)
    assert found["samples_a_period"] == pytest.approx(100.0, rel=2e-3)
    assert found["class"] is None
    assert found["gaps"] == found["warnings"] == []


def test_chain_has_no_difference_between_its_ends(sweep: Sweep):
    t, u = ring(n=6)
    np.savez("run.npz", t=t, u=u)
    closed, opened = as_json(sweep, "run.npz"), as_json(sweep, "run.npz", "--open")
    # On the ring of 6 the last pair is 5 pi / 4 off, 3 pi / 4 on the circle.
    assert closed["variations"]["V_theta"] == pytest.approx((5 * 0.25 + 0.75) / 6, abs=2e-3)
    assert opened["variations"]["V_theta"] == pytest.approx(0.25, abs=2e-3)
    assert (closed["ring"], opened["ring"]) == (True, False)


def test_order_of_nodes_is_by_name_or_number_or_from_a_file(sweep: Sweep):
    t, u = ring(n=4)
    names = ["c", "a", "d", "b"]
    table = "time," + ",".join(names) + "\n"
    table += "".join(
        ",".join(f"{x:.9f}" for x in (s, *row)) + "\n" for s, row in zip(t, u, strict=True)
    )
    Path("run.csv").write_text(table)
    Path("order.txt").write_text("a\nb\n\nc\n")
    assert as_json(sweep, "run.csv")["nodes"] == names
    found = as_json(sweep, "run.csv", "--order", "order.txt")
    assert found["nodes"] == ["a", "b", "c"]
    assert found["features"]["amplitude"] == pytest.approx([2.0, 2.0, 1.0], rel=2e-3)
    assert as_json(sweep, "run.csv", "--order", "2,0,1")["nodes"] == ["d", "c", "a"]


@pytest.fixture
def recorded(finished: Path) -> tuple[Path, Store, int]:
    """The finished sweep, and one of its runs that oscillates."""
    store = Store.open(finished / "store.zarr")
    return finished, store, int(np.flatnonzero(store.ledger()["status"] == 1)[0])


def test_run_of_the_atlas_itself_has_its_class_at_no_distance_whatever_the_format(
    recorded: tuple[Path, Store, int], sweep: Sweep
):
    import xarray as xr

    folder, store, i = recorded
    t, u = sample_times(store.sweep), store.series(i)
    np.savez("run.npz", t=t, u=u)
    np.save("run.npy", u)
    np.savetxt("run.csv", np.column_stack([t, u]), delimiter=";", fmt="%.17g")
    labelled = xr.Dataset({"u": (("node", "time"), u.T)}, coords={"time": t})
    labelled.to_netcdf("run.nc", engine="scipy")
    files = [("run.npz",), ("run.npy", "--step", "0.1"), ("run.csv",), ("run.nc",)]
    files += [(folder, "--select", f"point={i}")]
    for words in files:
        found = as_json(sweep, *words, "--atlas", folder)
        for name in ("V_theta", "V_a", "V_Omega"):
            expected = store.scalars()[name][i]
            assert found["variations"][name] == pytest.approx(expected, rel=1e-9), words
        assert found["distance"] == pytest.approx(0.0, abs=1e-9)
        assert found["confidence"] == 1.0
        assert found["class"] in {"ordered", "chimera", "disordered"}
        assert any("as recorded" in note for note in found["notes"])


def test_other_sampling_is_brought_to_the_step_of_the_atlas(
    recorded: tuple[Path, Store, int], sweep: Sweep
):
    folder, store, i = recorded
    t, u = sample_times(store.sweep), store.series(i)
    np.savez("half.npz", t=t[::2], u=u[::2])
    found = as_json(sweep, "half.npz", "--atlas", folder)
    assert (found["step"], found["recorded_step"]) == (0.1, pytest.approx(0.2))
    assert any("interpolated (recorded at 0.2)" in note for note in found["notes"])
    assert any("samples per period" in warning for warning in found["warnings"])


def test_recording_outside_the_atlas_has_no_class_but_a_nearest(
    recorded: tuple[Path, Store, int], sweep: Sweep
):
    folder, store, i = recorded
    np.savez("far.npz", t=sample_times(store.sweep), u=1000.0 * store.series(i))
    found = as_json(sweep, "far.npz", "--atlas", folder)
    assert (found["status"], found["class"], found["confidence"]) == ("done", None, 0.0)
    assert found["nearest"] in {"ordered", "chimera", "disordered"}
    code, out, _ = sweep("classify", "far.npz", "--atlas", folder, "--no-figures")
    assert code == 0
    assert f"class: none, by {folder}, runs of topological_fhn\n" in out
    assert f"the nearest class is {found['nearest']}\n" in out
    inside = as_json(sweep, folder, "--select", f"point={i}", "--atlas", folder)
    assert inside["class"] == inside["nearest"]


def test_what_the_atlas_has_otherwise_is_said(recorded: tuple[Path, Store, int], sweep: Sweep):
    folder, store, i = recorded
    t, u = sample_times(store.sweep), store.series(i)
    np.savez("part.npz", t=t, u=0.1 * u[:, :5])
    np.savetxt("links.csv", [[k, (k + 1) % 5] for k in range(5)], delimiter=",", fmt="%d")
    network, nodes, amplitude = "over neighbours on a ring: leave", "5 nodes, but", "median amplit"
    for words, said in (((), [amplitude, nodes]), (("--links", "links.csv"), [network])):
        warned = as_json(sweep, "part.npz", "--atlas", folder, *words)["warnings"]
        assert all(any(part in line for line in warned) for part in said), warned
    inside = as_json(sweep, folder, "--select", f"point={i}", "--atlas", folder)["warnings"]
    assert not any(part in line for line in inside for part in (network, nodes, amplitude))


def test_rescaling_takes_other_units_back(recorded: tuple[Path, Store, int], sweep: Sweep):
    folder, store, i = recorded
    t, u = sample_times(store.sweep), store.series(i)
    np.savez("milli.npz", t=1000.0 * t, u=7.0 * u)
    other = as_json(sweep, "milli.npz", "--rescale", "--atlas", folder)
    plain = as_json(sweep, folder, "--select", f"point={i}", "--rescale", "--atlas", folder)
    assert other["scale"]["time"] == pytest.approx(plain["scale"]["time"] / 1000.0, rel=1e-3)
    assert other["scale"]["signal"] == pytest.approx(plain["scale"]["signal"] / 7.0, rel=1e-3)
    for name, value in plain["variations"].items():
        assert other["variations"][name] == pytest.approx(value, rel=0.02, abs=1e-3)


def test_rescaling_takes_the_prominence_in_the_unit_of_the_atlas(
    recorded: tuple[Path, Store, int], sweep: Sweep
):
    folder, store, i = recorded
    np.savez("milli.npz", t=sample_times(store.sweep), u=1e-3 * store.series(i))
    words = ("milli.npz", "--set", "prominence=0.1", "--atlas", folder)
    assert as_json(sweep, *words, "--rescale")["status"] == "done"
    found = as_json(sweep, *words)
    assert found["status"] == "no_window"
    assert any("maxima of prominence = 0.1 in the unit" in line for line in found["warnings"])


@pytest.mark.parametrize("words", [(), ("--atlas",)])
def test_an_unknown_preset_is_one_line(words: tuple[str, ...], finished: Path, sweep: Sweep):
    np.savez("run.npz", t=ring()[0], u=ring()[1])
    more = (*words, finished) if words else ()
    code, _, error = sweep("classify", "run.npz", "--preset", "printed", *more)
    assert code == 2
    assert error == "error: --preset must be one of default, paper-printed, not 'printed'\n"


def test_the_key_steady_does_not_set_the_threshold(sweep: Sweep):
    t, u = ring()
    np.savez("micro.npz", t=t, u=1e-4 * u)
    assert as_json(sweep, "micro.npz", "--set", "steady=level")["status"] == "done"
    words = ("--set", "features.steady_threshold=0.01")
    assert as_json(sweep, "micro.npz", *words)["status"] == "steady"


def test_factors_take_known_units_back_without_a_difference(
    recorded: tuple[Path, Store, int], sweep: Sweep
):
    folder, store, i = recorded
    np.savez("milli.npz", t=1024.0 * sample_times(store.sweep), u=8.0 * store.series(i))
    factors = f"{1 / 1024},0.125"
    found = as_json(sweep, "milli.npz", "--factors", factors, "--atlas", folder)
    for name, value in found["variations"].items():
        assert value == pytest.approx(store.scalars()[name][i], rel=1e-9)
    assert found["distance"] == pytest.approx(0.0, abs=1e-9)


def test_other_unit_of_time_is_warned_of(recorded: tuple[Path, Store, int], sweep: Sweep):
    folder, store, i = recorded
    np.savez("slow.npz", t=20.0 * sample_times(store.sweep)[:50], u=store.series(i)[:50])
    found = as_json(sweep, "slow.npz", "--set", "n_peaks=3", "--atlas", folder)
    assert any("--factors or --rescale" in line for line in found["warnings"])


def test_noise_is_warned_of_and_damped(sweep: Sweep):
    t, u = ring()
    np.savez("run.npz", t=t, u=u + 0.05 * np.random.default_rng(0).normal(size=u.shape))
    noisy, smooth = as_json(sweep, "run.npz"), as_json(sweep, "run.npz", "--lowpass", "3")
    assert any("the clock, has" in line for line in noisy["warnings"])
    assert smooth["warnings"] == []
    assert smooth["windows"] < noisy["windows"]
    assert smooth["variations"]["V_theta"] == pytest.approx(0.25, abs=0.01)
    assert smooth["features"]["frequency"] == pytest.approx([1.0] * 8, rel=0.01)


def test_gaps_are_listed_bridged_or_cut_at(sweep: Sweep):
    t, u = ring()
    u[500:502, 3] = np.nan
    u[1000, 5] = np.inf
    u[2400:2500, 0] = np.nan
    kept = np.r_[0:100, 103 : len(t)]
    np.savez("run.npz", t=t[kept], u=u[kept])
    found = as_json(sweep, "run.npz")
    gaps = [(gap["node"], gap["samples"]) for gap in found["gaps"]]
    assert gaps == [("0", 100), (None, 3), ("3", 2), ("5", 1)]
    assert found["gaps"][0]["from"] == pytest.approx(23.99)
    assert found["gaps"][0]["to"] == pytest.approx(25.0)
    assert (found["start"], found["end"]) == (0.0, pytest.approx(23.99))
    assert found["variations"]["V_a"] == pytest.approx(1.0, abs=2e-3)
    code, out, _ = sweep("classify", "run.npz", "--no-figures", "--bridge", "1")
    assert code == 0
    assert "node 0: 100 samples missing between 23.99 and 25" in out
    assert "5.02 to 23.99" in out
    assert "103 values and 3 times missing, in 4 gaps" in out


@pytest.mark.slow
def test_figures_are_written_where_they_are_wanted(
    recorded: tuple[Path, Store, int], sweep: Sweep, tmp_path: Path
):
    folder, store, i = recorded
    np.savez("run.npz", t=sample_times(store.sweep), u=store.series(i))
    code, out, _ = sweep("classify", "run.npz", "--atlas", folder, "--out", tmp_path / "made")
    assert code == 0
    made = {path.name for path in (tmp_path / "made").glob("*.png")}
    assert made == {"space_time.png", "profiles.png", "spectrum.png", "atlas.png"}
    assert f"written: {tmp_path / 'made' / 'atlas.png'}" in out
    assert f"by {folder}" in out


def test_dollars_in_names_are_drawn_and_begin_no_formula(sweep: Sweep):
    t, u = ring(n=3)
    names = ["$\\frac$", "cost $", "a$b$"]
    table = [",".join(["time", *names])]
    table += [",".join(f"{x:.6f}" for x in (s, *row)) for s, row in zip(t, u, strict=True)]
    Path("$\\x$.csv").write_text("\n".join(table))
    code, _, error = sweep("classify", "$\\x$.csv", "--out", "made")
    assert (code, error) == (0, "")
    assert len(list(Path("made").glob("*.png"))) == 3


def test_recording_that_stands_still_is_steady(sweep: Sweep):
    np.savez("still.npz", t=RATE * np.arange(1000), u=np.ones((1000, 5)))
    found = as_json(sweep, "still.npz")
    assert (found["status"], found["class"]) == ("steady", "steady")
    assert found["variations"] == {"V_theta": None, "V_a": None, "V_Omega": None}


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--step", "0.1", "--time", "t"), "leave --step out"),
        (("--set", "n_peak=3"), "--set n_peak: no such key in [features]; known:"),
        (("--set", "n_peaks=three"), "--set n_peaks: "),
        (("--order", "0,1,1"), "1 is there twice"),
        (("--order", "0,9"), "9 is no node; there are 8: 0 to 7"),
        (("--start", "29.99"), "too few"),
        (("--rescale",), "--atlas STORE says it"),
        (("--bridge", "-1"), "allowed is 0 or more"),
        (("--factors", "2"), "T,U is needed, two numbers, T above 0"),
        (("--factors", "0,1"), "T,U is needed, two numbers, T above 0"),
        (("--lowpass", "60"), "60 per unit of time is not between 0 and half"),
        (("--variable", "v"), "--variable v: the file has t, u"),
        (("--select", "point"), "NAME=INDEX is needed"),
        (("--atlas", "nowhere"), "nowhere"),
    ],
)
def test_wrong_options_are_refused_on_one_line(options: tuple[str, ...], said: str, sweep: Sweep):
    t, u = ring()
    np.savez("run.npz", t=t, u=u)
    code, out, error = sweep("classify", "run.npz", "--no-figures", *options)
    assert (code, out) == (2, "")
    assert said in error
    assert error.count("\n") == 1


def test_number_of_clusters_is_a_number_or_auto() -> None:
    assert [_number_of_clusters(text) for text in ("3", "auto")] == [3, "auto"]
    for text in ("0", "-1", "many"):
        with pytest.raises(ArgumentTypeError, match="a number from 1 on, or auto"):
            _number_of_clusters(text)
