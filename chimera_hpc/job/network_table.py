"""The table [network] of a job."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    StringConstraints,
    ValidationInfo,
    model_validator,
)

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import nearest, short
from chimera_hpc.job.networks import KINDS
from chimera_hpc.job.table import Line, Table, as_tuple, found_in
from chimera_hpc.network.complex import SIGNALS
from chimera_hpc.network.sweep_network import RING, read_file


def _known_kind(value: str) -> str:
    if value not in KINDS and ":" not in value:
        raise BadInput(f"network.kind: {short(value)} is unknown{nearest(value, list(KINDS))}")
    return value


class NetworkTable(Table):
    """The network of oscillators; without this table, the paper's ring."""

    kind: Annotated[str, AfterValidator(_known_kind)] = Field(
        RING,
        description="Kind of network, or your own function module:function; its parameters are "
        "axes or fixed, like those of the model.",
        json_schema_extra={
            "anyOf": [{"enum": list(KINDS)}, {"pattern": ":", "description": "module:function"}]
        },
    )
    file: Line | None = Field(
        None,
        description='File of kind = "file", from the folder of the job: a list of edges, GraphML, '
        "GML, JSON, or a matrix.",
    )
    triangles: Literal["none", "cliques", "given"] = Field(
        "none",
        description="Triangles of the network: none, all triples of linked nodes, or those that "
        "the file or your function gives.",
    )
    signals: Literal["nodes", "links", "triangles"] = Field(
        "nodes", description="Where the observed signal u lives."
    )
    digest: Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{16}$")] | None = Field(
        None, description="Digest of the file, which the plan fills in."
    )
    sizes: Annotated[tuple[int, int, int] | None, BeforeValidator(as_tuple)] = Field(
        None, description="Nodes, links and triangles of the file, which the plan fills in."
    )

    @model_validator(mode="before")
    @classmethod
    def _read_file(cls, given: Any, info: ValidationInfo) -> Any:
        """Add path, digest and size of a file that a job names."""
        name = given.get("file") if isinstance(given, dict) else None
        if not isinstance(name, str) or given.get("kind") != "file" or given.get("digest"):
            return given
        path = found_in(name, info.context)
        try:
            network, digest = read_file(path)
            triangles = given.get("triangles", "none")
            if triangles == "cliques" or (triangles == "none" and network.n_triangles):
                network = network.with_triangles(triangles)
        except BadInput as error:
            raise BadInput(f"network.file: {error}") from None
        return {
            **given,
            "file": str(path),
            "digest": digest,
            "sizes": tuple(map(network.size, SIGNALS)),
        }

    @model_validator(mode="after")
    def _check_file(self) -> Self:
        if (self.kind == "file") != (self.file is not None):
            raise BadInput('network.file: needed with kind = "file", and only with that')
        if self.signals == "triangles" and self.triangles == "none":
            raise BadInput('network.signals: "triangles" needs triangles = "cliques"')
        if self.triangles == "given" and self.kind != "file" and ":" not in self.kind:
            raise BadInput('network.triangles: "given" is for a file or a function of yours')
        return self

    @property
    def nodes(self) -> int | None:
        """Number of nodes in the file."""
        return None if self.sizes is None else self.sizes[0]

    @property
    def spec(self) -> dict[str, Any]:
        """What of the table decides the numbers: all but where a file is."""
        return self.model_dump(mode="json", exclude={"file"}, exclude_none=True)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, NetworkTable) and self.spec == other.spec

    def __hash__(self) -> int:
        return hash(tuple(self.spec.items()))
