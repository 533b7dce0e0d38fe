"""Memory of the stepping loop: whole cache lines, used by one at a time."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from itertools import combinations
from threading import Barrier

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernel_tools import System, powers, run_all

from chimera_hpc.integrate.lanes import Control, integrate
from chimera_hpc.integrate.scratch import aligned, scratch_buffer
from chimera_hpc.integrate.simd import LANES

DECAY = System(powers, np.array([-1.0, 1.0]), 2)
STARTS = [np.array([1.0 + i, -1.0 - i]) for i in range(LANES)]


@given(st.integers(1, 40), st.integers(1, 40))
def test_state_begins_on_a_cache_line(rows, lanes):
    array = aligned(rows, lanes)
    assert array.shape == (rows, lanes)
    assert array.ctypes.data % 64 == 0
    assert array.flags.c_contiguous
    assert not array.any()


@given(st.lists(st.integers(1, 40), min_size=1, max_size=4))
def test_buffer_is_the_same_memory_as_before_where_that_is_enough(sizes):
    with scratch_buffer(40 * 40) as largest:
        address = largest.ctypes.data
    for size in sizes:
        with scratch_buffer(size, 40) as buffer:
            assert buffer.shape == (size, 40)
            assert buffer.flags.c_contiguous
            assert buffer.ctypes.data == address
    with scratch_buffer(10**6) as larger:
        assert larger.ctypes.data % 64 == 0
        larger[-1] = 1.0


def test_buffer_in_use_is_not_given_out_again_within():
    with scratch_buffer(100) as mine, scratch_buffer(100) as other:
        assert not np.shares_memory(mine, other)


def test_each_thread_has_a_buffer_of_its_own():
    """A thread that has given its buffer back keeps it: no other one may be working there."""
    with scratch_buffer(100) as mine:
        pass
    both_have_one, found = Barrier(2, timeout=30), []

    def ask():
        with scratch_buffer(100) as buffer:
            both_have_one.wait()
            found.append(buffer)
        with scratch_buffer(100) as again:
            assert again.ctypes.data == buffer.ctypes.data
            both_have_one.wait()

    with ThreadPoolExecutor(2) as pool:
        for asked in [pool.submit(ask) for _ in range(2)]:
            asked.result()
    for one, other in combinations([mine, *found], 2):
        assert not np.shares_memory(one, other)


def test_buffer_comes_back_from_work_that_failed():
    with pytest.raises(ValueError, match="its work failed"), scratch_buffer(100) as buffer:
        raise ValueError("its work failed")
    with scratch_buffer(100) as again:
        assert again.ctypes.data == buffer.ctypes.data


def test_samples_do_not_depend_on_who_used_the_buffer_before():
    long, short = Control(1.0, 0.0, 0.001), Control(1.0, 0.0, 0.1)
    first = run_all([DECAY] * LANES, STARTS, short, lanes=LANES)
    run_all([DECAY] * LANES, STARTS[::-1], long, lanes=LANES)
    again = run_all([DECAY] * LANES, STARTS, short, lanes=LANES)
    assert [run.bits for run in first] == [run.bits for run in again]


def test_an_integration_within_another_leaves_its_samples_alone():
    control, kept = Control(1.0, 0.0, 0.1), {}

    def on_end(number, outcome):
        run_all([DECAY] * LANES, STARTS[::-1], control, lanes=LANES)
        kept[number] = outcome.samples.copy()

    integrate([DECAY] * LANES, STARTS, control, 2, on_end, lanes=LANES)
    alone = run_all([DECAY] * LANES, STARTS, control, lanes=LANES)
    for number, run in enumerate(alone):
        np.testing.assert_array_equal(kept[number], run.samples)
