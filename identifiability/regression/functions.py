"""Functions that were learned, beside the terms of the model that they contain.

Splines over the velocity of a joint contain its viscous and Coulomb friction, splines over its
position a spring: data never tell how a torque is shared among both. What follows here shares it
so that the terms do all that they can, and the function, orthogonal to them on the data, the rest:
the terms mean what they mean in a model without the function, and a robot file, which holds terms
and no functions, holds as much as it can.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from identifiability.effects import FAMILIES
from identifiability.foundation.names import Array
from identifiability.regression.reduction import Rung
from identifiability.regression.structure import Structure

#: Share of a column that may lie outside the span of others where it is contained in them.
CONTAINED = 1e-9


def list_functions(structure: Structure) -> list[np.ndarray]:
    """Return the columns of every function of a model, (k,) int each."""
    groups: dict[tuple[str, str], list[int]] = {}
    for k, p in enumerate(structure.parameters):
        if p.group in FAMILIES and FAMILIES[p.group].flexible:
            groups.setdefault((p.group, p.owner), []).append(k)
    return [np.array(columns) for columns in groups.values()]


def leave_to_terms(structure: Structure, R: Array, phi: Array) -> Array:
    """Return standard parameters (p,) of the same torque, in which functions do the least.

    Parameters
    ----------
    structure : Structure
    R : (r, p)
        Rows whose norms are those of torque on the data.
    phi : (p,)

    Returns
    -------
    (p,)
        ``R phi`` is the same, what a function adds to it is orthogonal to the terms at its place
        that it contains, unless one would have a sign that physics forbids, and splines where no
        data are have no values.
    """
    out = phi.copy()
    for own, terms, P in _contained(structure, R):
        least = np.where(structure.nonnegative[terms], -out[terms], -np.inf)
        share = _bounded(R[:, terms], R[:, own] @ out[own], least)
        out[own] -= P @ share
        out[terms] += share
        out[own[~R[:, own].any(axis=0)]] = 0.0
    return out


def tell_with_terms(structure: Structure, rung: Rung, R: Array) -> Rung:
    """Return a rung of the same torque whose terms are told with their shares of functions.

    Data that cannot share a torque among a term and a function tell what both are together: the
    term as it is best without the function. What is left are the function's own values, of columns
    orthogonal to the terms.

    Parameters
    ----------
    structure : Structure
    rung : Rung
    R : (r, b)
        Rows of the base parameters, whose norms are those of torque on the data.
    """
    M, labels, base = rung.M.copy(), list(rung.labels), structure.parameters
    columns = R @ rung.M
    for own, terms, _ in _contained(structure, R @ structure.G):
        known = {k: at for at, k in enumerate(structure.base.kept.tolist())}
        rows = [np.array([known[k] for k in some if k in known], int) for some in (own, terms)]
        others = np.setdiff1d(np.arange(len(rung.M)), rows[1])
        curve = np.flatnonzero(rung.M[rows[0]].any(axis=0))
        told = np.flatnonzero(rung.M[rows[1]].any(axis=0) & ~rung.M[others].any(axis=0))
        if not (curve.size and told.size):
            continue
        length = np.linalg.norm(columns[:, told], axis=0)
        solved = np.linalg.lstsq(columns[:, told] / length, columns[:, curve], rcond=None)[0]
        M[:, curve] -= rung.M[:, told] @ (solved / length[:, None])
        member = "|".join(re.escape(base[k].term) for k in own)
        for k in told:
            rest = re.sub(rf" [+−] (\S+·)?({member})", "", labels[k])
            labels[k] = f"{rest} with its share of {base[own[0]].group}"
    return replace(rung, M=M, labels=tuple(labels))


def _contained(structure: Structure, R: Array) -> Iterator[tuple[np.ndarray, np.ndarray, Array]]:
    """Yield each function (k,), the terms (t,) that it contains, and these by its values (k, t)."""
    functions, every = list_functions(structure), structure.parameters
    flexible = np.isin(np.arange(len(every)), np.concatenate([*functions, []]))
    length = np.linalg.norm(R, axis=0)
    unit = R / np.where(length > 0, length, 1.0)
    for own in functions:
        here = np.array([p.owner == every[own[0]].owner for p in every])
        terms, acts = np.flatnonzero(here & ~flexible & (length > 0)), length[own] > 0
        P = np.zeros((len(own), len(terms)))
        P[acts] = np.linalg.lstsq(unit[:, own[acts]], unit[:, terms], rcond=1e-12)[0]
        inside = np.linalg.norm(unit[:, own] @ P - unit[:, terms], axis=0) < CONTAINED
        P[acts] *= length[terms] / length[own[acts], None]
        yield own, terms[inside], P[:, inside]


def _bounded(A: Array, y: Array, least: Array) -> Array:
    """Return the x ≥ least with the smallest ``‖A x − y‖``, one bound after the other."""
    x, free = least.copy(), np.ones(len(least), bool)
    length = np.linalg.norm(A, axis=0)
    while free.any():
        rest = y - A[:, ~free] @ x[~free]
        x[free] = np.linalg.lstsq(A[:, free] / length[free], rest, rcond=None)[0] / length[free]
        beyond = free & (x < least)
        if not beyond.any():
            break
        worst = int(np.argmax(np.where(beyond, (least - x) * length, -1.0)))
        x[worst], free[worst] = least[worst], False
    return x
