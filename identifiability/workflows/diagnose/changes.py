"""`Change`: what differs between logs or parts of one, of which size, where and when.

And what it may be instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from identifiability.effects import FAMILIES, find_families
from identifiability.estimation.differences import Differences
from identifiability.estimation.groups import describe_term, place_of
from identifiability.estimation.mixed_model import Term, Terms
from identifiability.estimation.rules import RULES
from identifiability.foundation.errors import listing
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.foundation.rounding import REACH, measured
from identifiability.foundation.values import frozen
from identifiability.regression.columns import Candidate, number
from identifiability.robot import Robot

#: Families that may differ beside loads.
DIFFERING = (
    "coulomb_friction",
    "viscous_friction",
    "torque_offset",
    "torque_scale",
    "passive_joint_friction",
)
#: Parameters of a load that its weight tells.
WEIGHT = INERTIAL_KINDS[:4]


def list_changes(robot: Robot, bodies: Sequence[str]) -> tuple[Candidate, ...]:
    """Return what may differ between rows of a robot: a load on some bodies, and families.

    A load has those parameters that its weight tells, or all: nobody knows which.
    """
    rigid = FAMILIES["rigid_body"].effect
    loads: tuple[tuple[str, ...], ...] = (WEIGHT, INERTIAL_KINDS)
    found = [(FAMILIES["payload"], rigid, body, kinds) for body in bodies for kinds in loads]
    for family in find_families(DIFFERING):
        for place, own in groupby(family.effect.parameters(robot), lambda p: p.owner):
            found.append((family, family.effect, place, tuple(p.kind for p in own)))
    return tuple(
        number(
            [Candidate(f, place, np.nan, k, e, tuple(range(len(k)))) for f, e, place, k in found]
        )
    )


@frozen
class DifferentTorque:
    """Torque of a log beside what a model has in all of them.

    Attributes
    ----------
    t : (N,) [s]
    whole : (N, n) [N·m or N]
        All of the torque.
    measured, explained : (N, n) [N·m or N]
        What differs as measured, and by what was found; NaN where torque is no data.
    """

    t: Array
    whole: Array
    measured: Array
    explained: Array

    @staticmethod
    def of(found: Differences, terms: Terms) -> DifferentTorque:
        """Return what the torque of the first log has beside the model of all."""
        seen, p, a = found.missing.seen, len(found.known.precision), found.always.shape[1]
        value, explained = found.solve(terms)[0], np.where(seen.data, 0.0, np.nan)
        sizes = found.always @ value[p : p + a]
        each = np.concatenate([np.empty(0, int), *map(found.at, terms)])
        sizes[each] += value[found.model.fixed :]
        for (j, k), x in found.missing.entries.items():
            explained[:, j] += sizes[k] * x
        both = (np.where(seen.data, x, np.nan) for x in (seen.y - seen.X @ value[:p], explained))
        return DifferentTorque(*(x[seen.log == 0] for x in (seen.t, seen.raw, *both)))


# `Change`: what differs, of which size, where and when.


#: What a change is called that cannot be told apart, and parameters, at most.
NAMED = 6


@frozen(kw_only=True)
class Change:
    """What changed between logs, or while one was recorded.

    Attributes
    ----------
    kind : {"load", "friction", "offset", "gain"}
    family, what, place : str
        Its name; it in words; and the body or joint, ``all joints`` where it is everywhere.
    log : str
        In which alone it is; empty where it is in all of those that are asked about.
    names, units : tuple of str
        Of its q numbers.
    sizes, sd : (q,)
        Of these, beside all others that changed.
    share, share_sd : float
        Of its torque before; NaN where that is not known.
    odds : float
        Log odds, averaged over sizes and ways, less what families and places cost; those of its
        surest part.
    others : tuple of str
        What else it may be,
    rivals : tuple of (family, place)
        and that by name.
    start, stop : float [s]
        When it began and ended; infinite where that was not logged.
    began, ended : (float, float) [s]
        Where these instants are in 95 % of what is likely.
    weight : float
        Its posterior probability among all that may have changed in part of a log.
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
    share: float
    share_sd: float
    odds: float
    others: tuple[str, ...]
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
    def when(self) -> str:
        """In words: ``from 41 s (95 %: 40.5 … 41.5 s) of run2``."""
        ends = ("from", self.start, self.began), ("until", self.stop, self.ended)
        told = [
            f"{word} {at:.3g} s (95 %: {low:.3g} … {high:.3g} s)"
            for word, at, (low, high) in ends
            if np.isfinite(at)
        ]
        if told:
            return f"{' '.join(told)} of {self.log}"
        return f"in {self.log}" if self.log else ""

    @property
    def called(self) -> str:
        """What it is, without a capital letter, and what it may be instead."""
        text = " ".join(filter(None, (self._sized, self.when)))
        if self.others:
            text += f", or {' or '.join(self.others[:NAMED])}"
        # As sure as what fitted and unseen rows together name.
        return text if self.odds >= RULES.name + RULES.keep else f"perhaps {text}"

    @property
    def _sized(self) -> str:
        """What it is; of one everywhere what is sure, where its sum is not."""
        half = REACH * self.sd
        size, reach, unit = 100 * self.share, 100 * REACH * self.share_sd, "%"
        words = "rose", "fell"
        if self.kind == "load":
            size, reach, unit, words = self.sizes[0], half[0], "kg", ("grew", "shrank")
        if abs(size) > reach:
            return f"{self.what} {words[int(size < 0)]} by {measured(abs(size), reach, unit)}"
        every = zip(self.names, self.sizes, half, self.units, strict=True)
        shares = ((n, 100 * x, 100 * h, "%") if u == "1" else (n, x, h, u) for n, x, h, u in every)
        parts = [f"{n} by {measured(x, h, u)}" for n, x, h, u in shares if abs(x) > h]
        return f"{self.what} changed{': ' if parts else ''}{listing(parts, NAMED)}"


def _describe(found: Differences, term: Term, names: Sequence[str]) -> str:
    """Return what a group is, in words."""
    own = found.whose(term)
    if not own.pattern:
        return f"{describe_term(term)} that the model lacks"
    where = own.odd(names)
    return f"{own.title} of {place_of(term)}{f' in {where}' if where else ''}"


def list_log_changes(found: Differences, terms: Terms, names: Sequence[str]) -> tuple[Change, ...]:
    """Return what terms say of logs, the surest first; kinds of friction at one place together.

    Parameters
    ----------
    found : Differences
    terms : tuple of Term
    names : sequence of str
        Of the logs, or of those that blocks are of.
    """
    model, known = found.model, found.known
    value, covariance = found.solve(terms)
    levels = found.levels(known.base + known.directions @ value[: len(known.precision)])
    each = np.split(np.arange(model.fixed, len(value)), np.cumsum([t.size for t in terms])[:-1])
    together: dict[tuple[str, str, str], list[int]] = {}
    for k, term in enumerate(terms):
        own = found.whose(term)
        if own.pattern:
            together.setdefault((own.kind, place_of(term), own.pattern), []).append(k)
    out = []
    for (kind, place, _), which in together.items():
        parts = [found.whose(terms[k]) for k in which]
        at = np.concatenate([each[k] for k in which])
        columns = np.concatenate([found.at(terms[k]) for k in which])
        sizes, spread, level = value[at], covariance[np.ix_(at, at)], levels[columns]
        share, share_sd = np.nan, np.nan
        if (np.abs(level) > 0).all():
            rms = found.missing.scale[columns]
            slope = rms * np.sign(level) / (np.abs(level) @ rms)
            share, share_sd = float(slope @ sizes), float(np.sqrt(slope @ spread @ slope))
        title = parts[0].title if len({c.family.name for c in parts}) == 1 else kind
        rivals = [r for k in which for r in model.rivals(terms, k) if r.odds > 0]
        _, called, units = zip(*(found.columns[k] for k in columns.tolist()), strict=True)
        out.append(
            Change(
                kind=kind,
                family=parts[0].family.name,
                what=f"{title} of {place}",
                place=place,
                log=parts[0].odd(names),
                names=called,
                units=units,
                sizes=sizes,
                sd=np.sqrt(np.diag(spread)),
                share=share,
                share_sd=share_sd,
                odds=max(terms[k].odds for k in which),
                others=tuple(dict.fromkeys(_describe(found, r, names) for r in rivals)),
            )
        )
    return tuple(sorted(out, key=lambda c: -c.odds))
