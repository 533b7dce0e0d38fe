"""Names of the classes of a sweep: the paper's names for its own system, otherwise letters."""

from __future__ import annotations

import json

from chimera_hpc.classify.naming import LETTERS, TRIPLET, Rule
from chimera_hpc.job.spec import Sweep
from chimera_hpc.job.tables import Features
from chimera_hpc.measures.conventions import PRESETS


def naming_rule(sweep: Sweep) -> Rule:
    """Return the names that the job gives, else the rule of its classes.

    Ordered, chimera and disordered are the names of the paper's three clusters: they hold for its
    model, on its ring, measured under a preset. The clusters of other runs are A, B, C, ...
    """
    if sweep.reduction.names != TRIPLET:
        return sweep.reduction.names
    return TRIPLET if is_papers_system(sweep) else LETTERS


def is_papers_system(sweep: Sweep) -> bool:
    """Tell whether a sweep is of the paper's model on its ring, measured under a preset."""
    network = sweep.network
    on_ring = network is None or (network.kind == "ring" and network.signals == "nodes")
    return sweep.model == "topological_fhn" and on_ring and _is_preset(sweep.features)


def _is_preset(features: Features) -> bool:
    """Tell whether the keys that presets set are those of one preset."""
    return any(
        all(getattr(features, key) == value for key, value in preset.items())
        for preset in PRESETS.values()
    )


def overridden(features: Features) -> list[str]:
    """Return a line if a job replaces what its preset sets: no preset may be left."""
    preset = PRESETS[features.preset]
    given = {key: getattr(features, key) for key in preset}
    other = [f"{k} = {json.dumps(v)}" for k, v in given.items() if v != preset[k]]
    if not other or features.preset == "default":
        return []
    return [
        f'features.preset = "{features.preset}", but the job itself sets {", ".join(other)}: '
        "only keys that a job leaves out are set by the preset"
    ]
