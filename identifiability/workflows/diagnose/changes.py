"""What changed while a log was recorded: a mass that was gripped, a brake that dragged for seconds.

No effect of the robot says it, and no unseen motion can judge it: the fitted motion alone has the
instant. So it is a group of the mixed model times the time between two instants of one log, of a
grid, priced by all instants, logs and places where it might have been. Of three or more logs it
may last as long as a log. What was logged while a change lasted is of another robot, and is left
out of all that follows.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.special import logsumexp, softmax

from identifiability.effects import find_families, title_of
from identifiability.effects.effect import Placed
from identifiability.estimation.estimate import Outliers
from identifiability.estimation.groups import Missing
from identifiability.estimation.mixed_model import SIZES, rise_of
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.foundation.answers import Cell, Column, Table
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.foundation.rounding import digits, join
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.regression.columns import Candidate, is_body, list_candidates, number
from identifiability.workflows.diagnose.findings import call
from identifiability.workflows.diagnose.naming import Naming
from identifiability.workflows.diagnose.problem import Rows, Setting

#: What may begin and end while a robot is logged: a load, a brake or dirt, a counterweight.
CHANGING = ("payload", "coulomb_friction", "viscous_friction", "torque_offset")
#: Weight above which none is said.
MOST: Tolerance = 0.99
#: Instants at most at which something may change.
INSTANTS = 40
#: Rounds in which noise is that without what is likeliest.
ROUNDS = 2
#: Shortest block of time [s], and time constants of drifts in shares of all the time.
SHORTEST: Tolerance = 0.5
DECAYS: tuple[Tolerance, ...] = (1 / 3, 1 / 10)
#: Share of what is explained that makes a block a burst.
BURST: Tolerance = 0.8
#: Logs of which one may be another robot's as a whole.
FEWEST = 3
#: Kinds of a load that is small and held somewhere: its mass with the first moments.
LOAD = 4


def weight_text(weight: float) -> str:
    """Return a weight in words: none is said nearer to one than noise and priors are known."""
    return f"> {MOST}" if weight > MOST else f"{weight:.2f}"


@frozen
class Change:
    """What changed in the middle of a log.

    Attributes
    ----------
    log : str
    number : int
        Which of the fitted logs.
    start, stop : float [s]
        When it began and ended; infinite where that was not logged.
    began, ended : (float, float) [s]
        Where these instants are in 95 % of what is likely.
    family, title, place : str
        What it was.
    parameters, units : tuple of str
    values, errors : (k,)
        Generalised least squares beside the model, with standard errors.
    open : tuple of str
        Parameters that the motion determines together with others only.
    odds : float [nat]
        Log odds for it, all instants, logs and places where it might have been counted.
    weight : float
        Its posterior probability among all that may change then.
    others : tuple of (family, place)
        What it cannot be told from.
    """

    log: str
    number: int
    start: float
    stop: float
    began: tuple[float, float]
    ended: tuple[float, float]
    family: str
    title: str
    place: str
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    errors: Array
    open: tuple[str, ...]
    odds: float
    weight: float
    others: tuple[tuple[str, str], ...] = ()

    @property
    def names(self) -> list[str]:
        """What it was, and what it cannot be told from, in words."""
        return [f"{title_of(f)} in {at}" for f, at in ((self.family, self.place), *self.others)]

    @property
    def statement(self) -> str:
        """When it changed, what, and what became of it."""
        value, error, unit = self.values[0], self.errors[0], self.units[0]
        size = f"{value:.3g} ± {REACH * error:.2g} {unit}".replace("-", "−")
        if self.parameters[0] in self.open:
            size = "of a size that this motion leaves open"
        return (
            f"{self.when[0].upper()}{self.when[1:]} another robot was logged. The difference: "
            f"{call(self.names)} ({size}, weight {weight_text(self.weight)}). What was logged "
            "meanwhile was left out."
        )

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON has it; no instant where it was not logged."""

        def known(*ends: float) -> list[float | None]:
            return [x if np.isfinite(x) else None for x in ends]

        start, stop = known(self.start, self.stop)
        return {
            "log": self.log,
            "effect": self.family,
            "joint": self.place,
            "weight": self.weight,
            "log_odds": self.odds,
            "from": start,
            "to": stop,
            "from95": known(*self.began),
            "to95": known(*self.ended),
            "or": [{"effect": family, "joint": place} for family, place in self.others],
            "parameters": dict(zip(self.parameters, self.values.tolist(), strict=True)),
            "errors": dict(zip(self.parameters, self.errors.tolist(), strict=True)),
            "open": list(self.open),
        }

    @property
    def whole(self) -> bool:
        """Whether it lasted as long as the log."""
        return bool(np.isinf(self.start) and np.isinf(self.stop))

    @property
    def when(self) -> str:
        """In words: ``from 41 s (95 %: 40.5 … 41.5 s) of run2 on``."""
        begin, end = (
            f"{at:.3g} s" + (f" (95 %: {low:.3g} … {high:.3g} s)" if low < high else "")
            for at, (low, high) in ((self.start, self.began), (self.stop, self.ended))
        )
        if self.whole:
            return f"in all of {self.log}"
        if np.isinf(self.stop):
            return f"from {begin} of {self.log} on"
        if np.isinf(self.start):
            return f"until {end} of {self.log}"
        return f"from {begin} to {end} of {self.log}"


CHANGES = (
    Column("when"),
    Column("effect"),
    Column("where"),
    Column("parameter", "code"),
    Column("value", digits(3)),
    Column("± se", digits(2)),
    Column("unit"),
    Column("weight", hint="Posterior probability among all that may change at any instant."),
    Column("or", hint="What this motion cannot tell it from."),
)


def table_changes(changes: Sequence[Change]) -> Table:
    """Return what changed as a table."""
    rows = []
    for c in changes:
        weight = Cell(weight_text(c.weight), c.weight)
        others = join(c.names[1:]) or "nothing"
        values = zip(c.parameters, c.values, c.errors, c.units, strict=True)
        rows += [(c.when, title_of(c.family), c.place, *row, weight, others) for row in values]
    return Table.of("What changed in the middle of a log, and was left out", CHANGES, rows)


@frozen
class Course:
    """How a candidate may have gone along blocks of time.

    Attributes
    ----------
    candidate : Candidate
    odds : (s + d,) [nat]
        Log odds of each stay and each drift.
    best : int
        The likeliest stay.
    values, errors : (k,)
        Of that.
    alone : (k,) bool
        Which values its motion determines by themselves.
    burst : bool
        Whether most of what it explains is in one block.
    """

    candidate: Candidate
    odds: Array
    best: int
    values: Array
    errors: Array
    alone: np.ndarray
    burst: bool


@frozen
class Scan:
    """Candidates that may act in some blocks of a log, or drift, beside a model.

    Attributes
    ----------
    naming : Naming
    missing : Missing
        The model, friction at reversals and the candidates.
    candidates : tuple of Candidate
    edges : (B + 1,) int
        Rows at which blocks begin and end.
    count : (logs,) int
        Blocks of each log.
    first, last, log : (s,) int
        Blocks of all stays, the last one not with it, and which log they are in.
    share : (s + d, B)
        What of a stay, and then of a drift, there is in each block.
    price : (s + d,) [nat]
    """

    naming: Naming
    missing: Missing
    candidates: tuple[Candidate, ...]
    edges: np.ndarray
    count: np.ndarray
    first: np.ndarray
    last: np.ndarray
    log: np.ndarray
    share: Array
    price: Array

    @staticmethod
    def of(naming: Naming, families: Collection[str]) -> Scan:
        """Return what may change beside a model.

        Of one log alone what ended in it says as much as what began then; what is shorter than two
        blocks is a burst. Of most of what was logged nobody knows which part is odd. Stays are
        alike that last to the end of their log, and those that do not.
        """
        setting, seen = naming.setting, naming.fitted.seen
        robot, motions = setting.structure.robot, [x.motion for x in setting.samples]
        listed, _ = list_candidates(robot, find_families(families), (), motions, fixed=True)
        known = naming.missing.candidates
        numbered = number([*known, *map(_held, listed)])
        missing = Missing(tuple(numbered), seen, setting.known.root, naming.missing.noise)
        acts = {k for _, k in missing.entries}
        own = tuple(c for c in numbered[len(known) :] if acts.intersection(c.columns))
        edges, count = _edges(seen.t, seen.log)
        stays, alike = [np.empty((3, 0), int)], [np.empty(0)]
        for n, (some, start) in enumerate(zip(count, np.cumsum(count) - count, strict=True)):
            first, last = np.triu_indices(some + 1, 2)
            may = ((first > 0) | (len(count) > 1)) & (last - first <= count.sum() // 2)
            first, last = first[may], last[may]
            on = last == some
            alike.append(np.log(np.where(on, on.sum(), max(int((~on).sum()), 1))))
            stays.append(np.array([first + start, last + start, np.full(len(on), n)]))
        first, last, log = np.concatenate(stays, axis=1)
        at = np.arange(count.sum())
        inside = (at >= first[:, None]) & (at < last[:, None])
        drifts = _drifts(naming.fitted, edges, count)
        price = np.concatenate([
            np.log(len(count)) + np.concatenate(alike), np.full(len(drifts), np.log(len(drifts)))
        ]) + np.log(2.0 * len(own) * len(SIZES))  # fmt: skip
        share = np.concatenate([inside, drifts])
        return Scan(naming, missing, own, edges, count, first, last, log, share, price)

    def courses(self, missing: Missing) -> list[Course]:
        """Return what each candidate may have done."""
        products = missing.products(edges=self.edges.tolist())
        model, own, stays = missing.model(products), self.candidates, len(self.first)
        s = model.solve()
        at = np.concatenate([c.columns for c in own]) + missing.fixed
        columns = np.concatenate([at, s.columns, [products.size]])
        scale = np.append(model.scale, 1.0)[columns]
        each = np.array([
            products.take(np.array([b])).between(at, columns) / np.outer(scale[: len(at)], scale)
            for b in range(len(products.counts))
        ])  # fmt: skip
        half, out = s.root @ model.target[s.columns], []
        ends = np.cumsum([len(c.columns) for c in own])[:-1]
        for c, k in zip(own, np.split(np.arange(len(at)), ends), strict=True):
            rows, squares = each[:, k], each[:, k][:, :, k]
            part, inside = (
                np.tensordot(self.share, rows, 1),
                np.tensordot(self.share**2, squares, 1),
            )
            along = np.einsum("cd,skd->csk", s.root, part[:, :, len(at) : -1], optimize=True)
            outside = inside - np.einsum("csk,csl->skl", along, along, optimize=True)
            left = part[:, :, -1] - np.einsum("csk,c->sk", along, half)
            odds = logsumexp(rise_of(inside, outside, left)[0], axis=1)
            best = int(np.argmax((odds - self.price)[:stays]))
            inverse = np.linalg.pinv(outside[best], rcond=1e-9, hermitian=True)
            value, here = inverse @ left[best], self.share[best] > 0
            moved = s.root.T @ (s.root @ (part[best][:, len(at) : -1].T @ value))
            scores = rows[:, :, -1] - rows[:, :, len(at) : -1] @ (s.value - moved)
            # What it explains in each block: a burst is in one of them; and how much more its
            # scores scatter elsewhere than noise lets them.
            gain = scores[here] @ value - 0.5 * (squares[here] @ value) @ value
            inner, z = np.linalg.pinv(squares[~here], rcond=1e-9, hermitian=True), scores[~here]
            excess = np.einsum("sk,skl,sl->s", z, inner, z).mean() / len(k) if len(z) else 1.0
            odds[:stays] /= max(float(excess), 1.0)
            unit = model.scale[at[k]]
            error = np.sqrt(np.maximum(np.diag(inverse), 0.0)) / unit
            alone, burst = determined_alone(outside[best]), gain.max() > BURST * gain.sum()
            out.append(Course(c, odds - self.price, best, value / unit, error, alone, bool(burst)))
        return out

    def without(self, course: Course) -> Missing:
        """Return all beside the noise that there is where the likeliest of a course is not."""
        a, b = self.edges[self.first[course.best]], self.edges[self.last[course.best]]
        asked, joints = self.naming.asked, list(self.naming.missing.noise)
        acts = {j for j, column in self.missing.entries if column in course.candidate.columns}
        for j in acts:
            cuts = (
                (int(c), int(d))
                for s, e in asked.seen.runs.each[j]
                for c, d in ((s, min(e, a)), (max(s, b), e))
            )
            joints[j] = asked.joint_noise(j, tuple(cut for cut in cuts if cut[0] < cut[1]))
        return replace(self.missing, given=tuple(joints))


def find_change(naming: Naming, effects: Collection[str] | None = None) -> Change | None:
    """Return the likeliest change in the middle of a log beside what was named, if it is sure.

    What it adds is no noise: once it is known roughly, noise is that without it.

    Parameters
    ----------
    naming : Naming
    effects : collection of str, optional
        Families that may be named; all by default.
    """
    families = [f for f in CHANGING if effects is None or f in effects]
    if not families or not len(naming.fitted):
        return None
    scan = Scan.of(naming, families)
    if not scan.candidates or not len(scan.first):
        return None
    courses = scan.courses(scan.missing)
    for _ in range(ROUNDS):
        before = _best(courses)
        courses = scan.courses(scan.without(before))
        best = _best(courses)
        if (best.candidate.columns, best.best) == (before.candidate.columns, before.best):
            break
    return _likeliest(scan, courses)


def _best(courses: Sequence[Course]) -> Course:
    return max(courses, key=lambda x: float(x.odds[x.best]))


def _drifts(rows: Rows, edges: np.ndarray, count: np.ndarray) -> Array:
    """Return how a drift may go, in each block (d, B): in one log, or in the session."""
    logs, t = np.repeat(np.arange(len(count)), count), rows.t[edges[:-1]]
    starts = [s.motion.start for s in rows.samples]
    lasting = np.array([np.ptp(s.output_times()) for s in rows.samples])
    begun = np.cumsum(lasting) - lasting
    if None not in starts:
        begun = np.array([float(x or 0.0) for x in starts])
    out = []
    for clock in (*(np.where(logs == n, t, np.nan) for n in range(len(count))), t + begun[logs]):
        x = (clock - np.nanmin(clock)) / max(float(np.ptp(clock[np.isfinite(clock)])), 1e-9)
        for course in (1.0 - x, np.exp(-x / DECAYS[0]), np.exp(-x / DECAYS[1])):
            out += [np.nan_to_num(course), np.nan_to_num(1.0 - course)]
    return np.array(out)


def _held(c: Candidate) -> Candidate:
    """Return a load as what is small and held somewhere: a mass with its first moments."""
    return replace(c, kinds=c.kinds[:LOAD], columns=c.columns[:LOAD]) if is_body(c) else c


def _edges(t: Array, log: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows at which blocks of time begin and end, and how many blocks each log has."""
    edges, count = [0], []
    for n in np.unique(log):
        rows = np.flatnonzero(log == n)
        lasts = float(t[rows[-1]] - t[rows[0]])
        some = max(min(INSTANTS, len(rows) // 2, int(lasts / SHORTEST)), 1)
        cuts = np.linspace(t[rows[0]], t[rows[-1]], some + 1)[1:-1]
        edges += [*(rows[0] + np.searchsorted(t[rows], cuts)).tolist(), int(rows[-1]) + 1]
        count.append(some)
    return np.array(edges), np.array(count)


def _likeliest(scan: Scan, courses: Sequence[Course]) -> Change | None:
    """Return the likeliest stay as a change, where it is sure.

    No unseen motion can take it out: it needs what both thresholds ask together, and nothing that
    stays for good, and no drift, may be a rival. Of two logs nobody knows which is odd.
    """
    naming, count, best = scan.naming, scan.count, _best(courses)
    k, odds, stays = best.best, float(best.odds[best.best]), len(scan.first)
    drift = max(float(x.odds[stays:].max()) for x in courses)
    lasting = max(drift, *(t.odds for t in naming.after)) if naming.after else drift
    log, first, last = int(scan.log[k]), int(scan.first[k]), int(scan.last[k])
    start, stop = int(count[:log].sum()), int(count[: log + 1].sum())
    begins, ends = first == start, last == stop
    needed = max(ESTIMATION_RULES.name + ESTIMATION_RULES.keep, lasting)
    if odds < needed + ESTIMATION_RULES.rival:
        return None
    if best.burst or (begins and ends and len(count) < FEWEST):
        return None
    total = [float(logsumexp(x.odds[:stays])) for x in courses]
    weights = dict[tuple[str, str], float]()
    for x, w in zip(courses, softmax(total).tolist(), strict=True):
        weights[x.candidate.group] = weights.get(x.candidate.group, 0.0) + w
    c, seen = best.candidate, naming.fitted.seen
    near = max(total) - ESTIMATION_RULES.rival
    others = [x.candidate.group for x, w in zip(courses, total, strict=True) if w > near]
    time = np.append(seen.t[scan.edges[start:stop]], seen.t[scan.edges[stop] - 1])
    own = np.flatnonzero(scan.log == log)
    began, ended = (_ends(x[own] - start, best.odds[own], time) for x in (scan.first, scan.last))
    parameters = Placed.part_parameters(naming.setting.structure.robot, c.part)
    return Change(
        log=naming.setting.samples[log].name,
        number=log,
        start=-np.inf if begins else float(time[first - start]),
        stop=np.inf if ends else float(time[last - start]),
        began=(-np.inf, -np.inf) if begins else began,
        ended=(np.inf, np.inf) if ends else ended,
        family=c.family.name,
        title=c.family.title,
        place=c.place,
        parameters=tuple(x.name for x in parameters),
        units=tuple(x.unit for x in parameters),
        values=best.values,
        errors=best.errors,
        open=tuple(x.name for x, one in zip(parameters, best.alone, strict=True) if not one),
        odds=odds,
        weight=weights[c.group],
        others=tuple(g for g in dict.fromkeys(others) if g != c.group),
    )


def _ends(at: np.ndarray, odds: Array, time: Array) -> tuple[float, float]:
    """Return between which instants 95 % of what is likely lies, a block more on each side."""
    share = np.cumsum(np.bincount(at, np.exp(odds - odds.max()), len(time)))
    low, high = np.searchsorted(share / share[-1], [0.025, 0.975]).tolist()
    ends = np.clip([low - 1, high + 1], 0, len(time) - 1)
    return float(time[ends[0]]), float(time[ends[1]])


def without_outliers(setting: Setting, outliers: Outliers) -> Setting:
    """Return a setting in which outlying stretches are no data, as where a joint stands."""
    samples = list(setting.samples)
    for k in np.unique(outliers.log):
        s, own = samples[k], outliers.log == k
        t, at = s.motion.t, s.output_times()
        gone = s.weight <= 0
        beside = at[1] - at[0]
        for a, b in zip(outliers.first[own], outliers.last[own], strict=True):
            gone[(t >= at[a] - beside) & (t <= at[b - 1] + beside)] = True
        samples[k] = replace(s, weight=1.0 - gone)
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


def determined_alone(G: Array) -> np.ndarray:
    """Return which columns (m,) of products beside a model are determined by themselves."""
    size = np.sqrt(np.maximum(np.diag(G), 1e-300))
    unit = G / np.outer(size, size)
    shares = np.diag(np.linalg.pinv(unit, rcond=1e-9, hermitian=True) @ unit)
    alone: np.ndarray = np.abs(shares - 1.0) < NEARLY
    return alone
