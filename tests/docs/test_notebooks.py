"""Notebooks of the documentation: they run, and what they keep is what they show."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "docs/notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


def code_cells(file: Path) -> list[dict[str, Any]]:
    cells = json.loads(file.read_text(encoding="utf-8"))["cells"]
    return [cell for cell in cells if cell["cell_type"] == "code"]


def run(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Names after all cells of a notebook have run in an empty folder."""
    from matplotlib import pyplot

    monkeypatch.chdir(folder)
    names: dict[str, Any] = {}
    monkeypatch.setattr(pyplot, "show", lambda: pyplot.close("all"))
    for number, cell in enumerate(code_cells(FOLDER / f"{name}.ipynb")):
        exec(compile("".join(cell["source"]), f"{name}, cell {number}", "exec"), names)
    return names


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_notebook_was_executed_from_top_to_bottom_without_an_error(file):
    cells = code_cells(file)
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    outputs = [output for cell in cells for output in cell["outputs"]]
    assert {output["output_type"] for output in outputs} <= {
        "stream",
        "display_data",
        "execute_result",
    }
    assert file.stat().st_size < 500_000


PUBLIC = {"chimera_hpc", "chimera_hpc.pipeline", "chimera_hpc.sweep"}


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_notebook_needs_no_internal_import_and_draws_by_the_public_figures(file):
    tree = ast.parse("\n".join("".join(cell["source"]) for cell in code_cells(file)))
    imported = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    imported |= {one.name for node in ast.walk(tree) if isinstance(node, ast.Import)
                 for one in node.names}  # fmt: skip
    assert {name for name in imported if name.startswith("chimera_hpc")} <= PUBLIC
    assert not {name for name in imported if name.startswith("matplotlib")}
    calls = {ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    assert {"plot.space_time", "plot.profiles", "plot.variations"} <= calls


@pytest.mark.slow
def test_the_paper_in_ten_minutes(tmp_path, monkeypatch):
    names = run("paper", tmp_path, monkeypatch)
    assert names["status"] == 0
    found = dict(zip(names["cells"].P.values.tolist(), names["cells"].values, strict=True))
    assert [found[P] for P in (11, 12, 13)] == ["chimera"] * 3
    assert {found[P] for P in range(6, 10)} == {"ordered"}
    assert {found[P] for P in (14, 15, *range(20, 25))} == {"disordered"}


@pytest.mark.slow
def test_your_own_data(tmp_path, monkeypatch):
    names = run("own-data", tmp_path, monkeypatch)
    assert names["names"] == ["ordered"] * 4 + ["chimera"] * 4 + ["disordered"] * 4
    assert 5 <= names["locked"].sum() <= 60
