"""Tables of a job other than [grid] and [fixed]: each key with default, bounds and meaning."""

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
from chimera_hpc.job.continue_table import ContinueTable
from chimera_hpc.job.decide import Decide
from chimera_hpc.job.initial_file import read_initial
from chimera_hpc.job.network_table import NetworkTable
from chimera_hpc.job.registry import (
    DEFAULT_PANEL,
    MEASURES,
    METHODS,
    OTHER_NAMES,
    REMOVED_METHODS,
)
from chimera_hpc.job.selection import (
    check_analyses,
    check_figures,
    check_measures,
    check_selections,
)
from chimera_hpc.job.table import Line, Table, as_tuple, found_in
from chimera_hpc.measures.conventions import PRESETS


def _as_words(value: Any) -> Any:
    """Convert one name to a tuple of one name."""
    return (value,) if isinstance(value, str) else as_tuple(value)


def _names(value: Any) -> Any:
    names = as_tuple(value)
    if names == "triplet":
        return names
    words = isinstance(names, tuple) and all(isinstance(n, str) and n.isprintable() for n in names)
    if not words or not all(names) or len(set(names)) < max(2, len(names)):
        raise BadInput(
            f'reduction.names: {short(value)} is neither "triplet" nor a list of different names'
        )
    return names


def _different(value: tuple[int, ...]) -> tuple[int, ...]:
    if len(set(value)) < len(value):
        raise BadInput(f"reduction.cuts: {short(value)} holds a number twice")
    return value


def _known_method(value: str) -> str:
    if value not in METHODS and value not in REMOVED_METHODS:
        raise BadInput(
            f"integrator.method: {short(value)} is unknown{nearest(value, list(METHODS))}"
        )
    return value


Word = Annotated[
    str, StringConstraints(pattern=r"^[A-Za-z0-9_][A-Za-z0-9_.,:@+-]*$", max_length=200)
]
"""A name that needs no quoting in a shell."""
Texts = tuple[str, ...]
Lines = Annotated[tuple[Line, ...], BeforeValidator(as_tuple)]
Count = Annotated[int, Field(ge=1, le=10**9)]


class Integrator(Table):
    """How a point is integrated."""

    method: Annotated[str, AfterValidator(_known_method)] = Field(
        "tsit5",
        description="Runge-Kutta pair of order 5: tsit5 (the paper's) or dopri5.",
        json_schema_extra={"enum": list(METHODS)},
    )
    form: Literal["reduced", "full"] = Field(
        "reduced", description="Equations of nodes only (exact), or of nodes and links."
    )
    t_end: float = Field(1000.0, gt=0, description="End of the run; it begins at 0.")
    t_step: float = Field(0.01, gt=0, description="Sampling step of the series.")
    rtol: float = Field(1e-3, gt=0, description="Relative tolerance.")
    atol: float = Field(1e-6, gt=0, description="Absolute tolerance.")
    delta: float = Field(
        1e-3,
        ge=0,
        description="Radius of the ball of initial states; an axis delta in [grid] overrides it.",
    )
    centre: Literal["origin", "upper", "lower"] = Field(
        "origin",
        description="Centre of that ball: u = v = 0, or u = +sqrt(3) or -sqrt(3) with v = -b/c.",
    )
    ball: Literal["maximum", "euclidean"] = Field(
        "maximum", description="Norm of that ball; maximum: delta * U[-1, 1] for each variable."
    )
    initial: Line | None = Field(
        None,
        description="NumPy file .npz with initial states in place of that ball, in the folder of "
        "the job: arrays u (or phase) and v, (n,) for all points or (seeds, n), row s for seed s.",
    )
    initial_digest: Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{16}$")] | None = Field(
        None, description="Digest of that file, which the plan fills in."
    )
    max_steps: Count = Field(10_000_000, description="Most steps per point, with rejected ones.")
    time_out: float = Field(600.0, gt=0, description="Most wall time per point, in seconds.")

    @model_validator(mode="before")
    @classmethod
    def _read_initial(cls, given: Any, info: ValidationInfo) -> Any:
        """Add path and digest of a file that a job names."""
        name = given.get("initial") if isinstance(given, dict) else None
        if not isinstance(name, str) or given.get("initial_digest"):
            return given
        path = found_in(name, info.context)
        try:
            _, digest = read_initial(path)
        except BadInput as error:
            raise BadInput(f"integrator.initial: {error}") from None
        return {**given, "initial": str(path), "initial_digest": digest}

    @property
    def spec(self) -> dict[str, Any]:
        """What of the table decides the numbers: all but where a file is."""
        return self.model_dump(mode="json", exclude={"initial"})

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Integrator) and self.spec == other.spec

    def __hash__(self) -> int:
        return hash(tuple(self.spec.items()))


class Features(Table):
    """How features are computed from a series."""

    preset: Literal["default", "paper-printed"] = Field(
        "default",
        description="Sets the keys below that a job leaves out. default: windows of one reference "
        "node over the whole series; paper-printed: the convention behind the printed numbers.",
    )
    start: float = Field(
        950.0, ge=0, description="Start of the analysis; it ends at integrator.t_end."
    )
    n_peaks: int = Field(
        10, ge=3, le=10**6, description="Maxima of one window, both ends included."
    )
    n_overlap: int = Field(5, ge=0, description="Maxima that consecutive windows share.")
    max_windows: int = Field(
        0, ge=0, le=10**6, description="Number of windows, from the first; 0: all."
    )
    prominence: float = Field(
        0.0,
        ge=0,
        description="Least prominence of a maximum that counts, in the unit of u; 0: any.",
    )
    window_reference: Literal["ring", "own"] = Field(
        "ring",
        description="Maxima that define the windows: the reference node's, or each node's own.",
    )
    reference_node: int = Field(
        0, ge=0, description="Node (from 0) whose maxima define the windows of all nodes."
    )
    phase_mean: Literal["circular", "arithmetic"] = Field(
        "circular", description="Mean of the phases over windows."
    )
    refine: Literal["parabola", "sine-fit"] = Field(
        "parabola", description="How the frequency of the largest line is refined."
    )
    time_origin: Literal["window", "recording", "absolute"] = Field(
        "window",
        description="Time of a phase: the window's start, that of the analysis, or 0.",
    )
    steady: Literal["apart", "level"] = Field(
        "apart",
        description="Runs that do not oscillate: a separate class (apart), or clustered by the "
        "variation of their mean level along the ring (level).",
    )
    steady_threshold: float = Field(
        1e-2,
        ge=0,
        description="Mean standard deviation, in the unit of u, below which a run is steady.",
    )
    groups: int = Field(
        6,
        ge=1,
        description="Groups of nodes for the local deviations of the strength of incoherence.",
    )

    def options(self) -> dict[str, Any]:
        """Return the keyword arguments of `fourier_features` by name."""
        return self.model_dump(exclude={"preset", "start", "groups"})

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, given: Any) -> Any:
        """Add the settings of the preset. An unknown preset is left to the check of its field."""
        preset = given.get("preset") if isinstance(given, dict) else None
        if isinstance(preset, str) and preset in PRESETS:
            return {**PRESETS[preset], **given}
        return given

    @model_validator(mode="after")
    def _check_overlap(self) -> Self:
        if self.n_overlap >= self.n_peaks:
            text = f"{self.n_overlap} must be below features.n_peaks = {self.n_peaks}"
            raise BadInput(f"features.n_overlap: {text}")
        return self


class Measures(Table):
    """The measures of each run."""

    pairs: Literal["ring", "links", "order"] | None = Field(
        None,
        description='Pairs of nodes over which variations are taken: "ring", a node and the next; '
        '"links"; "order", consecutive nodes in the order of the network. Default: the ring\'s on '
        "the ring, otherwise links.",
    )
    panel: Annotated[tuple[str, ...], BeforeValidator(check_measures)] = Field(
        DEFAULT_PANEL,
        description="Measures, in the order of the store's scalars; variations come first.",
        json_schema_extra={"items": {"enum": [*MEASURES, *OTHER_NAMES], "type": "string"}},
    )


class Reduction(Table):
    """How the points are classified; not part of the digest."""

    linkage: Literal["ward", "average", "complete"] = Field(
        "ward", description="Distance between clusters."
    )
    classifier: Literal["agglomerative", "kmeans", "mixture", "hdbscan"] = Field(
        "agglomerative",
        description="Method that makes the classes: the tree; or scikit-learn's k-means, Gaussian "
        "mixture or HDBSCAN, which finds the number of classes by itself.",
    )
    cuts: Annotated[
        tuple[Annotated[int, Field(ge=2, le=1000)], ...],
        BeforeValidator(as_tuple),
        AfterValidator(_different),
    ] = Field((3, 4, 5), description="Numbers of clusters; each gives a cut.")
    depth: float | None = Field(
        None, gt=0, description="Distance at which the dendrogram is also cut."
    )
    names: Annotated[str | tuple[str, ...], BeforeValidator(_names)] = Field(
        "triplet",
        description='The rule "triplet", or a list of names by rising V_theta. Classes of other '
        "systems than the paper's ring under a preset are A, B, C, ... by the rule.",
    )
    show: Annotated[Texts, BeforeValidator(check_selections("reduction.show"))] = Field(
        (),
        description="Points to draw over the analysis interval with their Fourier indicators, each "
        'as "P=9 Q=9 seed=0": the first point with these values. Empty: one of each class.',
    )
    replay: Annotated[Texts, BeforeValidator(check_selections("reduction.replay"))] = Field(
        (),
        description="Points, of this sweep or not, to integrate again and to draw from 0 to t_end; "
        "values that are not given are those of the sweep's first point.",
    )
    figures: Annotated[str | Texts, BeforeValidator(check_figures)] = Field(
        "auto", description='"auto", all that have data, or a list of the names of figures.'
    )
    analyses: Annotated[Texts, BeforeValidator(check_analyses)] = Field(
        (), description="Names of the analyses whose results go into results.json."
    )
    atlas: Annotated[tuple[Line, ...], BeforeValidator(_as_words)] = Field(
        (),
        description="Reduced sweeps whose classes the runs get: folders next to this one, or "
        "paths. The first gives the classes, the others are a check.",
    )
    beside: Annotated[tuple[Line, ...], BeforeValidator(_as_words)] = Field(
        (), description="Sweeps whose curves are drawn with this one's: folders next to this one."
    )
    deltas: Annotated[tuple[Annotated[float, Field(ge=0)], ...], BeforeValidator(as_tuple)] = Field(
        (), description="Thresholds of the strength of incoherence."
    )
    order: Line = Field(
        "order_parameter",
        description="Scalar that serves as order parameter of chains, with [continue].",
    )
    delta_unit: Literal["range", "absolute"] = Field(
        "range", description="Unit of deltas: the range of u of each run, or the unit of u."
    )

    @model_validator(mode="after")
    def _check_cut(self) -> Self:
        if not self.cuts and self.depth is None:
            text = "empty; a number of clusters is needed, or reduction.depth"
            raise BadInput(f"reduction.cuts: {text}")
        return self


class Keep(Table):
    """Which time series the store keeps; not part of the digest."""

    series: Literal["all", "first-seed", "none"] = Field(
        "all", description="Points whose u is kept."
    )
    dtype: Literal["int16", "float32"] = Field(
        "int16",
        description="Type of the kept u; int16 counts steps of 1e-4, up to 3.2767. "
        "A user's model has float32 by default.",
    )

    def with_dtype(self, dtype: Literal["int16", "float32"]) -> Keep:
        """Return a copy with another default of `dtype`, which a job may override."""
        if "dtype" in self.model_fields_set:
            return self
        values = {**dict(self), "dtype": dtype}
        return Keep.model_construct(_fields_set={*self.model_fields_set}, **values)

    def fits(self, stored: Keep) -> bool:
        """Return whether a store keeps what a job asks for. A `dtype` that is not set fits any."""
        return self.with_dtype(stored.dtype) == stored


class Run(Table):
    """How the points are computed; not part of the digest."""

    block: int = Field(0, ge=0, le=10**8, description="Points per block; 0: chosen from the cost.")
    workers: int = Field(0, ge=0, le=10**6, description="Worker processes; 0: one per core.")
    attempts: int = Field(2, ge=1, le=100, description="Most tries of a point that fails.")
    tighten: float = Field(
        0.1, gt=0, le=1, description="Factor on rtol and atol at each further try."
    )
    patience: float = Field(
        60.0,
        ge=1,
        le=86400,
        description="Seconds without a sign of life after which a worker counts as lost.",
    )


class Slurm(Table):
    """Options for SLURM, passed on unchanged; not part of the digest."""

    partition: Word | None = Field(None, description="Partition (--partition).")
    account: Word | None = Field(None, description="Account (--account).")
    time: (
        Annotated[str, StringConstraints(pattern=r"^([0-9]+-)?[0-9]+(:[0-9]{2}){0,2}$")] | None
    ) = Field(
        None, description="Time limit of a job: minutes, hours:minutes:seconds or days-hours."
    )
    mem: Annotated[str, StringConstraints(pattern=r"^[1-9][0-9]*[KMGT]?$")] | None = Field(
        None, description="Memory of a worker, as 400M or 2G."
    )
    workers: Count | None = Field(None, description="Worker processes in all.")
    array: Count | None = Field(None, description="Elements of the job array.")
    at_once: Count | None = Field(
        None, description="Most elements of the job array that run at a time."
    )
    setup: Lines = Field((), description="Shell lines before the work: modules, environments.")
    extra: Lines = Field((), description="Further options of sbatch, one per line.")
    interface: Word | None = Field(None, description="Network interface of scheduler and workers.")


TABLES: dict[str, type[Table]] = {
    "decide": Decide,
    "network": NetworkTable,
    "integrator": Integrator,
    "continue": ContinueTable,
    "features": Features,
    "measures": Measures,
    "reduction": Reduction,
    "keep": Keep,
    "run": Run,
    "slurm": Slurm,
}


def unknown_key(table: str, key: str, known: list[str]) -> str:
    """Return the message for a key that `table` (empty for the top level) does not have.

    It names the table that has this key, else the nearest known key.
    """
    homes = {field: name for name, other in TABLES.items() for field in other.model_fields}
    home = {**homes, "seeds": "grid"}.get(key)
    hint = f"; it belongs in [{home}]" if home else nearest(key, known)
    return f"{table}{'.' if table else ''}{key[:60]}: unknown key{hint}"
