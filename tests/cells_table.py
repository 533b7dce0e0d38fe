"""A stand-in for the points of a sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Table:
    """A stand-in for the points of a sweep: cells named by P, in order of first appearance."""

    P: np.ndarray

    def cells(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        values, first, cell = np.unique(self.P, return_index=True, return_inverse=True)
        order = np.argsort(first)
        rank = np.argsort(order)
        return rank[cell], {"P": values[order], "epsilon": np.full(len(values), 0.05)}
