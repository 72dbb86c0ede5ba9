"""`Cause`: a way in which values can change together, and all of them that a robot can have.

The friction of a joint, alike in both directions; a torque offset; another effect at a joint; a
load on a body; a single value of the bodies.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from identifiability.effects import title_of
from identifiability.foundation.names import INERTIAL, Array
from identifiability.foundation.values import frozen
from identifiability.regression.reduction import Rung
from identifiability.regression.structure import Structure
from identifiability.workflows.compare.difference import Difference

#: Directions of a cause that make less than this share of its largest are the same.
SAME = 1e-6

#: A load is tested by what its weight does; it may change all ten parameters of its body.
WEIGHT = ("m", "mx", "my", "mz")

#: The effect of which single values are causes.
BODIES = "rigid_body"


@frozen(kw_only=True)
class Cause:
    """A way in which values can change together.

    Attributes
    ----------
    kind : {"friction", "offset", "load", "effect", "value"}
    place : str
        Joint, body or parameter.
    what : str
        In words.
    names : tuple of str
        What its q numbers are.
    units : tuple of str
    design : (k, q)
        What a unit of each does to the values.
    tested : int
        How many of them, the first, it is tested by.
    """

    kind: str
    place: str
    what: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    design: Array
    tested: int


def find_causes(structure: Structure, rung: Rung, difference: Difference) -> tuple[Cause, ...]:
    """Return all causes that a difference can have under a model."""
    onto = difference.onto @ np.linalg.pinv(rung.M) @ structure.G
    found = [*_of_effects(structure), *_of_bodies(structure)]
    causes = []
    for kind, place, what, columns in found:
        names = tuple(" = ".join(structure.columns[c] for c in members) for members, _ in columns)
        units = tuple(structure.parameters[members[0]].unit for members, _ in columns)
        design = np.stack([onto[:, list(m)] @ np.array(sign) for m, sign in columns], 1)
        causes.append(
            Cause(
                kind=kind,
                place=place,
                what=what,
                names=names,
                units=units,
                design=design,
                tested=len(WEIGHT) if kind == "load" else len(names),
            )
        )
    rigid = {p.name for p in structure.parameters if p.group == BODIES}
    for k, column in enumerate(difference.kept):
        name = rung.columns[column]
        if name in rigid or name not in structure.columns:
            causes.append(
                Cause(
                    kind="value",
                    place=name,
                    what=rung.labels[column],
                    names=(name,),
                    units=(rung.units[column],),
                    design=np.eye(len(difference.kept))[:, [k]],
                    tested=1,
                )
            )
    size = np.sqrt(np.diag(difference.covariance))
    return tuple(c for c in causes if np.abs(c.design[:, : c.tested] / size[:, None]).max() > SAME)


_Columns = list[tuple[tuple[int, ...], tuple[float, ...]]]


def _of_effects(structure: Structure) -> Iterator[tuple[str, str, str, _Columns]]:
    """Yield causes at joints: friction, alike in both directions, offsets, and other effects."""
    offsets: dict[str, _Columns] = {}
    others: dict[tuple[str, str], _Columns] = {}
    for k, p in enumerate(structure.parameters):
        if p.group == "torque_offset":
            offsets[p.owner] = [((k,), (1.0,))]
        elif p.group != BODIES and p.kind not in ("Fc+", "Fc-") and "friction" not in p.group:
            others.setdefault((p.owner, p.group), []).append(((k,), (1.0,)))
    for joint, columns in structure.friction.items():
        yield "friction", joint, f"friction of {joint}", columns
        both = [members for members, _ in columns if len(members) == 2]
        if both:
            offsets.setdefault(joint, [(both[0], (1.0, -1.0))])
    for joint, columns in offsets.items():
        yield "offset", joint, f"torque offset of {joint}", columns
    for (joint, group), columns in others.items():
        yield "effect", joint, f"{title_of(group)} of {joint}", columns


def _of_bodies(structure: Structure) -> Iterator[tuple[str, str, str, _Columns]]:
    at = {name: k for k, name in enumerate(structure.columns)}
    for stem, title in structure.bodies.items():
        kinds = (*WEIGHT, *(kind for kind in INERTIAL if kind not in WEIGHT))
        columns: _Columns = [((at[f"{stem}{kind}"],), (1.0,)) for kind in kinds]
        yield "load", title, f"load of {title}", columns
