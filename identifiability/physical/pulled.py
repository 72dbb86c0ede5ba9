"""The nearest real robot under a CAD prior, by Newton's method.

    minimise  ‖F (x − free)‖² + w Σ_k [tr J_k(x) − log det J_k(x) − 4]   over   rows,  plane

The divergence keeps bodies inside their cones by itself, so that only rows (signs and bounds) need
multipliers, as in an interior-point method. That takes milliseconds, a tenth of what a general
solver does.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dposv

from identifiability.foundation.names import Array
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.held import Plane

#: Steps after which patience is tried, and after which the general solver is asked; about twenty
#: are needed.
STEPS = (40, 100)

#: Newton decrement and complementarity [σ²] at which the optimum is reached.
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


def pull(
    region: PhysicalSet,
    nominal: tuple[Array, float],
    lines: tuple[Array, Array],
    factor: Array,
    free: Array,
    plane: Plane,
) -> tuple[Array, Array] | None:
    """Return the optimum (p,) and the multipliers (m,) of the rows; None if it is not reached.

    Parameters
    ----------
    region : PhysicalSet
    nominal : (nb, 16, p) and float
        Maps to pseudo-inertias that the nominal bodies make the identity (`nominal_cones`), and
        the weight of the prior [σ²].
    lines : (m, p) and (m,)
        ``rows @ x ≥ least`` are the signs and the bounds.
    factor : (p, p)
        Square root of the quadratic cost.
    free : (p,)
        Where that cost is least, in the plane.
    plane : Plane
        What is held.
    """
    for steps, patience in zip(STEPS, PATIENCE, strict=True):
        found = _pull(region, nominal, lines, factor, free, plane, steps, patience)
        if found is not None:
            return found
    return None


def _pull(
    region: PhysicalSet,
    nominal: tuple[Array, float],
    lines: tuple[Array, Array],
    factor: Array,
    free: Array,
    plane: Plane,
    steps: int,
    patience: float,
) -> tuple[Array, Array] | None:
    (maps, light), (rows, least) = nominal, lines
    own = np.take_along_axis(maps, region.bodies[:, None, :], axis=2)
    x = free.copy()
    x[region.bodies] = np.linalg.pinv(own) @ np.eye(4).ravel()  # the nominal bodies
    _, s, Vt = np.linalg.svd(factor @ plane.along)
    T = plane.along @ Vt.T  # along these directions the quadratic cost is a sum of squares
    cone, sign = maps @ T, rows @ T
    z = T.T @ (x - free)
    weight = max(light, float(s * z @ (s * z)) / (4 * max(len(maps), 1)))
    triangle = 4 * ROW + COLUMN
    slack = np.abs(rows @ x - least) + 0.01
    y = weight / slack
    least_product = ENOUGH / max(100, 2 * y.size)  # so that all of them together are enough
    for _ in range(steps):
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
            return None
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
        elif reach == 1.0 and max(force @ step, product.sum()) < ENOUGH:
            return x, y
    return None


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
