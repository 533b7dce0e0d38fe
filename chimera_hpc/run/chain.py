"""A chain that is being computed: states to start points from, and results not yet written."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.store.block_result import BlockResult, joined
from chimera_hpc.store.blocks import DamagedChunk
from chimera_hpc.store.ledger import read_block
from chimera_hpc.store.store import Store

Rows = NDArray[np.int64]

LEAST_SECONDS = 1.0
"""Least time between two writes of a chain."""
WRITING_SHARE = 0.05
"""Most of the time that writing takes: each write rewrites what the block holds so far."""


class Chain:
    """The points of one block, each of which starts from the last state of the one before.

    A point after a failed one is not started: an initial state of its own could put it on another
    branch.

    write: called with results, their number of tries and their rows in the block.
    """

    def __init__(
        self, store: Store, block: int, write: Callable[[BlockResult, int, Rows], None]
    ) -> None:
        start, stop = store.block(block)
        self.states = np.full((stop - start, store.n_state), np.nan)
        self._write, self._tries = write, 0
        self._held: list[BlockResult] = []
        self._rows: list[int] = []
        self._written, self._cost = time.monotonic(), 0.0
        self.is_damaged = False
        try:
            if read_block(store.path, block, store.block_size) is not None:
                self.states[:] = store.files.read("state", block)[: stop - start]
        except DamagedChunk:
            self.is_damaged = True

    def starts(self, row: int) -> NDArray[np.float64]:
        """Return the state before a point, shape (1, variables); NaN for the first of the chain."""
        return self.states[[row - 1]] if row else np.full_like(self.states[:1], np.nan)

    def is_cut(self, row: int) -> bool:
        """Whether there is no state from which a point could start."""
        return row > 0 and bool(np.isnan(self.states[row - 1]).all())

    def take(self, row: int, result: BlockResult, tries: int) -> None:
        """Take the result of one point; write the results that are held from time to time."""
        assert result.state is not None
        self.states[row] = result.state[0]
        if tries != self._tries:
            self.flush()
        self._held.append(result)
        self._rows.append(row)
        self._tries = tries
        pause = max(LEAST_SECONDS, self._cost / WRITING_SHARE)
        if time.monotonic() - self._written > pause:
            self.flush()

    def flush(self) -> None:
        """Write the results that are held."""
        if not self._held:
            return
        began = time.monotonic()
        self._write(joined(self._held), self._tries, np.array(self._rows))
        self._held, self._rows = [], []
        self._written = time.monotonic()
        self._cost = self._written - began
