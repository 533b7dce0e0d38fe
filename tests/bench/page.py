"""docs/performance.md and its pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from precision import Curve
from projection import Costs, Forecast
from reduction import Size
from single import Row, Scaling, nodes_in_second_cache


@dataclass
class Results:
    """Everything that was measured."""

    machine: str
    load: float
    rows: list[Row] = field(default_factory=list)
    precision: dict[str, Curve] = field(default_factory=dict)
    scaling: Scaling = field(default_factory=Scaling)
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
    parts += [_ERRORS, _WHY.format(nodes=nodes_in_second_cache())]
    if results.precision:
        parts += [_PICTURE, _PRECISION, precision_table(results.precision)]
    if results.scaling.nodes:
        parts += [_SCALING]
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
        head = [
            "run",
            "cores",
            "points",
            "points per block",
            "hours",
            "efficiency",
            "scheduler busy",
        ]
        lines = [
            [name, f"{f.cores:,}", f"{f.points:,}", str(f.block), f"{f.hours:.3f}",
             f"{f.efficiency:.1%}", f"{f.scheduler_load:.1%}" if f.scheduler_load else "none"]
            for name, f in results.forecasts
        ]  # fmt: skip
        parts += [table(head, lines), _AT_SCALE]
    return "\n\n".join(parts) + "\n"


def precision_table(curves: dict[str, Curve]) -> str:
    """Return what each method takes for some errors, between the tolerances that were measured."""
    lines = []
    for name, curve in curves.items():
        errors, seconds = (np.log(values) for values in zip(*sorted(curve), strict=True))
        at = np.interp(np.log(_PRICED), errors, seconds, left=np.nan, right=np.nan)
        lines.append([name, *("" if x != x else f"{1e3 * np.exp(x):.3g} ms" for x in at)])
    return table(["method", *(f"error {error:.0e}" for error in _PRICED)], lines)


def precision_picture(results: Results) -> Figure:
    """Draw work against precision."""
    figure = Figure(figsize=(7.6, 4.2), layout="constrained")
    axes = figure.subplots()
    for k, (name, curve) in enumerate(results.precision.items()):
        ours = name.startswith("ours")
        errors, seconds = zip(*curve, strict=True)
        axes.loglog(errors, seconds, "o-" if ours else "s--", ms=4, label=name, color=f"C{k}")
    axes.set_xlabel("largest error of u, t ≤ 20")
    axes.set_ylabel("seconds per trajectory (u every 0.01)")
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes.grid(alpha=0.3)
    return figure


def scaling_picture(scaling: Scaling) -> Figure:
    """Draw seconds against workers, points, nodes and coupling range, with the ideal lines."""
    figure = Figure(figsize=(9, 7), layout="constrained")
    workers, points, nodes, degrees = figure.subplots(2, 2).flat
    _measured(workers, scaling.workers, "the plane: workers", "s, whole command", power=-1)
    # Less than a decade: the logarithmic axis alone has no number there.
    seconds = [each for _, each in scaling.workers]
    workers.set_yticks(seconds, [f"{each:.0f}" for each in seconds])
    _measured(points, scaling.points, "two workers: points", "s, whole command", power=1, at=-1)
    whole = [(n, 1e6 * n * each) for n, each in scaling.nodes]
    _measured(nodes, whole, "P = 12: nodes", "µs per step and trajectory", power=1)
    steps = [(half, 1e6 * each) for half, each in scaling.degrees]
    _measured(degrees, steps, "50 nodes: P", "µs per step and trajectory, in lanes", power=0)
    degrees.set_ylim(bottom=0)
    return figure


def _measured(
    axes: Axes, curve: Sequence[tuple[int, float]], what: str, unit: str, power: int, at: int = 0
) -> None:
    # The ideal line goes through point `at`: the last one where only there start-up is hidden.
    if curve:
        x, seconds = (np.array(values, dtype=float) for values in zip(*curve, strict=True))
        draw = axes.loglog if power else axes.plot
        draw(x, seconds[at] * (x / x[at]) ** power, "k:", label="ideal")
        draw(x, seconds, "o-", label="measured")
        axes.set_xticks(x, [f"{value:,.0f}" for value in x], rotation=60 if len(x) > 6 else 0)
        axes.minorticks_off()
    axes.set_xlabel(what)
    axes.set_ylabel(unit)
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)


def write(results: Results, docs: Path) -> None:
    """Write page and pictures into the folder `docs`."""
    (docs / "performance.md").write_text(text(results))
    if results.precision:
        precision_picture(results).savefig(docs / "images" / "performance.png", dpi=110)
    if results.scaling.nodes:
        scaling_picture(results.scaling).savefig(docs / "images" / "scaling.png", dpi=110)


_HEAD = """# Measured performance

    scripts/bench --write

measures everything on this page. It installs the peers in `.venv-bench`.

* The programs of a row run in turns, and medians are compared. In rows with a peer, a turn takes at
  least one second.
* A whole command is compared with bare blocks, which are the same points without executor and
  store, in turns of one second. Bare blocks are compared with dgemm in turns of 0.1 s. One process
  is stopped while the other runs, and only its own turns count for each.
* A whole command is compared several times. The value is the median; the last column lists all.
* One core is used unless the row names workers.

Machine: {machine}; load average at the
start {load:.1f}."""

_WHY = """\
What limits the speed:

* Caches. The state of eight trajectories of 50 nodes is larger than the first-level cache. With 100
  to about 800 nodes it fits into the second level, whose bandwidth limits the sums over stages. The
  divisions in the error norm add latency. The networked model has the same limits. Above about
  800 nodes the trajectories are computed one at a time. From {nodes:,} nodes on (on this machine)
  one state is larger than the second-level cache, and the rest comes from the third level or from
  memory.
* Start and end. Python, the cluster, its workers, planning and the reduction take a few seconds for
  any number of points. At the end, one worker waits for the last block of the other.
* Virtual machines. Their speed may change by half within seconds, and medians of five turns change
  with it. A row whose value is near its target may meet it in one run and miss it in the next.
* Shared cores. A virtual core may be one of two hardware threads of a core, and another machine may
  use the second. Two processes then do less than twice the work of one. dgemm is therefore run in
  one and in two processes at the same moments as the blocks. The row "2 workers over 1" is given as
  measured, and the next row relative to dgemm."""

_ERRORS = """\
*Error* is the largest difference of u from a DOP853 solution at rtol 1e-13, up to t = 20; at later
times chaos amplifies any error. Peers run at rtol 1e-6. This package ("ours") runs at
the loosest tolerance whose error is not larger than theirs; the ratio at equal
tolerance is given too. Full form: the equations of nodes and links as the paper prints them, which
is what a user of the peers would write. Reduced form: the exact reduction that this package
uses."""

_PICTURE = """![Work against precision](images/performance.png)"""

_PRICED = (1e-2, 1e-4, 1e-6)
_PRECISION = """\
Tsit5 is the default method, as in the paper; a job or a call may choose another one. The table has
the time per trajectory of 20 time units, with u every 0.01, at some errors, interpolated between
the points of the picture:"""

_SCALING = """![Seconds against workers, points, nodes and P](images/scaling.png)"""

_REDUCTION = """## Reduction at scale

Above 4,000 oscillating runs, Ward's tree is computed in linear memory. Above 100,000 (10,000 with
average or complete linkage) it is computed from a deterministic sample that covers every region of
the triplets; each of the other runs takes the class of the nearest run of the sample. Times for the
triplets of the plane sweep, resampled:"""

_PROJECTION = """## 10,000 cores and 10 million points

No such machine was available. These figures come from a simulation of the run with costs measured
here: {point:.1f} ms per point, {worker:.1f} ms per block on the worker (claim, write, flush),
{scheduler:.2f} ms of processor time per block in the scheduler, {ledger:.0f} ns per point to read
the ledger."""

_AT_SCALE = """\
With a scheduler, its single thread is the first bottleneck: it can feed about (seconds per block) /
(scheduler seconds per block) cores. Job arrays (`slurm --mode array`) need no scheduler. They
lose the time of the last block of each core, and the time to read the ledger once. Neither
simulation includes the file system: each block is five files and a claim, and a metadata server has
its own limits."""
