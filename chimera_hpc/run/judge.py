"""The judge of a sweep with [decide]: gives its runs their classes during the rounds.

It is the same in every round, so the class of a run never changes.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.classify.atlas import UNCLASSIFIED, Atlas
from chimera_hpc.classify.classification import classify
from chimera_hpc.classify.naming import Rule
from chimera_hpc.job import Sweep
from chimera_hpc.job.class_names import naming_rule
from chimera_hpc.job.tables import Reduction
from chimera_hpc.store.labelled import STORE_NAME
from chimera_hpc.store.reduction import sibling
from chimera_hpc.store.store import Store

_ONE_CLASS = Atlas(np.zeros((2, 3)), np.zeros((1, 3)), np.zeros(1, np.int64), (UNCLASSIFIED,))


def other_judge(store: Store) -> Atlas | None:
    """Return the first atlas that the job names; None when the first round judges.

    Raises BadInput: the sweep of that name is not there, or has not been reduced.
    """
    decide, names = store.sweep.decide, store.sweep.reduction.atlas
    if decide is None or decide.judge != "atlas":
        return None
    place = sibling(store.path.parent, names[0])
    if place.resolve() == store.path.parent.resolve():
        raise BadInput(
            f"decide.judge: atlas {names[0]} is this sweep itself, whose classes change as it goes "
            "on; leave judge out, or name another sweep"
        )
    try:
        stored = Store.open(place / STORE_NAME).reduction()
        atlas = Atlas.from_arrays(stored.arrays, stored.attributes)
    except BadInput as error:
        raise BadInput(f"decide.judge: atlas {names[0]}: {error}") from None
    if not atlas.names:
        raise BadInput(f"decide.judge: atlas {names[0]}: {place} has no classes")
    return atlas


def judge_warnings(store: Store) -> list[str]:
    """Return a line where another model's sweep judges."""
    decide, names = store.sweep.decide, store.sweep.reduction.atlas
    if decide is None or decide.judge != "atlas":
        return []
    model = Store.open(sibling(store.path.parent, names[0]) / STORE_NAME).sweep.model
    if model == store.sweep.model:
        return []
    return [f"decide.judge: atlas {names[0]} is of the model {model}, not {store.sweep.model}"]


def frozen_judge(
    sweep: Sweep, triplets: NDArray[np.float64], status: NDArray[np.int64], n_first: int
) -> Atlas:
    """Return the classes of the tree over the first `n_first` runs, in the first cut.

    Where none of these runs has a class, all later ones are of one, `UNCLASSIFIED`.
    """
    first = slice(n_first)
    return _first_tree(
        triplets[first].tobytes(), status[first].tobytes(), sweep.reduction, naming_rule(sweep)
    )


@lru_cache(maxsize=1)
def _first_tree(triplets: bytes, status: bytes, spec: Reduction, rule: Rule) -> Atlas:
    """Return the atlas of the first round, whose runs are the same in every round."""
    made = classify(
        np.frombuffer(triplets).reshape(-1, 3),
        np.frombuffer(status, dtype=np.int64),
        linkage=spec.linkage,
        classifier=spec.classifier,
        cuts=spec.cuts[:1],
        depth=None if spec.cuts else spec.depth,
        names=rule,
    )
    cut = next(iter(made.cuts.values()))
    return Atlas.of(made, cut) if cut.names else _ONE_CLASS
