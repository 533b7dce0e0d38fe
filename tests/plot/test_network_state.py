"""Pictures of a network with a run on it, and of its signals by community."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.animation import PillowWriter
from matplotlib.collections import LineCollection, PathCollection, PolyCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from PIL import Image

from chimera_hpc import Network
from chimera_hpc.measures.fourier import FEATURES
from chimera_hpc.network.layout import node_places
from chimera_hpc.plot import network_state, style
from chimera_hpc.plot.animation import animate
from chimera_hpc.plot.network_state import Drawing, NetworkState, network_states
from chimera_hpc.plot.ordered import OrderedRows, in_order
from chimera_hpc.plot.spacetime import space_time

SQUARE = Network(4, [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2)]).with_triangles("cliques")
KINDS = {"nodes": PathCollection, "links": LineCollection, "triangles": PolyCollection}


def state(signals: str, **changes: object) -> NetworkState:
    n = SQUARE.size(signals)
    features = np.arange(8.0)[:, None] + 0.1 * np.arange(n)
    given = {"network": SQUARE, "signals": signals, "class_name": "chimera", "features": features}
    return NetworkState(**{**given, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize("signals", KINDS)
def test_what_carries_u_has_the_colours_of_class_and_features(
    signals: str, rendered: Callable[[Figure], Figure]
) -> None:
    figure = rendered(network_states([state(signals)]))
    structure, *panels = figure.axes[:4]
    colours = {
        to_hex(colour)
        for made in structure.collections
        if isinstance(made, KINDS[signals])
        for colour in (made.get_edgecolor() if signals == "links" else made.get_facecolor())
    }
    assert style.BLUE in colours
    for panel, name in zip(panels, ("amplitude", "phase", "frequency"), strict=True):
        (values,) = [made.get_array() for made in panel.collections if made.get_array() is not None]
        row = FEATURES.index(name)
        np.testing.assert_allclose(values, row + 0.1 * np.arange(SQUARE.size(signals)))


@pytest.mark.parametrize("signals", KINDS)
def test_a_film_shows_the_network_in_the_colours_of_u(
    signals: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Any] = []

    def grab(self: PillowWriter, **_: Any) -> None:
        panel = self.fig.axes[0]
        (shown,) = [made for made in panel.collections if made.get_array() is not None]
        assert isinstance(shown, KINDS[signals])
        seen.append(np.array(shown.get_array()))
        self._frames.append(Image.new("RGB", (4, 4)))

    monkeypatch.setattr(PillowWriter, "grab_frame", grab)
    u = np.random.default_rng(0).normal(size=(3, SQUARE.size(signals)))
    drawing = Drawing(SQUARE, signals, node_places(SQUARE))
    animate(tmp_path / "film.gif", np.arange(3.0), u, -u, drawing=drawing)
    np.testing.assert_array_equal(seen, u)
    assert (tmp_path / "film.gif").is_file()


def test_runs_share_the_scale_of_a_feature_and_a_flat_one_looks_flat() -> None:
    features = np.ones((8, 4))
    figure = network_states([state("nodes"), state("nodes", features=features)])
    scales = [axes.collections[-1].norm for axes in figure.axes[:8]]
    amplitude = FEATURES.index("amplitude")
    assert (scales[1].vmin, scales[1].vmax) == (min(amplitude, 1.0), max(amplitude + 0.3, 1.0))
    assert (scales[2].vmin, scales[2].vmax) == (-np.pi, np.pi)
    flat = network_states([state("nodes", features=features)]).axes[1].collections[-1].norm
    assert (flat.vmin, flat.vmax) == pytest.approx((0.99, 1.01))


def test_run_that_does_not_oscillate_shows_its_network() -> None:
    figure = network_states([state("nodes", features=None, class_name="steady")])
    assert [text.get_text() for text in figure.axes[1].texts] == ["does not oscillate"]


def test_large_networks_are_drawn_in_part_and_say_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(network_state, "MOST_DRAWN", 50)
    ring = Network.ring(60, 2)
    features = np.ones((8, 60))
    figure = network_states([NetworkState(ring, "P = 2", features=features)])
    assert figure.axes[0].get_title(loc="left") == ""
    assert figure.axes[0].get_title() == "P = 2\n50 of 60 nodes, 50 of 120 links"
    assert len(figure.axes[1].collections[-1].get_offsets()) == 50


def test_space_time_has_rows_by_community_and_says_what_they_are() -> None:
    network = Network.modular([4, 4], 1.0, 0.1, seed=0).relabel([0, 4, 1, 5, 2, 6, 3, 7])
    t = np.arange(0.0, 4.0, 0.1)
    u = np.sin(2.0 * np.pi * t) * (1.0 + network.communities)[:, None]
    rows = in_order(u, network)
    assert isinstance(rows, OrderedRows)
    assert rows.bounds == (4,)
    np.testing.assert_array_equal(rows[0:8], u[network.order])
    drawn = space_time([(t, rows)])
    assert drawn.axes[0].get_ylabel() == "nodes, by community"
    assert [line.get_ydata()[0] for line in drawn.axes[0].lines] == [3.5]
    plain = space_time([(t, in_order(u, Network.ring(8, 1)))], signals="links")
    assert plain.axes[0].get_ylabel() == "link $i$"
