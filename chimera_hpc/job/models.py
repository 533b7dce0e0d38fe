"""The model that a job names: one of the registry, or a user's ``package.module:object``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import nearest, short
from chimera_hpc.job import registry
from chimera_hpc.job.networks import distinct, groups_of, on_network
from chimera_hpc.job.user_models import Origin, prints_to_stderr, user_model, user_source
from chimera_hpc.models.parameters import ModelParameters
from chimera_hpc.models.protocol import BuiltIn, Model, ModelKind
from chimera_hpc.network.sweep_network import network_of, pairs_of

if TYPE_CHECKING:
    from chimera_hpc.job.network_table import NetworkTable
    from chimera_hpc.job.spec import Sweep

MOST_TRIED = 100
"""Most networks that are made before a sweep starts, to find those that do not do."""


def model_kind(name: str, origin: Origin | None = None) -> ModelKind:
    """Return the model of this name. Raises BadInput for a name that is not in the registry.

    ``package.module:object`` is a user's model, see `user_models.user_model`.
    """
    if ":" in name:
        own: ModelKind = user_model(name, origin).kind
        return own
    if name not in registry.MODELS:
        known = nearest(name, list(registry.MODELS))
        raise BadInput(f"model: {short(name)} is not a known model{known}")
    found: ModelKind = registry.load(registry.MODELS[name])
    return found


def parameters_of(
    name: str, origin: Origin | None = None, network: NetworkTable | None = None
) -> ModelParameters:
    """Return the parameters of a model and of its network. Raises BadInput as `model_kind` does.

    Without `network`, those of a ring belong to the model's own table, or are added to it. Raises
    BadInput for a network with a model that does not live on networks.
    """
    if origin is not None and origin.table is not None:
        return origin.table
    kind = model_kind(name, origin)
    if network is not None and not getattr(kind, "on_network", None):
        raise BadInput(f"network: {short(name)} gets no network{_how(name)}")
    known = getattr(kind, "signals", ("nodes",))
    if network is not None and network.signals not in known:
        raise BadInput(f'network.signals: "{network.signals}": {short(name)} knows {known[0]} only')
    if not _general(kind, network):
        return kind.parameters
    return on_network(kind.parameters, network, origin)


def _how(name: str) -> str:
    return "; OwnModel(..., network=True) does" if ":" in name else ""


def _general(kind: ModelKind, network: NetworkTable | None) -> bool:
    """Tell whether a point is built on a `Network`, and not on the model's own ring."""
    own_ring = kind.parameters.find("P") is not None
    return bool(getattr(kind, "on_network", None)) and (network is not None or not own_ring)


def built_in() -> dict[str, ModelParameters]:
    """Return the tables of parameters of all models of the registry, by name."""
    return {name: parameters_of(name) for name in registry.MODELS}


def build(sweep: Sweep, row: Mapping[str, int | float]) -> Model:
    """Return the model of one point of a sweep, from its row of columns.

    A parameter that was added to a user's model after the sweep was planned has its default.
    """
    kind = model_kind(sweep.model, sweep.origin)
    if ":" not in sweep.model:
        if isinstance(kind, BuiltIn) and _general(kind, sweep.network):
            return kind.build_on(network_of(sweep, row), sweep, row)
        return kind.build(sweep, row)
    network = network_of(sweep, row) if _general(kind, sweep.network) else None
    defaults = {p.name: p.default for p in kind.parameters.parameters if p.default is not None}
    with prints_to_stderr():
        if network is not None:
            on_it: Callable[..., Model] = kind.point  # type: ignore[attr-defined]  # an OwnModel
            return on_it({**defaults, **row}, network.n_nodes, sweep.model, network)
        return kind.build(sweep, {**defaults, **row})


def try_networks(sweep: Sweep) -> None:
    """Build the model on the different networks of a sweep, `MOST_TRIED` of them at most.

    Raises BadInput for a network that cannot be made, that the model refuses, or that has not the
    pairs that variations need.
    """
    assert sweep.network is not None
    points, names = sweep.points(), distinct(sweep)
    first, _ = groups_of(points.columns, names)
    for i in sorted(first)[:MOST_TRIED]:
        row = points.row(i)
        try:
            model = build(sweep, row)
            _ = model.lane_group, model.lane_params  # the model checks the matrices that it uses
            pairs = pairs_of(sweep, row)
            if pairs is not None and not len(pairs):
                raise BadInput("no two of its signals are neighbours, so nothing varies")
            if model.n_nodes < max(sweep.features.groups, sweep.features.reference_node + 1):
                raise BadInput(
                    f"{model.n_nodes} {sweep.signals}: fewer than features.groups, or than "
                    "features.reference_node counts"
                )
        except BadInput as error:
            place = ", ".join(f"{name} = {row[name]}" for name in names)
            raise BadInput(f"network with {place}: {error}") from None


def model_folder(sweep: Sweep) -> str | None:
    """Return the folder of the module of a user's model or else network; None without either."""
    if not sweep.has_own_code:
        return None
    if sweep.origin.table is not None:
        return sweep.origin.folders[0]
    if ":" in sweep.model:
        found = user_source(sweep.model, sweep.origin)
    else:
        assert sweep.own_network is not None
        found = sweep.own_network.source
    return None if found is None else str(found.folder)
