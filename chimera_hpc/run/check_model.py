"""Tests of a user's model before a sweep."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.errors import BadInput
from chimera_hpc.base.foreign import foreign_code
from chimera_hpc.base.wording import short
from chimera_hpc.integrate.simd import LANES
from chimera_hpc.integrate.stepper import RIGHT_HAND_SIDE
from chimera_hpc.job import Sweep
from chimera_hpc.job.models import build
from chimera_hpc.models.protocol import Model, Row
from chimera_hpc.run.initial_state import initial_state
from chimera_hpc.run.watchdog import watchdog

_config: Any = numba.config  # its attributes are made at run time
Array = NDArray[np.float64]


def check_user_model(sweep: Sweep, row: Row) -> None:
    """Build a user's model for one point and try all that `Model` lists.

    Raises BadInput with what is missing, or of the wrong kind or shape.
    """
    where = f"model: {short(sweep.model)}"
    watchdog.watch(sweep)
    try:
        with foreign_code():
            model = build(sweep, row)
            state = _check_shapes(sweep, row, model)
            again = model.state(*initial_state(sweep, row, model))
        if state.tobytes() != again.tobytes():
            raise BadInput(
                "initial draws another state when it is called again: every random number must "
                "come from its argument rng"
            )
        rhs = model.right_hand_side
        with foreign_code():
            _check_right_hand_side(model, rhs, state)
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
    except Exception as error:
        # Whatever the user's code does.
        text = " ".join(f"{type(error).__name__}: {error}".split())
        raise BadInput(f"{where} does not work: {text}") from None


def _check_shapes(sweep: Sweep, row: Row, model: Model) -> Array:
    u, v = initial_state(sweep, row, model)
    state = np.asarray(model.state(u, v))
    _expect("state(u, v)", state.shape, (model.n_rows,))
    _expect("n_nodes", model.n_nodes, sweep.n_nodes)
    hash(model.lane_group)
    if not np.isfinite(state).all():
        raise BadInput("the initial state is not finite")
    for i, signal in enumerate(model.node_pair(state[:, None])):
        _expect(f"node_pair(rows)[{i}]", signal.shape, (model.n_nodes, 1))
    second = model.second_variable(state[:, None], v, np.zeros(1))
    _expect("second_variable(rows, v0, t)", second.shape, (1, model.n_second))
    return state


def _check_right_hand_side(model: Model, rhs: Any, state: Array) -> None:
    """Try it on one lane and on `LANES` different ones: each must have the numbers it has alone.

    A lane that reads another's parameters, or vector functions that round otherwise than those for
    single numbers, would make results depend on the neighbours.
    """
    ints = np.asarray(model.int_params, dtype=np.int64)
    if not (_config.DISABLE_JIT or RIGHT_HAND_SIDE in getattr(rhs, "nopython_signatures", [])):
        raise BadInput(f"right_hand_side is not compiled as {RIGHT_HAND_SIDE}")
    scale = 1.0 + 1e-3 * np.arange(LANES)
    rows = np.asarray(state, dtype=np.float64)[:, None] * scale
    params = np.asarray(model.lane_params, dtype=np.float64)[:, None] * scale
    together = np.full_like(rows, np.nan)
    before = rows.copy()
    rhs(rows, together, params, ints)
    if rows.tobytes() != before.tobytes():
        raise BadInput("the right-hand side changes the state y")
    for lane in range(LANES):
        alone = np.full((len(rows), 1), np.nan)
        rhs(rows[:, [lane]].copy(), alone, params[:, [lane]].copy(), ints)
        if lane == 0 and not np.isfinite(alone).all():
            row = int(np.flatnonzero(~np.isfinite(alone[:, 0]))[0])
            raise BadInput(
                f"the right-hand side is not finite in the initial state, or not set, in row {row}"
            )
        if alone[:, 0].tobytes() != together[:, lane].tobytes():
            raise BadInput(
                "the right-hand side gives a run other numbers next to others than alone: "
                "lane by lane, only its own columns of y, dy and p may be used"
            )


def _expect(what: str, found: Any, wanted: Any) -> None:
    if found != wanted:
        raise BadInput(f"{what} is {found} where {wanted} is needed")
