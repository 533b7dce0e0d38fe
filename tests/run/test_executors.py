"""The Dask executor against a cluster that is made up: what it submits, and what may go wrong."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import CancelledError
from pathlib import Path
from typing import Any

import pytest
from distributed.scheduler import KilledWorker

from chimera_hpc.run import executors as execute
from chimera_hpc.run.executors import ClusterLost, run_dask, run_serial
from chimera_hpc.run.messages import BlockReceipt, RunMessage

Outcome = BlockReceipt | BaseException | None
"""Of a block: its receipt, an error, or None when it never ends."""


class Future:
    """What the executor uses of Dask's."""

    def __init__(
        self, outcome: Outcome, cancelled: bool = False, way: OSError | None = None
    ) -> None:
        self.outcome, self._cancelled, self.way = outcome, cancelled, way

    def add_done_callback(self, call: Callable[[Future], None]) -> None:
        if self.outcome is not None or self._cancelled:
            call(self)

    def cancelled(self) -> bool:
        return self._cancelled

    def exception(self) -> BaseException | None:
        return self.outcome if isinstance(self.outcome, BaseException) else None

    def result(self) -> Any:
        if self._cancelled:
            raise CancelledError
        if self.way is not None:
            raise self.way
        return self.outcome


class Client:
    """A cluster of some workers, with outcomes of blocks in the order of the tries."""

    status = "running"

    def __init__(self, workers: int, outcomes: dict[int, list[Any]] | None = None) -> None:
        self.workers = workers
        self.outcomes = outcomes or {}
        self.submitted: list[int] = []
        self.keys: set[str] = set()

    def scheduler_info(self, n_workers: int) -> dict[str, Any]:
        return {"workers": dict.fromkeys(range(self.workers))}

    def submit(self, do: object, message: RunMessage, block: int, key: str, pure: bool) -> Future:
        assert key not in self.keys
        self.keys.add(key)
        self.submitted.append(block)
        outcome = self.outcomes.get(block, [BlockReceipt(block, 4)]).pop(0)
        return outcome if isinstance(outcome, Future) else Future(outcome)


@pytest.fixture
def message(tmp_path: Path) -> RunMessage:
    (tmp_path / "runs").mkdir()
    return RunMessage(tmp_path, 1)


def go(client: Client, message: RunMessage, blocks: range, **options: Any) -> list[BlockReceipt]:
    receipts: list[BlockReceipt] = []
    stop = options.pop("stop", lambda: False)
    run_dask(client, message, blocks, receipts.append, stop, **options)  # type: ignore[arg-type]
    return receipts


def test_every_block_is_submitted_once(message: RunMessage) -> None:
    client = Client(2)
    receipts = go(client, message, range(50))
    assert sorted(receipt.block for receipt in receipts) == list(range(50))
    assert sorted(client.submitted) == list(range(50))


def test_window_is_bounded(message: RunMessage, monkeypatch: pytest.MonkeyPatch) -> None:
    client = Client(2, {block: [None] for block in range(100)})
    asked = iter([False, False, True])
    monkeypatch.setattr(execute, "_LOOK_SECONDS", 0.01)
    began = time.monotonic()
    go(client, message, range(100), stop=lambda: next(asked, True), patience=0.2)
    assert time.monotonic() - began > 0.2  # blocks that have begun may still end
    assert client.submitted == list(range(6))


def test_killed_worker_means_that_the_block_is_submitted_again(message: RunMessage) -> None:
    lost = KilledWorker("task", None, 3)
    client = Client(1, {1: [lost, lost, BlockReceipt(1, 4)]})
    receipts = go(client, message, range(3))
    assert sorted(receipt.block for receipt in receipts) == [0, 1, 2]
    assert client.submitted.count(1) == 3


@pytest.mark.parametrize(
    "outcome",
    [Future(None, cancelled=True), Future(BlockReceipt(0), way=OSError("connection closed"))],
)
def test_lost_scheduler_is_told(outcome: Any, message: RunMessage) -> None:
    with pytest.raises(ClusterLost, match="the scheduler is gone"):
        go(Client(1, {0: [outcome]}), message, range(3))


def test_cluster_without_workers_is_given_up(
    message: RunMessage, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(execute, "NO_WORKER_SECONDS", 0.05)
    monkeypatch.setattr(execute, "_LOOK_SECONDS", 0.02)
    monkeypatch.setattr(execute, "_COUNT_SECONDS", 0.02)
    client = Client(0, {0: [None]})
    with pytest.raises(ClusterLost, match="no worker for"):
        go(client, message, range(1))
    asked = iter([False] * 20)
    go(
        Client(0, {0: [None]}),
        message,
        range(1),
        stop=lambda: next(asked, True),
        patience=0.1,
        may_come=lambda: True,
    )


def test_error_on_the_way_is_the_trouble_of_its_block(message: RunMessage) -> None:
    receipts = go(Client(1, {1: [ModuleNotFoundError("no module x")]}), message, range(3))
    error = {receipt.block: receipt.error for receipt in receipts}
    assert error[0] is None
    assert error[1] is not None
    assert error[1].text == "ModuleNotFoundError: no module x"


def test_stop_reaches_the_workers_and_what_they_have_is_waited_for(message: RunMessage) -> None:
    client = Client(1, {0: [BlockReceipt(0, 2, stopped=True)]})
    receipts = go(client, message, range(30), stop=lambda: True)
    assert message.stop_file.exists()
    assert len(receipts) == 3
    assert client.submitted == [0, 1, 2]


def test_serial_executor_stops_between_blocks(
    message: RunMessage, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(execute, "do_block", lambda message, block, stop: BlockReceipt(block))
    receipts: list[BlockReceipt] = []
    run_serial(message, range(10), receipts.append, lambda: len(receipts) == 4)
    assert [receipt.block for receipt in receipts] == [0, 1, 2, 3]
