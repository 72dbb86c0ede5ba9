"""The verdict on a hypothesis: how sure each part is, and what unseen motion says of it.

What only resembles the missing effect, or stands for a joint that sticks, scatters more from block
to block than noise lets it: the evidence of a part is divided by that [White 1982]. Motion that
did not choose must be likelier with it, and the error of its joints there must fall.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.evidence import View, factor_of
from identifiability.workflows.diagnose.gap import Gap
from identifiability.workflows.diagnose.hypothesis import Hypothesis
from identifiability.workflows.diagnose.problem import Problem
from identifiability.workflows.diagnose.rules import Rules
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
    before, after : float
        Error of its joints on unseen motion, each over its own scale, without and with it.
    asked, falls : bool
        Whether there is any unseen motion of its joints, and whether their error must fall there:
        not where values within their errors take on what a part adds.
    """

    odds: float
    scatter: float
    unseen: float
    before: float
    after: float
    asked: bool = True
    falls: bool = True

    def why(self, rules: Rules) -> str:
        """Return what refutes it, to follow its name."""
        if not self.unseen > 0:
            return "unseen motion is likelier without it"
        return (
            f"the error of its joints on unseen motion falls by less than {100 * rules.shows:g} %"
        )

    def stands(self, odds: float, shows: float) -> bool:
        """Whether a part is stated: sure on the fitted motion, and not refuted by the unseen."""
        return self.odds >= odds and not self.refuted(shows)

    def standing(self, odds: float) -> tuple[bool, float]:
        """Return what orders parts that do not stand: first those that are not sure at all."""
        return self.odds >= odds, -self.after / max(self.before, 1e-300)

    def refuted(self, shows: float) -> bool:
        """Whether unseen motion is not likelier with it, or the error of its joints stays."""
        stays = self.falls and self.after > (1.0 - shows) * self.before
        return self.asked and (not self.unseen > 0 or stays)


def judge_parts(search: Search, h: Hypothesis, view: View) -> dict[int, Judged]:
    """Return what is to be said of every part of a hypothesis."""
    p = search.problem
    asked = p.unseen is not p.fitted
    whole = p.residual(p.shown, h.parts, view)
    both = _beside_unseen(p, h, view)
    predicted = predictive(p, h.parts, view, both)
    out: dict[int, Judged] = {}
    views: dict[tuple[int, ...], View] = {}
    for k in h.parts:
        rest = h.without({k}).parts
        scatter, blocks = scatter_of(p, k, h.parts, view)
        odds = _odds_of(search, k, rest, view, scatter, blocks)
        # Two that undo one another each help beside the other: all of the joint must, too.
        joint = _strongest(p, k, h, view)
        none = h.without({o for o in h.parts if joint in p.acts(o)}).parts
        # Without it the others are as good as they can be: weighed as they leave the rows, too.
        models = [
            p.residual(p.shown, parts, v)
            for parts in dict.fromkeys((tuple(rest), tuple(none)))
            for v in (view, _own_view(p, parts, views))
        ]
        gap = Gap(p.shown, np.stack([*models, whole], axis=2))
        *without, after = gap.at([joint]).error_over_joints().tolist()
        before = min(without)
        unseen = predicted - predictive(p, rest, view, both)
        seen = asked and bool(np.isfinite(before))
        out[k] = Judged(odds, scatter, unseen, before, after, seen, p.rows.root is None)
    return out


def _own_view(p: Problem, parts: tuple[int, ...], known: dict[tuple[int, ...], View]) -> View:
    """Return the rows as some parts leave them."""
    if parts not in known:
        known[parts] = p.settled(parts)
    return known[parts]


def _strongest(p: Problem, k: int, h: Hypothesis, view: View) -> int:
    """Return the joint in which a part is the largest share of what the fitted motion leaves."""
    c = p.candidates[k]
    value, _ = p.solve([*(o for o in h.parts if o != k), k], view)
    added = p.rows.D.take(c.columns) @ value[-len(c.columns) :]
    left = p.residual(p.rows, h.parts, view)
    squares = np.sum(added**2, axis=0) / np.maximum(np.sum(left**2, axis=0), 1e-300)
    return max(p.acts(k), key=lambda j: float(squares[j]))


def _odds_of(
    search: Search, k: int, rest: Sequence[int], view: View, scatter: float, blocks: float
) -> float:
    """Return the log odds of a part: its evidence beside the others over `scatter`, less prices."""
    group = search.catalogue.of[k]
    p, allowed = search.problem, np.zeros(len(search.problem.candidates), bool)
    own = p.candidates[k]
    same = [
        o
        for o in search.catalogue.members[group]
        if not own.family.separate or p.candidates[o].slot == own.slot
    ]
    allowed[same] = True
    found = search.catalogue.best_of(search.gains(rest, view), allowed).get(group)
    if found is None:
        return -np.inf
    price = search.catalogue.price
    # Scatter divides the information that the data have, not what the prior pays for it.
    beside, at = p.columns(rest), [*p.columns(rest), *own.columns]
    volume = view.evidence.volume(at) - view.evidence.volume(beside)
    tempered = of_few((found[0] + volume) / scatter, blocks) - volume
    # Of a family that is nearly everywhere a further place costs nothing, and never less.
    return tempered - max(price([*rest, k]) - price(rest), 0.0)


def of_few(evidence: float, blocks: float) -> float:
    """Return what evidence, half a squared score over its scatter, is worth from so many blocks.

    What a few blocks say has the heavy tails of Student's distribution [Bell & McCaffrey 2002]; the
    normal score that is as rare is Wallace's [1959].
    """
    size = ((8.0 * blocks + 1.0) / (8.0 * blocks + 3.0)) ** 2
    return float(size * 0.5 * blocks * np.log1p(2.0 * max(evidence, 0.0) / max(blocks, 1e-9)))


def scatter_of(p: Problem, k: int, parts: Sequence[int], view: View) -> tuple[float, float]:
    """Return how much more the scores of a part scatter than noise lets them, one at least.

    It is the trace of the sandwich over that of the information; and of how many equal blocks that
    trace would be known as well [Satterthwaite 1946].
    """
    own = p.candidates[k].columns
    rest = [o for o in parts if o != k]
    at = [*p.columns(rest), *own]
    G = view.total(at)
    inner = len(G) - len(own)
    F = factor_of(G[1:inner, 1:inner])
    C = F.T @ (F @ G[1:inner, inner:])
    value, _ = p.solve([*rest, k], view)
    weights = np.zeros((len(G), 1 + len(own)))
    weights[0, 0], weights[1:, 0] = 1.0, -value
    weights[1:inner, 1:] = -C
    weights[inner:, 1:] = np.eye(len(own))
    rows, block = p.rows, p.setting.rules.block
    number = np.unique(
        np.floor((rows.t - rows.t.min()) / block) + 1e7 * rows.log, return_inverse=True
    )[1]
    scores = np.zeros((int(number.max()) + 1, len(own)))
    each = np.zeros((len(scores), len(own), len(own)))
    for j in p.acts(k):
        e = p.fitted.whitened(j, int(view.steps[j]), at) @ weights / np.sqrt(view.tempered[j])
        block_of = number[rows.data[:, j]]
        np.add.at(each, block_of, e[:, 1:, None] * e[:, None, 1:])
        np.add.at(scores, block_of, e[:, 1:] * e[:, :1])
    used = scores[np.any(scores != 0, axis=1)]
    V = used.T @ used * len(used) / max(len(used) - 1, 1)
    half = factor_of(each.sum(0))
    shares = np.einsum("ri,bij,sj->brs", half, each, half)
    blocks = len(half) ** 2 / max(float(np.sum(shares**2)), 1e-300)
    return max(1.0, float(np.trace(half @ V @ half.T)) / max(len(half), 1)), blocks


def _beside_unseen(p: Problem, h: Hypothesis, view: View) -> float:
    """Return how much larger the squares of unseen errors are than those of noise."""
    if p.unseen is p.fitted:
        return 1.0
    errors = p.errors(p.unseen, h.parts, view)
    weights = view.tempered.tolist()
    squares = sum(float(e @ e) / t for e, t in zip(errors, weights, strict=True))
    return max(1.0, float(squares) / max(sum(len(e) for e in errors), 1))


def predictive(p: Problem, parts: Sequence[int], view: View, scale: float) -> float:
    """Return the log predictive density of unseen motion given the fitted one.

    Over that of the model alone: the Bayes factor of both motions less that of the fitted one.
    """
    at = p.columns(parts)
    if p.unseen is p.fitted or not at:
        return 0.0
    fitted, unseen = view.total(at), view.total(at, p.unseen)
    sizes = view.sizes[at]
    return _log_bayes(fitted + unseen / scale, sizes) - _log_bayes(fitted, sizes)


def _log_bayes(G: Array, sizes: Array) -> float:
    inner = len(G) - len(sizes)
    F = factor_of(G[1:inner, 1:inner])
    C = F @ G[1:inner][:, [0, *range(inner, len(G))]]
    P = G[np.ix_([0, *range(inner, len(G))], [0, *range(inner, len(G))])] - C.T @ C
    S = np.eye(len(sizes)) + P[1:, 1:] * sizes * sizes[:, None]
    L = np.linalg.cholesky(0.5 * (S + S.T))
    u = np.linalg.solve(L, P[1:, 0] * sizes)
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
            view = p.settled(other.parts, verdict.view)
            judged = judge_parts(search, other, view)
            worse = judged[name].after > verdict.judged[k].after
            if not worse and all(x.stands(rules.odds, rules.shows) for x in judged.values()):
                verdict = Verdict(other, view, judged, verdict.refuted)
                break
    return verdict


def _settle(search: Search, start: Hypothesis, *, functions: bool) -> Verdict:
    """Return what stands, one part taken out after the other and barred."""
    rules = search.problem.setting.rules
    refuted: dict[int, Judged] = {}
    h, view = search.run(start, functions=functions)
    while h.parts:
        judged = judge_parts(search, h, view)
        bad = [k for k in h.parts if not judged[k].stands(rules.odds, rules.shows)]
        if not bad:
            return Verdict(h, view, judged, refuted)
        worst = min(bad, key=lambda k: judged[k].standing(rules.odds))
        if judged[worst].odds >= rules.odds:
            refuted[worst] = judged[worst]
        search.barred.add(search.catalogue.of[worst])
        rest = h.without({worst})
        while rest.parts and not search.catalogue.fits(rest.parts):
            rest = rest.without({rest.parts[-1]})
        h, view = search.run(rest, functions=functions)
    return Verdict(h, view, {}, refuted)
