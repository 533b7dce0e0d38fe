"""What each model may be given: names, defaults, bounds. No kernel is imported here.

For developers: a new model needs one `ModelParameters` in `MODELS`. Its parameters are columns of
the points; the number of nodes is one for a whole sweep.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cache
from importlib import import_module, invalidate_caches
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.errors import BadInput

Column = NDArray[np.int64 | np.float64]
_MODULE = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", re.ASCII)
METHODS = ("tsit5", "dopri5", "verner6", "kcl4")
"""Names of the integrators that a job may ask for."""


@dataclass(frozen=True)
class Parameter:
    """One number that a job sets; the job must set it when `default` is None."""

    name: str
    kind: type[int] | type[float]
    default: int | float | None
    text: str
    low: float = -math.inf
    high: float = math.inf
    above: float = -math.inf
    """Exclusive lower bound."""

    @property
    def allowed(self) -> str:
        """The values that `check` lets through, in words."""
        kind = "an integer" if self.kind is int else "a finite number"
        low = f" from {self.low:g}" if self.low > -math.inf else ""
        low = low or (f" above {self.above:g}" if self.above > -math.inf else "")
        return kind + low + (f" up to {self.high:g}" if self.high < math.inf else "")

    def check(self, value: object) -> int | float:
        """Return the value as `kind` (an integer is a float too); BadInput when not allowed."""
        number = self._number(value)
        if number is None or not (self.low <= number <= self.high and number > self.above):
            raise BadInput(f"{short(value)} is not {self.allowed}")
        return number

    def _number(self, value: object) -> int | float | None:
        if type(value) is int and self.kind is int:
            return value
        if type(value) not in (int, float) or self.kind is int:
            return None
        try:
            number = float(value)  # type: ignore[arg-type]
        except OverflowError:
            return None
        return number if math.isfinite(number) else None


@dataclass(frozen=True)
class Limit:
    """A bound by others: column `name` may be at most `highest(columns, n_nodes)`."""

    name: str
    needs: tuple[str, ...]
    highest: Callable[[Mapping[str, Column], int], Column | int]
    text: str


@dataclass(frozen=True)
class ModelParameters:
    """All that a sweep has to know of a model before any kernel is loaded."""

    n_nodes: Parameter
    parameters: tuple[Parameter, ...]
    limits: tuple[Limit, ...] = ()
    forms: tuple[str, ...] = ("reduced",)
    constants: Mapping[str, int] = field(default_factory=dict)
    """Columns that the model has no choice of, but that random streams and results want."""

    def find(self, name: str) -> Parameter | None:
        """Return the parameter that may be an axis or fixed, or None."""
        return next((p for p in self.parameters if p.name == name), None)


def short(value: object) -> str:
    """Return the value as it may stand in a one-line message."""
    if isinstance(value, int) and abs(value) >= 10**30:
        return "a huge integer"  # too long ones cannot even be printed
    try:
        text = repr(value)
    except RecursionError:
        return "a deeply nested value"
    return text if len(text) <= 60 else text[:57] + "..."


def nearest(name: str, known: list[str]) -> str:
    """Return '; did you mean X?' or, when nothing is near, '; known: X, Y, Z'."""
    near = get_close_matches(name[:60], known, n=1)
    return f"; did you mean {near[0]}?" if near else f"; known: {', '.join(known)}"


def parameters_of(model: str) -> ModelParameters:
    """Return the table of a model; raise BadInput for a name that is not in `MODELS`.

    ``package.module:object`` is a user's own model, see `user_model`.
    """
    if ":" in model:
        table: ModelParameters = user_model(model).parameters
        return table
    if model not in MODELS:
        raise BadInput(f"model: {short(model)} is not a known model{nearest(model, list(MODELS))}")
    return MODELS[model]


@cache
def user_model(name: str) -> Any:
    """Return the object that ``package.module:object`` names.

    It has ``parameters``, a `ModelParameters`, and ``build(sweep, row)``, which returns what
    `chimera_hpc.models.Model` lists for the point with this row of columns: see
    `chimera_hpc.models.user.OwnModel`, which makes both. The module is imported from the Python
    path, and after that from the folders of `look_in`, by the workers too.

    Raises
    ------
    BadInput
        When there is no such module, it cannot be imported, or the object is not a model.
    """
    module, _, attribute = name.partition(":")
    where = f"model: {short(name)}"
    if not (_MODULE.fullmatch(module) and attribute.isidentifier()):
        raise BadInput(f"{where} is not of the form package.module:object")
    try:
        found = getattr(_import(module), attribute)
    except Exception as error:
        # Whatever the user's module does when it is imported.
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
    """Import a module without leaving its bytecode on the disk.

    Python tells stale bytecode by the second of the last change and the size of the source: an edit
    may escape it.
    """
    before = sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    try:
        invalidate_caches()
        return import_module(module)
    finally:
        sys.dont_write_bytecode = before


def look_in(folder: str | Path) -> None:
    """Have the modules of users' models looked for in this folder too, after all other places."""
    place = str(Path(folder).absolute())
    if place not in sys.path:
        sys.path.append(place)


def model_folder(model: str) -> str | None:
    """Return the folder in which the module of a user's model was found; None for other models."""
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


SEED = Parameter("seed", int, None, "Number of the random initial state.", low=0, high=2**63 - 1)
SEED_COUNT = Parameter("seeds", int, None, "Number of seeds.", low=1, high=10**9)
DELTA = Parameter("delta", float, None, "Radius of the ball of initial states.", low=0)

_HALF_DEGREE = "Links of a node to each side (half its degree); 2 P must be smaller than n_nodes."
_RING_LIMIT = Limit("P", (), lambda _, n: (n - 1) // 2, "2 P must be smaller than n_nodes")
_EPSILON = Parameter("epsilon", float, 0.05, "Ratio of the two time scales.", above=0)


def _n_nodes(default: int) -> Parameter:
    return Parameter("n_nodes", int, default, "Nodes of the ring, N0.", low=3, high=10**7)


MODELS: dict[str, ModelParameters] = {
    "topological_fhn": ModelParameters(
        n_nodes=_n_nodes(50),
        parameters=(
            Parameter("P", int, None, _HALF_DEGREE, low=1, high=10**7),
            Parameter(
                "Q", int, None, "Links reoriented at node 1, on each side.", low=0, high=10**7
            ),
            Parameter("orientation", int, 1, "Rule that orients the ring's links.", low=1, high=2),
            _EPSILON,
            Parameter("b", float, 0.5, "Excitability."),
            Parameter("c", float, -0.01, "Self-coupling of the links."),
            Parameter("flips", int, 0, "Links reversed at random, Q_r.", low=0, high=10**15),
            Parameter(
                "flip_set", int, 0, "Links to draw those from: 0 all, 1 node 1's.", low=0, high=1
            ),
        ),
        limits=(
            _RING_LIMIT,
            Limit("Q", ("P",), lambda columns, _: columns["P"], "Q may not exceed P"),
            Limit(
                "flips",
                ("P", "flip_set"),
                lambda columns, n: np.where(columns["flip_set"] == 1, 2, n) * columns["P"],
                "flips may not exceed the number of links, n_nodes * P (2 P of them at node 1)",
            ),
        ),
        forms=("reduced", "full"),
    ),
    "networked_fhn": ModelParameters(
        n_nodes=_n_nodes(500),
        parameters=(
            Parameter("P", int, 165, _HALF_DEGREE, low=1, high=10**7),
            _EPSILON,
            Parameter("b", float, 0.5, "Excitability."),
            Parameter("phi", float, math.pi / 2 - 0.1, "Angle of the coupling matrix."),
            Parameter("sigma", float, 0.1, "Strength of the coupling."),
        ),
        limits=(_RING_LIMIT,),
        constants={"orientation": 1},
    ),
}


def _schema(parameters: list[Parameter], axis: bool) -> dict[str, Any]:
    """Return the JSON Schema of a table whose keys are these parameters, as numbers or as axes."""
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


def grid_schema() -> dict[str, Any]:
    """Return the JSON Schema of [grid] for all models together."""
    parameters = [p for model in MODELS.values() for p in model.parameters]
    seeds = Parameter("seeds", int, 1, "A count n, seeds 0..n-1, or a list of seeds.", low=0)
    return _schema([*parameters, DELTA, seeds], axis=True)


def fixed_schema() -> dict[str, Any]:
    """Return the JSON Schema of [fixed] for all models together."""
    parameters = [p for model in MODELS.values() for p in (model.n_nodes, *model.parameters)]
    return _schema(parameters, axis=False)
