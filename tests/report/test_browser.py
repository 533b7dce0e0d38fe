"""The report in a real browser: what hover, click, keys and tools do, and what it asks for."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import Browser, browser

from chimera_hpc.reduction.reduction import reduce_sweep
from chimera_hpc.report import write_report

pytestmark = [pytest.mark.chromium, pytest.mark.slow]

VIEW = "const view = (name) => Bokeh.index.find_one(Bokeh.documents[0].get_model_by_name(name));"
SOURCE = "const source = (name) => Bokeh.documents[0].get_model_by_name(`source-${name}`);"
TOOLTIPS = """
const found = (node) => [...node.children].flatMap((child) => [
  ...(child.classList.contains("bk-Tooltip") ? [child] : []),
  ...found(child), ...(child.shadowRoot ? found(child.shadowRoot) : [])]);
const text = (node) => node.nodeType === 3 ? node.data : node.nodeName === "STYLE" ? ""
  : [...(node.shadowRoot || node).childNodes].map(text).join(" ");
return found(document.body).map(text).join(" ").replace(/\\s+/g, " ");
"""


@pytest.fixture(scope="module")
def window(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with browser(tmp_path_factory.mktemp("chromium")) as found:
        yield found


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory, filled: Any) -> dict[str, Path]:
    """A plane of 12 cells with two failures, a diagonal, three axes, and an unfinished plane."""
    jobs: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
        "plane": (("P=2:5", "Q=0:2", "seeds=3"), {"failed": [0, 1], "steady": [8]}),
        "diagonal": (("P=2:5", "Q=P", "seeds=3"), {}),
        "three": (("P=2:4", "Q=0:2", "orientation=[1,2]", "seeds=1"), {}),
        "unfinished": (("P=2:5", "Q=0:2", "seeds=3"), {"blocks": [0, 1]}),
        "empty": (("P=2:5", "Q=0:2", "seeds=3"), {"blocks": []}),
    }
    made = {}
    for name, (overrides, options) in jobs.items():
        folder = tmp_path_factory.mktemp(name)
        filled(folder, *overrides, "reduction.figures=[]", **options)
        if name == "plane":
            curve = {"x": [0, 1], "fraction": [1.0, 0.5], "low": [0.8, 0.2], "high": [1.0, 0.8]}
            entry = {"label": "orientation 1", "judge": "a", "by": {"a": curve}}
            reduce_sweep(folder, curves={"robustness": entry})
        made[name] = write_report(folder).path
    return made


def show(window: Browser, page: Path, width: int = 1280) -> None:
    window.complaints()
    window.open(page, width)
    window.wait('document.documentElement.dataset.ready === "yes"')


def text(window: Browser, element: str) -> str:
    return str(window.run(f"return document.getElementById('{element}').textContent"))


def place(window: Browser, chart: str, x: float, y: float) -> tuple[float, float]:
    """Where a point of a chart is in the window; the chart is brought to its middle."""
    window.run(f"document.getElementById('chart-{chart}').scrollIntoView({{block: 'center'}})")
    return tuple(
        window.run(
            f"{VIEW} const chart = view('{chart}');"
            "const box = chart.canvas_view.el.getBoundingClientRect();"
            f"return [box.left + chart.frame.x_scale.compute({x}),"
            f" box.top + chart.frame.y_scale.compute({y})]"
        )
    )


@pytest.mark.parametrize("width", [1280, 400])
@pytest.mark.parametrize("name", ["plane", "diagonal", "three", "unfinished", "empty"])
def test_opens_in_silence_and_fits_the_window(window, pages, name, width):
    window.requests()
    show(window, pages[name], width)
    window.run("document.getElementById('next').click()")
    window.run("document.querySelector('#table-of-cells').open = true")
    window.wait("document.querySelectorAll('#table-of-cells tbody tr').length > 0")
    assert window.complaints() == []
    asked = [url for url in window.requests() if not url.startswith(("data:", "blob:"))]
    assert asked == [pages[name].as_uri()]
    widths = "[document.documentElement.scrollWidth, document.documentElement.clientWidth]"
    content, inside = window.run(f"return {widths}")
    assert content <= inside
    beyond = """return [...document.querySelectorAll('main *')].filter((e) =>
      !e.closest('.scroll, pre') &&
      e.getBoundingClientRect().right > document.documentElement.clientWidth + 1).length"""
    assert window.run(beyond) == 0


def test_the_browser_itself_refuses_what_the_page_must_not_ask(window, pages):
    show(window, pages["plane"])
    refused = window.run(
        "return fetch('http://127.0.0.1:9/').then(() => false, (error) => error.message)"
    )
    assert "Failed to fetch" in refused
    assert any("Content Security Policy" in line for line in window.complaints())


def test_pointing_at_a_cell_tells_its_votes(window, pages):
    show(window, pages["plane"])
    x, y = place(window, "map", 0, 2)
    window.point_at(x - 15, y)
    window.point_at(x, y)
    window.wait(f"(() => {{{TOOLTIPS}}})().includes('P = 2, Q = 2')")
    said = window.run(TOOLTIPS)
    assert "class: ■ disordered" in said
    assert "votes: ■ disordered 2, ✕ steady 1" in said
    assert "entropy: 0.918 bits" in said
    assert "3 of 3 have a result" in said


def test_clicking_a_cell_shows_its_run(window, pages):
    show(window, pages["plane"])
    window.point_at(*place(window, "map", 2, 1), click=True)
    window.wait("document.getElementById('details-name').textContent === 'P = 4, Q = 1'")
    assert "The run P=4 Q=1 seed=0: ▲ chimera" in text(window, "run-words")
    picture = window.run(f"{SOURCE} return source('picture').data.url[0]")
    assert picture.startswith("data:image/png")
    nodes = window.run(f"{SOURCE} return [...source('profile').data.node]")
    assert nodes == list(range(12))
    marked = window.run(f"{SOURCE} return source('points').selected.indices.length")
    assert marked == 3
    assert window.run("return document.getElementById('cell').value") == "7"
    assert window.complaints() == []


def test_keys_alone_reach_every_cell(window, pages):
    show(window, pages["plane"])
    for _ in range(20):
        window.press("Tab")
        if window.run("return document.activeElement.id") == "map-keys":
            break
    else:
        pytest.fail("Tab never reached the map")
    assert text(window, "details-name") == "P = 4, Q = 0"  # a chimera: the page opens with it
    window.press("ArrowLeft", "ArrowLeft")
    assert text(window, "details-name") == "P = 2, Q = 0"
    window.press("ArrowRight", "ArrowUp")
    assert text(window, "details-name") == "P = 3, Q = 1"
    assert "Votes: " in text(window, "details-words")
    assert window.run("return document.getElementById('details-words').ariaLive") == "polite"
    choose = "const list = document.getElementById('cell'); list.value = '11';"
    window.run(f"{choose} list.dispatchEvent(new Event('change'))")
    assert text(window, "details-name") == "P = 5, Q = 2"


def test_moving_the_cut_recolours_map_tree_and_planes(window, pages):
    show(window, pages["plane"])
    look = f"""{SOURCE} return {{map: [...source('cells').data.colour], points:
      [...source('points').data.colour], tree: [...source('leaves').data.colour],
      depth: Bokeh.documents[0].get_model_by_name('cut').location}}"""
    before = window.run(look)
    set_to = "const cut = document.getElementById('cut'); cut.value = '{}';"
    window.run(f"{set_to.format(0)} cut.dispatchEvent(new Event('input'))")
    after = window.run(look)
    assert text(window, "cut-words") == "2"
    assert "2 clusters at depth" in text(window, "tree-clusters")
    assert len(set(before["points"])) == 3
    assert len(set(after["points"])) == 2
    assert all(before[key] != after[key] for key in before)
    assert text(window, "legend").count(" run") == 3  # two clusters, and one steady run


def test_clicking_into_the_tree_moves_the_cut(window, pages):
    show(window, pages["plane"])
    data = "JSON.parse(document.getElementById('data').textContent).cuts"
    window.point_at(*place(window, "tree", 10, window.run(f"return {data}['2'].depth")), click=True)
    window.wait("document.getElementById('cut-words').textContent === '2'")


def test_selection_in_one_plane_is_one_in_all_and_on_the_map(window, pages):
    show(window, pages["plane"])
    window.run(
        "const bar = Bokeh.documents[0].get_model_by_name('plane0').toolbar;"
        "bar.tools.find((tool) => tool.type === 'BoxSelectTool').active = true"
    )
    start, end = place(window, "plane0", 0.25, 0.09), place(window, "plane0", 0.4, 0.11)
    window.drag(start, end)
    window.wait(f"(() => {{{SOURCE} return source('points').selected.indices.length > 0}})()")
    rows = window.run(f"{SOURCE} return [...source('cells').selected.indices].sort()")
    names = window.run(f"{SOURCE} return source('cells').data.name")
    assert [names[row] for row in rows] == [f"P = 4, Q = {q}" for q in range(3)]
    shared = (
        "new Set(['plane0', 'plane1', 'plane2'].map((n) => view(n).model.renderers[0].data_source))"
    )
    assert window.run(f"{VIEW} return {shared}.size") == 1
    assert text(window, "details-name") == "9 runs in 3 cells chosen"


def test_third_axis_is_chosen_in_a_list(window, pages):
    show(window, pages["three"])
    shown = "Bokeh.documents[0].get_model_by_name('slice').indices"
    names = f"{SOURCE} return {shown}.map((i) => source('cells').data.name[i])"
    assert all("orientation = 1" in name for name in window.run(names))
    window.run(
        "const list = document.querySelector('.slice'); list.value = '1';"
        "list.dispatchEvent(new Event('change'))"
    )
    chosen = window.run(names)
    assert len(chosen) == 9
    assert all("orientation = 2" in name for name in chosen)
    window.run(
        "const list = document.getElementById('cell'); list.value = '0';"
        "list.dispatchEvent(new Event('change'))"
    )
    assert all("orientation = 1" in name for name in window.run(names))


def test_unfinished_cells_are_told_apart_by_shape_and_words(window, pages):
    show(window, pages["unfinished"])
    markers = window.run(f"{SOURCE} return source('cells').data.marker")
    runs = window.run(f"{SOURCE} return source('cells').data.runs")
    assert [marker == "dot" for marker in markers] == [r.startswith("0 of 3") for r in runs]
    assert 0 < markers.count("dot") < 12
    window.run(
        "const list = document.getElementById('shade'); list.value = 'coverage';"
        "list.dispatchEvent(new Event('change'))"
    )
    alpha = window.run(f"{SOURCE} return [...source('cells').data.alpha]")
    assert max(alpha) == pytest.approx(0.8)
    assert min(alpha) == pytest.approx(0.05)
