"""The estimators give the numbers and labels of the functions by which a sweep is reduced."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray
from scipy.sparse import csr_array
from sklearn.base import clone
from sklearn.cluster import AgglomerativeClustering
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import MinMaxScaler
from sklearn.utils.estimator_checks import (
    check_get_params_invariance,
    check_no_attributes_set_in_init,
    check_parameters_default_constructible,
    check_set_params,
    parametrize_with_checks,
)

from chimera_hpc import fourier_features, measures, total_variations
from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.classify.agreement import rand_index
from chimera_hpc.classify.classification import classify
from chimera_hpc.pipeline import (
    ChimeraClasses,
    FourierFeatures,
    HilbertFeatures,
    Panel,
    TotalVariation,
    WaveletFeatures,
)

Array = NDArray[np.float64]
T = 0.02 * np.arange(1500)
N = 16
PER_RUN = [FourierFeatures(), HilbertFeatures(), WaveletFeatures(), Panel(), TotalVariation()]


def runs_of_three_kinds(each: int = 5) -> tuple[list[tuple[Array, Array]], NDArray[np.int64]]:
    """Waves, half of them with nodes of other speeds, and random phases."""
    rng = np.random.default_rng(0)
    runs, kinds = [], np.repeat([0, 1, 2], each)
    for kind in kinds:
        wave = 2 * np.pi * np.arange(N) / N + rng.normal(scale=0.05, size=N)
        phase = rng.uniform(-np.pi, np.pi, N) if kind == 2 else wave
        speed = 1 + np.where(np.arange(N) % 2, 0.2, 0.0) * (kind == 1)
        signal = np.cos(2 * np.pi * speed * T[:, None] + phase - phase[0])
        runs.append((T, (1 + 0.3 * (kind == 1) * (np.arange(N) % 3)) * signal))
    return runs, kinds


RUNS, KINDS = runs_of_three_kinds()
STEADY_RUN = (T, np.zeros((len(T), N)))


@parametrize_with_checks([ChimeraClasses(), ChimeraClasses(classifier="kmeans")])
def test_classes_pass_the_checks_of_scikit_learn(estimator: Any, check: Any) -> None:
    check(estimator)


@pytest.mark.parametrize("estimator", PER_RUN, ids=lambda e: type(e).__name__)
def test_parameters_are_as_scikit_learn_wants_them(estimator: Any) -> None:
    name = type(estimator).__name__
    check_parameters_default_constructible(name, estimator)
    check_no_attributes_set_in_init(name, estimator)
    check_get_params_invariance(name, estimator)
    check_set_params(name, estimator)
    assert clone(estimator).get_params() == estimator.get_params()


@pytest.mark.parametrize("preset", ["default", "paper-printed"])
def test_the_paper_is_one_line(preset: Any) -> None:
    triplets = np.array([total_variations(fourier_features(t, u, preset=preset)) for t, u in RUNS])
    line = make_pipeline(FourierFeatures(preset), TotalVariation())
    np.testing.assert_array_equal(line.fit_transform(RUNS), triplets)
    status = np.full(len(RUNS), Status.DONE)
    expected = classify(triplets, status, cuts=(3,), names="letters").cuts[3]
    paper = make_pipeline(line, MinMaxScaler(), AgglomerativeClustering(3)).fit_predict(RUNS)
    assert rand_index(paper, expected.labels) == 1.0
    assert rand_index(paper, KINDS) == 1.0
    ours = make_pipeline(line, ChimeraClasses()).fit(RUNS)
    np.testing.assert_array_equal(ours[-1].labels_, expected.labels)
    np.testing.assert_array_equal(ours.predict(RUNS), expected.labels)
    assert ours[-1].names_ == ("A", "B", "C")


@pytest.mark.parametrize("kind", [HilbertFeatures, WaveletFeatures])
def test_other_features_give_the_same_classes(kind: Any) -> None:
    found = make_pipeline(kind(), TotalVariation(), ChimeraClasses()).fit_predict(RUNS)
    assert rand_index(found, KINDS) == 1.0
    profiles, by_windows = kind().fit_transform(RUNS[:1])[0], FourierFeatures().transform(RUNS[:1])
    np.testing.assert_allclose(profiles[1:], by_windows[0, 1:], rtol=0.02)
    shift = np.exp(1j * (profiles[0] - by_windows[0, 0] + by_windows[0, 0, 0]))
    np.testing.assert_allclose(shift, 1.0, atol=0.02)


def test_runs_come_as_pairs_arrays_objects_and_datasets() -> None:
    u = np.stack([u for _, u in RUNS[:4]])
    dataset = xr.Dataset({"u": (("point", "time", "node"), u)}, coords={"time": T})
    crossed = dataset.assign_coords(point=range(4)).expand_dims(seed=1).transpose("time", ...)
    made = FourierFeatures(step=0.02)
    expected = made.transform(RUNS[:4])
    for X in (u, list(u), dataset, crossed, [run.Run(T, one) for run in [_Module] for one in u]):
        np.testing.assert_array_equal(made.transform(X), expected)
    ragged = made.transform([RUNS[0], (T, RUNS[1][1][:, :5])])
    assert [row.shape for row in ragged] == [(3, N), (3, 5)]
    assert TotalVariation().transform(ragged).shape == (2, 3)


class _Module:
    class Run:
        def __init__(self, t: Array, u: Array) -> None:
            self.t, self.u = t, u


def test_runs_that_stand_still_have_no_class() -> None:
    line = make_pipeline(FourierFeatures(), TotalVariation(), ChimeraClasses())
    labels = line.fit_predict([STEADY_RUN, *RUNS])
    assert labels[0] == -1
    assert rand_index(labels[1:], KINDS) == 1.0
    assert line.predict([STEADY_RUN])[0] == -1


def test_pairs_and_chains() -> None:
    profiles = FourierFeatures().transform(RUNS[:1])
    pairs = [[0, 3], [1, 2]]
    features = fourier_features(*RUNS[0])
    for made, expected in (
        (TotalVariation("chain"), total_variations(features, ring=False)),
        (TotalVariation(pairs), total_variations(features, pairs=pairs)),
    ):
        np.testing.assert_array_equal(made.fit_transform(profiles)[0], expected)


def test_panel_gives_the_numbers_of_the_measures() -> None:
    made = Panel(["order", "fit", "SI"])
    found = made.fit_transform(RUNS[:2])
    names = made.get_feature_names_out().tolist()
    assert names[:2] == ["R", "R_std"]
    assert found.shape == (2, len(names))
    u = RUNS[0][1]
    order = measures.order_parameter(measures.phases(u))
    assert found[0, 0] == pytest.approx(order.mean(), abs=1e-9)
    fit = np.median(fourier_features(*RUNS[0]).r_squared)
    assert found[0, names.index("r_squared")] == pytest.approx(fit)


def test_small_ranges_are_not_stretched() -> None:
    rng = np.random.default_rng(0)
    points = np.stack([np.repeat([0.1, 0.5], 10), *(0.01 * rng.random((2, 20)))], axis=1)
    points[:, 0] += 0.1 * rng.random(20)
    stretched, left = ChimeraClasses(2).fit(points), ChimeraClasses(2, least=0.2).fit(points)
    assert np.ptp(stretched.scaler_, axis=0).max() < 0.5
    np.testing.assert_allclose(np.ptp(left.scaler_, axis=0)[1:], 0.2)
    assert rand_index(left.labels_, np.repeat([0, 1], 10)) == 1.0


def test_a_line_gives_data_frames() -> None:
    line = make_pipeline(FourierFeatures(), TotalVariation()).set_output(transform="pandas")
    assert line.fit_transform(RUNS[:2]).columns.tolist() == ["V_theta", "V_a", "V_Omega"]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: FourierFeatures("printed").transform(RUNS), "preset"),
        (lambda: FourierFeatures().transform(np.zeros((3, 4))), r"\(runs, times, nodes\)"),
        (lambda: FourierFeatures().transform(3), "a list, an array or a dataset, not int"),
        (lambda: FourierFeatures().transform(["ab"]), "run 0 is neither"),
        (lambda: FourierFeatures().transform(xr.Dataset()), "the dataset has no time, u"),
        (lambda: WaveletFeatures(low=2.0, high=1.0).transform(RUNS), "wavelet frequencies from 2"),
        (lambda: TotalVariation("row").transform([]), "pairs is 'row'; allowed"),
        (lambda: TotalVariation().transform([[1.0, 2.0]]), r"\(3, nodes\), not \(2,\)"),
        (lambda: Panel(["ordr"]).transform(RUNS), "'ordr' is not a measure; did you mean"),
        (lambda: TotalVariation().transform(csr_array(np.eye(3))), "not csr_array"),
        (lambda: Panel("order").transform(RUNS), "names is 'order'; a list of measures is needed"),
        (lambda: Panel([]).transform(RUNS), "a list of measures is needed"),
        (lambda: Panel(["distance"]).transform(RUNS), "needs the ball of initial states"),
        (lambda: Panel(["order"], pairs=[[0, 1.5]]).transform(RUNS), "pairs must be .ring. or"),
        (lambda: ChimeraClasses(names="triplet").fit([[0.0], [1.0]]), "is for V_theta"),
        (lambda: ChimeraClasses(least=[1.0, 2.0]).fit(np.eye(3)), "one for each column"),
        (lambda: ChimeraClasses(least=np.nan).fit(np.eye(3)), "one number >= 0"),
    ],
)
def test_bad_input_is_one_clear_line(call: Any, message: str) -> None:
    with pytest.raises(BadInput, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)
