"""Random streams: published vectors, what enters the key, and that nothing else does."""

from __future__ import annotations

import inspect
from hashlib import blake2b

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chimera_hpc.base import streams
from chimera_hpc.base.streams import STREAM_TAG, initial_stream, topology_stream

POINT = ("topological_fhn", 50, 1, 12, 12, 0)
numbers = st.integers(0, 2**63 - 1)


def raw(generator, n=2):
    return generator.bit_generator.random_raw(n).tolist()


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        (POINT, [11704978848883669759, 6404558520510686158]),
        (("networked_fhn", 500, 1, 165, 0, 9), [18061095908055955961, 16086750830987580367]),
        (
            ("topological_fhn", 50, 1, 12, 12, 2**40 + 7),
            [18108133375192734065, 6413555579423005223],
        ),
    ],
)
def test_published_vectors_of_the_initial_state(point, expected):
    assert raw(initial_stream(*point)) == expected


def test_key_of_a_model_without_a_ring():
    assert streams.stream_key("mine:X", 5, {"seed": 3}) == ("mine:X", 5, 1, 0, 0, 3)


def test_published_vector_of_the_topology():
    generator = topology_stream("topological_fhn", 50, 1, 13, 13, 3, 40)
    assert raw(generator) == [1450647402846782716, 8634726795373142443]


def test_uniform_numbers_from_the_published_stream():
    expected = [0.2690563496856553, -0.3056163738251767, 0.5449089043306545]
    assert initial_stream(*POINT).uniform(-1, 1, 3).tolist() == expected


def naive_stream(spawn_key, model, *rest):
    """The key as the docstring of the module says it, word by word."""
    name = int.from_bytes(blake2b(model.encode(), digest_size=8).digest(), "little") // 2
    words = []
    for number in (1, name, *rest):
        words += [number % 2**32, number // 2**32]
    sequence = np.random.SeedSequence(words, spawn_key=(spawn_key,))
    return np.random.Generator(np.random.PCG64(sequence))


@given(st.text(min_size=1), st.lists(numbers, min_size=6, max_size=6))
def test_both_streams_follow_the_documented_key(model, rest):
    assert raw(initial_stream(model, *rest[:5])) == raw(naive_stream(0, model, *rest[:5]))
    assert raw(topology_stream(model, *rest)) == raw(naive_stream(1, model, *rest))


@given(st.lists(numbers, min_size=5, max_size=5), st.lists(numbers, min_size=5, max_size=5))
def test_streams_differ_exactly_when_the_points_do(one, other):
    same = raw(initial_stream("m", *one)) == raw(initial_stream("m", *other))
    assert same == (one == other)


def test_each_part_of_the_key_matters(monkeypatch):
    seen = {tuple(raw(initial_stream(*POINT)))}
    changes = [("other", *POINT[1:])]
    changes += [(*POINT[:i], POINT[i] + 1, *POINT[i + 1 :]) for i in range(1, 6)]
    seen |= {tuple(raw(initial_stream(*point))) for point in changes}
    seen |= {tuple(raw(topology_stream(*POINT, flips))) for flips in (0, 1)}
    monkeypatch.setattr(streams, "STREAM_TAG", STREAM_TAG + 1)
    seen.add(tuple(raw(initial_stream(*POINT))))
    assert len(seen) == 10


def test_nothing_but_the_key_can_enter():
    key = ["model", "n_nodes", "orientation", "P", "Q", "seed"]
    assert list(inspect.signature(initial_stream).parameters) == key
    assert list(inspect.signature(topology_stream).parameters) == [*key, "flips"]


def test_numbers_drawn_before_do_not_matter():
    first = raw(initial_stream(*POINT))
    topology_stream(*POINT, 3).random(100)
    np.random.random()  # noqa: NPY002
    assert raw(initial_stream(*POINT)) == first


def test_numpy_integers_are_the_same_numbers():
    assert raw(initial_stream("m", *np.arange(1, 6))) == raw(initial_stream("m", 1, 2, 3, 4, 5))


def test_a_fraction_is_refused():
    with pytest.raises(TypeError):
        initial_stream("m", 50, 1, 12.0, 12, 0)


def test_a_number_beyond_int64_is_refused():
    with pytest.raises(OverflowError):
        initial_stream("m", 50, 1, 12, 12, 2**63)
