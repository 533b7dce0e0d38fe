"""Figures of a sweep that `chimera_hpc.open` gives, or of runs (t, u)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.fourier import FEATURES, measure_signals
from chimera_hpc.pipeline.runs import signal_runs
from chimera_hpc.plot.indicators import fourier_indicators, profiles_of
from chimera_hpc.plot.modes import modal_classes
from chimera_hpc.plot.projections import projections
from chimera_hpc.plot.spacetime import space_time as draw_space_time

MOST = 12
"""Runs that are drawn at most, the first ones."""
_TRIPLET = ("V_theta", "V_a", "V_Omega")
_NO_AXES = ("cell", "seed", "size")


def space_time(data: Any, *, titles: Sequence[str] = (), step: float = 1.0, **where: Any) -> Figure:
    """Draw u over node and time, a panel for each run.

    Parameters
    ----------
    data : xarray.Dataset, or runs
        What `chimera_hpc.open` gives, or a run (t, u), a list of them, or an array (runs, times,
        nodes).
    titles : sequence of str
        Default for a dataset: parameters and class of each run.
    step : float
        Time between two samples of runs that have no times.
    **where
        Of a dataset: values of coordinates, such as ``P=[9, 12], seed=0``. Default: the first run
        of each class.
    """
    chosen, made = _chosen(data, where)
    runs = [(np.asarray(run.t), np.asarray(run.u).T) for run in signal_runs(chosen, step)]
    return draw_space_time(runs, list(titles) or made)


def profiles(data: Any, *, titles: Sequence[str] = (), step: float = 1.0, **where: Any) -> Figure:
    """Draw phase, amplitude and frequency of each node, a column for each run that oscillates.

    Arguments as in `space_time`. Runs (t, u) are measured as `chimera_hpc.fourier_features` does.
    """
    chosen, made = _chosen(data, where)
    if _is_dataset(chosen):
        tables = [
            np.stack([np.asarray(chosen[name].isel(point=i)) for name in FEATURES])
            for i in range(chosen.sizes["point"])
        ]
    else:
        tables = [measure_signals(run.t, run.u).as_array() for run in signal_runs(chosen, step)]
    return fourier_indicators([profiles_of(table) for table in tables], list(titles) or made)


def variations(
    data: Any, classes: Iterable[str | None] | None = None, *, clusters: int | None = None
) -> Figure:
    """Draw the total variations of all runs in three planes and in space, coloured by class.

    Parameters
    ----------
    data : xarray.Dataset, or array_like of shape (n, 3)
        What `chimera_hpc.open` gives, or triplets.
    classes : sequence of str, optional
        Class of each run; default: that of the dataset, or none.
    clusters : int, optional
        Cut of the dataset; default: the first.
    """
    if _is_dataset(data):
        triplets = np.stack([np.asarray(data[name]) for name in _TRIPLET], axis=1)
        classes = _classes(data, "class", clusters) if classes is None else classes
    else:
        triplets = np.asarray(data, dtype=np.float64)
    found = [name or "" for name in (classes if classes is not None else ["runs"] * len(triplets))]
    known = np.isfinite(triplets).all(axis=1)
    names = sorted({name for name, ok in zip(found, known, strict=True) if ok and name})
    labels = [
        names.index(name) if ok and name else -1 for name, ok in zip(found, known, strict=True)
    ]
    return projections(triplets, labels, names)


def classes(data: Any, *, clusters: int | None = None) -> Figure:
    """Draw the modal class of each cell against the one or two parameters that vary.

    Parameters
    ----------
    data : xarray.Dataset
        What `chimera_hpc.open` gives, reduced.
    clusters : int, optional
        Cut of the dataset; default: the first.

    Raises
    ------
    BadInput
        A sweep that has not been reduced, or in which three or more parameters vary.
    """
    modal = _classes(data, "modal_class", clusters)
    _, first, cell_of_run = np.unique(
        np.asarray(data["cell"]), return_index=True, return_inverse=True
    )
    axes = _axes(data, first)
    if len(axes) not in (1, 2):
        raise BadInput(f"{len(axes)} parameters vary ({', '.join(axes)}); 1 or 2 can be drawn")
    columns = [(f"${name}$", np.asarray(data[name])[first]) for name in axes]
    votes = [Counter[str]() for _ in first]
    for cell, name in zip(cell_of_run, _classes(data, "class", clusters), strict=True):
        if name:
            votes[cell][name] += 1
    return modal_classes(columns, [modal[i] or None for i in first], votes)


def _is_dataset(data: Any) -> bool:
    return hasattr(data, "data_vars")


def _chosen(data: Any, where: dict[str, Any]) -> tuple[Any, list[str]]:
    """Return the runs to draw and their titles."""
    if not _is_dataset(data):
        if where:
            raise BadInput(f"{next(iter(where))}: runs have no coordinates; a dataset has")
        is_run = hasattr(data, "u") or (isinstance(data, tuple) and np.ndim(data[0]) == 1)
        return ([data] if is_run else data[:MOST]), []
    points = _points(data, where)
    axes = [*_axes(data, np.arange(data.sizes["point"])), *(["seed"] if "seed" in data else [])]
    chosen = data.isel(point=points)
    names = _classes(chosen, "class", None) if _cuts(data) else [""] * len(points)
    titles = [
        ", ".join(f"${axis}$ = {chosen[axis].values[i]:g}" for axis in axes)
        + (f"\n{name}" if name else "")
        for i, name in enumerate(names)
    ]
    return chosen, titles


def _points(data: Any, where: dict[str, Any]) -> NDArray[np.int64]:
    unknown = [name for name in where if name not in data.coords]
    if unknown:
        raise BadInput(f"{unknown[0]}: the dataset has {', '.join(map(str, data.coords))}")
    if where or not _cuts(data):
        fits = np.ones(data.sizes["point"], dtype=np.bool_)
        for name, values in where.items():
            fits &= np.isin(np.asarray(data[name]), values)
        found = np.flatnonzero(fits)[:MOST]
    else:
        names = np.array(_classes(data, "class", None))
        found = np.array([np.flatnonzero(names == name)[0] for name in sorted({*names} - {""})])
    if not len(found):
        raise BadInput(
            f"no run has {', '.join(f'{k} = {v}' for k, v in where.items()) or 'a class'}"
        )
    return found.astype(np.int64)


def _cuts(data: Any) -> list[int]:
    names = (str(name) for name in data.data_vars)
    return [int(name.removeprefix("class_")) for name in names if name.startswith("class_")]


def _classes(data: Any, kind: str, clusters: int | None) -> list[str]:
    cuts = _cuts(data)
    if not cuts or (clusters is not None and clusters not in cuts):
        known = f"it has cuts into {', '.join(map(str, cuts))}" if cuts else "`reduce` makes them"
        raise BadInput(f"no classes of this cut in the dataset: {known}")
    return list(map(str, np.asarray(data[f"{kind}_{clusters or cuts[0]}"])))


def _axes(data: Any, points: ArrayLike) -> list[str]:
    """Return the parameters that vary among points, one of those that are equal throughout."""
    found: dict[str, NDArray[Any]] = {}
    for name, column in data.coords.items():
        if column.dims == ("point",) and name not in _NO_AXES and column.dtype.kind in "iuf":
            values = np.asarray(column)[np.asarray(points)]
            twin = any(np.array_equal(values, other) for other in found.values())
            if not twin and len(values) and (values != values[0]).any():
                found[str(name)] = values
    return list(found)
