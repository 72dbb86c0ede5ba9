"""Which names stay: those that explain more than they leave in their joint, and can be there."""

from __future__ import annotations

from identifiability.workflows.diagnose.gates import Naming, keep_surviving
from identifiability.workflows.diagnose.material import Material


def keep_complete(material: Material, naming: Naming) -> Naming:
    """Return a naming without names in whose joint more is left than they explain.

    They are taken out one after the other, the one that leaves most over what it explains first.
    What every joint has, friction and offsets, is there whatever else is missing.
    """
    naming = keep_one_way(material, naming)
    why = "more is left in its joint than it explains"
    while naming.chosen:
        remains = material.remains(naming.chosen)
        found = [(c, remains.beside(c)) for c in naming.chosen if not c.family.basic]
        against = [(one.ratio, c) for c, one in found if one is not None and one.outweighs]
        if not against:
            break
        gone = [max(against, key=lambda pair: pair[0])[1]]
        naming = keep_surviving(naming, gone, material.setting.structure.present, why)
    return naming


def keep_one_way(material: Material, naming: Naming) -> Naming:
    """Return a naming without joints of a closed chain that drag one another by their speeds.

    In one drive that may be a hose or a voltage; in several of them it is friction between bodies
    that no motor drives, and no leak.
    """
    drags = [c for c in naming.chosen if c.family.origin and c.family.against == "velocity"]
    drags = [c for c in drags if not c.family.unnamed]
    structure = material.setting.structure if len({c.place for c in drags}) > 1 else None
    if structure is None or not structure.robot.passive:
        return naming
    why = "joints of a closed chain that drag one another have friction between them"
    return keep_surviving(naming, drags, structure.present, why)
