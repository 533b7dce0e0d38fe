"""Points against a brute-force list of them, cells, blocks, and the size of a large plan."""

from __future__ import annotations

import math
import tracemalloc

import naive
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job import Points, Sweep, block_size, blocks
from chimera_hpc.job.axes import Between, Values
from chimera_hpc.job.points import expand


def sweep(grid, fixed=None, **tables):
    return Sweep.from_dict(
        {"name": "x", "model": "topological_fhn", "grid": grid, "fixed": fixed or {}, **tables}
    )


def lists(values, most=3):
    return st.lists(values, min_size=1, max_size=most, unique=True)


@st.composite
def grids(draw):
    """A grid as a job file has it, and the same grid for the brute-force twin."""
    dependent = {
        "P": ("same", "P"),
        "0:P": ("between", 0, "P", 1),
        "1:P:2": ("between", 1, "P", 2),
        "Q:P": ("between", "Q", "P", 1),
        "0:Q:3": ("between", 0, "Q", 3),
    }
    choices = {
        "P": lists(st.integers(2, 8)),
        "Q": st.sampled_from(["P", "0:P", "1:P:2"]) | lists(st.integers(0, 2), 2),
        "flips": st.sampled_from([*dependent]) | lists(st.integers(0, 100), 2),
        "orientation": lists(st.integers(1, 2), 2),
        "epsilon": lists(st.floats(0.01, 1), 2),
        "delta": lists(st.floats(0.0, 1), 2),
    }
    optional = draw(st.sets(st.sampled_from(["flips", "orientation", "epsilon", "delta"])))
    names = draw(st.permutations(["P", "Q", *sorted(optional)]))
    grid = {name: draw(choices[name]) for name in names}
    seeds = draw(st.integers(1, 3) | lists(st.integers(0, 2**62)))
    oracle = {
        name: dependent.get(axis, axis) if isinstance(axis, str) else axis
        for name, axis in grid.items()
    }
    oracle["seed"] = list(range(seeds)) if isinstance(seeds, int) else seeds
    return {**grid, "seeds": seeds}, oracle


@settings(max_examples=60)
@given(grids())
def test_points_are_those_of_the_brute_force_list_in_its_order(case):
    grid, oracle = case
    points = sweep(grid).points()
    expected = naive.grid_points(oracle)
    assert points.axes == tuple(oracle)
    assert len(points) == len(expected)
    assert list(zip(*(points.columns[name].tolist() for name in oracle), strict=True)) == expected


@settings(max_examples=30)
@given(grids(), st.data())
def test_index_and_point_belong_together(case, data):
    points = sweep(case[0]).points()
    i = data.draw(st.integers(0, len(points) - 1))
    row = points.row(i)
    assert points.find(**row).tolist() == [i]
    assert points[i : i + 1].row(0) == row


BIG = [2**31 + 5, 2**53, 2**53 + 1, 2**62 + 1, 2**63 - 1]


@settings(max_examples=60)
@given(grids(), st.data())
def test_a_stretch_of_points_is_that_of_the_whole_list(case, data):
    made = sweep(case[0])
    whole = made.points()
    first = data.draw(st.integers(0, len(whole) - 1))
    stop = data.draw(st.integers(first + 1, len(whole)))
    part, wanted = made.stretch(first, stop), whole[first:stop]
    assert part.axes == wanted.axes
    assert [*part.columns] == [*wanted.columns]
    for name, column in part.columns.items():
        assert column.dtype == wanted.columns[name].dtype
        np.testing.assert_array_equal(column, wanted.columns[name])


def test_a_stretch_of_ten_million_points_takes_little_memory():
    made = sweep({"P": "10:19", "Q": "0:9", "seeds": 100_000})
    tracemalloc.start()
    part = made.stretch(7_000_000, 7_000_016)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 200_000
    assert part.row(0) == made.stretch(7_000_000, 7_000_001).row(0)
    assert (part.row(1)["P"], part.row(1)["Q"], part.row(1)["seed"]) == (17, 0, 1)


@given(st.lists(st.integers(0, 2**63 - 1), min_size=2, max_size=6, unique=True))
@example([1_700_000_000, 1_700_000_001, 1_700_000_002])
@example(BIG)
def test_integers_are_found_by_all_their_bits(seeds):
    points = sweep({"P": 3, "Q": 0, "seeds": seeds}).points()
    for i, seed in enumerate(seeds):
        assert points.find(seed=seed).tolist() == [i]
        for other in (seed - 1, seed + 1):
            where = [seeds.index(other)] if other in seeds else []
            assert points.find(seed=other).tolist() == where
    assert points.find(seed=10**30).tolist() == points.find(seed=0.5).tolist() == []


def test_floats_are_found_exactly_then_within_a_few_units_in_the_last_place():
    x, ulp = 0.015, math.ulp(0.015)
    exact = sweep({"P": [3, 4], "Q": 0, "epsilon": [x, x + ulp], "seeds": 1}).points()
    assert exact.find(epsilon=x).tolist() == [0, 2]
    assert exact.find(epsilon=x + ulp, P=4).tolist() == [3]
    with pytest.raises(BadInput, match=r"epsilon=.*: is near to 0.015 and 0.015000000000000001;"):
        exact.find(epsilon=x - ulp)
    near = sweep({"P": 3, "Q": 0, "epsilon": [x, 0.02], "seeds": 1}).points()
    assert near.find(epsilon=x - 4 * ulp).tolist() == [0]
    assert near.find(epsilon=x - 5 * ulp).tolist() == []
    assert near.find(epsilon=x * (1 + 1e-9)).tolist() == near.find(epsilon=math.inf).tolist() == []


def test_every_parameter_is_a_column_of_its_type():
    points = sweep({"P": [5], "Q": "P"}).points()
    assert points.row(0) == {
        "P": 5, "Q": 5, "orientation": 1, "epsilon": 0.05, "b": 0.5, "c": -0.01, "flips": 0,
        "flip_set": 0, "delta": 0.001, "seed": 0,
    }  # fmt: skip
    integers = {name for name, column in points.columns.items() if column.dtype == np.int64}
    assert integers == {"P", "Q", "orientation", "flips", "flip_set", "seed"}
    assert all(column.dtype in (np.int64, np.float64) for column in points.columns.values())


def test_the_networked_model_has_its_own_columns():
    data = {"name": "n", "model": "networked_fhn", "grid": {"sigma": [0.1, 0.2], "seeds": 2}}
    points = Sweep.from_dict(data).points()
    assert points.axes == ("sigma", "seed")
    assert points.row(2) == {
        "P": 165, "epsilon": 0.05, "b": 0.5, "phi": np.pi / 2 - 0.1, "sigma": 0.2,
        "delta": 0.001, "seed": 0, "orientation": 1,
    }  # fmt: skip


def test_an_axis_of_numbers_may_follow_integers():
    points = sweep({"P": [3, 4], "Q": 0, "b": "P"}).points()
    assert points.columns["b"].tolist() == [3.0, 4.0]
    assert points.columns["b"].dtype == np.float64


def test_a_dependent_axis_may_follow_a_fixed_parameter():
    points = sweep({"Q": "0:P"}, {"P": 3}).points()
    assert points.columns["Q"].tolist() == [0, 1, 2, 3]
    assert points.columns["P"].tolist() == [3, 3, 3, 3]


def test_an_axis_delta_overrides_the_integrators():
    grid = {"P": 3, "Q": 0, "delta": [0.5, 1.5]}
    assert sweep(grid).points().columns["delta"].tolist() == [0.5, 1.5]
    assert sweep({"P": 3, "Q": 0}, integrator={"delta": 0.25}).points().row(0)["delta"] == 0.25


def test_columns_are_read_only():
    points = sweep({"P": [3, 4], "Q": 0}).points()
    with pytest.raises(ValueError, match="read-only"):
        points.columns["P"][0] = 1
    with pytest.raises(ValueError, match="read-only"):
        points[:1].columns["P"][0] = 1


def test_columns_must_be_equally_long():
    with pytest.raises(ValueError, match="equally long"):
        Points({"P": np.arange(2), "seed": np.arange(3)}, ("P", "seed"))


def test_finding_by_an_unknown_name_is_bad_input():
    with pytest.raises(BadInput, match="sigma: no such parameter; known: P, Q"):
        sweep({"P": 3, "Q": 0}).points().find(sigma=1)


@given(st.lists(st.tuples(*[st.integers(0, 3)] * 3, st.floats(0, 1)), max_size=60))
def test_cells_are_numbered_by_first_appearance(rows):
    columns = np.array(rows).reshape(-1, 4).T
    points = Points(
        {"P": columns[0].astype(int), "seed": columns[1].astype(int), "b": columns[3]}, ("seed",)
    )
    cell_id, cells = points.cells()
    ids, expected = naive.cells([points.columns["P"], points.columns["b"]])
    assert cell_id.tolist() == ids
    assert list(zip(cells["P"], cells["b"], strict=True)) == expected
    assert set(cells) == {"P", "b"}


def test_cells_of_many_wide_columns_stay_apart():
    """Nine columns of 256 values have 2^72 combinations, more than 64 bits can number."""
    rows = [[i] * 9 for i in range(256)] + [[1] + [0] * 8]
    columns = {f"p{i}": column.copy() for i, column in enumerate(np.array(rows).T)}
    cell_id, _ = Points({**columns, "seed": np.zeros(257, int)}, ("seed",)).cells()
    assert cell_id.tolist() == list(range(257))


@given(st.integers(0, 500), st.integers(1, 600))
def test_blocks_cut_all_points_once(n_points, size):
    cut = blocks(n_points, size)
    assert [i for start, stop in cut for i in range(start, stop)] == list(range(n_points))
    assert all(stop - start == size for start, stop in cut[:-1])


def test_a_block_is_what_the_job_asks_for():
    assert block_size(sweep({"P": 3, "Q": 0, "seeds": 100}, run={"block": 7}), 100) == 7


def test_a_block_is_never_larger_than_the_sweep():
    assert block_size(sweep({"P": 3, "Q": 0, "seeds": 5}, run={"block": 7}), 5) == 5


@pytest.mark.parametrize(
    ("tables", "n_points", "size"),
    [
        ({}, 460, 58),  # 8 blocks
        ({}, 3, 1),
        ({}, 10**6, 63),  # 63 series of 5001 * 50 * 2 bytes fit in 32 MB
        ({"keep": {"series": "none"}}, 10**6, 80),  # 10 s of 0.125 s
        ({"keep": {"series": "first-seed"}}, 10**6, 80),
        ({"keep": {"dtype": "float32"}}, 10**6, 31),
        ({"integrator": {"t_end": 10000.0}}, 10**6, 1),
        ({"integrator": {"form": "full"}, "keep": {"series": "none"}}, 10**6, 11),
        ({"integrator": {"rtol": 1e-6}, "keep": {"series": "none"}}, 10**6, 20),
    ],
)
def test_a_block_is_chosen_from_the_cost(tables, n_points, size):
    assert block_size(sweep({"P": 3, "Q": 0, "seeds": 20}, **tables), n_points) == size


@pytest.mark.parametrize(
    ("start", "t_end", "t_step", "n"),
    [
        (950.0, 1000.0, 0.01, 5001),
        (0.0, 1.0, 0.3, 4),
        (0.5, 1.0, 0.4, 1),
        (0.1, 0.3, 0.1, 3),
        (1.11, 1.13, 0.01, 3),
    ],
)
def test_samples_of_the_analysis_are_multiples_of_the_step(start, t_end, t_step, n):
    spec = sweep(
        {"P": 3, "Q": 0},
        integrator={"t_end": t_end, "t_step": t_step},
        features={"start": start},
    )
    assert spec.n_samples == n


def test_a_million_points_are_columns_of_the_right_length():
    spec = sweep({"P": "3:24", "Q": "0:P", "epsilon": "0.01:0.2:0.01", "seeds": 160})
    points = spec.points()
    cell_id, cells = points.cells()
    assert len(points) == 319 * 20 * 160
    assert len(cells["P"]) == 319 * 20
    assert np.array_equal(cell_id, np.repeat(np.arange(319 * 20), 160))


def test_ranges_whose_points_exceed_an_int64_are_refused():
    axes = {"Q": Values(range(100)), "x": Between(-(10**17), "Q")}
    with pytest.raises(BadInput, match=r"1e\+19 points or more"):
        expand(axes)
    with pytest.raises(BadInput, match="points or more"):
        expand({"x": Values(range(10**7)), "y": Values(range(10**17))})
    with pytest.raises(BadInput, match="points or more, at most 1e"):
        sweep({"P": "3:24", "Q": 0, "epsilon": [0.1, 0.2], "seeds": 10**7}).points()


def test_cells_of_many_columns_are_exact_where_the_product_of_their_values_exceeds_an_int64():
    rng = np.random.default_rng(14)
    rows = rng.integers(0, 1000, (2000, 10))
    # Rows that differ in one column only, and rows that are there twice.
    rows[1000:1500] = rows[:500]
    rows[1500:] = rows[:500]
    rows[1500:, 9] += 1
    columns = {f"x{i}": np.ascontiguousarray(rows[:, i]) for i in range(10)}
    points = Points({**columns, "seed": np.arange(2000)}, (*columns, "seed"))
    cell_id, cells = points.cells()
    numbers: dict[tuple[int, ...], int] = {}
    expected = [numbers.setdefault(tuple(row), len(numbers)) for row in rows.tolist()]
    assert cell_id.tolist() == expected
    assert list(zip(*(cells[name].tolist() for name in columns), strict=True)) == [*numbers]


def test_cells_that_differ_in_the_first_of_65_columns_only_are_two():
    # As digits of a binary number, the first column would be worth 2**64.
    rows = np.vstack([np.zeros(65, np.int64), np.eye(65, dtype=np.int64)])
    columns = {f"x{i}": np.ascontiguousarray(rows[:, i]) for i in range(65)}
    points = Points({**columns, "seed": np.zeros(66, np.int64)}, (*columns, "seed"))
    assert points.cells()[0].tolist() == list(range(66))
