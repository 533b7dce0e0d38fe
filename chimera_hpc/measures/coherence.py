r"""Chimera index and metastability of communities of oscillators (Shanahan 2010).

With R_c(t) the order parameter of community c,

    chi    = < Var_c R_c(t) >_t ,      lambda = < Var_t R_c(t) >_c .

chi is large where some communities are synchronous and others are not at the same time, lambda
where communities become synchronous and fall apart again. M. Shanahan, Chaos 20, 013108 (2010),
doi:10.1063/1.3305451. Sources divide by the number of values (ddof 0) or by one less (ddof 1);
published values are often divided by those of a reference, chi by 5/36 and lambda by 1/12.

Two communities with R = (1, 1) and (0, 0) at two times have chi = 1/4 (ddof 1: 1/2), lambda = 0.

>>> phase = np.array([[0.0, 0.0, 0.0, np.pi], [1.0, 1.0, 2.0, 2.0 + np.pi]])
>>> chimera_index(phase, [0, 0, 1, 1]), chimera_index(phase, [0, 0, 1, 1], ddof=1)
(0.25, 0.5)
>>> metastability(phase, [0, 0, 1, 1]) < 1e-30
True
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from chimera_hpc.base.errors import BadInput
from chimera_hpc.measures.checks import Array, integer
from chimera_hpc.measures.order_parameters import community_order

CHI_REFERENCE = 5.0 / 36.0
LAMBDA_REFERENCE = 1.0 / 12.0
"""Variance of a number that is uniform in [0, 1]."""


def chimera_index(
    phase: ArrayLike, communities: ArrayLike, ddof: int = 0, *, normalised: bool = False
) -> float:
    """Time mean of the variance over communities of their order parameters.

    Parameters
    ----------
    phase : array_like, shape (T, N)
        Phases in rad.
    communities : array_like, shape (N,)
        A label for each node.
    ddof : int
        The variance of C values divides by C - ddof.
    normalised : bool
        Whether to divide by 5/36.

    Raises
    ------
    BadInput
        As `order_parameters.community_order`; or a ddof that leaves nothing to divide by.
    """
    order = community_order(phase, communities)
    return float(_variance(order, 1, ddof).mean()) / (CHI_REFERENCE if normalised else 1.0)


def metastability(
    phase: ArrayLike, communities: ArrayLike, ddof: int = 0, *, normalised: bool = False
) -> float:
    """Mean over communities of the variance in time of their order parameters.

    Parameters and errors as in `chimera_index`; `normalised` divides by 1/12.
    """
    order = community_order(phase, communities)
    return float(_variance(order, 0, ddof).mean()) / (LAMBDA_REFERENCE if normalised else 1.0)


def _variance(order: Array, axis: int, ddof: int) -> Array:
    count = order.shape[axis]
    if not 0 <= integer("ddof", ddof) < count:
        what = ("times", "communities")[axis]
        raise BadInput(f"ddof = {ddof}: allowed is 0 to {count - 1} for {count} {what}")
    variance: Array = np.var(order, axis=axis, ddof=ddof)
    return variance
