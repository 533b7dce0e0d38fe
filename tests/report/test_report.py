"""The report's file: what it says of finished, unfinished, failed and unusual sweeps."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from bokeh.models import ColumnDataSource

from chimera_hpc.classify.classification import Classification
from chimera_hpc.job import Sweep
from chimera_hpc.job.shipped import job_file
from chimera_hpc.network.network import Network
from chimera_hpc.reduction.reduction import reduce_sweep
from chimera_hpc.reduction.runs import drawn_network
from chimera_hpc.report import charts, pictures, write_report
from chimera_hpc.report import content as contents
from chimera_hpc.report import page as report_page
from chimera_hpc.report.content import Content
from chimera_hpc.report.looks import look_of
from chimera_hpc.report.networks import drawing
from chimera_hpc.report.page import MOST_FAILURES
from chimera_hpc.report.pictures import Plates, evenly_spread, plates, representatives
from chimera_hpc.report.tree_top import top_of
from chimera_hpc.store.blocks import DamagedChunk
from chimera_hpc.sweep import main

FAST = "reduction.figures=[]"
PLANE = ("P=2:5", "Q=0:2", "seeds=2", FAST)


def page_of(folder: Path) -> str:
    report = write_report(folder)
    assert report.path == folder / "report.html"
    text = report.path.read_text(encoding="utf-8")
    assert report.size == len(text.encode())
    return text


def data_of(page: str):
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    return json.loads(found.group(1))


def pictured(content: Content, **options) -> Plates:
    return plates(content, np.arange(content.n_cells), **options)


def words_of(page: str) -> str:
    """The words of the page, without scripts, styles and elements."""
    body = page[page.index("<body>") :]
    text = re.sub(r"<(script|style).*?</\1>|<[^>]*>", " ", body, flags=re.DOTALL)
    return " ".join(text.split())


def test_seeds_reach_the_pages_script_with_all_their_bits(tmp_path, filled):
    seeds = [2**53 - 1, 2**53 + 1, 2**63 - 1]
    filled(tmp_path, f"seeds={seeds}", FAST)
    # A browser reads a number of JSON as a double.
    numbers = json.loads(json.dumps(data_of(page_of(tmp_path))), parse_int=float)
    assert {int(seed) for seed in numbers["points"]["seed"]} == set(seeds)


@pytest.fixture(scope="module")
def reduced(tmp_path_factory, filled) -> Path:
    """A sweep with a steady run, a failure, a claim and a curve, and its report."""
    folder = tmp_path_factory.mktemp("reduced")
    filled(folder, FAST, "title='Three \"classes\" <b>'", steady=[0], failed=[6])
    claims = [{"id": "one", "paper": "W is 1", "measured": "0.5", "reproduced": False}]
    curve = {"x": [0, 1], "fraction": [1.0, 0.5], "low": [0.8, 0.2], "high": [1.0, 0.8]}
    entry = {"label": "orientation 1, $Q$ = 0", "judge": "diagonal", "by": {"diagonal": curve}}
    reduce_sweep(folder, claims=claims, curves={"robustness": entry})
    page_of(folder)
    return folder


@pytest.fixture
def page(reduced: Path) -> str:
    return (reduced / "report.html").read_text(encoding="utf-8")


def test_one_file_beside_the_store_that_names_nothing_to_load(reduced, page):
    assert len(page) < 10e6
    markup = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert re.findall(r'(?:src|href)="(?!#|data:)', markup) == []
    assert "url(" not in markup
    assert "default-src 'none'" in markup
    assert list(reduced.glob(".*.partial")) == []


def test_summary_tells_sweep_counts_and_versions(page):
    words = words_of(page)
    assert "Three &#34;classes&#34; &lt;b&gt;" in words
    assert "15 points in 3 cells, 5 seeds; P = Q: 2, 3, 4." in words
    assert "13 done: it oscillates" in words
    assert "1 steady: the signal stands still" in words
    assert "1 time-out: " in words
    assert "chimera_hpc 0, source" in words
    assert "Not finished" not in words


def test_failures_are_listed_with_reason_and_command(page):
    words = words_of(page)
    assert "P=3 Q=3 seed=1 time-out: integrator.time_out seconds" in words
    assert re.search(r"sweep why \S+ P=3 Q=3 seed=1", words)
    assert "1 point failed." in words


def test_claims_of_the_results_are_shown(page):
    assert "one W is 1 0.5 ✗ no" in words_of(page)


def test_robustness_curves_have_a_chart(page):
    assert "Share of chimeras against reversed links Q_r" in words_of(page)
    assert "orientation 1, Q = 0, judged by diagonal" in page


@pytest.mark.slow
def test_votes_and_classes_are_those_of_the_results(tmp_path, filled):
    filled(tmp_path, *PLANE, steady=[0, 1, 5])
    reduce_sweep(tmp_path)
    results = json.loads((tmp_path / "results.json").read_text())
    data = data_of(page_of(tmp_path))
    assert data["first"] == "3"
    for k, cut in results["cuts"].items():
        if k not in data["cuts"]:
            continue
        shown = data["cuts"][k]
        names = [look["name"] for look in shown["looks"]]
        assert names[:-2] == [cluster["name"] for cluster in cut["clusters"]]
        assert shown["sizes"] == [cluster["size"] for cluster in cut["clusters"]]
        for row, cell in enumerate(cut["cells"]):
            votes = {n: v for n, v in zip(names, shown["votes"][row], strict=True) if v}
            assert votes == cell["votes"]
            assert names[shown["modal"][row]] == cell["class"]
            assert data["cells"]["name"][row] == f"P = {cell['P']}, Q = {cell['Q']}"


def test_steady_runs_may_vote_but_do_not_oscillate(tmp_path, filled):
    filled(tmp_path, *PLANE, "features.steady=level", steady=[0, 2, 3])
    reduce_sweep(tmp_path)
    cells = json.loads((tmp_path / "results.json").read_text())["cuts"]["3"]["cells"]
    assert [cell["oscillating"] for cell in cells[:3]] == [0.5, 0.0, 1.0]
    page = page_of(tmp_path)
    assert data_of(page)["cells"]["oscillating"][:3] == [1, 0, 2]
    assert "All 24 runs." in words_of(page)
    assert "Each cell has the class of most of its runs:" in words_of(page)


def test_cut_can_be_moved_from_two_clusters_to_eight(tmp_path, filled):
    filled(tmp_path, *PLANE)
    data = data_of(page_of(tmp_path))
    assert list(data["cuts"]) == [str(k) for k in range(2, 9)]
    depths = [cut["depth"] for cut in data["cuts"].values()]
    assert depths == sorted(depths, reverse=True)
    for k, cut in data["cuts"].items():
        assert len(cut["sizes"]) == int(k)
        assert sum(cut["sizes"]) == 24


def test_unfinished_sweep_says_so_and_shows_what_there_is(tmp_path, filled):
    filled(tmp_path, *PLANE, blocks=[0, 1, 2])
    page = page_of(tmp_path)
    assert "Not finished: 12 of 24 points tried (50.0 %)" in words_of(page)
    cells = data_of(page)["cells"]
    assert sum(cells["results"]) == 12
    assert data_of(page)["cuts"]["3"]["modal"].count(-1) == 6


def test_sweep_without_any_result_has_a_page(tmp_path, filled):
    filled(tmp_path, *PLANE, blocks=[])
    page = page_of(tmp_path)
    assert "0 of 24 points tried" in words_of(page)
    assert "Dendrogram" not in words_of(page)
    assert data_of(page)["plates"] == {}


def test_sweep_that_never_oscillates_has_a_page(tmp_path, filled):
    filled(tmp_path, FAST, steady=range(15))
    data = data_of(page_of(tmp_path))
    (cut,) = data["cuts"].values()
    assert [cut["looks"][i]["name"] for i in cut["modal"]] == ["steady"] * 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("overrides", "axes"),
    [
        (("P=3", "Q=P"), {"all runs": 1}),
        (("P=3:5", "Q=P"), {"P = Q": 3}),
        (("P=3:5", "Q=0:P"), {"P": 3, "Q": 6}),
        (("P=3:4", "Q=P", "epsilon=[0.05, 0.1, 0.2]"), {"P = Q": 2, "epsilon": 3}),
        (("P=3:4", "Q=[0,1]", "orientation=[1,2]"), {"P": 2, "Q": 2, "orientation": 2}),
        (("P=3", "Q=P", "flips=[0,4,9]"), {"flips": 3}),
    ],
)
def test_axes_of_the_map_are_what_varies(tmp_path, filled, overrides, axes):
    filled(tmp_path, "seeds=1", FAST, *overrides)
    data = data_of(page_of(tmp_path))
    assert {axis["name"]: len(axis["values"]) for axis in data["axes"]} == axes
    places = list(zip(*data["cells"]["place"], strict=True))
    assert len(set(places)) == len(data["cells"]["name"])
    for axis, column in zip(data["axes"], data["cells"]["place"], strict=True):
        assert set(column) == set(range(len(axis["values"])))


@pytest.mark.slow
def test_long_list_of_failures_is_cut(tmp_path, filled):
    filled(tmp_path, FAST, "seeds=80", "P=3:5", failed=range(240))
    words = words_of(page_of(tmp_path))
    assert f"240 points failed; the first {MOST_FAILURES} are listed" in words
    assert len(re.findall(r"sweep why \S+ P=", words)) == MOST_FAILURES


@pytest.mark.slow
def test_agreement_of_measures_is_told_and_shown(tmp_path, filled, capsys, monkeypatch):
    wish = ('reduction.analyses=["agreement"]', "reduction.deltas=[0.1]")
    wish += ('reduction.figures=["verdicts"]',)
    filled(tmp_path, *PLANE, *wish, 'reduction.delta_unit="absolute"')
    monkeypatch.setattr(report_page, "remarks", lambda _: ["SI of 2 of 9 runs"])
    assert main(["reduce", str(tmp_path)]) == 0
    told = " ".join(capsys.readouterr().out.split())
    head = "triplets SI sigma_1"
    caption = "Cohen's kappa of the runs below the diagonal, adjusted Rand index above it"
    assert f"{caption}: {head}" in told
    words = words_of(page_of(tmp_path)).replace("&#39;", "'")
    assert f"1 is full agreement, 0 as by chance, - not defined. {head} triplets" in words
    assert "sigma_1: modes of its density SI of 2 of 9 runs. The measures differ in " in words
    assert (tmp_path / "figures" / "verdicts.png").stat().st_size > 0


def test_tree_of_the_reduction_is_used_again_while_it_fits(tmp_path, filled, monkeypatch):
    store = filled(tmp_path, *PLANE, blocks=[0, 1, 2])
    reduce_sweep(tmp_path)
    known: list[bool] = []
    real = contents.classify

    def spy(*args, **options) -> Classification:
        known.append(options["known"] is not None)
        return real(*args, **options)

    monkeypatch.setattr(contents, "classify", spy)
    again = Content.read(tmp_path)
    from store_tools import block_results

    store.write_block(3, block_results(store, 3), 1, 1)
    Content.read(tmp_path)
    assert known == [True, False]
    fresh = real(again.triplets, again.status, cuts=(3,))
    np.testing.assert_array_equal(again.cuts[3].labels, fresh.cuts[3].labels)


def test_every_cell_carries_picture_and_profiles_of_a_typical_run(tmp_path, filled):
    filled(tmp_path, *PLANE, steady=[0])
    content = Content.read(tmp_path)
    chosen = representatives(content)
    np.testing.assert_array_equal(content.cell[chosen], np.arange(12))
    assert chosen[0] == 1  # the modal class is taken over the runs that oscillate
    made = pictured(content)
    assert made.n_images == len(made.by_cell) == 12
    assert made.sentence == "All 12 cells with results carry a picture and profiles."
    plate = made.by_cell[5]
    assert plate["image"].startswith("data:image/png;base64,")
    assert plate["point"] == content.point_words(int(chosen[5]))
    features = content.store.features()[chosen[5]]
    np.testing.assert_allclose(plate["amplitude"], features[0], rtol=1e-3)
    np.testing.assert_allclose(plate["phase"], features[2], rtol=1e-3)


def test_budget_of_pictures_is_kept_and_told(tmp_path, filled, monkeypatch):
    filled(tmp_path, *PLANE)
    content = Content.read(tmp_path)
    assert sorted(pictured(content, most_cells=3).by_cell) == [0, 4, 8]
    whole = len(json.dumps(pictured(content).by_cell))
    monkeypatch.setattr(pictures, "MOST_BYTES", whole // 2)
    made = pictured(content)
    assert 4 <= len(made.by_cell) <= 6
    assert f"{len(made.by_cell)} of 12 cells with results carry a picture" in made.sentence
    assert "spread evenly" in made.sentence


def test_large_sweep_shows_evenly_spread_cells_and_fewer_cuts(tmp_path, filled, monkeypatch):
    filled(tmp_path, *PLANE)
    monkeypatch.setattr("chimera_hpc.report.payload.MOST_CELLS", 6)
    monkeypatch.setattr("chimera_hpc.report.payload.MOST_POINTS", 10)
    monkeypatch.setattr(contents, "_MOST_VOTES", 12 * 9)
    page = page_of(tmp_path)
    data, words = data_of(page), words_of(page)
    assert list(data["cuts"]) == ["2", "3", "4"]
    assert len(data["cells"]["name"]) == 6
    assert {data["plates"][str(row)]["point"].rpartition(" ")[0] for row in range(6)} == {
        name.replace(" = ", "=").replace(", ", " ") for name in data["cells"]["name"]
    }
    assert "6 of 12 cells are on the map, spread evenly." in words
    assert "10 of 24 oscillating runs, spread evenly." in words


@pytest.mark.parametrize("n", [1, 2, 7, 64, 100])
def test_first_parts_of_an_even_spread_leave_no_large_gap(n):
    order = evenly_spread(n)
    assert sorted(order.tolist()) == list(range(n))
    for count in (1, 2, 4, 8, 16):
        if count <= n:
            taken = np.sort(order[:count])
            assert np.diff([*taken, n]).max() <= 4 * n / count


def test_series_that_are_not_kept_are_replayed(tmp_path, filled):
    job = ("P=3", "Q=P", "seeds=2", "keep.series='none'", FAST)
    filled(tmp_path, *job)
    content = Content.read(tmp_path)
    assert pictured(content, replay=False).n_images == 0
    assert "carry profiles" in pictured(content, replay=False).sentence
    assert pictured(content).n_images == 1


def test_replay_stops_at_its_budget(tmp_path, filled, monkeypatch):
    filled(tmp_path, *PLANE, "keep.series='none'")
    content = Content.read(tmp_path)
    content.scan.columns["elapsed_us"][:] = 8_000_000
    monkeypatch.setattr(pictures, "_replay", lambda content, points: np.ones((len(points), 21, 12)))
    made = pictured(content)
    assert made.n_images == 2
    assert len(made.by_cell) == 12


def test_damage_is_raised_and_leaves_the_old_report(tmp_path, filled):
    store = filled(tmp_path, *PLANE)
    write_report(tmp_path)
    before = (tmp_path / "report.html").read_bytes()
    store.files.file("scalars", 1).unlink()
    with pytest.raises(DamagedChunk):
        write_report(tmp_path)
    assert (tmp_path / "report.html").read_bytes() == before


def test_top_of_a_tree_holds_all_leaves_in_order():
    from scipy.cluster import hierarchy

    points = np.random.default_rng(3).normal(size=(200, 3))
    linkage = hierarchy.linkage(points, "ward")
    top = top_of(linkage, most=12)
    assert sum(top.sizes) == 200
    assert len(top.sizes) == len(top.members) == 12
    labels = hierarchy.cut_tree(linkage, n_clusters=12)[:, 0]
    assert len(set(labels[top.members])) == 12
    np.testing.assert_allclose(sorted(max(y) for y in top.ys), linkage[-11:, 2])
    for (first, last), xs in zip(top.ends, top.xs, strict=True):
        assert first <= min(xs) <= max(xs) <= last
    assert top_of(np.empty((0, 4))).sizes == []
    assert top_of(linkage[:0]).xs == []


def test_classes_differ_by_shape_and_by_colour():
    names = ("ordered", "chimera", "disordered", "steady", "chimera-1", "chimera-2", "ordered-2")
    looks = [look_of(name) for name in names]
    families = looks[:4]
    for key in ("marker", "colour", "sign"):
        assert len({getattr(look, key) for look in families}) == 4
    assert looks[4].marker != looks[5].marker


def test_reduce_writes_the_report_unless_figures_are_not_wanted(tmp_path, filled, capsys):
    filled(tmp_path, *PLANE)
    assert main(["reduce", str(tmp_path), "--no-figures"]) == 0
    assert not (tmp_path / "report.html").exists()
    assert main(["reduce", str(tmp_path)]) == 0
    assert f"report   {tmp_path / 'report.html'} (" in capsys.readouterr().out


def test_a_class_name_cannot_break_out_of_the_pages_data(tmp_path, filled):
    name = "</script><script>alert(1)</script><!--"
    filled(tmp_path, FAST, "title='</title><b>'", f"reduction.names=['{name}','b','c']")
    page = page_of(tmp_path)
    looks = data_of(page)["cuts"]["3"]["looks"]
    assert sorted(look["name"] for look in looks)[:1] == [name]
    assert "alert(1)<" not in page
    assert "</title><b>" not in page


def test_network_for_the_page_is_thinned_and_says_so():
    ring = Network.ring(40, 2).with_triangles("cliques")
    for signals, corners in (("nodes", 1), ("links", 2), ("triangles", 3)):
        made = drawing(ring, signals, 10)
        assert np.array(made["marks"]).shape == (10, corners)
        assert len(made["behind"]) == (0 if signals == "links" else 80)
        assert made["partly"] == f"10 of {ring.size(signals)} {signals}"
        places = np.column_stack([made["x"], made["y"]])
        assert np.abs(np.linalg.norm(places, axis=1) - 1.0).max() < 1e-2
    first = drawing(Network.ring(5, 1), "links", 10)
    sides = np.column_stack([first["x"], first["y"]])[first["marks"]]
    np.testing.assert_allclose(sides[0], [[0.0, 1.0], [0.951, 0.309]])
    assert first["partly"] == ""


def test_network_of_a_point_is_drawn_where_the_job_has_one() -> None:
    said: list[str] = []
    sweep = Sweep.load(job_file("examples/small_world"))
    drawn = drawn_network(sweep, sweep.points().row(0), said.append)
    assert drawn is not None
    assert (drawn.n_nodes, said) == (sweep.n_nodes, [])


def test_picture_of_a_run_stands_on_its_lower_left_corner() -> None:
    source = ColumnDataSource({name: [] for name in ("url", "x", "y", "w", "h")})
    frame = charts.picture({"picture": source}, 8, "node")
    assert frame.renderers[0].glyph.anchor == "bottom_left"
