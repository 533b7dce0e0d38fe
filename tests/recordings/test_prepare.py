"""From a recording with holes and uneven times to an even grid."""

from __future__ import annotations

import numpy as np
import pytest

from chimera_hpc.base.errors import BadInput
from chimera_hpc.recordings.gaps import Gap, find_gaps, longest_stretch
from chimera_hpc.recordings.preparing import prepare, with_times
from chimera_hpc.recordings.recording import Recording

NAN = np.nan


def column(*values: float) -> np.ndarray:
    return np.array(values)[:, None]


def test_gaps_are_found_at_the_beginning_the_end_and_in_the_times():
    t = np.array([0.0, 1.0, 2.0, 6.0, 7.0])
    u = np.column_stack([[NAN, 1.0, 1.0, 1.0, 1.0], [1.0, 1.0, 1.0, NAN, NAN]])
    assert find_gaps(t, u, 1.0) == [
        Gap(2.0, 6.0, 3),
        Gap(2.0, 7.0, 2, 1),
        Gap(0.0, 1.0, 1, 0),
    ]


def test_step_half_as_long_again_as_usual_is_no_gap():
    t = np.array([0.0, 1.0, 2.5, 3.5])
    assert find_gaps(t, np.ones((4, 1)), 1.0) == []
    assert len(find_gaps(np.where(t > 2.0, t + 0.125, t), np.ones((4, 1)), 1.0)) == 1


def test_longest_stretch_is_without_long_gaps_and_whole_at_its_ends():
    t = np.arange(10.0)
    u = np.ones((10, 2))
    u[2:5, 1] = NAN
    assert longest_stretch(t, u, 1.0, bridge=2) == slice(5, 10)
    assert longest_stretch(t, u, 1.0, bridge=3) == slice(0, 10)
    u[5, 0] = u[9, 0] = NAN
    assert longest_stretch(t, u, 1.0, bridge=2) == slice(6, 9)
    assert longest_stretch(t, np.full((10, 2), NAN), 1.0, bridge=2) == slice(0, 0)


def test_longest_stretch_does_not_cross_missing_times():
    t = np.array([0.0, 1.0, 2.0, 3.0, 8.0, 9.0, 10.0])
    u = np.ones((7, 1))
    assert longest_stretch(t, u, 1.0, bridge=3) == slice(0, 4)
    assert longest_stretch(t, u, 1.0, bridge=4) == slice(0, 7)


def test_recording_of_the_wanted_step_is_not_touched():
    t = 0.1 * np.arange(50)
    u = np.random.default_rng(0).normal(size=(50, 3))
    made = prepare(Recording(t, u), 0.1)
    assert made.u.tobytes() == u.tobytes()
    assert made.t.tobytes() == t.tobytes()
    assert made.gaps == made.warnings == ()


def test_cubic_is_interpolated_without_error():
    t = np.linspace(0.0, 3.0, 16)
    made = prepare(Recording(t, column(*(t**3 - t))), 0.05)
    assert len(made.t) == 61
    assert made.u[:, 0] == pytest.approx(made.t**3 - made.t, abs=1e-12)
    assert (made.step, made.recorded_step) == (0.05, pytest.approx(0.2))


def test_uneven_times_and_short_gaps_are_interpolated():
    rng = np.random.default_rng(1)
    t = 0.02 * np.arange(500) + rng.uniform(-0.004, 0.004, 500)
    u = np.column_stack([np.sin(t), np.cos(t)])
    u[100:102, 0] = NAN
    made = prepare(Recording(t, u), None)
    assert made.step == pytest.approx(0.02, rel=0.02)
    assert made.u[:, 0] == pytest.approx(np.sin(made.t), abs=1e-6)
    assert made.u[:, 1] == pytest.approx(np.cos(made.t), abs=1e-6)
    assert "uneven times: steps from" in made.notes[-1]


def test_span_and_factors_are_applied():
    t = 0.1 * np.arange(100)
    made = prepare(Recording(t, column(*t)), None, span=(2.0, 5.0), scale=(10.0, 2.0))
    assert made.t[[0, -1]] == pytest.approx([20.0, 50.0])
    assert made.u[[0, -1], 0] == pytest.approx([4.0, 10.0])


@pytest.mark.parametrize(
    ("t", "said"),
    [
        ([0.0, 1.0, 1.0, 2.0], "times must rise: 1 follows 1 (samples 1, 2)"),
        ([0.0, NAN, 1.0, 2.0], "time 1 (from 0) is missing"),
    ],
)
def test_times_that_are_none_are_refused(t: list[float], said: str):
    with pytest.raises(BadInput) as caught:
        with_times(Recording(np.array(t), np.ones((4, 2))), None)
    assert said in str(caught.value)


def test_step_is_needed_where_there_are_no_times_and_only_there():
    with pytest.raises(BadInput, match="the file has no times: --step"):
        with_times(Recording(None, np.ones((4, 2))), None)
    with pytest.raises(BadInput, match=r"--step 0\.0: a number above 0"):
        with_times(Recording(None, np.ones((4, 2))), 0.0)
    with pytest.raises(BadInput, match="times of its own"):
        with_times(Recording(np.arange(4.0), np.ones((4, 2))), 1.0)
    made = with_times(Recording(None, np.ones((4, 2))), 0.5).t
    assert made is not None
    assert made.tolist() == [0.0, 0.5, 1.0, 1.5]


def test_node_without_values_is_named():
    u = np.ones((10, 3))
    u[:, 1] = NAN
    with pytest.raises(BadInput, match="more than half of the values of node 1 is missing; --drop"):
        prepare(Recording(np.arange(10.0), u), None)


def test_nothing_whole_is_refused():
    u = np.ones((9, 2))
    u[1::2, 0] = u[::2, 1] = NAN
    u[0, 1] = 1.0
    with pytest.raises(BadInput, match="no stretch without gaps of more than 0 samples"):
        prepare(Recording(np.arange(9.0), u), None, bridge=0)


@pytest.mark.parametrize("factor", [0.001, 1.0, 50.0])
def test_lowpass_is_in_the_unit_of_the_recording_whatever_the_factors(factor: float):
    t = 0.001 * np.arange(4000)
    slow, fast = np.sin(2 * np.pi * 2.0 * t), np.sin(2 * np.pi * 100.0 * t)
    made = prepare(Recording(t, column(*(slow + fast))), None, scale=(factor, 3.0), lowpass=20.0)
    assert made.t == pytest.approx(factor * t)
    assert made.u[500:-500, 0] == pytest.approx(3.0 * slow[500:-500], abs=0.02)


def test_lowpass_is_refused_by_the_recordings_own_sampling_frequency():
    t, u = 0.001 * np.arange(4000), np.ones((4000, 1))
    prepare(Recording(t, u), None, scale=(0.01, 1.0), lowpass=499.0)
    with pytest.raises(BadInput, match="--lowpass: "):
        prepare(Recording(t, u), None, scale=(0.01, 1.0), lowpass=501.0)
