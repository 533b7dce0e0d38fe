"""Telling how a run goes: plain lines, the log, and what may go wrong with them."""

from __future__ import annotations

import errno
import io
import re
from pathlib import Path

import pytest

from chimera_hpc.run import progress
from chimera_hpc.run.progress import Reporter


class Full(io.StringIO):
    """A stream on a full disk."""

    def write(self, text: str) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_plain_lines_come_at_intervals_and_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 0.0
    monkeypatch.setattr(progress.time, "monotonic", lambda: now)
    stream = io.StringIO()
    with Reporter(100, stream=stream) as reporter:
        reporter.count(20, 1)
        for _ in range(8):
            now += 4.0
            reporter.add(9, 1, seconds=4.0)
    lines = stream.getvalue().splitlines()
    # Every 10 s: after 12, 24 and, at the end, 32 s.
    assert lines == [
        "50 of 100 points, 4 failed, 2.5 points/s, elapsed 00:00:12, ETA 00:00:20",
        "80 of 100 points, 7 failed, 2.5 points/s, elapsed 00:00:24, ETA 00:00:08",
        "100 of 100 points, 9 failed, 2.5 points/s, elapsed 00:00:32, ETA 00:00:00",
    ]


def test_no_time_to_go_is_told_before_any_point_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 0.0
    monkeypatch.setattr(progress.time, "monotonic", lambda: now)
    stream = io.StringIO()
    with Reporter(8, stream=stream) as reporter:
        for n_done in (0, 4):
            now += 20.0
            reporter.add(n_done, 0, seconds=20.0)
    assert stream.getvalue().splitlines() == [
        "4 of 8 points, 0.2 points/s, elapsed 00:00:40, ETA 00:00:20"
    ]


@pytest.mark.parametrize(("workers", "load"), [(1, 5.0), (4, 5.0), (16, 0.0)])
@pytest.mark.parametrize("block", [2.0, 30.0])
def test_rate_is_that_of_all_workers_from_the_first_blocks_on(
    workers: int, load: float, block: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Workers do blocks of 10 points, out of step, and load something before their first one.
    begun = [(0.1 + 0.9 * k / workers) * block for k in range(workers)]
    ends = sorted(
        (begin + load + (k + 1) * block, block + load * (k == 0))
        for begin in begun
        for k in range(20)
    )
    true = workers * 10 / block
    pace = progress._Pace(workers)
    rates = [pace.add(10, seconds, now) for now, seconds in ends]
    assert min(rates[:workers]) == pytest.approx(true * block / (block + load))
    assert rates[workers : 5 * workers] == pytest.approx([true] * (4 * workers))
    # By the clock: up to one block per worker is under way.
    assert rates[5 * workers : -workers] == pytest.approx([true] * (14 * workers), rel=0.3)


def test_durations_have_days_when_they_need_them() -> None:
    assert progress.duration(59.7) == "00:01:00"
    assert progress.duration(2 * 86400 + 3 * 3600 + 4 * 60 + 5) == "2 d 03:04:05"


def test_log_gets_every_line_with_its_time(tmp_path: Path) -> None:
    with Reporter(10, tmp_path / "run.log", io.StringIO()) as reporter:
        reporter.say("to be seen")
        reporter.note("for later")
    lines = (tmp_path / "run.log").read_text().splitlines()
    assert len(lines) == 2
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\+00:00 to be seen", lines[0])
    assert lines[1].endswith(" for later")


def test_full_disk_is_no_reason_to_stop() -> None:
    with Reporter(10, Path("/dev/full"), Full()) as reporter:
        reporter.say("no one hears this")
        reporter.add(10, 0)
    assert reporter.done == 10


def test_terminal_gets_a_bar_with_count_and_rate() -> None:
    stream = Terminal()
    with Reporter(8, stream=stream) as reporter:
        reporter.count(2, 0)
        reporter.add(6, 0, seconds=2.0)
    assert "8/8" in stream.getvalue()
    assert "3.0/s" in stream.getvalue()
