"""The model that a job names: one of the registry, or a user's ``package.module:object``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import nearest, short
from chimera_hpc.job import registry
from chimera_hpc.job.user_models import Origin, prints_to_stderr, user_model, user_source
from chimera_hpc.models.parameters import ModelParameters
from chimera_hpc.models.protocol import Model, ModelKind

if TYPE_CHECKING:
    from chimera_hpc.job.spec import Sweep


def model_kind(name: str, origin: Origin | None = None) -> ModelKind:
    """Return the model of this name. Raises BadInput for a name that is not in the registry.

    ``package.module:object`` is a user's model, see `user_models.user_model`.
    """
    if ":" in name:
        own: ModelKind = user_model(name, origin).kind
        return own
    if name not in registry.MODELS:
        known = nearest(name, list(registry.MODELS))
        raise BadInput(f"model: {short(name)} is not a known model{known}")
    found: ModelKind = registry.load(registry.MODELS[name])
    return found


def parameters_of(name: str, origin: Origin | None = None) -> ModelParameters:
    """Return the table of parameters of a model. Raises BadInput as `model_kind` does."""
    if origin is not None and origin.table is not None:
        return origin.table
    return model_kind(name, origin).parameters


def built_in() -> dict[str, ModelParameters]:
    """Return the tables of parameters of all models of the registry, by name."""
    return {name: parameters_of(name) for name in registry.MODELS}


def build(sweep: Sweep, row: Mapping[str, int | float]) -> Model:
    """Return the model of one point of a sweep, from its row of columns.

    A parameter that was added to a user's model after the sweep was planned has its default.
    """
    kind = model_kind(sweep.model, sweep.origin)
    if ":" not in sweep.model:
        return kind.build(sweep, row)
    defaults = {p.name: p.default for p in kind.parameters.parameters if p.default is not None}
    with prints_to_stderr():
        return kind.build(sweep, {**defaults, **row})


def model_folder(sweep: Sweep) -> str | None:
    """Return the folder of the module of a user's model; None for other models."""
    if ":" not in sweep.model:
        return None
    if sweep.origin.table is not None:
        return sweep.origin.folders[0]
    found = user_source(sweep.model, sweep.origin)
    return None if found is None else str(found.folder)
