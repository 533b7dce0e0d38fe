"""Packed matrices: what a kernel multiplies with is the matrix, and equal rows are found."""

from __future__ import annotations

import numpy as np
import pytest
from networks_for_tests import complete, random_complex, two_populations
from scipy.sparse import csr_array

from chimera_hpc.integrate.jit import jit
from chimera_hpc.integrate.simd import load, store
from chimera_hpc.integrate.stepper import RIGHT_HAND_SIDE
from chimera_hpc.models.csr import Packed, pack, packed
from chimera_hpc.models.csr_kernels import add_products, matrix_at, product, row_at


def unpacked(found: Packed, number: int = 0) -> np.ndarray:
    """Read a matrix back, entry by entry."""
    ints = found.integers
    reals = ints.view(np.float64)
    header = ints[8 * number : 8 * number + 8].tolist()
    rows, shared, order, start, column, value, each, runs = header
    first = 0
    for length, end in ints[runs + 1 :][: 2 * ints[runs]].reshape(-1, 2):
        assert (np.diff(ints[start:][first : end + 1]) == length).all()
        first = end
    assert first == (shared or rows)
    table = []
    for k in range(shared or rows):
        begin, end = ints[start + k : start + k + 2].tolist()
        columns = ints[column + begin : column + end]
        assert (np.diff(columns) > 0).all()
        table.append((columns, reals[value + begin : value + end] if value else reals[each + k]))
    width = 1 + max(max(columns, default=0) for columns, _ in table)
    matrix = np.zeros((rows, width if value and not shared else rows))
    for k, i in enumerate(ints[order : order + rows]):
        columns, values = table[ints[each + k] if shared else k]
        matrix[i, columns] = values
        if shared or not value:
            matrix[i, i] += reals[each + rows + k]
    return matrix


COMPLETE = np.ones((12, 12)) - np.eye(12)
BIPARTITE = np.kron([[0, 1], [1, 0]], np.ones((6, 6)))


@pytest.mark.parametrize(
    ("matrix", "n_shared", "n_entries"),
    [
        (COMPLETE, 1, 12),
        (12 * np.eye(12) - np.ones((12, 12)), 1, 12),
        (BIPARTITE, 2, 12),
        (np.kron([[0.6, 0.4], [0.4, 0.6]], np.ones((6, 6))) - 0.6 * np.eye(12), 2, 24),
        (COMPLETE + np.diag(np.arange(12.0)), 1, 12),
        (np.eye(12), 0, 12),
        (np.zeros((12, 12)), 0, 0),
        # One entry less, and nothing but equal rows would be wrong.
        (COMPLETE * (np.arange(144).reshape(12, 12) != 1), 2, 22),
        (np.arange(144.0).reshape(12, 12), 0, 143),
        # Equal in each row but for the diagonal, which is not counted: a chain.
        (2 * np.eye(12) - np.eye(12, k=1) - np.eye(12, k=-1), 0, 22),
        (np.diag(np.arange(12.0)) + np.arange(12.0)[:, None] * np.eye(12, k=5), 0, 6),
    ],
)
def test_equal_rows_are_stored_once(matrix, n_shared, n_entries):
    found = pack(csr_array(matrix))
    np.testing.assert_array_equal(unpacked(found), matrix[:, : unpacked(found).shape[1]])
    assert (found.n_shared, found.n_entries) == (n_shared, n_entries)
    assert found.kernel.startswith(f"{n_shared} shared rows" if n_shared else "sparse rows")


def _by_product(y, dy, params, ints):
    matrix = matrix_at(ints, 0)
    for k in range(matrix.rows):
        i = row_at(matrix, k)
        local = load(0.0, params, 1 + matrix.rows + i)
        store(dy, i, product(matrix, k, y, 0, local, (0.0, params, 0)))


@jit()
def _local(zero, i, context):
    params, first = context
    return load(zero, params, first + i)


def _in_pairs(y, dy, params, ints):
    matrix = matrix_at(ints, 0)
    context, work = (params, 1 + matrix.rows), (0.0, params, 0)
    add_products(matrix, y, 0, _local, context, (dy, 0), work)


@pytest.mark.parametrize("kind", ["equal", "values", "shared"])
def test_rows_in_pairs_have_the_bits_of_single_rows(kind):
    rng = np.random.default_rng(0)
    n = 40
    links = rng.random((n, n)) < 0.3 * rng.random(n)[:, None]
    values = {
        "equal": links * rng.random(n)[:, None],
        "values": links * rng.random((n, n)),
        "shared": np.kron(rng.random((2, 2)), np.ones((n // 2, n // 2))) * ~np.eye(n, dtype=bool),
    }[kind]
    found = pack(csr_array(values))
    assert (found.integers[5] == 0, found.n_shared) == (kind == "equal", 2 * (kind == "shared"))
    y, params = rng.standard_normal((n, 1)), rng.standard_normal((1 + 2 * n, 1))
    results = []
    for function in (_by_product, _in_pairs):
        dy = np.zeros((n, 1))
        jit(RIGHT_HAND_SIDE)(function)(y, dy, params, found.integers)
        results.append(dy)
    np.testing.assert_array_equal(*results)


def test_large_populations_share_two_rows():
    for which in ("adjacency", "differences", "mean"):
        found = packed(two_populations(150, 0.2), which)
        assert found.n_shared == 2
    assert packed(complete(60), "laplacian").n_entries == 60


@pytest.mark.parametrize("k", [0, 1, 2])
def test_matrices_of_a_network(k):
    network = random_complex(3)
    dirac = network.dirac(k).toarray()
    found = packed(network, "dirac", k)
    np.testing.assert_array_equal(unpacked(found), dirac)
    np.testing.assert_array_equal(unpacked(found, 1), dirac.T)
    assert found.integers[16] == (0, network.n_nodes, network.n_links)[k]
    laplacian = unpacked(packed(network, "laplacian", k))
    np.testing.assert_array_equal(laplacian, network.laplacian(k).toarray())
    assert packed(network, "dirac", k) is found


def test_key_tells_matrices_apart():
    network = random_complex(3)
    keys = {packed(network, which).key for which in ("adjacency", "differences", "mean")}
    keys |= {packed(network.with_weights(None), "adjacency").key}
    assert len(keys) == 4
    again = packed(random_complex(3), "adjacency")
    assert again.key == packed(network, "adjacency").key


def test_the_callers_matrix_is_left_alone():
    matrix = csr_array(
        (np.array([1.0, 2.0, 3.0]), np.array([2, 0, 1]), np.array([0, 2, 3])), (2, 3)
    )
    before = matrix.indices.copy()
    np.testing.assert_array_equal(unpacked(pack(matrix)), matrix.toarray())
    np.testing.assert_array_equal(matrix.indices, before)
