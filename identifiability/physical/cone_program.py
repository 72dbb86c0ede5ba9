"""A convex quadratic program over cones, handed to Clarabel as it is.

    minimise  Σ_j w_j x_j² + c·x   over   M x = m,  M x ≥ m,  matrices M x − m ⪰ 0,  logarithms

A modelling language would compile it first. Where the cost is data that change from call to call,
what it keeps for that grows with the fourth power of the parameters (11 GB for 24 joints); and for
one call the compiling takes ten times as long as the solver.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import clarabel
import numpy as np
import scipy.sparse

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

#: What Clarabel's words mean here. Without one of these there is no answer.
STATUS = {"Solved": "optimal", "AlmostSolved": "optimal_inaccurate", "MaxIterations": "user_limit"}


@frozen
class ConeAnswer:
    """The optimum and the multipliers of each group of constraints, in the order of their adding.

    Attributes
    ----------
    x : (p,)
    multipliers : tuple of (m,) or (d, d)
        At least zero for rows ``M x ≥ m``; positive semidefinite for matrices.
    status : str
    """

    x: Array
    multipliers: tuple[Array, ...]
    status: str


@dataclass
class ConeProgram:
    """Constraints that are added one after the other.

    Attributes
    ----------
    size : int
        Number of variables p.
    """

    size: int
    _rows: list[Any] = field(default_factory=list)
    _least: list[Array] = field(default_factory=list)
    _cones: list[Any] = field(default_factory=list)

    def equal(self, M: Array, m: Array) -> None:
        """Require ``M x = m``, for (r, p) and (r,)."""
        self._add(M, m, clarabel.ZeroConeT(len(m)))

    def at_least(self, M: Array, m: Array) -> None:
        """Require ``M x ≥ m``, for (r, p) and (r,)."""
        self._add(M, m, clarabel.NonnegativeConeT(len(m)))

    def semidefinite(self, M: Array, m: Array) -> None:
        """Require that the symmetric matrix ``M x − m`` is positive semidefinite.

        Parameters
        ----------
        M : (d, d, p)
        m : (d, d)
        """
        d = len(m)
        at, weight = _triangle(d)
        rows = weight[:, None] * M.reshape(d * d, -1)[at]
        self._add(rows, weight * m.ravel()[at], clarabel.PSDTriangleConeT(d))

    def logarithm(self, level: int, argument: int) -> None:
        """Require of two variables that ``x[level] ≤ log x[argument]``."""
        M = np.zeros((3, self.size))
        M[0, level] = M[2, argument] = 1.0
        self._add(M, np.array([0.0, -1.0, 0.0]), clarabel.ExponentialConeT())

    def _add(self, M: Array, m: Array, cone: Any) -> None:
        if len(m):
            self._rows.append(scipy.sparse.csr_matrix(-M))
            self._least.append(-m)
        self._cones.append((cone, len(m)))

    def solve(self, squares: Array, slope: Array) -> ConeAnswer:
        """Return the least ``Σ squares x² + slope·x``, for (p,) and (p,).

        Raises
        ------
        ValueError
            When the solver ends without an answer; with its word for that.
        """
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        P = scipy.sparse.diags(2.0 * squares, format="csc")
        rows = scipy.sparse.vstack(self._rows, format="csc")
        cones = [cone for cone, count in self._cones if count]
        least = np.concatenate(self._least)
        found = clarabel.DefaultSolver(P, slope, rows, least, cones, settings).solve()
        word = str(found.status)
        if word not in STATUS:
            raise ValueError(word)
        z, out, at = np.array(found.z), list[Array](), 0
        for cone, count in self._cones:
            own, at = z[at : at + count], at + count
            out.append(_square(own) if isinstance(cone, clarabel.PSDTriangleConeT) else own)
        return ConeAnswer(np.array(found.x), tuple(out), STATUS[word])


def _triangle(d: int) -> tuple[np.ndarray, Array]:
    """Return where the upper triangle lies in a flat (d, d), by columns, and its weights."""
    column, row = np.tril_indices(d)
    return row * d + column, np.where(row == column, 1.0, np.sqrt(2.0))


def _square(own: Array) -> Array:
    """Return the symmetric matrix (d, d) of its weighted upper triangle."""
    d = int(np.sqrt(2 * len(own)))
    at, weight = _triangle(d)
    out = np.zeros(d * d)
    out[at] = own / weight
    upper = out.reshape(d, d)
    square: Array = upper + upper.T - np.diag(np.diag(upper))
    return square
