"""The test vectors of docs/incoherence.md, read from it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from chimera_hpc.measures.incoherence import (
    discontinuity_measure,
    local_sigma,
    sigma,
    strength_of_incoherence,
)

TEXT = (Path(__file__).parents[2] / "docs" / "incoherence.md").read_text(encoding="utf-8")
ROWS = [line.strip("| ").split("|") for line in TEXT.splitlines() if re.match(r"\| \d+ \|", line)]


def numbers(text: str) -> list[float]:
    return [float(word) for word in re.findall(r"-?[0-9.]+", text)]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0].strip())
def test_a_published_vector_holds(row: list[str]) -> None:
    first = ROWS[0][1]
    signal = row[1] if "(" in row[1] else first
    x = np.array([numbers(part) for part in signal.split("),")])
    deviations = local_sigma(x, int(row[2]))
    if row[3].strip():
        assert sigma(x) == pytest.approx(float(row[3]), abs=1e-6)
        assert deviations == pytest.approx(numbers(row[4]), abs=1e-6)
    delta = float(row[5])
    assert (deviations <= delta).astype(float).tolist() == numbers(row[6])
    assert strength_of_incoherence(deviations, delta) == float(row[7])
    assert discontinuity_measure(deviations, delta) == float(row[8])


def test_seven_vectors_are_published() -> None:
    assert len(ROWS) == 7
