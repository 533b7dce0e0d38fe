"""Checks across the keys of a job: known names, complete parameters, limits, size."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import prod
from typing import Any, TypeVar

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import nearest, short
from chimera_hpc.job.added import SEEDS, cells_of, check_columns
from chimera_hpc.job.axes import Axis, Values, normal_form, parse_axis, references, resolve
from chimera_hpc.job.networks import NETWORK_SEED
from chimera_hpc.job.parameters import DELTA, SEED, SEED_COUNT
from chimera_hpc.job.points import expand, refuse_huge
from chimera_hpc.job.tables import Features, Integrator, unknown_key
from chimera_hpc.models.parameters import Column, Limit, ModelParameters, Parameter

Fixed = Mapping[str, int | float]
Result = TypeVar("Result")
MAX_SAMPLES = 10**9
"""Most samples of one point's analysis."""


class Grid(dict[str, Any]):
    """The table [grid] in normal form, `seeds` last, with its parsed axes."""

    parsed: Mapping[str, Axis]
    """By the names in the table. References to other parameters are not yet replaced."""

    @classmethod
    def of(cls, model: ModelParameters, raw: Mapping[str, Any]) -> Grid:
        """Parse every axis once; `seeds` defaults to 1. Raises BadInput for a wrong axis."""
        if "n_nodes" in raw:
            raise BadInput("grid.n_nodes: one for a whole sweep; set it in [fixed]")
        raw = _with_realisations(raw)
        parsed = {
            name: _parse(name, value, axis_parameter(model, name))
            for name, value in raw.items()
            if name != "seeds"
        }
        seeds = parse_seeds(raw.get("seeds", 1))
        grid = cls({name: normal_form(axis) for name, axis in parsed.items()})
        count, normal = len(seeds.values), normal_form(seeds)
        grid["seeds"] = count if normal == normal_form(Values(range(count))) else normal
        grid.parsed = {**parsed, "seeds": seeds}
        return grid


def _with_realisations(raw: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return [grid] with a count of networks written as a range: n means 0 to n - 1."""
    name = NETWORK_SEED.name
    if type(raw.get(name)) is not int:
        return raw
    count = int(_at(f"grid.{name}", SEED_COUNT.check, raw[name]))
    return {**raw, name: [0] if count == 1 else f"0:{count - 1}"}


def parsed(grid: Mapping[str, Any]) -> Mapping[str, Axis]:
    """Return the axes of a validated table [grid]."""
    assert isinstance(grid, Grid)
    return grid.parsed


def complete_fixed(
    model: ModelParameters, fixed: Mapping[str, Any], axes: Mapping[str, Any]
) -> Fixed:
    """Return n_nodes and every parameter that is not an axis, with defaults."""
    known = {parameter.name: parameter for parameter in (model.n_nodes, *model.parameters)}
    for name in fixed:
        if name not in known:
            raise BadInput(unknown_key("fixed", name, list(known)))
        if name in axes:
            raise BadInput(
                f"fixed.{name}: {name} is an axis in [grid] already, set it in one of them"
            )
    complete = {}
    for name, parameter in known.items():
        if name in axes:
            continue
        value = fixed.get(name, parameter.default)
        if value is None:
            raise BadInput(
                f"grid.{name}: missing; {name} must be an axis in [grid] or set in [fixed]"
            )
        complete[name] = _at(f"fixed.{name}", parameter.check, value) + 0  # + 0: no -0.0
    return complete


def axes_of(model: ModelParameters, grid: Mapping[str, Axis], fixed: Fixed) -> dict[str, Axis]:
    """Return the axes by the name of their column, `seed` last.

    References to fixed parameters are replaced by their values. Raises BadInput for a name that is
    neither an axis nor fixed, or that has the wrong type.
    """
    axes: dict[str, Axis] = {}
    for name, read in grid.items():
        if name == "seeds":
            continue
        parameter = axis_parameter(model, name)
        axis = _at(f"grid.{name}", resolve, read, fixed, parameter)
        for other in references(axis):
            if other not in grid or other == "seeds":
                known = [key for key in (*grid, *fixed) if key not in ("seeds", name)]
                raise BadInput(f"grid.{name}: {other} is not an axis{nearest(other, known)}")
            if parameter.kind is int and axis_parameter(model, other).kind is float:
                raise BadInput(f"grid.{name}: must be integers, and {other} is not")
        axes[name] = axis
    return {**axes, "seed": grid["seeds"]}


def axis_parameter(model: ModelParameters, name: str) -> Parameter:
    """Return the parameter of an axis: one of the model, or the radius `delta`."""
    parameter = DELTA if name == "delta" else model.find(name)
    if parameter is None:
        known = [*(p.name for p in model.parameters), "delta", "seeds"]
        raise BadInput(unknown_key("grid", name, known))
    return parameter


def parse_seeds(raw: Any) -> Values:
    """Return the seeds of a count n (0 to n - 1), a list or a range. Raises BadInput otherwise."""
    if type(raw) is int:
        return Values(range(int(_at("grid.seeds", SEED_COUNT.check, raw))))
    axis = _parse("seeds", raw, SEED)
    if not isinstance(axis, Values):
        raise BadInput(
            f"grid.seeds: {short(raw)} is neither a count, a list nor a range of integers"
        )
    return axis


def check_points(model: ModelParameters, axes: Mapping[str, Axis], fixed: Fixed) -> None:
    """Raise BadInput for a point beyond the model's limits and for too many points.

    Only the axes that occur in limits and in dependent axes are multiplied out, which keeps the
    check of a very large grid cheap.
    """
    limited = {name for limit in model.limits for name in (limit.name, *limit.needs)}
    linked = {name for axis in axes.values() for name in references(axis)}
    linked |= limited | {name for name, axis in axes.items() if references(axis)}
    single = {name: Values((int(fixed[name]),)) for name in limited if name in fixed}

    def check(name: str, columns: Mapping[str, Column]) -> None:
        if name in axes and references(axes[name]):
            parameter = axis_parameter(model, name)
            for value in (columns[name].min(), columns[name].max()):
                _at(f"grid.{name}", parameter.check, value.item())
        for limit in model.limits:
            mine = {limit.name, *limit.needs}
            if name in mine and mine <= set(columns):
                _check_limit(limit, columns, int(fixed["n_nodes"]), fixed)

    linked_axes = {name: axis for name, axis in axes.items() if name in linked}
    rows = expand({**single, **linked_axes}, check)
    free = [axis for name, axis in axes.items() if name not in linked]
    n_rows = max(map(len, rows.values()), default=1)
    refuse_huge(n_rows * prod(len(axis.values) for axis in free if isinstance(axis, Values)))


def check_added(
    model: ModelParameters, axes: Mapping[str, Axis], fixed: Fixed, added: Mapping[str, Any]
) -> None:
    """Raise BadInput for an incomplete table [added], or a cell beyond the model's limits."""
    names = [name for name in axes if name != "seed"]
    check_columns(added, names)
    for name in names:
        parameter = axis_parameter(model, name)
        for value in set(added[name]):
            _at(f"added.{name}", parameter.check, value)
    columns: dict[str, Column] = cells_of(added, names)
    whole = {name: np.full(len(added[SEEDS]), value) for name, value in fixed.items()}
    for limit in model.limits:
        if limit.name in columns or any(name in columns for name in limit.needs):
            _check_limit(limit, {**whole, **columns}, int(fixed["n_nodes"]), fixed, "added")


def check_tables(
    integrator: Integrator, features: Features, model: ModelParameters, axes: Mapping[str, Axis]
) -> None:
    """Raise BadInput for settings that contradict each other or the model."""
    length = integrator.t_end - features.start
    if length <= 0:
        text = f"is outside the run, it must be below integrator.t_end = {integrator.t_end:g}"
        raise BadInput(f"features.start: {features.start:g} {text}")
    if not length / MAX_SAMPLES <= integrator.t_step <= length:
        text = f"is not between 1 / {MAX_SAMPLES:.0e} and all of the analysis, {length:g} long"
        raise BadInput(f"integrator.t_step: {integrator.t_step:g} {text}")
    if integrator.form not in model.forms:
        raise BadInput(f"integrator.form: this model has only {', '.join(model.forms)}")
    if integrator.centre != "origin":
        c = axes.get("c")
        if not isinstance(c, Values) or 0 in c.values:
            text = f"{integrator.centre} has v = -b/c, so the model must have a c, not 0"
            raise BadInput(f"integrator.centre: {text}")


def check_nodes(features: Features, n_nodes: int) -> None:
    """Raise BadInput for a node outside the ring, and for more groups than nodes."""
    if features.reference_node >= n_nodes:
        text = f"is outside the ring, 0 to {n_nodes - 1} is allowed"
        raise BadInput(f"features.reference_node: {features.reference_node} {text}")
    if features.groups > n_nodes:
        raise BadInput(f"features.groups: {features.groups} is more than n_nodes = {n_nodes}")


def _check_limit(
    limit: Limit,
    columns: Mapping[str, Column],
    n_nodes: int,
    fixed: Fixed,
    home: str = "grid",
) -> None:
    highest = np.broadcast_to(limit.highest(columns, n_nodes), columns[limit.name].shape)
    beyond = columns[limit.name] > highest
    if beyond.any():
        row = int(np.argmax(beyond))
        table = "fixed" if limit.name in fixed else home
        given = "".join(f", {name} = {columns[name][row]}" for name in limit.needs)
        raise BadInput(
            f"{table}.{limit.name}: {columns[limit.name][row]} is too large, at most {highest[row]}"
            f" is allowed ({limit.text}; n_nodes = {n_nodes}{given})"
        )


def _parse(name: str, raw: Any, parameter: Parameter) -> Axis:
    return _at(f"grid.{name}", parse_axis, raw, parameter)


def _at(key: str, function: Callable[..., Result], *arguments: Any) -> Result:
    """Call the function. Put the key in front of the message of its BadInput."""
    try:
        return function(*arguments)
    except BadInput as error:
        raise BadInput(f"{key}: {error}") from None
