"""The verdict of an atlas, and how far to trust it."""

from __future__ import annotations

import numpy as np
import pytest

from chimera_hpc.classify.atlas import Atlas
from chimera_hpc.recordings.judge import verdict_of

# Two classes on a line of a cube of side 10: runs at 0, 1, 2 and at 8, 10, scaled by 10.
ATLAS = Atlas(
    scaler=np.array([[0.0, 0.0, 0.0], [10.0, 10.0, 10.0]]),
    points=np.array([[0.0, 0, 0], [0.1, 0, 0], [0.2, 0, 0], [0.8, 0, 0], [1.0, 0, 0]]),
    labels=np.array([0, 0, 0, 1, 1]),
    names=("ordered", "chimera"),
)


@pytest.mark.parametrize(
    ("place", "name", "distance", "confidence", "other", "words"),
    [
        # Distances of the runs to the next one: 0.1, 0.1, 0.1, 0.2, 0.2.
        (1.0, "ordered", 0.0, 1.0, 0.7, "among"),
        (0.5, "ordered", 0.05, 1.0, 0.75, "among"),
        (3.5, "ordered", 0.15, 0.4, 0.45, "among"),
        (-4.0, "ordered", 0.4, 0.0, 1.2, "outside"),
        (5.4, "chimera", 0.26, 0.0, 0.34, "outside"),
    ],
)
def test_confidence_compares_with_the_spacing_of_the_atlas(
    place: float, name: str, distance: float, confidence: float, other: float, words: str
):
    verdict = verdict_of(ATLAS, np.array([place, 0.0, 0.0]))
    assert verdict.name == name
    assert verdict.distance == pytest.approx(distance)
    assert verdict.confidence == pytest.approx(confidence)
    assert verdict.other == ("chimera" if name == "ordered" else "ordered")
    assert verdict.other_distance == pytest.approx(other)
    assert words in verdict.sentence
