"""The rules that judge claims: small functions of the evidence, fixed before anything is run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from chimera_hpc.classify.robustness import wilson_interval
from scoreboard.decided import decided_cells, outcome_of
from scoreboard.evidence import (
    Cell,
    Evidence,
    Missing,
    base_of,
    family_of,
    select,
    wanted,
)

REPRODUCED, NOT_REPRODUCED, NOT_DECIDABLE = "reproduced", "not reproduced", "not decidable"


@dataclass(frozen=True)
class Finding:
    """What was found of one claim."""

    outcome: str
    measured: str
    low: float | None = None
    high: float | None = None
    """95 % interval, where what was measured is a fraction."""


Rule = Callable[..., Finding]


def verdict(holds: bool, measured: str) -> Finding:
    """Return a verdict without an interval."""
    return Finding(REPRODUCED if holds else NOT_REPRODUCED, measured)


def share(holds: bool, hits: int, trials: int, text: str = "") -> Finding:
    """Return a verdict on a fraction, with its Wilson interval."""
    low, high = (float(end) for end in wilson_interval(hits, trials))
    words = f"{hits} of {trials}" + (f": {text}" if text else "")
    return Finding(REPRODUCED if holds else NOT_REPRODUCED, words, low, high)


def cells_are(
    evidence: Evidence,
    job: str,
    cut: int,
    expect: Sequence[Mapping[str, Any]],
    at_least: int | None = None,
) -> Finding:
    """Cells have the modal class that is expected: all of them, or `at_least` so many.

    Each of `expect` has ``class`` and coordinates. Steady runs count as ordered.
    """
    cells, hits, wrong, total = evidence.cells(job, cut), 0, [], 0
    for entry in expect:
        where = {name: value for name, value in entry.items() if name != "class"}
        for cell in select(cells, where):
            total += 1
            if cell["family"] == entry["class"]:
                hits += 1
            else:
                place = ", ".join(f"{name} = {cell[name]:g}" for name in where)
                wrong.append(f"{place} is {cell['family']}")
    return share(hits >= (total if at_least is None else at_least), hits, total, "; ".join(wrong))


def only_there(
    evidence: Evidence, job: str, cut: int, axis: str, values: Any, of_class: str
) -> Finding:
    """No cell outside these values of an axis has the class (a class, or a numbered sub-class)."""
    numbered = of_class != base_of(of_class)
    key = "class" if numbered else "family"
    cells = evidence.cells(job, cut)
    those = [cell for cell in cells if cell[key] == of_class]
    if not those:
        return verdict(False, f"no cell is {of_class}")
    inside = [cell for cell in those if cell[axis] in wanted(values)]
    found = sorted({cell[axis] for cell in those})
    text = f"{of_class} at {axis} = {', '.join(f'{x:g}' for x in found)}"
    return share(len(inside) == len(those), len(inside), len(those), text)


def number(
    evidence: Evidence,
    job: str,
    path: str,
    at_least: float | None = None,
    at_most: float | None = None,
    above: float | None = None,
    below: float | None = None,
) -> Finding:
    """A number of results.json lies within bounds."""
    value = evidence.value(job, path)
    if value is None:
        return verdict(False, "there is no such value")
    holds = (at_least is None or value >= at_least) and (at_most is None or value <= at_most)
    holds = holds and (above is None or value > above) and (below is None or value < below)
    return verdict(holds, f"{value:.4g}")


def cluster_order(
    evidence: Evidence, job: str, cut: int, quantity: str, rising: Sequence[str]
) -> Finding:
    """The centroids of the classes rise in this order."""
    clusters = evidence.job(job)["cuts"][str(cut)]["clusters"]
    centre = {cluster["name"]: cluster["centroid"][quantity] for cluster in clusters}
    if not set(rising) <= set(centre):
        raise Missing(f"the job {job} has no classes {', '.join(rising)}")
    values = [centre[name] for name in rising]
    text = ", ".join(f"{name} {centre[name]:.3f}" for name in rising)
    return verdict(bool(np.all(np.diff(values) > 0)), f"{quantity}: {text}")


def splits(
    evidence: Evidence,
    job: str,
    step: int,
    is_class: str | None = None,
    never: str | None = None,
) -> Finding:
    """Which class parts at a step below three classes (1: four classes); or one never does."""
    order = [split["class"] for split in evidence.value(job, "clustering/order_of_splits")[:step]]
    if len(order) < step:
        raise Missing(f"the tree of {job} has too few leaves")
    text = "the first to split: " + ", then ".join(order)
    return verdict(order[-1] == is_class if never is None else never not in order, text)


def n_classes(evidence: Evidence, job: str, cut: int, count: int) -> Finding:
    """A cut has this many classes; counted, not asked for."""
    made = evidence.job(job)["cuts"]
    found = [len(c["clusters"]) for k, c in made.items() if str(cut) == k]
    if not found:
        kept = ", ".join(made)
        return verdict(False, f"the cuts there are have {kept} classes")
    return verdict(found[0] == count, f"{found[0]} classes")


def depth_gives(evidence: Evidence, job: str, depth: float, count: int) -> Finding:
    """A line across the tree at this depth makes so many classes."""
    made = evidence.job(job)["cuts"]
    at_depth = [cut for cut in made.values() if abs(cut["depth"] - depth) < 1e-9]
    found = len(at_depth[0]["clusters"]) if at_depth else 0
    text = ", ".join(f"{len(cut['clusters'])} at d = {cut['depth']:.2f}" for cut in made.values())
    return verdict(found == count, f"classes: {text}")


def sub_class_count(evidence: Evidence, job: str, cut: int, of_class: str, count: int) -> Finding:
    """A class has this many sub-classes in a cut."""
    clusters = evidence.job(job)["cuts"].get(str(cut), {}).get("clusters", [])
    names = [cluster["name"] for cluster in clusters]
    if len(names) < cut:
        raise Missing(f"the job {job} has no cut into {cut} classes")
    found = sum(base_of(name) == of_class for name in names)
    return verdict(found == count, f"classes: {', '.join(names)}")


def differ(evidence: Evidence, job: str, cut: int, first: Cell, second: Cell) -> Finding:
    """Two cells have different modal classes of one family."""
    cells = evidence.cells(job, cut)
    one, other = select(cells, first)[0], select(cells, second)[0]
    same_family = one["class"] and other["class"]
    same_family = same_family and base_of(one["class"]) == base_of(other["class"])
    holds = bool(same_family) and one["class"] != other["class"]
    return verdict(holds, f"{one['class']} and {other['class']}")


def triplet(
    evidence: Evidence, job: str, where: Cell, values: Sequence[float], quantities: Sequence[str]
) -> Finding:
    """Printed values lie within the middle 95 % of the runs of a cell, each for itself."""
    rows = evidence.value(job, "curves/variations/cells")
    row = select(rows, where)[0]
    if row["runs"] < 5:
        raise Missing(f"only {row['runs']} oscillating runs in the cell")
    inside, words = 0, []
    for name, value in zip(quantities, values, strict=True):
        low, median, high = (row[name][i] for i in (1, 3, 5))
        inside += low <= value <= high
        words.append(f"{name} {median:.4f} ({low:.4f} to {high:.4f}; paper {value:g})")
    return verdict(inside == len(values), "median (middle 95 %): " + ", ".join(words))


def rising_medians(evidence: Evidence, job: str, quantity: str, order: Sequence[Cell]) -> Finding:
    """The median of a quantity rises from cell to cell."""
    rows = evidence.value(job, "curves/variations/cells")
    medians = [select(rows, where)[0][quantity][3] for where in order]
    text = ", ".join(f"{median:.4f}" for median in medians)
    return verdict(bool(np.all(np.diff(medians) > 0)), f"medians {text}")


def still(evidence: Evidence, job: str, where: Cell, strictly: bool = False) -> Finding:
    """No run of a cell oscillates; strictly: none moves at all."""
    cells = select(evidence.value(job, "curves/oscillation/cells"), where)
    names = ("oscillating", "moving", "runs")
    fast, slow, runs = (sum(cell[name] for cell in cells) for name in names)
    hits = fast + slow if strictly else fast
    return share(hits == 0, hits, runs, f"{fast} oscillate, {slow} move slowly")


def safe_radius(
    evidence: Evidence,
    job: str,
    degrees: Any,
    at_least: float,
    at_most: float,
) -> Finding:
    """The largest radius up to which f = 1, as a median over these P, lies between bounds."""
    found = _radii(evidence, job, degrees)
    middle = float(np.median(found))
    text = f"R = {middle:.2f} ({min(found):.2f} to {max(found):.2f})"
    return verdict(at_least <= middle <= at_most, text)


def radii_compare(evidence: Evidence, job: str, larger: Any, smaller: Any) -> Finding:
    """The median largest radius with f = 1 is larger for some P than for others."""
    first, second = (float(np.median(_radii(evidence, job, d))) for d in (larger, smaller))
    return verdict(first > second, f"R = {first:.2f} against {second:.2f}")


def _radii(evidence: Evidence, job: str, degrees: Any) -> list[float]:
    entry = evidence.value(job, "curves/basin")
    known = dict(zip(entry["P"], entry["safe_radius"], strict=True))
    absent = [P for P in wanted(degrees) if P not in known]
    if absent:
        raise Missing(f"no P = {absent[0]} in {job}")
    return [known[P] if known[P] is not None else 0.0 for P in wanted(degrees)]


def basins_agree(
    evidence: Evidence, first: str, second: str, within: float, at_least: float
) -> Finding:
    """f(P, R) of two jobs differ by no more than `within` in a share of the cells."""
    one, other = (np.array(evidence.value(j, "curves/basin/fraction")) for j in (first, second))
    near = np.abs(one.astype(float) - other.astype(float)) <= within + 1e-12
    return share(bool(near.mean() >= at_least), int(near.sum()), int(near.size))


def judged(
    evidence: Evidence, job: str, where: Cell, is_class: str, exceptions: int = 0
) -> Finding:
    """Cells are judged by the atlas to be of a class, with so many exceptions.

    Steady runs count as ordered.
    """
    cells = select(_judged(evidence, job), where)
    right = [cell for cell in cells if cell["family"] == is_class]
    wrong = [cell for cell in cells if cell["family"] != is_class]
    axis = _axis(cells)
    text = "; ".join(f"{axis} = {cell[axis]:.3g} is {cell['family']}" for cell in wrong)
    return share(len(wrong) <= exceptions, len(right), len(cells), text)


def transition(
    evidence: Evidence, job: str, where: Cell, into: str, low: float, high: float
) -> Finding:
    """Along the axis the class changes into `into` for good between `low` and `high`.

    The transition is the middle between the last cell of another class and the next one.
    """
    cells = select(_judged(evidence, job), where)
    axis = _axis(cells)
    cells = sorted(cells, key=lambda cell: cell[axis])
    others = [i for i, cell in enumerate(cells) if cell["family"] != into]
    if not others or others[-1] + 1 == len(cells):
        return verdict(False, "there is no such change")
    last = others[-1]
    middle = 0.5 * (cells[last][axis] + cells[last + 1][axis])
    return verdict(low <= middle <= high, f"{axis} = {middle:.3g}")


def extreme_is(evidence: Evidence, job: str, where: Cell, axis: str, is_class: str) -> Finding:
    """The cell with the largest value of an axis is of a class."""
    last = max(select(_judged(evidence, job), where), key=lambda cell: cell[axis])
    text = f"{axis} = {last[axis]:.3g} is {last['family']} ({last['votes']})"
    return verdict(last["family"] == is_class, text)


def _judged(evidence: Evidence, job: str) -> list[dict[str, Any]]:
    judges = evidence.value(job, "curves/atlas/judges")
    cells = next(iter(judges.values()))
    return [{**cell, "family": family_of(cell["votes"], {})} for cell in cells]


def _axis(cells: Sequence[Cell]) -> str:
    names = [name for name in ("epsilon", "b", "sigma", "P") if name in cells[0]]
    varying = [name for name in names if len({cell[name] for cell in cells}) > 1]
    return varying[0] if varying else "P"


def decided(
    evidence: Evidence, job: str, where: Cell, axis: str, is_class: str, exceptions: int = 0
) -> Finding:
    """Cells with seeds until they are decided are of a class, with so many exceptions.

    It cannot be decided where cells that are still open tip it. Steady runs count as ordered.
    """
    right, wrong, still_open, text = decided_cells(evidence, job, where, axis, is_class)
    holds = outcome_of(wrong, still_open, exceptions)
    total = right + wrong + still_open
    if holds is None:
        return Finding(NOT_DECIDABLE, f"{right} of {total}, {still_open} open: {text}")
    return share(holds, right, total, text)


def share_of_chimeras(
    evidence: Evidence,
    job: str,
    flips: float,
    until: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
) -> Finding:
    """W at a number of reversed links, or everywhere from `flips` to `until`, is within bounds."""
    curve = _curve(evidence, job)
    x = np.array(curve["x"])
    if not (x == flips).any():
        raise Missing(f"no {flips:g} reversed links in {job}")
    chosen = (x >= flips) & (x <= (flips if until is None else until))
    hits, trials = (np.array(curve[name])[chosen] for name in ("hits", "trials"))
    fraction = hits / trials
    holds = at_least is None or bool((fraction >= at_least).all())
    holds = holds and (at_most is None or bool((fraction <= at_most).all()))
    text = f"chimeras; W from {fraction.min():.1f} to {fraction.max():.1f}"
    return share(holds, int(hits.sum()), int(trials.sum()), text)


def threshold_ratio(
    evidence: Evidence, first: str, second: str, at_least: float, at_most: float
) -> Finding:
    """Ratio of the numbers of reversed links at which W falls below one half."""
    one, other = (_curve(evidence, job)["half_at"] for job in (first, second))
    if one is None or other is None or not other:
        return verdict(False, f"W falls below 1/2 at {one} and {other}")
    text = f"{one:g} against {other:g}: {one / other:.2f}"
    return verdict(at_least <= one / other <= at_most, text)


def _curve(evidence: Evidence, job: str) -> dict[str, Any]:
    entry = evidence.value(job, "curves/robustness")
    curve: dict[str, Any] = entry["by"][entry["judge"]]
    return curve


def strength_is(evidence: Evidence, job: str, delta: float, where: Cell, is_class: str) -> Finding:
    """By the strength of incoherence the modal class of these cells is this one."""
    rows = _strengths(evidence, job, delta)
    chosen = select(rows, where)
    axis = next(iter(where))
    text = ", ".join(f"{axis} = {row[axis]:.3g}: {row['median']:.2f}" for row in chosen)
    hits = sum(row["class"] == is_class for row in chosen)
    return share(hits == len(chosen), hits, len(chosen), f"median SI {text}")


def _strengths(evidence: Evidence, job: str, delta: float) -> list[dict[str, Any]]:
    entry = evidence.value(job, "curves/incoherence")
    for made in entry["range"]["by_delta"]:
        if made["delta"] == delta:
            return [
                {**cell, **row, "class": row["class"]}
                for cell, row in zip(entry["cells"], made["rows"], strict=True)
            ]
    raise Missing(f"the job {job} has no delta = {delta}")


def methods_agree(evidence: Evidence, job: str, pair: int, at_least: int) -> Finding:
    """Two methods give at least so many cells the same modal class."""
    made = evidence.value(job, f"curves/agreement/pairs/{pair}")
    if made["cells"] < at_least:
        raise Missing(f"only {made['cells']} cells in {job}")
    text = f"cells; runs agree {made['agreement']:.2f}, kappa {made['kappa']:.2f}"
    return share(made["cells_equal"] >= at_least, made["cells_equal"], made["cells"], text)


def reoriented(evidence: Evidence, job: str, panel: int, count: int) -> Finding:
    """A drawing of the ring has this many reoriented links."""
    found = evidence.value(job, f"curves/networks/panels/{panel}/reoriented")
    return verdict(found == count, f"{found} links")


def orientation_without_effect(evidence: Evidence, within: float) -> Finding:
    """With b = 0 both orientations give the same u, when the links start from the same state.

    A link's signal changes its sign with the link's orientation. P = 12, 50 nodes, t to 5.
    """
    from chimera_hpc import Topology, simulate

    rng = np.random.default_rng(1)
    rings = [Topology.ring(50, 12, orientation) for orientation in (1, 2)]
    u, v = rng.uniform(-1, 1, 50), rng.uniform(-1, 1, 600)
    made = [
        simulate(ring, u0=u, v0=v * ring.link_signs, b=0.0, t_end=5.0, rtol=1e-10, atol=1e-12).u
        for ring in rings
    ]
    gap = float(np.abs(made[0] - made[1]).max())
    return verdict(gap <= within, f"largest difference {gap:.1e}")


def undecidable(evidence: Evidence, why: str) -> Finding:
    """The paper does not say enough to judge."""
    raise Missing(why)


RULES: dict[str, Rule] = {
    rule.__name__: rule
    for rule in (
        cells_are,
        only_there,
        number,
        cluster_order,
        splits,
        n_classes,
        depth_gives,
        sub_class_count,
        differ,
        triplet,
        rising_medians,
        still,
        safe_radius,
        radii_compare,
        basins_agree,
        judged,
        decided,
        transition,
        extreme_is,
        share_of_chimeras,
        threshold_ratio,
        strength_is,
        methods_agree,
        reoriented,
        orientation_without_effect,
        undecidable,
    )
}
