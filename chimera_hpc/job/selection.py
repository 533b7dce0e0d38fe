"""Selections in a job: points by their values; figures, analyses and measures by their names."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import nearest, short
from chimera_hpc.job.models import built_in
from chimera_hpc.job.parameters import DELTA, SEED
from chimera_hpc.job.registry import (
    ANALYSES,
    CUT_FIGURES,
    FIGURES,
    MEASURES,
    OTHER_NAMES,
    RING_ANALYSES,
)
from chimera_hpc.models.parameters import ModelParameters, Parameter

_EXAMPLE = 'NAME=NUMBER is needed, such as "P=9 Q=9 seed=0"'
_WORD = re.compile(r"\w+=[-+.\w]+", re.ASCII)
_INTEGER = re.compile(r"[-+]?[0-9]{1,30}")
_NUMBERED = re.compile(r"([a-z_]+)_([1-9][0-9]{0,8})")


def parse_selection(
    text: str, key: str = "selection", known: Mapping[str, Parameter] | None = None
) -> dict[str, int | float]:
    """Return the values by name of a text such as ``P=9 Q=9 seed=0``.

    Raises BadInput for words that are not NAME=NUMBER, a repeated name and, if `known` is given,
    unknown names and values. The message begins with `key`.
    """
    where = f"{key}: {short(text)}"
    values: dict[str, int | float] = {}
    for word in text.split():
        name, _, number = word.partition("=")
        if not _WORD.fullmatch(word):
            raise BadInput(f"{where}: {_EXAMPLE}")
        if known is not None and name not in known:
            raise BadInput(f"{where}: unknown {short(name)}{nearest(name, list(known))}")
        if name in values:
            raise BadInput(f"{where}: {name} is given twice")
        try:
            value = int(number) if _INTEGER.fullmatch(number) else float(number)
            values[name] = value if known is None else known[name].check(value)
        except ValueError as error:
            raise BadInput(f"{where}: {name}: {error}") from None
    if not values:
        raise BadInput(f"{where}: {_EXAMPLE}")
    return values


def check_names(key: str, texts: Sequence[str], model: ModelParameters | None) -> None:
    """Raise BadInput for a selection with a name or value that the model does not know.

    Without a model, all models of the registry are tried, because a selection may refer to another
    sweep.
    """
    models = built_in().values() if model is None else [model]
    known = {p.name: p for each in models for p in (*each.parameters, DELTA, SEED)}
    for text in texts:
        parse_selection(text, key, known)


def split_figure_name(name: str) -> tuple[str, int | None]:
    """Return a figure's name and its number of clusters: dendrogram_3 is (dendrogram, 3)."""
    found = _NUMBERED.fullmatch(name)
    return (found.group(1), int(found.group(2))) if found else (name, None)


def check_selections(key: str) -> Callable[[Any], Any]:
    """Return a validator that turns a list of selections into a tuple of texts.

    The validator raises BadInput. `check_names`, which knows the model, checks the names.
    """

    def check(value: Any) -> tuple[str, ...]:
        texts = _texts(value)
        if texts is None:
            raise BadInput(f'{key}: {short(value)} is not a list such as ["P=9 Q=9 seed=0"]')
        for text in texts:
            parse_selection(text, key)
        return texts

    return check


def check_figures(value: Any) -> Any:
    """Return "auto", or a tuple of known names of figures. Raises BadInput for other names."""
    if value == "auto":
        return value
    names, known = _texts(value), [*FIGURES, *CUT_FIGURES]
    if names is None:
        text = f'{short(value)} is neither "auto" nor a list of names; known: {", ".join(known)}'
        raise BadInput(f"reduction.figures: {text}")
    for name in names:
        if split_figure_name(name)[0] not in CUT_FIGURES:
            check_name("reduction.figures", "a figure", name, known)
    return names


def check_analyses(value: Any) -> tuple[str, ...]:
    """Return a tuple of known names of analyses; BadInput for others."""
    return _known_names("reduction.analyses", "an analysis", value, ANALYSES)


def check_network_choices(analyses: Iterable[str]) -> None:
    """Raise BadInput for an analysis of the paper's ring in a job with another network."""
    for name in analyses:
        if name in RING_ANALYSES:
            raise BadInput(
                f"reduction.analyses: {name} is an analysis of the ring, without [network]"
            )


def check_measures(value: Any) -> tuple[str, ...]:
    """Return a tuple of different known names of measures; BadInput for others.

    Names from the literature become those of the measures behind them. The variations, which make
    the classes, are added in front of a list without them.
    """
    given = _known_names("measures.panel", "a measure", value, {**MEASURES, **OTHER_NAMES})
    names = tuple(name for known in given for name in OTHER_NAMES.get(known, (known,)))
    if names and "variations" not in names:
        names = ("variations", *names)
    if len(set(names)) < len(names):
        raise BadInput(f"measures.panel: {short(list(names))} holds a name twice")
    if names[:1] != ("variations",):
        raise BadInput("measures.panel: variations must come first; the classes are made of them")
    return names


def check_name(key: str, kind: str, name: str, known: Iterable[str]) -> None:
    """Raise BadInput, with the nearest known name, if the name is not known."""
    if name not in known:
        raise BadInput(f"{key}: {short(name)} is not {kind}{nearest(name, list(known))}")


def _known_names(key: str, kind: str, value: Any, known: Iterable[str]) -> tuple[str, ...]:
    """Return a tuple of names that a registry has."""
    names = _texts(value)
    if names is None:
        raise BadInput(f"{key}: {short(value)} is not a list of names")
    for name in names:
        check_name(key, kind, name, known)
    return names


def _texts(value: Any) -> tuple[str, ...] | None:
    is_list = isinstance(value, list | tuple) and all(isinstance(item, str) for item in value)
    return tuple(value) if is_list else None
