"""From a point of a sweep to its model and its initial state."""

from __future__ import annotations

import numpy as np
import pytest

from chimera_hpc.base.streams import initial_stream, topology_stream
from chimera_hpc.job import Sweep
from chimera_hpc.job.models import build
from chimera_hpc.models.networked_fhn import NetworkedFHN
from chimera_hpc.network.topology import Topology
from chimera_hpc.run.initial_state import initial_state


def sweep(text="", model="topological_fhn", grid='P = [4]\nQ = "P"\nseeds = [7]'):
    head = f'name = "x"\nmodel = "{model}"\n[grid]\n{grid}\n'
    return Sweep.from_toml_text(head + text)


def first(sweep):
    row = sweep.points().row(0)
    model = build(sweep, row)
    return row, model, *initial_state(sweep, row, model)


def test_topological_point():
    s = sweep("[fixed]\nn_nodes = 20\norientation = 2\nepsilon = 0.07\nb = 0.6\nc = -0.02\n")
    _, model, _, _ = first(s)
    expected = Topology.ring(20, 4, 2).reorient_node(0, 4)
    np.testing.assert_array_equal(model.topology.links, expected.links)
    assert (model.epsilon, model.b, model.c, model.form) == (0.07, 0.6, -0.02, "reduced")


def test_full_form_comes_from_the_integrator_s_table():
    assert first(sweep('[integrator]\nform = "full"'))[1].form == "full"


def test_flips_are_drawn_from_the_topology_s_stream():
    _, model, _, _ = first(sweep("[fixed]\nflips = 9\nn_nodes = 20\n"))
    ring = Topology.ring(20, 4).reorient_node(0, 4)
    stream = topology_stream("topological_fhn", 20, 1, 4, 4, 7, 9)
    assert (model.topology.links != ring.links).any(axis=1).sum() == 9
    np.testing.assert_array_equal(model.topology.links, ring.reorient_random(9, stream).links)


def test_flips_may_be_drawn_from_the_links_of_node_1():
    _, model, _, _ = first(sweep("[fixed]\nflips = 5\nflip_set = 1\nn_nodes = 20\n"))
    ring = Topology.ring(20, 4).reorient_node(0, 4)
    changed = np.flatnonzero((model.topology.links != ring.links).any(axis=1))
    assert len(changed) == 5
    assert set(changed) <= set(ring.links_at(0))


def test_networked_point():
    s = sweep(
        "[fixed]\nn_nodes = 30\nsigma = 0.4\nepsilon = 0.07\nb = 0.6\nphi = 1.2\n",
        "networked_fhn",
        "P = [4]\nseeds = [7]",
    )
    row, model, u, v = first(s)
    assert model == NetworkedFHN(30, 4, 0.4, 0.07, 0.6, 1.2)
    numbers = initial_stream("networked_fhn", 30, 1, 4, 0, 7).uniform(-1, 1, 60)
    np.testing.assert_array_equal(np.concatenate([u, v]), row["delta"] * numbers)


@pytest.mark.parametrize(
    ("centre", "u_centre", "v_centre"),
    [("origin", 0.0, 0.0), ("upper", np.sqrt(3.0), 50.0), ("lower", -np.sqrt(3.0), 50.0)],
)
def test_initial_state_in_the_maximum_norm(centre, u_centre, v_centre):
    s = sweep(f'[fixed]\nn_nodes = 20\n[integrator]\ndelta = 0.25\ncentre = "{centre}"\n')
    _, _, u, v = first(s)
    numbers = initial_stream("topological_fhn", 20, 1, 4, 4, 7).uniform(-1, 1, 100)
    np.testing.assert_array_equal(u, u_centre + 0.25 * numbers[:20])
    np.testing.assert_array_equal(v, v_centre + 0.25 * numbers[20:])


def test_initial_state_does_not_depend_on_other_parameters():
    def state(text):
        return np.concatenate(first(sweep(text))[2:])

    same = state("")
    for text in (
        "[fixed]\nepsilon = 0.2\nb = 1.0\nc = -0.5\nflips = 3",
        '[integrator]\nform = "full"\nrtol = 1e-6\nt_end = 2000.0',
    ):
        np.testing.assert_array_equal(state(text), same)


def test_initial_state_in_the_euclidean_ball_is_uniform():
    # |x| / delta is U**(1/n): its n-th power is uniform; the directions have no mean.
    s = sweep(
        '[fixed]\nn_nodes = 4\n[integrator]\nball = "euclidean"\ndelta = 0.3\n[features]\ngroups=1',
        grid="P = [1]\nQ = [0]\nseeds = 600",
    )
    points = s.points()
    model = build(s, points.row(0))
    states = np.array(
        [np.concatenate(initial_state(s, points.row(i), model)) for i in range(len(points))]
    )
    radii = np.linalg.norm(states, axis=1) / 0.3
    assert radii.max() <= 1.0
    quantiles = np.sort(radii**8)
    uniform = (np.arange(600) + 0.5) / 600
    assert np.abs(quantiles - uniform).max() < 1.63 / np.sqrt(600)  # Kolmogorov-Smirnov, 1 %
    assert np.linalg.norm(states.mean(axis=0)) < 4 * 0.3 / np.sqrt(600)


def test_delta_of_the_grid_is_the_radius():
    s = sweep("[fixed]\nn_nodes = 20\n", grid='P = [4]\nQ = "P"\ndelta = [0.5, 2.0]\nseeds = [7]')
    points = s.points()
    states = [
        np.concatenate(initial_state(s, points.row(i), build(s, points.row(i)))) for i in (0, 1)
    ]
    np.testing.assert_array_equal(4.0 * states[0], states[1])
