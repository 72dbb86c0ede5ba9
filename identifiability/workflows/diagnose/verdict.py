"""The verdict on a hypothesis: how sure each part is, and what unseen motion says of it.

What only resembles the missing effect, or stands for a joint that sticks, scatters more from block
to block than noise lets it: the evidence of a part is divided by that [White 1982]. Motion that
did not choose must be likelier with it, by its predictive density with the errors of all values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy import special

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.evidence import View, factor_of
from identifiability.workflows.diagnose.gap import Gap
from identifiability.workflows.diagnose.hypothesis import Hypothesis
from identifiability.workflows.diagnose.motion import OTHER
from identifiability.workflows.diagnose.problem import Problem
from identifiability.workflows.diagnose.search import Search


@frozen
class Judged:
    """What fitted and unseen motion say of a part beside the others.

    Attributes
    ----------
    odds : float [nat]
        For the part on the fitted motion, prices included and divided by `scatter`.
    scatter : float
        How much more its scores scatter from block to block than noise lets them, one at least.
    unseen : float [nat]
        Logarithm of the predictive likelihood ratio of unseen motion, with the part over without.
    asked : bool
        Whether there is any unseen motion of its joints.
    alone : float [nat]
        Log odds for it on the unseen motion by itself, with whatever value it has there.
    """

    odds: float
    scatter: float
    unseen: float
    asked: bool = True
    alone: float = -np.inf

    def stands(self, odds: float) -> bool:
        """Whether a part is stated: sure on the fitted motion, and not refuted by the unseen."""
        return self.odds >= odds and not self.refuted

    def standing(self, odds: float) -> tuple[bool, float]:
        """Return what orders parts that do not stand: first those that are not sure at all."""
        return self.odds >= odds, self.unseen

    @property
    def refuted(self) -> bool:
        """Whether unseen motion is not likelier with it."""
        return self.asked and not self.unseen > 0

    @property
    def why(self) -> str:
        """What refuted it, to follow its name."""
        if self.refuted and self.alone > 0:
            return OTHER
        return REFUTED if self.refuted else WORSE


#: What refutes a part, to follow its name.
REFUTED = "unseen motion is likelier without it"
WORSE = "torque of unseen motion is surely predicted worse with it"


def judge_parts(search: Search, h: Hypothesis, view: View) -> dict[int, Judged]:
    """Return what is to be said of every part of a hypothesis."""
    p, catalogue = search.problem, search.catalogue
    fitted = Fitted(p, h.parts, view)
    moves = fitted.unseen_moves
    alike: dict[str, list[int]] = {}
    for k in h.parts:
        alike.setdefault(catalogue.of[k][0], []).append(k)
    out: dict[int, Judged] = {}
    for own in alike.values():
        found = np.array([fitted.scatter(k) for k in own])
        for k, scattered, blocks in zip(own, *moderate(*found.T), strict=True):
            scatter = max(1.0, float(scattered))  # no less than noise lets them
            odds = _odds_of(search, k, h, view, scatter, blocks)
            asked = bool(moves[list(p.acts(k))].any())
            rest = h.without({k}).parts
            price = catalogue.price(h.parts) - catalogue.price(rest)
            alone = fitted.foretold(k, alone=True) / scatter - price
            seen = fitted.foretold(k)
            out[k] = Judged(odds, scatter, seen, asked, float(alone))
    return {k: out[k] for k in h.parts}


def _odds_of(
    search: Search, k: int, h: Hypothesis, view: View, scatter: float, blocks: float
) -> float:
    """Return the log odds of a part: its evidence beside the others over `scatter`, less prices."""
    group, rest = search.catalogue.of[k], h.without({k}).parts
    p, allowed = search.problem, np.zeros(len(search.problem.candidates), bool)
    own = p.candidates[k]
    same = [
        o
        for o in search.catalogue.members[group]
        if not own.family.separate or p.candidates[o].slot == own.slot
    ]
    allowed[same] = True
    beside, at = p.columns(rest), [*p.columns(rest), *own.columns]
    left = view.evidence.beside(p.columns(h.parts)).without(own.columns)
    gains = left.gains(p.options, p.setting.rules.alias / 3, allowed)
    found = search.catalogue.best_of(gains, allowed).get(group)
    if found is None:
        return -np.inf
    price = search.catalogue.price
    # Scatter divides the information that the data have, not what the prior pays for it.
    volume = view.evidence.volume(at) - view.evidence.volume(beside)
    tempered = of_few((found[0] + volume) / scatter, blocks) - volume
    # Of a family that is nearly everywhere a further place costs nothing, and never less.
    return tempered - max(price([*rest, k]) - price(rest), 0.0)


def of_few(evidence: float, blocks: float) -> float:
    """Return what evidence, half a squared score over its scatter, is worth from so many blocks.

    What a few blocks say has the heavy tails of Student's distribution [Bell & McCaffrey 2002]; the
    normal score that is as rare is Wallace's [Wallace 1959].
    """
    size = ((8.0 * blocks + 1.0) / (8.0 * blocks + 3.0)) ** 2
    return float(size * 0.5 * blocks * np.log1p(2.0 * max(evidence, 0.0) / max(blocks, 1e-9)))


def scatter_of(scores: Array, each: Array) -> tuple[float, float]:
    """Return how much more scores scatter than noise lets them, and from how many blocks.

    It is the trace of the sandwich over that of the information; and of how many equal blocks
    that trace would be known as well [Satterthwaite 1946].

    Parameters
    ----------
    scores : (blocks, k)
    each : (blocks, k, k)
        Information of each block.
    """
    used = scores[np.any(scores != 0, axis=1)]
    V = used.T @ used * len(used) / max(len(used) - 1, 1)
    half = factor_of(each.sum(0))
    shares = np.einsum("ri,bij,sj->brs", half, each, half)
    blocks = len(half) ** 2 / max(float(np.sum(shares**2)), 1e-300)
    return float(np.trace(half @ V @ half.T)) / max(len(half), 1), blocks


def moderate(scatter: Array, blocks: Array) -> tuple[Array, Array]:
    """Return scatters (m,) of parts that are alike, and of how many blocks each is known.

    Each is drawn to what they have in common, as far as they are alike [Smyth 2004]; and what they
    have in common is known from no more blocks than the others have.
    """
    if len(scatter) < 2:
        return scatter, blocks
    half = 0.5 * blocks
    e = np.log(np.maximum(scatter, 1e-12)) - special.digamma(half) + np.log(half)
    spread = float(np.var(e, ddof=1) - np.mean(special.polygamma(1, half)))
    others = blocks.sum() - blocks
    prior = np.minimum(2.0 * _inverse_trigamma(spread), others) if spread > 0 else others
    common = np.exp(e.mean() + special.digamma(0.5 * prior) - np.log(0.5 * prior))
    both = blocks + prior
    return (blocks * scatter + prior * common) / both, both


def _inverse_trigamma(y: float) -> float:
    """Return where the trigamma function is y > 0, by Newton steps on its inverse."""
    x = 0.5 + 1.0 / y
    for _ in range(20):
        own = float(special.polygamma(1, x))
        x += own * (1.0 - own / y) / float(special.polygamma(2, x))
    return x


class Fitted:
    """A hypothesis fitted in a view: how the scores of its parts scatter, and what it foretells.

    Parameters
    ----------
    problem : Problem
    parts : sequence of int
    view : View
    """

    def __init__(self, problem: Problem, parts: Sequence[int], view: View) -> None:
        self.problem, self.parts, self.view = problem, tuple(parts), view
        p, b = problem, problem.rows.X.shape[2]
        self.at = p.columns(parts)
        ends = 1 + b + np.cumsum([0, *(len(p.candidates[k].columns) for k in parts)])
        self._own = {
            k: np.arange(start, stop)
            for k, start, stop in zip(parts, ends[:-1].tolist(), ends[1:].tolist(), strict=True)
        }
        self._white: dict[int, Array] = {}

    @cached_property
    def _total(self) -> Array:
        return self.view.total(self.at)

    @cached_property
    def _value(self) -> Array:
        value: Array = self.problem.solve(self.parts, self.view)[0]
        return value

    @cached_property
    def _number(self) -> np.ndarray:
        """The block of each row."""
        rows, block = self.problem.rows, self.problem.setting.rules.block
        at = np.floor((rows.t - rows.t.min()) / block) + 1e7 * rows.log
        number: np.ndarray = np.unique(at, return_inverse=True)[1]
        return number

    def _whitened(self, j: int) -> Array:
        if j not in self._white:
            A = self.problem.fitted.whitened(j, int(self.view.steps[j]), self.at)
            self._white[j] = A / np.sqrt(self.view.tempered[j])
        return self._white[j]

    def scatter(self, k: int) -> tuple[float, float]:
        """Return how much more the scores of a part scatter than noise lets them.

        Each joint has blocks of its own: what fits one joint at the cost of another scatters.
        """
        G, own = self._total, self._own[k]
        inner = np.setdiff1d(np.arange(1, len(G)), own)
        F = factor_of(G[np.ix_(inner, inner)])
        weights = np.zeros((len(G), 1 + len(own)))
        weights[0, 0], weights[1:, 0] = 1.0, -self._value
        weights[inner, 1:] = -F.T @ (F @ G[np.ix_(inner, own)])
        weights[own, 1:] = np.eye(len(own))
        number = self._number
        acts, count = self.problem.acts(k), int(number.max()) + 1
        scores = np.zeros((count * len(acts), len(own)))
        each = np.zeros((len(scores), len(own), len(own)))
        for n, j in enumerate(acts):
            e = self._whitened(j) @ weights
            block_of = n * count + number[self.problem.rows.data[:, j]]
            np.add.at(each, block_of, e[:, 1:, None] * e[:, None, 1:])
            np.add.at(scores, block_of, e[:, 1:] * e[:, :1])
        return scatter_of(scores, each)

    @cached_property
    def unseen_moves(self) -> np.ndarray:
        """Which joints have torque that varies in motion that was not fitted, (n,)."""
        p = self.problem
        if p.unseen is p.fitted:
            return np.zeros(p.rows.joints, bool)
        found: np.ndarray = np.any(Gap(p.shown, p.shown.tau[:, :, None]).variation > 0, axis=0)
        return found

    @cached_property
    def _predicted(self) -> tuple[Array, Array, Array]:
        """Products of torque and columns beside the model, on fitted, unseen and both motions."""
        p, view = self.problem, self.view
        errors = p.errors(p.unseen, self.parts, view)
        weights = view.tempered.tolist()
        squares = sum(float(e @ e) / t for e, t in zip(errors, weights, strict=True))
        # Squares of unseen errors may be larger than those of noise.
        scale = max(1.0, float(squares) / max(sum(len(e) for e in errors), 1))
        b = p.rows.X.shape[2]
        unseen = view.total(self.at, p.unseen) / scale
        one, other, both = (
            _beside_model(x, b) for x in (self._total, unseen, self._total + unseen)
        )
        return one, other, both

    def foretold(self, without: int | None = None, *, alone: bool = False) -> float:
        """Return the log predictive density of unseen motion over that without a part.

        The Bayes factor of both motions less that of the fitted one; of nothing over the model.
        Where unseen motion is `alone` it is the Bayes factor of that.
        """
        if self.problem.unseen is self.problem.fitted or not self.at:
            return 0.0
        b, sizes = self.problem.rows.X.shape[2], self.view.typical[self.at]
        every = np.arange(len(sizes))
        gone = every if without is None else self._own[without] - 1 - b
        fitted, unseen, both = self._predicted
        if alone:
            fitted, both = np.zeros_like(unseen), unseen
        rest = np.setdiff1d(every, gone)
        return sum(
            sign * (_log_bayes(both, sizes, at) - _log_bayes(fitted, sizes, at))
            for sign, at in ((1.0, every), (-1.0, rest))
        )


def _beside_model(G: Array, b: int) -> Array:
    """Return products of torque and columns (1 + k, ·) beside the b columns of the model."""
    at = np.r_[0, 1 + b : len(G)]
    C = factor_of(G[1 : 1 + b, 1 : 1 + b]) @ G[1 : 1 + b][:, at]
    P: Array = G[np.ix_(at, at)] - C.T @ C
    return P


def _log_bayes(P: Array, sizes: Array, at: np.ndarray) -> float:
    own = sizes[at]
    S = np.eye(len(at)) + P[1:, 1:][np.ix_(at, at)] * own * own[:, None]
    L = np.linalg.cholesky(0.5 * (S + S.T))
    u = np.linalg.solve(L, P[1 + at, 0] * own)
    return float(0.5 * u @ u - np.log(np.diag(L)).sum())


@frozen
class Verdict:
    """What stands, and what does not.

    Attributes
    ----------
    hypothesis : Hypothesis
    view : View
        The rows as it leaves them.
    judged, refuted : mapping of part to Judged
    """

    hypothesis: Hypothesis
    view: View
    judged: dict[int, Judged]
    refuted: dict[int, Judged]


def settle(search: Search, start: Hypothesis) -> Verdict:
    """Return what the search finds and unseen motion lets stand: names, then functions beside them.

    The simplest that is as good has the name: a function gives way to a name at its place that is
    sure, too, and predicts unseen motion as well.
    """
    candidates = search.problem.candidates
    functions = [k for k in start.parts if candidates[k].family.unnamed]
    named = _settle(search, start.without(functions), functions=False)
    begun = named.hypothesis
    for k in functions:
        begun = begun.add(k, 0.0)
    both = _settle(search, begun, functions=True)
    both = _specialise(search, both if both.hypothesis.parts else named)
    stated = {search.catalogue.of[k] for k in both.hypothesis.parts}
    refuted = {**named.refuted, **both.refuted}
    refuted = {k: x for k, x in refuted.items() if search.catalogue.of[k] not in stated}
    return replace(both, refuted=refuted)


def refute_worse(search: Search, verdict: Verdict, rng: np.random.Generator) -> Verdict:
    """Return a verdict without parts beside which unseen torque is surely predicted worse.

    The likelihood weighs what noise that remembers lets through; levels, which it hides, count as
    much as all else where torque is predicted by the values that are stated.

    Parameters
    ----------
    search : Search
    verdict : Verdict
        Of `settle`.
    rng : numpy.random.Generator
    """
    p, refuted = search.problem, verdict.refuted
    while verdict.hypothesis.parts and p.unseen is not p.fitted:
        h, view = verdict.hypothesis, verdict.view
        whole = _stated(p, h.parts, view)
        rises = {k: _rise(p, _stated(p, h.without({k}).parts, view), whole, rng) for k in h.parts}
        surely = any(low > 0 for _, low in rises.values())
        if not surely and not _rise(p, _stated(p, (), p.settled(())), whole, rng)[1] > 0:
            break
        worst = max(rises, key=lambda k: rises[k])
        refuted[worst] = verdict.judged[worst]
        verdict = _take_out(search, _without(search, verdict, worst, refuted))
    return verdict


def _stated(p: Problem, parts: Sequence[int], view: View) -> Array:
    """Return what the values that are stated leave of unseen torque, (N, n)."""
    return p.left(p.shown, parts, p.weighed(parts, view)[0])


def _rise(p: Problem, before: Array, after: Array, rng: np.random.Generator) -> tuple[float, float]:
    """Return by how much the error over joints rises, and the lower end of its interval."""
    gap = Gap(p.shown, np.stack([before, after], axis=2))
    one, two = gap.error_over_joints().tolist()
    return two - one, gap.interval_over_joints(0, 1, rng)[0]


def _specialise(search: Search, verdict: Verdict) -> Verdict:
    """Return a verdict in which names stand for functions that foretell no more."""
    p, rules = search.problem, search.problem.setting.rules
    for k in verdict.hypothesis.parts:
        if not p.candidates[k].family.unnamed:
            continue
        rest = verdict.hypothesis.without({k})
        near = search.options(rest.parts, verdict.view, functions=False)
        own = [x for x in near.values() if p.candidates[x[1]].place == p.candidates[k].place]
        for _, name, shaped in sorted(own, reverse=True)[: rules.options]:
            other = rest.add(name, shaped)
            two = (Fitted(p, x.parts, verdict.view) for x in (other, verdict.hypothesis))
            name_foretells, function_foretells = (x.foretold() for x in two)
            if name_foretells < function_foretells:
                continue
            view = p.settled(other.parts, verdict.view)
            judged = judge_parts(search, other, view)
            if all(x.stands(rules.odds) for x in judged.values()):
                verdict = Verdict(other, view, judged, verdict.refuted)
                break
    return verdict


def _settle(search: Search, start: Hypothesis, *, functions: bool) -> Verdict:
    """Return what stands: search, take out and bar what does not, and go on from what is left."""
    refuted: dict[int, Judged] = {}
    h, view = search.run(start, functions=functions)
    while True:
        found = _take_out(search, Verdict(h, view, {}, refuted))
        if found.hypothesis.key == h.key:
            return found
        h, view = search.run(found.hypothesis, functions=functions)
        if h.key == found.hypothesis.key:
            return found


def _take_out(search: Search, verdict: Verdict) -> Verdict:
    """Return a verdict without the parts that do not stand, one taken out after the other."""
    level, refuted = search.problem.setting.rules.odds, verdict.refuted
    while verdict.hypothesis.parts:
        judged = judge_parts(search, verdict.hypothesis, verdict.view)
        bad = [k for k in judged if not judged[k].stands(level)]
        if not bad:
            return replace(verdict, judged=judged)
        worst = min(bad, key=lambda k: judged[k].standing(level))
        if judged[worst].odds >= level:
            refuted[worst] = judged[worst]
        verdict = _without(search, verdict, worst, refuted)
    return verdict


def _without(search: Search, verdict: Verdict, part: int, refuted: dict[int, Judged]) -> Verdict:
    """Return a verdict without a part and what refines it, not judged yet; it is barred."""
    search.barred.add(search.catalogue.of[part])
    if part in refuted:
        search.refuted.add(search.catalogue.of[part])
    h = verdict.hypothesis.without({part})
    while h.parts and not search.catalogue.fits(h.parts):
        h = h.without({h.parts[-1]})
    return Verdict(h, search.problem.settled(h.parts, verdict.view), {}, refuted)
