"""A store as one labelled dataset."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.job.registry import measures
from chimera_hpc.measures.conventions import PRESETS
from chimera_hpc.store.reduction import StoredReduction, read_reduction
from chimera_hpc.store.store import Store

if TYPE_CHECKING:
    import xarray as xr

STORE_NAME = "store.zarr"
"""Name of the store in the folder of a sweep."""


def open_sweep(path: str | Path) -> xr.Dataset:
    """Open the folder of a sweep, or its store, as a dataset with a variable per quantity.

    Parameters
    ----------
    path : path
        The sweep's folder, or the store.zarr in it; while the sweep runs, too.

    Returns
    -------
    xarray.Dataset
        Features are ``amplitude(point, node)`` and so on, scalars ``V_theta(point)``, the ledger's
        fields ``status(point)``; all NaN where a point has no result. With u on links or triangles,
        that dimension is called ``link`` or ``triangle``; the coordinate `size` gives their number
        for each point; values beyond are NaN. Coordinates are the parameters and `cell`, the number
        of the point's combination of all parameters but the seed:
        ``set_index(point=["cell", "seed"]).unstack()`` makes them dimensions. For each cut k
        of the reduction, ``class_k(point)`` is the class of a run and ``modal_class_k(point)`` that
        of its cell, as texts, empty where there is none; those of another convention of the panel
        end as its scalars do, ``class_k_printed``. `u` and features are read when used. The
        attribute `units` of each variable is its unit.

    Raises
    ------
    BadInput
        When there is no store, or its metadata are damaged.

    Examples
    --------
    >>> data = chimera_hpc.open("results/quickstart")  # doctest: +SKIP
    >>> data.where(data.P == 12, drop=True).class_3.values[:2]  # doctest: +SKIP
    array(['chimera', 'chimera'], dtype='<U10')
    """
    # xarray takes half a second to import, and a worker has no use for it.
    import xarray as xr

    store = Store.open(_store_in(Path(path)))
    try:
        stored = xr.open_zarr(store.path, chunks={})
        for name in stored.coords:
            # A selection needs their values, and xarray indexes by no Dask array.
            stored.variables[name].load()
    except (ValueError, KeyError, TypeError, OSError):
        # We know better than what the file says: its copy is sound.
        raise BadInput(f"{store.path}: its metadata are damaged; `run` writes them again") from None
    ledger = store.ledger()
    tables: dict[str, Mapping[str, NDArray[Any]]] = {"scalars": store.scalars(), "ledger": ledger}
    if "quality" in stored:
        tables["quality"] = store.quality()
    dataset: xr.Dataset = stored.drop_vars(["features", *tables])
    dataset = dataset.assign_coords(cell=("point", store.points.cells()[0], _attributes("cell")))
    if store.sweep.signals != "nodes":
        size = (store.sizes, _attributes(f"number of {store.sweep.signals}"))
        dataset = dataset.assign_coords(size=("point", *size))
    features = stored["features"]
    never = ledger["status"] == Status.NEVER
    if never.any():
        # Chunks that were written before their ledger chunk could be are no results.
        features = features.where(xr.DataArray(~never, dims="point"))
    for k, (label, unit) in enumerate(_labels(stored["features"])):
        dataset[label] = features.isel(feature=k)
        dataset[label].attrs = _attributes(label, unit)
    for name, columns in tables.items():
        for label, unit in _labels(stored[name]):
            dataset[label] = ("point", columns[label], _attributes(label, unit))
    return dataset.assign(_classes(store, ledger["status"], tables["scalars"]))


def reductions(store: Store) -> Iterator[tuple[str, StoredReduction]]:
    """Yield what the last reduction stored under each convention that the sweep measures.

    With each comes the end of the convention's names, as in ``V_theta_printed``: nothing for the
    sweep's own. A reduction that does not cover all points, as the sweep was extended, is left out.
    """
    panel = store.sweep.measures.panel
    for name in ("", *(name for name in panel if name in PRESETS)):
        suffix = (
            measures([name])[0].labels(store.sweep.features)[0][len("V_theta") :] if name else ""
        )
        with suppress(BadInput):
            found = read_reduction(store.path.parent / name if name else store.path)
            columns = [x for key, x in found.arrays.items() if key == "cell" or "labels_" in key]
            if all(len(column) == store.n_points for column in columns):
                yield suffix, found


def cuts_in(reduction: StoredReduction) -> list[str]:
    """Return what the arrays of a reduction's classes are called by: cuts, and the judge's."""
    found = [str(cut) for cut in reduction.attributes.get("cuts", [])]
    return [*found, "judge"] if "names_judge" in reduction.attributes else found


def _classes(
    store: Store, status: NDArray[np.int64], scalars: Mapping[str, NDArray[np.float64]]
) -> dict[str, tuple[str, NDArray[np.str_], dict[str, str]]]:
    """Return the classes of runs and cells in each cut of the last reductions."""
    classes = {}
    for suffix, reduction in reductions(store):
        arrays = reduction.arrays
        codes = scalars.get(f"status{suffix}", status)
        still = np.where(codes == Status.STEADY, -3, np.where(codes == Status.NO_WINDOW, -2, -1))
        for cut in cuts_in(reduction):
            labels, modal = arrays[f"labels_{cut}"], arrays[f"modal_class_{cut}"]
            # The names end with those of runs without a class: steady, no_window, "".
            names = np.array([*reduction.attributes[f"names_{cut}"], ""])
            for name, what, own in (
                (f"class_{cut}{suffix}", "class of the run", np.where(labels < 0, still, labels)),
                (
                    f"modal_class_{cut}{suffix}",
                    "most frequent class of the cell",
                    modal[arrays["cell"]],
                ),
            ):
                classes[name] = "point", names[own], {"long_name": f"{what}, {cut} clusters"}
    return classes


def _store_in(path: Path) -> Path:
    return path / STORE_NAME if (path / STORE_NAME).is_dir() else path


def _labels(array: xr.DataArray) -> list[tuple[str, str]]:
    return list(zip(array.attrs["labels"], array.attrs["label_units"], strict=True))


def _attributes(label: str, unit: str = "1") -> dict[str, str]:
    return {"units": unit, "long_name": label.replace("_", " ")}
