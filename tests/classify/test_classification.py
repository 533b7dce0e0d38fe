from __future__ import annotations

import numpy as np
import pytest

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.classify.classification import Classification, classify
from chimera_hpc.classify.naming import all_names, name_base

# Centres in (V_theta, V_a, V_Omega) near those of the paper's three classes.
ORDERED, CHIMERA, DISORDERED = (0.07, 0.01, 0.01), (0.27, 0.09, 0.11), (0.53, 0.02, 0.01)


def blobs(*centres_and_sizes: tuple[tuple[float, float, float], int]) -> np.ndarray:
    rng = np.random.default_rng(0)
    return np.concatenate([rng.normal(c, 0.003, (n, 3)) for c, n in centres_and_sizes])


def done(points: np.ndarray) -> np.ndarray:
    return np.full(len(points), Status.DONE)


@pytest.fixture
def three() -> np.ndarray:
    return blobs((DISORDERED, 8), (CHIMERA, 5), (ORDERED, 12))


def classes(result: Classification, k: int) -> list[str]:
    cut = result.cuts[k]
    return [cut.names[label] if label >= 0 else "-" for label in cut.labels]


def test_three_blobs_get_the_names_of_the_rule(three: np.ndarray) -> None:
    result = classify(three, done(three))
    assert classes(result, 3) == ["disordered"] * 8 + ["chimera"] * 5 + ["ordered"] * 12
    cut = result.cuts[3]
    assert cut.names == cut.families == ("ordered", "chimera", "disordered")
    assert cut.sizes.tolist() == [12, 5, 8]
    np.testing.assert_allclose(cut.centroids[1], three[8:13].mean(axis=0))


@pytest.mark.parametrize("linkage", ["ward", "average", "complete"])
def test_every_linkage_finds_the_blobs(three: np.ndarray, linkage: str) -> None:
    result = classify(three, done(three), linkage=linkage)  # type: ignore[arg-type]
    assert classes(result, 3) == ["disordered"] * 8 + ["chimera"] * 5 + ["ordered"] * 12


def test_chimera_is_the_largest_frequency_variation_even_with_the_largest_phase_variation() -> None:
    centroids = np.array([[0.9, 0.1, 0.2], [0.1, 0.9, 0.1], [0.5, 0.0, 0.0]])
    assert name_base(centroids, "triplet") == ["chimera", "ordered", "disordered"]


def test_order_of_points_does_not_change_their_classes() -> None:
    points = blobs((DISORDERED, 20), (CHIMERA, 15), (ORDERED, 25))
    points[:10] = points[10:20]  # equal points, ties in the tree
    points = np.round(points, 3)  # and many equal distances
    plain = classify(points, done(points), cuts=(3, 4, 5, 8))
    order = np.random.default_rng(5).permutation(len(points))
    shuffled = classify(points[order], done(points), cuts=(3, 4, 5, 8))
    for k in plain.cuts:
        assert plain.cuts[k].names == shuffled.cuts[k].names
        np.testing.assert_array_equal(plain.cuts[k].labels[order], shuffled.cuts[k].labels)
    np.testing.assert_array_equal(plain.linkage, shuffled.linkage)


def test_only_done_points_are_clustered(three: np.ndarray) -> None:
    status = done(three)
    status[[0, 9, 20]] = Status.STEADY, Status.NO_WINDOW, Status.TIME_OUT
    three[[0, 9, 20]] = np.nan
    result = classify(three, status)
    np.testing.assert_array_equal(np.flatnonzero(result.cuts[3].labels < 0), [0, 9, 20])
    assert result.cuts[3].sizes.sum() == len(three) - 3
    assert set(result.members) == set(range(len(three))) - {0, 9, 20}
    assert result.linkage.shape == (len(three) - 4, 4)


def test_done_point_without_finite_triplet_is_an_error(three: np.ndarray) -> None:
    three[4, 1] = np.nan
    with pytest.raises(ValueError, match="not finite"):
        classify(three, done(three))


def test_finer_cut_gets_suffixes_only_where_a_class_split() -> None:
    # The disordered class is two blobs; the one with the larger V_a comes first, as in the paper.
    points = blobs((ORDERED, 9), (CHIMERA, 9), ((0.50, 0.00, 0.00), 4), ((0.56, 0.04, 0.0), 6))
    result = classify(points, done(points), cuts=(3, 4))
    cut = result.cuts[4]
    assert cut.names == ("ordered", "chimera", "disordered-1", "disordered-2")
    assert cut.families == ("ordered", "chimera", "disordered", "disordered")
    assert classes(result, 4)[18:] == ["disordered-2"] * 4 + ["disordered-1"] * 6
    assert classes(result, 3)[18:] == ["disordered"] * 10


def test_sub_classes_are_listed_by_number() -> None:
    singles = np.array([[0.01 * i * i, 0.001 * i, 0.0] for i in range(12)])
    points = np.concatenate([singles, [[0.3, 0.1, 9.0], [90.0, 0.0, 0.0]]])
    cut = classify(points, done(points), cuts=(14,)).cuts[14]
    ordered = [f"ordered-{i}" for i in range(1, 13)]
    assert cut.names == (*ordered, "chimera", "disordered")
    assert (np.diff(cut.centroids[:12, 1]) < 0).all()


def test_finer_classes_lie_inside_one_base_class(three: np.ndarray) -> None:
    result = classify(three, done(three), cuts=(3, 9))
    fine, base = result.cuts[9], result.base
    for label, family in enumerate(fine.families):
        inside = {base.names[i] for i in base.labels[fine.labels == label]}
        assert inside == {family}


def test_coarser_cut_takes_the_name_of_its_largest_part() -> None:
    # Ordered and chimera lie nearest to each other here, and there are more ordered points.
    points = blobs(((0.1, 0.0, 0.0), 7), ((0.12, 0.0, 0.03), 4), ((0.9, 0.9, 0.0), 5))
    result = classify(points, done(points), cuts=(1, 2, 3))
    assert classes(result, 3) == ["ordered"] * 7 + ["chimera"] * 4 + ["disordered"] * 5
    assert result.cuts[2].names == ("ordered", "disordered")
    assert result.cuts[2].sizes.tolist() == [11, 5]
    assert result.cuts[1].names == ("ordered",)


def test_list_of_names_goes_by_rising_phase_variation() -> None:
    points = blobs(((0.8, 0.0, 0.5), 3), ((0.1, 0.5, 0.0), 4), ((0.4, 0.9, 0.9), 5), (ORDERED, 2))
    names = ["still", "slow", "wild", "wilder"]
    result = classify(points, done(points), cuts=(4,), names=names)
    expected = ["wilder"] * 3 + ["slow"] * 4 + ["wild"] * 5 + ["still"] * 2
    assert classes(result, 4) == expected
    assert result.cuts[4].names == tuple(names)


def test_depth_gives_the_cut_below_it_and_keeps_the_line(three: np.ndarray) -> None:
    plain = classify(three, done(three), cuts=(3, 4))
    between = 0.999 * plain.cuts[4].depth
    result = classify(three, done(three), cuts=(), depth=between)
    assert list(result.cuts) == [4]
    assert result.cuts[4].depth == result.depth == between
    np.testing.assert_array_equal(result.cuts[4].labels, plain.cuts[4].labels)


def test_nothing_oscillates() -> None:
    result = classify(np.full((6, 3), np.nan), np.full(6, Status.STEADY))
    assert result.linkage.shape == (0, 4)
    for cut in result.cuts.values():
        assert cut.names == ()
        assert (cut.labels == -1).all()
    assert result.order_of_splits() == ()


def test_one_point_is_one_ordered_class() -> None:
    result = classify([[0.1, 0.2, 0.3]], [Status.DONE])
    assert result.cuts[3].names == ("ordered",)
    assert result.cuts[5].labels.tolist() == [0]


@pytest.mark.parametrize(
    ("second", "name"), [((0.5, 0.0, 0.9), "chimera"), ((0.5, 0.9, 0.0), "disordered")]
)
def test_two_different_points_are_ordered_and_one_more(
    second: tuple[float, float, float], name: str
) -> None:
    points = np.array([second, (0.1, 0.2, 0.3), second])
    result = classify(points, done(points))
    assert classes(result, 3) == [name, "ordered", name]


def test_equal_points_make_one_class() -> None:
    points = np.tile([0.3, 0.1, 0.1], (7, 1))
    assert classify(points, done(points)).cuts[5].names == ("ordered",)


def test_order_of_splits_tells_which_class_parts_first() -> None:
    points = blobs((ORDERED, 9), (CHIMERA, 9), ((0.50, 0.00, 0.00), 4), ((0.56, 0.04, 0.0), 6))
    first = classify(points, done(points)).order_of_splits()[0]
    assert (first.name, first.n_clusters, first.sizes) == ("disordered", 4, (6, 4))


def test_large_sets_are_sampled_without_chance_and_agree_with_the_whole_tree() -> None:
    rng = np.random.default_rng(1)
    points = np.concatenate([rng.normal(c, 0.01, (300, 3)) for c in (ORDERED, CHIMERA, DISORDERED)])
    points = np.concatenate([points, [[0.9, 0.0, 0.0]]])  # alone in its box: must be in the sample
    whole = classify(points, done(points))
    sampled = classify(points, done(points), largest_tree=150)
    assert not whole.sampled
    assert sampled.sampled
    assert 150 <= len(sampled.members) <= 150 + 60
    assert 900 in sampled.members
    np.testing.assert_array_equal(sampled.cuts[3].labels, whole.cuts[3].labels)
    assert sampled.cuts[3].sizes.sum() == len(points)
    order = rng.permutation(len(points))
    again = classify(points[order], done(points), largest_tree=150)
    np.testing.assert_array_equal(again.cuts[5].labels, sampled.cuts[5].labels[order])


def test_every_part_of_a_large_set_is_sampled_in_proportion() -> None:
    points = blobs((ORDERED, 100), (CHIMERA, 300), (DISORDERED, 600))
    members = classify(points, done(points), largest_tree=100).members
    counts = [
        ((members >= a) & (members < b)).sum() for a, b in ((0, 100), (100, 400), (400, 1000))
    ]
    np.testing.assert_allclose(counts, [10, 30, 60], atol=20)
    assert counts[0] < counts[1] < counts[2]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"linkage": "single"}, "linkage"),
        ({"cuts": (3, 0)}, "cuts"),
        ({"depth": 0.0}, "depth"),
        ({"names": "mine"}, "names"),
        ({"names": ["a", "a"]}, "different"),
        ({"names": []}, "different"),
        ({"names": ["slow", "steady"]}, "steady"),
    ],
)
def test_bad_options_are_named(three: np.ndarray, options: dict, message: str) -> None:
    with pytest.raises(BadInput, match=message) as caught:
        classify(three, done(three), **options)
    assert "\n" not in str(caught.value)


def test_letters_go_to_the_largest_clusters_of_the_first_cut_first():
    rng = np.random.default_rng(3)
    centres = np.array([[0.9, 0.5, 0.1], [0.1, 0.1, 0.9], [0.5, 0.9, 0.5], [0.1, 0.9, 0.1]])
    points = np.repeat(centres, [4, 12, 8, 20], axis=0) + 0.01 * rng.random((44, 3))
    found = classify(points, done(points), cuts=(4, 2), names="letters")
    assert found.cuts[4].names == ("A", "B", "C", "D")
    assert found.cuts[4].sizes.tolist() == [20, 12, 8, 4]
    assert found.base.names == found.cuts[4].names
    assert set(found.cuts[2].names) <= {"A", "B", "C", "D"}
    assert classify(points, done(points), cuts=(2,), names="letters").cuts[2].names == ("A", "B")
    three = classify(points, done(points), cuts=(3, 4), names="letters")
    assert three.cuts[3].names == ("A", "B", "C")
    assert {name[0] for name in three.cuts[4].names} == {"A", "B", "C"}


def test_letters_go_on_after_z():
    assert all_names("letters", 28)[-3:] == ["Z", "AA", "AB"]
    assert name_base(np.zeros((2, 3)), "letters", np.array([1, 1])) == ["A", "B"]
