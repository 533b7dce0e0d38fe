"""Measures of other authors: hand-made values, slow twins, and digits of their own programs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import naive
import numpy as np
import pytest
from numpy.typing import NDArray

from chimera_hpc import measures
from chimera_hpc.base.errors import BadInput
from chimera_hpc.job import Sweep, registry
from chimera_hpc.job.tables import Features, Measures
from chimera_hpc.measures.fourier import measure_signals
from chimera_hpc.measures.measure import MeasuredRun
from chimera_hpc.run.block import run_block
from chimera_hpc.store.schema import scalar_labels

DATA = Path(__file__).parent.parent / "data"
Array = NDArray[np.float64]
PANEL = ("order", "communities", "g0h0", "phase_velocity", "centre_of_mass", "acm", "fit")
LINKS = [(0, 3), (4, 1), (1, 2), (2, 0), (3, 0)]  # node 5 is alone, one pair stands twice


def field(n_times: int = 50, n_nodes: int = 6, seed: int = 0) -> Array:
    """Phases: coherent nodes, and two that wander."""
    rng = np.random.default_rng(seed)
    phase = 0.2 * np.arange(n_times)[:, None] + 0.1 * np.arange(n_nodes)
    phase[:, 2:4] += np.cumsum(rng.normal(0, 0.3, (n_times, 2)), axis=0)
    return phase


def vectors_as_phases(z: NDArray[np.complex128]) -> tuple[Array, list[int]]:
    """Phases of pairs of oscillators whose mean vectors are z (T, 3), the last pair twice."""
    half = np.arccos(np.abs(z))
    first, second = np.angle(z) + half, np.angle(z) - half
    phase = np.hstack([first, second, first[:, 2:], second[:, 2:]])
    return phase, [0, 1, 2, 0, 1, 2, 2, 2]


def test_digits_of_synchrotools() -> None:
    """The digits in its test/test.ipynb (github.com/nkoub/synchrotools, commit of 2018).

    tests/data/synchrotools.npz holds the mean vectors of its three communities (25, 25 and 50
    nodes), made in its folder test/old_data by

        phase = np.loadtxt("spacetime_test.txt").T[85:]
        member = np.loadtxt("membership.txt")
        z = np.stack([np.exp(1j * phase[:, member == c]).mean(axis=1) for c in range(3)], axis=1)
        np.savez_compressed("synchrotools.npz", z=z)

    Its printed chi, 0.0220039, does not follow from its formula, which gives the value here.
    """
    phase, communities = vectors_as_phases(np.load(DATA / "synchrotools.npz")["z"])
    order = measures.community_order(phase, communities).mean(axis=0)
    expected = [0.95258980127, 0.180455638763, 0.948778847584]
    np.testing.assert_allclose(order, expected, rtol=1e-11)
    assert measures.order_parameter(phase).mean() == pytest.approx(0.726217543789, rel=1e-11)
    found = measures.metastability(phase, communities)
    assert found == pytest.approx(0.0031985509411240755, rel=1e-12)
    assert measures.chimera_index(phase, communities) == pytest.approx(0.1339716, abs=5e-8)


def test_correlations_of_classify_chimeras() -> None:
    """Values of classify-chimeras 2.0.2 (PyPI), whose licence keeps it out of the requirements.

    tests/data/classify-chimeras.npz was made by

        rng = np.random.default_rng(1)
        t = np.arange(60)[:, None]
        phase = 0.2 * t + 0.3 * np.sin(2 * np.pi * np.arange(24) / 24)
        phase[:, 8:14] += np.cumsum(rng.normal(0, 0.3, (60, 6)), axis=0)
        u = np.cos(phase) + 0.2 * np.cos(3 * phase)
        ring = spatial(u, boundaries="periodic"), spatial(phase, "periodic", phases=True)
        distances = globaldist(u), globaldist(phase, phases=True)
        h0 = np.sqrt(temporal(u)[-1]), np.sqrt(temporal(phase, phases=True)[-1])

    and np.savez_compressed(..., u=u, phase=phase, ring=ring, **{"global": distances}, h0=h0).
    """
    data = np.load(DATA / "classify-chimeras.npz")
    for k, u in enumerate((data["u"], np.exp(1j * data["phase"]))):
        for pairs in ("ring", "global"):
            np.testing.assert_allclose(measures.g0(u, pairs), data[pairs][k], rtol=0, atol=1e-12)
        assert measures.h0(u) == pytest.approx(data["h0"][k], abs=1e-12)
    assert 0.0 < data["ring"].min() < data["ring"].max() < 1.0


@pytest.mark.parametrize("pairs", [naive.ring_pairs(6), LINKS])
def test_curvature_and_local_order_equal_their_twins(pairs: list[tuple[int, int]]) -> None:
    phase, given = field(), np.array(pairs)
    u = np.cos(phase)
    np.testing.assert_array_equal(measures.g0(u, given, 0.2), naive.g0(u, pairs, 0.2))
    local = naive.local_order(phase, pairs)
    np.testing.assert_allclose(measures.local_order(phase, given), local, rtol=1e-13)


def test_pairs_of_a_ring_are_the_ring() -> None:
    phase, ring = field(), np.array(naive.ring_pairs(6))
    np.testing.assert_array_equal(measures.g0(phase, ring), measures.g0(phase))
    np.testing.assert_array_equal(measures.local_order(phase, ring), measures.local_order(phase))


def test_distances_equal_their_twin_over_many_chunks() -> None:
    u = np.cos(field(1100, 5))
    np.testing.assert_allclose(measures.g0(u, "global", 0.1), naive.g0_global(u, 0.1), rtol=1e-15)


@pytest.mark.parametrize("pairs", ["ring", "global", np.array([[0, 1]])])
def test_a_coherent_field_has_g0_of_one(pairs: Any) -> None:
    u = np.repeat(np.sin(np.arange(30.0))[:, None], 4, axis=1)
    for same in (u, 1e6 + 1e-3 * u, 0.0 * u, np.exp(1j * u)):
        np.testing.assert_array_equal(measures.g0(same, pairs), np.ones(30))
    assert measures.h0(u) == 1.0


def test_nodes_at_rest_correlate_with_each_other_only() -> None:
    u = np.stack([np.ones(40), 2 * np.ones(40), np.sin(np.arange(40.0))], axis=1)
    assert measures.h0(u) == np.sqrt(1 / 3)


def test_h0_relative_to_the_largest_correlation_or_not() -> None:
    u = np.random.default_rng(3).normal(size=(200, 5))
    assert measures.h0(u) == np.sqrt(1 / 10)
    assert measures.h0(u, relative=False) == 0.0


def test_node_without_neighbours_has_an_order_only_with_itself() -> None:
    phase = np.array([[0.0, np.pi / 2, 2.0]])
    with_itself = measures.local_order(phase, [[0, 1]])
    np.testing.assert_allclose(with_itself, [[np.sqrt(0.5), np.sqrt(0.5), 1.0]])
    others = measures.local_order(phase, [[0, 1]], itself=False)
    np.testing.assert_allclose(others, [[1.0, 1.0, np.nan]])


@pytest.mark.parametrize("turns", [0, 1, 3, 8])
def test_local_order_of_a_plane_wave(turns: int) -> None:
    q = 2 * np.pi * turns / 16
    phase = q * np.arange(16)[None, :] + np.arange(3.0)[:, None]
    expected = np.full((3, 16), abs(1 + 2 * np.cos(q)) / 3)
    np.testing.assert_allclose(measures.local_order(phase), expected, atol=1e-14)
    alone = measures.local_order(phase, itself=False)
    np.testing.assert_allclose(alone, np.full((3, 16), abs(np.cos(q))), atol=1e-14)
    # two neighbours on either side: the sum of exp(i k q) over k = -2 .. 2
    wide = [(i, (i + k) % 16) for i in range(16) for k in (1, 2)]
    kernel = 1.0 if turns == 0 else abs(np.sin(2.5 * q) / (5 * np.sin(q / 2)))
    np.testing.assert_allclose(measures.local_order(phase, wide)[0], np.full(16, kernel))


def test_chi_and_lambda_by_hand() -> None:
    # R of the two communities: (1, 0), then (0, 0)
    phase = np.array([[0.0, 0.0, 0.0, np.pi], [0.0, np.pi, 1.0, 1.0 + np.pi]])
    labels = ["b", "b", "a", "a"]
    assert measures.community_order(phase, labels).round(12).tolist() == [[0, 1], [0, 0]]
    assert measures.chimera_index(phase, labels) == pytest.approx(1 / 8)
    assert measures.chimera_index(phase, labels, 1) == pytest.approx(1 / 4)
    assert measures.metastability(phase, labels) == pytest.approx(1 / 8)
    assert measures.metastability(phase, labels, ddof=1) == pytest.approx(1 / 4)
    assert measures.chimera_index(phase, labels, normalised=True) == pytest.approx(36 / 40)
    assert measures.metastability(phase, labels, normalised=True) == pytest.approx(12 / 8)


def test_phase_velocity_of_a_plateau_and_an_arc() -> None:
    t = np.linspace(0.0, 50.0, 2001)
    omega = np.array([1.0, 1.0, 1.002, 1.3, -1.6, 1.0])
    phase = np.mod(t[:, None] * omega + np.arange(6), 2 * np.pi)
    found = measures.mean_phase_velocity(t, phase)
    np.testing.assert_allclose(found, omega, atol=1e-12)
    counted = measures.mean_phase_velocity(t, phase, count=True) * 50 / (2 * np.pi)
    assert counted.round(9).tolist() == [7, 7, 7, 10, -12, 7]
    assert measures.plateau(found) == 4 / 6
    assert measures.plateau(found, width=0.0) == 3 / 6
    assert measures.plateau(-found) == 4 / 6  # whichever way phases turn


def test_adaptive_coherence_equals_its_twin() -> None:
    u = np.cos(field(80, 6))
    found = measures.adaptive_coherence(u, 0.1)
    r_squared, n_delays = naive.adaptive_coherence(u, 0.1)
    assert found.r_squared == pytest.approx(r_squared, rel=1e-12)
    assert found.n_delays == n_delays


@pytest.mark.parametrize(
    ("shift", "n_delays"),
    [(np.zeros(12), 1), (np.repeat([0, 9, 21], 4), 3), (np.arange(12), 12)],
    ids=["synchronous", "clusters", "wave"],
)
def test_adaptive_coherence_tells_regimes(shift: Array, n_delays: int) -> None:
    u = np.sin(2 * np.pi * (np.arange(600)[:, None] - shift + 0.5) / 40)
    assert measures.adaptive_coherence(u).n_delays == n_delays
    assert measures.adaptive_coherence(u).r_squared == pytest.approx(1.0)
    noise = np.random.default_rng(0).normal(size=(600, 12))
    assert measures.adaptive_coherence(noise).r_squared < 0.2
    # six of twelve nodes go together
    assert 0.2 < measures.adaptive_coherence(np.hstack([u[:, :6], noise[:, 6:]])).r_squared < 0.9
    assert np.isnan(measures.adaptive_coherence(np.ones((20, 3))).r_squared)


def test_phases_of_a_sine_agree() -> None:
    angle = 2 * np.pi * np.arange(3000)[:, None] / 150 + np.array([0.0, 1.0, 2.0, 4.0])
    u, w = 3 + 2 * np.cos(angle), 1 + 2 * np.sin(angle)
    for method in ("geometric", "hilbert", "fourier"):
        found = measures.phases(u, w, method)
        assert found.shape == u.shape
        assert np.abs(found).max() <= np.pi
        assert np.abs(np.exp(1j * found) - np.exp(1j * angle)).max() < 1e-3, method
    np.testing.assert_array_equal(measures.phases(u, w), measures.phases(u, w, "geometric"))
    np.testing.assert_array_equal(measures.phases(u), measures.phases(u, method="hilbert"))


def test_strength_of_incoherence_of_a_run() -> None:
    u = np.array([[0.0, 1.0, 0.0, 0.0], [2.0, 2.0, 5.0, 1.0], [0.0, 0.0, 0.0, 0.0]])
    t = np.arange(3.0)
    # deviations (1.040440, 0.971825), a third smaller than the published vector's
    assert measures.strength_of_incoherence(t, u, 2, 1.0, "absolute") == 0.5
    assert measures.strength_of_incoherence(t, u, 2, 0.2) == 0.5  # 0.2 of the range 5
    assert measures.strength_of_incoherence(t, u, 2, 0.19) == 1.0


WRONG: list[tuple[Callable[[], Any], str]] = [
    (lambda: measures.order_parameter([1.0, 2.0]), "phase must have shape"),
    (lambda: measures.order_parameter([[1.0, np.nan]]), "phase must be finite"),
    (lambda: measures.local_order(field(), [[0, 6]]), "node 6: allowed is 0 to 5"),
    (lambda: measures.local_order(field(), [[2, 2]]), "node 2 is paired with itself"),
    (lambda: measures.local_order(field(), "links"), "must be .ring. or nodes"),
    (lambda: measures.g0(field(), [[0.0, 1.0]]), "must be .ring. or nodes"),
    (lambda: measures.g0(field(), delta=0.0), "delta must be in"),
    (lambda: measures.g0([[1.0, np.inf]]), "u must be finite"),
    (lambda: measures.h0([[1.0], [2.0]]), "two nodes"),
    (lambda: measures.chimera_index(field(), [0, 1]), "one label for each of 6"),
    (lambda: measures.chimera_index(field(), np.zeros(6), ddof=1), "allowed is 0 to 0"),
    (lambda: measures.mean_phase_velocity([0.0, 1.0], field()), "50 .at least two. rising"),
    (lambda: measures.plateau([1.0], width=-1.0), "width >= 0"),
    (lambda: measures.centre_of_mass(field(), field(3)), "one shape"),
    (lambda: measures.adaptive_coherence(field(5)), "at least 6 times"),
    (lambda: measures.phases(field(), method="geometric"), "needs w"),
    (lambda: measures.phases(field(), method="wavelet"), "one of geometric, hilbert, fourier"),
    (lambda: measures.phases(field(), method="fourier"), "fewer than 10 maxima"),
]


@pytest.mark.parametrize(("call", "said"), WRONG)
def test_wrong_input_is_one_line(call: Callable[[], Any], said: str) -> None:
    with pytest.raises(BadInput, match=said):
        call()


def measured(n_times: int = 2000, n_nodes: int = 13) -> MeasuredRun:
    """A run whose nodes turn with several frequencies."""
    t = 0.01 * np.arange(n_times)
    angle = 2 * np.pi * t[:, None] * np.repeat([1.0, 1.3], [9, 4])[:n_nodes]
    angle = angle + np.random.default_rng(2).uniform(0, 6, n_nodes)
    u, w = 0.3 + np.cos(angle) + 0.1 * np.cos(3 * angle), np.sin(angle) - 0.2
    return MeasuredRun(t, u, w, measure_signals(t, u), Features(), 0.0)


def scalars(run: MeasuredRun, *names: str) -> dict[str, float]:
    """Return what the measures of these names give, by label."""
    found: dict[str, float] = {}
    for measure in registry.measures(names):
        values = [float(value) for value in measure.compute(run)]
        found |= dict(zip(measure.labels(run.settings), values, strict=True))
    return found


def test_the_streamed_panel_equals_the_public_functions() -> None:
    run = measured()
    phase = measures.phases(run.u, run.w)
    arcs = np.repeat(np.arange(6), [3, 2, 2, 2, 2, 2])
    local = measures.local_order(phase).mean(axis=0)
    omega = measures.mean_phase_velocity(run.t, phase)
    expected = {
        "R": measures.order_parameter(phase).mean(),
        "R_std": measures.order_parameter(phase).std(),
        "R_local": local.mean(),
        "R_local_min": local.min(),
        "chi": measures.chimera_index(phase, arcs),
        "lambda": measures.metastability(phase, arcs),
        "g0": measures.g0(run.u).mean(),
        "g0_std": measures.g0(run.u).std(),
        "g0_global": measures.g0(run.u, "global").mean(),
        "h0": measures.h0(run.u),
        "omega": omega.mean(),
        "omega_std": omega.std(),
        "plateau": 9 / 13,
        "centre_of_mass": measures.centre_of_mass(run.u, run.w).mean(),
        "centre_of_mass_std": measures.centre_of_mass(run.u, run.w).std(),
        "acm": measures.adaptive_coherence(run.u).r_squared,
        "acm_delays": measures.adaptive_coherence(run.u).n_delays,
        "r_squared": np.median(run.features.r_squared),
        "r_squared_min": run.features.r_squared.min(),
        "badly_fitted": 0.0,
    }
    found = scalars(run, *PANEL)
    assert list(found) == list(expected)
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, rel=1e-9, abs=1e-12), name


def test_a_network_gives_its_own_neighbours() -> None:
    pairs = np.array([(i, (i + k) % 13) for i in range(13) for k in (1, 2)])
    run = replace(measured(), pairs=pairs)
    found = scalars(run, "order", "g0h0")
    local = measures.local_order(measures.phases(run.u, run.w), pairs).mean()
    assert found["R_local"] == pytest.approx(local, rel=1e-9)
    assert found["R_local"] != pytest.approx(scalars(measured(), "order")["R_local"], rel=1e-3)
    assert found["g0"] == measures.g0(run.u, pairs).mean()


def test_bursts_are_badly_fitted() -> None:
    run = measured()
    u = np.exp(-0.5 * ((run.t[:, None] + 0.1 * np.arange(5)) % 1.0 / 0.02) ** 2)
    bursts = replace(run, u=u, features=measure_signals(run.t, u))
    found = scalars(bursts, "fit")
    assert found["badly_fitted"] == 1.0
    assert found["r_squared"] < 0.5


def test_third_harmonic_is_the_share_that_the_fit_leaves() -> None:
    t = 0.01 * np.arange(5001)
    x = 2 * np.pi * t[:, None] + np.arange(3)
    features = measures.fourier_features(t, np.cos(x) + 0.3 * np.cos(3 * x))
    np.testing.assert_allclose(features.r_squared, 1 / 1.09, atol=1e-3)


def test_names_from_the_literature_stand_for_measures() -> None:
    given = Measures(panel=["triplet", "SI", "sigma_l", "order", "fit"])
    assert given.panel == ("variations", "range", "local_sigma", "sigma", "order", "fit")
    assert Measures(panel=["order", "g0h0"]).panel == ("variations", "order", "g0h0")


THREE = {
    "V_theta": (0.040, 0.273, 0.559),
    "V_a": (0.0077, 0.108, 0.0157),
    "V_Omega": (0.0016, 0.112, 0.011),
    "sigma_1": (0.283, 1.31, 2.01),
    "R": (0.411, 0.046, 0.015),
    "R_local": (0.990, 0.755, 0.536),
    "R_local_min": (0.987, 0.393, 0.420),
    "chi": (0.0055, 0.087, 0.0147),
    "lambda": (0.0054, 0.019, 0.019),
    "g0": (0.304, 0.247, 0.018),
    "g0_global": (0.326, 0.174, 0.156),
    "h0": (0.185, 0.146, 0.029),
    "omega": (7.43, 16.2, 28.8),
    "omega_std": (0.0129, 3.66, 0.108),
    "plateau": (1.0, 0.44, 0.8),
    "centre_of_mass": (0.930, 0.049, 0.028),
    "acm": (0.988, 0.324, 0.070),
    "acm_delays": (50, 22, 19),
    "r_squared": (0.518, 0.840, 0.919),
    "badly_fitted": (0.32, 0.0, 0.0),
}
"""The first seed at P = Q = 9, 12, 21; docs/measures.md has the medians of twenty."""


def test_measures_of_the_papers_ordered_chimera_and_disordered_states() -> None:
    panel = ["triplet", "SI", "sigma_l", *PANEL]
    grid = {"P": [9, 12, 21], "Q": "P", "seeds": 1}
    job = {"name": "three", "model": "topological_fhn", "grid": grid, "measures": {"panel": panel}}
    sweep = Sweep.from_dict(job)
    made = run_block(sweep, sweep.points()).scalars
    found = dict(zip(scalar_labels(sweep), made.T.tolist(), strict=True))
    for name, expected in THREE.items():
        # The states are chaotic: another processor may round otherwise.
        assert found[name] == pytest.approx(expected, rel=0.3, abs=0.02), name
    local = np.array([found[f"local_sigma_{m}"] for m in range(1, 7)])
    strength = np.mean(local > 0.1256 * np.array(found["range_u"]), axis=0)
    assert [strength[0], strength[2]] == [0.0, 1.0]
    assert 0.0 < strength[1] < 1.0
