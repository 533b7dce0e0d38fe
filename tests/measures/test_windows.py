import itertools

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from chimera_hpc.measures.windows import maxima, windows


@pytest.mark.parametrize(
    ("x", "expected"),
    [
        ([0, 1, 0], [1]),
        ([1, 0, 1], []),  # the ends are no maxima
        ([0, 1, 2, 3], []),
        ([2, 2, 2], []),
        ([0, 1, 1, 0], [1]),  # a plateau counts once, at its middle rounded down
        ([0, 1, 1, 1, 0], [2]),
        ([0, 1, 1, 2, 0], [3]),  # a step on the way up is no maximum
        ([0, 2, 1, 1, 0], [1]),  # nor is one on the way down
        ([0, 1, 1], []),  # nor a plateau that reaches the end
        ([1, 1, 0, 1, 0], [3]),
        ([0, 1, 0, 1, 0, 1, 0], [1, 3, 5]),
        ([0], []),
    ],
)
def test_maxima_of_hand_made_signals(x, expected):
    assert maxima(np.array(x, dtype=float)).tolist() == expected


@given(hnp.arrays(float, st.integers(1, 60), elements=st.integers(0, 3).map(float)))
def test_maxima_equal_those_of_scipy_plateaus_included(x):
    assert maxima(x).tolist() == naive.maxima(x).tolist()


def test_maxima_of_every_other_sample_all_fit():
    x = np.tile([0.0, 1.0], 50)
    assert maxima(x).tolist() == list(range(1, 99, 2))


@pytest.mark.parametrize(
    ("count", "n_peaks", "n_overlap", "expected"),
    [
        (9, 10, 5, []),
        (10, 10, 5, [(0, 9)]),
        (14, 10, 5, [(0, 9)]),
        (15, 10, 5, [(0, 9), (5, 14)]),
        (6, 3, 0, [(0, 2), (3, 5)]),  # no maximum shared
        (5, 3, 1, [(0, 2), (2, 4)]),  # the end of one is the begin of the next
        (5, 3, 2, [(0, 2), (1, 3), (2, 4)]),
        (0, 3, 0, []),
    ],
)
def test_windows_of_hand_made_lists(count, n_peaks, n_overlap, expected):
    first, last = windows(10 * np.arange(count), n_peaks, n_overlap)
    assert list(zip(first // 10, last // 10, strict=True)) == expected


@given(st.sets(st.integers(0, 500)), st.integers(3, 12), st.data())
def test_windows_hold_n_peaks_maxima_share_n_overlap_and_leave_out_no_complete_one(
    places, n_peaks, data
):
    n_overlap = data.draw(st.integers(0, n_peaks - 1))
    peaks = np.array(sorted(places), dtype=np.int64)
    first, last = windows(peaks, n_peaks, n_overlap)
    inside = [set(peaks[(peaks >= a) & (peaks <= b)]) for a, b in zip(first, last, strict=True)]
    assert all(len(held) == n_peaks for held in inside)
    assert all(len(a & b) == n_overlap for a, b in itertools.pairwise(inside))
    used = (len(inside) - 1) * (n_peaks - n_overlap) + n_peaks if inside else 0
    assert len(peaks) - used < (n_peaks - n_overlap if inside else n_peaks)
