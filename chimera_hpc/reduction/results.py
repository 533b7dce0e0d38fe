"""results.json: everything a reader needs of a finished sweep, in one plain file."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.status import Status
from chimera_hpc.classify.classification import TRIPLET as TRIPLET
from chimera_hpc.classify.classification import Classification, Cut
from chimera_hpc.classify.modes import CellTable, modal_classes
from chimera_hpc.reduction.quality import POOR_FIT, class_fits, describe_quality
from chimera_hpc.store.schema import QUALITY

SCHEMA = 1


class NamedSweep(Protocol):
    """What is asked of a sweep."""

    @property
    def name(self) -> str: ...

    def to_dict(self) -> dict[str, Any]:
        """Return the tables of the job file, defaults filled in."""
        ...


def build_results(
    sweep: NamedSweep,
    points: CellTable,
    ledger: Mapping[str, NDArray[np.int64]],
    classification: Classification,
    curves: Mapping[str, Any] | None = None,
    claims: Sequence[Mapping[str, Any]] = (),
    quality: Mapping[str, NDArray[np.float64]] | None = None,
) -> dict[str, Any]:
    """Assemble the contents of results.json; plain Python values only, None in place of NaN.

    Cells carry every coordinate of `points` but the seed, and what the sweep holds fixed besides
    (the number of nodes). Beyond the agreed keys, each cut tells the depth of its line, each
    cluster the median R^2 of its runs and whether that is poor, ``quality`` how well the points are
    measured (see `reduction.quality`), and ``clustering`` linkage, scaling, whether a sample was
    clustered, and the order of splits. `quality` are the columns of `Store.quality`.
    """
    status = np.asarray(ledger["status"])
    unknown = np.full(len(status), np.nan)
    marks = quality or dict.fromkeys(QUALITY, unknown)
    fixed = sweep.to_dict().get("fixed", {})
    results = {
        "schema": SCHEMA,
        "sweep": sweep.name,
        "points": count_points(status),
        "cuts": {
            str(asked): _describe_cut(points, status, cut, fixed, marks["r_squared"])
            for asked, cut in classification.cuts.items()
        },
        "quality": describe_quality(marks),
        "clustering": _describe_clustering(classification),
        "curves": dict(curves or {}),
        "claims": [dict(claim) for claim in claims],
    }
    plain: dict[str, Any] = json_safe(results)
    return plain


def count_points(status: ArrayLike) -> dict[str, int]:
    """Count points by outcome; the parts sum to the total."""
    codes = np.asarray(status)
    count = {code: int(np.count_nonzero(codes == code)) for code in Status}
    return {
        "total": len(codes),
        "done": count[Status.DONE],
        "steady": count[Status.STEADY],
        "no_window": count[Status.NO_WINDOW],
        "failed": sum(n for code, n in count.items() if code.is_failure),
        "pending": count[Status.NEVER],
    }


def _describe_cut(
    points: CellTable,
    status: NDArray[np.int64],
    cut: Cut,
    fixed: Mapping[str, Any],
    r_squared: NDArray[np.float64],
) -> dict[str, Any]:
    fits = class_fits(cut, r_squared)
    clusters = [
        {
            "name": name,
            "size": size,
            "centroid": dict(zip(TRIPLET, centroid, strict=True)),
            "r_squared": fit,
            "poorly_fitted": fit < POOR_FIT,
        }
        for name, size, centroid, fit in zip(cut.names, cut.sizes, cut.centroids, fits, strict=True)
    ]
    cells = [{**fixed, **cell} for cell in modal_classes(points, status, cut)]
    return {"clusters": clusters, "cells": cells, "depth": cut.depth}


def _describe_clustering(classification: Classification) -> dict[str, Any]:
    return {
        "linkage": classification.method,
        "classifier": classification.classifier,
        "minimum": dict(zip(TRIPLET, classification.scaler[0], strict=True)),
        "maximum": dict(zip(TRIPLET, classification.scaler[1], strict=True)),
        "sampled": classification.sampled,
        "clustered_points": len(classification.members),
        "order_of_splits": [
            {"depth": s.depth, "clusters": s.n_clusters, "class": s.name, "sizes": s.sizes}
            for s in classification.order_of_splits()
        ],
    }


def json_safe(value: Any) -> Any:
    """Turn NumPy values into plain ones, tuples into lists, and NaN or infinity into None."""
    if isinstance(value, Mapping):
        return {str(key): json_safe(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return json_safe(value.tolist())
    if isinstance(value, list | tuple):
        return [json_safe(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def read_results(path: str | Path) -> dict[str, Any]:
    """Return the contents of a results.json.

    Raises
    ------
    BadInput
        When it is missing, or something else than this module writes.
    """
    try:
        results = json.loads(Path(path).read_bytes())
        _Results.model_validate(results)
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror or error}") from None
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"])) or "all of it"
        raise BadInput(f"{path}: no results of a sweep: {place[:100]!r}: {first['msg']}") from None
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{path}: no results of a sweep: {error}") from None
    return dict(results)


class _Part(BaseModel):
    """A part of results.json as far as readers rely on it."""

    model_config = ConfigDict(strict=True, extra="allow", defer_build=True)


class _Cluster(_Part):
    name: str
    size: int = Field(ge=0)


class _Cell(_Part):
    modal_class: str | None = Field(alias="class")
    votes: dict[str, Annotated[int, Field(ge=0)]]


class _Cut(_Part):
    clusters: list[_Cluster]
    cells: list[_Cell]


class _Points(_Part):
    total: int
    done: int
    steady: int
    no_window: int
    failed: int
    pending: int


class _Way(_Part):
    what: str
    steps: float
    failed: dict[str, int]
    changed: int
    of: int
    low: float
    high: float
    total_variation: float


class _Loose(_Part):
    place: dict[str, int | float]
    modal_class: str = Field(alias="class")
    kept: float


class _Bootstrap(_Part):
    draws: int
    cells: int
    single: int
    mean: float | None
    loose: list[_Loose]
    kept: dict[str, list[float | None]]


class _Audit(_Part):
    key: str
    labels: str
    points: int
    of: int
    total: int
    ways: dict[str, _Way]
    changed: list[dict[str, Any]]
    bootstrap: _Bootstrap


class _Chain(_Part):
    along: str
    direction: Literal["forward", "backward"]
    values: list[float]
    classes: list[str | None]
    order: list[float | None]


class _Results(_Part):
    version: Literal[1] = Field(alias="schema")
    sweep: str
    points: _Points
    cuts: dict[str, _Cut]
    curves: dict[str, Any]
    claims: list[dict[str, Any]]
    audit: _Audit | None = None
    warnings: list[str] = []
    chains: list[_Chain] = []


def to_json(results: Mapping[str, Any]) -> str:
    """Return the text of results.json; equal results give equal text."""
    return json.dumps(json_safe(results), indent=1, allow_nan=False) + "\n"
