import numpy as np
import pytest

from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.checks import floats, node_rows
from chimera_hpc.measures.incoherence import (
    differences,
    discontinuity_measure,
    sigma,
    strength_of_incoherence,
)
from chimera_hpc.measures.variation import total_variation_arrays


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
    ("values", "kind"),
    [
        ([1j], "complex128"),
        (
            np.array(["2026-01-01"], "M8[D]"),
            'datetime64[D]: pass seconds, (t - t[0]) / np.timedelta64(1, "s")',
        ),
        (np.array([1], "m8[s]"), 'timedelta64[s]: pass seconds, t / np.timedelta64(1, "s")'),
        (["1", "2"], "<U1"),
    ],
)
def test_what_is_not_real_is_named(values, kind):
    with pytest.raises(BadInput) as caught:
        floats("u", values)
    assert str(caught.value) == f"u must be an array of real numbers, not {kind}"


@pytest.mark.parametrize(
    "values",
    [np.ma.array([1.0, 2.0], mask=[0, 1]), [np.ma.array([1.0], mask=[1]), np.ma.array([2.0])]],
)
def test_masked_values_are_refused_in_lists_too(values):
    with pytest.raises(BadInput, match="u holds masked values"):
        floats("u", values)


@pytest.mark.parametrize("bad", [np.array([1j, 2, 3]), np.ma.array([1.0, 2, 3], mask=[0, 1, 0])])
@pytest.mark.parametrize(
    "measure",
    [
        lambda x: total_variation_arrays(x, x, x),
        lambda x: sigma(np.outer([1, 2], x) if x.dtype == complex else np.ma.stack([x, x])),
        differences,
        lambda x: strength_of_incoherence(x, 0.5),
        lambda x: discontinuity_measure(x, 0.5),
    ],
)
def test_every_measure_refuses_what_is_not_real_or_masked(measure, bad):
    with pytest.raises(BadInput, match=r"must be an array of real numbers|holds masked values"):
        measure(bad)
