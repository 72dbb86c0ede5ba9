"""`Change`: a difference between logs or parts of a log, with size, place and time.

It also lists competing hypotheses.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any

import numpy as np
import scipy

from identifiability.effects import FAMILIES, find_families
from identifiability.estimation.differences import DRIFT, WARM, Differences
from identifiability.estimation.groups import describe_term, place_of
from identifiability.estimation.mixed_model import (
    EVERYWHERE,
    Group,
    MixedModel,
    Term,
    Terms,
    without,
)
from identifiability.estimation.rules import RULES, Thresholds
from identifiability.foundation.linalg import TINY, rms_of, root_diagonal
from identifiability.foundation.names import GROUPED_KINDS, INERTIAL_KINDS, Array, Strings
from identifiability.foundation.presenter import presented
from identifiability.foundation.rounding import REACH
from identifiability.foundation.values import frozen
from identifiability.physical.pseudo_inertia import describe_body
from identifiability.regression.columns import Candidate, number
from identifiability.robot import Robot
from identifiability.robot.robot import ten_parameters

#: Families that may differ, other than loads.
DIFFERING = (
    "coulomb_friction",
    "viscous_friction",
    "torque_offset",
    "torque_scale",
    "passive_joint_friction",
)
#: Attributes of a change in steps that are not those of its last step.
STEADY = ("family", "odds", "course", "alternatives")
#: A function that the model may lack at a joint whose friction is nonlinear.
VELOCITY = "function_of_velocity"
#: Parameters of a load that its weight determines.
WEIGHT = INERTIAL_KINDS[:4]


def list_changes(robot: Robot, bodies: Sequence[str], *more: str) -> tuple[Candidate, ...]:
    """Return possible differences between rows of a robot: loads on bodies, and (more) families.

    A load has either the parameters that its weight determines, or all ten. Both are candidates.
    """
    rigid = FAMILIES["rigid_body"].effect
    loads: tuple[Strings, ...] = (WEIGHT, INERTIAL_KINDS)
    found = [(FAMILIES["payload"], rigid, body, kinds) for body in bodies for kinds in loads]
    for family in find_families((*DIFFERING, *more)):
        for place, own in groupby(family.effect.parameters(robot), lambda p: p.owner):
            found.append((family, family.effect, place, tuple(p.kind for p in own)))
    candidates = []
    for family, effect, place, kinds in found:
        columns = tuple(range(len(kinds)))
        candidates.append(Candidate(family, place, np.nan, kinds, effect, columns))
    return tuple(number(candidates))


@frozen
class DifferentTorque:
    """Torque of a log minus the torque that the model, or an effect it lacks, has in all logs.

    Attributes
    ----------
    t : (N,) [s]
    whole : (N, n) [N·m or N]
        All of the torque.
    measured, explained : (N, n) [N·m or N]
        The measured difference, and its part that the changes explain; NaN where torque is no data.
    log : int
        The log: of those after, the one that changed most.
    """

    t: Array
    whole: Array
    measured: Array
    explained: Array
    log: int

    @property
    def errors(self) -> tuple[Array, Array]:
        """Rms of each joint's difference that is not explained, (n,) [N·m or N].

        And the same over the variation of the measured difference; NaN where that was not measured.
        """
        error = np.ma.masked_invalid(self.measured - self.explained)
        variation = np.ma.masked_invalid(self.measured).std(0)
        rms = np.ma.sqrt((error**2).mean(0))
        return rms.filled(np.nan), (rms / variation).filled(np.nan)

    @staticmethod
    def of(found: Differences, terms: Terms, later: int) -> DifferentTorque:
        """Return the torque of one of the later logs minus that of the model of all logs."""
        seen = found.missing.seen
        p = found.known.size
        a = found.always.shape[1]
        value = found.solve(terms)[0]
        sizes = found.always @ value[p : p + a]
        each = np.concatenate([np.empty(0, int), *map(found.at, terms)])
        sizes[each] += value[found.model.fixed :]
        explained, common = np.zeros((2, *seen.y.shape))
        for (j, k), x in found.missing.entries.items():
            differs = found.always[k].any() or found.columns[k][0].pattern
            part = explained if differs else common
            part[:, j] += sizes[k] * x
        measured = np.where(seen.data, seen.y - seen.X @ value[:p] - common, np.nan)
        explained = np.where(seen.data, explained, np.nan)
        size = [np.nansum(explained[seen.log == k] ** 2) for k in range(later)]
        log = int(np.argmax(size))
        own = seen.log == log
        return DifferentTorque(seen.t[own], seen.raw[own], measured[own], explained[own], log)


@frozen(kw_only=True)
class FeltTorque:
    """Torque of a change at the joint that feels it most, in the logs that have it.

    Attributes
    ----------
    joint, unit : str
    rms, sd : float [N·m or N]
        Root of its mean square, with the sign of the first number of the change, and its standard
        error.
    before : float [N·m or N]
        The rms torque of this joint in all logs.
    """

    joint: str = ""
    unit: str = ""
    rms: float = np.nan
    sd: float = np.nan
    before: float = np.nan

    @staticmethod
    def of(found: Differences, columns: np.ndarray, sizes: Array, spread: Array) -> FeltTorque:
        """Return the torque of some columns (q,) of sizes (q,) with a covariance (q, q)."""
        seen = found.missing.seen
        pattern = found.columns[int(columns[0])][0]
        acting = np.array(pattern.logs)[seen.log] != 0
        out = FeltTorque()
        for j, joint in enumerate(seen.robot.joints):
            rows = acting & seen.data[:, j]
            if not rows.any():
                continue
            torque = _columns_in(found, j, columns)[rows]
            gram = torque.T @ torque / len(torque)
            rms = float(np.sqrt(max(sizes @ gram @ sizes, 0.0)))
            if out.joint and not rms > abs(out.rms):
                continue
            slope = gram @ sizes / rms if rms > 0 else np.zeros(len(sizes))
            out = FeltTorque(
                joint=joint,
                unit=seen.robot.torque_units[j],
                rms=float(np.copysign(rms, sizes[0])),
                sd=float(np.sqrt(slope @ spread @ slope)),
                before=float(rms_of(seen.raw[seen.data[:, j], j])),
            )
        return out


def _columns_in(found: Differences, joint: int, columns: np.ndarray) -> Array:
    """Return some columns (q,) in a joint, (N, q); zero where they do not act."""
    none = np.zeros(len(found.missing.seen.y))
    parts = [found.missing.entries.get((joint, k), none) for k in columns.tolist()]
    return np.column_stack(parts)


# `Change`: a difference with size, place and time.


@frozen(kw_only=True)
class Change:
    """A change between logs or during a log.

    Attributes
    ----------
    kind : {"load", "friction", "offset", "gain", "spring", "missing"}
        The last is an effect that the model lacks in all logs; it only competes with changes.
    family, what, place : str
        Its name; its description; and the body or joint, ``all joints`` where it is everywhere.
    log, since : str
        The only log with the change, and the first of several; empty if all later logs have it.
    seconds : float [s]
        Of friction that changes within every log: the time in which it changes by its sizes. NaN of
        a change between logs.
    course : tuple of Change
        Of several later logs, the change in each of them by itself.
    gradual : bool
        Whether it came in several steps; its sizes are those of the last log.
    names, units : tuple of str
        Of its q numbers.
    before, before_sd : (q,)
        These numbers before, and their standard errors; NaN where that is not known, as of a load.
    sizes, sd : (q,)
        Of these, given all other changes, and their standard errors.
    covariance : (q, q)
        Of the sizes; infinite variances of numbers of a load that the motion does not show.
    share, share_sd : float
        Change relative to its torque before; NaN where that is not known.
    felt : FeltTorque
        Its torque.
    odds : float
        Log odds, averaged over sizes and ways, less the price of families and places; those of its
        surest part.
    others : tuple of str
        Competing hypotheses of a change in part of a log,
    rivals : tuple of (family, place)
        and their names.
    alternatives : tuple of Change
        Competing hypotheses of a change between logs, with their sizes.
    parts : tuple of Change
        Of a change in all joints, that of each joint.
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
    names: Strings
    units: Strings
    sizes: Array
    covariance: Array
    odds: float
    since: str = ""
    seconds: float = np.nan
    course: tuple[Change, ...] = ()
    gradual: bool = False
    others: Strings = ()
    before: Array = np.empty(0)
    before_sd: Array = np.empty(0)
    share: float = np.nan
    share_sd: float = np.nan
    felt: FeltTorque = FeltTorque()
    rivals: tuple[tuple[str, str], ...] = ()
    alternatives: tuple[Change, ...] = ()
    parts: tuple[Change, ...] = ()
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
    def within(self) -> bool:
        """Whether it happens within every log, and not between logs."""
        return bool(np.isfinite(self.seconds))

    @property
    def sd(self) -> Array:
        """Standard errors of the sizes, (q,)."""
        return root_diagonal(self.covariance)

    @property
    def determined(self) -> np.ndarray:
        """Whether the logs tell each number before from others, as its change, (q,) bool.

        A joint may share friction with its motor: only their sum is known before.
        """
        vague = self.before_sd > np.maximum(self.sd, np.abs(self.before) / REACH)
        return ~vague

    @property
    def body(self) -> tuple[Array, Array]:
        """Mass, centre and moments about it of a load that was added or removed, each (10,).

        As of `describe_body`, and their standard errors. NaN where the mass may be zero; the errors
        are infinite where the motion does not show a number.
        """
        if self.kind != "load" or not abs(self.sizes[0]) > REACH * self.sd[0]:
            return np.full(10, np.nan), np.full(10, np.inf)
        size, sd = np.zeros(10), np.full(10, np.inf)
        count = len(self.sizes)
        size[:count] = np.copysign(1.0, self.sizes[0]) * self.sizes
        sd[:count] = self.sd
        grouped = [INERTIAL_KINDS.index(kind) for kind in GROUPED_KINDS]

        def describe(x: Array) -> Array:
            return describe_body(x[grouped])

        step = 1e-6 * np.abs(size).max()
        slopes = scipy.optimize.approx_fprime(size, describe, step)
        known = np.nan_to_num(self.covariance, posinf=0.0)
        variance = np.diag(slopes[:, :count] @ known @ slopes[:, :count].T)
        unknown = (slopes[:, np.isinf(sd)] != 0).any(1)
        return describe(size), np.sqrt(np.where(unknown, np.inf, variance))

    @property
    def centre(self) -> tuple[Array, Array]:
        """Centre of mass of a changed load, and its standard errors, (3,) and (3,) [m].

        NaN where the mass may be zero.
        """
        values, sd = self.body
        return values[1:4], sd[1:4]

    @property
    def sure(self) -> bool:
        """Whether its odds exceed the thresholds of fitted and unseen rows together."""
        return self.odds >= RULES.name + RULES.keep

    @property
    def relative(self) -> tuple[float, float]:
        """The change and its standard error, as shares of the friction or gain before.

        Of a load or an offset they are shares of the torque of the joint that feels it most.
        """
        if np.isfinite(self.share):
            return self.share, self.share_sd
        return self.felt.rms / self.felt.before, self.felt.sd / self.felt.before

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


@frozen(kw_only=True)
class Unchanged:
    """The least change of a number that would be named.

    Attributes
    ----------
    kind, family, what, place, name, unit : str
        As of a `Change` with one number; of a load the mass.
    least : float
        Change that is named with 95 % probability; infinite if these logs cannot show it.
    share : float
        The same relative to the friction or gain; NaN where that is not known.
    felt : FeltTorque
        Its torque.
    """

    kind: str
    family: str
    what: str
    place: str
    name: str
    unit: str
    least: float
    share: float
    felt: FeltTorque

    @property
    def relative(self) -> float:
        """The least change as a share, as `Change.relative`."""
        if np.isfinite(self.share):
            return self.share
        return self.felt.rms / self.felt.before


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
    together = defaultdict[Any, list[int]](list)
    for k, term in enumerate(terms):
        own = found.whose(term)
        if own.pattern:
            together[own.kind, place_of(term), own.pattern].append(k)
    changes = []
    for which in together.values():
        change = _measure_change(found, terms, which, names)
        alternatives = [
            _measure_change(found, (*without(terms, k), rival), [len(terms) - 1], names)
            for k in which
            for rival in found.model.rivals(terms, k)
            if rival.odds > 0 and not _is_repeated(found, terms, terms[k], rival)
        ]
        course = tuple(_list_course(found, terms, which, names))
        changes.append(replace(change, alternatives=tuple(alternatives), course=course))
    ordered = sorted(changes, key=lambda c: -c.odds)
    return tuple(_join_steps(ordered, names[: found.later]))


def list_lacks(found: Differences, terms: Terms) -> Strings:
    """Return the effects among terms that act in all logs: the model lacks them."""
    return tuple(describe_term(t) for t in terms if not found.whose(t).pattern)


def _is_repeated(found: Differences, terms: Terms, own: Term, rival: Term) -> bool:
    """Return whether a rival is a change of the same kind that says no more than that of a term.

    It is at the same place, or in all joints though the logs show no such change at other ones.
    """
    its, of_own = (found.whose(term) for term in (rival, own))
    if (its.kind, its.pattern) != (of_own.kind, of_own.pattern):
        return False
    if rival.group.place != EVERYWHERE or own.group.place == EVERYWHERE:
        return rival.group.place == own.group.place
    (further,) = found.model.gains(terms, [rival.group])
    return further.odds <= 0.0


def _join_steps(changes: Sequence[Change], later: Sequence[str]) -> list[Change]:
    """Return changes, where several at one place are the steps of one: that in the last log.

    Parameters
    ----------
    changes : sequence of Change
        The surest first.
    later : sequence of str
        The later logs.
    """
    out = list[Change]()
    for change in changes:
        key = change.kind, change.place
        steps = [k for k, c in enumerate(changes) if c.course and (c.kind, c.place) == key]
        if not change.course or len(steps) < 2:
            out.append(change)
        elif change is changes[steps[0]]:
            last = change.course[-1]
            sure = [abs(c.relative[0]) > REACH * c.relative[1] for c in change.course]
            first = later[sure.index(True)] if any(sure) else ""
            kept = {name: getattr(change, name) for name in STEADY}
            out.append(replace(last, **kept, log="", since=first, gradual=True))
    return out


def _list_course(
    found: Differences, terms: Terms, which: Sequence[int], names: Sequence[str]
) -> Iterator[Change]:
    """Yield the change of some terms in each later log; none of one later log.

    All changes of the same kind and place are replaced by one in each log.
    """
    first = terms[which[0]]
    own = found.whose(first)
    later = found.later
    if later < 2 or own.pattern == WARM:
        return

    def alike(group: Group) -> bool:
        other = found.candidate_of(group)
        same = (other.kind, group.place) == (own.kind, first.group.place)
        return same and other.pattern not in ("", WARM)

    rest = tuple(t for t in terms if not alike(t.group))
    member = first.member if own.kind == "load" else 0
    singles = []
    for group in filter(alike, found.groups):
        amounts = found.candidate_of(group).logs
        log = int(np.argmax(amounts))
        if np.count_nonzero(amounts) == 1 and log < later:
            singles.append((log, replace(first, group=group, member=member)))
    every = (*rest, *(term for _, term in singles))
    for log in range(later):
        at = [len(rest) + k for k, (of_log, _) in enumerate(singles) if of_log == log]
        yield _measure_change(found, every, at, names)


def _measure_change(
    found: Differences, terms: Terms, which: Sequence[int], names: Sequence[str]
) -> Change:
    """Return the change of some terms at one place, with its size."""
    terms, which = _with_companions(found, terms, which)
    value, covariance = found.solve(terms)
    p = found.known.size
    levels = found.levels(found.known.base + found.known.directions @ value[:p])
    level_errors = found.level_errors(covariance[:p, :p])
    at = np.concatenate([rows_of(found.model, terms, k) for k in which])
    columns = np.concatenate([found.at(terms[k]) for k in which])
    families = {found.whose(terms[k]).family.name for k in which}
    first = found.whose(terms[which[0]])
    place = place_of(terms[which[0]])

    def measure(some: np.ndarray, place: str) -> Change:
        sizes = value[at[some]]
        spread = covariance[np.ix_(at[some], at[some])]
        own = columns[some]
        felt = FeltTorque.of(found, own, sizes, spread)
        share = _share_of(found, own, levels[own], sizes, spread)
        alone = len(set(owners[some].tolist())) == 1
        if first.kind == "friction" and np.isfinite(share[0]) and alone:
            friction = _rms_friction(found, terms, value, own, levels, felt.joint)
            share = np.nan, np.nan
            if friction:  # the joint had some friction before
                share = felt.rms / friction, felt.sd / friction
        _, called, units = zip(*(found.columns[n] for n in own.tolist()), strict=True)
        title = first.title if len(families) == 1 else first.kind
        duration = longest if first.pattern == WARM else np.nan
        odds = max(terms[k].odds for k in which)
        if first.kind == "load":  # where the prior alone gives a size, it is not known
            prior = np.sqrt(terms[which[0]].variance) / found.scale[own]
            learned = root_diagonal(spread) <= (1 - Thresholds().contraction) * prior
            spread = spread + np.diag(np.where(learned, 0.0, np.inf))
        return Change(
            kind=first.kind if first.pattern else "missing",
            family=first.family.name,
            what=f"{title} of {place}",
            place=place,
            log=first.odd(names),
            since=first.since(names),
            seconds=duration,
            names=called,
            units=units,
            before=np.where(levels[own] == 0, np.nan, levels[own]),
            before_sd=level_errors[own],
            sizes=sizes,
            covariance=spread,
            share=share[0],
            share_sd=share[1],
            felt=felt,
            odds=odds,
        )

    seen = found.missing.seen
    longest = max(float(np.ptp(seen.t[seen.log == k])) for k in np.unique(seen.log))
    owners = np.array([found.columns[n][0].place for n in columns.tolist()])
    change = measure(np.arange(len(at)), place)
    places = list(dict.fromkeys(owners.tolist()))
    if len(places) == 1:
        return change
    parts = tuple(measure(np.flatnonzero(owners == owner), owner) for owner in places)
    return replace(change, parts=parts)


def _rms_friction(
    found: Differences, terms: Terms, value: Array, columns: np.ndarray, levels: Array, joint: str
) -> float:
    """Return the rms friction of a joint before a change, along the logs with the change.

    A joint may share its friction with a motor that moves it, and the motion may hardly tell the
    two apart. A function of velocity that the model lacks there is friction as well.

    Parameters
    ----------
    found : Differences
    terms : tuple of Term
    value : (c,)
        Of the fixed columns and of the terms.
    columns : (q,) int
        Of the friction that changed.
    levels : (C,)
        Of all friction before.
    joint : str
        That feels it.
    """
    seen = found.missing.seen
    j = seen.robot.joints.index(joint)
    first = found.columns[int(columns[0])][0]
    alike = {(first.pattern, found.columns[k][0].family.name) for k in columns.tolist()}
    every = [k for k, (c, *_) in enumerate(found.columns) if (c.pattern, c.family.name) in alike]
    numbers = [(k, float(levels[k])) for k in every]
    for k, term in enumerate(terms):
        if found.whose(term).family.name == VELOCITY:
            at = rows_of(found.model, terms, k)
            numbers += zip(found.at(term).tolist(), value[at].tolist(), strict=True)
    torque = np.zeros(len(seen.y))
    for column, size in numbers:
        torque += size * found.missing.entries.get((j, column), 0.0)
    rows = seen.data[:, j] & (np.array(first.logs)[seen.log] != 0)
    return float(rms_of(torque[rows]))


def _with_companions(
    found: Differences, terms: Terms, which: Sequence[int]
) -> tuple[Terms, list[int]]:
    """Return terms with the small changes that may come with a change, and where the change is.

    Wear changes dry and viscous friction together. The evidence may name one of them only, and
    would give it a part of the change of the other one. Torque constants drift as motors warm, so
    the logs of a load may differ in their gains by as little as friction does between two logs.
    """
    first = terms[which[0]]
    own = found.whose(first)
    at = list(which)
    if own.kind == "load" and own.pattern:
        return (*terms, *_list_drifting_gains(found, terms, first)), at
    if own.kind != "friction" or not own.pattern:
        return terms, at
    taken = {t.key for t in terms}
    for group in found.groups:
        other = found.candidate_of(group)
        alike = (other.kind, other.pattern) == (own.kind, own.pattern)
        if alike and group.place == first.group.place and group.key not in taken:
            at.append(len(terms))
            terms = (*terms, replace(first, group=group, member=0))
    return terms, at


def _list_drifting_gains(found: Differences, terms: Terms, load: Term) -> Terms:
    """Return small changes of every joint's gain in the logs of a load, but for those of terms."""
    pattern = found.whose(load).pattern
    taken = {t.key for t in terms}
    of_logs = (g for g in found.groups if found.candidate_of(g).pattern == pattern)
    gains = [g for g in of_logs if found.candidate_of(g).kind == "gain" and g.place != EVERYWHERE]
    return tuple(
        replace(load, group=g, member=0, variance=DRIFT**2) for g in gains if g.key not in taken
    )


def _share_of(
    found: Differences, columns: np.ndarray, levels: Array, sizes: Array, spread: Array
) -> tuple[float, float]:
    """Return the change as a share of the torque before, and its standard error.

    It is the factor that best turns the torque before into the torque of the change. So two
    numbers that the motion hardly tells apart count by the torque of their sum. NaN where the
    torque before is not known.

    Parameters
    ----------
    found : Differences
    columns : (q,) int
        Of the change.
    levels, sizes : (q,), (q,)
        Numbers before the change, and their changes.
    spread : (q, q)
        Covariance of the changes.
    """
    if not (np.abs(levels) > 0).all():
        return np.nan, np.nan
    norms = found.missing.seen.torque_norm
    slope = np.zeros(len(columns))
    for j in np.flatnonzero(norms > 0).tolist():
        torque = _columns_in(found, j, columns) / norms[j]
        slope += (torque @ levels) @ torque
    slope /= max(float(slope @ levels), TINY)
    share = float(slope @ sizes)
    sd = float(np.sqrt(slope @ spread @ slope))
    return share, sd


def list_unchanged(found: Differences, terms: Terms) -> tuple[Unchanged, ...]:
    """Return the least changes that would be named, in the order of joints.

    What changed is left out, but for loads: their least change is that without any load.

    Parameters
    ----------
    found : Differences
    terms : tuple of Term
    """
    levels = np.abs(found.levels(found.known.base))
    changed = {
        (found.columns[n][0].family.name, found.columns[n][0].place)
        for term in terms
        for n in found.at(term).tolist()
        if found.whose(term).pattern and found.whose(term).kind != "load"
    }
    unloaded = tuple(t for t in terms if found.whose(t).kind != "load")
    out = []
    for group in found.groups:
        columns = found.columns_of(group.members[0])
        first, name, unit = found.columns[int(columns[0])]
        key = first.family.name, first.place
        if first.pattern != "0" or group.place == EVERYWHERE or key in changed:
            continue
        unit_change = np.eye(len(columns))[0]
        if first.kind == "load":  # of 1 kg at the centre of the body
            unit_change = _body_of_one(found.missing.seen.robot, first.place)[: len(columns)]
        level = float(levels[columns[0]])
        others = unloaded if first.kind == "load" else terms
        least = found.model.least_named(others, group, unit_change)
        sizes = unit_change * (least if np.isfinite(least) else 0.0)
        felt = FeltTorque.of(found, columns, sizes, np.zeros((len(sizes),) * 2))
        share = least / level if level > 0 else np.nan
        out.append(
            Unchanged(
                kind=first.kind,
                family=first.family.name,
                what=f"{first.title} of {first.place}",
                place=first.place,
                name=name,
                unit=unit,
                least=least,
                share=share,
                felt=felt,
            )
        )
    order = {joint: k for k, joint in enumerate(found.missing.seen.robot.joints)}
    return tuple(sorted(out, key=lambda x: order.get(x.place, len(order))))


def _body_of_one(robot: Robot, body: str) -> Array:
    """Return the ten parameters of 1 kg at the centre of a body, or at its origin."""
    mass, *first = (robot.nominal[f"{body}.{kind}"] for kind in WEIGHT)
    x, y, z = np.array(first) / mass if mass > 0 else np.zeros(3)
    return ten_parameters(1.0, (x, y, z), np.zeros(3))
