"""What pulls at the bodies reaches several joints, and in one of them it looks like a spring.

A base that is tilted, a load that was forgotten, a rope to a body: forces that do not turn with
what they act on. Each motor feels a function of the posture, which in that joint alone resembles an
offset, a spring or a counterweight, or a share of what another motor carries. Such a name is
doubted where forces leave it no more to say than the best of so many names has by chance, and
surely explain more than it does in this joint or in others; or where there are such names in
several joints, each of which would be a cause of its own: every one beyond the first takes what
decides between two names. Which force it is need not be known: every body may be pulled at in any
direction, by as much as the file says that it weighs; or all of them alike, as where the base is
tilted, which says as much with two columns as others with a dozen that each have to be paid for.
If that is the cause, it leaves nothing: where curves of the positions surely explain what it
leaves, as in a robot of which the model misses much, names stay. A true law loses its name at the
level of the test alone: beside it forces explain what noise does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.polynomial import legendre
from scipy import stats

from identifiability.foundation.names import BASE, Array
from identifiability.foundation.numbers import log_tail, tail_of_sum
from identifiability.workflows.diagnose.gates import Chosen, Naming, keep_surviving
from identifiability.workflows.diagnose.late import is_curve
from identifiability.workflows.diagnose.leftover import (
    LEVEL,
    ROWS,
    basis_beside,
    in_units_of_rest,
    squares_along,
)
from identifiability.workflows.diagnose.lookalikes import DECISIVE
from identifiability.workflows.diagnose.material import Material
from identifiability.workflows.diagnose.rows import Candidate
from identifiability.workflows.diagnose.spans import orthonormal, project_out

#: Of polynomials of a position, which a force would leave nothing to.
DEGREE = 8
#: What does not change along an axis that no motor has, and so by the posture in every motor; and
#: a drift, which contains the offset that a posture has on average.
CONSTANT = ("constant_force", "torque_drift")
#: Ways in which forces may pull: at each body by itself, or at all of them alike [Bonferroni].
WAYS = 2
#: What names of torque at rest are by.
AT_REST = ("position", "load")


def keep_off_bodies(material: Material, naming: Naming) -> Naming:
    """Return a naming without names of one joint that forces on the bodies say, and more.

    Only where the masses are fitted: if values are kept, a wrong one has a name.
    """
    structure, fixed = material.setting.structure, material.setting.fixed
    if fixed or "rigid_body" not in structure.model.names:
        return naming
    names = [c for c in naming.chosen if _is_at_rest(c) and c.place != BASE]
    gone = find_on_bodies(material, naming.chosen, names) if names else []
    why = "forces on the bodies, which several joints feel, explain what it does, and more"
    return keep_surviving(naming, gone, structure.present, why)


def _is_at_rest(c: Candidate) -> bool:
    """Whether a name is of torque by posture or load, or contains one that does not change."""
    if c.family.unnamed or c.family.dry:
        return False
    return c.family.against in AT_REST or is_curve(c) or c.family.name in CONSTANT


def find_on_bodies(
    material: Material, chosen: Sequence[Candidate], names: Sequence[Candidate]
) -> Chosen:
    """Return the names that say nothing beside forces on the bodies, if these are the better one.

    Parameters
    ----------
    material : Material
    chosen : sequence of Candidate
        All that was named.
    names : sequence of Candidate
        Those of them that are asked for.
    """
    rows, noise, table = material.train, material.noise, material.tables.train
    forces = table.forces
    if not forces.shape[2]:
        return []
    rest = rows.columns([c for c in chosen if c not in names])
    own = [rows.D.take(c.columns) for c in names]
    curves = _curves(rows.q)
    y, X, F, alike, C, *own = (
        noise.whiten(part, rows.moving).reshape(-1, part.shape[2])
        for part in (rows.tau[:, :, None], rest, forces, table.field, curves, *own)
    )
    y, dof = in_units_of_rest(y, [X, F, *own], rows.silent)
    if dof < ROWS * F.shape[1]:
        return []
    each, one, all_of_them = (say([X], part, y) for part in (F, alike, np.column_stack(own)))
    if one > each:
        F = alike
    more = len({c.place for c in names}) - 1
    simpler = more > 0 and max(one, each) - np.log(WAYS) > all_of_them - DECISIVE * more
    if not simpler and not says_more(material, [X, *own], F, y, LEVEL / WAYS):
        return []
    if says_more(material, [X, F, *own], C, y):
        return []
    gone = find_needless(material, [X, F], own, y)
    return [c for c, needless in zip(names, gone, strict=True) if needless]


def find_needless(
    material: Material, beside: Sequence[Array], own: Sequence[Array], y: Array
) -> list[bool]:
    """Return which names say no more beside some columns than the best of all has by chance.

    The least needed one is left out first, until what is left stands out [Bonferroni].

    Parameters
    ----------
    beside : sequence of (R, k)
    own : sequence of (R, k)
        Columns of each name.
    y : (R, 1)
    """
    needed, tried = list(range(len(own))), len({c.group for c in material.candidates})
    chance = max(float(np.log(tried / material.setting.rules.level)), DECISIVE)
    while needed:
        said = [say([*beside, *(own[o] for o in needed if o != k)], own[k], y) for k in needed]
        least = int(np.argmin(said))
        if said[least] > chance:
            break
        del needed[least]
    return [k not in needed for k in range(len(own))]


def write_curve(q: Array) -> Array:
    """Return polynomials of a position (N,), (N, k)."""
    columns: Array = legendre.legvander(2 * (q - q.min()) / (np.ptp(q) or 1.0) - 1, DEGREE)
    return columns


def _curves(q: Array) -> Array:
    """Return polynomials of the position of each joint (N, n) in that joint, (N, n, k)."""
    own = np.stack([write_curve(x) for x in q.T], axis=1)
    columns: Array = np.einsum("tjk,ij->tijk", own, np.eye(q.shape[1])).reshape(*q.shape, -1)
    return columns


def says_more(
    material: Material, named: Sequence[Array], F: Array, y: Array, level: float = LEVEL
) -> bool:
    """Whether some columns surely explain something beside all that was named.

    By an F-test, and by simulated noise: what is slow looks like a posture.

    Parameters
    ----------
    named : sequence of (R, k)
        Columns of the model with its names.
    F : (R, k)
    y : (R, 1)
        In units of what the model with both leaves.
    level : float
    """
    Q = orthonormal(np.column_stack(named))
    U = basis_beside(Q, F)
    k, dof = U.shape[1], len(y) - material.train.silent - Q.shape[1] - U.shape[1]
    explained = squares_along(U, y)[0]
    if not k or stats.f.sf(explained / k, k, dof) >= level:
        return False
    rows, simulated = material.train, material.bench.simulated
    if simulated.shape[2] < 2:
        return True
    white = material.noise.whiten(simulated.astype(float), rows.moving)
    Z = project_out(Q, white.reshape(-1, white.shape[2]))
    drawn = squares_along(U, Z)
    drawn *= dof / (np.sum(Z**2, axis=0) - drawn)
    return tail_of_sum(explained, drawn) < level


def say(beside: Sequence[Array], A: Array, y: Array) -> float:
    """Return what columns A (R, k) say of y (R, 1) beside others: minus the log of the tail."""
    U = basis_beside(orthonormal(np.column_stack(beside)), A)
    return -float(log_tail(squares_along(U, y), U.shape[1])[0]) if U.shape[1] else 0.0
