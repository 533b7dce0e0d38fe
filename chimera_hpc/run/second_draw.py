"""Builds points of a user's model again in a second process and compares them.

What differs between processes, such as a global random generator, an array that is drawn at import
or the order of a set, would give each worker another model.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.wording import short
from chimera_hpc.job import Sweep
from chimera_hpc.job.models import build
from chimera_hpc.job.user_models import Origin, prints_to_stderr, user_model
from chimera_hpc.models.source import PACKAGE
from chimera_hpc.run.initial_state import initial_state

_PARTS = ("the real parameters p", "the integers", "the initial state", "the initial state")
_RULE = "every random number must come from rng, the first argument of initial"
_RULE_OF_NETWORKS = "every random number must come from the argument seed"


def check_in_second_process(sweep: Sweep) -> None:
    """Build the first and the last point here and in a second process, and compare.

    Raises
    ------
    BadInput
        With what differs.
    """
    if not sweep.has_own_code:
        return
    rows = sorted({0, len(sweep.points()) - 1})
    here, there = drawn(sweep, rows), _drawn_elsewhere(sweep, rows)
    held = (here["holds"], there["holds"])
    other = [name for name in held[0] | held[1] if held[0].get(name) != held[1].get(name)]
    for one, two in zip(here["points"], there["points"], strict=True):
        other += [part for part, a, b in zip(_PARTS, one, two, strict=True) if a != b]
    if other:
        names = ", ".join(dict.fromkeys(other))
        rule = _RULE if ":" in sweep.model else _RULE_OF_NETWORKS
        raise BadInput(f"{_name(sweep)}: not the same in another process: {names}; {rule}")


def drawn(sweep: Sweep, rows: Sequence[int]) -> dict[str, Any]:
    """Return what the model holds, and the bytes of parameters and initial state of points."""
    points, found = sweep.points(), []
    for i in rows:
        row = points.row(i)
        model = build(sweep, row)
        parts = (model.lane_params, model.int_params, *initial_state(sweep, row, model))
        found.append([np.asarray(part).tobytes().hex() for part in parts])
    own = sweep.own_network
    holds = dict(own.held) if own is not None else {}
    if ":" in sweep.model:
        holds |= user_model(sweep.model, sweep.origin).held
    return {"holds": holds, "points": found}


def _name(sweep: Sweep) -> str:
    if ":" in sweep.model or sweep.network is None:
        return f"model: {short(sweep.model)}"
    return f"network.kind: {short(sweep.network.kind)}"


def _drawn_elsewhere(sweep: Sweep, rows: Sequence[int]) -> dict[str, Any]:
    paths = filter(None, (os.environ.get("PYTHONPATH"), str(PACKAGE.parent)))
    done = subprocess.run(
        [sys.executable, "-P", "-m", __name__],
        input=json.dumps([sweep.to_dict(), sweep.origin.folders, rows]),
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True,
        text=True,
        check=False,
    )
    try:
        found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    except (ValueError, IndexError):
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise BadInput(f"{_name(sweep)} does not work in another process: {last}") from None
    return found


def _main() -> None:
    spec, folders, rows = json.load(sys.stdin)
    with prints_to_stderr():
        sweep = Sweep.from_dict(spec, origin=Origin(tuple(folders)))
        found = drawn(sweep, rows)
    sys.stdout.write("\n" + json.dumps(found) + "\n")


if __name__ == "__main__":
    _main()
