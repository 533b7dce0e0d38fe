"""The points that a job asks to be drawn: points of the sweep, or others that are computed."""

from __future__ import annotations

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import nearest
from chimera_hpc.job import Points, Sweep
from chimera_hpc.job.selection import parse_selection

MOST_SAMPLES = 20_000
"""Samples of a whole run; a longer one is sampled more coarsely."""


def check_selections(sweep: Sweep, points: Points) -> None:
    """Raise BadInput unless ``reduction.show`` and ``reduction.replay`` suit the model.

    A point to show need not be in the sweep: one that is not is left out when the sweep is drawn.
    """
    for text in sweep.reduction.show:
        for name in parse_selection(text, "reduction.show"):
            if name not in points.columns:
                known = nearest(name, list(points.columns))
                raise BadInput(f"reduction.show: {text}: this model has no {name}{known}")
        find_point(points, text)
    for text in sweep.reduction.replay:
        single_point(sweep, points.row(0), text)


def find_point(points: Points, text: str) -> int | None:
    """Return the first point that a text of ``reduction.show`` selects, None when there is none."""
    try:
        found = points.find(**parse_selection(text, "reduction.show"))
    except BadInput as error:
        raise BadInput(f"reduction.show: {text}: {error}") from None
    return int(found[0]) if len(found) else None


def single_point(sweep: Sweep, first: dict[str, int | float], text: str) -> Sweep:
    """Return a sweep of the one selected point, sampled from 0 to t_end; BadInput if impossible.

    Values that the selection does not name are those of `first`, a point of the sweep.
    """
    chosen = parse_selection(text, "reduction.replay")
    values = first | chosen
    data = sweep.to_dict()
    names = [parameter.name for parameter in sweep.parameters.parameters]
    alien = {name: x for name, x in chosen.items() if name not in (*names, "seed", "delta")}
    t_end, t_step = sweep.integrator.t_end, sweep.integrator.t_step
    data |= {
        "grid": {"seeds": [values["seed"]], "delta": [values["delta"]]},
        "fixed": {"n_nodes": sweep.n_nodes} | {name: values[name] for name in names} | alien,
        "integrator": data["integrator"] | {"t_step": max(t_step, t_end / MOST_SAMPLES)},
        "features": data["features"] | {"start": 0.0},
    }
    return Sweep.from_dict(data, f"reduction.replay: {text}", sweep.origin)
