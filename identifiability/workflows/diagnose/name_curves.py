"""Functions of the position have a name: torque along the position, where that may be given."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from identifiability.workflows.diagnose.evidence import score_candidates
from identifiability.workflows.diagnose.gates import Naming
from identifiability.workflows.diagnose.in_bodies import keep_off_bodies
from identifiability.workflows.diagnose.lookalikes import DECISIVE
from identifiability.workflows.diagnose.material import Material
from identifiability.workflows.diagnose.options import find_same, signature
from identifiability.workflows.diagnose.rows import Candidate
from identifiability.workflows.diagnose.spans import orthonormal

#: A curve over the position, without and with its name.
CURVE, NAMED_CURVE = "function_of_position", "position_torque"


def name_curves(
    material: Material, again: Naming, wider: Material
) -> tuple[Material, tuple[Candidate, ...], Mapping[tuple[str, str], float]]:
    """Return what is chosen with functions, curves over the position by the name that they have.

    Whatever depends on the position of a joint alone is what that name means: where it may be
    named, a function says no more. It has as many pieces as predict best, and the p-value. But a
    constant is a function of anything; and what forces on the bodies say, and more, several joints
    feel: that keeps no name in one of them.

    Returns
    -------
    whole : Material
        With the functions that are left.
    chosen : tuple of Candidate
        Of it.
    p_values : mapping of (family, place) to float
    """
    curves = [c for c in again.chosen if c.family.name == CURVE]
    but = {c.place for c in curves if not is_curved(wider, again.chosen, c)}
    found = whole, chosen, p_values = _name_curves(material, again, wider, but)
    if all(c.slot in signature(again.chosen) for c in chosen):
        return found
    kept = keep_off_bodies(whole, Naming(chosen, p_values, ())).chosen
    shared = {c.place for c in chosen if c not in kept}
    return _name_curves(material, again, wider, but | shared) if shared else found


def _name_curves(
    material: Material, again: Naming, wider: Material, but: Collection[str]
) -> tuple[Material, tuple[Candidate, ...], Mapping[tuple[str, str], float]]:
    """Return the same, whatever other joints feel, but for some joints."""
    taken = {c.group for c in again.chosen}
    curves = {
        (CURVE, c.place): c.group
        for c in material.candidates
        if c.family.name == NAMED_CURVE and c.group not in taken and c.place not in but
    }
    left = [c for c in again.chosen if c.family.unnamed and c.group not in curves]
    whole = material.extended(left, wider if left else None)
    p_values = dict(again.p_values)
    options = []
    for c in again.chosen:
        name = curves.get(c.group)
        options.append([o for o in whole.candidates if o.group == name])
        if name is None:
            options[-1] = [find_same(c, whole.candidates)]
        else:
            p_values[name] = p_values.get(c.group, float("nan"))
    chosen = [several[0] for several in options]
    for at, several in enumerate(options):
        if len(several) > 1:
            rest = [*chosen[:at], *chosen[at + 1 :]]
            chosen[at] = min(([*rest, o] for o in several), key=whole.held.error)[-1]
    return whole, tuple(chosen), p_values


def is_curved(m: Material, chosen: Sequence[Candidate], function: Candidate) -> bool:
    """Whether the data decide for a function over a constant, which any function contains."""
    model = m.white.columns([c for c in chosen if c is not function])
    constant = m.white.D[:, list(function.columns)].sum(1)  # splines add up to one
    beside = orthonormal(np.column_stack([model, constant]))
    return float(score_candidates(m.white, beside, [function], null=False).fit[0]) > DECISIVE
