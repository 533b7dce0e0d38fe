"""Thresholds along chains."""

import numpy as np

from chimera_hpc.classify.hysteresis import band, class_thresholds, largest_step


def test_steps_between_classes_are_found_in_both_directions():
    x = [1.0, 2.0, 3.0, 4.0]
    there = class_thresholds(x, ["ordered", "ordered", "chimera", "ordered"])
    assert [(one.between, one.interval, one.at) for one in there] == [
        (("ordered", "chimera"), (2.0, 3.0), 2.5),
        (("chimera", "ordered"), (3.0, 4.0), 3.5),
    ]
    (back,) = class_thresholds(x[::-1], ["chimera", "chimera", "ordered", "ordered"])
    assert (back.between, back.interval) == (("chimera", "ordered"), (2.0, 3.0))
    assert class_thresholds(x, [None] * 4) == []


def test_a_point_without_a_class_widens_the_interval():
    (found,) = class_thresholds([1.0, 2.0, 3.0], ["ordered", None, "chimera"])
    assert found.interval == (1.0, 3.0)


def test_the_largest_step_of_the_order_parameter():
    found = largest_step([4.0, 3.0, 2.0, 1.0], [0.9, np.nan, 0.8, 0.1])
    assert found is not None
    assert (found.interval, found.at) == ((1.0, 2.0), 1.5)
    assert largest_step([1.0, 2.0], [np.nan, 0.1]) is None


def test_the_band_holds_all_intervals():
    steps = [largest_step([1.0, 2.0, 3.0], levels) for levels in ([0, 0, 1], [0, 1, 1], [0, 1, 1])]
    assert band(steps) == {"at": 1.5, "interval": [1.0, 3.0], "chains": 3}
