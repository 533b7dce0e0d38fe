"""The JSON Schema of a job file, for editors and other tools.

It is made from the tables that check a job. It covers single keys, not conditions between keys
(2 P below n_nodes, a range that is not empty). A file that is valid by the schema may still be
refused; `plan` then gives the reason.
"""

from __future__ import annotations

import json
from typing import Any

from chimera_hpc.job.models import built_in
from chimera_hpc.job.networks import KINDS, kind_parameters
from chimera_hpc.job.parameters import DELTA
from chimera_hpc.job.registry import ANALYSES, CUT_FIGURES, FIGURES
from chimera_hpc.job.spec import Sweep
from chimera_hpc.job.tables import TABLES, Reduction
from chimera_hpc.models.parameters import ModelParameters

FILE_NAME = "job.schema.json"
"""File name of the schema, in the folder of the job files that come with the package."""

_USER_MODEL = {"type": "string", "pattern": ":", "description": "package.module:object"}
_AT_LEAST_ONE = {  # keys of which a list may be written as one value
    "reduction": ("atlas", "beside")
}


def job_schema() -> dict[str, Any]:
    """Return the schema as plain data (JSON Schema, draft 2020-12).

    Only the parameters of the model are allowed in [grid] and [fixed]. For a user's model, whose
    parameters are not known here, any are allowed.
    """
    schema: dict[str, Any] = Sweep.model_json_schema()
    properties = schema["properties"]
    known = {"enum": list(built_in())}
    properties["model"] = {
        "anyOf": [known, _USER_MODEL],
        "description": properties["model"]["description"],
    }
    for table in ("decide", "network", "continue"):
        properties[table] = {"$ref": properties[table]["anyOf"][0]["$ref"]}
    added = properties["added"]
    properties["added"] = {**added["anyOf"][0], "description": added["description"]}
    for table in ("grid", "fixed"):
        del properties[table]["additionalProperties"]
        properties[table].pop("default", None)
    for table, names in _AT_LEAST_ONE.items():
        keys = schema["$defs"][TABLES[table].__name__]["properties"]
        for name in names:
            _allow_one(keys[name])
    _name_figures_and_analyses(schema["$defs"][Reduction.__name__]["properties"])
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "Job file of chimera_hpc",
        "allOf": [
            rule
            for name, model in built_in().items()
            for rule in (_only_for(name, model), _only_for(name, _anywhere(model), "network"))
        ],
    }


def schema_text() -> str:
    """Return the schema as the text of a file."""
    return json.dumps(job_schema(), indent=1, ensure_ascii=False) + "\n"


def _anywhere(model: ModelParameters) -> ModelParameters:
    """Return the parameters of a model on any kind of network."""
    added = {p.name: p for kind in KINDS for p in kind_parameters(kind)}
    own = tuple(p for p in model.parameters if p.name not in added)
    return ModelParameters(model.n_nodes, (*added.values(), *own))


def _only_for(name: str, model: ModelParameters, table: str = "") -> dict[str, Any]:
    """Return the rule that [grid] and [fixed] hold only parameters of this model.

    It is for jobs with this table, or for those without [network].
    """
    parameters = [parameter.name for parameter in model.parameters]
    numbers = () if table else (model.n_nodes, *model.parameters)
    defaults = {p.name: {"default": p.default} for p in numbers if p.default is not None}
    allowed = {
        "grid": {"propertyNames": {"enum": [*parameters, DELTA.name, "seeds"]}},
        "fixed": {
            "propertyNames": {"enum": [model.n_nodes.name, *parameters]},
            **({"properties": defaults} if defaults else {}),
        },
    }
    named = {"properties": {"model": {"const": name}}, "required": ["model"]}
    # A network of the user's own has parameters that are not known here.
    shipped = {"network": {"properties": {"kind": {"not": {"pattern": ":"}}}}}
    there: dict[str, Any] = {"required": [table], "properties": shipped}
    if not table:
        there = {"not": {"required": ["network"]}}
    return {"if": {"allOf": [named, there]}, "then": {"properties": allowed}}


def _name_figures_and_analyses(keys: dict[str, Any]) -> None:
    cuts = "|".join(CUT_FIGURES)
    figure = {"anyOf": [{"enum": list(FIGURES)}, {"pattern": f"^({cuts})(_[0-9]+)?$"}]}
    for kind in keys["figures"]["anyOf"]:
        kind |= {"items": figure} if kind["type"] == "array" else {"const": "auto"}
    keys["analyses"]["items"] = {"type": "string", "enum": list(ANALYSES)}


def _allow_one(key: dict[str, Any]) -> None:
    of_list = {name: key.pop(name) for name in ("items", "type") if name in key}
    key["anyOf"] = [of_list, of_list["items"]]
