"""The fault harness: real processes, real signals, and a table of what became of the points.

``scripts/faults --trials 20`` runs each fault 20 times at random moments; ``--only TEXT,...`` those
with one of these texts in their name; ``--seed`` chooses the moments; ``--jobs`` how many trials
run at a time, for they mostly wait; ``--json FILE`` writes the table too; ``--brief`` runs one
trial of each fault, two where these are two different things.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parent))
from faults import FAULTS, Impossible
from lab import JOB, Child, Finding, Point, Stuck, Trial, fork, read_points

Reference = dict[Point, dict[str, Any]]
"""What an undisturbed run leaves of each point."""


@dataclass
class Outcome:
    """How one trial came out."""

    finding: Finding | None = None
    impossible: str = ""
    """Why this machine does not allow it."""
    seconds: float = 0.0


@dataclass
class Row:
    """All trials of one fault."""

    fault: str
    planned: int
    trials: int = 0
    lost: int = 0
    recomputed: int = 0
    """Most in one trial."""
    allowed: int = 0
    equal: int = 0
    seconds: float = 0.0
    problems: list[str] = field(default_factory=list)
    impossible: str = ""

    @property
    def good(self) -> bool:
        if self.impossible:
            return True
        held = self.recomputed <= self.allowed and self.equal == self.trials
        return held and self.lost == 0 and not self.problems

    def add(self, outcome: Outcome) -> None:
        self.trials += 1
        self.seconds += outcome.seconds
        self.impossible = self.impossible or outcome.impossible
        finding = outcome.finding
        if finding is not None:
            self.lost += finding.lost
            self.recomputed = max(self.recomputed, finding.recomputed)
            self.allowed = max(self.allowed, finding.allowed)
            self.equal += finding.equal
            self.problems += finding.problems

    def verdict(self) -> str:
        """Return a line for people, and one for each problem."""
        judged = self.impossible or ("as it should be" if self.good else "WRONG")
        line = f"{self.fault}: {self.trials} trials, {self.seconds:.0f} s, {judged}"
        return "\n  ".join([line, *self.problems])


def main() -> int:
    """Run the faults that were asked for, and print the table; 1 when any trial went wrong."""
    args = _arguments()
    texts = args.only.lower().split(",")
    names = [name for name in FAULTS if any(text in name.lower() for text in texts)]
    if not names:
        print(f"no fault has {args.only!r} in its name; known: {', '.join(FAULTS)}")
        return 2
    folder = Path(tempfile.mkdtemp(prefix="chimera-faults-", dir=args.folder))
    _import_everything(folder)
    reference = _reference(folder)
    least = {name: 1 + FAULTS[name].by_turns for name in names}
    rows = {name: Row(name, least[name] if args.brief else args.trials) for name in names}
    broken_off = False
    try:
        for name, outcome in _trials(rows, folder, reference, args):
            rows[name].add(outcome)
            if outcome.finding is not None and not outcome.finding.good:
                print(f"{name}: {outcome.finding}", flush=True)
            if rows[name].trials == rows[name].planned:
                print(rows[name].verdict(), flush=True)
    except KeyboardInterrupt:
        broken_off = True
    good = all(row.good for row in rows.values())
    if good:
        shutil.rmtree(folder, ignore_errors=True)
    else:
        print(f"the folders of the trials that went wrong are in {folder}")
    print(table(list(rows.values())))
    if args.json:
        made = [asdict(row) | {"good": row.good} for row in rows.values()]
        args.json.write_text(json.dumps(made))
    return 130 if broken_off else 0 if good else 1


def table(rows: list[Row]) -> str:
    """Return the table as Markdown."""
    head = ["fault", "trials", "points lost", "points recomputed", "digest equal", "s a trial"]
    lines = [head, ["---"] * len(head)]
    for row in rows:
        if row.impossible:
            lines.append([row.fault, "0", "", "", "", row.impossible])
            continue
        again = f"{row.recomputed} of {row.allowed} allowed"
        equal = f"{row.equal} of {row.trials}"
        mean = f"{row.seconds / max(1, row.trials):.1f}"
        lines.append([row.fault, str(row.trials), str(row.lost), again, equal, mean])
    widths = [max(len(line[k]) for line in lines) for k in range(len(head))]
    return "\n".join(
        "| " + " | ".join(w.ljust(n) for w, n in zip(line, widths, strict=True)) + " |"
        for line in lines
    )


def _trials(
    rows: dict[str, Row], folder: Path, reference: Reference, args: argparse.Namespace
) -> Iterator[tuple[str, Outcome]]:
    """Run all trials, some at a time, each from a process of its own; yield how they came out."""
    waiting = [(number, name) for name, row in rows.items() for number in range(row.planned)]
    waiting.sort(key=lambda trial: trial[0])
    running: dict[Child, tuple[str, Path]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < args.jobs:
                number, name = waiting.pop(0)
                place = folder / f"{name.replace(' ', '-')}-{number}"
                chance = random.Random(f"{args.seed} {name} {number}")
                output = folder / f"{place.name}.txt"
                work = partial(_trial, name, place, chance, number, reference)
                running[Child(fork(work, output, {}), output)] = (name, place)
            for child in [child for child in running if child.poll() is not None]:
                name, place = running.pop(child)
                yield name, _outcome(child, place)
            time.sleep(0.02)
    finally:
        # Each of them ends its own processes.
        for child in running:
            child.signal(signal.SIGINT)
        for child in running:
            child.wait()


def _trial(
    name: str, folder: Path, chance: random.Random, number: int, reference: Reference
) -> int:
    """Run one trial, and leave word of how it came out."""
    trial = Trial(folder, chance, number, reference)
    began = time.monotonic()
    try:
        outcome = Outcome(FAULTS[name](trial))
    except Impossible as error:
        outcome = Outcome(impossible=f"not run: {error}")
    except Stuck as error:
        outcome = Outcome(Finding(0, 0, 0, False, [*trial.problems, str(error)]))
    finally:
        trial.end()
    outcome.seconds = time.monotonic() - began
    _word(folder).write_text(json.dumps(asdict(outcome)))
    return 0


def _outcome(child: Child, folder: Path) -> Outcome:
    """Return how a trial came out that has ended; the folder of a good one is removed."""
    if child.code != 0:
        problem = f"the trial itself ended with {child.code}: {child.text()[-400:]}"
        return Outcome(Finding(0, 0, 0, False, [problem]))
    said = json.loads(_word(folder).read_text())
    finding = said.pop("finding")
    outcome = Outcome(finding and Finding(**finding), **said)
    if outcome.finding is None or outcome.finding.good:
        shutil.rmtree(folder, ignore_errors=True)
    return outcome


def _word(folder: Path) -> Path:
    return folder / "outcome.json"


def _reference(folder: Path) -> Reference:
    """Run the sweep without a disturbance, and return what is in its store."""
    trial = Trial(folder / "reference", random.Random(0), 0, {})
    trial.resume()
    if trial.problems:
        raise SystemExit("\n".join(trial.problems))
    return read_points(trial.store, trial.folder)


def _import_everything(folder: Path) -> None:
    """Import and compile here, so that the processes forked later have it; start no thread."""
    import distributed
    import sklearn.preprocessing

    import chimera_hpc.reduction
    import chimera_hpc.reduction.selection
    import chimera_hpc.run.executors
    import chimera_hpc.run.local_cluster
    import chimera_hpc.run.worker
    import chimera_hpc.store.merge
    import chimera_hpc.sweep
    from chimera_hpc.job import Sweep
    from chimera_hpc.run.block import warm_up

    assert all((distributed, sklearn.preprocessing, chimera_hpc))
    sweep = Sweep.from_toml_text(JOB)
    warm_up(sweep, sweep.points())


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="scripts/faults", description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=2, help="trials a fault (default: 2)")
    parser.add_argument("--brief", action="store_true", help="one trial a fault, or two")
    parser.add_argument("--only", default="", metavar="TEXT,...",
                        help="faults with one of these in their name")  # fmt: skip
    parser.add_argument("--jobs", type=int, default=4, help="trials at a time (default: 4)")
    parser.add_argument("--seed", type=int, default=0, help="chooses the moments")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the table here too")
    parser.add_argument("--folder", type=Path, help="where to work (default: a temporary folder)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
