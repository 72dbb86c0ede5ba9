"""Gates that a name must pass after the search: it predicts better, and so in a real robot.

Both look only at motion that chooses, never at the motion that verifies. What is refuted later
leaves a `Naming` with all that only refines it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.material import Rules
from identifiability.workflows.diagnose.rows import Candidate, Present

Chosen = list[Candidate]

#: Variations that shift the clock; they warn and do not refuse. A sample more or less moves the
#: reversal of every friction law, so that true friction of half the noise often fails them.
CLOCK = ("torque one sample earlier", "torque one sample later")
#: Score below which an effect has not survived: a one-sided p-value of one per cent.
SURVIVES = 4.6


@frozen
class Survival:
    """How an effect fares when the motion is made anew.

    Attributes
    ----------
    variation : str
    score : float
    same_sign : bool
    grown : bool
        Whether it grows with the noise of the motion, as what that noise makes does.
    """

    variation: str
    score: float
    same_sign: bool
    grown: bool = False

    @property
    def survived(self) -> bool:
        """Whether the effect would still be believed."""
        return self.score > SURVIVES and self.same_sign and not self.grown

    @property
    def refutes(self) -> bool:
        """Whether the name must go: it hangs on how the motion was made from the log."""
        return not self.survived and self.variation not in CLOCK


@frozen
class Step:
    """One step of the selection.

    Attributes
    ----------
    evidence : mapping of (family, place) to score
        The best over shapes.
    critical : float
        Score that noise alone exceeds with the family-wise level.
    best : (family, place)
    p_value : float
        Family-wise.
    gain : float
        Relative fall of the held-out error; nan where not tried.
    accepted : bool
        Whether the effect is still there at the end.
    reason : str
    withdrawn : bool
        Whether it was there, and went.
    """

    evidence: dict[tuple[str, str], float]
    critical: float
    best: tuple[str, str]
    p_value: float
    gain: float = float("nan")
    accepted: bool = False
    reason: str = ""
    withdrawn: bool = False


@frozen
class Nearest:
    """A name that was refused beside a function without one.

    Attributes
    ----------
    title : str
    worse : float
        By how much the motion that chooses is predicted worse with it in the function's stead, as
        a share.
    """

    title: str
    worse: float


@frozen
class Naming:
    """What was named.

    Attributes
    ----------
    chosen : tuple of Candidate
        In order of addition.
    p_values : mapping of (family, place) to float
    steps : tuple of Step
    stress : mapping of (family, place, kinds) to tuple of Survival
        How each fares when the motion is made anew.
    nearest : mapping of (family, place) to tuple of Nearest
        The names nearest to each function that has none.
    refused : tuple of Candidate
        Names in several joints of what one of these alone has.
    replaced : tuple of Candidate
        Names that functions without one took the place of.
    denied : tuple of Candidate
        Names that had gone before, where functions were named then.
    """

    chosen: tuple[Candidate, ...]
    p_values: Mapping[tuple[str, str], float]
    steps: tuple[Step, ...]
    stress: Mapping[tuple[str, str, tuple[str, ...]], tuple[Survival, ...]] = field(
        default_factory=dict
    )
    nearest: Mapping[tuple[str, str], tuple[Nearest, ...]] = field(default_factory=dict)
    refused: tuple[Candidate, ...] = ()
    replaced: tuple[Candidate, ...] = ()
    denied: tuple[Candidate, ...] = ()

    def then(self, later: Naming) -> Naming:
        """Return what a search that went on from here named, with the steps of both."""
        p_values = {**self.p_values, **later.p_values}
        return replace(later, p_values=p_values, steps=(*self.steps, *later.steps))


def list_units(chosen: Sequence[Candidate]) -> list[Chosen]:
    """Return what can be taken out: each candidate, and each family."""
    families = dict.fromkeys(c.family.name for c in chosen)
    whole = [[c for c in chosen if c.family.name == name] for name in families]
    return [[c] for c in chosen] + [w for w in whole if len(w) > 1]


def keep_useful(held: HeldOut, chosen: Sequence[Candidate], rules: Rules) -> Chosen:
    """Return the choices without what does not predict motion that did not fit it better."""
    return _take_out(list(chosen), lambda rest, whole: held.gain(rest, whole).share - rules.gain)


def keep_where(
    held: HeldOut, beside: Sequence[Candidate], new: Sequence[Candidate], rules: Rules
) -> list[Candidate]:
    """Return those of some candidates that predict better beside others, one by one or together."""

    def margin(rest: Chosen, whole: Chosen) -> float:
        return held.gain([*beside, *rest], [*beside, *whole]).share - rules.gain

    return _take_out(list(new), margin)


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


def has_place(c: Candidate, beside: Sequence[Candidate], present: Present) -> bool:
    """Whether what a candidate refines, if it refines anything, is beside it or in the model."""
    needed = c.family.needs, c.place
    return not c.family.needs or needed in present or needed in {other.group for other in beside}


def keep_surviving(
    naming: Naming, refuted: Sequence[Candidate], present: Present, reason: str
) -> Naming:
    """Return a naming without candidates that are refuted, and without what only refines them.

    Parameters
    ----------
    naming : Naming
    refuted : sequence of Candidate
    present : collection of (family, place)
        What the base model has.
    reason : str
        What refutes them, for the steps that named them.
    """
    left = [c for c in naming.chosen if c not in refuted]
    kept = tuple(c for c in left if has_place(c, left, present))
    lost = {c.family.name for c in naming.chosen} - {c.family.name for c in kept}
    steps = tuple(
        replace(s, accepted=False, reason=reason, withdrawn=True)
        if s.accepted and s.best[0] in lost
        else s
        for s in naming.steps
    )
    return replace(naming, chosen=kept, steps=steps)
