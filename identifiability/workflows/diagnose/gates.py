"""Gates that a name must pass after the search: it predicts better, and so in a real robot.

Both look only at motion that chooses, never at the motion that verifies.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.rows import Candidate
from identifiability.workflows.diagnose.rules import Rules

Chosen = list[Candidate]


def list_units(chosen: Sequence[Candidate]) -> list[Chosen]:
    """Return what can be taken out: each candidate, and each family."""
    families = dict.fromkeys(c.family.name for c in chosen)
    whole = [[c for c in chosen if c.family.name == name] for name in families]
    return [[c] for c in chosen] + [w for w in whole if len(w) > 1]


def keep_useful(held: HeldOut, chosen: Sequence[Candidate], rules: Rules) -> Chosen:
    """Return the choices without what does not predict motion that did not fit it better."""
    return _take_out(list(chosen), lambda rest, whole: held.gain(rest, whole).share - rules.gain)


def keep_possible(
    held: HeldOut, chosen: Sequence[Candidate], candidates: Sequence[Candidate], rules: Rules
) -> Chosen:
    """Return the choices without what gains nothing once every fit must be a real robot.

    Only what some joints have must prove itself, and beside what every joint has at every place: a
    spring that stands in for friction nobody looked for in its joint is no spring. Friction,
    rotors and offsets themselves are not refused: without them it is the bodies that give way.
    The gain must exceed its standard error [Breiman 1984].
    """
    if held.real is None:
        return list(chosen)
    basic = [c for c in chosen if c.family.basic]
    around = add_places(basic, candidates)
    special = [c for c in chosen if not c.family.basic]

    def margin(rest: Chosen, whole: Chosen) -> float:
        gain = held.gain([*around, *rest], [*around, *whole], real=True)
        return min(gain.share - rules.gain, gain.share - gain.error)

    kept = _take_out(special, margin)
    return [c for c in chosen if c.family.basic or c in kept]


def add_places(chosen: Sequence[Candidate], candidates: Sequence[Candidate]) -> Chosen:
    """Return some candidates with their families at every other place."""
    families, out = {c.family.name for c in chosen}, list(chosen)
    groups = {c.group for c in out}
    for c in candidates:
        if c.family.name in families and c.group not in groups:
            out.append(c)
            groups.add(c.group)
    return out


def _take_out(chosen: Chosen, margin: Callable[[Chosen, Chosen], float]) -> Chosen:
    """Take out one unit after the other, the one with the least margin first."""
    while chosen:
        rests = [[c for c in chosen if c not in unit] for unit in list_units(chosen)]
        margins = [margin(rest, chosen) for rest in rests]
        if min(margins) > 0:
            break
        chosen = rests[int(np.argmin(margins))]
    return chosen
