"""The whole before its parts: one name for what several were needed to say.

A search adds one name at a time. What acts in several joints at once, or has two columns in one
joint, is first found in pieces: a base that is tilted under a plane robot as offsets of its motors,
a play as a delay and a friction law. Each piece stands out beside the others, so none of them is
dropped again. One candidate that explains what all of them do, with no more columns, is the
simpler hypothesis: it has the name unless the data decide for the parts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from identifiability.workflows.diagnose.dictionary import Dictionary
from identifiability.workflows.diagnose.evidence import Scores
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.lookalikes import DECISIVE
from identifiability.workflows.diagnose.rows import Candidate

#: Scores of candidates beside others.
Score = Callable[[Sequence[Candidate], Sequence[Candidate]], Scores]
#: In which joints a candidate acts.
Reach = Callable[[Candidate], frozenset[int]]
#: A whole, and its parts.
Joined = tuple[Candidate, tuple[Candidate, ...]]


def find_whole(
    chosen: Sequence[Candidate],
    options: Sequence[Candidate],
    reach: Reach,
    score: Score,
    held: HeldOut,
    least: float,
) -> Joined | None:
    """Return a candidate with the choices that are its parts; None where there is none.

    Its likelihood is no worse than that of the parts by more than what decides between two names,
    where those with more columns pay for them; and the parts do not surely predict better what did
    not choose. Functions without a name are neither.

    Parameters
    ----------
    chosen : sequence of Candidate
    options : sequence of Candidate
        What may be a whole.
    reach : callable(Candidate) -> joints
        Parts act nowhere else than their whole.
    score : callable(beside, candidates) -> Scores
    held : HeldOut
    least : float
        Share by which several must predict better than one.
    """
    wholes: dict[tuple[int, ...], list[Candidate]] = {}
    for c in () if any(p.family.unnamed for p in chosen) else options:
        if c.family.unnamed:
            continue
        inside = tuple(k for k, p in enumerate(chosen) if reach(p) <= reach(c))
        if len(inside) > 1 and len(c.columns) <= count(chosen[k] for k in inside):
            wholes.setdefault(inside, []).append(c)
    for inside, own in wholes.items():
        rest = [c for k, c in enumerate(chosen) if k not in inside]
        whole = own[int(np.argmax(score(rest, own).fit))]
        parts = tuple(chosen[k] for k in inside)
        for some in (parts, explained(whole, rest, parts, score)):
            others = [c for c in chosen if c not in some]
            if len(some) < 2 or len(whole.columns) > count(some):
                continue
            one, several = score(others, [whole, together(some)]).fit
            if not one > several - DECISIVE:
                continue
            gain = held.gain([*others, whole], chosen)
            if gain.share <= max(least, gain.error):
                return whole, some
    return None


def explained(
    whole: Candidate, rest: Sequence[Candidate], parts: Sequence[Candidate], score: Score
) -> tuple[Candidate, ...]:
    """Return the parts that are not needed beside a whole, the least needed one taken out first."""
    left = list(parts)
    while left:
        beside = [[*rest, whole, *(o for o in left if o is not c)] for c in left]
        fits = [float(score(others, [c]).fit[0]) for others, c in zip(beside, left, strict=True)]
        at = int(np.argmin(fits))
        if fits[at] > DECISIVE:
            break
        del left[at]
    return tuple(c for c in parts if c not in left)


def together(parts: Sequence[Candidate]) -> Candidate:
    """Return some candidates as one of all their columns."""
    columns = tuple(k for c in parts for k in c.columns)
    return replace(parts[0], columns=columns, positive=all(c.positive for c in parts))


def count(parts: Iterable[Candidate]) -> int:
    """Return how many columns some candidates have."""
    return sum(len(c.columns) for c in parts)


def measure_reach(D: Dictionary) -> Reach:
    """Return what says in which joints a candidate acts."""
    joints: dict[int, list[int]] = {}
    for j in range(D.joints):
        for k in D.block(j).columns.tolist():
            joints.setdefault(k, []).append(j)
    return lambda c: frozenset(j for k in c.columns for j in joints.get(k, ()))
