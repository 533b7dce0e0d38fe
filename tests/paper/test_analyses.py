from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from chimera_hpc.base.errors import BadInput
from chimera_hpc.classify.atlas import Atlas
from chimera_hpc.classify.classification import classify
from chimera_hpc.classify.stability import (
    block_eigenvalues,
    full_spectrum,
    predicted_spectrum,
    residual,
    spectrum_distance,
)
from chimera_hpc.job import Sweep
from chimera_hpc.job.registry import ANALYSES, load
from chimera_hpc.network.topology import Topology
from chimera_hpc.plot.figure_input import FigureInput
from chimera_hpc.plot.robustness import robustness_figure
from chimera_hpc.reduction.agreement_text import (
    agreement_lines,
    cluster_lines,
    differing_rows,
    matrix_rows,
)
from chimera_hpc.reduction.analyses import analyse
from chimera_hpc.reduction.analysis_input import AnalysisInput

DONE, STEADY, FAILED = 1, 2, 4
ATLAS = Atlas(
    scaler=np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]),
    points=np.array([[0.1, 0.0, 0.0], [0.3, 0.1, 0.1], [0.5, 0.0, 0.0]]),
    labels=np.array([0, 1, 2]),
    names=("ordered", "chimera", "disordered"),
)


def given(
    grid: dict, status: list[int], atlases=None, reduction=None, network=None, **scalars
) -> AnalysisInput:
    """A tiny finished sweep; scalars that are not named are NaN."""
    tables = {"grid": grid, "reduction": reduction or {}, "features": {"groups": 2}}
    if network is not None:
        tables["network"] = network
    sweep = Sweep.from_dict({"name": "tiny", "model": "topological_fhn", **tables})
    points, n = sweep.points(), len(status)
    names = ["V_theta", "V_a", "V_Omega", "sigma_1", "range_u", "distance"]
    columns = {name: np.full(n, np.nan) for name in (*names, "local_sigma_1", "local_sigma_2")}
    columns |= {name: np.array(values, dtype=float) for name, values in scalars.items()}
    triplets = np.stack([columns[name] for name in names[:3]], axis=1)
    codes = np.array(status)
    made = classify(triplets, np.where(np.isfinite(triplets).all(axis=1), codes, STEADY))
    return AnalysisInput(sweep, points, codes, columns, made, made.base, atlases or {})


def test_blocks_of_a_ring_have_the_spectrum_of_the_whole_jacobian() -> None:
    ring = Topology.ring(9, 3).reorient_node(0, 2)
    for u in (0.0, np.sqrt(3.0)):
        blocks = predicted_spectrum(ring, 0.05, -0.01, u)
        whole = full_spectrum(ring, 0.05, -0.01, u)
        assert len(blocks) == len(whole) == 9 + 27
        assert spectrum_distance(blocks, whole) < 1e-9


def test_a_block_by_hand() -> None:
    # s = -2, epsilon = 1, c = -1, b = 1: l^2 + 3 l + 3 = 0
    found = block_eigenvalues(-2.0, 1.0, -1.0, np.array([1.0]))[0]
    expected = [-1.5 - 0.5j * np.sqrt(3.0), -1.5 + 0.5j * np.sqrt(3.0)]
    assert sorted(found, key=lambda z: z.imag) == pytest.approx(expected)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_small_eigenvalue_of_a_stiff_block_keeps_its_digits(sign: float) -> None:
    # l^2 - sign (2e9 + 1) l + 3e9 = 0, whose small root is 1.5 + 0.75 / 2e9 to 19 digits
    found = block_eigenvalues(sign * 2.0, 1e-9, sign, np.array([1.0]))[0]
    assert min(abs(found)) == pytest.approx(1.5 + 0.75 / 2e9, rel=1e-13)


def test_distance_of_spectra_looks_both_ways() -> None:
    one, two = np.array([0j, 1j]), np.array([0j])
    assert spectrum_distance(one, two) == spectrum_distance(two, one) == 1.0


def test_reorientation_breaks_the_equilibrium() -> None:
    plain = Topology.ring(9, 3)
    assert residual(plain, 0.5, -0.01, np.sqrt(3.0)) < 1e-12
    # s = -2 and +2 next to node 1, times v = -b/c = 50
    assert residual(plain.reorient_node(0, 1), 0.5, -0.01, np.sqrt(3.0)) == pytest.approx(100.0)


def test_the_three_equilibria_of_a_ring_hold_and_blocks_give_their_spectra() -> None:
    made = load(ANALYSES["stability"])(given({"P": 3, "Q": 0}, [STEADY]))
    rows, root = made["rows"], np.sqrt(3.0)
    assert [row["equilibrium"] for row in rows] == pytest.approx([0.0, root, -root])
    assert max(row["residual"] for row in rows) < 1e-12
    assert max(row["distance"] for row in rows) < 1e-9


def test_networks_count_the_links_that_turned() -> None:
    made = load(ANALYSES["networks"])(given({"P": 3, "Q": [0, 1, 3]}, [STEADY] * 3))
    assert [panel["reoriented"] for panel in made["panels"]] == [0, 2, 6]


def test_basin_counts_runs_within_their_own_radius() -> None:
    grid = {"P": [1, 2], "Q": 0, "delta": [0.5, 1.0], "seeds": 2}
    distance = [0.4, 0.5, 0.2, 2.0, 0.6, np.nan, 0.9, 0.9]
    state = [STEADY] * 5 + [FAILED] + [STEADY] * 2
    made = load(ANALYSES["basin"])(given(grid, state, distance=distance))
    np.testing.assert_array_equal(made["fraction"], [[1.0, 0.5], [0.0, 1.0]])
    np.testing.assert_array_equal(made["trials"], [[2, 2], [1, 2]])
    np.testing.assert_array_equal(made["safe_radius"], [0.5, np.nan])
    np.testing.assert_array_equal(made["radius_of_half"], [1.0, 1.0])


def test_oscillation_tells_slow_motion_from_rest_and_leaves_failed_runs_out() -> None:
    made = load(ANALYSES["oscillation"])(
        given({"P": [1, 2], "Q": 1, "seeds": 2}, [STEADY, FAILED, DONE, 3])
    )
    names = ("oscillating", "moving", "resting", "runs")
    assert [[cell[name] for name in names] for cell in made["cells"]] == [
        [0, 0, 1, 1],
        [1, 1, 0, 2],
    ]


def test_atlas_judges_runs_and_averages_those_of_the_modal_class() -> None:
    runs = given(
        {"P": 5, "Q": 5, "seeds": 4},
        [DONE, DONE, DONE, STEADY],
        {"other": ATLAS},
        V_theta=[0.3, 0.32, 0.1, np.nan],
        V_a=[0.1, 0.1, 0.0, np.nan],
        V_Omega=[0.1, 0.1, 0.0, np.nan],
    )
    (cell,) = load(ANALYSES["atlas"])(runs)["judges"]["other"]
    assert cell["class"] == "chimera"
    assert cell["votes"] == {"ordered": 1, "chimera": 2, "steady": 1}
    assert cell["triplet"] == pytest.approx([0.31, 0.1, 0.1])
    assert cell["distance"] == pytest.approx(0.01)


def test_robustness_is_the_share_of_chimeras_by_reversed_links() -> None:
    runs = given(
        {"P": 13, "Q": 13, "flips": [0, 5], "seeds": 2},
        [DONE, DONE, DONE, STEADY],
        {"other": ATLAS},
        V_theta=[0.3, 0.3, 0.5, np.nan],
        V_a=[0.1, 0.1, 0.0, np.nan],
        V_Omega=[0.1, 0.1, 0.0, np.nan],
    )
    made = load(ANALYSES["robustness"])(runs)
    curve = made["by"]["other"]
    assert made["label"] == "orientation 1"
    assert (curve["hits"], curve["trials"]) == ([2, 0], [2, 2])
    assert (curve["holds_until"], curve["zero_from"]) == (0.0, 5.0)
    np.testing.assert_array_equal(curve["others"]["disordered"], [0.0, 0.5])


def test_robustness_on_networks_goes_along_the_parameter_with_most_values() -> None:
    runs = given(
        {"P": [2, 3], "rewire": [0.0, 0.1, 0.5], "network_seed": 2},
        [DONE] * 12,
        {"other": ATLAS},
        network={"kind": "small_world"},
        V_theta=[0.3, 0.3, 0.3, 0.5, 0.5, 0.5, *[0.3] * 6],
        V_a=[0.1, 0.1, 0.1, 0.0, 0.0, 0.0, *[0.1] * 6],
        V_Omega=[0.1, 0.1, 0.1, 0.0, 0.0, 0.0, *[0.1] * 6],
    )
    made = load(ANALYSES["robustness"])(runs)
    assert (made["axis"], made["judge"]) == ("rewire", "other")
    assert [curve["plain"] for curve in made["curves"]] == ["P = 2", "P = 3"]
    first, second = (curve["by"]["other"] for curve in made["curves"])
    assert (first["x"], first["hits"], first["trials"]) == ([0.0, 0.1, 0.5], [2, 1, 0], [2, 2, 2])
    assert second["hits"] == [2, 2, 2]
    figure = robustness_figure(FigureInput(runs.classification, runs.triplets, [], {}, curves={
        "robustness": made}))  # fmt: skip
    assert figure.axes[0].get_xlabel() == r"$\mathrm{rewire}$"
    own = load(ANALYSES["robustness"])(replace(runs, atlases={}))
    assert own["judge"] == "own classes"
    with pytest.raises(BadInput, match='no parameter of the network "small_world" varies'):
        load(ANALYSES["robustness"])(given({"P": 2}, [DONE], network={"kind": "small_world"}))


def test_incoherence_scales_delta_by_the_range_of_each_run() -> None:
    runs = given(
        {"P": 5, "Q": 5, "seeds": 2},
        [DONE, STEADY],
        reduction={"deltas": [0.1]},
        local_sigma_1=[0.3, 0.3],
        local_sigma_2=[0.5, 0.5],
        range_u=[4.0, 2.0],
    )
    made = load(ANALYSES["incoherence"])(runs)
    (row,) = made["range"]["by_delta"][0]["rows"]
    # 0.1 * 4 = 0.4 lies between both deviations, 0.1 * 2 below both
    np.testing.assert_array_equal(row["runs"], [0.5, 1.0])
    assert (row["median"], row["discontinuity"]) == (0.75, 0.5)
    (absolute,) = made["absolute"]["by_delta"][0]["rows"]
    np.testing.assert_array_equal(absolute["runs"], [1.0, 1.0])


def three_kinds(n: int = 12) -> AnalysisInput:
    rng = np.random.default_rng(3)
    kind = np.repeat([0, 1, 2], n)
    scatter = 0.01 * rng.standard_normal(3 * n)
    centre = np.array([0.2, 1.3, 2.1])[kind]
    return given(
        {"P": [5, 12, 21], "Q": "P", "seeds": n},
        [DONE] * 3 * n,
        reduction={"deltas": [0.1]},
        sigma_1=centre + scatter,
        range_u=np.full(3 * n, 4.0),
        local_sigma_1=np.array([0.1, 0.1, 2.0])[kind],
        local_sigma_2=np.array([0.1, 2.0, 2.0])[kind],
        V_theta=np.array([0.05, 0.25, 0.5])[kind] + scatter,
        V_a=np.array([0.01, 0.09, 0.02])[kind],
        V_Omega=np.array([0.01, 0.1, 0.01])[kind],
    )


def test_sigma_l_finds_three_classes_along_p() -> None:
    made = load(ANALYSES["sigma-l"])(three_kinds())
    assert made["n_classes"] == 3
    assert [cell["class"] for cell in made["cells"]] == ["ordered", "chimera", "disordered"]


def test_three_methods_that_agree_have_diagonal_matrices() -> None:
    made = load(ANALYSES["agreement"])(three_kinds())
    assert [pair["agreement"] for pair in made["pairs"]] == [1.0, 1.0, 1.0]
    assert [pair["cells_equal"] for pair in made["pairs"]] == [3, 3, 3]
    assert made["differing"] == []


def test_steady_runs_that_si_does_not_call_ordered_are_counted() -> None:
    runs = three_kinds()
    runs.status[10:14] = STEADY  # two ordered ones by SI, two chimeras
    made = load(ANALYSES["agreement"])(runs)
    said = "SI does not call 2 of 4 steady runs ordered: in what is left of a run at rest, delta"
    assert agreement_lines(made)[-2].startswith(said)
    runs.status[12:14] = DONE
    assert load(ANALYSES["agreement"])(runs)["remark"] == ""


def test_methods_that_differ_are_listed_by_cell() -> None:
    runs = three_kinds()
    runs.scalars["local_sigma_2"][:12] = 2.0  # P = 5: half of the groups are incoherent now
    made = load(ANALYSES["agreement"])(runs)
    assert [cell["P"] for cell in made["differing"]] == [5]
    np.testing.assert_array_equal(made["pairs"][0]["counts"], [[0, 12, 0], [0, 12, 0], [0, 0, 12]])


def test_measures_of_the_panel_join_the_agreement_after_the_first_three() -> None:
    runs = three_kinds()
    values = np.repeat([1.0, 0.5, 0.02], 12)
    columns = {**runs.scalars, "acm": values, "plateau": np.where(values < 0.5, 1.0, values)}
    status = runs.status.copy()
    status[0] = STEADY
    columns["acm"] = np.where(status == STEADY, np.nan, values)
    given_runs = AnalysisInput(**{**vars(runs), "scalars": columns, "status": status})
    made = load(ANALYSES["agreement"])(given_runs)
    assert (
        list(made["modal"]) == ["triplets", "SI", "sigma_1", "plateau", "acm"] == [*made["rules"]]
    )
    pairs = {(pair["rows"], pair["columns"]): pair for pair in made["pairs"]}
    order = [*pairs][:4]
    assert order == [
        *(("triplets", "SI"), ("triplets", "sigma_1"), ("SI", "sigma_1"), ("triplets", "plateau"))
    ]
    whole = pairs["SI", "acm"]
    assert (whole["kappa"], whole["adjusted_rand"], whole["cells_kappa"]) == (1.0, 1.0, 1.0)
    # 24 of 36 agree: (2/3 - 1/3) / (1 - 1/3)
    assert pairs["SI", "plateau"]["kappa"] == pytest.approx(0.5)
    assert [cell["plateau"] for cell in made["differing"]] == ["ordered"]
    rows = matrix_rows(made)
    assert rows[0] == ("", "triplets", "SI", "sigma_1", "plateau", "acm")
    assert (rows[4][2], rows[5][2], rows[2][5]) == ("0.50", "1.00", "1.00")
    assert agreement_lines(made)[-1] == "the measures differ in 1 of 3 cells"
    assert differing_rows(made)[0][0] == "P, Q"
    assert len(differing_rows(made)) == 2


def test_other_classifiers_stand_next_to_the_tree() -> None:
    runs = three_kinds()
    made = load(ANALYSES["classifiers"])(runs)
    assert list(made["labels"]) == ["agglomerative", "kmeans", "mixture", "hdbscan"]
    assert made["sizes"]["kmeans"].sum() == 36
    assert [pair["adjusted_rand"] for pair in made["pairs"]][:2] == [1.0, 1.0]
    curves = {"classifiers": made, "number-of-classes": load(ANALYSES["number-of-classes"])(runs)}
    lines = cluster_lines(curves)
    assert lines[0].startswith("36 of 36 runs look like 3 classes (gap statistic ")
    assert lines[1] == "agglomerative and kmeans: adjusted Rand index 1.00"
    assert cluster_lines({}) == []


def test_variations_are_quantiles_of_oscillating_runs() -> None:
    runs = given(
        {"P": 5, "Q": 5, "seeds": 4},
        [DONE, DONE, DONE, STEADY],
        V_theta=[0.1, 0.2, 0.4, np.nan],
        V_a=[0.0] * 3 + [np.nan],
        V_Omega=[0.0] * 3 + [np.nan],
        sigma_1=[1.0, 2.0, 3.0, 9.0],
    )
    (cell,) = load(ANALYSES["variations"])(runs)["cells"]
    assert (cell["runs"], cell["V_theta"][3], cell["sigma_1"][-1]) == (3, 0.2, 3.0)


def test_the_synthetic_signal_is_reconstructed() -> None:
    made = load(ANALYSES["synthetic"])(given({"P": 5, "Q": 5}, [DONE]))
    assert made["largest_error"]["sine-fit"]["phase"] < 0.02
    assert made["largest_error"]["sine-fit"]["frequency"] < 1e-6


def test_spectrum_of_a_cosine_has_its_peak_in_the_ninth_line() -> None:
    runs = given({"P": 12, "Q": 12, "seeds": 2}, [DONE] * 2, reduction={"show": ["P=12"]})
    t = 950.0 + 0.01 * np.arange(5001)
    u = np.cos(2.0 * np.pi * 4.0 * t)[:, None] * np.ones(3)
    made = load(ANALYSES["spectrum"])(AnalysisInput(**{**vars(runs), "series": lambda i: (t, u)}))
    assert (made["peak"], made["n_samples"]) == (9, 226)
    assert made["amplitude"][9] == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    ("name", "lacking"),
    [
        ("atlas", "reduction.atlas names a sweep"),
        ("robustness", "reduction.atlas names a sweep"),
        ("agreement", "reduction.deltas is needed"),
        ("spectrum", "reduction.show names no run"),
    ],
)
def test_what_cannot_be_made_is_said_and_the_rest_is_made(name: str, lacking: str) -> None:
    wish = {"analyses": [name, "oscillation"]}
    said: list[str] = []
    made = analyse(given({"P": 5, "Q": 5, "seeds": 2}, [DONE, DONE], reduction=wish), said.append)
    assert list(made) == ["oscillation"]
    assert len(said) == 1
    assert said[0].startswith(f"analysis {name}: ")
    assert lacking in said[0]


@pytest.mark.parametrize("name", ["sigma-l", "agreement", "incoherence", "variations", "spectrum"])
def test_analyses_of_runs_need_two_of_them(name: str) -> None:
    runs = given({"P": 5, "Q": 5, "seeds": 2}, [DONE, FAILED])
    with pytest.raises(BadInput, match="too few runs yet"):
        load(ANALYSES[name])(runs)
