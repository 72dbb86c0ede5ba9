"""`Search`: effects that a robot model may lack, searched, judged and named; every verb uses it.

Groups of all families at all places, and everywhere, are searched on fitted rows; unseen rows may
only remove them. Left-out blocks of the fitted rows decide at which places each effect acts.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from identifiability.effects import Family, find_families, find_family, joints_of
from identifiability.effects.friction import (
    PassiveJointFriction,
    QuadraticFriction,
    RisingFriction,
    SigmoidFriction,
    StribeckFriction,
)
from identifiability.effects.measurement import ClockError, CommandDelay, TimeDelay, TorqueScale
from identifiability.effects.springs import PositionTorque
from identifiability.effects.transmission import Hysteresis
from identifiability.foundation.linalg import ROUNDOFF, triangular_factor
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import format_number
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.columns import Candidate
from identifiability.regression.information import Information
from identifiability.regression.regression import Regression
from identifiability.regression.structure import Structure
from identifiability.robot import Robot

from .evidence import LEVELS
from .groups import NO_MISSING_EFFECTS, Excerpt, JointRows, Missing, MissingEffects, Share
from .mixed_model import EVERYWHERE, Group, MixedModel, Term, Terms, leave_out_each, without
from .rules import RULES

#: Places of terms by their keys, each with its gain on left-out blocks [nat].
Places = dict[tuple[str, str], dict[str, float]]
#: Terms, each with a gain [nat].
Gains = tuple[tuple[Term, float], ...]
#: Terms, each with a gain and the gain that it needs to be named [nat].
Weak = tuple[tuple[Term, float, float], ...]
#: Terms that unseen rows confirm, and the gains of all terms there, by key [nat].
Confirmed = tuple[Terms, dict[tuple[str, str], float]]


@frozen
class Search:
    """Candidates along fitted rows, and rows that may refute them.

    Attributes
    ----------
    missing : Missing
        Candidates and fitted rows.
    unseen : Excerpt or None
        Without any, the last fitted log (or the last part of the only one) refutes names.
    """

    missing: Missing
    unseen: Excerpt | None = None

    @cached_property
    def model(self) -> MixedModel:
        """The mixed model of all candidates."""
        return self.missing.model()


@frozen
class Judged:
    """Terms that unseen rows and left-out blocks confirm.

    Attributes
    ----------
    search : Search
    terms : tuple of Term
    unseen : dict of (str, str) to float [nat]
        Gains on unseen rows, by the keys of terms.
    places : Places
    refuted : Gains
        Terms that fitted rows named and unseen rows refuted, with their gains there [nat].
    possible : Weak
        Possible terms that are not named, with their gains on left-out blocks.
    tried : set of (str, str)
        Names that were tried in place of a term.
    """

    search: Search
    terms: Terms
    unseen: dict[tuple[str, str], float]
    places: Places
    refuted: Gains = ()
    possible: Weak = ()
    tried: frozenset[tuple[str, str]] = frozenset()

    @property
    def keys(self) -> set[tuple[str, str]]:
        """Family and place of each term."""
        return {t.key for t in self.terms}

    @cached_property
    def further(self) -> dict[tuple[str, str], float]:
        """Log odds of all other groups in addition to the terms, by key."""
        return {t.key: t.odds for t in self.search.model.gains(self.terms)}


def name_terms(search: Search) -> Judged:
    """Return the missing effects, found on fitted rows and not refuted by unseen rows.

    Left-out blocks of the fitted rows decide in which joints each confirmed effect acts. Once other
    terms are removed, a name may be far less probable than an alternative. The alternative replaces
    it if the same rows confirm the alternative, and it gains at least as much on unseen rows. A
    name that is in the end still far less probable than one that was not tried is no name.
    """
    search, found = _find_terms(search)
    judged = _judge(search, found)
    for _ in found:
        better = _exchange_improbable(judged)
        if not better:
            break
        new = {t.key for t in better} - judged.keys
        tried = judged.tried | new
        confirmed = _confirm(search, better)
        # Unseen rows are asked first: left-out blocks take far longer.
        if _replaces(Judged(search, *confirmed, {}), judged, new):
            other = _judge_confirmed(search, better, confirmed, judged.refuted)
            judged = other if _replaces(other, judged, new) else judged
        judged = replace(judged, tried=tried)
    improbable = {k for k, _ in _find_improbable(judged)}
    if not improbable:
        return judged
    rest = tuple(t for k, t in enumerate(judged.terms) if k not in improbable)
    last = _judge(search, search.model.update_terms(rest), judged.refuted)
    return replace(last, tried=judged.tried)


def _judge(search: Search, found: Terms, refuted: Gains = ()) -> Judged:
    """Return the terms that unseen rows and left-out blocks confirm.

    `refuted` are those of earlier judgements.
    """
    return _judge_confirmed(search, found, _confirm(search, found), refuted)


def _judge_confirmed(
    search: Search, found: Terms, confirmed: Confirmed, refuted: Gains = ()
) -> Judged:
    """Return the terms that left-out blocks confirm, too."""
    kept, gains = confirmed
    places, possible = _ask_left_out(search, kept) if kept else ({}, ())
    standing = {t.key for t in kept}
    news = ((t, gains[t.key]) for t in found if t.key not in standing)
    refuted = tuple(x for x in (*refuted, *news) if x[0].key not in standing)
    kept = search.model.update_terms(_pay_prices(search, kept, places))
    if search.unseen is None:  # these rows are among the fitted ones already
        kept = tuple(replace(t, unseen=0.0) for t in kept)
        gains = {}
    return Judged(search, kept, gains, places, refuted, possible)


def _confirm(search: Search, found: Terms) -> Confirmed:
    """Return the terms that unseen rows do not refute, and the gains of all terms there, by key."""
    if not found:
        return (), {}
    model = search.model
    missing = search.missing
    if search.unseen is not None:
        products = missing.products(search.unseen, among=found)
    else:
        log = missing.seen.log
        count = len(log)
        first = int(np.argmax(log == log[-1]))
        edges = [0, first, count] if first else [0, *divide(count), count]
        blocks = missing.products(missing.seen, edges, among=found)
        model = replace(model, products=blocks.take(np.array([0])))
        products = blocks.take(np.array([-1]))
    kept = model.confirm(found, products)
    news = {t.key: gain for t, gain in zip(found, model.news(found, products), strict=True)}
    return kept, news | {t.key: t.unseen for t in kept}


def _replaces(other: Judged, judged: Judged, new: set[tuple[str, str]]) -> bool:
    """Whether new names stand, and gain at least as much on unseen rows as those that they replace.

    Without other rows than the fitted ones, that they stand is enough.
    """
    if other.search.unseen is None:
        return new <= other.keys
    own = sum(other.unseen.get(key, 0.0) for key in other.keys - judged.keys)
    before = sum(judged.unseen.get(key, 0.0) for key in judged.keys - other.keys)
    return new <= other.keys and own >= before


def _exchange_improbable(judged: Judged) -> Terms:
    """Return terms with the likeliest alternative of an improbable one; none if there is none."""
    terms = judged.terms
    for k, other in _find_improbable(judged):
        return judged.search.model.update_terms((*terms[:k], other, *terms[k + 1 :]))
    return ()


def _find_improbable(judged: Judged) -> Iterator[tuple[int, Term]]:
    """Yield the number of each term that is far less probable than another name, and that name."""
    for k in range(len(judged.terms)):
        odds, others = list_alternatives(judged, k)
        if others and others[0].odds > odds + RULES.rival:
            yield k, others[0]


def list_alternatives(judged: Judged, k: int) -> tuple[float, Terms]:
    """Return the log odds of a term, and other names for it, the likeliest first.

    Names that were tried in place of a term are left out. A name at another place explains of the
    term only the log odds that it loses by the term: the rest is another effect.
    """
    search = judged.search
    term = judged.terms[k]
    rest = without(judged.terms, k)
    odds = max(term.odds, _odds_of_parts(search, rest, term.group))
    others = [t for t in search.model.gains(rest) if t.key not in judged.tried]
    rivals = [_as_rival(judged, term, t) for t in others if _may_rival(t.group, term.group)]
    rivals.sort(key=lambda t: -t.odds)
    return odds, tuple(rivals)


def _as_rival(judged: Judged, term: Term, other: Term) -> Term:
    """Return another name with the log odds that it would explain in place of a term."""
    if other.group.place == term.group.place:
        return other
    beside = max(judged.further.get(other.key, 0.0), 0.0)
    return replace(other, odds=other.odds - beside)


def find_rivals(judged: Judged, k: int) -> Terms:
    """Return the names that explain about as much as a term; no function rivals a name."""
    odds, others = list_alternatives(judged, k)
    unnamed = judged.terms[k].group.unnamed
    near = (t for t in others if t.odds > odds - RULES.rival)
    return tuple(t for t in near if unnamed or not t.group.unnamed)


def further_gains(search: Search, terms: Terms) -> Terms:
    """Return the log odds of groups that are neither among some terms nor parts of them."""
    contained = {part.key for t in terms for part in _parts_of(search, t.group)}
    return tuple(t for t in search.model.gains(terms) if t.key not in contained)


#: Families of errors in the times of a log: no approximations, so they leave nothing to others.
CLOCKS = (ClockError.name, TimeDelay.name)
#: Laws of friction at a speed, whatever the position.
AT_SPEEDS = (
    StribeckFriction.name,
    RisingFriction.name,
    SigmoidFriction.name,
    QuadraticFriction.name,
)
#: Families that a joint which sticks at reversals may imitate.
LATE_FRICTION = (RisingFriction.name, Hysteresis.name)


def _find_terms(search: Search) -> tuple[Search, Terms]:
    """Return the missing effects on fitted rows, and the search with their noise and rows.

    Friction that rises with speed, or with the way after a reversal, may be friction that changes
    sign at an unrecorded time. It is then searched between reversals only.
    """
    kept = _search_terms(search)
    if not search.missing.apart and any(t.group.family in LATE_FRICTION for t in kept):
        search = replace(search, missing=search.missing.between_reversals())
        kept = _search_terms(search)
    named = [t for t in kept if not _family(search.missing, t).unnamed]
    if named:  # their torque is no noise
        missing = search.missing.beside(named)
        search = replace(search, missing=missing)
        kept = _search_terms(search)
    return search, _simplify_families(search, kept)


def _search_terms(search: Search) -> Terms:
    """Return the missing effects, those of one place joined."""
    return _join_terms(search, search.model.search())


def _simplify_families(search: Search, best: Terms) -> Terms:
    """Return smaller groups in place of families everywhere, if they explain as much.

    A family everywhere may replace different effects of several joints, and a search would not find
    its way back. So further searches have smaller groups alone. The evidence decides, and fewer
    parameters if it is about equal. The noise is kept from the search with families, which leave
    the least torque. A family has paid the price of the effects of which it consists. Some joints
    of one family are no other effects: those that keep its name are chosen later. Smaller
    groups with a curve among them explain nothing more simply, and may predict worse.
    """
    model = search.model
    most = model.total_odds(best)
    while everywhere := [t.group for t in best if t.group.place == EVERYWHERE]:
        widest = max(map(_width, everywhere))
        smaller = tuple(g for g in model.groups if _width(g) < widest)
        model = replace(model, groups=smaller)
        found = _join_terms(search, model.search())
        paid = {part.family for g in everywhere for part in _parts_of(search, g)}
        relief = sum(t.group.price for t in found if t.group.family in paid)
        odds = model.total_odds(found) + relief
        fewer = sum(t.size for t in found) < sum(t.size for t in best)
        curves = any(_family(search.missing, t.group).flexible for t in found)
        nothing_new = _families_of(found) <= _families_of(best)
        if curves or nothing_new or odds < most - RULES.simpler * fewer:
            break
        best, most = found, odds
    return best


def _width(group: Group) -> int:
    """Return the least number of columns of a group."""
    return min(map(len, group.members))


def _families_of(terms: Terms) -> set[str]:
    """Return the families of missing effects."""
    return {t.group.family for t in terms}


def _join_terms(search: Search, terms: Terms) -> Terms:
    """Return terms with one effect where a place has all effects of which it consists.

    A spring with an unknown rest is joint stiffness and torque offset.
    """
    for group in search.model.groups:
        parts = {part.key for part in _parts_of(search, group)}
        if parts and parts <= {t.key for t in terms}:
            first = min(k for k, t in enumerate(terms) if t.key in parts)
            rest = tuple(t for t in terms[first:] if t.key not in parts)
            terms = search.model.update_terms((*terms[:first], Term(group), *rest))
    return terms


def _parts_of(search: Search, group: Group) -> list[Group]:
    """Return the groups of several effects of which a group consists; none if it has no parts."""
    names = _family(search.missing, group).effect.supersedes
    parts = [g for g in search.model.groups if g.place == group.place and g.family in names]
    return parts if len(parts) > 1 else []


def _odds_of_parts(search: Search, rest: Terms, group: Group) -> float:
    """Return the log odds of a group given the rest, by its parts; minus infinity without parts.

    Far from its rest a spring's two columns are nearly the same, and a prior of both together
    would hold the spring back. Its parts are one effect, and pay one price.
    """
    odds = -group.price
    parts = _parts_of(search, group)
    for part in parts:
        (term,) = search.model.gains(rest, [part])
        odds += term.odds + part.price
        rest = (*rest, term)
    return odds if parts else -np.inf


def _ask_left_out(search: Search, found: Terms) -> tuple[Places, Weak]:
    """Return places where terms surely gain on left-out blocks, and terms that may gain.

    A family everywhere is one term for each place. Each term also needs its own log odds, which use
    the signs that physics allows. Each round removes the worst term of each place and family.

    Friction of several passive joints keeps all its places: values at some of them would take the
    friction of the others. Its further places have no gain (nan).
    """
    rows = search.missing.seen
    folds = leave_out_each(search.missing.products(rows, _block_edges(rows), among=found))
    every = kept = _split_places(search, found)
    possible = list[tuple[Term, float, float]]()
    gains = np.empty(0)
    while kept:
        terms = tuple(t for _, t in kept)
        gains, needed = _gains_left_out(search.model, terms, folds)
        lacking = np.minimum(gains - needed, search.model.odds_each(terms) - RULES.name)
        gone = _choose_leaving(lacking, kept)
        if not gone:
            break
        left = [(terms[k], float(gains[k]), float(needed[k])) for k in gone]
        possible += [weak for weak in left if weak[1] > 0]
        kept = [x for k, x in enumerate(kept) if k not in gone]
    places: Places = {t.key: {} for t in found}
    for (owner, term), gain in zip(kept, gains.tolist(), strict=False):
        places[owner][term.group.place] = gain
    together = PassiveJointFriction.name, EVERYWHERE
    if len(places.get(together, ())) > 1:
        joined = [t for owner, t in every if owner == together]
        places[together] = {t.group.place: np.nan for t in joined} | places[together]
        possible = [x for x in possible if x[0].group.family != PassiveJointFriction.name]
    return places, tuple(possible)


def _pay_prices(search: Search, terms: Terms, places: Places) -> Terms:
    """Return the terms with places whose torque there is worth the price of the name.

    A family everywhere pays its price once, for all its places. If some of them leave, those that
    stay must be worth it by themselves: it counts the names tried [Scott & Berger 2010].
    """
    kept = tuple(t for t in terms if places[t.key])
    parts = tuple(_at_some(search, t, places[t.key]) for t in kept)
    asked = zip(kept, search.model.update_terms(parts), strict=True)
    return tuple(t for t, part in asked if part.odds >= RULES.name or part.size == t.size)


def _at_some(search: Search, term: Term, places: Collection[str]) -> Term:
    """Return a term with the columns of some places alone."""
    sets = search.missing.sets[term.key]
    used = [k for some in sets for c in some if c.place in places for k in c.columns]
    columns = np.array(used) + search.missing.fixed
    members = (at[np.isin(at, columns)] for at in term.group.members)
    shapes = tuple(at for at in members if len(at))  # places may have fewer shapes
    group = replace(term.group, members=shapes)
    return replace(term, group=group, member=min(term.member, len(shapes) - 1))


#: Terms of one place each, with the keys of the terms whose parts they are.
Split = list[tuple[tuple[str, str], Term]]


def _choose_leaving(lacking: Array, split: Split) -> list[int]:
    """Return the terms removed in a round: at most one of a place and of a family, the worst.

    One scale of the torque is redundant given all others, but all scales together are not.
    """
    gone = list[int]()
    taken = set[object]()
    for k in np.argsort(lacking).tolist():
        owner, term = split[k]
        if lacking[k] < 0 and taken.isdisjoint([owner, term.group.place]):
            gone.append(k)
            taken |= {owner, term.group.place}
    return gone


def _split_places(search: Search, found: Terms) -> Split:
    """Return terms of one place each, and the keys of the terms whose parts they are.

    A sum of all shapes of a family is a curve, which no equation names.
    """
    split: Split = []
    for k, term in enumerate(found):
        candidates = find_candidates(search, found, k)
        price = float(np.log(len(candidates)))  # the family has paid its price
        curve = term.group.unnamed or term.member == len(search.missing.sets[term.key])
        part = replace(term.group, price=price, unnamed=curve)
        for c in candidates:
            columns = np.array(c.columns) + search.missing.fixed
            group = replace(part, place=c.place, members=(columns,))
            split.append((term.key, replace(term, group=group, member=0)))
    return split


def _block_edges(rows: Excerpt) -> list[int]:
    """Return rows at which blocks of the logs begin, and the end of the last."""
    logs = np.unique(rows.log)
    each = -(-LEVELS.folds // len(logs))
    edges = [0]
    for log in logs:
        at = np.flatnonzero(rows.log == log)
        cuts = np.linspace(at[0], at[-1] + 1, each + 1)
        edges += cuts.astype(int).tolist()[1:]
    return edges


def _gains_left_out(
    model: MixedModel, terms: Terms, folds: Sequence[Information]
) -> tuple[Array, Array]:
    """Return the gain of each term on left-out blocks, and the gain that it needs, (t,) [nat].

    A law is an approximation. The likeliest term of a joint may leave an error that other terms
    fit. Each other term must therefore gain a share of their joint gain, or be no such error. The
    likeliest may be a family everywhere. An error of clocks is no law of the joint.
    """
    laws = [k for k, t in enumerate(terms) if t.group.family not in CLOCKS]
    crowds = [[k for k in laws if _share_joint(terms[k], t)] for t in terms]
    singles = [frozenset([k]) for k in range(len(terms))]
    joint = map(frozenset.union, singles, crowds)
    gains, together = model.left_out(terms, folds, [*singles, *joint]).reshape(2, -1)
    needed = np.full(len(terms), RULES.keep)
    for k, crowd in enumerate(crowds):
        likeliest = max(crowd, default=k, key=lambda k: terms[k].odds)
        least = max(RULES.keep, RULES.law_error * together[k])
        small = k != likeliest and gains[k] < least
        if small and not _is_apart(model, terms, k, likeliest):
            needed[k] = least
    return gains, needed


def _share_joint(one: Term, other: Term) -> bool:
    """Return whether terms are one, or of two families with a joint in common.

    Springs over several pairs of joints are one spring over more joints.
    """
    if one.group.family == other.group.family:
        return one is other
    joints = joints_of(other.group.family, other.group.place)
    return not set(joints_of(one.group.family, one.group.place)).isdisjoint(joints)


def _is_apart(model: MixedModel, terms: Terms, k: int, likeliest: int) -> bool:
    """Return whether a term explains more than errors of the likeliest law there.

    A curve along the position is no law with a form: it errs along the position alone, and not as
    one law of friction at a speed does.

    The error of a law is a smooth function of the same coordinates. It is in the model as the
    function of this joint that replaces the law best. A scale of the torque must gain in addition
    to it. An error of clocks must be as large as in other joints. Other effects are as small on
    real robots because laws are wrong there, and then harm unseen motion.
    """
    term = terms[k]
    if term.group.family in CLOCKS:
        return _has_one_clock(model, terms, k)
    law = term.group.family in AT_SPEEDS and not term.group.unnamed
    if law and terms[likeliest].group.family == PositionTorque.name:
        return True
    if term.group.family != TorqueScale.name:
        return False
    instead = model.gains(without(terms, likeliest))
    functions = [t for t in instead if t.group.unnamed and t.group.place == term.group.place]
    if not functions:
        return False
    (again,) = model.gains((*without(terms, k), functions[0]), [term.group])
    return again.odds >= RULES.name + RULES.keep


def _has_one_clock(model: MixedModel, terms: Terms, k: int) -> bool:
    """Return whether an error of clocks is as large as in other joints: a log has one clock.

    It may differ from their weighted mean by its standard error, and by the error of a law.
    """
    family = terms[k].group.family
    columns = [t.columns[0] for t in terms if t.group.family == family]
    solution = model.solve(terms)
    at = np.isin(solution.columns, columns)
    unit = model.scale[solution.columns[at]]
    sizes = solution.value[at] / unit
    variances = np.square(solution.root[:, at] / unit).sum(0)
    own = solution.columns[at] == terms[k].columns[0]
    if own.all():
        return False
    precision = 1.0 / variances[~own]
    mean = np.average(sizes[~own], weights=precision)
    variance = variances[own][0] + 1.0 / precision.sum() + (RULES.law_error * mean) ** 2
    # Half a squared deviation is a difference in nats.
    return bool(0.5 * (sizes[own][0] - mean) ** 2 < RULES.keep * variance)


def _may_rival(one: Group, other: Group) -> bool:
    """Whether groups compete; a family at a place does not compete with itself everywhere."""
    places = {one.place, other.place}
    return one.family != other.family or (len(places) > 1 and EVERYWHERE not in places)


def _family(missing: Missing, what: Term | Group) -> Family:
    return missing.sets[what.key][0][0].family


def find_candidates(search: Search, terms: Terms, k: int) -> list[Candidate]:
    """Return the candidates of one of some terms, one for each place."""
    term = terms[k]
    rest = without(terms, k)
    sets = search.missing.sets[term.key]
    chosen = sets[min(term.member, len(sets) - 1)]
    family = sets[0][0].family
    if family.continuous or family.refined:
        chosen = _refined(search.model, rest, term.group, sets)
    elif term.member == len(sets):
        chosen = [c for some in sets for c in some]
    places = dict.fromkeys(c.place for c in chosen)
    return [_merge_kinds([c for c in chosen if c.place == place]) for place in places]


def _merge_kinds(own: Sequence[Candidate]) -> Candidate:
    """Return the candidates of one place as one."""
    kinds = tuple(kind for c in own for kind in c.kinds)
    columns = tuple(k for c in own for k in c.columns)
    return replace(own[0], kinds=kinds, columns=columns)


def _refined(
    model: MixedModel, rest: Terms, group: Group, sets: Sequence[Sequence[Candidate]]
) -> list[Candidate]:
    """Return a family at its places, with the likeliest shape between those of its grid.

    A parabola through the likeliest grid shape and its two neighbours has its maximum there.
    """
    odds = odds_of_each(model, rest, group, group.members[: len(sets)])
    at = where = int(odds.argmax())
    if 0 < at < len(odds) - 1:
        before, here, after = odds[at - 1 : at + 2]
        where = at + 0.5 * (after - before) / max(2 * here - before - after, ROUNDOFF)
    out = []
    for c in sets[at]:
        grid = np.log([x.shape for some in sets for x in some if x.place == c.place])
        shape = float(np.exp(np.interp(where, np.arange(len(grid)), grid)))
        out.append(c.with_shape(shape))
    return out


def odds_of_each(
    model: MixedModel, rest: Terms, group: Group, members: Sequence[np.ndarray]
) -> Array:
    """Return the log odds of members of a group by themselves, (m,)."""
    each = [replace(group, members=(at,)) for at in members]
    found = {id(t.group): t.odds for t in model.gains(rest, each)}
    return np.array([found[id(g)] for g in each])


# `MissingEffects` of a model: what the search found, and one group more of all others.

#: Share of the only log that may refute names, and share of either part that is omitted at the
#: division, because noise has a memory.
LAST: Tolerance = 0.25
PAUSE: Tolerance = 0.05


def divide(rows: int) -> tuple[int, int]:
    """Return the end of the fitted part of the only log, and the start of the held-out part."""
    end = (1 - LAST) * rows
    start = int((1 - PAUSE) * end)
    stop = np.ceil(end + PAUSE * (rows - end))
    return start, int(stop)


def find_missing(
    structure: Structure,
    regression: Regression,
    unseen: Regression | None = None,
    *,
    commanded: bool = False,
    irregular: bool = False,
    known: MissingEffects | None = None,
    play: Collection[str] = (),
    own_delays: Array | None = None,
) -> MissingEffects:
    """Return the effects that a model with all columns of a regression may lack.

    Rows that were held out may only take a name away: these are the last log, or the last part of
    the only one, if no other rows were held out. Where commands were lost (`irregular`), or dry
    friction builds up over a distance, no delay of a joint is looked for: lost commands that are
    not detected, and friction that reverses late, act like one.

    Effects that are `known` were found in the same rows. The model has got some of them since, and
    lacks the others. Joints with `play` show no other effects, nor do those that share a link with
    them: the play is in their torque.

    Rollouts refute delays of joints with which they would err more (`Rollouts.own_delays`).
    The search then begins again without them.
    """
    robot = structure.robot
    every = find_families(None, commanded=commanded)
    hides_delays = irregular or (robot.servo is not None and robot.servo.slide.any())
    families = [f for f in every if not (hides_delays and f.name == CommandDelay.name)]
    whole = Missing.of(regression, families, structure.present)
    spoilt = share_a_link(robot, play)
    missing = replace(whole, seen=whole.seen.leave_out(spoilt))
    if commanded or robot.base is not None:
        missing = missing.between_reversals()
    if not len(missing.seen.y) or not missing.groups:
        return NO_MISSING_EFFECTS
    if known is not None:
        return _conclude_known(missing, known, robot, own_delays)
    others = None if unseen is None else Excerpt.of(unseen).leave_out(spoilt)
    found = _name_missing(missing, others, robot, own_delays)
    # The noise of joints that were left out is that of all their rows.
    each = enumerate(zip(spoilt.tolist(), found.noise, strict=True))
    noise = tuple(whole.noise_of(j) if out else own for j, (out, own) in each)
    return replace(found, noise=noise)


def _name_missing(
    missing: Missing, others: Excerpt | None, robot: Robot, own_delays: Array | None
) -> MissingEffects:
    """Return the effects on rows that others do not refute, nor rollouts their delays."""
    judged = name_terms(Search(missing, others))
    found = _conclude_named(judged, robot)
    kept = _leave_refuted(found, judged.search, robot, own_delays)
    left = {t.key for t in kept.named}
    gone = {t.key for t in found.named} - left
    if not gone:
        return kept
    late = {key for key in missing.sets if key[0] == CommandDelay.name}
    # Rows that show none but false delays show none.
    refuted = {*missing.refuted, *(gone if late & left else late)}
    return _name_missing(replace(missing, refuted=refuted), others, robot, own_delays)


def _conclude_named(judged: Judged, robot: Robot) -> MissingEffects:
    """Return the named effects but for those that no model lacks.

    They are unknown ages of measurements, and drifts of servos that integrate: errors of rows add
    up in the integral.
    """
    terms = tuple(_at_places(judged, k) for k in range(len(judged.terms)))
    found = _conclude(judged.search, terms)
    named = found.shares[: len(found.named)]
    spurious = is_unknown_age, is_drift_of_integral
    real = [s for s in named if not any(of(s, robot) for of in spurious)]
    if len(real) == len(named):
        return found
    kept = tuple(s.term for s in real)
    return _conclude(judged.search, judged.search.model.update_terms(kept))


def share_a_link(robot: Robot, joints: Collection[str]) -> np.ndarray:
    """Return which joints are some joints, or share a link with one of them, (n,) bool."""
    tree = robot.tree.joints
    own = {k for k, joint in enumerate(tree) if not {*joints}.isdisjoint(joint.dofs)}
    before = {tree[k].parent for k in own}
    at = (j for k, j in enumerate(tree) if k in own | before or j.parent in own)
    names = [name for joint in at for name in joint.dofs]
    return np.isin(robot.joints, names)


def is_unknown_age(share: Share, robot: Robot) -> bool:
    """Return whether commands only seem to act later by the age of measurements, if not stated.

    Measurements that are older look like commands that act earlier.
    """
    if share.term.group.family != CommandDelay.name:
        return False
    assert robot.servo is not None
    sd = np.linalg.norm(share.root, axis=0)
    within = np.abs(share.value) <= robot.servo.unknown_lags[0] + 2.0 * sd
    return bool(within.all())


def _leave_refuted(
    found: MissingEffects, search: Search, robot: Robot, own_delays: Array | None
) -> MissingEffects:
    """Return the effects without delays of joints with which rollouts would err more."""
    refuted = {s.term.key for s in found.shares if is_refuted(s, robot, own_delays)}
    if not refuted:
        return found
    kept = tuple(t for t in found.named if t.key not in refuted)
    return _conclude(search, kept, refuted)


def is_refuted(share: Share, robot: Robot, own_delays: Array | None) -> bool:
    """Return whether rollouts would err more if commands acted later as torque says."""
    group = share.term.group
    if group.family != CommandDelay.name or own_delays is None:
        return False
    joints = robot.motor_joints if group.place == EVERYWHERE else (group.place,)
    later = np.zeros(len(own_delays))
    later[[robot.joints.index(joint) for joint in joints][: len(share.value)]] = share.value
    errors = own_delays[:, -1]
    moved = own_delays @ later + errors
    return bool(moved @ moved >= errors @ errors)


def is_drift_of_integral(share: Share, robot: Robot) -> bool:
    """Return whether an effect changes with time as the torque of a servo that integrates does."""
    servo = robot.servo
    integrates = servo is not None and bool(servo.integral.any())
    family = find_family(share.term.group.family)
    return integrates and family.against == "time"


def _conclude_known(
    missing: Missing, known: MissingEffects, robot: Robot, own_delays: Array | None
) -> MissingEffects:
    """Return the same for those known effects that a model still lacks, on fitted rows."""
    search = Search(missing.under(known.noise))
    groups = {g.key: g for g in search.model.groups}
    lacking = (replace(t, group=groups[t.key]) for t in known.named if t.key in groups)
    terms = search.model.update_terms(tuple(lacking))
    lacked = _conclude(search, tuple(t for t in terms if t.odds >= RULES.name))
    return _leave_refuted(lacked, search, robot, own_delays)


def _at_places(judged: Judged, k: int) -> Term:
    """Return a term with its rivals, and with its places where only some of them show it."""
    term = replace(judged.terms[k], rivals=find_rivals(judged, k))
    family, place = term.key
    every = {place for name, place in judged.search.missing.sets if name == family} - {EVERYWHERE}
    sure = judged.places[term.key]
    if place != EVERYWHERE or every <= set(sure):
        return term
    return replace(term, places=tuple(sure))


#: Families by which friction of a joint may be nonlinear without a name.
NONLINEAR_FRICTION = (
    "function_of_velocity",
    "function_of_load",
    "load_dependent_friction",
    "quadratic_friction",
)


def _share_of(
    model: MixedModel,
    used: np.ndarray,
    term: Term,
    weight: float,
    own: float,
    terms: Terms,
) -> Share:
    """Return the contribution of one of some terms; columns are among those that are used."""
    s = model.solve(terms)
    unit = model.scale[term.columns]
    at = np.isin(s.columns, term.columns)
    columns = np.searchsorted(used, term.columns)
    value = s.value[at] / unit
    root = s.root[:, at] / unit
    return Share(term, weight, own, columns, value, root)


def _state_peak(missing: Missing, share: Share, used: np.ndarray) -> str:
    """Return the largest torque of a function without a name, with its joint if there are others.

    The used columns (u,) are those that the share counts in.
    """
    group, seen = share.term.group, missing.seen
    if not group.unnamed:
        return ""
    torque: Array = np.zeros_like(seen.y)
    columns = (used[share.columns] - missing.fixed).tolist()
    for column, value in zip(columns, share.value.tolist(), strict=True):
        for joint in range(len(torque.T)):
            torque[:, joint] += value * missing.entries.get((joint, column), 0.0)
    peaks = np.abs(torque).max(axis=0)
    joint = int(peaks.argmax())
    name, unit = seen.robot.joints[joint], seen.robot.torque_units[joint]
    where = "" if name == group.place else f" in {name}"
    return f", up to {format_number(float(peaks[joint]), 2)} {unit}{where}"


def _conclude(
    search: Search, terms: Terms, refuted: Collection[tuple[str, str]] = ()
) -> MissingEffects:
    """Return the effects of some terms, and of one group more, on the labels of a model.

    A wrong scale of one joint's torque is nearly the model itself, at any size: its prior alone
    would widen every label. So it is one group more only where a scale was found. Groups that are
    refuted are none.
    """
    missing = search.missing
    model = search.model
    unlikely = {TorqueScale.name} - {t.group.family for t in terms}
    usual = (g for g in model.groups if g.family not in unlikely and g.key not in refuted)
    model = replace(model, groups=tuple(usual))
    groups = [(t, 1.0, 1.0, terms) for t in terms]
    alternatives = model.alternatives(terms, NONLINEAR_FRICTION)
    groups += [(t, weight, own, (*terms, t)) for t, weight, own in alternatives]
    columns_each = (t.columns for t, *_ in groups)
    used = np.unique(np.concatenate([np.empty(0, int), *columns_each]))
    shares = [_share_of(model, used, *group) for group in groups]
    rows = []
    for j, X in enumerate(missing.seen.X.swapaxes(0, 1)):
        columns = np.flatnonzero(X.any(0))
        at = (used - missing.fixed).tolist()
        random = [k for k, column in enumerate(at) if (j, column) in missing.entries]
        Z = [missing.entries[j, at[k]] for k in random]
        R = triangular_factor(np.column_stack([X[:, columns], *Z]))
        width = len(columns)
        rows.append(JointRows(columns, R[:, :width], np.array(random, int), R[:, width:]))
    alone = tuple(t.odds for (t,) in (model.gains((), [t.group]) for t in terms))
    peaks = [_state_peak(missing, share, used) for share in shares[: len(terms)]]
    sized = tuple(replace(t, peak=peak) for t, peak in zip(terms, peaks, strict=True))
    return MissingEffects(sized, tuple(shares), tuple(rows), missing.noise, alone)
