"""``audit``: what it computes, keeps, draws and refuses."""

from __future__ import annotations

import json
import os
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chimera_hpc.base.status import Status
from chimera_hpc.cli import audit as commands
from chimera_hpc.reduction import audit as audits
from chimera_hpc.reduction import audit_runs
from chimera_hpc.reduction.audit import Sample, audit_sweep
from chimera_hpc.reduction.audit_runs import Runs, compute_again, compute_piece, variant
from chimera_hpc.run.block import run_block
from chimera_hpc.store.ledger import digests
from chimera_hpc.store.store import Store

Run = Callable[..., tuple[int, str, str]]


def results_of(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "results.json").read_text())
    return found


def stored_bytes(folder: Path) -> dict[Path, bytes]:
    return {p: p.read_bytes() for p in (folder / "store.zarr").rglob("*") if p.is_file()}


def test_the_same_audit_twice_is_the_same_and_leaves_the_store_alone(
    finished: Path, sweep: Run
) -> None:
    before = stored_bytes(finished)
    words = ("audit", finished, "--workers", 1, "--points", 7, "--no-figures", "--json")
    first, second = sweep(*words), sweep(*words)
    assert first == second
    assert first[0] == 0
    assert json.loads(first[1]) == results_of(finished)["audit"]
    assert stored_bytes(finished) == before


@pytest.mark.slow
def test_processes_find_what_one_does(finished: Path) -> None:
    chosen = np.array([0, 6, 7, 13])
    path = finished / "store.zarr"
    alone = compute_again(path, chosen, audit_runs.WAYS, workers=1)
    shared = compute_again(path, chosen, audit_runs.WAYS, workers=2)
    for way in audit_runs.WAYS:
        for one, other in zip(alone[way], shared[way], strict=True):
            np.testing.assert_array_equal(one, other)


def test_ways_change_what_they_say_and_nothing_else(finished: Path) -> None:
    sweep = Store.open(finished / "store.zarr").sweep
    made = {way: variant(sweep, way) for way in audit_runs.WAYS}
    for way, (other, nudge) in made.items():
        spec, features = other.integrator, other.features
        assert nudge == (1e-13 if way == "nudged" else 0.0)
        factor = 100.0 if way == "tighter" else 1.0
        assert spec.rtol == pytest.approx(sweep.integrator.rtol / factor)
        assert spec.atol == pytest.approx(sweep.integrator.atol / factor)
        assert spec.t_end == (300.0 if way == "longer" else 60.0)
        assert features.start == (270.0 if way == "longer" else 30.0)
        assert features.n_peaks == sweep.features.n_peaks
        assert other.n_samples == sweep.n_samples
        assert other.keep.dtype == sweep.keep.dtype
        assert other.points().row(3) == sweep.points().row(3)


def test_each_way_is_another_computation(finished: Path) -> None:
    """Without their factor or nudge the ways would give the stored bits back."""
    store = Store.open(finished / "store.zarr")
    ledger, chosen = store.ledger(), np.arange(10, 15)
    steps = ledger["steps"][chosen]
    assert np.all(compute_piece(store.path, chosen, "stored").steps == steps)
    tighter = compute_piece(store.path, chosen, "tighter").steps / steps
    # A pair of order 5 takes 100 ** (1 / 5) = 2.5 times the steps.
    assert np.all((tighter > 1.7) & (tighter < 3.2))
    longer = compute_piece(store.path, chosen, "longer").steps / steps
    assert np.all((longer > 4.0) & (longer < 6.0))
    moved = run_block(store.sweep, store.points[chosen], nudge=audit_runs.NUDGE)
    assert np.all(digests(moved.features, moved.scalars) != ledger["digest"][chosen])


def test_reduce_keeps_the_audit_and_drops_it_with_other_points_or_classes(
    finished: Path, job: Path, sweep: Run
) -> None:
    sweep("audit", finished, "--workers", 1, "--points", 3, "--no-figures")
    audit = results_of(finished)["audit"]
    assert sweep("reduce", finished, "--no-figures")[0] == 0
    assert results_of(finished)["audit"] == audit
    words = ("--out", finished, "--cluster", "serial", "--no-figures")
    _, out, _ = sweep("run", job, *words, "--set", "reduction.cuts=[2]")
    assert "audit was of other points or classes and is dropped" in out
    assert "audit" not in results_of(finished)
    sweep("audit", finished, "--workers", 1, "--points", 3, "--no-figures")
    (finished / "store.zarr" / "ledger" / "c.0.0").unlink()
    assert "is dropped" in sweep("reduce", finished, "--no-figures")[1]


def test_an_unfinished_sweep_says_how_far_it_is(finished: Path, sweep: Run) -> None:
    (finished / "store.zarr" / "ledger" / "c.0.0").unlink()
    code, _, err = sweep("audit", finished, "--no-figures")
    assert code == 2
    assert err.count("\n") == 1
    assert "`reduce` first" in err
    sweep("reduce", finished, "--no-figures")
    code, out, _ = sweep("audit", finished, "--workers", 0, "--share", 0.3, "--no-figures")
    assert code == 0
    assert "3 of 11 points with a result (4 more have none) computed again" in out


def test_failures_are_counted_by_status_and_left_out_of_the_comparison(
    finished: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def one_fails(path: Path, chosen: Any, way: str) -> Runs:
        made = compute_piece(path, chosen, way)
        made.status[0] = Status.STEP_BUDGET
        return made

    monkeypatch.setattr(audit_runs, "compute_piece", one_fails)
    audit = audit_sweep(finished, Sample(points=5))
    for made in audit["ways"].values():
        assert (made["failed"], made["of"]) == ({"step_budget": 1}, 4)
    assert audit["changed"][0]["tighter"] is None


def test_a_worker_that_dies_is_a_failure(finished: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(audit_runs, "compute_piece", _dies)
    runs = compute_again(finished / "store.zarr", np.arange(3), ["tighter"], workers=2)
    assert runs["tighter"].status.tolist() == [Status.WORKER_LOST] * 3


def _dies(path: Path, chosen: Any, way: str) -> Runs:
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


def test_a_cell_with_one_seed_has_no_bootstrap(finished: Path, job: Path, sweep: Run) -> None:
    folder = finished.parent / "single"
    words = ("--out", folder, "--cluster", "serial", "--no-figures")
    sweep("run", job, *words, "--set", "seeds=1", "--set", "P=3")
    code, out, _ = sweep("audit", folder, "--workers", 1, "--no-figures")
    assert code == 0
    assert "no bootstrap of 1 cells: they have a single run" in out
    assert results_of(folder)["audit"]["bootstrap"]["mean"] is None


@pytest.mark.slow
def test_figures_and_report_show_the_audit(finished: Path, sweep: Run) -> None:
    code, out, _ = sweep("audit", finished, "--workers", 1, "--points", 3)
    assert code == 0
    assert "start moved by 1e-13 (control)" in out
    assert (finished / "figures" / "modal_classes_3.png").is_file()
    page = (finished / "report.html").read_text()
    assert 'id="h-audit"' in page
    assert "t_end 300 instead of 60" in page


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--share", "0"), "--share 0.0: a share above 0"),
        (("--share", "1.5"), "--share 1.5"),
        (("--share", "nan"), "--share nan"),
        (("--points", "0"), "--points 0: allowed is 1 or more"),
        (("--points", "2", "--share", "0.5"), "--share and --points: one of them"),
        (("--seed", "-1"), "--seed -1"),
        (("--workers", "-2"), "--workers -2"),
    ],
)
def test_bad_input_is_one_line(
    finished: Path, sweep: Run, words: tuple[str, ...], said: str
) -> None:
    before = (finished / "results.json").read_bytes()
    code, _, err = sweep("audit", finished, *words)
    assert code == 2
    assert said in err
    assert err.count("\n") == 1
    assert (finished / "results.json").read_bytes() == before


def test_a_sweep_that_was_not_reduced_is_refused(finished: Path, sweep: Run) -> None:
    (finished / "results.json").unlink()
    assert sweep("audit", finished)[0] == 2
    shutil.rmtree(finished)
    assert sweep("audit", finished)[0] == 2


def test_an_audit_while_the_sweep_is_reduced_otherwise_is_not_written(
    finished: Path, monkeypatch: pytest.MonkeyPatch, sweep: Run
) -> None:
    def meanwhile(*words: Any) -> dict[str, Runs]:
        made = compute_again(*words)
        results = results_of(finished)
        results["cuts"] = {}
        (finished / "results.json").write_text(json.dumps(results))
        return made

    monkeypatch.setattr(audits, "compute_again", meanwhile)
    code, _, err = sweep("audit", finished, "--workers", 1, "--points", 1)
    assert (code, "reduced again while the audit went on" in err) == (2, True)
    assert "audit" not in results_of(finished)


@pytest.mark.parametrize("workers", [1, 2])
def test_ctrl_c_leaves_results_as_they_were(
    finished: Path, monkeypatch: pytest.MonkeyPatch, sweep: Run, workers: int
) -> None:
    def press(done: int, total: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(commands, "_progress", press)
    before = (finished / "results.json").read_bytes()
    code, _, err = sweep("audit", finished, "--workers", workers)
    assert (code, err) == (130, "")
    assert (finished / "results.json").read_bytes() == before
    assert not list(finished.glob(".*.partial"))


@pytest.mark.slow
def test_a_sweep_that_does_not_measure_the_distance_is_audited(
    job: Path, tmp_path: Path, sweep: Run
) -> None:
    out = tmp_path / "panel"
    words = ("--set", 'measures.panel=["variations"]', "--cluster", "serial", "--no-figures")
    assert sweep("run", job, "--out", out, *words)[0] == 0
    code, text, error = sweep("audit", out, "--workers", 1, "--points", 3, "--no-figures")
    assert (code, error) == (0, "")
    assert results_of(out)["audit"]["points"] == 3
    assert "tighter" in text
