import numpy as np
import pytest

from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.checks import floats, node_rows


@pytest.mark.parametrize("order", ["C", "F"])
def test_node_rows_are_contiguous_rows_of_nodes(order):
    u = np.array([[1, 2, 3], [4, 5, 6]], order=order, dtype=float)
    rows = node_rows("u", u)
    assert rows.tolist() == [[1, 4], [2, 5], [3, 6]]
    assert rows.flags.c_contiguous


def test_a_recording_by_nodes_is_not_copied():
    u = np.zeros((3, 5)).T
    assert np.shares_memory(node_rows("u", u), u)


def test_a_protected_recording_is_copied_and_stays_protected():
    u = np.zeros((3, 5)).T
    u.setflags(write=False)
    rows = node_rows("u", u)
    rows[0, 0] = 1.0
    assert not u.any()


@pytest.mark.parametrize(
    ("values", "kind"), [([1j], "complex128"), (np.array(["2026-01-01"], "M8[D]"), "datetime64[D]")]
)
def test_what_is_not_real_is_named(values, kind):
    with pytest.raises(BadInput) as caught:
        floats("u", values)
    assert str(caught.value) == f"u must be an array of real numbers, not {kind}"
