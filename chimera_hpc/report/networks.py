"""The networks of cells that carry a picture: laid out once, coloured by the page's script."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

import numpy as np

from chimera_hpc.network.layout import MOST_SPRING, node_places, picture_order
from chimera_hpc.network.network import Network
from chimera_hpc.plot.raster import bins
from chimera_hpc.reduction.runs import drawn_network
from chimera_hpc.report.content import Content

MOST_BYTES = 1_500_000
MOST_LINKS = 1_500
"""What networks may take of the page, and links of one that are drawn behind its signals."""
_MOST_WORK = 5_000_000
"""Squares of numbers of nodes, in all, that are laid out: about 20 s."""


class DrawnNetworks:
    """Networks of points, each laid out once.

    Parameters
    ----------
    content : Content
    steps : int
        Most nodes, links or triangles of one that have a colour, as in the profiles.
    """

    def __init__(self, content: Content, steps: int) -> None:
        self._content, self._steps = content, steps
        self._numbers: dict[str, int | None] = {}
        self._bytes = self._work = 0
        self.drawn: list[dict[str, Any]] = []
        """What the page's script draws: places x and y, ``marks`` with u and links ``behind``."""

    def of(self, point: int) -> Network | None:
        """Return the network of a point; None without [network], or where it cannot be made."""
        store = self._content.store
        return drawn_network(store.sweep, store.points.row(point), lambda line: None)

    def number(self, point: int) -> int | None:
        """Return the position in `drawn` of a point's network; None where there is no room."""
        network = self.of(point)
        if network is None:
            return None
        if network.digest not in self._numbers:
            self._numbers[network.digest] = self._add(network)
        return self._numbers[network.digest]

    def ordered(self, points: Iterable[int]) -> bool:
        """Tell whether the first of these points has its signals drawn in another order."""
        network = next(filter(None, map(self.of, points)), None)
        return network is not None and picture_order(network, self._signals) is not None

    @property
    def _signals(self) -> str:
        return self._content.store.sweep.signals

    def _add(self, network: Network) -> int | None:
        self._work += min(network.n_nodes, MOST_SPRING) ** 2
        if self._work > _MOST_WORK or self._bytes > MOST_BYTES:
            return None
        made = drawing(network, self._signals, self._steps)
        self._bytes += len(json.dumps(made))
        self.drawn.append(made)
        return len(self.drawn) - 1


def drawing(network: Network, signals: str, steps: int) -> dict[str, Any]:
    """Return a network for the page's script: numbers of nodes count those that are drawn."""
    some = bins(network.size(signals), steps)
    carriers = {"links": network.links, "triangles": network.triangles}
    sides = carriers.get(signals)
    marks = some[:, None] if sides is None else sides[some]
    links = network.links[bins(network.n_links, MOST_LINKS)] if network.n_links else network.links
    behind = links[:0] if signals == "links" else links
    used, place = np.unique(np.concatenate([marks.ravel(), behind.ravel()]), return_inverse=True)
    x, y = node_places(network)[used].round(3).T.tolist()
    shown = {signals: len(marks)} | ({} if signals == "links" else {"links": len(links)})
    few = [f"{n} of {network.size(what)} {what}" for what, n in shown.items()]
    partly = [text for text in few if len(set(text.split()[:3:2])) > 1]
    return {
        "x": x,
        "y": y,
        "marks": place[: marks.size].reshape(marks.shape).tolist(),
        "behind": place[marks.size :].reshape(-1, 2).tolist(),
        "partly": ", ".join(partly),
    }
