"""When the report is written: at the end, and now and then while a run goes on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from chimera_hpc import report
from chimera_hpc.base.errors import BadInput
from chimera_hpc.cli import reporting
from chimera_hpc.cli.reporting import LIVE_SECONDS, LiveReport

Run = Callable[..., tuple[int, str, str]]


class Clock:
    """A clock that goes on when a report is written."""

    def __init__(self, seconds: float) -> None:
        self.now, self.seconds, self.written = 0.0, seconds, 0

    def monotonic(self) -> float:
        return self.now

    def write_report(self, folder: Path, **options: object) -> None:
        self.written += 1
        self.now += self.seconds


def written_within(clock: Clock, live: LiveReport, seconds: int) -> int:
    """Refresh every second, and count the reports."""
    end = clock.now + seconds
    while clock.now < end:
        clock.now += 1.0
        live.refresh(lambda line: pytest.fail(line))
    return clock.written


@pytest.mark.parametrize(
    ("takes", "within", "count"), [(0.5, 59, 0), (0.5, 61, 1), (0.5, 600, 9), (6.0, 1200, 4)]
)
def test_refreshing_is_rare_and_cheap(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, takes: float, within: int, count: int
) -> None:
    clock = Clock(takes)
    monkeypatch.setattr(reporting, "time", clock)
    monkeypatch.setattr(report, "write_report", clock.write_report)
    assert written_within(clock, LiveReport(tmp_path, 400), within) == count
    assert clock.written * takes <= 0.02 * within + takes


def test_large_sweep_waits_for_its_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Clock(1.0)
    monkeypatch.setattr(reporting, "time", clock)
    monkeypatch.setattr(report, "write_report", clock.write_report)
    assert written_within(clock, LiveReport(tmp_path, 10**6), 500) == 0


def test_failure_is_noted_and_the_run_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(folder: Path, **options: object) -> None:
        raise BadInput("no store here")

    monkeypatch.setattr(report, "write_report", refuse)
    monkeypatch.setattr(reporting, "LIVE_SECONDS", -1.0)
    notes: list[str] = []
    LiveReport(tmp_path, 10).refresh(notes.append)
    assert notes == ["no report for now: no store here"]


@pytest.mark.slow
def test_run_writes_reports_on_the_way_and_at_its_end(
    job: Path, tmp_path: Path, sweep: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[str] = []
    real = report.write_report

    def spy(folder: Path, **options: int) -> report.Report:
        made = real(folder, **options)
        seen.append(made.path.read_text()[-200_000:])
        return made

    monkeypatch.setattr(report, "write_report", spy)
    monkeypatch.setattr(reporting, "LIVE_SECONDS", -1.0)
    monkeypatch.setattr(reporting, "_LIVE_SHARE", 1e9)
    out = tmp_path / "out"
    code, told, _ = sweep("run", job, "--out", out, "--cluster", "serial")
    assert code == 0
    assert len(seen) == 5  # after each of four blocks, and at the end
    assert f"report   {out / 'report.html'} (" in told
    assert "Not finished" not in (out / "report.html").read_text()
    assert LIVE_SECONDS == 60.0
