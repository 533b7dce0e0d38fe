"""A user's maker of networks, ``kind = "module:function"`` in [network].

The function has typed parameters, ``hub(n_nodes: int, spokes: int = 3, seed=0)``, and returns a
`Network`. ``n_nodes`` and ``seed``, where it has them, come from the sweep; all others are
parameters of the job.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import short
from chimera_hpc.job.user_models import Origin, prints_to_stderr, user_object
from chimera_hpc.models.parameters import Parameter
from chimera_hpc.models.source import SourceFiles, source_files
from chimera_hpc.network.network import Network

_GIVEN = ("n_nodes", "seed")
_KINDS: dict[Any, type[int] | type[float]] = {int: int, float: float, "int": int, "float": float}
_SEEDS = 2**32
"""Seeds are below this limit, so that all generators of random numbers accept them."""


@dataclass(frozen=True, eq=False)
class OwnMaker:
    """A user's function that makes networks."""

    kind: str
    """``module:function``"""
    function: Callable[..., Any]
    takes: tuple[str, ...]
    """Which of n_nodes and seed it has."""
    parameters: tuple[Parameter, ...]
    file: Path | None
    """The file of its module."""
    held: Mapping[str, str]
    """What it holds, see `models.held`, right after the import."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(p.name for p in self.parameters)

    def make(self, n_nodes: int, numbers: Mapping[str, Any], rng: np.random.Generator) -> Network:
        """Return the network of these parameters.

        Raises BadInput if the function fails, or returns another thing or another size.
        """
        given = {"n_nodes": n_nodes, "seed": int(rng.integers(_SEEDS))}
        where = f"network.kind: {short(self.kind)}"
        try:
            with prints_to_stderr():
                made = self.function(**{name: given[name] for name in self.takes}, **numbers)
        except Exception as error:
            # Whatever the user's code does.
            text = " ".join(f"{type(error).__name__}: {error}".split())
            raise BadInput(f"{where} does not work: {text}") from None
        if not isinstance(made, Network):
            raise BadInput(
                f"{where} returns {short(type(made).__name__)}: a Network is needed, as from "
                "Network.from_networkx, from_edges or from_matrices"
            )
        if made.n_nodes != n_nodes:
            raise BadInput(
                f"{where} makes {made.n_nodes} nodes, but n_nodes = {n_nodes}: set it in [fixed]"
            )
        return made

    @property
    def source(self) -> SourceFiles | None:
        """The files of its code as they are now; None where there are none."""
        return None if self.file is None else source_files(self.file, self.kind.partition(":")[0])


def own_maker(kind: str, origin: Origin | None = None) -> OwnMaker:
    """Return the maker that ``module:function`` names, searched for as a user's model is.

    Raises
    ------
    BadInput
        The module cannot be imported, the object is no function, or it has a parameter without a
        type that a job can set.
    """
    return _made(kind, *user_object("network.kind", kind, origin))


@cache
def _made(kind: str, function: Any, file: Path | None) -> OwnMaker:
    from chimera_hpc.models.held import held_values

    where = f"network.kind: {short(kind)}"
    if not inspect.isfunction(function):
        raise BadInput(f"{where} is not a function (parameters, seed) that returns a Network")
    signature = inspect.signature(function).parameters
    return OwnMaker(
        kind,
        function,
        tuple(name for name in _GIVEN if name in signature),
        tuple(_parameter(where, p) for p in signature.values() if p.name not in _GIVEN),
        file,
        held_values(function, "" if file is None else str(file.parent)),
    )


def _parameter(where: str, given: inspect.Parameter) -> Parameter:
    """Return what a job may set; its type is that of the annotation, or of the default."""
    default = None if given.default is given.empty else given.default
    written = type(default) if given.annotation is given.empty else given.annotation
    kind = _KINDS.get(written)
    named = given.kind in (given.POSITIONAL_OR_KEYWORD, given.KEYWORD_ONLY)
    if kind is None or not named or type(default) not in (int, float, type(None)):
        raise BadInput(
            f"{where}: parameter {given}: parameters are numbers with a name and a type, such as "
            "spokes: int = 3"
        )
    value = None if default is None else kind(default)
    return Parameter(given.name, kind, value, f"Parameter of {where.partition(' ')[2]}.")
