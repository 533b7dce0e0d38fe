"""The topological model: both forms against dense matrices, references and exact properties."""

from __future__ import annotations

import math
from pathlib import Path

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kernel_tools import run_all

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.integrate.lanes import Control
from chimera_hpc.integrate.simd import LANES
from chimera_hpc.models.topological_fhn import TopologicalFHN
from chimera_hpc.network.topology import Topology
from chimera_hpc.run.simulate import simulate

# Made once by SciPy's DOP853 at rtol 3e-14 from the node-link equations as the paper prints them.
REFERENCE = np.load(Path(__file__).parents[1] / "data" / "trajectories.npz")
CASES = sorted({name.split("/")[0] for name in REFERENCE.files})
forms = pytest.mark.parametrize("form", ["reduced", "full"])
TIGHT = {"rtol": 1e-9, "atol": 1e-12}


def reference(case):
    """Fields of a reference case, and the topology with its links."""
    fields = {n.split("/")[1]: REFERENCE[n] for n in REFERENCE.files if n.startswith(case + "/")}
    n_nodes = int(fields["n_nodes"])
    half = len(fields["links"]) // n_nodes
    topology = Topology.ring(n_nodes, half)
    reversed_links = (fields["links"] != topology.links).any(axis=1)
    return fields, topology.reorient(np.flatnonzero(reversed_links))


def random_state(topology, seed=0, size=1.0):
    random = np.random.default_rng(seed)
    return (size * random.uniform(-1, 1, n) for n in (topology.n_nodes, topology.n_links))


@pytest.mark.parametrize("epsilon", [0.0, -0.05, math.nan])
def test_time_scale_that_is_none_is_refused(epsilon):
    with pytest.raises(BadInput, match=f"epsilon = {epsilon}: must be above 0"):
        TopologicalFHN(Topology.ring(5, 1), epsilon=epsilon)


# --- right-hand sides -----------------------------------------------------------------------------


@st.composite
def lanes_of_models(draw):
    """Models of one form and ring for all lanes, each with its own orientation and parameters."""
    n = draw(st.integers(3, 19))
    half = draw(st.integers(1, (n - 1) // 2))
    form = draw(st.sampled_from(["reduced", "full"]))
    numbers = st.floats(-2, 2)
    lanes = draw(st.sampled_from([1, LANES]))
    models = []
    for _ in range(lanes):
        topology = Topology.ring(n, half, draw(st.sampled_from([1, 2])))
        topology = topology.reorient_random(draw(st.integers(0, n * half)), draw(st.integers(0, 9)))
        epsilon = draw(st.floats(0.01, 2))
        models.append(TopologicalFHN(topology, epsilon, draw(numbers), draw(numbers), form))
    return models


@settings(max_examples=40)
@given(lanes_of_models())
def test_right_hand_side_equals_the_dense_one_in_every_lane(models):
    first = models[0]
    y = np.random.default_rng(0).uniform(-2, 2, (first.n_rows, len(models)))
    dy = np.full_like(y, np.nan)
    params = np.stack([model.lane_params for model in models], axis=1)
    first.right_hand_side(y, dy, params, first.int_params)
    twin = naive.reduced_rhs if first.form == "reduced" else naive.full_rhs
    for lane, m in enumerate(models):
        expected = twin(y[:, lane], m.topology.links, m.n_nodes, m.epsilon, m.b, m.c)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(dy[:, lane], expected, rtol=0, atol=1e-13 * scale)


@pytest.mark.parametrize("n", [3, 7, 8, 9, 15, 16, 17, 24, 50])
def test_slopes_of_a_lane_alone_have_the_bits_of_a_pack(n):
    # Alone, eight neighbours go together; in a pack, the same node of eight rings.
    for half in range(1, (n - 1) // 2 + 1):
        model = TopologicalFHN(Topology.ring(n, half).reorient_node(0, half))
        y = np.random.default_rng(half).normal(size=(2 * n, LANES))
        params = np.repeat(model.lane_params[:, None], LANES, axis=1)
        together = np.empty_like(y)
        model.right_hand_side(y, together, params, model.int_params)
        for lane in range(LANES):
            alone = np.empty((2 * n, 1))
            column = np.ascontiguousarray(y[:, lane : lane + 1])
            model.right_hand_side(column, alone, params[:, :1].copy(), model.int_params)
            assert alone[:, 0].tobytes() == together[:, lane].tobytes()


@forms
@pytest.mark.parametrize(("which", "sign"), [("upper", 1.0), ("lower", -1.0), ("origin", 0.0)])
def test_homogeneous_states_stand_still_on_the_oriented_ring(form, which, sign):
    # u = +-sqrt(3) or 0 and v = -b/c; the origin that runs start around has v = 0 instead.
    model = TopologicalFHN(Topology.ring(20, 6), form=form)
    u, v = model.equilibrium(which)
    assert (u, v) == (sign * np.sqrt(3.0), 50.0 if sign else 0.0)
    state = model.state(np.full(20, u), np.full(120, 50.0))
    run = simulate(model, u0=np.full(20, u), v0=np.full(120, 50.0), t_end=0.1, t_step=0.1)
    assert np.abs(state[20:]).max() == (0.0 if form == "reduced" else 50.0)
    np.testing.assert_allclose(run.u[-1], u, atol=1e-10)
    np.testing.assert_allclose(run.v[-1], 50.0, atol=1e-9)


# --- trajectories ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("method", "rtol"),
    [("tsit5", 1e-9), ("dopri5", 1e-9)],
)
@forms
@pytest.mark.parametrize("case", CASES)
def test_reference_trajectory(case, form, method, rtol):
    fields, topology = reference(case)
    np.testing.assert_array_equal(topology.links, fields["links"])
    numbers = {name: float(fields[name]) for name in ("epsilon", "b", "c")}
    t = fields["t"]
    run = simulate(
        topology,
        u0=fields["u0"],
        v0=fields["v0"],
        **numbers,
        t_end=t[-1],
        t_step=t[1] - t[0],
        rtol=rtol,
        atol=1e-3 * rtol,
        form=form,
        method=method,
    )
    limit = max(1e-6, 100 * float(fields["uncertainty"]))
    assert limit == 1e-6
    assert run.status == Status.DONE
    np.testing.assert_allclose(run.t, t, atol=1e-12)
    np.testing.assert_allclose(run.u, fields["u"], rtol=0, atol=limit)
    np.testing.assert_allclose(run.v[-1], fields["v_end"], rtol=0, atol=limit)


@pytest.mark.parametrize(
    ("case", "topology"),
    [
        ("orientation1_P9_Q9", Topology.ring(50, 9).reorient_node(0, 9)),
        ("orientation1_P12_Q12", Topology.ring(50, 12).reorient_node(0, 12)),
        ("orientation2_P13", Topology.ring(50, 13, orientation=2)),
    ],
)
def test_reference_links_are_those_of_the_ring(case, topology):
    np.testing.assert_array_equal(topology.links, REFERENCE[f"{case}/links"])


@pytest.mark.parametrize(
    "topology",
    [
        Topology.ring(50, 12).reorient_node(0, 12),
        Topology.ring(21, 10, orientation=2),
        Topology.ring(16, 3).reorient_random(20, seed=4),
    ],
    ids=["reoriented", "orientation 2", "random"],
)
def test_both_forms_give_the_same_nodes_and_links(topology):
    u0, v0 = random_state(topology)
    start = {"u0": u0, "v0": v0, "t_end": 4.0, "t_step": 0.1, **TIGHT}
    reduced, full = (simulate(topology, **start, form=form) for form in ("reduced", "full"))
    np.testing.assert_allclose(reduced.u, full.u, rtol=0, atol=1e-7)
    np.testing.assert_allclose(reduced.w, full.w, rtol=0, atol=1e-7)
    np.testing.assert_allclose(reduced.v, full.v, rtol=0, atol=1e-7)
    assert full.v.shape == (41, topology.n_links)
    np.testing.assert_allclose(full.w, full.v @ topology.incidence.toarray().T, atol=1e-11)


@forms
def test_sum_over_the_nodes_of_w_stays_zero(form):
    topology = Topology.ring(50, 12).reorient_node(0, 12)
    u0, v0 = random_state(topology, size=1e-3)
    t_end = 200.0 if form == "reduced" else 20.0
    run = simulate(topology, u0=u0, v0=v0, t_end=t_end, t_step=0.05, form=form)
    assert run.w.std() > 0.1
    assert np.abs(run.w.sum(axis=1)).max() < 1e-9


def test_without_b_the_orientation_has_no_effect():
    ring = Topology.ring(20, 5)
    others = [
        ring.reorient_node(0, 5),
        Topology.ring(20, 5, orientation=2),
        ring.reorient_random(40, seed=1),
    ]
    random = np.random.default_rng(3)
    u0, w0 = random.uniform(-1, 1, (2, 20))
    y0 = np.concatenate([u0, w0 - w0.mean()])
    control = Control(5.0, 0.0, 0.1)

    def samples(topology, b):
        (run,) = run_all([TopologicalFHN(topology, b=b)], [y0], control)
        return run.samples

    for other in others:
        np.testing.assert_array_equal(samples(other, 0.0), samples(ring, 0.0))
        assert np.abs(samples(other, 0.5) - samples(ring, 0.5)).max() > 0.1


def test_without_b_the_orientation_has_no_effect_on_the_full_form():
    ring, turned = Topology.ring(20, 5), Topology.ring(20, 5).reorient_random(40, seed=1)
    u0, v0 = random_state(ring)
    # The same w on the nodes: a reversed link has its signal reversed.
    v1 = v0 * ring.link_signs * turned.link_signs
    a, b = (
        simulate(topology, u0=u0, v0=v, b=0.0, t_end=3.0, t_step=0.1, form="full", **TIGHT)
        for topology, v in ((ring, v0), (turned, v1))
    )
    np.testing.assert_allclose(a.u, b.u, rtol=0, atol=1e-9)


def mirror_nodes(u):
    """u'_i = -u_(2 - i), nodes counted from 1: node 1 is the mirror's."""
    return -np.roll(u[..., ::-1], 1, axis=-1)


def mirror_links(topology, v):
    """v' of the link from -b to -a is v of the link from a to b."""
    n = topology.n_nodes
    place = {tuple(link): i for i, link in enumerate(topology.links.tolist())}
    image = [place[(-b) % n, (-a) % n] for a, b in topology.links.tolist()]
    mirrored = np.empty_like(v)
    mirrored[image] = v
    return mirrored


@forms
@pytest.mark.parametrize("count", [0, 3, 5])
def test_reflection_maps_solutions_to_solutions(form, count):
    topology = Topology.ring(20, 5).reorient_node(0, count)
    u0, v0 = random_state(topology, seed=count)
    options = {"t_end": 4.0, "t_step": 0.1, "form": form, **TIGHT}
    run = simulate(topology, u0=u0, v0=v0, **options)
    image = simulate(topology, u0=mirror_nodes(u0), v0=mirror_links(topology, v0), **options)
    assert np.abs(run.u - mirror_nodes(run.u)).max() > 0.1
    np.testing.assert_allclose(image.u, mirror_nodes(run.u), rtol=0, atol=1e-9)
    np.testing.assert_allclose(image.w, mirror_nodes(run.w), rtol=0, atol=1e-9)


# --- links of a reduced run -----------------------------------------------------------------------


@pytest.mark.parametrize("c", [-0.01, -1.0, 0.0, 0.3])
def test_links_follow_from_the_nodes_for_every_c(c):
    topology = Topology.ring(12, 4).reorient_node(0, 3)
    u0, v0 = random_state(topology)
    options = {"u0": u0, "v0": v0, "c": c, "t_end": 3.0, "t_step": 0.25, **TIGHT}
    reduced, full = (simulate(topology, **options, form=form) for form in ("reduced", "full"))
    np.testing.assert_allclose(reduced.v, full.v, rtol=0, atol=1e-7)
    np.testing.assert_allclose(reduced.v[0], v0, atol=1e-12)


@settings(max_examples=30)
@given(st.integers(3, 15), st.integers(0, 99), st.floats(-1, 1), st.floats(-2, 2))
def test_formula_of_the_links_equals_its_dense_form(n, seed, c, b):
    random = np.random.default_rng(seed)
    half = int(random.integers(1, (n - 1) // 2 + 1))
    topology = Topology.ring(n, half).reorient_random(n * half // 2, seed)
    model = TopologicalFHN(topology, b=b, c=c)
    w = random.normal(size=(4, n))
    w -= w.mean(axis=1, keepdims=True)
    v0, t = random.normal(size=n * half), np.array([0.0, 0.5, 1.0, 7.0])
    matrix = naive.incidence(n, topology.links)
    inverse = np.linalg.pinv(matrix)
    projection = np.eye(n * half) - inverse @ matrix
    for row, at in enumerate(t):
        # v' = b + c v on the cycles, where the nodes have no say
        grown = at if abs(c) < 1e-12 else np.expm1(c * at) / c
        expected = inverse @ w[row] + projection @ (v0 * np.exp(c * at) + b * grown)
        got = model.links(w, v0, t)[row]
        np.testing.assert_allclose(got, expected, atol=1e-9 * max(1.0, np.exp(7 * c)))


def test_small_c_joins_the_formula_of_no_c():
    topology = Topology.ring(12, 4).reorient_node(0, 3)
    _, v0 = random_state(topology)
    w, t = np.zeros((3, 12)), np.array([0.0, 1.0, 50.0])
    without, tiny = (TopologicalFHN(topology, c=c).links(w, v0, t) for c in (0.0, -1e-13))
    np.testing.assert_allclose(tiny, without, atol=1e-9)


# --- what the sweep needs to know -----------------------------------------------------------------


def test_lanes_are_shared_by_equal_rings_and_forms_only():
    def group(n=20, half=5, **options):
        form = options.pop("form", "reduced")
        return TopologicalFHN(Topology.ring(n, half, **options), form=form).lane_group

    assert group() == group(orientation=2)
    assert len({group(), group(half=4), group(n=21), group(form="full")}) == 4


@forms
def test_sizes_of_the_state(form):
    topology = Topology.ring(10, 3)
    model = TopologicalFHN(topology, form=form)
    state = model.state(np.arange(10.0), np.arange(30.0))
    assert model.n_second == 30
    assert state.shape == (model.n_rows,) == ((20,) if form == "reduced" else (40,))
    u, w = model.node_pair(state)
    np.testing.assert_array_equal(u, np.arange(10.0))
    np.testing.assert_array_equal(w, topology.incidence @ np.arange(30.0))
