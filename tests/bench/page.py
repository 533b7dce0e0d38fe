"""docs/performance.md and its picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from matplotlib.figure import Figure
from precision import Curve
from projection import Costs, Forecast
from reduction import Size
from single import Row


@dataclass
class Results:
    """Everything that was measured."""

    machine: str
    load: float
    rows: list[Row] = field(default_factory=list)
    precision: dict[str, Curve] = field(default_factory=dict)
    nodes: list[tuple[int, float]] = field(default_factory=list)
    sizes: list[Size] = field(default_factory=list)
    costs: Costs | None = None
    forecasts: list[tuple[str, Forecast]] = field(default_factory=list)


def table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    return "\n".join(
        "| " + " | ".join(words) + " |" for words in [head, ["---"] * len(head), *lines]
    )


def text(results: Results) -> str:
    """Return the page."""
    parts = [_HEAD.format(machine=results.machine, load=results.load)]
    parts.append(
        table(
            ["measured", "value", "target", "held", "how it comes about"],
            [row.words() for row in results.rows],
        )
    )
    parts.append(_ERRORS)
    if results.precision:
        parts += [_PICTURE]
    if results.sizes:
        parts += [_REDUCTION, table(["points", "leaves of the tree", "s", "labels equal"], [
            [f"{size.points:,}", f"{size.leaves:,}", f"{size.seconds:.2f}",
             "" if size.agreement != size.agreement else f"{size.agreement:.4f}"]
            for size in results.sizes
        ])]  # fmt: skip
    if results.costs:
        costs = results.costs
        parts.append(
            _PROJECTION.format(
                point=1e3 * costs.point,
                worker=1e3 * costs.block_on_worker,
                scheduler=1e3 * costs.block_on_scheduler,
                ledger=1e9 * costs.point_of_ledger,
            )
        )
        head = ["run", "cores", "points", "points a block", "hours", "efficiency", "scheduler busy"]
        lines = [
            [name, f"{f.cores:,}", f"{f.points:,}", str(f.block), f"{f.hours:.3f}",
             f"{f.efficiency:.1%}", f"{f.scheduler_load:.1%}" if f.scheduler_load else "none"]
            for name, f in results.forecasts
        ]  # fmt: skip
        parts += [table(head, lines), _LIMITS]
    return "\n\n".join(parts) + "\n"


def picture(results: Results) -> Figure:
    """Draw work against precision, and cost against the number of nodes."""
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    for k, (name, curve) in enumerate(results.precision.items()):
        ours = name.startswith("ours")
        errors, seconds = zip(*curve, strict=True)
        left.loglog(errors, seconds, "o-" if ours else "s--", ms=4, label=name, color=f"C{k}")
    left.set_xlabel("largest error of u, t ≤ 20")
    left.set_ylabel("seconds a trajectory (u every 0.01)")
    left.set_title("(a) work against precision, P = 12", loc="left")
    left.legend(fontsize=7)
    if results.nodes:
        nodes, costs = zip(*results.nodes, strict=True)
        right.loglog(nodes, [n * c * 1e6 for n, c in results.nodes], "o-", label="measured")
        right.loglog(nodes, [n * costs[0] * 1e6 for n in nodes], "k:", label="linear")
        right.set_xlabel("nodes")
        right.set_ylabel("µs a step and trajectory, in lanes")
        right.set_title("(b) cost of a step", loc="left")
        right.legend(fontsize=8)
    for axes in (left, right):
        axes.grid(alpha=0.3)
    return figure


def write(results: Results, docs: Path) -> None:
    """Write page and picture into the folder `docs`."""
    (docs / "performance.md").write_text(text(results))
    if results.precision:
        picture(results).savefig(docs / "images" / "performance.png", dpi=110)


_HEAD = """# Measured performance

    scripts/bench --write

measures all of this in one run, with the peers installed beside (`.venv-bench`). Medians of
interleaved repeats; one core unless workers are named. Machine: {machine}; load average at the
start {load:.1f}."""

_ERRORS = """\
*Error* is the largest difference of u from a DOP853 solution at rtol 1e-13, up to t = 20
(later, chaos has made everything of it). Peers run at rtol 1e-6; ours runs at the loosest
tolerance whose error is not larger than theirs, and what comes out at equal tolerance stands
beside. Full form: nodes and links as the paper prints them, which is what a user of the peers
would write; reduced form: the exact reduction that this package uses."""

_PICTURE = """![Work against precision, cost against nodes](images/performance.png)"""

_REDUCTION = """## Reduction at scale

Ward's tree is grown in linear memory (fastcluster); beyond 50,000 oscillating runs (10,000 with
average or complete linkage) it grows over a sample without chance that covers every region of
the triplets, and the others take the class of their nearest sampled run. Triplets of the plane
sweep, resampled:"""

_PROJECTION = """## 10,000 cores and 10 million points

No such machine was at hand: this is a simulation of the run, fed with what was measured here:
{point:.1f} ms a point, {worker:.1f} ms a block on the worker (claim, write, flush),
{scheduler:.2f} ms a block of the scheduler's processor time, {ledger:.0f} ns a point to read
the ledger."""

_LIMITS = """\
With the scheduler, its one thread is the first bottleneck: it hands out a block in the time
above, so that about (seconds a block) / (that time) cores can be fed. Job arrays (`slurm --mode
array`) know no scheduler; what is lost there is the last block of each core and reading the
ledger once. What neither shows is the file system: each block is four files and a claim, and a
metadata server has its own limits."""
