"""The examples of models of one's own, against numbers computed by hand and by double sums."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from chimera_hpc.job import Sweep
from chimera_hpc.job.models import build
from chimera_hpc.run.simulate import simulate
from chimera_hpc.store.store import Store
from chimera_hpc.sweep import main

EXAMPLES = Path(__file__).resolve().parents[2] / "jobs" / "examples"
Array = NDArray[np.float64]


@pytest.fixture(autouse=True)
def _path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path])


def point(name: str, n_nodes: int, **values: float) -> Any:
    """Return the model of one point of an example."""
    data = Sweep.load(EXAMPLES / f"{name}.toml").to_dict()
    data |= {"grid": {"seeds": 1}, "fixed": {"n_nodes": n_nodes, **values}}
    data["features"]["groups"] = 1
    sweep = Sweep.from_dict(data)
    return build(sweep, sweep.points().row(0))


def slope(model: Any, *variables: Array) -> Array:
    """Return the right-hand side (variables, nodes)."""
    rows = np.concatenate(variables)[:, None]
    made = np.full_like(rows, np.nan)
    model.right_hand_side(rows, made, model.lane_params[:, None].copy(), model.int_params)
    return made.reshape(len(variables), -1)


def turning(model: Any, phase: Array) -> Array:
    """Return d phase / dt of phase oscillators."""
    cos, sin = np.cos(phase), np.sin(phase)
    dx, dy = slope(model, cos, sin)
    assert np.abs(cos * dx + sin * dy).max() < 1e-12  # they stay on the circle
    return cos * dy - sin * dx


def test_phase_oscillators_in_phase_turn_at_omega_minus_gain_sine_of_the_lag() -> None:
    model = point("kuramoto_sakaguchi", 10, R=3, K=2.0, omega=5.0, alpha=math.pi / 6)
    # 5 - 2 sin(30 degrees)
    assert turning(model, np.full(10, 0.7)) == pytest.approx(np.full(10, 4.0), abs=1e-12)


def test_twisted_phase_oscillators_turn_at_the_speed_of_the_hand_computed_sum() -> None:
    # One twist on 8 nodes, neighbours at 45 and 90 degrees: the mean of their cosines is
    # (sqrt(1/2) + 0) / 2, and the sines of the two sides cancel.
    model = point("kuramoto_sakaguchi", 8, R=2, K=1.0, omega=0.0, alpha=math.pi / 2)
    phase = 2.0 * np.pi * np.arange(8) / 8
    expected = -math.sqrt(0.5) / 2
    assert turning(model, phase) == pytest.approx(np.full(8, expected), abs=1e-12)


def test_phase_oscillators_are_those_of_the_double_sum() -> None:
    rng = np.random.default_rng(0)
    n, reach, alpha = 11, 4, 1.3
    model = point("kuramoto_sakaguchi", n, R=reach, K=1.5, omega=2.0, alpha=alpha)
    phase = rng.uniform(-np.pi, np.pi, n)
    expected = np.full(n, 2.0)
    for i in range(n):
        for k in range(-reach, reach + 1):
            if k:
                there = phase[(i + k) % n]
                expected[i] -= 1.5 / (2 * reach) * math.sin(phase[i] - there + alpha)
    assert turning(model, phase) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("alpha", [1.2, 1.9])
def test_in_phase_state_is_stable_below_a_lag_of_a_quarter_turn_only(alpha: float) -> None:
    # Mode q of a small perturbation grows as exp(-K cos(alpha) (1 - c_q) t), c_q the mean cosine
    # of 2 pi q k / N over the neighbours k = 1..R.
    n, reach, t_end = 16, 5, 3.0
    model = point("kuramoto_sakaguchi", n, R=reach, K=1.0, omega=1.0, alpha=alpha)
    wave = np.cos(2.0 * np.pi * np.arange(n) / n)
    phase = 1e-4 * wave
    made = simulate(
        model, u0=np.cos(phase), v0=np.sin(phase), t_end=t_end, t_step=t_end, rtol=1e-9, atol=1e-12
    )
    after = np.angle(np.exp(1j * (np.arctan2(made.w[-1], made.u[-1]) - 0.0)))
    after = np.angle(np.exp(1j * (after - after[4])))  # relative to a node at rest in the wave
    size = 2.0 * np.mean(wave * after) / 1e-4
    cosine = np.mean(np.cos(2.0 * np.pi * np.arange(1, reach + 1) / n))
    assert size == pytest.approx(math.exp(-math.cos(alpha) * (1.0 - cosine) * t_end), rel=1e-4)
    assert (size < 1.0) == (alpha < math.pi / 2)


def test_uncoupled_rayleigh_oscillator_has_the_amplitude_and_period_of_theory() -> None:
    # Averaging: the friction does no work over a turn for y^2 = 4/3; frequency 1 - epsilon^2 / 16.
    epsilon = 0.1
    model = point("rayleigh", 3, sigma=0.0, P=1, epsilon=epsilon)
    made = simulate(
        model, u0=np.ones(3), v0=np.zeros(3), t_start=200.0, t_end=500.0, t_step=0.01, rtol=1e-9
    )
    assert made.w.max() == pytest.approx(2.0 / math.sqrt(3.0), rel=2e-3)
    rises = np.flatnonzero((made.u[:-1, 0] < 0.0) & (made.u[1:, 0] >= 0.0))
    share = made.u[rises, 0] / (made.u[rises, 0] - made.u[rises + 1, 0])
    times = made.t[rises] + 0.01 * share
    turn = (times[-1] - times[0]) / (len(times) - 1)
    assert 2.0 * np.pi / turn == pytest.approx(1.0 - epsilon**2 / 16.0, abs=2e-5)


def test_rayleigh_oscillators_are_those_of_the_double_sum() -> None:
    rng = np.random.default_rng(1)
    n, reach, sigma, phi, epsilon, omega = 9, 3, 0.3, 1.1, 0.5, 1.4
    model = point("rayleigh", n, sigma=sigma, P=reach, phi=phi, epsilon=epsilon, omega=omega)
    x, y = rng.uniform(-1.0, 1.0, (2, n))
    expected = np.stack([y, epsilon * (1.0 - y**2) * y - omega**2 * x])
    matrix = np.array([[math.cos(phi), math.sin(phi)], [-math.sin(phi), math.cos(phi)]])
    for i in range(n):
        for k in range(-reach, reach + 1):
            j = (i + k) % n
            expected[:, i] += sigma / (2 * reach) * matrix @ np.array([x[j] - x[i], y[j] - y[i]])
    assert slope(model, x, y) == pytest.approx(expected, abs=1e-12)


def test_phase_lag_decides_between_order_and_disorder_through_the_whole_pipeline(
    tmp_path: Path,
) -> None:
    settings = ["grid.alpha=[1.1, 1.62]", "seeds=3", "n_nodes=40", "R=14", "integrator.t_end=150"]
    settings += ["features.start=120", "features.refine=sine-fit", "reduction.cuts=[2]"]
    settings += ['reduction.figures=["modal_classes"]']
    words = [word for text in settings for word in ("--set", text)]
    job, out = str(EXAMPLES / "kuramoto_sakaguchi.toml"), str(tmp_path / "out")
    assert main(["run", job, "--out", out, "--cluster", "serial", *words]) == 0
    cells = json.loads((tmp_path / "out" / "results.json").read_text())["cuts"]["2"]["cells"]
    assert len({cell["class"] for cell in cells}) == 2
    store = Store.open(tmp_path / "out" / "store.zarr")
    frequency, v_theta = store.features()[:, 1], store.scalars()["V_theta"]
    order = store.points.columns["alpha"] == 1.1
    # In phase: (2 pi - sin 1.1) / 2 pi turns a unit of time, for every node.
    expected = (2.0 * math.pi - math.sin(1.1)) / (2.0 * math.pi)
    assert frequency[order] == pytest.approx(np.full((3, 40), expected), rel=1e-4)
    assert (v_theta[order] < 0.01).all()
    assert (v_theta[~order] > 0.2).all()


@pytest.mark.slow
def test_rayleigh_job_runs_through_the_whole_pipeline(tmp_path: Path) -> None:
    settings = ["grid.sigma=[0.2, 0.4]", "grid.P=[5]", "seeds=2", "n_nodes=20"]
    settings += ["integrator.t_end=200", "features.start=100", "features.n_peaks=6"]
    words = [word for text in settings for word in ("--set", text)]
    job, out = str(EXAMPLES / "rayleigh.toml"), str(tmp_path / "out")
    assert main(["run", job, "--out", out, "--cluster", "serial", "--no-figures", *words]) == 0
    store = Store.open(tmp_path / "out" / "store.zarr")
    assert (store.ledger()["status"] == 1).all()
    assert main(["verify", out, "--sample", "1"]) == 0
