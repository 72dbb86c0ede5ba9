"""The nearest real robots under a CAD prior of falling weight, by Newton's method.

    minimise  ‖F (x − free)‖² + w Σ_k [tr J_k(x) − log det J_k(x) − 4]   over   rows,  plane

The divergence keeps bodies inside their cones by itself, so that only rows (signs and bounds) need
multipliers, as in an interior-point method. That takes milliseconds, a tenth of what a general
solver does. The way to a light weight leads along the optima of heavier ones, as that of an
interior point does: a path of weights costs little more than its last one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from scipy.linalg.lapack import dposv

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.held import Plane

#: Steps after which patience is tried, and after which the general solver is asked; about twenty
#: are needed.
STEPS = (40, 100)

#: Newton decrement and complementarity [σ²] at which the optimum is reached, of a weight up to one;
#: of heavier ones [weights].
ENOUGH = 1e-8

#: Share of the way to the edge that one step goes, of cones and of signs.
IN_CONES, IN_SIGNS = 0.9, 0.995

#: Each step asks for this share of what the products of slack and multiplier are.
LESS = 0.03

#: The same of the weight, which begins at the size of the cost and ends at the prior's.
LIGHTER = 0.2

#: Rows and columns of the lower triangle of a body, and what makes its squares those of the whole.
ROW, COLUMN = np.tril_indices(4)
TWICE = np.where(ROW == COLUMN, 1.0, np.sqrt(2.0))

#: Newton decrement up to which the weight goes on falling, in weights. Nearly always it may fall at
#: once. Where that leads along the edge of a thin body in ever smaller steps, it waits.
PATIENCE = (np.inf, 1.0)


@frozen
class Pulled:
    """An optimum under a prior of one weight.

    Attributes
    ----------
    x : (p,)
    multipliers : (m,)
        Of the rows.
    directions, curve : (p, q) and (q, q)
        Of the plane, and the second derivatives of the cost [σ²] along them.
    """

    x: Array
    multipliers: Array
    directions: Array
    curve: Array

    @property
    def root(self) -> Array:
        """L of the errors ``L Lᵀ`` of x, (p, q), if half the cost is a negative log posterior."""
        size = 1 / np.sqrt(np.diag(self.curve))
        factor = np.linalg.cholesky(size[:, None] * self.curve * size)
        found: Array = np.sqrt(2.0) * (self.directions * size) @ np.linalg.inv(factor).T
        return found


def pull(region: PhysicalSet, maps: Array, weight: float, *way: Any) -> Pulled | None:
    """Return the optimum under one weight of the prior, None if it is not reached.

    Parameters as in `follow`.
    """
    for steps, patience in zip(STEPS, PATIENCE, strict=True):
        found = next(follow(region, maps, [weight], *way, steps=steps, patience=patience), None)
        if found is not None:
            return found
    return None


def follow(
    region: PhysicalSet,
    maps: Array,
    weights: Sequence[float],
    lines: tuple[Array, Array],
    factor: Array,
    free: Array,
    plane: Plane,
    *,
    enough: float = ENOUGH,
    steps: int = STEPS[0],
    patience: float = PATIENCE[0],
) -> Iterator[Pulled]:
    """Yield the optimum under each weight of the prior, as far as they are reached.

    Parameters
    ----------
    region : PhysicalSet
    maps : (nb, 16, p)
        To pseudo-inertias that the nominal bodies make the identity (`nominal_cones`).
    weights : sequence of float
        Of the prior [σ²], the heaviest first.
    lines : (m, p) and (m,)
        ``rows @ x ≥ least`` are the signs and the bounds.
    factor : (p, p)
        Square root of the quadratic cost.
    free : (p,)
        Where that cost is least, in the plane.
    plane : Plane
        What is held.
    enough : float
        Newton decrement and complementarity at which an optimum is reached, as `ENOUGH`.
    steps : int
        Within which each is.
    patience : float
        Newton decrement, in weights, up to which the weight goes on falling.
    """
    rows, least = lines
    own = np.take_along_axis(maps, region.bodies[:, None, :], axis=2)
    x = free.copy()
    x[region.bodies] = np.linalg.pinv(own) @ np.eye(4).ravel()  # the nominal bodies
    _, s, Vt = np.linalg.svd(factor @ plane.along)
    T = plane.along @ Vt.T  # along these directions the quadratic cost is a sum of squares
    cone, sign = maps @ T, rows @ T
    z = T.T @ (x - free)
    weight = max(weights[0], float(s * z @ (s * z)) / (4 * max(len(maps), 1)))
    triangle = 4 * ROW + COLUMN
    slack = np.abs(rows @ x - least) + 0.01
    y = weight / slack
    at, left = 0, steps
    while left and at < len(weights):
        left, light = left - 1, weights[at]
        reached = max(enough, ENOUGH * light)
        least_product = reached / max(100, 2 * y.size)  # so that all of them together are enough
        root = np.linalg.inv(np.linalg.cholesky((maps @ x).reshape(-1, 4, 4)))
        congruent = np.einsum("kab,kcd->kacbd", root, root).reshape(-1, 16, 16)
        # Of the congruent J along each direction: the triangle, and its squares as of the whole.
        rates = (TWICE[:, None] * congruent[:, triangle] @ cone).reshape(-1, z.size)
        away = np.eye(4) - root.transpose(0, 2, 1) @ root
        lack, product = rows @ x - least - slack, slack * y
        aim = max(LESS * product.mean(), least_product) if y.size else 0.0
        force = sign.T @ ((aim - y * lack) / slack) - 2 * s**2 * z
        force = force - weight * away.ravel() @ cone.reshape(-1, z.size)
        stiff = np.sqrt(y / slack)[:, None] * sign
        curve = weight * (rates.T @ rates) + stiff.T @ stiff  # each half the work: A.T @ A
        curve[np.diag_indices_from(curve)] += 2 * s**2
        step = _solve(curve, force)
        if step is None:
            return
        change = sign @ step + lack
        rise = (aim - y * change) / slack - y
        turn = np.linalg.eigvalsh(_whole((rates @ step).reshape(-1, 10))).ravel()
        edges = _room(np.ones(turn.size), turn, IN_CONES), _room(slack, change, IN_SIGNS)
        reach = min(*edges, _room(y, rise, IN_SIGNS))
        z, slack, y = z + reach * step, slack + reach * change, y + reach * rise
        x = free + T @ z
        if weight > light:
            if patience == np.inf or (reach > IN_CONES and force @ step <= patience * weight):
                weight = max(light, LIGHTER * weight)
        elif reach == 1.0 and max(force @ step, product.sum()) < reached:
            yield Pulled(x, y, T, curve)
            at, left = at + 1, steps
            weight = max(weights[min(at, len(weights) - 1)], LIGHTER * weight)


def _whole(triangles: Array) -> Array:
    """Return the symmetric matrices (nb, 4, 4) of their lower triangles (nb, 10), weighted."""
    out = np.empty((len(triangles), 4, 4))
    out[:, ROW, COLUMN] = out[:, COLUMN, ROW] = triangles / TWICE
    return out


def _solve(curve: Array, force: Array) -> Array | None:
    """Return the Newton step, each direction in its own size; None where rounding forbids it."""
    size = 1 / np.sqrt(np.diag(curve))
    _, step, failed = dposv(size[:, None] * curve * size, size * force)
    return None if failed else size * step


def _room(value: Array, change: Array, share: float) -> float:
    """Return the part of a change, at most one, that leaves values positive."""
    falls = change < 0
    return min(1.0, share * float((value[falls] / -change[falls]).min(initial=np.inf)))
