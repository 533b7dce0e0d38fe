"""Runge-Kutta methods as data: Butcher tableau and interpolant."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Coefficients: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True)
class Tableau:
    r"""An explicit embedded Runge-Kutta pair with a continuous extension.

    .. math::
        k_i = f\big(y_n + h \sum_{j<i} a_{ij} k_j\big), \qquad
        y_{n+1} = y_n + h \sum_i b_i k_i, \qquad
        e_{n+1} = h \sum_i e_i k_i, \qquad
        y(t_n + \theta h) = y_n + h \sum_i k_i \sum_d p_{id} \theta^{d+1}.

    Every method has the form "first same as last": the last stage is the derivative at the new
    point. For a method without this property, append its weights as a last row of ``a``, with
    zeros in ``b``, ``e`` and ``p``.

    Parameters
    ----------
    name : str
        Name in job files.
    order : int
        Order of the solution that is propagated.
    error_order : int
        Order of the embedded solution.
    a : shape (s, s)
        Strictly lower triangular; its last row is ``b``.
    e : shape (s,)
        Weights of the error estimate, the difference of the two solutions.
    p : shape (s, d)
        Polynomial of the continuous extension; its rows sum to ``b``.
    interpolant_order : int
        Order of the continuous extension.
    source : str
        Where the coefficients are published.

    Raises
    ------
    ValueError
        The coefficients contradict each other.

    References
    ----------
    Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I*, secs. II.1, II.4, II.6.
    """

    name: str
    order: int
    error_order: int
    a: Coefficients = field(repr=False)
    e: Coefficients = field(repr=False)
    p: Coefficients = field(repr=False)
    interpolant_order: int
    source: str

    def __post_init__(self) -> None:
        """Check the shapes and the identities that hold for every method."""
        s = self.a.shape[0]
        if self.a.shape != (s, s) or self.e.shape != (s,) or self.p.shape[0] != s:
            raise ValueError(f"{self.name}: shapes of the tableau differ")
        if np.any(np.triu(self.a) != 0.0):
            raise ValueError(f"{self.name}: the method is not explicit")
        if abs(self.b.sum() - 1.0) > 1e-14 or abs(self.e.sum()) > 1e-14:
            raise ValueError(f"{self.name}: weights must sum to 1, error weights to 0")
        if np.abs(self.p.sum(axis=1) - self.b).max() > 1e-12:
            raise ValueError(f"{self.name}: the interpolant does not end at the new point")

    @property
    def stages(self) -> int:
        """Number of stages, including the derivative at the new point."""
        return int(self.a.shape[0])

    @cached_property
    def b(self) -> Coefficients:
        """Weights of the solution, shape (s,)."""
        weights: Coefficients = self.a[-1]
        return weights

    @cached_property
    def c(self) -> Coefficients:
        """Abscissae, shape (s,)."""
        c: Coefficients = self.a.sum(axis=1)
        return c


def lower_triangular(*rows: tuple[float, ...]) -> Coefficients:
    """Return a square matrix of coefficients from its rows below the diagonal.

    >>> lower_triangular((0.5,), (0.0, 1.0))
    array([[0. , 0. , 0. ],
           [0.5, 0. , 0. ],
           [0. , 1. , 0. ]])
    """
    a = np.zeros((len(rows) + 1, len(rows) + 1))
    for i, row in enumerate(rows, start=1):
        a[i, : len(row)] = row
    return a


def hermite(b: Coefficients) -> Coefficients:
    """Return the weights p of the cubic Hermite interpolant of a step (order 3).

    ``b`` are the weights of the solution. The last stage must be the slope at the new point (HNW
    sec. II.6, eq. 6.7).

    >>> hermite(np.array([0.5, 0.5, 0.0]))
    array([[ 1. , -0.5,  0. ],
           [ 0. ,  1.5, -1. ],
           [ 0. , -1. ,  1. ]])
    """
    p = np.outer(b, [0.0, 3.0, -2.0])
    p[0] += 1.0, -2.0, 1.0
    p[-1] += 0.0, -1.0, 1.0
    return p
