"""Random streams of a point. They depend on its parameters, not on how or where it is run.

The key of a point is the row of integers (STREAM_TAG, model, n_nodes, orientation, P, Q, seed). The
model is the first 8 bytes of the BLAKE2b digest of its name, little-endian, without the lowest bit.
The key does not contain epsilon, b, c, a tolerance, the form of the equations or the radius of the
initial state. Two runs that differ only in those therefore start from the same random numbers, and
points that are added later change no existing one.

Each integer of the key is written as an int64 (two little-endian 32-bit words), so different keys
give different entropy. `numpy.random.SeedSequence` over these words seeds PCG64. Its spawn key
separates the sub-streams: 0 for the initial state and 1 for the topology. The key of the topology
ends with the number of reversed links.

Points of a job with a table [network] have other streams. The network's depends on its kind, its
parameters and network_seed (spawn key 2; 3 for the links reversed at random). The initial state's
key is (STREAM_TAG, model, kind, nodes, links, triangles, network_seed, seed), with spawn key 4.

Test vectors (first two raw 64-bit outputs):

>>> initial_stream("topological_fhn", 50, 1, 12, 12, 0).bit_generator.random_raw(2).tolist()
[11704978848883669759, 6404558520510686158]
>>> topology_stream("topological_fhn", 50, 1, 13, 13, 3, 40).bit_generator.random_raw(2).tolist()
[1450647402846782716, 8634726795373142443]
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from hashlib import blake2b
from operator import index
from typing import Any

import numpy as np

from chimera_hpc.base.errors import BadInput

STREAM_TAG = 1
"""Version of the key. It is part of every key: a new rule needs a new tag."""


def generator(seed: Any) -> np.random.Generator:
    """Return NumPy's generator of a seed, or the one given. Raises BadInput for no such seed."""
    try:
        return np.random.default_rng(seed)
    except (TypeError, ValueError) as error:
        raise BadInput(f"seed = {seed!r}: a whole number from 0, or a Generator") from error


def stream_key(
    model: str, n_nodes: int, row: Mapping[str, int | float]
) -> tuple[str, int, int, int, int, int]:
    """Return the key of a point: model, N0, orientation, P, Q, seed."""
    # A user's model need not know orientation, P or Q.
    ring = (row.get("orientation", 1), row.get("P", 0), row.get("Q", 0))
    orientation, half_degree, reoriented, seed = (int(number) for number in (*ring, row["seed"]))
    return model, int(n_nodes), orientation, half_degree, reoriented, seed


def initial_stream(
    model: str, n_nodes: int, orientation: int, P: int, Q: int, seed: int
) -> np.random.Generator:
    """Return the generator of the initial state of a point (see the module's text for the key).

    Raises TypeError for a number that is not an integer, OverflowError for one beyond int64.
    """
    return _generator(0, model, n_nodes, orientation, P, Q, seed)


def topology_stream(
    model: str, n_nodes: int, orientation: int, P: int, Q: int, seed: int, flips: int
) -> np.random.Generator:
    """Return the generator that draws which `flips` links of a point are reversed.

    Independent of `initial_stream` for the same point: the initial state does not depend on
    `flips`. Raises as `initial_stream` does.
    """
    return _generator(1, model, n_nodes, orientation, P, Q, seed, flips)


def network_stream(parameters: Mapping[str, str | int | float]) -> np.random.Generator:
    """Return the generator that draws a random network.

    parameters: kind, n_nodes, network_seed and what else decides the network, by name.
    """
    return _drawn_by(2, parameters)


def orientation_stream(parameters: Mapping[str, str | int | float]) -> np.random.Generator:
    """Return the generator that draws which links of a network are reversed.

    parameters: as of `network_stream`, and flips.
    """
    return _drawn_by(3, parameters)


def initial_stream_on_network(
    model: str, kind: str, sizes: tuple[int, int, int], network_seed: int, seed: int
) -> np.random.Generator:
    """Return the generator of the initial state of a point on a network of [network].

    sizes: numbers of nodes, links and triangles.
    """
    return _generator(4, model, _model_number(kind), *sizes, network_seed, seed)


def _drawn_by(sub_stream: int, parameters: Mapping[str, str | int | float]) -> np.random.Generator:
    """Return the generator of a key that is text: the parameters as JSON, sorted by name.

    The words are STREAM_TAG, followed by the 32 bytes of the BLAKE2b digest of the text as eight
    little-endian words.
    """
    text = json.dumps(dict(parameters), sort_keys=True, separators=(",", ":"))
    digest = blake2b(text.encode(), digest_size=32).digest()
    words = np.array([STREAM_TAG, *np.frombuffer(digest, dtype="<u4")], dtype=np.uint32)
    sequence = np.random.SeedSequence(words, spawn_key=(sub_stream,))
    return np.random.Generator(np.random.PCG64(sequence))


def _generator(sub_stream: int, model: str, *numbers: int) -> np.random.Generator:
    key = [STREAM_TAG, _model_number(model), *map(index, numbers)]
    words = np.array(key, dtype="<i8").view("<u4").astype(np.uint32)
    sequence = np.random.SeedSequence(words, spawn_key=(sub_stream,))
    return np.random.Generator(np.random.PCG64(sequence))


def _model_number(model: str) -> int:
    return int.from_bytes(blake2b(model.encode(), digest_size=8).digest(), "little") >> 1
