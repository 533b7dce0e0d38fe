"""From a store to results.json, a table and figures; finished sweeps and others."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from store_tools import block_results, make_store, small_sweep

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.classify.classification import classify
from chimera_hpc.job import Sweep
from chimera_hpc.job.models import build
from chimera_hpc.reduction.atlases import atlases_of
from chimera_hpc.reduction.cells import FreeAxis, describe, free_axes
from chimera_hpc.reduction.reduction import reduce_sweep
from chimera_hpc.reduction.selection import check_selections, find_point, single_point
from chimera_hpc.reduction.table import class_table
from chimera_hpc.report.content import Content
from chimera_hpc.run.initial_state import initial_state
from chimera_hpc.store.store import Store

ROOT = Path(__file__).resolve().parents[2]
CENTRES = {2: (0.05, 0.01, 0.001), 3: (0.3, 0.1, 0.11), 4: (0.55, 0.02, 0.01)}
CLASSES = {2: "ordered", 3: "chimera", 4: "disordered"}
FAST = "reduction.figures=[]"


def filled(folder: Path, *overrides: str, blocks=None, status=None) -> Store:
    """Fill the small store: each P has its own class, or the given status."""
    store = make_store(folder, *overrides)
    store.start_run({})
    for i in range(store.n_blocks) if blocks is None else blocks:
        made = block_results(store, i)
        columns = {name: c[slice(*store.block(i))] for name, c in store.points.columns.items()}
        for row, (half_degree, seed) in enumerate(zip(columns["P"], columns["seed"], strict=True)):
            if status is not None and half_degree in status:
                made.status[row] = status[half_degree]
                made.features[row] = made.scalars[row, :3] = np.nan
            else:
                made.scalars[row, :3] = np.multiply(CENTRES[half_degree], 1.0 + 0.02 * seed)
        store.write_block(i, made, 1, 1)
    return store


def results_in(folder: Path):
    return json.loads((folder / "results.json").read_text())


def told(folder: Path, **options):
    """Reduce, and return what was said beside the summary."""
    lines = []
    return reduce_sweep(folder, say=lines.append, **options), lines


@pytest.mark.slow
def test_reduction_that_needs_no_run_loads_no_kernels(tmp_path):
    filled(tmp_path, FAST, 'reduction.analyses=["oscillation"]')
    code = "import sys\nfrom pathlib import Path\n"
    code += "from chimera_hpc.reduction.reduction import reduce_sweep\n"
    code += "reduce_sweep(Path(sys.argv[1]), make_figures=False); "
    code += "assert not {'numba', 'scipy.stats'} & {*sys.modules}"
    subprocess.run([sys.executable, "-c", code, tmp_path], check=True)
    assert "oscillation" in results_in(tmp_path)["curves"]


def test_finished_sweep_gives_classes_counts_and_paths(tmp_path):
    filled(tmp_path, FAST)
    summary, lines = told(tmp_path)
    results = results_in(tmp_path)
    assert results["schema"] == 1
    assert results["sweep"] == "small"
    assert results["points"] == summary.points
    assert summary.points["done"] == summary.points["total"] == 15
    for cell in results["cuts"]["3"]["cells"]:
        assert cell["class"] == CLASSES[cell["P"]]
        assert cell["votes"] == {CLASSES[cell["P"]]: 5}
        assert cell["n_nodes"] == 12
    assert set(results["cuts"]) == {"3", "4", "5"}
    assert summary.notes == ()
    assert lines[0] == "15 of 15 points run: 15 oscillate"
    assert summary.table.splitlines() == lines[1:5]
    assert lines[2].split()[:5] == ["2", "ordered", "100%", "ordered", "5"]
    assert lines[-1] == f"results  {tmp_path / 'results.json'}"


def test_store_keeps_the_reduction(tmp_path):
    store = filled(tmp_path, FAST)
    reduce_sweep(tmp_path)
    kept = store.reduction()
    names = kept.attributes["names_3"]
    found = [names[label] for label in kept.arrays["labels_3"]]
    assert found == [CLASSES[p] for p in store.points.columns["P"]]
    assert kept.arrays["linkage"].shape == (14, 4)


def test_curves_and_claims_are_passed_on(tmp_path):
    filled(tmp_path, FAST)
    claims = [{"id": "one", "paper": 1.0, "measured": 2.0, "reproduced": False}]
    reduce_sweep(tmp_path, curves={"W": [1.0, 0.5]}, claims=claims)
    assert results_in(tmp_path)["curves"] == {"W": [1.0, 0.5]}
    assert results_in(tmp_path)["claims"] == claims


def test_part_of_a_sweep_is_reduced_with_its_coverage(tmp_path):
    filled(tmp_path, FAST, blocks=[0, 1])
    summary, lines = told(tmp_path)
    assert lines[0] == "8 of 15 points run: 8 oscillate"
    assert summary.points["pending"] == 7
    classes = {cell["P"]: cell["class"] for cell in results_in(tmp_path)["cuts"]["3"]["cells"]}
    assert classes[4] is None
    assert None not in (classes[2], classes[3])
    assert "none yet" in summary.table


def test_sweep_without_any_result_says_so(tmp_path):
    make_store(tmp_path)
    summary, lines = told(tmp_path)
    assert lines[0] == "0 of 15 points run"
    assert summary.notes == ("no run oscillates yet: there is nothing to classify",)
    assert summary.figures == ()
    assert results_in(tmp_path)["points"]["pending"] == 15
    assert results_in(tmp_path)["cuts"]["3"]["clusters"] == []


def test_sweep_that_stands_still_says_so(tmp_path):
    filled(tmp_path, status=dict.fromkeys(CENTRES, Status.STEADY))
    summary, _ = told(tmp_path)
    nothing, warning = summary.notes
    assert nothing == "no run oscillates yet: there is nothing to classify"
    assert "though u varies by up to" in warning
    assert "features.steady_threshold = 0.01, has the unit of u" in warning
    classes = {cell["class"] for cell in results_in(tmp_path)["cuts"]["3"]["cells"]}
    assert classes == {"steady"}
    assert {path.stem for path in summary.figures} == {"modal_classes_3"}


def test_fewer_runs_than_clusters_is_said_for_each_cut(tmp_path):
    filled(tmp_path, FAST, "grid.seeds=1", "reduction.cuts=[2,3,5]", status={3: Status.STEADY})
    summary, _ = told(tmp_path)
    assert summary.notes == (
        "3 clusters: only 2, of 2 clustered runs",
        "5 clusters: only 2, of 2 clustered runs",
    )
    assert len(results_in(tmp_path)["cuts"]["5"]["clusters"]) == 2


def test_failed_points_are_counted(tmp_path):
    filled(tmp_path, FAST, status={3: Status.NON_FINITE, 4: Status.NO_WINDOW})
    _, lines = told(tmp_path)
    assert lines[0] == ("15 of 15 points run: 5 oscillate, 5 without a complete window, 5 failed")


def test_a_cell_whose_runs_have_no_window_is_not_steady(tmp_path):
    store = filled(tmp_path, FAST, status={3: Status.STEADY, 4: Status.NO_WINDOW})
    summary, _ = told(tmp_path)
    cells = results_in(tmp_path)["cuts"]["3"]["cells"]
    assert [(cell["class"], cell["oscillating"]) for cell in cells] == [
        ("ordered", 1.0),
        ("steady", 0.0),
        ("no_window", 0.0),
    ]
    assert [line.split()[1] for line in summary.table.splitlines()[1:]] == [
        "ordered",
        "steady",
        "no_window",
    ]
    words = "5 of 15 points (33.3 %) have fewer than features.n_peaks"
    assert sum(words in note for note in summary.notes) == 1
    stored, names = store.reduction(), store.reduction().attributes["names_3"]
    modal = [names[k] for k in stored.arrays["modal_class_3"]]
    assert modal == ["ordered", "steady", "no_window"]


def test_too_few_samples_and_poor_fits_are_warned_of_once(tmp_path, monkeypatch):
    store = filled(tmp_path, FAST)
    few, poor = store.points.columns["P"] == 4, store.points.columns["P"] == 2
    marks = {
        "samples_per_period": np.where(few, 8.0, 30.0),
        "r_squared": np.where(poor, 0.3, 0.9),
    }
    monkeypatch.setattr(Store, "quality", lambda self: marks)
    summary, lines = told(tmp_path)
    samples, fit = summary.notes
    assert samples == (
        "warning: 5 of 15 oscillating points (33.3 %) have fewer than 20 samples per period of the "
        "fastest node (as few as 8): their classes may be wrong; run again with "
        "--set integrator.t_step=0.2 and another --out"
    )
    assert fit.startswith("warning: ordered* is poorly fitted: the sine explains 30% of the")
    assert lines.count(samples) == lines.count(fit) == 1
    results = results_in(tmp_path)
    assert [f"warning: {line}" for line in results["warnings"]] == [samples, fit]
    assert results["quality"]["samples_per_period"] == {
        "limit": 20.0,
        "points": 15,
        "below": 5,
        "least": 8.0,
        "median": 30.0,
    }
    clusters = results["cuts"]["3"]["clusters"]
    assert [(c["r_squared"], c["poorly_fitted"]) for c in clusters] == [
        (0.3, True),
        (0.9, False),
        (0.9, False),
    ]
    assert summary.table.splitlines()[1].split()[1] == "ordered*"


def test_folder_without_a_store_is_bad_input(tmp_path):
    with pytest.raises(BadInput):
        reduce_sweep(tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_importing_outputs_loads_no_matplotlib_and_no_sklearn():
    code = "import chimera_hpc.reduction.reduction, sys\n"
    code += "print(*{n.partition('.')[0] for n in sys.modules})"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert {"matplotlib", "sklearn", "numba"} & set(done.stdout.split()) == set()


# Figures


def test_figures_come_as_png_and_pdf_in_their_folder(tmp_path):
    filled(tmp_path, 'reduction.figures=["modal_classes","dendrogram_3"]')
    summary, lines = told(tmp_path)
    names = ["modal_classes_3", "modal_classes_4", "modal_classes_5", "dendrogram_3"]
    wanted = [f"{name}.{kind}" for name in names for kind in ("png", "pdf")]
    assert [path.name for path in summary.figures] == wanted
    assert sorted(path.name for path in (tmp_path / "figures").iterdir()) == sorted(wanted)
    assert all(path.stat().st_size > 1000 for path in summary.figures)
    assert lines[-1] == f"figures  {tmp_path / 'figures'}: {', '.join(names)} (PNG and PDF)"


def test_no_figures_when_not_wanted(tmp_path):
    filled(tmp_path)
    summary = reduce_sweep(tmp_path, make_figures=False)
    assert summary.figures == ()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["results.json", "store.zarr"]


def test_figures_of_before_go_and_files_of_others_stay(tmp_path):
    filled(tmp_path, 'reduction.figures=["dendrogram_3"]')
    place = tmp_path / "figures"
    place.mkdir()
    for name in ("dendrogram_9.png", "space_time.pdf", "notes.png", "dendrogram_9.txt"):
        (place / name).touch()
    reduce_sweep(tmp_path)
    names = {path.name for path in place.iterdir()}
    assert names == {"dendrogram_3.png", "dendrogram_3.pdf", "notes.png", "dendrogram_9.txt"}


def test_figure_that_fails_leaves_results_and_the_figures_of_before(tmp_path, monkeypatch):
    filled(tmp_path, 'reduction.figures=["dendrogram_3"]')
    reduce_sweep(tmp_path)
    before = (tmp_path / "figures" / "dendrogram_3.png").read_bytes()
    (tmp_path / "results.json").unlink()

    def fail(figure, stem):
        stem.with_suffix(".png").write_text("half a picture")
        raise MemoryError

    monkeypatch.setattr("chimera_hpc.plot.style.save", fail)
    with pytest.raises(MemoryError):
        reduce_sweep(tmp_path)
    assert (tmp_path / "figures" / "dendrogram_3.png").read_bytes() == before
    assert {path.name for path in tmp_path.iterdir()} == {"results.json", "figures", "store.zarr"}


def test_figure_that_was_asked_for_in_vain_is_noted(tmp_path):
    filled(tmp_path, 'reduction.figures=["dendrogram_7","whole_run"]')
    summary, _ = told(tmp_path)
    assert summary.notes == (
        "figure dendrogram_7: this sweep has no such cut",
        "figure whole_run: this sweep has nothing for it to show",
    )


def test_point_to_show_that_is_not_there_is_noted(tmp_path):
    show = 'reduction.show=["P=9 Q=9","P=4 seed=4","P=2 seed=1"]'
    filled(tmp_path, show, 'reduction.figures=["space_time"]', blocks=[0, 1])
    summary, _ = told(tmp_path)
    assert summary.notes == (
        "not shown: P=9 Q=9 is not in this sweep",
        "not shown: P=4 seed=4: never run",
    )
    assert {path.stem for path in summary.figures} == {"space_time"}


# Runs to draw


def loaded(store, **changes):
    """Return the runs that a reduction of this store shows."""
    from chimera_hpc.classify.modes import run_names
    from chimera_hpc.reduction.results import TRIPLET
    from chimera_hpc.reduction.runs import shown_runs

    status, scalars = store.ledger()["status"], store.scalars()
    triplets = np.stack([scalars[name] for name in TRIPLET], axis=1)
    cut = classify(triplets, status).cuts[3]
    axes = free_axes(store.points.cells()[1], ("P", "Q"))
    names = run_names(cut.labels, status, cut.names)
    return shown_runs(store, status, triplets, cut, names, axes, lambda line: None)


def test_without_a_wish_one_run_of_each_class_is_shown(tmp_path):
    store = filled(tmp_path, status={4: Status.STEADY})
    runs = loaded(store)
    assert [run.class_name for run in runs] == ["ordered", "chimera", "disordered"]
    store = filled(tmp_path / "full", "keep.series=first-seed")
    runs = loaded(store)
    assert [(run.place, run.class_name) for run in runs] == [
        ("$P = Q = 2$, seed 0", "ordered"),
        ("$P = Q = 3$, seed 0", "chimera"),
        ("$P = Q = 4$, seed 0", "disordered"),
    ]
    np.testing.assert_array_equal(runs[1].features, store.features()[5])
    np.testing.assert_array_equal(runs[1].u[:], store.series(5).T)
    np.testing.assert_allclose(runs[1].triplet, CENTRES[3])


def test_representative_comes_from_the_cell_with_most_votes(tmp_path):
    from chimera_hpc.reduction.runs import representatives

    store = filled(tmp_path, "keep.series=first-seed")
    scalars = store.scalars()
    triplets = np.stack([scalars[name] for name in ("V_theta", "V_a", "V_Omega")], axis=1)
    triplets[2] = triplets[12]  # a disordered run among the ordered ones
    cut = classify(triplets, store.ledger()["status"]).cuts[3]
    assert representatives(store.sweep, store.points, cut) == [0, 5, 10]


def test_run_whose_series_is_not_kept_is_computed_again(tmp_path):
    from chimera_hpc.run.block import run_block

    show = 'reduction.show=["P=3 seed=2"]'
    runs = {}
    for series in ("all", "none"):
        folder = tmp_path / series
        store = make_store(folder, f"keep.series={series}", "keep.dtype=float32", show)
        store.start_run({})
        block = 7 // store.block_size
        first, last = store.block(block)
        store.write_block(block, run_block(store.sweep, store.points[first:last]), 1, 1)
        (runs[series],) = loaded(store)
    assert runs["none"].u[:].std() > 0.1
    np.testing.assert_array_equal(runs["none"].u[:], runs["all"].u[:])
    np.testing.assert_array_equal(runs["none"].t, runs["all"].t)


def test_replay_begins_at_the_initial_state_and_ends_at_the_end(tmp_path):
    from chimera_hpc.reduction.runs import whole_runs

    sweep = small_sweep('reduction.replay=["P=5 Q=1 seed=9"]')
    axes = [FreeAxis(("P", "Q"), np.array([2, 3, 4]))]
    (run,) = whole_runs(sweep, sweep.points().row(0), axes, lambda line: None)
    assert run.place == "$P = 5$, $Q = 1$, seed 9"
    assert (run.t[0], run.t[-1]) == (0.0, 20.0)
    other = small_sweep("P=5", "Q=1", "seeds=[9]")
    row = other.points().row(0)
    u0, _ = initial_state(other, row, build(other, row))
    np.testing.assert_allclose(run.u[:][:, 0], u0, atol=1e-9)
    assert run.u.shape == (12, len(run.t)) == (12, 41)


def test_replay_takes_what_is_not_named_from_the_first_point():
    sweep = small_sweep("epsilon=[0.02,0.05]", "b=0.7")
    point = single_point(sweep, sweep.points().row(0), "P=5 Q=1").points()
    row = point.row(0)
    assert len(point) == 1
    assert (row["P"], row["Q"], row["seed"]) == (5, 1, 0)
    assert (row["epsilon"], row["b"], row["delta"]) == (0.02, 0.7, 1e-3)


def test_long_replay_is_sampled_coarsely():
    sweep = Sweep.load(ROOT / "jobs" / "quickstart.toml")
    single = single_point(sweep, sweep.points().row(0), "P=1 Q=1")
    assert single.n_samples == 20_001
    assert single.integrator.t_step == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("key", "text", "said"),
    [
        ("replay", "P=3 Q=4", "Q may not exceed P"),
        ("replay", "sigma=0.1", "sigma"),
        ("show", "P=3 sigma=0.1", "this model has no sigma"),
    ],
)
def test_point_that_the_model_does_not_have_is_refused_before_anything_is_written(
    tmp_path, key, text, said
):
    filled(tmp_path, f'reduction.{key}=["{text}"]')
    with pytest.raises(BadInput, match=said) as caught:
        reduce_sweep(tmp_path)
    assert f"reduction.{key}: {text}: " in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["store.zarr"]


def test_point_is_found_by_some_of_its_values():
    points = small_sweep("epsilon={linspace=[0.01,0.1,19]}").points()
    i = find_point(points, "P=3 epsilon=0.015 seed=2")
    assert points.row(i) | {"P": 3, "seed": 2} == points.row(i)
    assert points.row(i)["epsilon"] == pytest.approx(0.015)
    assert find_point(points, "epsilon=0.0151") is None


def test_selection_that_is_near_to_two_values_is_refused_before_anything_runs():
    low, high = 0.1 - 3 * math.ulp(0.1), 0.1 + 3 * math.ulp(0.1)
    sweep = small_sweep(f"epsilon=[{low!r},{high!r}]", 'reduction.show=["P=3 epsilon=0.1"]')
    with pytest.raises(BadInput, match=r"reduction.show: P=3 epsilon=0.1: .* write all digits"):
        check_selections(sweep, sweep.points())


# Axes


def test_values_that_differ_have_labels_that_differ():
    close = FreeAxis(("epsilon",), np.array([0.1, 0.10001, 0.2]))
    assert [close.label(x) for x in close.values] == ["0.1", "0.10001", "0.2"]
    nearer = FreeAxis(("epsilon",), np.array([0.1, 0.1 + math.ulp(0.1)]))
    assert len({nearer.label(x) for x in nearer.values}) == 2
    assert FreeAxis(("epsilon",), np.array([1 / 3, 2 / 3])).label(1 / 3) == "0.3333"
    assert describe({"epsilon": 0.10001}, [close]) == "epsilon = 0.10001"


def test_columns_that_vary_together_are_one_axis():
    cells = {"P": np.array([2, 3, 4]), "Q": np.array([2, 3, 4]), "b": np.full(3, 0.5)}
    (axis,) = free_axes(cells, ("P", "Q", "b"))
    assert axis.names == ("P", "Q")
    assert (axis.plain, axis.symbol) == ("P = Q", "$P = Q$")
    assert free_axes({"P": np.empty(0), "b": np.full(3, 0.5)}, ("P", "b", "gone")) == []


def test_column_that_follows_from_others_is_no_axis():
    cells = {
        "P": np.array([2, 2, 3, 3]),
        "Q": np.array([0, 1, 0, 1]),
        "b": np.array([5.0, 6.0, 7.0, 8.0]),
    }
    assert [axis.names for axis in free_axes(cells, ("P", "Q", "b"))] == [("P",), ("Q",)]


def test_place_names_what_varies():
    axes = [FreeAxis(("P", "Q"), np.arange(2)), FreeAxis(("epsilon",), np.arange(2.0))]
    assert describe({"P": 9, "Q": 9, "epsilon": 0.05}, axes) == "P = Q = 9, epsilon = 0.05"
    row = {"P": 9, "Q": 3, "epsilon": 0.05, "b": 1.0}
    assert describe(row, axes, math=True) == r"$P = 9$, $Q = 3$, $\epsilon = 0.05$"


# Table


def cells_of(classes):
    shares = {"steady": 0.0, None: None}
    return [
        {
            "class": name,
            "oscillating": shares.get(name, 1.0),
            "votes": {name: 2} if name else {},
        }
        for name in classes
    ]


def test_table_of_few_cells_has_a_line_for_each():
    cells = {"3": cells_of(["ordered", None]), "4": cells_of(["ordered-1", None])}
    cells["3"][0] |= {"oscillating": 2 / 3, "votes": {"steady": 1, "ordered": 2}}
    table = class_table(cells, [FreeAxis(("P", "Q"), np.array([9, 10]))])
    assert table.splitlines() == [
        "P = Q  3 clusters  oscillating  votes                4 clusters",
        "9      ordered     67%          ordered 2, steady 1  ordered-1",
        "10     .           .            none yet             .",
    ]


def test_table_marks_classes_that_are_poorly_fitted():
    cells = {"3": cells_of(["ordered", "chimera"])}
    table = class_table(cells, [FreeAxis(("P",), np.array([9, 12]))], {"3": {"ordered"}})
    assert table.splitlines()[1:] == [
        "9   ordered*    100%         ordered* 2",
        "12  chimera     100%         chimera 2",
    ]


def test_table_of_many_values_lists_stretches():
    classes = ["ordered"] * 40 + ["chimera"] + ["ordered"] * 30
    table = class_table({"3": cells_of(classes)}, [FreeAxis(("flips",), np.arange(71))])
    assert table.splitlines() == [
        "ordered  flips: 0-39, 41-70",
        "chimera  flips: 40",
        "runs that oscillate: all in 71 cells",
    ]


def test_table_of_two_axes_is_a_map_with_the_second_axis_upwards():
    axes = [FreeAxis(("P",), np.array([3, 3, 10, 10])), FreeAxis(("Q",), np.array([0, 1, 0, 1]))]
    cells = cells_of(["disordered", "chimera", "steady", None])
    cells[1]["oscillating"] = 0.05
    table = class_table({"3": cells}, axes)
    assert table.splitlines() == [
        "modal classes of 3 clusters",
        "Q",
        "1  c  .",
        "0  d  s",
        "   3 10  P",
        "c chimera, d disordered, s steady",
        "runs that oscillate: all in 1 cells, 5% to 5% of them in 1, none in 1",
    ]


def test_classes_with_one_initial_get_different_letters():
    axes = [FreeAxis(("P",), np.arange(3)), FreeAxis(("Q",), np.zeros(3))]
    table = class_table({"3": cells_of(["wave", "waltz", "wane"])}, axes)
    letters = [part.split()[0] for part in table.splitlines()[-2].split(", ")]
    assert len(set(letters)) == 3


@pytest.mark.parametrize("shape", [(200, 2), (2, 200), (2, 2, 2)])
def test_table_too_large_for_the_terminal_counts_cells(shape):
    grids = np.meshgrid(*[np.arange(n) for n in shape], indexing="ij")
    axes = [FreeAxis((name,), g.ravel()) for name, g in zip("abc", grids, strict=False)]
    half = grids[0].size // 2
    table = class_table({"3": cells_of(["ordered"] * half + ["chimera"] * half)}, axes)
    assert table.splitlines() == [
        f"{half:8d} cells ordered",
        f"{half:8d} cells chimera",
        f"runs that oscillate: all in {2 * half} cells",
    ]


def test_classes_of_another_system_have_letters_everywhere(tmp_path):
    filled(tmp_path, FAST, "features.refine=sine-fit", "grid.seeds=12")
    _, lines = told(tmp_path)
    cut = results_in(tmp_path)["cuts"]["3"]
    assert [cluster["name"] for cluster in cut["clusters"]] == ["A", "B", "C"]
    assert [cell["class"] for cell in cut["cells"]] == ["A", "B", "C"]
    assert Store.open(tmp_path / "store.zarr").reduction().attributes["atlas_names"] == list("ABC")
    text = "\n".join([*lines, (tmp_path / "results.json").read_text()])
    assert not any(name in text for name in CLASSES.values())
    assert Content.read(tmp_path).classification.base.names == ("A", "B", "C")


def test_an_atlas_of_another_model_is_said_to_be_one(tmp_path):
    filled(tmp_path / "judge", FAST)
    told(tmp_path / "judge")
    make_store(tmp_path / "same", FAST)
    data = {"name": "x", "model": "kuramoto_sakaguchi", "grid": {"P": [2, 3]}}
    Store.plan(tmp_path / "other/store.zarr", Sweep.model_validate(data))
    said = []
    assert list(atlases_of(tmp_path / "same", ["judge"], said.append)) == ["judge"]
    assert said == []
    assert list(atlases_of(tmp_path / "other", ["judge"], said.append)) == ["judge"]
    assert said == [
        "atlas judge: its runs are of the model topological_fhn, these of kuramoto_sakaguchi: its "
        "classes and their names are those of another system"
    ]


def test_measures_are_compared_by_partition_where_classes_have_letters(tmp_path):
    filled(
        tmp_path,
        'reduction.figures=["agreement_matrix", "verdicts"]',
        "features.refine=sine-fit",
        'reduction.analyses=["agreement"]',
        "reduction.deltas=[0.0]",
    )
    summary, _ = told(tmp_path)
    made = results_in(tmp_path)["curves"]["agreement"]
    assert made["modal"]["triplets"] == ["A", "B", "C"]
    pairs = {(pair["rows"], pair["columns"]): pair for pair in made["pairs"]}
    assert pairs["triplets", "SI"]["kappa"] is None
    assert pairs["triplets", "SI"]["adjusted_rand"] is not None
    assert len(summary.figures) == 4


def test_runs_of_one_state_are_said_to_be_one(tmp_path):
    store = make_store(tmp_path, FAST, "grid.seeds=24")
    store.start_run({})
    draw = np.random.default_rng(1)
    for i in range(store.n_blocks):
        made = block_results(store, i)
        made.scalars[:, :3] = np.multiply(
            CENTRES[2], 1.0 + 0.1 * draw.normal(size=(len(made.status), 3))
        )
        store.write_block(i, made, 1, 1)
    _, lines = told(tmp_path)
    (said,) = (line for line in results_in(tmp_path)["warnings"] if "state" in line)
    assert said.startswith("72 of 72 runs look like one state (gap ")
    assert f"warning: {said}" in lines
