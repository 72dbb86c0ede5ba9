"""`Hypothesis`: parts that are added to the model; moves from one to the next; what each costs.

A part is a `Candidate`: a family at a place with a shape. Which families are missing, in how many
of their places, is equally likely beforehand; so one family in all of its places costs no more than
in one of them [Scott & Berger 2010], and every joint's own friction, rotor and offset are as likely
together as all that only some joints have.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Sequence
from functools import cached_property

import numpy as np
from scipy.special import gammaln

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.columns import Candidate, Present
from identifiability.workflows.diagnose.rules import Rules

#: Families that are one function, friction over speed, with one name in one joint.
FRICTION = ("stribeck_friction", "rising_friction", "sigmoid_friction")
OVER_SPEED = "friction over speed"

Group = tuple[str, str]
Slot = tuple[str, str, tuple[str, ...]]


@frozen
class Hypothesis:
    """Parts that are added to the model.

    Attributes
    ----------
    parts : tuple of int
        Numbers of candidates.
    shaped : tuple of float [nat]
        What each pays for the shapes that it might have had.
    """

    parts: tuple[int, ...] = ()
    shaped: tuple[float, ...] = ()

    def add(self, part: int, shaped: float) -> Hypothesis:
        """Return it with a part more."""
        return Hypothesis((*self.parts, part), (*self.shaped, shaped))

    def without(self, gone: Collection[int]) -> Hypothesis:
        """Return it without some parts."""
        left = [(k, s) for k, s in zip(self.parts, self.shaped, strict=True) if k not in gone]
        return Hypothesis(tuple(k for k, _ in left), tuple(s for _, s in left))

    @property
    def key(self) -> frozenset[int]:
        """What it is, whatever the order."""
        return frozenset(self.parts)


class Catalogue:
    """Candidates by what is named: their groups, what is allowed beside what, and prices.

    Parameters
    ----------
    candidates : sequence of Candidate
    given : int
        How many of them are shapes of grids; the others lie between these.
    present : collection of (family, place)
        What the base model has.
    rules : Rules
    """

    def __init__(
        self, candidates: Sequence[Candidate], given: int, present: Present, rules: Rules
    ) -> None:
        self.candidates, self.given, self.rules = candidates, given, rules
        self.present = frozenset(present)
        self.of = [group_of(c) for c in candidates]
        self.members: dict[Group, list[int]] = defaultdict(list)
        for k, group in enumerate(self.of):
            self.members[group].append(k)
        #: Candidates of each slot, by shape.
        self.slots: dict[Slot, list[int]] = defaultdict(list)
        for k in sorted(range(len(candidates)), key=lambda k: candidates[k].shape):
            self.slots[candidates[k].slot].append(k)
        self.places = Counter(family for family, _ in self.members)
        first = {self.of[k][0]: c.family for k, c in reversed([*enumerate(candidates)])}
        kinds = Counter(_kind(family) for family in first.values())
        self._prices: dict[tuple[str, int], float] = {}
        self.family_price = {
            name: float(np.log(2.0 * kinds[_kind(family)])) + rules.function * family.unnamed
            for name, family in first.items()
        }

    def price(self, parts: Iterable[int]) -> float:
        """Return what parts must explain beforehand, shapes apart [nat]."""
        parts = list(parts)
        groups = {self.of[k] for k in parts}
        total = 0.0
        for family, k in Counter(family for family, _ in groups).items():
            total += self._of_family(family, k)
        crowd = Counter(
            (c.place, c.family.against)
            for c in (self.candidates[k] for k in parts)
            if not c.family.basic
        )
        return total + self.rules.crowd * sum(count - 1 for count in crowd.values())

    def further(self, rest: Sequence[int]) -> Array:
        """Return what each candidate costs beside some parts, (c,) [nat]."""
        named = {self.of[k] for k in rest}
        counts = Counter(family for family, _ in named)
        own = np.array([
            self._of_family(family, counts[family] + 1) - self._of_family(family, counts[family])
            for family in self.places
        ])  # fmt: skip
        family, over = self._family_and_curve
        taken = over[[k for k in rest if not self.candidates[k].family.basic]]
        place = own[family]
        for group in named:  # more of what is named already is no further place
            place[self.members[group]] = 0.0
        cost: Array = place + self.rules.crowd * np.isin(over, taken)
        return cost

    @cached_property
    def _family_and_curve(self) -> tuple[np.ndarray, np.ndarray]:
        """Number of each candidate's family, and of the curve that it adds to; -1 of basic ones."""
        families = {family: n for n, family in enumerate(self.places)}
        curves: dict[tuple[str, str], int] = {}
        over = [
            -1 if c.family.basic else curves.setdefault((c.place, c.family.against), len(curves))
            for c in self.candidates
        ]
        return np.array([families[family] for family, _ in self.of], int), np.array(over, int)

    def with_group(self, some: np.ndarray) -> np.ndarray:
        """Return some candidates (c,) bool with all others of their groups."""
        order, starts, *_ = self._order
        any_of = np.logical_or.reduceat(some[order], starts)
        out: np.ndarray = np.empty(len(order), bool)
        out[order] = np.repeat(any_of, np.diff(np.r_[starts, len(order)]))
        return out

    def _of_family(self, family: str, k: int) -> float:
        """Return what a family costs in k of its places."""
        if (family, k) not in self._prices:
            n = self.places[family]
            some = float(gammaln(n + 1) - gammaln(k + 1) - gammaln(n - k + 1))
            whole = self.family_price[family] + some + float(np.log(n)) * (1 < k < n)
            self._prices[family, k] = whole if k else 0.0
        return self._prices[family, k]

    def allowed(self, rest: Sequence[int], barred: Collection[Group], *, functions: bool) -> Array:
        """Return which candidates may stand beside some parts, (c,) bool."""
        out = ~self._unnamed | functions
        for group in barred:
            out[self.members.get(group, [])] = False
        there = {self.candidates[k].group for k in rest}
        for need, lacking in self._lacking.items():
            if need not in there:
                out[lacking] = False
        slots = {self.candidates[k].slot for k in rest}
        for group in {self.of[k] for k in rest}:
            for slot, own in self._slots[group].items():
                if slot is None or slot in slots:
                    out[own] = False
        return out

    @cached_property
    def _unnamed(self) -> np.ndarray:
        return np.array([c.family.unnamed for c in self.candidates], bool)

    @cached_property
    def _lacking(self) -> dict[Group, list[int]]:
        """Candidates that refine what the model does not have, by that."""
        out: dict[Group, list[int]] = defaultdict(list)
        for k, c in enumerate(self.candidates):
            if c.family.needs and (c.family.needs, c.place) not in self.present:
                out[c.family.needs, c.place].append(k)
        return out

    @cached_property
    def _slots(self) -> dict[Group, dict[tuple[str, str, tuple[str, ...]] | None, list[int]]]:
        """Candidates of each group by what may stand beside others of it; None for nothing."""
        out: dict[Group, dict[tuple[str, str, tuple[str, ...]] | None, list[int]]]
        out = {group: defaultdict(list) for group in self.members}
        for k, c in enumerate(self.candidates):
            out[self.of[k]][c.slot if c.family.separate else None].append(k)
        return out

    def best_of(self, gains: Array, allowed: Array) -> dict[Group, tuple[float, int, float]]:
        """Return for each group its evidence, best candidate and what that pays for its shape.

        The evidence is the mean over its shapes; of a shape between those of the grid it is that of
        one of them.
        """
        value = np.where(allowed, gains, -np.inf)
        order, starts, groups, count = self._order
        ordered = value[order]
        top = np.maximum.reduceat(ordered, starts)
        safe = np.where(np.isfinite(top), top, 0.0)
        width = np.diff(np.r_[starts, len(order)])
        shifted = np.exp(ordered - np.repeat(safe, width))
        total = np.add.reduceat(np.where(order < self.given, shifted, 0.0), starts)
        with np.errstate(divide="ignore"):
            mean = safe + np.log(total) - np.log(count)
        own = np.maximum(mean, top - np.log(count))
        best = np.flatnonzero(ordered == np.repeat(top, width))
        at = order[best[np.searchsorted(best, starts)]]
        return {
            groups[g]: (float(own[g]), int(at[g]), float(top[g] - own[g]))
            for g in np.flatnonzero(np.isfinite(top)).tolist()
        }

    @cached_property
    def _order(self) -> tuple[np.ndarray, np.ndarray, list[Group], np.ndarray]:
        """Candidates group by group, where each begins, the groups, and shapes of their grids."""
        groups = list(self.members)
        order = np.array([k for g in groups for k in self.members[g]], int)
        starts = np.cumsum([0, *(len(self.members[g]) for g in groups)])[:-1]
        count = [max(sum(k < self.given for k in self.members[g]), 1) for g in groups]
        return order, starts, groups, np.array(count, float)

    def fits(self, parts: Sequence[int]) -> bool:
        """Whether all that some parts refine is there."""
        there = {self.candidates[k].group for k in parts} | self.present
        needs = ((c.family.needs, c.place) for c in (self.candidates[k] for k in parts))
        return all(not family or (family, place) in there for family, place in needs)


def group_of(c: Candidate) -> Group:
    """Return what a candidate is named by: its family and place, friction over speed as one."""
    return (OVER_SPEED, c.place) if c.family.name in FRICTION else c.group


def _kind(family: object) -> str:
    if getattr(family, "unnamed", False):
        return "function"
    return "basic" if getattr(family, "basic", False) else "special"
