"""The executors: compute the blocks of a store one after the other, or on a Dask cluster.

The serial executor is the reference: every other one calls the same `work.do_block` on the same
blocks and leaves the same bytes. Only the store records what is done; an executor that is killed
loses only its current blocks.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from typing import TYPE_CHECKING

from chimera_hpc.run.messages import BlockError, BlockReceipt, RunMessage, tell_to_stop

if TYPE_CHECKING:
    from distributed import Client, Future

OnReceipt = Callable[[BlockReceipt], None]
ShouldStop = Callable[[], bool]

WINDOW = 3
"""Blocks submitted to the scheduler at a time, for each worker: enough that none waits, few enough
that the scheduler's memory does not grow with the sweep."""
NO_WORKER_SECONDS = 90.0
"""Time without any worker after which the cluster is given up: new ones take a while to start."""
_LOOK_SECONDS = 0.5
_COUNT_SECONDS = 2.0
"""How often the workers are counted."""


class ClusterLost(RuntimeError):
    """The scheduler, or every worker, is gone; what was in flight is lost, the store is not."""


def do_block(
    message: RunMessage, block: int, local_stop: Callable[[], bool] | None = None
) -> BlockReceipt:
    """Compute a block in this process, which first loads the integrator; see `work.do_block`."""
    from chimera_hpc.run import work

    return work.do_block(message, block, local_stop)


def run_serial(
    message: RunMessage, blocks: Iterable[int], on_receipt: OnReceipt, should_stop: ShouldStop
) -> None:
    """Do the blocks one after the other in this process."""
    for block in blocks:
        if should_stop():
            return
        on_receipt(do_block(message, block, should_stop))


def run_dask(
    client: Client,
    message: RunMessage,
    blocks: Iterable[int],
    on_receipt: OnReceipt,
    should_stop: ShouldStop,
    patience: float = 60.0,
    may_come: Callable[[], bool] = lambda: False,
) -> None:
    """Do the blocks on a Dask cluster, a bounded window of them at a time.

    Workers write their blocks themselves and send back receipts. A task whose worker died is
    submitted again: the claims in the store count the losses, so the culprit is found.

    message, blocks, on_receipt: as in `run_serial`.
    should_stop: asked twice a second. When true, the workers are told through the message's stop
        file, and what they have done so far is waited for.
    patience: seconds of waiting for workers that were told to stop.
    may_come: whether workers that are not there yet may still come, as from the queue of a batch
        system: then they are waited for.

    Raises ClusterLost when the scheduler went away, or there was no worker for `NO_WORKER_SECONDS`.
    """
    _Window(client, message, blocks, patience, may_come).run(on_receipt, should_stop)


class _Window:
    """The blocks in flight, and how the cluster is."""

    def __init__(
        self,
        client: Client,
        message: RunMessage,
        blocks: Iterable[int],
        patience: float,
        may_come: Callable[[], bool],
    ) -> None:
        self.client, self.message, self.patience = client, message, patience
        self.may_come = may_come
        self.waiting: Iterator[int] = iter(blocks)
        self.flying: dict[Future[BlockReceipt], int] = {}
        self.landed: queue.SimpleQueue[Future[BlockReceipt]] = queue.SimpleQueue()
        self.submitted = self.workers = 0
        self.seen = time.monotonic()
        self.counted = -_COUNT_SECONDS

    def run(self, on_receipt: OnReceipt, should_stop: ShouldStop) -> None:
        stopping: float | None = None
        self.look_after()
        self.top_up()
        while self.flying:
            if stopping is None and should_stop():
                stopping = time.monotonic()
                tell_to_stop(self.message)
            for future in self.take_landed():
                block = self.flying.pop(future)
                receipt = self.receipt(future, block)
                if receipt is not None:
                    on_receipt(receipt)
                elif stopping is None:
                    self.submit(block)
            self.look_after()
            if stopping is None:
                self.top_up()
            elif time.monotonic() - stopping > self.patience:
                return

    def submit(self, block: int) -> None:
        self.submitted += 1
        # The key is new each time: the scheduler must not count how often a block failed.
        future = self.client.submit(
            do_block,
            *(self.message, block),
            key=f"block-{block}-{self.message.run}-{self.submitted}-{id(self)}",
            pure=False,
        )
        self.flying[future] = block
        future.add_done_callback(self.landed.put)

    def top_up(self) -> None:
        for _ in range(WINDOW * max(1, self.workers) - len(self.flying)):
            block = next(self.waiting, None)
            if block is None:
                return
            self.submit(block)

    def take_landed(self) -> list[Future[BlockReceipt]]:
        """Return the futures that have ended, waiting half a second for the first one."""
        ended = []
        try:
            ended.append(self.landed.get(timeout=_LOOK_SECONDS))
            while True:
                ended.append(self.landed.get_nowait())
        except queue.Empty:
            return ended

    def receipt(self, future: Future[BlockReceipt], block: int) -> BlockReceipt | None:
        """Return the receipt of a block, or None when its worker died."""
        from distributed.scheduler import KilledWorker

        try:
            error = None if future.cancelled() else future.exception()
            if error is None:
                receipt: BlockReceipt = future.result()
                return receipt
        except (CancelledError, OSError, TimeoutError):
            # `do_block` raises none of these: they tell of the way to the scheduler.
            raise ClusterLost("the scheduler is gone") from None
        if isinstance(error, KilledWorker):
            return None
        text = " ".join(f"{type(error).__name__}: {error}".split())
        return BlockReceipt(block, error=BlockError(text, text))

    def look_after(self) -> None:
        """Count the workers from time to time; raise ClusterLost if there is none for too long."""
        now = time.monotonic()
        if now - self.counted < _COUNT_SECONDS:
            return
        self.counted = now
        self.workers = self.count_workers()
        if self.workers or self.may_come():
            self.seen = now
        elif now - self.seen > NO_WORKER_SECONDS:
            raise ClusterLost(f"no worker for {NO_WORKER_SECONDS:.0f} s")

    def count_workers(self) -> int:
        """Return the number of workers; 0 while the scheduler cannot be asked."""
        if self.client.status != "running":
            return 0
        try:
            return len(self.client.scheduler_info(n_workers=-1)["workers"])
        except (OSError, TimeoutError, ValueError, RuntimeError):
            return 0
