"""What changed in the middle of a log: a mass that was gripped, a brake that dragged for seconds.

No effect of the robot says it, and no unseen motion can judge it: the fitted motion alone has the
instant. So a change is a hypothesis beside all that is named: one part that acts in some blocks of
one log only, priced by all instants, logs and places where it might have been. What drifts, as
friction that warms up, is a step to those who know steps only: so each candidate may drift as well,
in one log or in all, and a change is said where no drift is as good. What was logged while a change
lasted is of another robot, and is left out of all that follows.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from identifiability.effects import find_families
from identifiability.effects.effect import Placed
from identifiability.estimation.estimate import Outliers
from identifiability.estimation.noise import ARNoise, JointNoise, JointRuns, fit_joint, runs_of
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.regression.columns import Candidate, is_body, list_candidates, number
from identifiability.workflows.diagnose.evidence import (
    Products,
    View,
    factor_of,
    step_of,
    tempering,
)
from identifiability.workflows.diagnose.known_values import VECTORS
from identifiability.workflows.diagnose.motion import Change
from identifiability.workflows.diagnose.problem import Setting
from identifiability.workflows.diagnose.search import Search
from identifiability.workflows.diagnose.verdict import Verdict, of_few, scatter_of

#: What may begin and end while a robot is logged: a load, a brake or dirt, a counterweight.
CHANGING = ("payload", "coulomb_friction", "viscous_friction", "torque_offset")

#: Changes with whose noise the search for the likeliest begins, and rounds that settle it.
STARTS, SETTLED = 3, 3
#: Of each joint the block of its rows, torque and model, and candidates, whitened.
Blocks = list[tuple[np.ndarray, Array, Array]]


@frozen
class Stay:
    """Where a candidate acts, in blocks of one log or as a drift, with what the rows say of it.

    Attributes
    ----------
    candidate : int
    course : (blocks,)
        How much of it acts in each block of all logs.
    log : int
        Minus one for a drift.
    first, last : int
        Blocks of that log, the last one not with it.
    evidence, price : float [nat]
        Logarithm of its Bayes factor, and of the number of alternatives.
    others : (first, last, evidence less price), each (s,)
        All stays of the candidate in that log.
    """

    candidate: int
    course: Array
    log: int
    first: int
    last: int
    evidence: float
    price: float
    others: tuple[np.ndarray, np.ndarray, Array]

    @property
    def drifts(self) -> bool:
        """Whether it has no instant."""
        return self.log < 0

    @property
    def key(self) -> tuple[int, bytes]:
        """What acts, and when."""
        return self.candidate, self.course.tobytes()

    def ends(self, scatter: float) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return between which blocks it began, and ended, in 95 % of what is likely.

        What is sharp is whitened before blocks are told apart: a block more on each side.
        """
        first, last, value = self.others
        weight = np.exp((value - value.max()) / scatter)
        out = []
        for x in (first, last):
            share = np.cumsum(np.bincount(x, weight)) / weight.sum()
            low, high = np.searchsorted(share, [0.025, 0.975]).tolist()
            out.append((low - 1, high + 1))
        return out[0], out[1]


class Scan:
    """Products of whitened rows in every block of every log, beside a model with some parts.

    Parameters
    ----------
    search : Search
    parts : sequence of int
        What is named.
    families : collection of str
        What may change.
    """

    def __init__(self, search: Search, parts: Sequence[int], families: Collection[str]) -> None:
        self.problem, self.parts = search.problem, tuple(parts)
        p = self.problem
        s, rules = p.setting, p.setting.rules
        robot, motions = s.structure.robot, [x.motion for x in s.samples]
        listed, _ = list_candidates(robot, find_families(families), (), motions, fixed=True)
        listed = number([_settled(c) for c in listed])
        self.rows = p.tables[0].rows(listed)
        self.sizes = p.typical(listed, self.rows)
        self.candidates = [c for c in listed if self.sizes[list(c.columns)].any()]
        self.model, self.products = p.fitted, Products(self.rows, p.noise)
        t, log = self.rows.t, self.rows.log
        self.logs = np.unique(log)
        self.begin = np.array([t[log == n].min() for n in self.logs])
        whole = np.array([t[log == n].max() for n in self.logs]) - self.begin
        self.width = np.maximum(rules.block, whole / rules.instants)
        self.count = np.maximum(np.ceil(whole / self.width - 1e-9), 1).astype(int)
        at = np.searchsorted(self.logs, log)
        own = np.minimum(((t - self.begin[at]) / self.width[at]).astype(int), self.count[at] - 1)
        self.start = np.r_[0, np.cumsum(self.count)]
        self.block = self.start[at] + own
        sessions = [x.start for x in motions]
        self.drifts = self._drifts([x for x in sessions if x is not None])
        self._noises: dict[tuple[int, bytes, int], JointNoise] = {}

    def whitened(self, view: View) -> Blocks:
        """Return of each joint the block of its rows, torque and model, and candidates."""
        p, b = self.problem, self.rows.X.shape[2]
        out = []
        for j, step in enumerate(view.steps.tolist()):
            A = self.model.whitened(j, step, p.columns(self.parts))
            ids = self.products.ids[j]
            C = np.zeros((len(A), len(self.sizes)))
            C[:, ids] = self.products.whitened(j, step, ids)[:, 1 + b :] * self.sizes[ids]
            scale = np.sqrt(view.tempered[j])
            out.append((self.block[self.rows.data[:, j]], A / scale, C / scale))
        return out

    def likeliest(self, rows: Blocks) -> list[Stay]:
        """Return for every candidate where in the logs it is likeliest, and how it would drift.

        Half of the stays, of which each is as likely beforehand, go on to the end of their log.
        """
        blocks, m, K = int(self.start[-1]), rows[0][1].shape[1], len(self.sizes)
        head, own, cross = np.zeros((m, m)), np.zeros((blocks, K, K)), np.zeros((blocks, m, K))
        for block, A, C in rows:
            head += A.T @ A
            ends = np.searchsorted(block, np.arange(blocks + 1))
            for k in np.flatnonzero(np.diff(ends)).tolist():
                here = slice(ends[k], ends[k + 1])
                own[k] += C[here].T @ C[here]
                cross[k] += A[here].T @ C[here]
        F = self._factor(head[1:, 1:])
        f, C = F @ head[1:, 0], np.einsum("ri,bik->brk", F, cross[:, 1:])
        out: list[Stay] = []
        for which, c in enumerate(self.candidates):
            at = list(c.columns)
            g, price = self.drifts
            P = np.einsum("sb,bij->sij", g**2, own[:, at][:, :, at])
            value = _evidence(P, g @ cross[:, 0, at], np.tensordot(g, C[:, :, at], 1), f)
            k, every = int(np.argmax(value - price)), np.arange(len(g))
            drift = Stay(which, g[k], -1, 0, blocks, value[k], price[k],
                         (every, every, value - price))  # fmt: skip
            out.append(drift)
            best: Stay | None = None
            for n, log in enumerate(self.logs.tolist()):
                here = slice(self.start[n], self.start[n + 1])
                first, last, price = self._stays(n)
                if not len(first):  # a log of half a second has no middle
                    continue
                P, z, X = (
                    np.concatenate([np.zeros_like(x[:1]), np.cumsum(x, axis=0)])
                    for x in (own[here][:, at][:, :, at], cross[here][:, 0, at], C[here][:, :, at])
                )
                value = _evidence(P[last] - P[first], z[last] - z[first], X[last] - X[first], f)
                k = int(np.argmax(value - price))
                if best is None or value[k] - price[k] > best.evidence - best.price:
                    course = np.zeros(blocks)
                    course[here][first[k] : last[k]] = 1.0
                    best = Stay(which, course, log, int(first[k]), int(last[k]), value[k],
                                price[k], (first, last, value - price))  # fmt: skip
            if best is not None:
                out.append(best)
        return sorted(out, key=lambda x: x.price - x.evidence)

    def _drifts(self, sessions: Sequence[float]) -> tuple[Array, Array]:
        """Return how a drift may go, in each block (s, blocks), and what each must explain [nat].

        It goes away or comes, in one log, in all alike, or along the session that they are of; and
        what differs between logs is as slow as can be.
        """
        logs = np.repeat(np.arange(len(self.logs)), self.count)
        t = (np.arange(len(logs)) - self.start[logs] + 0.5) * self.width[logs]
        alone = [logs == n for n in range(len(self.logs))]
        clocks = [np.where(on, t, np.nan) for on in alone] + [t]
        if len(sessions) == len(self.logs):
            clocks.append(t + (self.begin + np.array(sessions))[logs])
        out = [on.astype(float) for on in alone]
        for clock in clocks:
            x = (clock - np.nanmin(clock)) / max(float(np.nanmax(clock) - np.nanmin(clock)), 1e-9)
            # What drifts is linear in time, or decays with these time constants, in
            # shares of all the time.
            for course in (1.0 - x, *(np.exp(-x / d) for d in (1 / 3, 1 / 10))):
                out += [np.nan_to_num(course), np.nan_to_num(1.0 - course)]
        price = np.log(2 * len(self.candidates) * len(out))
        return np.array(out), np.full(len(out), price)

    def _stays(self, n: int) -> tuple[np.ndarray, np.ndarray, Array]:
        """Return first and last blocks of all stays in a log, and what each must explain [nat]."""
        count = int(self.count[n])
        first, last = np.triu_indices(count + 1, 1)
        # What lasted as long as the log is a difference between logs; and of one log alone what
        # ended in it says as much as what began then.
        may = (last - first < count) & ((first > 0) | (len(self.logs) > 1))
        first, last = first[may], last[may]
        on = last == count
        each = np.where(on, on.sum(), (~on).sum())
        kinds = 2 * len(self.logs) * len(self.candidates)
        return first, last, np.log(kinds * np.maximum(each, 1.0))

    def _factor(self, G: Array) -> Array:
        """Return the factor of the model's products, with the prior of what is named."""
        b, at = self.rows.X.shape[2], self.problem.columns(self.parts)
        G = G.copy()
        if self.rows.root is not None:
            G[:b, :b] += self.rows.root.T @ self.rows.root
        size = self.problem.sizes[at]
        prior = 1.0 / np.where(size > 0, size, np.inf) ** 2
        G[range(b, len(G)), range(b, len(G))] += prior
        return factor_of(G)

    def fit(self, stay: Stay, rows: Blocks) -> ChangeFit:
        """Return a change fitted beside the model: values, covariance, scatter of its scores."""
        at = list(self.candidates[stay.candidate].columns)
        every = [np.column_stack([A, C[:, at] * stay.course[block, None]]) for block, A, C in rows]
        G = sum(A.T @ A for A in every)
        m, k = len(G) - len(at), len(at)
        F = self._factor(G[1:m, 1:m])
        inner = F.T @ (F @ G[1:m])
        P = G[m:, m:] - G[m:, 1:m] @ inner[:, m:]
        half = factor_of(P)
        value = half.T @ (half @ (G[m:, 0] - G[m:, 1:m] @ inner[:, 0]))
        whole = np.r_[1.0, -(inner[:, 0] - inner[:, m:] @ value), -value]
        # How its scores scatter while nothing changes is known from all blocks, not from a few.
        blocks = int(self.start[-1])
        scores = np.zeros((len(rows) * blocks, k))
        each = np.zeros((len(scores), k, k))
        for n, ((block, _, C), A) in enumerate(zip(rows, every, strict=True)):
            np.add.at(each, n * blocks + block, C[:, at, None] * C[:, None, at])
            np.add.at(scores, n * blocks + block, C[:, at] * (A @ whole)[:, None])
        scatter, equal = scatter_of(scores, each)
        sizes = self.sizes[at]
        return ChangeFit(value * sizes, half * sizes, P, max(1.0, scatter), equal, whole)

    def widen(self, found: Sequence[Stay], rows: Blocks) -> Blocks:
        """Let all be typically as large as they are where they are likeliest."""
        ratio = np.ones(len(self.sizes))
        for x in {x.candidate: x for x in reversed(found)}.values():
            at = list(self.candidates[x.candidate].columns)
            size = np.where(self.sizes[at] > 0, self.sizes[at], np.inf)
            ratio[at] = np.maximum(np.abs(self.fit(x, rows).values) / size, 1.0)
        self.sizes = self.sizes * ratio
        return [(block, A, C * ratio) for block, A, C in rows]

    def reweigh(self, stay: Stay, fit: ChangeFit, view: View) -> View:
        """Return the rows weighed as a change leaves them, by the noise without it."""
        p, at = self.problem, list(self.candidates[stay.candidate].columns)
        b, named = self.rows.X.shape[2], p.columns(self.parts)
        course, noise = stay.course[self.block, None], self._noise_without(stay)
        self.model, self.products = Products(p.rows, noise), Products(self.rows, noise)
        left = self.rows.tau + self.rows.X @ fit.whole[1 : 1 + b]
        left += p.rows.D.take(named) @ fit.whole[1 + b : 1 + b + len(named)]
        left -= (self.rows.D.take(at) @ fit.values) * course
        steps = np.array([
            step_of(x, n.left)
            for x, n in zip(noise.misfit(left, self.rows.counts), noise.joints, strict=True)
        ])  # fmt: skip
        rules, share = p.setting.rules, (b + len(named)) / len(steps)
        errors = [self.model.whiten(left, j, step) for j, step in enumerate(steps.tolist())]
        return replace(
            view,
            steps=steps,
            tempered=tempering(errors, share, rules.lag, rules.usual),
        )

    def _noise_without(self, stay: Stay) -> ARNoise:
        """Return the noise that there is without a change; each joint's is fitted once.

        Noise is that of the blocks where it does not act, nor beside these: of a change that is not
        fitted well yet the rest looks like slow noise, beside which it is none; and it begins and
        ends where blocks do not. Of what acts nearly everywhere, as drifts do, it is that beside
        its columns.
        """
        at, named = self.candidates[stay.candidate].columns, self.problem.columns(self.parts)
        near = np.convolve(stay.course > 0, np.ones(3), "same")[self.block] > 0
        rest = self.rows.data & ~near[:, None]
        most = 2 * rest.sum() > self.rows.data.sum()
        runs = JointRuns.of(self.rows.runs, rest) if most else self.rows.moving
        joints = []
        for j, y in enumerate(self.rows.tau.T):
            own = self.rows.D.acting(j, at) * stay.course[self.block, None]
            key = j, stay.course.tobytes(), stay.candidate if own.any() else -1
            if key not in self._noises:
                model = [self.rows.X[:, j], self.problem.rows.D.acting(j, named)]
                columns = np.concatenate([*model, own], axis=1)
                self._noises[key] = fit_joint(y, [columns], runs_of(runs, j))
            joints.append(self._noises[key])
        return ARNoise(tuple(joints))


def _evidence(P: Array, z: Array, X: Array, f: Array) -> Array:
    """Return the logarithms of Bayes factors of columns (s,), from products with their own kind.

    Parameters
    ----------
    P, z, X : (s, k, k), (s, k) and (s, r, k)
        Products with one another, with the torque, and with the model, that over its factor.
    f : (r,)
        The torque with the model, over its factor.
    """
    L = np.linalg.cholesky(P - X.transpose(0, 2, 1) @ X + np.eye(P.shape[1]))
    u = np.linalg.solve(L, (z - np.einsum("srk,r->sk", X, f))[:, :, None])[:, :, 0]
    value: Array = 0.5 * (u**2).sum(1) - np.log(np.einsum("sii->si", L)).sum(1)
    return value


def _settled(c: Candidate) -> Candidate:
    """Return a load as what is small and held somewhere: a mass with its first moments."""
    if not is_body(c):
        return c
    first = 1 + len(VECTORS[1])
    return replace(c, kinds=c.kinds[:first], columns=c.columns[:first])


@frozen
class ChangeFit:
    """A change beside a model.

    Attributes
    ----------
    values : (k,)
    half : (r, k)
        Its columns' outer product is their covariance.
    P : (k, k)
        Products of its columns, over their typical sizes, beside the model.
    scatter, blocks : float
        How much more its scores scatter than noise lets them, and from how many blocks.
    whole : (1 + b + …,)
        Minus the values of all that was fitted, behind a one.
    """

    values: Array
    half: Array
    P: Array
    scatter: float
    blocks: float
    whole: Array


#: What is likeliest beside the noise that a change leaves, the first of it fitted, and rows.
Settled = tuple[list[Stay], ChangeFit, Blocks]


def find_change(
    search: Search, parts: Sequence[int], view: View, families: Collection[str] = CHANGING
) -> Change | None:
    """Return the likeliest change in the middle of a log beside some parts, sure or not.

    None where what drifts says it as well.

    Parameters
    ----------
    search : Search
    parts : sequence of int
        What is named.
    view : View
        Rows as these leave them.
    families : collection of str
        What may change.
    """
    scan = Scan(search, parts, families)
    if not scan.candidates or scan.rows.joints == 0:
        return None
    rows = scan.whitened(view)
    likely = [x for x in scan.likeliest(rows) if x.evidence > 0]
    # Beside noise that has the change in it another one may look likelier.
    starts = [*likely[:STARTS], *[x for x in likely[STARTS:] if x.drifts][:1]]
    settled: dict[tuple[int, bytes], Settled] = {}
    for x in starts:
        _settle(scan, x, rows, view, settled)
    if not settled:
        return None
    found, fit, rows = max(settled.values(), key=lambda x: _odds(x[0][0], x[1]))
    best, odds = found[0], _odds(found[0], fit)
    share = search.problem.setting.rules.level
    weights = _weights(found, fit)
    drifts = np.array([x.drifts for x in found])
    if best.drifts or weights[drifts].sum() > share:
        return None
    if odds > 0:  # it is there: what it is was not less likely for being large
        rows = scan.widen(found, rows)
        found = scan.likeliest(rows)
    found = [x for x in found if not x.drifts]
    best = found[0]
    fit, c = scan.fit(best, rows), scan.candidates[best.candidate]
    weights = _weights(found, fit)
    among = found[: 1 + int(np.searchsorted(np.cumsum(weights), 1.0 - share))]
    n = int(np.searchsorted(scan.logs, best.log))
    begin, width = float(scan.begin[n]), float(scan.width[n])
    robot = search.problem.setting.structure.robot
    parameters = Placed.part_parameters(robot, c.part)
    size = np.sqrt(np.maximum(np.diag(fit.P), 1e-300))
    unit = fit.P / np.outer(size, size)
    known = factor_of(unit)
    alone = np.abs(np.diag(known.T @ (known @ unit)) - 1.0) < NEARLY
    count, at = int(scan.count[n]), best.ends(fit.scatter)
    began, ended = (tuple(begin + width * np.clip(x, 0, count)) for x in np.array(at))
    return Change(
        log=search.problem.setting.samples[n].name,
        number=n,
        start=begin + best.first * width if best.first else -np.inf,
        stop=begin + best.last * width if best.last < count else np.inf,
        began=began if best.first else (-np.inf, -np.inf),
        ended=ended if best.last < count else (np.inf, np.inf),
        family=c.family.name,
        title=c.family.title,
        place=c.place,
        parameters=tuple(x.name for x in parameters),
        units=tuple(x.unit for x in parameters),
        values=fit.values,
        errors=np.sqrt((fit.half**2).sum(0) * fit.scatter),
        open=tuple(x.name for x, one in zip(parameters, alone, strict=True) if not one),
        odds=odds,
        weight=float(weights[0]),
        others=tuple(scan.candidates[x.candidate].group for x in among[1:]),
    )


def _settle(
    scan: Scan,
    start: Stay,
    rows: Blocks,
    view: View,
    settled: dict[tuple[int, bytes], Settled],
) -> None:
    """Note what is likeliest beside the noise that a change leaves, and end where others did."""
    best = start
    for _ in range(SETTLED):
        rows = scan.whitened(scan.reweigh(best, scan.fit(best, rows), view))
        found, before = scan.likeliest(rows), best
        best = found[0]
        if best.key in settled:
            return
        if best.key == before.key:
            break
    settled[best.key] = found, scan.fit(best, rows), rows


def _weights(found: Sequence[Stay], fit: ChangeFit) -> Array:
    """Return the posterior probability of each of some changes, (k,)."""
    level = np.array([x.evidence - x.price for x in found]) / fit.scatter
    weights: Array = np.exp(level - logsumexp(level))
    return weights


def _odds(stay: Stay, fit: ChangeFit) -> float:
    volume = 0.5 * float(np.linalg.slogdet(np.eye(len(fit.P)) + fit.P)[1])
    return of_few((stay.evidence + volume) / fit.scatter, fit.blocks) - volume - stay.price


def change_first(search: Search, effects: Collection[str] | None) -> tuple[Change | None, bool]:
    """Return the likeliest change beside the model alone, and whether it goes before any name.

    It does where it is surely there and explains more than any one name: what it leaves would else
    be named piece by piece.
    """
    families = _changing(effects)
    view = search.problem.settled(())
    found = find_change(search, (), view, families) if families else None
    if found is None:
        return None, False
    names = search.options((), view, functions=False).values()
    most = max((value for value, *_ in names), default=0.0)
    return found, found.odds >= max(search.problem.setting.rules.odds, most)


def change_beside(
    search: Search,
    verdict: Verdict,
    alone: Change | None = None,
    effects: Collection[str] | None = None,
) -> Change | None:
    """Return a change that is surely there beside what was named, or in its stead; or None.

    Parameters
    ----------
    search : Search
    verdict : Verdict
    alone : Change, optional
        The likeliest one beside the model alone.
    effects : collection of str, optional
        Families that may be named; all by default.
    """
    level, named = search.problem.setting.rules.odds, verdict.hypothesis
    families = _changing(effects)
    if named.parts and families:
        found = find_change(search, named.parts, verdict.view, families)
        if found is not None and found.odds >= level:
            return found
    score = search.score(named, search.problem.settled(())) if named.parts else 0.0
    return alone if alone is not None and alone.odds - max(score, 0.0) >= level else None


def stays_beside(
    search: Search, named: Sequence[Candidate], effects: Collection[str] | None
) -> bool:
    """Whether something surely changes beside what was named without what was logged meanwhile."""
    parts = tuple(search.extend(named))
    found = find_change(search, parts, search.problem.settled(parts), _changing(effects))
    return found is not None and found.odds >= search.problem.setting.rules.odds


def _changing(effects: Collection[str] | None) -> list[str]:
    return [f for f in CHANGING if effects is None or f in effects]


def without_outliers(setting: Setting, outliers: Outliers) -> Setting:
    """Return a setting in which outlying stretches are no data, as where a joint stands."""
    samples = list(setting.samples)
    for k in np.unique(outliers.log):
        s, own = samples[k], outliers.log == k
        t, at = s.motion.t, s.output_times()
        gone = np.zeros(s.tau.shape, bool) if s.dwells is None else s.dwells.copy()
        beside = at[1] - at[0]
        for a, b in zip(outliers.first[own], outliers.last[own], strict=True):
            gone[(t >= at[a] - beside) & (t <= at[b - 1] + beside)] = True
        samples[k] = replace(s, dwells=gone, echoes=())
    return replace(setting, samples=tuple(samples))


def leave_out(setting: Setting, change: Change) -> Setting | None:
    """Return a setting without what was logged while a change lasted; None if too little is left.

    So is when it may have lasted.
    """
    samples, s = list(setting.samples), setting.samples[change.number]
    t = s.motion.t
    low, high = change.began[0], change.ended[1]
    rest = np.flatnonzero((t < low) | (t > high))
    kept = s.take(rest) if len(rest) else None
    if kept is None or kept.outputs < LOG_RULES.fewest:
        samples.pop(change.number)
    else:
        samples[change.number] = replace(kept, notes=(*s.notes, f"{change.when}: left out"))
    if not samples:
        return None
    return replace(setting, samples=tuple(samples), changes=(*setting.changes, change))
