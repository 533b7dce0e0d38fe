"""A model that misbehaves on demand, for the fault harness: ``model = "trouble:MODEL"``.

It is the package's own ring. The environment says what goes wrong, in whichever process a point is
built:

TROUBLE          ``kind:P:seed``: this point misbehaves. Kinds: ``kill`` (the process kills itself),
                 ``memory`` (it allocates until it is stopped), ``forever`` (the steps become so
                 small that the end is never reached), ``blow-up`` (the state grows beyond all
                 bounds), ``raise`` (an error in the model's code), ``hang`` (the right-hand side
                 never returns)
TROUBLE_SECONDS  time that each point takes before anything else
TROUBLE_LOG      file that gets a line ``P seed`` for each point that is begun
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from chimera_hpc.integrate.jit import compile_uncached
from chimera_hpc.integrate.stepper import RIGHT_HAND_SIDE
from chimera_hpc.job import Sweep
from chimera_hpc.models.parameters import ModelParameters, Parameter
from chimera_hpc.models.topological_fhn import TopologicalFHN
from chimera_hpc.network.topology import Topology

_STEP = 16_000_000
_ENOUGH = 1_500_000_000


class Hanging(TopologicalFHN):
    """A point whose right-hand side never returns."""

    @property
    def lane_group(self) -> tuple[Any, ...]:
        return ("hanging",)

    @property
    def right_hand_side(self) -> Any:
        return _hanging()


@cache
def _hanging() -> Any:
    return compile_uncached(RIGHT_HAND_SIDE, _never_return)


def _never_return(y, dy, p, ints):  # type: ignore[no-untyped-def]
    while ints[0] > -1:
        dy[0, 0] += 1.0


class Trouble:
    """What the package asks of a user's model."""

    parameters = ModelParameters(
        n_nodes=Parameter("n_nodes", int, 12, "Nodes.", low=3, high=1000),
        parameters=(Parameter("P", int, None, "Half the degree.", low=1, high=100),),
    )

    def build(self, sweep: Sweep, row: Mapping[str, int | float]) -> TopologicalFHN:
        half_degree, seed = int(row["P"]), int(row["seed"])
        _log(half_degree, seed)
        time.sleep(float(os.environ.get("TROUBLE_SECONDS", "0")))
        kind, _, which = os.environ.get("TROUBLE", "").partition(":")
        changes = _misbehave(kind) if which == f"{half_degree}:{seed}" else {}
        topology = Topology.ring(sweep.n_nodes, half_degree, 1).reorient_node(0, half_degree)
        kind_of_model = Hanging if changes.pop("hangs", 0) else TopologicalFHN
        return kind_of_model(topology, **{"epsilon": 0.05, "b": 0.5, "c": -0.01, **changes})


MODEL = Trouble()


def _misbehave(kind: str) -> dict[str, float]:
    """Do what was asked for at once, or return the parameters that do it."""
    if kind == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    if kind == "memory":
        _allocate()
    if kind == "raise":
        raise ZeroDivisionError("as asked for")
    return {"forever": {"epsilon": 1e-9}, "blow-up": {"b": 1e300}, "hang": {"hangs": 1}}[kind]


def _allocate() -> None:
    hoard = []
    for _ in range(_ENOUGH // _STEP):
        hoard.append(np.ones(_STEP // 8))
        time.sleep(0.02)
    raise MemoryError


def _log(half_degree: int, seed: int) -> None:
    path = os.environ.get("TROUBLE_LOG")
    if path:
        descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        os.write(descriptor, f"{half_degree} {seed}\n".encode())
        os.close(descriptor)
