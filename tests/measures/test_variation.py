"""Total variations of profiles whose answers can be worked out by hand."""

from types import SimpleNamespace

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from chimera_hpc import Network
from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.fourier import fourier_features
from chimera_hpc.measures.variation import total_variation_arrays, total_variations

ZERO = np.zeros(4)


def v_phase(phase):
    return total_variation_arrays(phase, np.zeros(len(phase)), np.zeros(len(phase)))[0]


def test_equal_nodes_do_not_vary():
    assert total_variation_arrays(np.full(5, 1.0), np.full(5, 2.0), np.full(5, 3.0)) == (0, 0, 0)


@pytest.mark.parametrize(
    ("phase", "expected"),
    [
        ([0, np.pi, 0, np.pi], 1.0),  # the largest there is
        ([0, np.pi / 2, np.pi, -np.pi / 2], 0.5),  # a wave around the ring
        ([0, 0, 0, 1], 2 / (4 * np.pi)),  # up by 1 and, over the ring's end, down by 1
        ([3, -3], (2 * np.pi - 6) / np.pi),  # across the cut: 2 pi - 6, twice
        ([0, 2 * np.pi], 0.0),
        ([0, 5 * np.pi], 1.0),  # more than a turn apart
        ([1.0], 0.0),
    ],
)
def test_phase_variation_by_hand(phase, expected):
    assert v_phase(np.array(phase, dtype=float)) == pytest.approx(expected, abs=1e-15)


def test_amplitude_and_frequency_variations_by_hand():
    _, v_a, v_omega = total_variation_arrays(ZERO, [1, 3, 2, 2], [0, 0, 5, 1])
    assert v_a == (2 + 1 + 0 + 1) / 4
    assert v_omega == (0 + 5 + 4 + 1) / 4


def test_result_is_in_the_order_of_the_triplet():
    assert total_variation_arrays([0, np.pi], [0, 2], [0, 3]) == pytest.approx((1, 2, 3))


profiles = hnp.arrays(float, (3, 7), elements=st.floats(-3.14, 3.14))


@given(profiles)
def test_equal_to_the_slow_twin(x):
    assert total_variation_arrays(*x) == pytest.approx(naive.total_variations(*x), abs=1e-14)


@given(hnp.arrays(float, (3, 12), elements=st.floats(-9.0, 9.0)), st.integers(0, 20))
def test_pairs_are_averaged_whatever_the_nodes_are_called(x, seed):
    rng = np.random.default_rng(seed)
    network = Network.random(12, 4.0, seed)
    turns = [abs(naive.wrap(x[0, j] - x[0, i])) / np.pi for i, j in network.links]
    steps = [np.abs(x[1:, j] - x[1:, i]) for i, j in network.links]
    expected = np.mean(turns), *np.mean(steps, axis=0)
    assert total_variation_arrays(*x, pairs=network.links) == pytest.approx(expected, abs=1e-12)
    for _ in range(20):
        new = rng.permutation(12)
        again = rng.permutation(network.relabel(new).links)[:, :: rng.choice([-1, 1])]
        found = total_variation_arrays(*x[:, np.argsort(new)], pairs=again)
        assert found == pytest.approx(expected, abs=1e-12)


@given(profiles, st.sampled_from([1, 2]))
def test_links_of_a_ring_of_nearest_neighbours_give_its_variations_to_the_bit(x, orientation):
    links = Network.ring(7, 1, orientation).links
    assert total_variation_arrays(*x, pairs=links) == total_variation_arrays(*x)


def test_without_pairs_there_is_no_variation():
    assert np.isnan(total_variation_arrays(ZERO, ZERO, ZERO, pairs=[])).all()


@pytest.mark.parametrize("pairs", [[[0, 4]], [[-1, 0]], [[0, 1, 2]], [[0.5, 1.0]], [0, 1]])
def test_pairs_that_name_no_nodes_are_refused(pairs):
    with pytest.raises(BadInput, match="pairs"):
        total_variation_arrays(ZERO, ZERO, ZERO, pairs=pairs)


@given(profiles, st.integers(0, 6), st.floats(-20, 20))
def test_turning_reversing_and_shifting_the_ring_change_nothing(x, turn, shift):
    expected = total_variation_arrays(*x)
    turned = np.roll(x, turn, axis=1)[:, ::-1] + shift
    assert total_variation_arrays(*turned) == pytest.approx(expected, abs=1e-13)


def test_features_give_their_variations():
    t = np.arange(3001) * 0.01
    # phase 0.5 rad a node; amplitudes 1, 2, 1, 2; one frequency
    lag = 0.5 * np.arange(4)
    u = np.array([1, 2, 1, 2]) * np.cos(4 * np.pi * t[:, None] - lag)
    v_theta, v_a, v_omega = total_variations(fourier_features(t, u, refine="sine-fit"))
    assert v_theta == pytest.approx((0.5 + 0.5 + 0.5 + 1.5) / (4 * np.pi), abs=1e-9)
    assert v_a == pytest.approx(1.0, abs=1e-9)
    assert v_omega == pytest.approx(0.0, abs=1e-9)


def test_a_steady_run_has_no_variations():
    f = fourier_features(np.arange(100.0), np.ones((100, 3)))
    assert np.isnan(total_variations(f)).all()


def test_any_object_with_the_three_profiles_will_do():
    f = SimpleNamespace(phase=ZERO, amplitude=np.array([0, 1, 0, 1.0]), frequency=ZERO)
    assert total_variations(f) == (0.0, 1.0, 0.0)


@pytest.mark.parametrize("shapes", [(3, 3, 4), (0, 0, 0)])
def test_shapes_that_do_not_fit_are_refused(shapes):
    with pytest.raises(BadInput, match=r"must have one shape \(nodes,\), not "):
        total_variation_arrays(*(np.zeros(n) for n in shapes))
    with pytest.raises(BadInput, match="one shape"):
        total_variation_arrays(np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2)))


def test_chain_has_one_difference_less_and_is_the_mean_over_its_pairs():
    phase, amplitude, frequency = [0.0, np.pi / 2, np.pi], [1.0, 3.0, 2.0], [4.0, 4.0, 1.0]
    found = total_variation_arrays(phase, amplitude, frequency, ring=False)
    assert found == pytest.approx((0.5, 1.5, 1.5))
    with pytest.raises(BadInput, match="a chain has at least two nodes"):
        total_variation_arrays([0.0], [1.0], [1.0], ring=False)


@pytest.mark.parametrize("turn", [np.pi, -np.pi])
def test_phases_exactly_half_a_turn_apart_vary_most_and_a_whole_turn_apart_not_at_all(turn):
    assert v_phase([0.0, turn, 0.0, turn]) == 1.0
    assert v_phase([np.pi, -np.pi, np.pi, -np.pi]) == 0.0
    assert v_phase([turn] * 3) == 0.0
