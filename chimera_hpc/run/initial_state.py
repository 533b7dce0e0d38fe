"""The random initial state of a point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.streams import initial_stream, initial_stream_on_network, stream_key
from chimera_hpc.job import Sweep
from chimera_hpc.job.initial_file import initial_file
from chimera_hpc.job.user_models import prints_to_stderr
from chimera_hpc.models.custom import OwnPoint
from chimera_hpc.models.protocol import Model, Row
from chimera_hpc.network.sweep_network import network_of

Array = NDArray[np.float64]


def initial_state(
    sweep: Sweep, row: Row, model: Model, nudge: float = 0.0, start: Array | None = None
) -> tuple[Array, Array]:
    """Return the initial state (u, v) of a point: `start`, u then v, else that of the job's file.

    Without both it is drawn.

    Uniform in the ball of radius ``delta`` around ``integrator.centre``: in the maximum norm every
    variable is ``centre + delta * U[-1, 1]``, u first, then v (paper sec. Method and results). In
    the Euclidean norm the direction is Gaussian and the radius ``delta * U**(1/n)``. A user's model
    may draw it otherwise, from the same stream. `nudge` then moves every variable x by
    ``nudge * max(1, |x|) * U[-1, 1]``, drawn from that stream, too.

    Returns u (N0,) and v (n_second,).
    """
    stream = _stream(sweep, row)
    with prints_to_stderr():
        drawn = model.draw(stream) if isinstance(model, OwnPoint) else None
    drawn = _given(sweep, row, model, start) or drawn
    if drawn is None:
        drawn = _in_the_ball(sweep, row, model, stream)
    return (_moved(drawn[0], nudge, stream), _moved(drawn[1], nudge, stream)) if nudge else drawn


def _given(sweep: Sweep, row: Row, model: Model, start: Array | None) -> tuple[Array, Array] | None:
    """Return the state that is not drawn, if there is one."""
    if start is not None:
        return start[: model.n_nodes], start[model.n_nodes : model.n_nodes + model.n_second]
    file, digest = sweep.integrator.initial, sweep.integrator.initial_digest
    if file is None or digest is None:
        return None
    states, seed = initial_file(file, digest), int(row["seed"])
    states.check((model.n_nodes, model.n_second), seed)
    return states.state(seed)


def _stream(sweep: Sweep, row: Row) -> np.random.Generator:
    if sweep.network is None:
        return initial_stream(*stream_key(sweep.model, sweep.n_nodes, row))
    network = network_of(sweep, row)
    sizes = network.n_nodes, network.n_links, network.n_triangles
    seeds = int(row.get("network_seed", 0)), int(row["seed"])
    return initial_stream_on_network(sweep.model, sweep.network.kind, sizes, *seeds)


def _moved(state: Array, nudge: float, stream: np.random.Generator) -> Array:
    size = nudge * np.maximum(1.0, np.abs(state))
    return state + size * stream.uniform(-1.0, 1.0, len(state))


def _in_the_ball(
    sweep: Sweep, row: Row, model: Model, stream: np.random.Generator
) -> tuple[Array, Array]:
    size = model.n_nodes + model.n_second
    if sweep.integrator.ball == "maximum":
        offset = stream.uniform(-1.0, 1.0, size)
    else:
        direction = stream.standard_normal(size)
        radius = stream.uniform() ** (1.0 / size)
        offset = direction * (radius / np.sqrt(np.sum(direction * direction)))
    u, v = model.equilibrium(sweep.integrator.centre)
    centre = np.repeat([u, v], [model.n_nodes, model.n_second])
    state = centre + row["delta"] * offset
    return state[: model.n_nodes], state[model.n_nodes :]
