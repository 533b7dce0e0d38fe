"""Series at the resolution of a picture."""

from __future__ import annotations

import numpy as np
import pytest

from chimera_hpc.plot import raster
from chimera_hpc.plot.raster import ROWS, close_up, envelope, n_periods, overview, stretch

T = np.arange(0.0, 50.0, 0.01)


def wave(frequency: float, n_nodes: int = 50, wavelength: float = 50.0) -> np.ndarray:
    place = np.arange(n_nodes)[:, None] / wavelength
    return np.sin(2.0 * np.pi * (frequency * T[:1000] - place))


def test_envelope_holds_every_extreme_and_leaves_out_what_is_missing() -> None:
    u = np.random.default_rng(0).normal(size=(1000, 301))
    u[17, 5], u[18, 5] = 50.0, np.nan
    low, high = envelope(u, 100, 50)
    assert low.shape == high.shape == (100, 50)
    assert np.unravel_index(high.argmax(), high.shape) == (1, 0)
    assert low.min() == np.nanmin(u)
    parts = np.array([np.nanmax(part) for part in np.array_split(u[:10], [6, 12], axis=1)])
    assert high[0, 0] == parts[0]


def test_periods_are_those_of_slow_and_of_fast_nodes() -> None:
    u = np.sin(2.0 * np.pi * np.repeat([1.0, 4.0], 25)[:, None] * T[:1000])
    slow, fast = n_periods(u)
    assert slow == pytest.approx(10.0, abs=1.0)
    assert fast == pytest.approx(40.0, abs=1.0)
    assert n_periods(np.full((5, 100), 1.7)) == (0.0, 0.0)


@pytest.mark.parametrize("frequency", [0.5, 2.0, 4.9, 7.3, 9.9, 19.3])
def test_overview_shows_no_pattern_that_is_not_there(frequency: float) -> None:
    made = overview(T[:1000], wave(frequency), 100)
    if made.is_range:
        assert made.values.min() > 1.5  # all nodes swing, in every dot
    else:
        np.testing.assert_array_equal(made.values.shape[0], 50)
        assert frequency <= 2.0  # five dots a period


def test_steady_and_slow_series_are_drawn_as_they_are() -> None:
    for u in (np.tile([[1.7], [-1.7]], (25, 1000)), wave(0.2)):
        made = overview(T[:1000], u)
        assert not made.is_range
        assert made.nodes == (0, 50)
        assert made.partly == ""


def test_wide_ring_is_drawn_at_some_nodes_only_where_neighbours_are_alike() -> None:
    smooth = wave(0.5, 2000, 2000.0)
    made = overview(T[:1000], smooth)
    assert (made.partly, made.is_range) == ("one node in 7", False)
    np.testing.assert_array_equal(made.values, smooth[::7, 1::2])
    waves = wave(0.5, 2000, 6.9)  # every seventh node would show a long wave
    made = overview(T[:1000], waves)
    assert made.is_range
    assert made.values.min() > 1.5
    near = close_up(T[:1000], waves)
    assert near.partly == f"nodes 0 to {ROWS - 1}"
    assert near.length == f"last half, nodes 0 to {ROWS - 1}"


class Counting:
    """A series that notes how much of it is read at once."""

    def __init__(self, u: np.ndarray) -> None:
        self.u, self.shape, self.read = u, u.shape, []

    def __getitem__(self, nodes: slice) -> np.ndarray:
        part = self.u[nodes]
        self.read.append(part.size)
        return part


@pytest.mark.parametrize(("frequency", "n_nodes"), [(0.5, 250), (0.5, 2000), (19.3, 250)])
def test_series_is_read_in_pieces_and_its_picture_does_not_depend_on_them(
    frequency: float, n_nodes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    u = wave(frequency, n_nodes, 2000.0)
    whole = [overview(T[:1000], u), close_up(T[:1000], u)]
    monkeypatch.setattr(raster, "_PIECE", 8_000)
    counting = Counting(u)
    made = overview(T[:1000], counting)
    reads = [len(counting.read)]
    for counted in (made.periods, None):
        near = close_up(T[:1000], counting, counted=counted)
        reads.append(len(counting.read))
    for one, other in zip(whole, (made, near), strict=True):
        np.testing.assert_array_equal(one.values, other.values)
        assert (one.times, one.nodes, one.length) == (other.times, other.nodes, other.length)
    assert max(counting.read) <= 8_000
    # The nodes whose periods are counted, 63 in pieces of 8, are not read again for the close-up.
    assert (reads[2] - reads[1]) - (reads[1] - reads[0]) == 8


def test_half_a_ring_of_noise_is_a_chimera_at_every_few_nodes() -> None:
    u = wave(1.0, 1000, 1000.0)
    u[500:] = np.random.default_rng(0).permutation(u[500:])
    assert close_up(T[:1000], u).partly == "one node in 4"


def test_stretch_ends_with_the_last_sample() -> None:
    u = np.arange(7.0)[None] * np.ones((3, 1))
    made = stretch(np.arange(7.0), u, 4.0, columns=3)
    assert made.values[0].tolist() == [2.0, 4.0, 6.0]
    assert made.times == (1.0, 7.0)
    assert stretch(np.arange(7.0), u, 2.0).values[0].tolist() == [4.0, 5.0, 6.0]
