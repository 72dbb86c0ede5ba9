"""The whole before its parts: one name for what several were needed to say.

A search adds one name at a time, the cheapest first. What acts in several joints at once, or has
several columns in one, is first found in pieces: a base that is tilted under a plane robot as
offsets of its motors, a cable as a spring and a drift. Each piece stands out beside the others, so
none of them is dropped again. One candidate that explains what all of them do is the simpler
hypothesis: it has the name unless the data decide for the parts. And what was found as one name,
because it is cheaper, gives way to another one if the data decide for that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
#: What may stand beside others.
Eligible = Callable[[Sequence[Candidate]], Sequence[Candidate]]
#: A whole, and its parts.
Joined = tuple[Candidate, tuple[Candidate, ...]]


def find_whole(
    chosen: Sequence[Candidate],
    eligible: Eligible,
    reach: Reach,
    score: Score,
    held: HeldOut,
    least: float,
) -> Joined | None:
    """Return a candidate with the choices whose name it takes; None where there is none.

    Likelihoods compare by their tails, so that who has more columns pays for them. One candidate
    takes the place of several unless these are better by what decides between two names, or surely
    predict better what did not choose; it takes the place of one if it is better by as much, and
    predicts better. Functions without a name do neither.

    Parameters
    ----------
    chosen : sequence of Candidate
    eligible : callable(beside) -> candidates
        What may stand beside others.
    reach : callable(Candidate) -> joints
        Parts act nowhere else than their whole.
    score : callable(beside, candidates) -> Scores
    held : HeldOut
    least : float
        Share by which several must predict better than one.
    """
    if any(c.family.unnamed for c in chosen):
        return None
    for inside in _list_parts(chosen, eligible(chosen), reach):
        parts = [chosen[k] for k in inside]
        rest = [c for k, c in enumerate(chosen) if k not in inside]
        where = frozenset().union(*map(reach, parts))
        own = [c for c in eligible(rest) if where <= reach(c) and not c.family.unnamed]
        if not own:
            continue
        whole = own[int(np.argmax(score(rest, own).fit))]
        for some in dict.fromkeys((tuple(parts), explained(whole, rest, parts, score))):
            others = [c for c in chosen if c not in some]
            if not some or some == (whole,) or whole in others:
                continue
            one, several = score(others, [whole, together(some)]).fit
            gain = held.gain([*others, whole], chosen)
            if len(some) > 1:
                takes = one > several - DECISIVE and gain.share <= max(least, gain.error)
            else:
                takes = one > several + DECISIVE and gain.share < 0
            if takes:
                return whole, some
    return None


def _list_parts(
    chosen: Sequence[Candidate], options: Sequence[Candidate], reach: Reach
) -> list[tuple[int, ...]]:
    """Return which choices act where one candidate could, several together before each alone."""
    where = {reach(c) for c in (*options, *chosen)}
    several = {tuple(k for k, c in enumerate(chosen) if reach(c) <= joints) for joints in where}
    alone = {(k,) for k in range(len(chosen))}
    return sorted((several | alone) - {()}, key=lambda inside: (-len(inside), inside))


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


def measure_reach(D: Dictionary) -> Reach:
    """Return what says in which joints a candidate acts."""
    joints: dict[int, list[int]] = {}
    for j in range(D.joints):
        for k in D.columns(j).tolist():
            joints.setdefault(k, []).append(j)
    return lambda c: frozenset(j for k in c.columns for j in joints.get(k, ()))
