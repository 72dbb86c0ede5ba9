"""What a step of naming can add, and what each costs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.names import Array
from identifiability.workflows.diagnose.rows import Candidate

#: Price of an effect that only some joints have, beside one that every joint has.
SPECIAL = 1.5
#: The place of an option that is in all places of its family.
EVERYWHERE = "all joints"


def price(c: Candidate) -> float:
    """Return what its fit is divided by: columns at a place, more for what not every joint has.

    Between two that explain about the same, the simpler one goes first; it is dropped again if
    the other one turns out to be needed in its stead.
    """
    return len(c.kinds) * (1.0 if c.family.basic else SPECIAL)


def list_options(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return what a step can add: every candidate, then every family and shape everywhere."""
    out = list(candidates)
    shared: dict[tuple[str, tuple[str, ...], int], list[Candidate]] = {}
    count: dict[tuple[str, str, tuple[str, ...]], int] = {}
    for c in candidates:
        at = count[c.slot] = count.get(c.slot, -1) + 1
        shared.setdefault((c.family.name, c.kinds, at), []).append(c)
    for same in shared.values():
        if len(same) > 1 and not same[0].family.unnamed:
            columns = tuple(k for c in same for k in c.columns)
            out.append(replace(same[0], place=EVERYWHERE, columns=columns, members=tuple(same)))
    return out


def signature(chosen: Sequence[Candidate]) -> set[tuple[str, str, tuple[str, ...]]]:
    """Return what is in a set of candidates, whatever the shapes."""
    return {c.slot for c in chosen}


def find_same(c: Candidate, candidates: Iterable[Candidate]) -> Candidate:
    """Return the candidate that is the same effect with the same shape."""
    return next(o for o in candidates if is_same(o, c))


def is_same(one: Candidate, other: Candidate) -> bool:
    """Whether two candidates are the same effect with the same shape."""
    own, its = ([c.shape, len(c.columns)] for c in (one, other))
    return one.slot == other.slot and np.array_equal(own, its, equal_nan=True)


def best_by_group(options: Sequence[Candidate], scores: Array) -> dict[tuple[str, str], float]:
    """Return the best score of every family and place."""
    out: dict[tuple[str, str], float] = {}
    for o, s in zip(options, scores, strict=True):
        out[o.group] = max(out.get(o.group, 0.0), float(s))
    return out
