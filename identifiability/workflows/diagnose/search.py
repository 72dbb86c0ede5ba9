"""The search for what is missing: a beam of hypotheses, and moves from each to its neighbours.

Hypotheses are compared beside the rows as the best of them leaves these. Moves are: add, drop, swap
(another family in the place of one), join (one part in the stead of all that act where it does, or
a family in all of its places), refine (a shape between those of the grid). A function without a
name and the nearest name are swapped for one another like any two.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.regression.columns import Candidate
from identifiability.workflows.diagnose.evidence import Beside, View
from identifiability.workflows.diagnose.hypothesis import Catalogue, Group, Hypothesis
from identifiability.workflows.diagnose.problem import Problem

#: Shapes that are tried on each side of one, as shares of the way to its neighbours, and rounds: a
#: sixteenth of a step of the grid is left.
BETWEEN: tuple[Tolerance, Tolerance, Tolerance] = (0.25, 0.5, 0.75)
ROUNDS = 2

Say = Callable[[str, float], None]
#: Neighbours of a hypothesis in a view that may have a score at least.
Moves = Callable[[Hypothesis, View, float], Iterator[Hypothesis]]


@dataclass
class SearchStep:
    """One step of the search.

    Attributes
    ----------
    evidence : mapping of (family, place) to float [nat]
        Log odds of each beside what was there, prices included.
    critical : float [nat]
        Log odds from which on a name is stated.
    best : (family, place)
        What came.
    p_value : float
        Share of simulated noises in which anything has as much; an upper bound where none has.
    gain : float
        Relative fall of the error of its joints on unseen motion; nan where not asked.
    accepted : bool
        Whether it is there at the end.
    reason : str
    """

    evidence: dict[Group, float]
    critical: float
    best: Group
    p_value: float
    gain: float = float("nan")
    accepted: bool = False
    reason: str = ""


@dataclass
class Search:
    """A search in a problem.

    Attributes
    ----------
    problem : Problem
    say : callable(str, float)
    barred : set of (family, place)
        What was taken out, and is not tried again.
    refuted : set of (family, place)
        What of it unseen motion refuted; the rest was not sure beside what there was.
    steps : list of SearchStep
    """

    problem: Problem
    say: Say = lambda what, share: None
    barred: set[Group] = field(default_factory=set)
    refuted: set[Group] = field(default_factory=set)
    steps: list[SearchStep] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._list()

    def extend(self, more: Sequence[Candidate]) -> range:
        """Add candidates, and return their numbers."""
        added = self.problem.extend(more)
        self._list()
        return added

    def _list(self) -> None:
        p = self.problem
        present = p.setting.structure.present
        self.catalogue = Catalogue(p.candidates, p.given, present, p.setting.rules)

    def run(self, start: Hypothesis, *, functions: bool = False) -> tuple[Hypothesis, View]:
        """Return the best hypothesis that moves lead to, and the rows as it leaves them."""
        p, rules = self.problem, self.problem.setting.rules
        beam, view = [start], self.problem.settled(start.parts)
        seen: dict[frozenset[int], float] = {}
        expanded: set[frozenset[int]] = set()
        swapped: set[frozenset[int]] = set()
        while len(beam[0].parts) < rules.most:
            best = beam[0]
            beam = self._widen(beam, view, expanded, partial(self._moves, functions=functions))
            if beam[0].key == best.key:  # an addition that gains goes before a swap: it leads there
                beam = self._widen(beam, view, swapped, partial(self._swaps, functions=functions))
            odds = self.options(best.parts, view, functions=functions)
            now = beam[0]
            if now.key == best.key:  # what no move betters may have better shapes
                now = self._refine(best, view, functions=functions)
            if now.key == best.key:
                own = self._add_in_own_view(best, odds, view, seen)
                if own is None:
                    self._tell(best, best, odds)
                    break
                now, view = own
            else:
                view = p.view(now.parts, view)
            beam[0] = now
            self._tell(best, now, odds)
            # Under its own weights it must stay the better one, or the search would go in circles.
            if seen.get(now.key, -np.inf) >= (again := self.score(now, view)):
                break
            seen[now.key] = again
        return beam[0], self.problem.settled(beam[0].parts, view)

    def _add_in_own_view(
        self,
        h: Hypothesis,
        odds: dict[Group, tuple[float, int, float]],
        view: View,
        seen: Collection[frozenset[int]],
    ) -> tuple[Hypothesis, View] | None:
        """Return a hypothesis with a part more, if it gains beside rows as it leaves them itself.

        What is missing divides the information of its joint: beside rows as the model leaves them
        an effect that is far larger than the noise hides itself.
        """
        p, found, most = self.problem, None, 0.0
        hides = (view.tempered > 1.0) | (view.steps > 0)
        hidden = [x for x in odds.values() if hides[list(p.acts(x[1]))].any()]
        for _, k, shaped in sorted(hidden, reverse=True)[: self.problem.setting.rules.hidden]:
            more = h.add(k, shaped)
            if more.key in seen:
                continue
            own = p.settled(more.parts, view)
            gain = self.score(more, own) - self.score(h, own)
            if gain > most:
                found, most = (more, own), gain
        return found

    def score(self, h: Hypothesis, view: View) -> float:
        """Return the log odds of a hypothesis over the model alone."""
        if not h.parts:
            return 0.0
        p = self.problem
        value = view.evidence.log_bayes(p.columns(h.parts))
        return value - sum(h.shaped) - self.catalogue.price(h.parts)

    def _widen(
        self, beam: list[Hypothesis], view: View, done: set[frozenset[int]], moves: Moves
    ) -> list[Hypothesis]:
        """Return the best of a beam and of what moves lead to, from the first and the new ones."""
        most, found = self.problem.setting.rules.beam, {h.key: h for h in beam}
        score = self._scores(found, view)
        for h in [h for h in beam if h is beam[0] or h.key not in done]:
            done.add(h.key)
            least = sorted(score.values())[-most] if len(score) >= most else -np.inf
            new = {n.key: n for n in moves(h, view, least)}
            found.update(new)
            score.update(self._scores(new, view))
        order = sorted(found, key=lambda key: -score[key])
        return [found[key] for key in order[:most]]

    def _scores(
        self, found: Mapping[frozenset[int], Hypothesis], view: View
    ) -> dict[frozenset[int], float]:
        """Return the scores of several hypotheses."""
        view.evidence.square(self.problem.columns({k for key in found for k in key}))
        return {key: self.score(h, view) for key, h in found.items()}

    def gains(self, rest: Sequence[int], view: View) -> Array:
        """Return the log Bayes factor of every candidate beside some parts, (c,)."""
        p = self.problem
        return self._beside(rest, view).gains(p.options, p.setting.rules.alias / 3)

    def options(
        self,
        rest: Sequence[int],
        view: View,
        *,
        functions: bool,
        beside: Beside | None = None,
        among: np.ndarray | None = None,
    ) -> dict[Group, tuple[float, int, float]]:
        """Return for each group that may stand beside some parts: log odds, candidate, shape."""
        p, cost = self.problem, self.catalogue.further(rest)
        if among is None:
            among = self.catalogue.allowed(rest, self.barred, functions=functions)
        beside = beside or self._beside(rest, view)
        gains = beside.gains(p.options, p.setting.rules.alias / 3, among)
        found = self.catalogue.best_of(gains, among)
        return {g: (value - cost[k], k, shaped) for g, (value, k, shaped) in found.items()}

    def _beside(self, rest: Sequence[int], view: View) -> Beside:
        return view.evidence.beside(self.problem.columns(rest))

    def _moves(
        self, h: Hypothesis, view: View, _worth: float, *, functions: bool
    ) -> Iterator[Hypothesis]:
        """Yield the neighbours of a hypothesis, swaps apart."""
        p, most = self.problem, self.problem.setting.rules.options
        odds = self.options(h.parts, view, functions=functions)
        ranked = sorted(odds.values(), reverse=True)
        adding = [(k, shaped) for value, k, shaped in ranked[:most] if value > 0]
        yield from (h.add(k, shaped) for k, shaped in adding)
        yield from (self._drop(h, gone) for gone in h.parts)
        # One part in the stead of all that act where it does, and are of its kind.
        for k, shaped in adding:
            joints, own = set(p.acts(k)), p.candidates[k].family
            several = {
                o
                for o in h.parts
                if set(p.acts(o)) <= joints
                and (len(joints) > 1 or p.candidates[o].family.against == own.against)
            }
            if len(several) > 1 or (several and len(joints) > 1):
                yield h.without(several).add(k, shaped)
        yield from self._everywhere(h, view, odds)

    def _drop(self, h: Hypothesis, gone: int) -> Hypothesis:
        """Return a hypothesis without a part, and without what refines it."""
        rest, fits = h.without({gone}), self.catalogue.fits
        while not fits(rest.parts):
            rest = rest.without({
                k for k in rest.parts if not fits([k, *(o for o in rest.parts if o != k)])
            })  # fmt: skip
        return rest

    def _swaps(
        self, h: Hypothesis, view: View, worth: float, *, functions: bool
    ) -> Iterator[Hypothesis]:
        """Yield a hypothesis with another part in the stead of each, if its score may be worth it.

        Where k stands for g, the evidence is that of both, less what g says beside k; and a part
        says at least what its prior loses. So what k says beside all parts, which is asked once,
        bounds every swap [branch and bound; Land & Doig 1960].
        """
        p = self.problem
        rests = [(gone, self._drop(h, gone)) for gone in h.parts]
        may = [
            self.catalogue.allowed(rest.parts, self.barred, functions=functions)
            for _, rest in rests
        ]
        if not rests:
            return
        beside = self._beside(h.parts, view)
        most = beside.gains(p.options, 0.0, np.any(may, axis=0), signed=False)
        most = np.where(np.isfinite(most), most, 0.0)  # what is an alias beside all parts
        whole = view.evidence.log_bayes(p.columns(h.parts))
        for (gone, rest), allowed in zip(rests, may, strict=True):
            away = p.columns(h.key - rest.key)
            bound = whole + most + beside.volume(away) - self.catalogue.further(rest.parts)
            bound -= sum(rest.shaped) + self.catalogue.price(rest.parts)
            among = allowed & self.catalogue.with_group(bound > worth)
            if not among.any():
                continue
            near = self.options(
                rest.parts, view, functions=functions, beside=beside.without(away), among=among
            )
            likeliest = sorted(near.values())[-3:]
            yield from (rest.add(k, shaped) for _, k, shaped in likeliest if k != gone)

    def _everywhere(
        self, h: Hypothesis, view: View, odds: dict[Group, tuple[float, int, float]]
    ) -> Iterator[Hypothesis]:
        """Yield a hypothesis with a family in all places that gain by it, the likeliest ones.

        A place comes in where it gains beside those that came before.
        """
        p = self.problem
        gains: dict[str, list[tuple[float, int, float]]] = {}
        for group, (value, k, shaped) in odds.items():
            if (value := value + self.catalogue.price([k])) > 0 and not p.candidates[
                k
            ].family.unnamed:
                gains.setdefault(group[0], []).append((value, k, shaped))
        several = [(sum(v for v, *_ in own), own) for own in gains.values() if len(own) > 1]
        for _, own in sorted(several, key=lambda x: -x[0])[:2]:
            more, columns = h, p.columns(h.parts)
            view.evidence.square([*columns, *p.columns(k for _, k, _ in own)])
            known = view.evidence.log_bayes(columns)
            for _, k, shaped in sorted(own, reverse=True):
                with_it = [*columns, *p.candidates[k].columns]
                value = view.evidence.log_bayes(with_it)
                if value - shaped > known:
                    more, columns, known = more.add(k, shaped), with_it, value
            yield more

    def _refine(self, h: Hypothesis, view: View, *, functions: bool) -> Hypothesis:
        """Return a hypothesis with the shapes between those of the grid that fit best.

        What finer shapes may bring near to a part is refined as well: of two names for one curve
        the one whose grid happens to have its shape would win else.
        """
        p = self.problem
        for _ in range(ROUNDS):
            near = [self._near(h, k, view, functions=functions) for k in h.parts]
            between = {o: more for own in near for o in own if (more := self._between(o))}
            if not between:
                break
            self.extend([c for more in between.values() for c in more])
            wide = replace(view, sizes=p.widened(h.parts, view))
            for k, own in zip(h.parts, near, strict=True):
                if own & between.keys():
                    rest, only = h.without({k}), np.zeros(len(p.candidates), bool)
                    only[[i for o in own for i in self.catalogue.slots[p.candidates[o].slot]]] = (
                        True
                    )
                    odds = self.options(rest.parts, wide, functions=functions, among=only)
                    _, best, shaped = max(odds.values())
                    h = h if best == k else rest.add(best, shaped)
        return h

    def _near(self, h: Hypothesis, k: int, view: View, *, functions: bool) -> set[int]:
        """Return a part, and the best of every other slot that finer shapes may bring near to it.

        A parabola through a shape and its neighbours rises above it by an eighth of what they fall
        short together at most, where it is the best of them.
        """
        p, rest = self.problem, h.without({k}).parts
        gains = self.gains(rest, view)
        least = gains[k] - p.setting.rules.odds
        gains[~self.catalogue.allowed(rest, self.barred, functions=functions)] = -np.inf
        near = {k}
        for own in self.catalogue.slots.values():
            best = max(range(len(own)), key=lambda n: gains[own[n]])
            most = gains[own[best]]
            beside = [gains[own[n]] for n in (best - 1, best + 1) if 0 <= n < len(own)]
            # How far a parabola rises above the best of three, of what the other two
            # fall short together.
            if np.isfinite(most) and most + sum(most - x for x in beside) * 0.125 >= least:
                near.add(own[best])
        return near

    def _between(self, k: int) -> list[Candidate]:
        """Return a candidate with shapes on the way to its neighbours among those tried."""
        p, own = self.problem, self.problem.candidates[k]
        if np.isnan(own.shape) or own.family.flexible:
            return []
        same = self.catalogue.members[self.catalogue.of[k]]
        alike = [o for o in same if p.candidates[o].slot == own.slot]
        tried = sorted({p.candidates[o].shape for o in alike})
        if tried[0] <= 0:
            return []
        at = tried.index(own.shape)
        ends = [tried[o] for o in (at - 1, at + 1) if 0 <= o < len(tried)]
        grid = np.log(sorted({p.candidates[o].shape for o in alike if o < p.given}))
        finest = float(np.diff(grid).min(initial=np.inf)) * BETWEEN[0] ** ROUNDS
        # Ends farther apart than so many of the finest steps have shapes between them.
        ends = [end for end in ends if abs(np.log(end / own.shape)) > 1.5 * finest]
        shapes = [float(own.shape * (end / own.shape) ** x) for end in ends for x in BETWEEN]
        return [
            replace(own, shape=s, effect=own.family.at(s, own.place))
            for s in shapes if s not in tried
        ]  # fmt: skip

    def _tell(
        self, before: Hypothesis, after: Hypothesis, odds: dict[Group, tuple[float, int, float]]
    ) -> None:
        """Remember what came in a step, and what the evidence was."""
        was = {self.catalogue.of[k] for k in before.parts}
        came = [k for k in after.parts if self.catalogue.of[k] not in was]
        if not came and self.steps:
            return
        evidence: dict[Group, float] = {}
        for g, (value, k, _) in odds.items():
            evidence[self.problem.candidates[k].family.name, g[1]] = value
        best = max(odds, key=lambda g: odds[g][0], default=None)
        if came:
            group = self.problem.candidates[came[0]].group
        elif best is not None:
            group = self.problem.candidates[odds[best][1]].group
        else:
            return
        level = self.problem.setting.rules.odds
        self.steps.append(SearchStep(evidence, level, group, float("nan")))
