"""Which names stay: those that are what is missing in their joint, and can be there."""

from __future__ import annotations

from identifiability.workflows.diagnose.gates import Naming, keep_surviving
from identifiability.workflows.diagnose.material import Material


def keep_complete(material: Material, naming: Naming, *, alone: bool = False) -> Naming:
    """Return a naming without names that surely are not what is missing in their joint.

    They are taken out one after the other, the one that resembles it least first. What every joint
    has, friction and offsets, is there whatever else is missing; unless it is given alone, in
    doubt, as what explains most.
    """
    naming = keep_one_way(material, naming)
    least = material.setting.rules.confusable
    why = "what is missing in its joint resembles it too little"
    while naming.chosen:
        remains = material.remains(naming.chosen)
        found = [(c, remains.beside(c)) for c in naming.chosen if alone or not c.family.basic]
        against = [(one.similarity, c) for c, one in found if one and one.unlike(least)]
        if not against:
            break
        gone = [min(against, key=lambda pair: pair[0])[1]]
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
