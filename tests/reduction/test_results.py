from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from chimera_hpc.base.status import Status
from chimera_hpc.classify.atlas import Atlas
from chimera_hpc.classify.classification import classify
from chimera_hpc.reduction.record import reduction_variables
from chimera_hpc.reduction.results import build_results, count_points, json_safe, to_json


class Sweep:
    name = "small"

    def to_dict(self) -> dict[str, Any]:
        return {"fixed": {"n_nodes": 50, "epsilon": 0.07}}


TRIPLETS = np.array(
    [
        [0.1, 0.0, 0.0],
        [0.1, 0.01, 0.0],
        [0.3, 0.1, 0.2],
        [0.6, 0.0, 0.0],
        [np.nan] * 3,
        [np.nan] * 3,
    ]
)
STATUS = np.array([1, 1, 1, 1, Status.STEADY, Status.NEVER])


@pytest.fixture
def points(table: Any) -> Any:
    return table(np.array([5, 5, 7, 9, 5, 11]))


@pytest.fixture
def results(points: Any) -> dict[str, Any]:
    result = classify(TRIPLETS, STATUS, cuts=(3, 4))
    curves = {"W": {"x": np.array([0, 5]), "fraction": np.array([1.0, np.nan])}}
    claims = [{"id": "one", "paper": 1, "measured": np.float64(0.5), "reproduced": None}]
    return build_results(Sweep(), points, {"status": STATUS}, result, curves, claims)


def test_results_have_the_agreed_keys(results: dict[str, Any]) -> None:
    agreed = {"schema", "sweep", "points", "cuts", "curves", "claims"}
    assert agreed <= set(results)
    assert (results["schema"], results["sweep"]) == (1, "small")
    assert set(results["cuts"]) == {"3", "4"}
    assert results["claims"] == [{"id": "one", "paper": 1, "measured": 0.5, "reproduced": None}]


def test_clusters_tell_name_size_and_centroid(results: dict[str, Any]) -> None:
    clusters = results["cuts"]["3"]["clusters"]
    assert [(c["name"], c["size"]) for c in clusters] == [
        ("ordered", 2),
        ("chimera", 1),
        ("disordered", 1),
    ]
    assert clusters[0]["centroid"] == pytest.approx({"V_theta": 0.1, "V_a": 0.005, "V_Omega": 0.0})


def test_cells_carry_axes_and_fixed_parameters(results: dict[str, Any]) -> None:
    cells = results["cuts"]["3"]["cells"]
    assert [cell["P"] for cell in cells] == [5, 7, 9, 11]
    # The column of the points wins over the table of fixed values.
    assert cells[0] == {
        "n_nodes": 50,
        "epsilon": 0.05,
        "P": 5,
        "class": "ordered",
        "oscillating": pytest.approx(2 / 3),
        "votes": {"ordered": 2, "steady": 1},
        "entropy_bits": pytest.approx(0.9182958340544896),
    }
    assert cells[3]["class"] is None


def test_points_are_counted_by_outcome() -> None:
    status = [1, 1, 1, 1, 2, 3, 3, 4, 5, 6, 7, 8, 9, 255, 255, 255]
    assert count_points(status) == {
        "total": 16,
        "done": 4,
        "steady": 1,
        "no_window": 2,
        "failed": 6,
        "pending": 3,
    }


def test_results_are_strict_json_without_nan(results: dict[str, Any]) -> None:
    text = to_json(results)
    assert json.loads(text) == results
    assert "NaN" not in text
    assert results["curves"]["W"] == {"x": [0, 5], "fraction": [1.0, None]}


def test_json_safe_reaches_every_level() -> None:
    value = {1: [np.int64(2), (np.nan, np.array([[np.inf]]))], "b": np.bool_(True)}
    safe = json_safe(value)
    assert safe == {"1": [2, [None, [[None]]]], "b": True}
    assert type(safe["1"][0]) is int


def test_sampling_is_flagged(points: Any) -> None:
    result = classify(TRIPLETS, STATUS, largest_tree=1)
    assert result.sampled == (len(result.members) < 4)
    clustering = build_results(Sweep(), points, {"status": STATUS}, result)["clustering"]
    assert clustering["sampled"] is True
    assert clustering["linkage"] == "ward"


def test_sweep_without_any_result_has_results(points: Any) -> None:
    status = np.full(6, Status.NEVER)
    result = classify(TRIPLETS, status)
    empty = build_results(Sweep(), points, {"status": status}, result)
    json.loads(to_json(empty))
    assert empty["cuts"]["3"]["clusters"] == []
    assert empty["points"]["pending"] == 6


def test_stored_variables_rebuild_cells_and_atlas(points: Any, results: dict[str, Any]) -> None:
    result = classify(TRIPLETS, STATUS, cuts=(3, 4))
    variables, attributes = reduction_variables(points, STATUS, result)
    for dimensions, values in variables.values():
        assert np.ndim(values) == len(dimensions)
        assert np.asarray(values).dtype.kind in "if"
    json.dumps(attributes, allow_nan=False)
    names = [*attributes["names_3"], None]
    modal = [names[i] for i in variables["modal_class_3"][1]]
    assert modal == [cell["class"] for cell in results["cuts"]["3"]["cells"]]
    votes = dict(zip(attributes["names_3"], variables["votes_3"][1][0].tolist(), strict=True))
    assert {k: v for k, v in votes.items() if v} == results["cuts"]["3"]["cells"][0]["votes"]
    np.testing.assert_array_equal(variables["cell"][1], [0, 0, 1, 2, 0, 3])
    atlas = Atlas.from_arrays({name: v for name, (_, v) in variables.items()}, attributes)
    assert atlas.classify(TRIPLETS[:4]).name == ["ordered", "ordered", "chimera", "disordered"]


def test_dimensions_of_stored_variables_fit_together(points: Any) -> None:
    variables, _ = reduction_variables(points, STATUS, classify(TRIPLETS, STATUS))
    lengths: dict[str, int] = {}
    for dimensions, values in variables.values():
        for name, length in zip(dimensions, np.shape(values), strict=True):
            assert lengths.setdefault(name, length) == length
    assert lengths["point"] == 6
    assert lengths["cell_number"] == 4
