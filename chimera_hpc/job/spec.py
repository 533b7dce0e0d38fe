"""A sweep: a job file, validated and frozen."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    Field,
    PrivateAttr,
    StringConstraints,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from chimera_hpc.base import renaming
from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.renaming import with_new_names
from chimera_hpc.base.wording import short
from chimera_hpc.job import registry
from chimera_hpc.job.added import expand_added
from chimera_hpc.job.axes import Axis, Values
from chimera_hpc.job.chains import axis_names, check_chains, in_chains
from chimera_hpc.job.checks import (
    Grid,
    axes_of,
    check_added,
    check_nodes,
    check_points,
    check_tables,
    complete_fixed,
    parsed,
)
from chimera_hpc.job.continue_table import ContinueTable
from chimera_hpc.job.decide import Decide, check_first
from chimera_hpc.job.digest import explain_difference, spec_digest
from chimera_hpc.job.models import parameters_of
from chimera_hpc.job.network_table import NetworkTable
from chimera_hpc.job.networks import check_sizes, observed_sizes
from chimera_hpc.job.own_networks import OwnMaker, own_maker
from chimera_hpc.job.parameters import DELTA, DIRECTION, SEED, fixed_schema, grid_schema
from chimera_hpc.job.points import DTYPES, Points, Product, appended, expand
from chimera_hpc.job.reading import apply_overrides, bad, one_line, parse_toml, read_text
from chimera_hpc.job.selection import check_names, check_network_choices
from chimera_hpc.job.table import Line, Table
from chimera_hpc.job.tables import (
    Features,
    Integrator,
    Keep,
    Measures,
    Reduction,
    Run,
    Slurm,
)
from chimera_hpc.job.user_models import Origin
from chimera_hpc.models.parameters import Column, ModelParameters

_FOLDER_NAME = r"^[A-Za-z0-9_][A-Za-z0-9_.-]*$"
_KNOWN = {"model", "network"}


class Sweep(Table):
    """A sweep: its points, their integration and measures, and the reduction.

    Make one with `load`, `from_toml_text` or `from_dict`, which raise BadInput with one line.
    `grid` holds each axis in normal form (`normal_form` of `axes`; seeds last). `fixed` holds every
    other parameter of the model, with defaults. Two job files that mean the same sweep therefore
    give equal values.
    """

    name: Annotated[str, StringConstraints(pattern=_FOLDER_NAME, max_length=100)] = Field(
        description="Name of the sweep, and of its folder under results/."
    )
    title: Line | None = Field(None, description="Heading of figures and report.")
    model: str = Field(description="Name of the model.")
    network: NetworkTable | None = Field(
        None, validate_default=True, description="The network of oscillators."
    )
    decide: Decide | None = Field(
        None, description="Runs are spent until the modal class of each cell is decided."
    )
    grid: dict[str, Any] = Field(
        default_factory=dict,
        validate_default=True,
        description="Axes; their product is the list of cells, first axis slowest, seeds fastest.",
        json_schema_extra=grid_schema(),
    )
    fixed: dict[str, int | float] = Field(
        default_factory=dict,
        validate_default=True,
        description="Parameters of the model that are not axes.",
        json_schema_extra=fixed_schema(),
    )
    added: dict[str, list[int | float]] | None = Field(
        None,
        description="Cells beyond the grid, or with more seeds: a list per axis, and `seeds`, the "
        "number of seeds of each cell. [decide] writes it.",
    )
    integrator: Integrator = Field(default_factory=Integrator)
    continue_: ContinueTable | None = Field(
        None, alias="continue", description="Chains of points that go on from one another."
    )
    features: Features = Field(default_factory=Features)
    measures: Measures = Field(default_factory=Measures)
    reduction: Reduction = Field(default_factory=Reduction)
    keep: Keep = Field(default_factory=Keep, validate_default=True)
    run: Run = Field(default_factory=Run)
    slurm: Slurm = Field(default_factory=Slurm)
    _origin: Origin = PrivateAttr(default_factory=Origin)

    @classmethod
    def load(cls, path: str | Path, overrides: Sequence[str] = ()) -> Self:
        """Return the sweep of a job file, with KEY=VALUE overrides (`reading.apply_overrides`).

        The module of a user's model may be in the folder of the job file.
        """
        folder = Path(path).parent
        return cls.from_toml_text(read_text(path), overrides, where=str(path), folder=folder)

    @classmethod
    def from_toml_text(
        cls,
        text: str,
        overrides: Sequence[str] = (),
        where: str = "job file",
        folder: Path | None = None,
    ) -> Self:
        """Return the sweep that TOML text describes; `where` begins the messages of errors.

        The module of a user's model is also searched for in `folder`.
        """
        data = parse_toml(text, where)
        origin = Origin(() if folder is None else (os.path.abspath(folder),))
        data = apply_overrides(_with_new_names(data, "features."), overrides, origin)
        settings = "".join(f" --set {short(override)}" for override in overrides)
        where = f"{where} with{settings}" if settings else where
        sweep = cls.from_dict(data, where, origin)
        try:
            # A store may still name a method that was removed; a job may not.
            registry.method(sweep.integrator.method)
        except BadInput as error:
            raise BadInput(f"{where}: integrator.{error}") from None
        return sweep

    @classmethod
    def from_dict(cls, data: Any, where: str = "sweep", origin: Origin | None = None) -> Self:
        """Return the sweep of plain data as `to_dict` gives. Raises BadInput with one line.

        `origin` tells where a user's model comes from.
        """
        try:
            return cls.model_validate(_with_new_names(data), context=origin or Origin())
        except ValidationError as error:
            keys = [field.alias or name for name, field in cls.model_fields.items()]
            raise bad(where, one_line(error, keys)) from None

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON, with defaults. `from_dict` is the inverse."""
        return self.model_dump(mode="json", exclude_none=True, by_alias=True)

    @property
    def origin(self) -> Origin:
        """Where a user's model comes from."""
        return self._origin

    @property
    def parameters(self) -> ModelParameters:
        """The table of parameters of the model."""
        return parameters_of(self.model, self._origin, self.network)

    @property
    def own_network(self) -> OwnMaker | None:
        """A user's maker of networks, of a job with ``kind = "module:function"``."""
        if self.network is None or ":" not in self.network.kind:
            return None
        return own_maker(self.network.kind, self._origin)

    @property
    def has_own_code(self) -> bool:
        """Whether the model or the network is a user's, ``module:object``."""
        return ":" in self.model or (self.network is not None and ":" in self.network.kind)

    @property
    def signals(self) -> str:
        """Where the observed signal u lives: "nodes", "links" or "triangles"."""
        return "nodes" if self.network is None else self.network.signals

    @cached_property
    def n_observed(self) -> int:
        """Most nodes, links or triangles with a signal u of one point: the width of its arrays."""
        return self.n_nodes if self.signals == "nodes" else int(self.observed(self.points()).max())

    def observed(self, points: Points) -> NDArray[np.int64]:
        """Return how many nodes, links or triangles have a signal u, for each point."""
        return observed_sizes(self, points.columns)

    @property
    def pairs(self) -> str:
        """Over which pairs of nodes variations are taken: "ring", "links" or "order"."""
        return self.measures.pairs or ("ring" if self.network is None else "links")

    @property
    def n_nodes(self) -> int:
        return int(self.fixed["n_nodes"])

    @cached_property
    def axes(self) -> dict[str, Axis]:
        """Axes by the name of their column, in order of declaration, `seed` last."""
        return axes_of(self.parameters, parsed(self.grid), self.fixed)

    @property
    def seeds(self) -> range | tuple[float, ...]:
        """Seeds in order; `keep.series = "first-seed"` means the first of them."""
        seeds = self.axes["seed"]
        assert isinstance(seeds, Values)
        return seeds.values

    @property
    def n_samples(self) -> int:
        """Samples of the analysis: multiples of t_step from features.start to integrator.t_end."""
        step = self.integrator.t_step
        first = math.ceil(self.features.start / step - 1e-9)
        return math.floor(self.integrator.t_end / step + 1e-9) - first + 1

    @property
    def digest(self) -> str:
        """16 hexadecimal digits: 64-bit BLAKE2b of what decides the points and their numbers.

        It covers model, grid (with the order of the axes), fixed, integrator and features (what a
        preset sets, not its name) as canonical JSON, and measures unless they are the default.
        """
        return spec_digest(self.to_dict())

    def explain_difference(self, other: Sweep) -> list[str]:
        """Return one line per digested key with a different value in `other`, the stored sweep."""
        return explain_difference(self.to_dict(), other.to_dict())

    def points(self) -> Points:
        """Return all points. Axes are in order of declaration; the first varies slowest.

        Those of [added] that the grid has not come behind.
        """
        axes, chains = self.axes, self.continue_
        points = self._points_of(expand(axes) if chains is None else in_chains(axes, chains))
        if self.added is None:
            return points
        return appended(points, self._points_of(expand_added(self.added, points.axes[:-1])))

    @property
    def is_product(self) -> bool:
        """Whether the points are the product of the axes, in its order."""
        return self.added is None and self.continue_ is None

    @cached_property
    def _product(self) -> Product:
        return Product(self.axes)

    def stretch(self, first: int, stop: int) -> Points:
        """Return ``points()[first:stop]`` of a product without the other points."""
        return self._points_of(self._product.columns(first, stop))

    def _points_of(self, columns: dict[str, Column]) -> Points:
        """Return points by the columns of the axes, with what is fixed."""
        axes, chains = self.axes, self.continue_
        n_points = len(columns["seed"])
        model = self.parameters
        single = {**self.fixed, **model.constants, "delta": self.integrator.delta}
        kinds = {p.name: p.kind for p in (*model.parameters, DELTA, SEED)}
        kinds |= dict.fromkeys(model.constants, int)
        if chains is not None:
            kinds[DIRECTION.name] = DIRECTION.kind
        return Points(
            {
                name: columns[name].astype(DTYPES[kind], copy=False)
                if name in columns
                else np.broadcast_to(DTYPES[kind](single[name]), n_points)
                for name, kind in kinds.items()
            },
            tuple(axes) if chains is None else axis_names(axes, chains),
        )

    @field_validator("model")
    @classmethod
    def _check_model(cls, model: str, info: ValidationInfo) -> str:
        parameters_of(model, info.context)
        return model

    @field_validator("network")
    @classmethod
    def _check_network(
        cls, network: NetworkTable | None, info: ValidationInfo
    ) -> NetworkTable | None:
        plain = network is None or network == NetworkTable()
        if not plain and "model" in info.data:
            parameters_of(info.data["model"], info.context, network)
        return None if plain else network

    @field_validator("grid")
    @classmethod
    def _normalise_grid(cls, grid: dict[str, Any], info: ValidationInfo) -> dict[str, Any]:
        if not set(info.data) >= _KNOWN:
            return grid
        decide = info.data.get("decide")
        made = Grid.of(_parameters(info), {"seeds": decide.first, **grid} if decide else grid)
        check_first(made, decide)
        return made

    @field_validator("fixed", mode="before")
    @classmethod
    def _complete_fixed(cls, fixed: Any, info: ValidationInfo) -> Any:
        if not _is_table(fixed) or not _KNOWN | {"grid"} <= set(info.data):
            return fixed
        network = info.data["network"]
        if network is not None and network.nodes not in (None, fixed.get("n_nodes", network.nodes)):
            raise BadInput(
                f"fixed.n_nodes: {short(fixed['n_nodes'])}, but {network.file} has "
                f"{network.nodes} nodes"
            )
        return complete_fixed(_parameters(info), fixed, info.data["grid"])

    @field_validator("keep")
    @classmethod
    def _own_dtype(cls, keep: Keep, info: ValidationInfo) -> Keep:
        # Nothing is known of the size of a user's signals.
        return keep.with_dtype("float32") if ":" in info.data.get("model", "") else keep

    @model_validator(mode="after")
    def _check_all(self, info: ValidationInfo) -> Self:
        if self.has_own_code and info.context is not None:
            self._origin = info.context
        model, axes = self.parameters, self.axes
        check_points(model, axes, self.fixed)
        if self.added is not None:
            check_added(model, axes, self.fixed, self.added)
        if self.decide is not None:
            self.decide.check_axes(axes)
            self.decide.check_judge(self.reduction.atlas)
            if self.continue_ is not None:
                raise BadInput("decide: not with [continue], whose seeds are whole chains")
        if self.continue_ is not None and (self.decide or self.added) is not None:
            raise BadInput("decide: not with [continue], whose points need all of their chain")
        single = {name: Values((value,)) for name, value in self.fixed.items()}
        check_tables(self.integrator, self.features, model, {**single, **axes})
        if self.integrator.initial is not None and "delta" in axes:
            raise BadInput("grid.delta: integrator.initial gives the first states, without a ball")
        if self.continue_ is not None:
            check_chains(self.continue_, {**single, **axes}, self.run.block)
            if self.reduction.replay:
                raise BadInput(
                    "reduction.replay: with [continue] a point has no run of its own from t = 0; "
                    "reduction.show draws runs of the sweep"
                )
        check_nodes(self.features, self.n_nodes)
        if self.network is not None:
            check_sizes(self.network.kind, self.n_nodes, _values({**single, **axes}))
            check_network_choices(self.reduction.analyses)
            if self.signals != "nodes" and self.pairs != "links":
                raise BadInput(f'measures.pairs: "{self.pairs}" is for signals = "nodes"')
        own = model if ":" in self.model or self.network is not None else None
        check_names("reduction.show", self.reduction.show, own)
        check_names("reduction.replay", self.reduction.replay, own)
        return self


def _parameters(info: ValidationInfo) -> ModelParameters:
    """Return the table of parameters of the model and network that were validated before."""
    return parameters_of(info.data["model"], info.context, info.data["network"])


def _values(axes: Mapping[str, Axis]) -> dict[str, Any]:
    """Return the values of the axes that do not depend on others."""
    return {name: axis.values for name, axis in axes.items() if isinstance(axis, Values)}


def _with_new_names(data: Any, where: str = "") -> Any:
    """Return a job with settings under their new names. With `where`, warn of each old name."""
    features = data.get("features") if isinstance(data, dict) else None
    if not isinstance(features, dict):
        return data
    return {**data, "features": with_new_names(features, renaming.FEATURES, where)}


def _is_table(value: Any) -> bool:
    return isinstance(value, dict) and all(isinstance(key, str) for key in value)
