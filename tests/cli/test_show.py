"""``show``: a point or a cell computed again, compared with the store, and drawn."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any
from weakref import WeakSet

import numpy as np
import pytest
from PIL import Image

from chimera_hpc.cli import show
from chimera_hpc.measures import variation
from chimera_hpc.measures.fourier import fourier_features
from chimera_hpc.plot import animation
from chimera_hpc.plot.spectrum import vertex
from chimera_hpc.reduction import replay as module
from chimera_hpc.reduction.replay import replay, representative, window_spectrum
from chimera_hpc.store.store import Store

Sweep = Callable[..., tuple[int, str, str]]


@pytest.fixture
def store(finished: Path) -> Store:
    return Store.open(finished / "store.zarr")


def oscillating(store: Store) -> int:
    return int(np.flatnonzero(store.ledger()["status"] == 1)[0])


def words(store: Store, i: int) -> list[str]:
    row = store.points.row(i)
    return [f"{name}={row[name]}" for name in ("P", "Q", "seed")]


def test_point_is_replayed_bit_for_bit_and_drawn(finished: Path, store: Store, sweep: Sweep):
    i = oscillating(store)
    code, out, _ = sweep("show", finished, *words(store, i))
    assert code == 0
    digest = f"{int(store.ledger()['digest'][i]) & (2**64 - 1):016x}"
    assert f"digest {digest}, as stored: the same bits" in out
    assert f"V_theta {store.scalars()['V_theta'][i]:.6g}" in out
    row = store.points.row(i)
    stem = f"P{row['P']}_Q{row['Q']}_seed{row['seed']}"
    folder = finished / "figures" / "show"
    for name in ("space_time", "profiles", "portrait", "spectrum"):
        assert f"written: {folder / stem}-{name}.png" in out
        assert (folder / f"{stem}-{name}.pdf").stat().st_size > 1000
        with Image.open(folder / f"{stem}-{name}.png") as picture:
            assert picture.size[0] > 500


def test_replayed_signals_are_those_of_the_store(store: Store):
    chosen = [oscillating(store), 0]
    for run in replay(store, chosen):
        assert run.u.at(slice(None)).tobytes() == store.series(run.point).tobytes()
        kept, some = store.node_series(run.point), np.array([3, 1])
        assert run.u[2:4].tobytes() == kept[2:4].tobytes()
        assert kept.in_memory()[some].tobytes() == run.u[0:4][some].tobytes()
        assert run.is_same
        assert run.begins
        assert run.is_whole
        assert run.w.shape == run.u.shape[::-1]


def test_large_points_are_computed_one_by_one_and_only_their_last_w_is_kept(
    store: Store, monkeypatch: pytest.MonkeyPatch
):
    together = list(replay(store, [oscillating(store), 0]))
    monkeypatch.setattr(module, "_AT_ONCE", 1)
    monkeypatch.setattr(module, "_MOST_W", 12 * 7)
    alone = list(replay(store, [oscillating(store), 0]))
    for one, other in zip(alone, together, strict=True):
        assert one.u[0:12].tobytes() == other.u[0:12].tobytes()
        assert one.w.tobytes() == other.w[-7:].tobytes()
        assert one.digest == other.digest
    focused = replay(store, [1, 0], focus=0)
    assert [run.w.shape for run in focused] == [(0, 12), (7, 12)]


def test_large_runs_of_a_cell_are_in_memory_one_at_a_time_but_for_the_one_in_focus(
    finished: Path, store: Store, sweep: Sweep, monkeypatch: pytest.MonkeyPatch
):
    alive: WeakSet[Any] = WeakSet()
    most = []

    class Counted(module.SeriesInMemory):
        def __init__(self, stored: Any) -> None:
            super().__init__(stored)
            alive.add(self)
            most.append(len(alive))

    monkeypatch.setattr(module, "SeriesInMemory", Counted)
    monkeypatch.setattr(module, "representative", lambda store, chosen: chosen[0])
    monkeypatch.setattr(module, "_AT_ONCE", 1)
    code, _, _ = sweep("show", finished, "P=4", "--out", finished / "pictures")
    assert code == 0
    assert len(most) == 5
    assert max(most) <= 2


@pytest.mark.slow
def test_other_bits_than_stored_are_said_with_status_one(
    finished: Path, store: Store, sweep: Sweep, monkeypatch: pytest.MonkeyPatch
):
    true = variation.total_variations

    def other(*given: Any, **named: Any) -> list[float]:
        return [1.0 + x for x in true(*given, **named)]

    monkeypatch.setattr(variation, "total_variations", other)
    code, out, _ = sweep("show", finished, *words(store, oscillating(store)))
    assert code == 1
    assert "NOT the same" in out


@pytest.mark.slow
def test_cell_shows_its_seeds_and_one_that_stands_for_them(
    finished: Path, store: Store, sweep: Sweep
):
    code, out, _ = sweep("show", finished, "P=4", "--out", finished / "pictures")
    assert code == 0
    assert out.count("as stored: the same bits") == 5
    chosen = store.points.find(P=4).tolist()
    first = representative(store, chosen)
    assert f"portrait and spectrum: {' '.join(words(store, first))}" in out
    assert (finished / "pictures" / "P4_Q4-space_time.png").is_file()


def test_representative_is_of_the_most_frequent_class_and_nearest_to_its_median():
    class Made:
        n_points = 6
        triplets = np.array([0.1, 0.2, 0.9, 0.5, 0.3, np.nan])

        def scalars(self):
            return dict.fromkeys(("V_theta", "V_a", "V_Omega"), self.triplets)

    names = ["ordered", "ordered", "chimera", "chimera", "chimera", "steady"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("chimera_hpc.reduction.replay.classes_of", lambda store: names)
        assert representative(Made(), range(6)) == 3
        assert representative(Made(), [5]) == 5
        assert representative(Made(), [0, 1, 5]) in (0, 1)


def test_several_cells_are_refused_with_what_to_say(finished: Path, sweep: Sweep):
    code, _, error = sweep("show", finished, "seed=1")
    assert code == 2
    assert "these values are those of 3 cells; say also P (2, 3, 4), Q (2, 3, 4)" in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--node", "12"), "--node 12: allowed is 0 to 11"),
        (("--window", "99"), "--window 99: allowed is 0 to"),
        (("--periods", "0"), "--periods 0.0: a number above 0"),
        (("--animate", "ring.avi"), "allowed endings are .gif and .mp4"),
        (("--animate", "nowhere/ring.gif"), "no such folder"),
    ],
)
def test_wrong_options_are_refused_on_one_line(
    options: tuple[str, ...], said: str, finished: Path, store: Store, sweep: Sweep
):
    code, _, error = sweep("show", finished, *words(store, oscillating(store)), *options)
    assert code == 2
    assert said in error
    assert error.count("\n") == 1


def test_film_without_ffmpeg_is_refused_before_anything_is_computed(
    finished: Path, store: Store, sweep: Sweep, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(animation.FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
    code, out, error = sweep("show", finished, "P=4", "seed=0", "--animate", "ring.mp4")
    assert (code, out) == (2, "")
    assert "needs the program ffmpeg" in error


@pytest.mark.slow
def test_gif_has_a_frame_for_each_sample_asked_for(
    finished: Path, store: Store, sweep: Sweep, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(show, "_FRAMES_A_PERIOD", 4)
    film = finished / "ring.gif"
    point = words(store, oscillating(store))
    code, out, _ = sweep("show", finished, *point, "--animate", film, "--periods", "2")
    assert code == 0
    assert f"written: {film}" in out
    with Image.open(film) as frames:
        assert frames.size == (700, 340)
        assert 6 <= frames.n_frames <= 12
    assert list(finished.glob("tmp*")) == []


def test_steady_run_is_shown_without_profiles(finished: Path, store: Store, sweep: Sweep):
    steady = np.flatnonzero(store.ledger()["status"] == 2)
    assert len(steady)
    code, out, _ = sweep("show", finished, *words(store, int(steady[0])))
    assert code == 0
    assert "space_time.png" in out
    assert "profiles.png" not in out
    assert "spectrum.png" not in out


def test_spectrum_is_that_of_the_window_that_the_features_come_from(store: Store):
    settings = store.sweep.features
    t = 0.01 * np.arange(4001)
    u = np.stack([np.cos(2.0 * np.pi * t), 3.0 + 2.0 * np.cos(4.0 * np.pi * t - 1.0)], axis=1)
    data, text = window_spectrum(t, u.T, settings, node=1, window=0)
    # Node 0 is the clock: 1 turn a unit of time, 3 maxima, so two turns after the first maximum.
    assert len(np.asarray(data.t)) == 201
    assert np.asarray(data.t)[[0, -1]] == pytest.approx([1.0, 3.0])
    assert data.peak == 4
    assert np.asarray(data.frequency)[1] == pytest.approx(1.0 / 2.01)
    assert vertex(data)[0] == pytest.approx(2.0, rel=0.01)
    exact = settings.model_copy(update={"refine": "sine-fit"})
    for origin in ("window", "absolute"):
        refined = exact.model_copy(update={"time_origin": origin})
        fitted = window_spectrum(t, u.T, refined, node=1, window=1)[0]
        assert np.asarray(fitted.fit) == pytest.approx(np.asarray(fitted.y), abs=1e-6)
    assert "node 1, window 0 of" in text
    names = ("n_peaks", "n_overlap", "window_reference", "reference_node")
    features = fourier_features(t, u, **{name: getattr(settings, name) for name in names})
    assert features.frequency[1] == pytest.approx(vertex(data)[0], rel=1e-6)


@pytest.mark.slow
def test_pictures_of_other_nodes_and_windows_are_files_of_their_own(
    finished: Path, store: Store, sweep: Sweep
) -> None:
    i = oscillating(store)
    pictures: list[Path] = []
    for options in ((), ("--node", "3"), ("--node", "3", "--window", "1")):
        code, out, _ = sweep("show", finished, *words(store, i), *options)
        assert code == 0
        pictures += [Path(line[9:]) for line in out.splitlines() if line.endswith(".png")]
    chosen = [p.name for p in pictures if "portrait" in p.name or "spectrum" in p.name]
    assert len({name for name in chosen if "spectrum" in name}) == 3
    assert len({name for name in chosen if "portrait" in name}) == 2
