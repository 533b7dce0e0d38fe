"""What a store knows of a user's model or network, so that it can be read without the module."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job.user_models import Origin
from chimera_hpc.models.parameters import ModelParameters, Parameter

_OF_EVERY_SWEEP = ("seed", "seeds", "delta", "n_nodes")


def stored_origin(path: Path, root: Mapping[str, Any]) -> Origin:
    """Return where the model of a store comes from, by its root metadata.

    The parameters of a user's model are those of the coordinates over the points, without bounds:
    these were checked by the plan. The module is looked for in the folder in which the plan found
    it, then in that of the sweep.

    Raises
    ------
    BadInput
        The metadata are damaged.
    """
    try:
        attributes, nodes = root["attributes"], root["consolidated_metadata"]["metadata"]
        spec = attributes["spec"]
        if ":" not in spec["model"] and ":" not in spec.get("network", {}).get("kind", ""):
            return Origin()
        folders = [*filter(None, [attributes.get("model_folder")]), str(path.absolute().parent)]
        return Origin(tuple(dict.fromkeys(folders)), _table(spec, nodes))
    except (KeyError, TypeError, AttributeError) as error:
        raise BadInput(f"{path}: the attributes are damaged: {error!r}") from None


def _table(spec: Mapping[str, Any], nodes: Mapping[str, Any]) -> ModelParameters | None:
    """Return the table of parameters; None where a column is none of the job's keys."""
    columns = [n for n in nodes["ledger"]["attributes"]["coordinates"].split() if n in nodes]
    keys = [*spec["fixed"], *spec["grid"]]
    if not {*keys}.issuperset({*columns} - {"seed", "delta"}):
        return None
    # A parameter that came with a later version of the model has no column of its own.
    names = dict.fromkeys((*columns, *keys))
    return ModelParameters(
        n_nodes=Parameter("n_nodes", int, None, "Number of nodes."),
        parameters=tuple(
            _parameter(name, nodes.get(name), spec["fixed"].get(name))
            for name in names
            if name not in _OF_EVERY_SWEEP
        ),
        forms=(spec["integrator"]["form"],),
    )


def _parameter(name: str, node: Mapping[str, Any] | None, fixed: int | float | None) -> Parameter:
    if node is None:
        return Parameter(name, type(fixed) if fixed is not None else float, fixed, name)
    kind: type[int] | type[float] = int if node["data_type"] == "int64" else float
    return Parameter(name, kind, fixed, str(node["attributes"]["long_name"]))
