r"""Incoherence of neighbours (Gopal et al. 2014) and the order of the whole ring.

Gopal, Chandrasekar, Venkatesan and Lakshmanan, Phys. Rev. E 89, 052914 (2014),
doi:10.1103/PhysRevE.89.052914; paper, app. F. With z_i = x_i - x_{i+1} around a ring
of N nodes and <z> the mean of z over all nodes,

    sigma    = < sqrt( sum_i (z_i - <z>)^2 / N ) >_t ,
    sigma(m) = < sqrt( sum_{i in group m} (z_i - <z>)^2 / n_m ) >_t ,    m = 1 .. M ,
    SI       = 1 - sum_m s_m / M ,          s_m = Theta(delta - sigma(m)) ,
    eta      = sum_m |s_m - s_{m+1}| / 2 ,  group M + 1 being the first.

Conventions that the sources leave open:

- z_N = x_N - x_1, so <z> = 0 at every time;
- N nodes fall into M groups as `numpy.array_split` does it: the first N mod M groups have one
  node more than the others (50 nodes in 6 groups: 9, 9, 8, 8, 8, 8);
- Theta(0) = 1: a group whose deviation equals delta is coherent;
- delta is in the units of x. A delta given as a fraction of `range_of(x)` reproduces the paper's
  figures.

Test vector, computed by hand, for two times and four nodes:

    x = (0, 1, 0, 0), (2, 2, 5, 1):   z = (-1, 1, 0, 0), (0, -3, 4, -1)
    sigma    = (sqrt(2/4) + sqrt(26/4)) / 2                          = 1.628308
    sigma(m) = (sqrt(2/2) + sqrt(9/2)) / 2, (0 + sqrt(17/2)) / 2     = 1.560660, 1.457738
    delta 1.5: s = (0, 1), SI = 1/2, eta = 1
    delta 1.6: s = (1, 1), SI = 0, eta = 0;  delta 1: s = (0, 0), SI = 1, eta = 0

>>> x = np.array([[0.0, 1.0, 0.0, 0.0], [2.0, 2.0, 5.0, 1.0]])
>>> sigma(x), local_sigma(x, groups=2)
(1.628308, array([1.560660, 1.457738]))
>>> strength_of_incoherence(local_sigma(x, 2), 1.5), discontinuity_measure(local_sigma(x, 2), 1.5)
(0.5, 1.0)
"""

from __future__ import annotations

import math
from typing import Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from chimera_hpc.base.errors import BadInput
from chimera_hpc.integrate.jit import jit
from chimera_hpc.measures.checks import Array, choice, floats, integer, node_rows
from chimera_hpc.measures.signals_input import checked_signals

# Times per chunk, so that their sums stay in the first-level cache.
_CHUNK = 1024


def range_of(x: ArrayLike) -> float:
    """Largest minus smallest value over all times and nodes, in the units of x.

    Raises
    ------
    BadInput
        x does not have shape (times, nodes), or holds a value that is not finite.
    """
    rows = node_rows("x", x)
    return float(_finite(rows.max() - rows.min(), "x"))


def differences(x: ArrayLike) -> Array:
    """z_i = x_i - x_{i+1} around the ring, for x (..., N)."""
    values = floats("x", x)
    return values - np.roll(values, -1, axis=-1)


def sigma(x: ArrayLike) -> float:
    """Time mean of the standard deviation over all nodes of the differences between neighbours.

    Parameters
    ----------
    x : array_like, shape (T, N)
        One component of the state. An array whose transpose is contiguous is not copied.

    Raises
    ------
    BadInput
        A wrong shape, or a value that is not finite.
    """
    return float(local_sigma(x, 1)[0])


def local_sigma(x: ArrayLike, groups: int) -> Array:
    """Return sigma(m) of each group of neighbouring nodes, shape (groups,).

    Raises
    ------
    BadInput
        As `sigma`; or a number of groups outside 1 .. N.
    """
    rows = node_rows("x", x)
    n_nodes = rows.shape[0]
    groups = integer("groups", groups)
    if not 1 <= groups <= n_nodes:
        raise BadInput(f"groups must be in 1 .. {n_nodes} (the nodes), not {groups}")
    small, larger = divmod(n_nodes, groups)
    sizes = np.full(groups, small, dtype=np.int64)
    sizes[:larger] += 1
    out = np.empty(groups)
    _local_sigma(rows, np.concatenate([[0], np.cumsum(sizes)]), np.empty(_CHUNK), out)
    _finite(out, "x and its squares")
    return out


@overload
def strength_of_incoherence(local: ArrayLike, delta: float) -> float: ...
@overload
def strength_of_incoherence(local: ArrayLike, delta: Array) -> Array: ...


def strength_of_incoherence(local: ArrayLike, delta: float | Array) -> float | Array:
    """SI = 1 - sum_m Theta(delta - sigma(m)) / M with Theta(0) = 1.

    SI is 0 for a coherent state, 1 for an incoherent state, and between 0 and 1 for a chimera.

    Parameters
    ----------
    local : array_like, shape (M,) or (..., M)
        `local_sigma` of one run, or of many.
    delta : float or array
        Threshold, >= 0, in the units of `local`. An array is broadcast against all axes of `local`
        except the last.

    Returns
    -------
    float, or an array for arrays; NaN where any sigma(m) is NaN

    Raises
    ------
    BadInput
        No groups, or a delta that is negative or NaN.
    """
    s = _coherent(local, delta)
    return _plain(1.0 - s.mean(axis=-1))


@overload
def discontinuity_measure(local: ArrayLike, delta: float) -> float: ...
@overload
def discontinuity_measure(local: ArrayLike, delta: Array) -> Array: ...


def discontinuity_measure(local: ArrayLike, delta: float | Array) -> float | Array:
    """Number of incoherent regions: ``eta = sum_m |s_m - s_{m+1}| / 2`` around the ring.

    eta is 1 for a chimera, 2 or more for a multi-chimera, and 0 for a coherent or an incoherent
    state (all s_m equal). Parameters, result and errors as in `strength_of_incoherence`.
    """
    s = _coherent(local, delta)
    return _plain(0.5 * np.abs(s - np.roll(s, -1, axis=-1)).sum(axis=-1))


def strength_of_run(
    t: ArrayLike,
    u: ArrayLike,
    groups: int = 6,
    delta: float = 0.1256,
    unit: Literal["range", "absolute"] = "range",
) -> float:
    """Strength of incoherence of a run, in [0, 1]: `chimera_hpc.measures.strength_of_incoherence`.

    Parameters
    ----------
    t : array_like, shape (T,)
        Times, which do not matter as long as they are uniform.
    u : array_like, shape (T, N)
    groups : int
        M.
    delta : float
        Threshold; the default is the paper's for its topological model.
    unit : {"range", "absolute"}
        Unit of delta: the range of u over times and nodes, or that of u.

    Raises
    ------
    BadInput
        As `local_sigma` and `strength_of_incoherence`, or another unit.
    """
    checked_signals(t, u)
    choice("unit", unit, ("range", "absolute"))
    scale = range_of(u) if unit == "range" else 1.0
    return strength_of_incoherence(local_sigma(u, groups), delta * scale)


def order_parameter(u: ArrayLike, w: ArrayLike) -> float:
    r"""Time mean of the modulus of the mean phase vector of the ring, in [0, 1].

        R = < | sum_j exp(i phi_j) / N | >_t ,
        phi_j(t) = atan2(w_j(t) - <w_j>_t, u_j(t) - <u_j>_t) ,

    where phi_j is the geometric phase about each node's mean point (Kuramoto's order parameter). A
    node at its mean point has phase 0.

    Parameters
    ----------
    u, w : array_like, shape (T, N)
        Two components of the state.

    Raises
    ------
    BadInput
        Shapes that are wrong or differ, or a value that is not finite.
    """
    x, y = node_rows("u", u), node_rows("w", w)
    if x.shape != y.shape:
        raise BadInput(f"u and w must have one shape, not {x.T.shape} and {y.T.shape}")
    work = np.empty((2, _CHUNK))
    order = _order_parameter(x, y, x.mean(axis=1), y.mean(axis=1), work)
    return float(_finite(order, "u and w"))


@jit()
def _local_sigma(x: Any, bounds: Any, square: Any, out: Any) -> None:
    """Write sigma(m) of x (N, T) into out (M,). Group m is nodes bounds[m] .. bounds[m+1] - 1."""
    n_nodes, n_times = x.shape
    for m in range(out.size):
        out[m] = 0.0
    for start in range(0, n_times, square.size):
        n = min(square.size, n_times - start)
        for m in range(out.size):
            for i in range(n):
                square[i] = 0.0
            for j in range(bounds[m], bounds[m + 1]):
                here = x[j, start : start + n]
                following = x[(j + 1) % n_nodes, start : start + n]
                for i in range(n):
                    z = here[i] - following[i]
                    square[i] += z * z
            for i in range(n):
                out[m] += math.sqrt(square[i] / (bounds[m + 1] - bounds[m]))
    for m in range(out.size):
        out[m] /= n_times


@jit()
def _order_parameter(x: Any, y: Any, x_mean: Any, y_mean: Any, vector: Any) -> Any:
    """Return the order parameter of x, y (N, T); vector (2, chunk) is a work array."""
    n_nodes, n_times = x.shape
    along, across = vector[0], vector[1]
    total = 0.0
    for start in range(0, n_times, along.size):
        n = min(along.size, n_times - start)
        for i in range(n):
            along[i] = 0.0
            across[i] = 0.0
        for j in range(n_nodes):
            for i in range(n):
                dx = x[j, start + i] - x_mean[j]
                dy = y[j, start + i] - y_mean[j]
                radius = math.sqrt(dx * dx + dy * dy)
                still = radius == 0.0
                scale = 1.0 / (1.0 if still else radius)
                along[i] += 1.0 if still else dx * scale
                across[i] += dy * scale
        for i in range(n):
            total += math.sqrt(along[i] * along[i] + across[i] * across[i])
    return total / (n_nodes * n_times)


def _finite(result: Any, what: str) -> Any:
    """Return the result. It is not finite if any value of the signals is not finite."""
    if not np.isfinite(result).all():
        raise BadInput(f"{what} must be finite")
    return result


def _coherent(local: ArrayLike, delta: float | Array) -> Array:
    """Return s_m as 0.0 or 1.0. All s_m of a run with a NaN deviation are NaN."""
    deviations = floats("local", local)
    threshold = floats("delta", delta)[..., None]
    if deviations.ndim == 0 or deviations.shape[-1] == 0:
        raise BadInput(f"local must have shape (..., groups), not {deviations.shape}")
    if not (threshold >= 0).all():
        raise BadInput(f"delta must be >= 0, not {delta}")
    unknown = np.isnan(deviations).any(axis=-1, keepdims=True)
    return np.where(unknown, np.nan, (deviations <= threshold).astype(np.float64))


def _plain(values: Array) -> float | Array:
    return float(values) if np.ndim(values) == 0 else values
