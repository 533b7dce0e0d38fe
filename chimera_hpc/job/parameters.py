"""The parameters that every sweep has, and the JSON Schema of [grid] and [fixed]."""

from __future__ import annotations

import math
from typing import Any

from chimera_hpc.job.models import built_in
from chimera_hpc.job.networks import KINDS, kind_parameters
from chimera_hpc.models.parameters import Parameter

SEED = Parameter("seed", int, None, "Number of the random initial state.", low=0, high=2**63 - 1)
SEED_COUNT = Parameter("seeds", int, None, "Number of seeds.", low=1, high=10**9)
DIRECTION = Parameter(
    "direction", int, None, "Direction along the chain: 1 forward, -1 backward.", low=-1, high=1
)
DELTA = Parameter("delta", float, None, "Radius of the ball of initial states.", low=0)


def _schema(parameters: list[Parameter], axis: bool) -> dict[str, Any]:
    """Return the JSON Schema of a table with these parameters as keys, for numbers or for axes."""
    properties: dict[str, Any] = {}
    for parameter in parameters:
        number: dict[str, Any] = {"type": "integer" if parameter.kind is int else "number"}
        bounds = {
            "minimum": parameter.low,
            "maximum": parameter.high,
            "exclusiveMinimum": parameter.above,
        }
        number |= {key: bound for key, bound in bounds.items() if math.isfinite(bound)}
        values = {"type": "array", "items": number, "minItems": 1, "uniqueItems": True}
        entry = {"anyOf": [number, values, {"type": "string"}, _LINSPACE]} if axis else number
        properties[parameter.name] = {**entry, "description": parameter.text}
    return {"properties": properties, "additionalProperties": False}


_LINSPACE = {
    "type": "object",
    "properties": {"linspace": {"type": "array", "minItems": 3, "maxItems": 3}},
    "required": ["linspace"],
    "additionalProperties": False,
}


def _of_networks() -> list[Parameter]:
    return [parameter for kind in KINDS for parameter in kind_parameters(kind)]


def grid_schema() -> dict[str, Any]:
    """Return the JSON Schema of [grid] for all models together."""
    parameters = [*_of_networks(), *(p for m in built_in().values() for p in m.parameters)]
    seeds = Parameter("seeds", int, 1, "A count n, seeds 0..n-1, or a list of seeds.", low=0)
    return _schema([*parameters, DELTA, seeds], axis=True)


def fixed_schema() -> dict[str, Any]:
    """Return the JSON Schema of [fixed] for all models together."""
    of_models = [p for model in built_in().values() for p in (model.n_nodes, *model.parameters)]
    parameters = [*_of_networks(), *of_models]
    return _schema(parameters, axis=False)
