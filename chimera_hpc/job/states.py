"""Sizes of the states of a sweep's points, and checks of initial states and chains."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import nearest, short
from chimera_hpc.job.chains import chain_length
from chimera_hpc.job.initial_file import initial_file
from chimera_hpc.job.models import build
from chimera_hpc.job.networks import distinct, groups_of
from chimera_hpc.job.registry import measures
from chimera_hpc.models.parameters import Column

if TYPE_CHECKING:
    from chimera_hpc.job.spec import Sweep


def state_sizes(sweep: Sweep, columns: Mapping[str, Column]) -> NDArray[np.int64]:
    """Return the numbers of values of u and of v of each point's state, shape (n_points, 2).

    One model is built for each network.
    """
    names = [name for name in distinct(sweep) if name in columns]
    first, of_point = [0], np.zeros(len(columns["seed"]), dtype=np.int64)
    if names:
        first, of_point = groups_of(columns, names)
    rows = [{name: column[i].item() for name, column in columns.items()} for i in first]
    models = [build(sweep, row) for row in rows]
    return np.array([(model.n_nodes, model.n_second) for model in models])[of_point]


def largest_state(sweep: Sweep) -> int:
    """Return the largest number of values of a point's state; 0 without [continue]."""
    if sweep.continue_ is None:
        return 0
    return int(state_sizes(sweep, sweep.points().columns).sum(axis=1).max())


def check_states(sweep: Sweep) -> None:
    """Raise BadInput for a chain whose states change size, and for a file that does not fit."""
    given, digest = sweep.integrator.initial, sweep.integrator.initial_digest
    if sweep.continue_ is None and given is None:
        return
    points = sweep.points()
    sizes = state_sizes(sweep, points.columns)
    if sweep.continue_ is not None:
        _check_chains(sweep.continue_.along, sizes.reshape(-1, chain_length(sweep), 2))
        _check_order(sweep)
    if given is not None and digest is not None:
        states, seeds = initial_file(given, digest), points.columns["seed"]
        for i in sorted({*np.unique(sizes, axis=0, return_index=True)[1], int(seeds.argmax())}):
            try:
                states.check((int(sizes[i, 0]), int(sizes[i, 1])), int(seeds[i]))
            except BadInput as error:
                raise BadInput(f"integrator.initial: {given}: {error}") from None


def _check_order(sweep: Sweep) -> None:
    """Raise BadInput unless the panel has the order parameter; its default may be missing."""
    order, panel = sweep.reduction.order, measures(sweep.measures.panel)
    known = [label for measure in panel for label in measure.labels(sweep.features)]
    if order not in known and "order" in sweep.reduction.model_fields_set:
        raise BadInput(
            f"reduction.order: {short(order)} is no scalar of this sweep{nearest(order, known)}; "
            "[measures] panel chooses them"
        )


def _check_chains(along: str, sizes: NDArray[np.int64]) -> None:
    other = (sizes != sizes[:, :1]).any(axis=2)
    if other.any():
        chain, place = np.argwhere(other)[0]
        had, has = (int(sizes[chain, i].sum()) for i in (place - 1, place))
        raise BadInput(
            f"continue.along: {along}: a state of {had} variables cannot be continued in a point "
            f"that has {has}"
        )
