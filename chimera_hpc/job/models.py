"""The model that a job names: one of the registry, or a user's ``package.module:object``."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from functools import cache
from importlib import import_module, invalidate_caches
from pathlib import Path
from types import ModuleType
from typing import Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import nearest, short
from chimera_hpc.job import registry
from chimera_hpc.models.parameters import ModelParameters
from chimera_hpc.models.protocol import Model, ModelKind

_MODULE = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", re.ASCII)


def model_kind(name: str) -> ModelKind:
    """Return the model of this name. Raises BadInput for a name that is not in the registry.

    ``package.module:object`` is a user's model, see `user_model`.
    """
    if ":" in name:
        own: ModelKind = user_model(name)
        return own
    if name not in registry.MODELS:
        known = nearest(name, list(registry.MODELS))
        raise BadInput(f"model: {short(name)} is not a known model{known}")
    found: ModelKind = registry.load(registry.MODELS[name])
    return found


def parameters_of(name: str) -> ModelParameters:
    """Return the table of parameters of a model. Raises BadInput as `model_kind` does."""
    return model_kind(name).parameters


def built_in() -> dict[str, ModelParameters]:
    """Return the tables of parameters of all models of the registry, by name."""
    return {name: parameters_of(name) for name in registry.MODELS}


def build(sweep: Any, row: Mapping[str, int | float]) -> Model:
    """Return the model of one point of a sweep, from its row of columns."""
    return model_kind(sweep.model).build(sweep, row)


@cache
def user_model(name: str) -> Any:
    """Return the object that ``package.module:object`` names.

    The object has ``parameters``, a `ModelParameters`, and ``build(sweep, row)``, which returns a
    `chimera_hpc.models.protocol.Model` for the point with this row of columns.
    `chimera_hpc.models.custom.OwnModel` provides both. The module is searched for on the Python
    path first, then in the folders of `look_in`, also by the workers.

    Raises BadInput: the module does not exist or cannot be imported, or the object is not a model.
    """
    module, _, attribute = name.partition(":")
    where = f"model: {short(name)}"
    if not (_MODULE.fullmatch(module) and attribute.isidentifier()):
        raise BadInput(f"{where} is not of the form package.module:object")
    try:
        found = getattr(_import(module), attribute)
    except Exception as error:
        # The import of a user's module may raise any exception.
        text = " ".join(f"{type(error).__name__}: {error}".split())
        if isinstance(error, ModuleNotFoundError) and error.name == module.partition(".")[0]:
            text += "; it must be in the job's folder, the current one, or on PYTHONPATH"
        raise BadInput(f"{where} can't be imported: {text}") from None
    if not isinstance(getattr(found, "parameters", None), ModelParameters):
        raise BadInput(f"{where} has no attribute parameters of type ModelParameters")
    if not callable(getattr(found, "build", None)):
        raise BadInput(f"{where} has no method build(sweep, row)")
    return found


def _import(module: str) -> ModuleType:
    """Import a module without writing its bytecode to the disk.

    Python detects stale bytecode by the time of the last change, in whole seconds, and the size of
    the source. It may miss an edit.
    """
    before = sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    try:
        invalidate_caches()
        return import_module(module)
    finally:
        sys.dont_write_bytecode = before


def look_in(folder: str | Path) -> None:
    """Append a folder to the places where modules of users' models are searched for."""
    place = str(Path(folder).absolute())
    if place not in sys.path:
        sys.path.append(place)


def model_folder(model: str) -> str | None:
    """Return the folder that holds the module of a user's model; None for other models."""
    if ":" not in model:
        return None
    user_model(model)
    module = model.partition(":")[0]
    file = getattr(sys.modules[module], "__file__", None)
    if file is None:
        return None
    place = Path(file).absolute()
    levels = module.count(".") + (place.name == "__init__.py")
    return str(place.parents[levels])
