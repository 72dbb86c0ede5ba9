"""A function without a name gives back the names that it replaced where unseen motion says so.

Whatever law there is is a function, too: one took the place of a name because it explains the
fitted motion better, or because what the name leaves spoke against it, which by chance it does in
one joint of a hundred. Where the motion that verifies refutes the function, or motion made anew
does, there is no reason any more to deny the name. And where a name foretells the unseen motion at
least as well as the function, the errors of all values known, its law is what the function had
learned: a wrong name leaves there what the function says, a true one leaves nothing, and the
function pays for its further numbers.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from identifiability.workflows.diagnose.gates import Chosen, Naming, has_place, keep_surviving
from identifiability.workflows.diagnose.lookalikes import DECISIVE
from identifiability.workflows.diagnose.material import Material
from identifiability.workflows.diagnose.options import is_same
from identifiability.workflows.diagnose.rows import Candidate, Present

#: Ways to be given: the fitted motion names it, or unseen motion decides what that left open
#: [Bonferroni].
WAYS = 2
#: Names that may stand at a place in the stead of the functions there.
Preferred = Mapping[str, Chosen]


def with_denied(
    naming: Naming, denied: Iterable[Candidate], m: Material, elsewhere: Collection[str] = ()
) -> Naming:
    """Return a naming that remembers the names that were denied where it has functions now.

    Not where the cause is elsewhere: in a joint that feels forces on the bodies a spring foretells
    as much as a function of the position, and is no more what is missing. Nor what every joint has,
    which was denied as the mean of something else: so it is of the function.

    Parameters
    ----------
    naming : Naming
    denied : iterable of Candidate
    m : Material
    elsewhere : collection of str
        Joints where a name was denied because of what other joints feel as well.
    """
    places = {c.place for c in naming.chosen if c.family.unnamed} - set(elsewhere)
    there = [c for c in denied if c.place in places and not c.family.basic]
    own = (o for c in there for o in m.candidates if is_same(o, c))
    return replace(naming, denied=tuple(own))


def list_preferred(m: Material, naming: Naming) -> dict[str, Chosen]:
    """Return names that make unseen motion as likely as the functions at their place, by place.

    The names that functions replaced there, or one that was denied, beside all else, if unseen
    motion decides for them at all. Each name is a cause of its own: beyond as many as there are
    functions every one takes what decides between two.

    Parameters
    ----------
    m : Material
    naming : Naming
        What unseen motion left of it.
    """
    found: dict[str, Chosen] = {}
    for place in dict.fromkeys(c.place for c in naming.chosen if c.family.unnamed):
        replaced = [c for c in naming.replaced if c.place == place]
        options = [[c] for c in naming.denied if c.place == place]
        options += [replaced] if replaced else []
        if not options:
            continue
        functions = [c for c in naming.chosen if c.place == place and c.family.unnamed]
        rest = [c for c in naming.chosen if c not in functions]
        said = [
            _foretell(m, rest, own) - DECISIVE * max(len(own) - len(functions), 0)
            for own in options
        ]
        best = int(np.argmax(said))
        if said[best] >= max(_foretell(m, rest, functions), DECISIVE):
            found[place] = options[best]
    return found


def _foretell(m: Material, rest: Chosen, own: Sequence[Candidate]) -> float:
    """Return by how much some candidates make unseen motion likelier, as a logarithm."""
    chosen = [*rest, *own]
    model = m.train.X.shape[2] + sum(len(c.columns) for c in rest)
    width = sum(len(c.columns) for c in own)
    return m.unseen(chosen).of_effect(range(model, model + width)).evidence


def give_back(
    naming: Naming,
    gone: Collection[tuple[str, str]],
    present: Present,
    preferred: Preferred = MappingProxyType({}),
) -> Naming | None:
    """Return a naming in which some functions give way to names.

    The names have had the fitted motion's word; that unseen motion chose is a second way.

    Parameters
    ----------
    naming : Naming
        Before unseen motion was asked.
    gone : collection of (family, place)
        What is refuted: functions give way to what they replaced in their joint, and if none of
        them is left, everywhere.
    present : collection of (family, place)
        What the base model has.
    preferred : mapping of place to list of Candidate
        Names to which functions give way whether they are refuted or not.

    Returns
    -------
    Naming or None
        None where no name comes back.
    """
    functions = [c for c in naming.chosen if c.family.unnamed]
    refuted = [c for c in functions if c.group in gone]
    places = {c.place for c in refuted}
    if refuted == functions:
        places |= {c.place for c in naming.replaced}
    back = [c for c in naming.replaced if functions and c.place in places - preferred.keys()]
    back += [c for own in preferred.values() for c in own]
    if not back:
        return None
    without = [c for c in functions if c in refuted or c.place in preferred]
    why = "a name that it replaced comes back, for unseen motion refutes it or says no more for it"
    left = keep_surviving(naming, without, present, why)
    again = {c.family.name for c in back}
    steps = tuple(
        replace(s, accepted=True, reason="named, in the stead of a function", withdrawn=False)
        if s.withdrawn and s.best[0] in again
        else s
        for s in left.steps
    )
    chosen = [*left.chosen, *back]
    p_values = {c.group: min(WAYS * naming.p_values.get(c.group, float("nan")), 1.0) for c in back}
    return replace(
        left,
        chosen=tuple(c for c in chosen if has_place(c, chosen, present)),
        p_values={**naming.p_values, **p_values},
        steps=steps,
        replaced=tuple(c for c in naming.replaced if c not in back),
    )
