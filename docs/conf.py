"""Sphinx: how the pages become a site; `scripts/docs` calls it."""

from __future__ import annotations

import sys
from itertools import takewhile
from pathlib import Path
from typing import Any

from docutils.nodes import SkipNode

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from generated import write_pages  # noqa: E402
from latex2mathml.converter import convert  # noqa: E402

from chimera_hpc import __version__  # noqa: E402

project = "chimera_hpc"
author = "the chimera_hpc developers"
copyright = author
release = version = __version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["_build", "_generated"]
templates_path: list[str] = []

html_theme = "furo"
html_title = f"chimera_hpc {__version__}"
html_copy_source = False
html_show_sphinx = False

# Single backticks in docstrings are names.
default_role = "literal"
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

# Notebooks are shown as they were executed; `scripts/docs --notebooks` executes them again.
nb_execution_mode = "off"
myst_heading_anchors = 3
# MathML is drawn by the browser itself: pages need no network.
html_math_renderer = "mathml"

write_pages(HERE / "_generated")

PROPERTIES: dict[str, list[str]] = {}
"""Docstrings of properties as they are."""


def setup(app: Any) -> None:
    """Have docstrings prepared before numpydoc sections are parsed."""
    app.connect("autodoc-process-docstring", set_equations_apart, priority=400)
    app.connect("autodoc-process-docstring", put_back_property, priority=600)
    app.connect("source-read", drop_missing)
    renderers = (draw("inline"), None)
    app.add_html_math_renderer("mathml", renderers, (draw("block"), None))


def draw(display: str) -> Any:
    """Return what writes a formula as MathML."""

    def visit(translator: Any, node: Any) -> None:
        translator.body.append(convert(node.astext(), display=display))
        raise SkipNode

    return visit


def set_equations_apart(
    app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]
) -> None:
    """Make literal blocks of what is indented before the first section: equations, as typed."""
    if what == "property":
        PROPERTIES[name] = list(lines)
    text = list(takewhile(lambda line: set(line) != {"-"}, lines))
    out: list[str] = []
    for line in text:
        begins = line.startswith(" ") and out[-1:] == [""] and len(out) > 1
        if begins and not _is_indented(out):
            out += ["::", ""]
        out.append(line)
    lines[: len(text)] = out


def put_back_property(
    app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]
) -> None:
    """Undo what napoleon makes of a property: it takes what stands before a colon for a type."""
    if what == "property":
        lines[:] = PROPERTIES[name]


def _is_indented(lines: list[str]) -> bool:
    """Tell whether the last line that is not empty is indented."""
    return next((line for line in reversed(lines) if line), "").startswith(" ")


def drop_missing(app: Any, document: str, source: list[str]) -> None:
    """Leave out of the contents the pages in brackets, as in [r]eport, that are not there."""
    if document == "index":
        lines = source[0].splitlines()
        source[0] = "\n".join(
            line.replace("[", "").replace("]", "") if line.startswith("[") else line
            for line in lines
            if not line.startswith("[") or (HERE / f"{line[1]}{line[3:]}.md").is_file()
        )
