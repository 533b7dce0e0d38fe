"""A trajectory has the same bits in any lane, beside any neighbours, alone or among others."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernel_tools import run_all

from chimera_hpc.base.status import Status
from chimera_hpc.integrate import lane_rows as K
from chimera_hpc.integrate.lanes import Control, LanePool
from chimera_hpc.integrate.simd import LANES
from chimera_hpc.models.networked_fhn import NetworkedFHN
from chimera_hpc.models.topological_fhn import TopologicalFHN
from chimera_hpc.network.topology import Topology

CONTROL = Control(6.0, 3.0, 0.01)
N_RUNS = 11


def ring(**parameters):
    """A run with its initial state; the keyword `seed` chooses the state."""
    random = np.random.default_rng(parameters.pop("seed"))
    count = parameters.pop("Q", 2)
    model = TopologicalFHN(Topology.ring(9, 3).reorient_node(0, count), **parameters)
    return model, model.state(*(random.uniform(-0.1, 0.1, n) for n in (9, 27)))


def family(form):
    """Runs that differ in everything that lanes of one call may differ in."""
    return [
        ring(seed=i, Q=i % 4, epsilon=0.02 + 0.01 * i, b=0.1 * i, c=-0.01 - 0.02 * i, form=form)
        for i in range(N_RUNS)
    ]


def networked_family():
    random = np.random.default_rng(5)
    for i in range(N_RUNS):
        model = NetworkedFHN(11, 3, sigma=0.1 + 0.05 * i, epsilon=0.03 + 0.01 * i, b=0.1 * i)
        yield model, random.uniform(-0.5, 0.5, 22)


FAMILIES = {
    "reduced": family("reduced"),
    "full": family("full"),
    "networked": list(networked_family()),
}


def alone(runs, control=CONTROL):
    """Bits of each run integrated on its own, in one lane."""
    return [run_all([model], [y0], control, lanes=1)[0].bits for model, y0 in runs]


def bits_of(runs, control=CONTROL, **options):
    return [run.bits for run in run_all(*zip(*runs, strict=True), control, **options)]


@cache
def expected(name):
    """Bits of each run of a family, on its own."""
    return alone(FAMILIES[name])


REDUCED = FAMILIES["reduced"]


@pytest.mark.parametrize("name", FAMILIES)
def test_a_vector_gives_the_bits_of_single_lanes(name):
    assert len(set(expected(name))) == N_RUNS
    assert bits_of(FAMILIES[name], lanes=LANES) == expected(name)
    assert bits_of(FAMILIES[name], lanes=1) == expected(name)


@given(st.permutations(range(N_RUNS)), st.integers(1, N_RUNS))
def test_order_and_company_do_not_matter(order, n):
    # Runs end at different times, so every order refills the lanes in another way.
    chosen = order[:n]
    got = bits_of([REDUCED[i] for i in chosen], lanes=LANES)
    assert got == [expected("reduced")[i] for i in chosen]


@pytest.mark.parametrize("lane", range(LANES))
def test_position_in_the_vector_does_not_matter(lane):
    model, y0 = REDUCED[4]
    pool = LanePool(LANES, model, CONTROL, model.n_rows)
    pool.put(lane, y0, model.lane_params)
    while pool.lanes.counters[K.STATE, lane] in (K.FRESH, K.RUNNING):
        pool.run()
    status, steps, n_sampled, y_end, samples = expected("reduced")[4]
    assert pool.lanes.counters[K.STATE, lane] == status
    assert pool.lanes.counters[K.ACCEPTED, lane] == steps
    assert pool.lanes.y[: pool.size, lane].tobytes() == y_end
    assert pool.sampled(lane)[:, :n_sampled].tobytes() == samples


# Neighbours that fail: at once, after a while, or by taking very many steps.
TROUBLE = {
    "NaN from the first step": ring(seed=0, b=np.nan),
    "infinite at once": ring(seed=0, epsilon=5e-324),
    "grows beyond all bounds": ring(seed=0, c=1e4),
    "stiff": ring(seed=0, epsilon=1e-7),
}


@pytest.mark.parametrize("trouble", TROUBLE.values(), ids=TROUBLE)
def test_a_neighbour_that_fails_changes_no_bit(trouble):
    control = replace(CONTROL, max_steps=20_000)
    mixed = [REDUCED[1], trouble, REDUCED[2], trouble, *REDUCED[3:]]
    runs = run_all(*zip(*mixed, strict=True), control, lanes=LANES)
    assert {runs[1].outcome.status, runs[3].outcome.status}.isdisjoint({Status.DONE})
    own = expected("reduced")
    assert [runs[i].bits for i in (0, 2)] == [own[1], own[2]]
    assert [run.bits for run in runs[4:]] == own[3:]
    assert runs[1].bits == runs[3].bits == alone([trouble], control)[0]


@pytest.mark.parametrize("iterations", [1, 2, 3, 1000])
def test_length_of_a_call_of_the_loop_does_not_matter(iterations):
    # Between two calls the state is copied back to where it came from.
    model, y0 = REDUCED[6]
    pool = LanePool(1, model, CONTROL, model.n_rows)
    pool.put(0, y0, model.lane_params)
    while pool.lanes.counters[K.STATE, 0] in (K.FRESH, K.RUNNING):
        pool.iterations = iterations
        pool.run()
    assert pool.lanes.y[: model.n_rows, 0].tobytes() == expected("reduced")[6][3]


def test_sampling_does_not_change_the_run():
    model, y0 = REDUCED[6]
    (run,) = run_all([model], [y0], Control(6.0, 0.0, 0.5), n_observed=1)
    assert run.outcome.y_end.tobytes() == expected("reduced")[6][3]
