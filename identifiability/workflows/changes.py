"""`Change`: a difference between logs or parts of a log, with size, place and time.

It also lists competing hypotheses.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any

import numpy as np

from identifiability.effects import FAMILIES, find_families
from identifiability.estimation.differences import Differences
from identifiability.estimation.groups import describe_term, place_of
from identifiability.estimation.mixed_model import MixedModel, Term, Terms
from identifiability.estimation.rules import RULES
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.foundation.presenter import presented
from identifiability.foundation.values import frozen
from identifiability.regression.columns import Candidate, number
from identifiability.robot import Robot

#: Families that may differ, other than loads.
DIFFERING = (
    "coulomb_friction",
    "viscous_friction",
    "torque_offset",
    "torque_scale",
    "passive_joint_friction",
)
#: Parameters of a load that its weight determines.
WEIGHT = INERTIAL_KINDS[:4]


def list_changes(robot: Robot, bodies: Sequence[str]) -> tuple[Candidate, ...]:
    """Return possible differences between rows of a robot: a load on some bodies, and families.

    A load has either the parameters that its weight determines, or all ten. Both are candidates.
    """
    rigid = FAMILIES["rigid_body"].effect
    loads: tuple[tuple[str, ...], ...] = (WEIGHT, INERTIAL_KINDS)
    found = [(FAMILIES["payload"], rigid, body, kinds) for body in bodies for kinds in loads]
    for family in find_families(DIFFERING):
        for place, own in groupby(family.effect.parameters(robot), lambda p: p.owner):
            found.append((family, family.effect, place, tuple(p.kind for p in own)))
    candidates = []
    for family, effect, place, kinds in found:
        columns = tuple(range(len(kinds)))
        candidates.append(Candidate(family, place, np.nan, kinds, effect, columns))
    return tuple(number(candidates))


@frozen
class DifferentTorque:
    """Torque of a log minus the torque that the model has in all logs.

    Attributes
    ----------
    t : (N,) [s]
    whole : (N, n) [N·m or N]
        All of the torque.
    measured, explained : (N, n) [N·m or N]
        The measured difference, and its part that the changes explain; NaN where torque is no data.
    """

    t: Array
    whole: Array
    measured: Array
    explained: Array

    @staticmethod
    def of(found: Differences, terms: Terms) -> DifferentTorque:
        """Return the torque of the first log minus that of the model of all logs."""
        seen, p, a = found.missing.seen, len(found.known.precision), found.always.shape[1]
        value = found.solve(terms)[0]
        explained = np.where(seen.data, 0.0, np.nan)
        sizes = found.always @ value[p : p + a]
        each = np.concatenate([np.empty(0, int), *map(found.at, terms)])
        sizes[each] += value[found.model.fixed :]
        for (j, k), x in found.missing.entries.items():
            explained[:, j] += sizes[k] * x
        measured = np.where(seen.data, seen.y - seen.X @ value[:p], np.nan)
        explained = np.where(seen.data, explained, np.nan)
        first = seen.log == 0
        return DifferentTorque(seen.t[first], seen.raw[first], measured[first], explained[first])


# `Change`: a difference with size, place and time.


@frozen(kw_only=True)
class Change:
    """A change between logs or during a log.

    Attributes
    ----------
    kind : {"load", "friction", "offset", "gain"}
    family, what, place : str
        Its name; its description; and the body or joint, ``all joints`` where it is everywhere.
    log : str
        The only log with the change; empty if all compared logs have it.
    names, units : tuple of str
        Of its q numbers.
    sizes, sd : (q,)
        Of these, given all other changes.
    share, share_sd : float
        Change relative to its torque before; NaN where that is not known.
    odds : float
        Log odds, averaged over sizes and ways, less the price of families and places; those of its
        surest part.
    others : tuple of str
        Competing hypotheses,
    rivals : tuple of (family, place)
        and their names.
    start, stop : float [s]
        When it began and ended; infinite where that was not logged.
    began, ended : (float, float) [s]
        95 % intervals of these instants.
    weight : float
        Its posterior probability among all possible changes in part of a log.
    """

    kind: str
    family: str
    what: str
    place: str
    log: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    sizes: Array
    sd: Array
    odds: float
    others: tuple[str, ...]
    share: float = np.nan
    share_sd: float = np.nan
    rivals: tuple[tuple[str, str], ...] = ()
    start: float = -np.inf
    stop: float = np.inf
    began: tuple[float, float] = (-np.inf, -np.inf)
    ended: tuple[float, float] = (np.inf, np.inf)
    weight: float = np.nan

    @property
    def whole(self) -> bool:
        """Whether it lasted as long as the log."""
        return bool(np.isinf(self.start) and np.isinf(self.stop))

    @property
    def sure(self) -> bool:
        """Whether its odds exceed the thresholds of fitted and unseen rows together."""
        return self.odds >= RULES.name + RULES.keep

    @property
    @presented
    def when(self) -> str:
        """In words: ``from 41 s (95 %: 40.5 … 41.5 s) of run2``."""
        raise NotImplementedError

    @property
    @presented
    def called(self) -> str:
        """Description of the change without a capital letter, with competing hypotheses."""
        raise NotImplementedError


def _describe(found: Differences, term: Term, names: Sequence[str]) -> str:
    """Return a description of a group."""
    own = found.whose(term)
    if not own.pattern:
        return f"{describe_term(term)} that the model lacks"
    where = own.odd(names)
    return f"{own.title} of {place_of(term)}{f' in {where}' if where else ''}"


def rows_of(model: MixedModel, terms: Terms, k: int) -> np.ndarray:
    """Return the indices of the values of a term in a solution, (m,)."""
    first = model.fixed + sum(t.size for t in terms[:k])
    return first + np.arange(terms[k].size)


def list_log_changes(found: Differences, terms: Terms, names: Sequence[str]) -> tuple[Change, ...]:
    """Return the changes of terms, the surest first; friction at one place is one change.

    Parameters
    ----------
    found : Differences
    terms : tuple of Term
    names : sequence of str
        Of the logs, or of those that blocks are of.
    """
    known, together = found.known, defaultdict[Any, list[int]](list)
    for k, term in enumerate(terms):
        own = found.whose(term)
        if own.pattern:
            together[own.kind, place_of(term), own.pattern].append(k)
    value, covariance = found.solve(terms)
    levels = found.levels(known.base + known.directions @ value[: len(known.precision)])
    changes = []
    for which in together.values():
        at = np.concatenate([rows_of(found.model, terms, k) for k in which])
        columns = np.concatenate([found.at(terms[k]) for k in which])
        spread = covariance[np.ix_(at, at)]
        share = _share_of(levels[columns], found.missing.scale[columns], value[at], spread)
        change = _join_terms(found, terms, which, names)
        sd = np.sqrt(np.diag(spread))
        changes.append(replace(change, sizes=value[at], sd=sd, share=share[0], share_sd=share[1]))
    return tuple(sorted(changes, key=lambda c: -c.odds))


def _share_of(level: Array, rms: Array, sizes: Array, spread: Array) -> tuple[float, float]:
    """Return the change as a share of the torque before, and its standard error.

    NaN where the torque before is not known.

    Parameters
    ----------
    level, rms : (q,)
        Numbers before the change, and the torque that each makes at 1.
    sizes, spread : (q,), (q, q)
        Changes of these numbers, and their covariance.
    """
    if not (np.abs(level) > 0).all():
        return np.nan, np.nan
    slope = rms * np.sign(level) / (np.abs(level) @ rms)
    return float(slope @ sizes), float(np.sqrt(slope @ spread @ slope))


def _join_terms(
    found: Differences, terms: Terms, which: Sequence[int], names: Sequence[str]
) -> Change:
    """Return the change of some terms at one place, without its size."""
    place, parts = place_of(terms[which[0]]), [found.whose(terms[k]) for k in which]
    columns = [found.columns[n] for k in which for n in found.at(terms[k]).tolist()]
    _, called, units = zip(*columns, strict=True)
    rivals = [r for k in which for r in found.model.rivals(terms, k) if r.odds > 0]
    alike = len({c.family.name for c in parts}) == 1
    return Change(
        kind=parts[0].kind,
        family=parts[0].family.name,
        what=f"{parts[0].title if alike else parts[0].kind} of {place}",
        place=place,
        log=parts[0].odd(names),
        names=called,
        units=units,
        sizes=np.empty(0),
        sd=np.empty(0),
        odds=max(terms[k].odds for k in which),
        others=tuple(dict.fromkeys(_describe(found, r, names) for r in rivals)),
    )
