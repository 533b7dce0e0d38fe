"""``show``: a point, or a cell, computed again and drawn."""

from __future__ import annotations

import re
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.exits import Exit
from chimera_hpc.cli.arguments import add, errors_in_one_line, path_name, store_path, value
from chimera_hpc.cli.ending import name_of
from chimera_hpc.cli.jobs import find_points
from chimera_hpc.network.layout import chosen_layout

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from chimera_hpc.plot.indicators import IndicatorProfiles
    from chimera_hpc.plot.spacetime import PanelRasters
    from chimera_hpc.reduction.replay import Replay
    from chimera_hpc.store.store import Store

EPILOG = """examples:
  python -m chimera_hpc.sweep show results/quickstart P=12 Q=12 seed=3
  python -m chimera_hpc.sweep show results/quickstart P=12 --node 20 --window 2
  python -m chimera_hpc.sweep show results/quickstart P=12 seed=3 --animate film.gif

The run is integrated again, and the result is compared with the store bit for bit; exit status 1:
it differs. Without a seed, the runs of a cell are drawn side by side, with the portrait and
spectrum of a representative run: among the runs of the most frequent class, the one nearest to the
median of their variations. Nodes and windows count from 0, here and in figures.
"""
Array = NDArray[np.float64]

_SIDE_BY_SIDE = 6
"""Most seeds of a cell that are drawn."""
_FRAMES_A_PERIOD = 25


def add_arguments(parser: ArgumentParser) -> None:
    add(
        parser,
        *("folder", "point"),
        node=value("J", int, "node of portrait and spectrum (default: features.reference_node)"),
        window=value("K", int, "window of the spectrum (default: 0)", default=0),
        out=value("DIR", path_name, "where figures go (default: figures/show)"),
        animate=value("FILE", path_name, "write the run as a film, .gif or .mp4"),
        periods=value("N", float, "periods of it (default: 5)", default=5.0),
        layout=value("HOW", str, "network: spring, circular, or a file of x, y", default="auto"),
    )


def execute(args: Namespace) -> int:
    path = store_path(args.folder)
    if not 0.0 < args.periods <= 1000.0:
        raise BadInput(f"--periods {args.periods}: a number above 0, up to 1000, is needed")
    from chimera_hpc.store.store import Store

    store = Store.open(path)
    chosen = find_points(store, args.point)
    node = store.sweep.features.reference_node if args.node is None else args.node
    if not 0 <= node < store.sweep.n_observed:
        raise BadInput(f"--node {node}: allowed is 0 to {store.sweep.n_observed - 1}")
    _one_cell(store, chosen)
    layout = chosen_layout(args.layout)
    from chimera_hpc.plot.animation import check_film
    from chimera_hpc.reduction.replay import replay, representative

    if args.animate is not None:
        check_film(args.animate)
    first = representative(store, chosen) if len(chosen) > 1 else chosen[0]
    shown = sorted({first, *[i for i in chosen if i != first][: _SIDE_BY_SIDE - 1]})
    made = _Pictures(store, first, len(shown))
    for run in replay(store, shown, first):
        made.add(run)
        del run  # or it would stay in memory while the next one is computed
    focus = made.in_focus()
    if len(chosen) > len(shown):
        print(f"{len(shown)} of {len(chosen)} seeds shown")
    if len(shown) > 1:
        print(f"portrait and spectrum: {name_of(store, first)}")
    folder = args.out or path.parent / "figures" / "show"
    figures = made.figures() | _figures_of_one(store, focus, node, args.window)
    figures |= _network_figure(store, focus, layout)
    for written in _save(figures, folder, _stem(store, first, len(shown) == 1)):
        print(f"written: {written}")
    if args.animate is not None:
        _animate(store, focus, args.animate, args.periods, layout)
    return Exit.COMPLETE if made.is_good else Exit.FAILURES


def _one_cell(store: Store, chosen: list[int]) -> None:
    """Refuse points of several cells."""
    mine = store.points[np.asarray(chosen)]
    loose = {name: np.unique(column) for name, column in mine.columns.items() if name != "seed"}
    loose = {name: values for name, values in loose.items() if len(values) > 1}
    if loose:
        cells = len(np.unique(store.points.cells()[0][chosen]))
        some = ", ".join(
            f"{name} ({', '.join(f'{x:g}' for x in values[:4])}{', ...' * (len(values) > 4)})"
            for name, values in loose.items()
        )
        raise BadInput(f"point: these values are those of {cells} cells; say also {some}")


def _tell(store: Store, run: Replay) -> None:
    words = [f"{name_of(store, run.point)}: {run.class_name or 'not classified yet'}"]
    if np.isfinite(run.triplet).all():
        labels = ("V_theta", "V_a", "V_Omega")
        words += [f"{name} {x:.6g}" for name, x in zip(labels, run.triplet, strict=True)]
    print(", ".join(words))
    print(f"  {run.status.sentence}; {run.n_windows} windows")
    digest = f"{run.digest & (2**64 - 1):016x}"
    if run.stored is None:
        print(f"  digest {digest}; the store holds no result of this point yet")
    elif run.is_same:
        print(f"  digest {digest}, as stored: the same bits")
    else:
        print(f"  digest {digest}, stored is {run.stored & (2**64 - 1):016x}: NOT the same")
        for line in _why(store, run.point):
            print(f"    {line}")


def _why(store: Store, point: int) -> list[str]:
    """Return what differs between now and the run that stored a point."""
    from chimera_hpc.store.provenance import differences, gather
    from chimera_hpc.store.runs import read_run

    try:
        before = read_run(store.path, int(store.ledger()["run"][point]))
    except BadInput as error:
        return [str(error)]
    found = differences(before, gather(store.sweep))
    return found or ["nothing known of differs; `verify` looks at the bytes"]


def _stem(store: Store, point: int, with_seed: bool) -> str:
    """Return how the files of a point are called: ``P12_Q12_seed3``."""
    words = name_of(store, point).split()
    if not with_seed:
        words = [word for word in words if not word.startswith("seed=")]
    return re.sub(r"[^\w.+-]", "", "_".join(words).replace("=", "")) or "cell"


class _Pictures:
    """What is drawn of all runs: panels and profiles, made of one run at a time.

    Only the run in focus stays in memory as a whole.
    """

    def __init__(self, store: Store, first: int, count: int) -> None:
        from chimera_hpc.reduction.runs import drawn_network

        self.store, self.first, self.count = store, first, count
        self.network = drawn_network(store.sweep, store.points.row(first), print)
        self.focus: Replay | None = None
        self.is_good = True
        self.panels: list[tuple[str, PanelRasters]] = []
        self.profiles: list[tuple[str, IndicatorProfiles]] = []

    def add(self, run: Replay) -> None:
        """Tell of a run, and keep what is drawn of it."""
        from chimera_hpc.plot.indicators import profiles_of, variations_text
        from chimera_hpc.plot.ordered import in_order
        from chimera_hpc.plot.spacetime import panel_rasters

        _tell(self.store, run)
        self.is_good &= run.is_same or run.stored is None
        if run.begins:
            u = in_order(run.u, self.network, self.store.sweep.signals)
            self.panels.append((run.title, panel_rasters(run.t, u, self.count)))
        if run.n_windows:
            title = f"{run.title}\n{variations_text(run.triplet)}"
            self.profiles.append((title, profiles_of(run.features)))
        if run.point == self.first:
            self.focus = run

    def in_focus(self) -> Replay:
        """Return the run in focus, once it was added."""
        assert self.focus is not None
        return self.focus

    def figures(self) -> dict[str, Figure]:
        """Draw the runs that begin, and the profiles of those with windows."""
        from chimera_hpc.plot.indicators import fourier_indicators
        from chimera_hpc.plot.spacetime import draw_panels

        made: dict[str, Figure] = {}
        signals = self.store.sweep.signals
        if self.panels:
            titles, panels = zip(*self.panels, strict=True)
            made["space_time"] = draw_panels(panels, titles, signals=signals)
        if self.profiles:
            titles, profiles = zip(*self.profiles, strict=True)
            made["profiles"] = fourier_indicators(profiles, titles, signals=signals)
        return made


def _figures_of_one(store: Store, focus: Replay, node: int, window: int) -> dict[str, Figure]:
    """Draw the portrait and the spectrum of the run in focus."""
    from chimera_hpc.plot import style
    from chimera_hpc.plot.portrait import ring_portrait
    from chimera_hpc.plot.spectrum import spectrum
    from chimera_hpc.reduction.replay import has_nullcline, window_spectrum

    figures: dict[str, Figure] = {}
    signals = store.sweep.signals
    # Pictures of another node or window than the default are files of their own.
    at_window = f"-window{window}" if window else ""
    at_node = "" if node == store.sweep.features.reference_node else f"-node{node}"
    if focus.is_whole:
        end = slice(-len(focus.w), None)
        figures[f"portrait{at_node}"] = ring_portrait(
            *(focus.t[end], focus.u.at(end), focus.w, node),
            title=focus.title,
            nullcline=has_nullcline(store.sweep),
            period=focus.period,
            signals=signals,
        )
    if focus.n_windows:
        settings = store.sweep.features
        data, text = window_spectrum(focus.t, focus.u, settings, node, window)
        word = style.SIGNALS[signals]
        print(text.replace("node", word, 1))
        figures[f"spectrum{at_node}{at_window}"] = spectrum(data, f"{word} {node}, window {window}")
    return figures


def _network_figure(store: Store, run: Replay, layout: str | Array) -> dict[str, Figure]:
    """Draw the network with a run on it, where the job has a table [network]."""
    from chimera_hpc.plot.network_state import NetworkState, network_states
    from chimera_hpc.reduction.runs import drawn_network

    network = drawn_network(store.sweep, store.points.row(run.point), lambda line: None)
    if network is None:
        return {}
    features = run.features if run.n_windows else None
    state = NetworkState(network, run.title, store.sweep.signals, run.class_name or "", features)
    return {"network": network_states([state], layout)}


def _save(figures: Mapping[str, Figure], folder: Path, stem: str) -> list[Path]:
    """Write figures; returns the PNG files, each with a PDF next to it."""
    from chimera_hpc.plot.style import save

    with errors_in_one_line(folder):
        folder.mkdir(parents=True, exist_ok=True)
        return [save(figure, folder / f"{stem}-{name}")[0] for name, figure in figures.items()]


def _animate(store: Store, run: Replay, path: Path, periods: float, layout: str | Array) -> None:
    from chimera_hpc.network.layout import node_places
    from chimera_hpc.plot.animation import animate
    from chimera_hpc.plot.network_state import Drawing
    from chimera_hpc.reduction.replay import has_nullcline
    from chimera_hpc.reduction.runs import drawn_network

    if not run.is_whole:
        raise BadInput(f"--animate: {run.status.sentence}: there is nothing to show")
    length = run.t[-1] - run.t[0]
    duration = min(periods * run.period, length) if run.period > 0.0 else 0.1 * length
    step = run.t[1] - run.t[0]
    frame = max(1, round(duration / (periods * _FRAMES_A_PERIOD) / step))
    begin = len(run.t) - len(run.w)
    first = max(begin, int(np.searchsorted(run.t, run.t[-1] - duration)))
    part = slice(first, None, frame)
    title = ", ".join(run.title.split("\n"))
    network = drawn_network(store.sweep, store.points.row(run.point), lambda line: None)
    drawing = None
    if network is not None:
        drawing = Drawing(network, store.sweep.signals, node_places(network, layout))
    animate(
        *(path, run.t[part], run.u.at(part), run.w[first - begin :: frame]),
        drawing=drawing,
        title=title,
        nullcline=has_nullcline(store.sweep),
    )
    print(f"written: {path}")
