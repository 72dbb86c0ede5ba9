"""What every joint has may stand in for something else: offsets, rotors where motion is harmonic.

Friction, rotors and offsets are there whatever else is missing, so they are not asked whether they
are all that is missing in their joint. But a torque by the position, or a share of what this or
another motor carries, has a mean, which is an offset, and what swings with a position is an
acceleration; what it does not explain of that others do, in other joints. Where one such function
leaves such names no more to say than the best of so many has by chance, and surely explains more,
they go: for a name of its own, or a function without one. A true offset loses its name at the level
of the test alone, which the functions share [Bonferroni]. If that is the cause, it leaves nothing
in its joint: where anything else surely explains what it leaves, as in a robot of which the model
misses much, names stay. They also stay where the motion is too short to say what is left there:
rows of other joints say nothing of it, and one column takes something of all that is missing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.names import Array
from identifiability.workflows.diagnose.anything import list_together
from identifiability.workflows.diagnose.gates import Chosen, Naming, keep_surviving
from identifiability.workflows.diagnose.in_bodies import find_needless, say, says_more, write_curve
from identifiability.workflows.diagnose.leftover import LEVEL, ROWS, in_units_of_rest
from identifiability.workflows.diagnose.material import Material
from identifiability.workflows.diagnose.rows import Candidate


def keep_no_stand_ins(material: Material, naming: Naming) -> Naming:
    """Return a naming without what every joint has where another function says it, and more."""
    places = dict.fromkeys(c.place for c in naming.chosen if c.family.basic)
    if not places:
        return naming
    gone: Chosen = []
    joints = material.setting.structure.robot.joints
    for place in places:
        names = [c for c in naming.chosen if c.family.basic and c not in gone]
        if place in joints and any(c.place == place for c in names):
            j = joints.index(place)
            found = find_stand_ins(material, naming.chosen, names, j)
            if found and material.remains(naming.chosen).joints[j] is not None:
                gone += found
    why = "something else in one joint explains what it does, and more"
    return keep_surviving(naming, gone, material.setting.structure.present, why)


def find_stand_ins(
    material: Material, chosen: Sequence[Candidate], names: Sequence[Candidate], j: int
) -> Chosen:
    """Return the names that say nothing beside a function in joint j, if that is the better one.

    Parameters
    ----------
    material : Material
    chosen : sequence of Candidate
        All that was named.
    names : sequence of Candidate
        Those of them that are asked for.
    j : int
    """
    rows, noise = material.train, material.noise
    torque = rows.tau - material.held.fitted_residual(chosen)

    def whiten(columns: Array) -> Array:
        return noise.whiten(columns, rows.moving).reshape(-1, columns.shape[2])

    def inside(columns: Array) -> Array:
        out = np.zeros((*rows.tau.shape, columns.shape[1]))
        out[:, j] = columns
        return whiten(out)

    y = whiten(rows.tau[:, :, None])
    X = whiten(rows.columns([c for c in chosen if c not in names]))
    own = [whiten(rows.D.take(c.columns)) for c in names]
    tried = [inside(A) for A in (write_curve(rows.q[:, j]), *torque.T[:, :, None])]
    other = inside(list_together(rows, torque, j))
    one = tried[int(np.argmax([say([X, *own], A, y) for A in tried]))]
    y, dof = in_units_of_rest(y, [X, one, *own])
    if dof < ROWS * other.shape[1]:
        return []
    if not says_more(material, [X, *own], one, y, LEVEL / len(tried)):
        return []
    if says_more(material, [X, one, *own], other, y):
        return []
    gone = find_needless(material, [X, one], own, y)
    return [c for c, needless in zip(names, gone, strict=True) if needless]
