"""Print the cost of an accepted step of a lane, in microseconds of processor time.

    PYTHONPATH=CHECKOUT python -P tests/bench/step_costs.py 3

Called by turns for checkouts that differ in one thing, it shows what that thing is worth. Each line
is a round of all cases; the first round, which compiles, is not printed.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from chimera_hpc.integrate.lanes import Control, Outcome, integrate
from chimera_hpc.job import Sweep
from chimera_hpc.job.models import build
from chimera_hpc.run.initial_state import initial_state

JOBS = Path(__file__).parents[2] / "jobs"
RING = ("P=12", "seeds=8")
CASES: dict[str, tuple[str, tuple[str, ...], int, float, float]] = {
    "ring of 50": ("quickstart", RING, 8, 600.0, 570.0),
    "the same, all sampled": ("quickstart", RING, 8, 60.0, 0.0),
    "ring of 2000": ("quickstart", (*RING, "fixed.n_nodes=2000"), 1, 25.0, 20.0),
    "networked": ("paper/networked", ("seeds=8",), 8, 20.0, 15.0),
}
"""Job, overrides, trajectories, end, and the time from which u is sampled every 0.01."""


def case(
    job: str, overrides: tuple[str, ...], n: int, end: float, start: float
) -> Callable[[], float]:
    """Return a call that integrates and gives the microseconds of a step."""
    sweep = Sweep.load(JOBS / f"{job}.toml", overrides)
    rows = [sweep.points().row(i) for i in range(n)]
    models = [build(sweep, row) for row in rows]
    pairs = zip(rows, models, strict=True)
    states = [m.state(*initial_state(sweep, row, m)) for row, m in pairs]
    control = Control(end, start, 0.01)

    def measure() -> float:
        steps = np.zeros(n, dtype=np.int64)

        def on_end(number: int, outcome: Outcome) -> None:
            steps[number] = outcome.steps

        began = time.thread_time()
        integrate(models, states, control, models[0].n_nodes, on_end)
        return 1e6 * (time.thread_time() - began) / int(steps.sum())

    return measure


def main() -> None:
    """Measure as many rounds as asked for."""
    cases = {name: case(*settings) for name, settings in CASES.items()}
    for number in range(1 + int(sys.argv[1])):
        found = ", ".join(f"{name} {measure():.4f}" for name, measure in cases.items())
        if number:
            print(found, flush=True)


if __name__ == "__main__":
    main()
