"""The fault harness: real processes, real signals, and a table of what became of the points.

``scripts/faults --trials 20`` runs each fault 20 times at random moments; ``--only TEXT`` those
with this text in their name; ``--seed`` chooses the moments; ``--json FILE`` writes the table too.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from faults import FAULTS, Impossible
from lab import JOB, Finding, Stuck, Trial, read_points


@dataclass
class Row:
    """All trials of one fault."""

    fault: str
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
        held = self.recomputed <= self.allowed and self.equal == self.trials
        return held and self.lost == 0 and not self.problems

    def add(self, finding: Finding) -> None:
        self.trials += 1
        self.lost += finding.lost
        self.recomputed = max(self.recomputed, finding.recomputed)
        self.allowed = finding.allowed
        self.equal += finding.equal
        self.problems += finding.problems


def main() -> int:
    """Run the faults that were asked for, and print the table; 1 when any trial went wrong."""
    args = _arguments()
    names = [name for name in FAULTS if args.only.lower() in name.lower()]
    if not names:
        print(f"no fault has {args.only!r} in its name; known: {', '.join(FAULTS)}")
        return 2
    folder = Path(tempfile.mkdtemp(prefix="chimera-faults-", dir=args.folder))
    _import_everything(folder)
    reference = _reference(folder)
    rows = [_row(name, folder, reference, args) for name in names]
    if all(row.good for row in rows):
        shutil.rmtree(folder, ignore_errors=True)
    else:
        print(f"the folders of the trials that went wrong are in {folder}")
    print(table(rows))
    if args.json:
        args.json.write_text(json.dumps([asdict(row) | {"good": row.good} for row in rows]))
    return 0 if all(row.good for row in rows) else 1


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


def _row(
    name: str, folder: Path, reference: dict[tuple[int, int], dict[str, object]], args: object
) -> Row:
    row = Row(name)
    chance = random.Random(f"{args.seed} {name}")
    began = time.monotonic()
    for number in range(args.trials):
        trial = Trial(folder / f"{name.replace(' ', '-')}-{number}", chance, number, reference)
        try:
            row.add(FAULTS[name](trial))
        except Impossible as error:
            row.impossible = f"not run: {error}"
            break
        except Stuck as error:
            row.add(Finding(0, 0, 0, False, [str(error)]))
        finally:
            trial.end()
        if not trial.problems:
            shutil.rmtree(trial.folder, ignore_errors=True)
    row.seconds = time.monotonic() - began
    verdict = row.impossible or ("as it should be" if row.good else "WRONG")
    print(f"{name}: {row.trials} trials, {row.seconds:.0f} s, {verdict}", flush=True)
    for problem in row.problems:
        print(f"  {problem}", flush=True)
    return row


def _reference(folder: Path) -> dict[tuple[int, int], dict[str, object]]:
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

    import chimera_hpc.cluster
    import chimera_hpc.execute
    import chimera_hpc.outputs
    import chimera_hpc.outputs.selection
    import chimera_hpc.store.merging
    import chimera_hpc.sweep
    import chimera_hpc.worker
    from chimera_hpc.grid import Sweep
    from chimera_hpc.task import warm_up

    assert all((distributed, sklearn.preprocessing, chimera_hpc))
    sweep = Sweep.from_toml_text(JOB)
    warm_up(sweep, sweep.points())


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="scripts/faults", description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=2, help="trials a fault (default: 2)")
    parser.add_argument("--only", default="", metavar="TEXT", help="faults with this in their name")
    parser.add_argument("--seed", type=int, default=0, help="chooses the moments")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the table here too")
    parser.add_argument("--folder", type=Path, help="where to work (default: a temporary folder)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
