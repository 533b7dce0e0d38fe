"""Run the lines of the page gallery.md on a finished quick start, and write its pictures."""

from __future__ import annotations

import ast
import re
import sys
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib as mpl
from PIL import Image

HERE = Path(__file__).resolve().parent
PART = re.compile(r"```python\n(.*?)```\n(?:\n!\[[^]]*\]\((\S+)\))?", re.DOTALL)
COLOURS = 256
SWEEP = '"results/quickstart"'


def draw_gallery(sweep: str, page: Path = HERE / "gallery.md") -> list[Path]:
    """Run each block of code; the value of the last line is the picture that follows the block."""
    names: dict[str, Any] = {}
    written = []
    for code, picture in PART.findall(page.read_text(encoding="utf-8")):
        *statements, last = ast.parse(code.replace(SWEEP, repr(sweep))).body
        exec(compile(ast.Module([*statements], []), page.name, "exec"), names)
        if not picture:
            exec(compile(ast.Module([last], []), page.name, "exec"), names)
            continue
        assert isinstance(last, ast.Expr), code
        figure = eval(compile(ast.Expression(last.value), page.name, "eval"), names)
        drawn = BytesIO()
        figure.savefig(drawn, dpi=130)
        few = Image.open(drawn).convert("RGB").quantize(COLOURS, method=Image.Quantize.MEDIANCUT)
        few.save(page.parent / picture, optimize=True)
        written.append(page.parent / picture)
    return written


if __name__ == "__main__":
    mpl.use("agg")
    print(*draw_gallery(sys.argv[1]), sep="\n")
