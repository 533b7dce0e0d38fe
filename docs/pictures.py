"""Pictures of the pages, from the figures of the quickstart: smaller, and with fewer colours."""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image

WIDTH = 1100
COLOURS = 256
PICTURES = {
    "space_time": "space-time",
    "indicators": "indicators",
    "dendrogram_3": "dendrogram",
    "projections_3": "projections",
    "modal_classes_3": "modal-classes",
    "classification_3": "classification",
}
"""Name of the figure -> name of the picture."""


def make_pictures(figures: Path, target: Path) -> None:
    """Write the pictures of a sweep's folder `figures` into the folder `target`."""
    for figure, picture in PICTURES.items():
        with Image.open(figures / f"{figure}.png") as image:
            small = image.convert("RGB")
            small.thumbnail((WIDTH, WIDTH), Image.Resampling.LANCZOS)
            few = small.quantize(COLOURS, method=Image.Quantize.MEDIANCUT)
            few.save(target / f"{picture}.png", optimize=True)


if __name__ == "__main__":
    make_pictures(Path(sys.argv[1]), Path(__file__).resolve().parent / "images")
