"""Execute the notebooks of the site in a Jupyter kernel, and keep what they show."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbformat import NotebookNode

NOTEBOOKS = Path(__file__).resolve().parent / "notebooks"


def execute(file: Path) -> None:
    """Execute one notebook in an empty folder of its own, and write it with its outputs."""
    notebook = nbformat.read(file, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        where = {"metadata": {"path": folder}}
        NotebookClient(notebook, timeout=300, resources=where).execute()
        for cell in notebook.cells:
            _clean(cell, folder)
    notebook.metadata = {
        "kernelspec": {"name": "python3", "display_name": "Python 3"},
        "language_info": {"name": "python", "pygments_lexer": "ipython3"},
    }
    nbformat.write(notebook, file)


def _clean(cell: NotebookNode, folder: str) -> None:
    """Drop what depends on the machine and the day: times, progress, the folder."""
    cell.metadata = {}
    if cell.cell_type == "code":
        cell.outputs = [output for output in cell.outputs if output.get("name") != "stderr"]
        for output in cell.outputs:
            if "text" in output:
                output.text = output.text.replace(f"{folder}/", "")


if __name__ == "__main__":
    os.environ["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"
    for name in sorted(NOTEBOOKS.glob("*.ipynb")):
        execute(name)
        print(name)
