"""The results of chains: classes and an order parameter along them, thresholds, hysteresis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.classify.hysteresis import Threshold, band, class_thresholds, largest_step
from chimera_hpc.job.chains import FORWARD
from chimera_hpc.reduction.cells import number
from chimera_hpc.store.store import Store

_WAYS = ("forward", "backward")


def chain_results(
    store: Store, classes: Sequence[str | None], scalars: Mapping[str, NDArray[np.float64]]
) -> dict[str, Any]:
    """Return ``chains`` and ``hysteresis`` of results.json; nothing for a sweep without chains.

    classes: class of each run, None without a result.
    """
    if store.sweep.continue_ is None:
        return {}
    order = store.sweep.reduction.order
    if order not in scalars:
        order = next(iter(scalars))
    chains = [
        entry
        for block in range(store.n_blocks)
        for entry in _of_block(store, np.arange(*store.block(block)), classes, scalars[order])
    ]
    return {"chains": chains, "hysteresis": _hysteresis(chains, order)}


def _of_block(
    store: Store,
    rows: NDArray[np.int64],
    classes: Sequence[str | None],
    order: NDArray[np.float64],
) -> list[dict[str, Any]]:
    """Return an entry for each direction of a chain."""
    assert store.sweep.continue_ is not None
    along, columns = store.sweep.continue_.along, store.points.columns
    others = [name for name in store.points.axes if name not in (along, "direction", "seed")]
    found = []
    for way in dict.fromkeys(columns["direction"][rows].tolist()):
        mine = rows[columns["direction"][rows] == way]
        x, names, levels = columns[along][mine], [classes[i] for i in mine], order[mine]
        step = largest_step(x, levels)
        found.append(
            {
                **{name: columns[name][mine[0]].item() for name in others},
                "seed": int(columns["seed"][mine[0]]),
                "along": along,
                "direction": _WAYS[way != FORWARD],
                "values": x.tolist(),
                "classes": names,
                "order": levels.tolist(),
                "thresholds": [_plain(one) for one in class_thresholds(x, names)],
                "step": None if step is None else _plain(step),
            }
        )
    return found


def _plain(found: Threshold) -> dict[str, Any]:
    return {
        "between": list(found.between),
        "at": float(found.at),
        "interval": [float(end) for end in found.interval],
    }


def _threshold(entry: Mapping[str, Any]) -> Threshold:
    low, high = entry["interval"]
    return Threshold(tuple(entry["between"]), (low, high))


def _hysteresis(chains: Sequence[Mapping[str, Any]], order: str) -> list[dict[str, Any]]:
    """Return for each cell of the other axes the thresholds of both directions over its chains."""
    cells: dict[tuple[Any, ...], dict[str, Any]] = {}
    for chain in chains:
        place = dict(list(chain.items())[: list(chain).index("seed")])
        entry = {**place, "along": chain["along"], "order": order}
        cells.setdefault(tuple(place.values()), {**entry, "of": []})["of"].append(chain)
    return [_of_cell(cell, cell.pop("of")) for cell in cells.values()]


def _of_cell(cell: dict[str, Any], chains: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    for way in _WAYS:
        mine = [chain for chain in chains if chain["direction"] == way]
        if not mine:
            continue
        steps = [_threshold(chain["step"]) for chain in mine if chain["step"] is not None]
        passages: dict[tuple[str, str], list[Threshold]] = {}
        for threshold in (_threshold(each) for chain in mine for each in chain["thresholds"]):
            passages.setdefault(threshold.between, []).append(threshold)
        cell[way] = {
            "step": band(steps) if steps else None,
            "classes": [{"between": list(pair), **band(them)} for pair, them in passages.items()],
        }
    return cell


def chain_lines(results: Mapping[str, Any]) -> list[str]:
    """Return the thresholds of both directions in words, a line for each cell and direction."""
    lines = []
    for cell in results.get("hysteresis", []):
        known = ("along", "order", *_WAYS)
        place = ", ".join(f"{k} = {number(v)}" for k, v in cell.items() if k not in known)
        for way in (way for way in _WAYS if way in cell):
            words = [
                f"{' to '.join(each['between'])} {_where(each)}" for each in cell[way]["classes"]
            ]
            if cell[way]["step"] is not None:
                words.append(f"largest step of {cell['order']} {_where(cell[way]['step'])}")
            text = f"{cell['along']} {way}: {'; '.join(words)}"
            lines.append(f"{place}: {text}" if place else text)
    return lines


def _where(found: Mapping[str, Any]) -> str:
    low, high = (number(end) for end in found["interval"])
    return f"at {number(found['at'])} [{low}, {high}]"
