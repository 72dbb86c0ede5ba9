"""What changed while a log was recorded: a mass that was gripped, a brake that dragged for seconds.

No effect of the robot says it, and no unseen motion can judge it: the fitted motion alone has the
instant. So it is a difference between parts of time (`Differences`), whose pattern is all stretches
of one log, of a grid; of three or more logs it may last as long as a log. What was logged while a
change lasted is of another robot, and is left out of all that follows.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp, softmax

from identifiability.estimation.differences import (
    Change,
    Differences,
    Known,
    LogRows,
    find_changes,
    find_further,
)
from identifiability.estimation.estimate import Outliers
from identifiability.estimation.mixed_model import Term
from identifiability.estimation.noise import ARNoise
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.workflows.diagnose.naming import Naming
from identifiability.workflows.diagnose.problem import Rows, Setting

#: What may begin and end while a robot is logged: a load, a brake or dirt, a counterweight.
CHANGING = ("payload", "coulomb_friction", "viscous_friction", "torque_offset")
#: Instants at most at which something may change.
INSTANTS = 40
#: Rounds in which noise is that without what is likeliest.
ROUNDS = 2
#: Shortest part of time [s], and time constants of drifts in shares of all the time.
SHORTEST: Tolerance = 0.5
DECAYS: tuple[Tolerance, ...] = (1 / 3, 1 / 10)
#: Share of what is explained that makes a part a burst.
BURST: Tolerance = 0.8
#: Logs of which one may be another robot's as a whole.
FEWEST = 3


@frozen
class Stretches:
    """Parts of time of logs, and how a change may go along them.

    Attributes
    ----------
    part : (N,) int
        Which of P parts a row is of.
    begins : (P + 1,) int
        Rows at which they begin; the last one ends there.
    log : (P,) int
        Which log a part is of.
    patterns : tuple of (w, P)
        Drifts; then of each log the stretches that last to its end, and those that do not.
    """

    part: np.ndarray
    begins: np.ndarray
    log: np.ndarray
    patterns: tuple[Array, ...]

    @staticmethod
    def of(rows: Rows) -> Stretches:
        """Return those of the rows of logs.

        Of one log alone what ended in it says as much as what began then; what is shorter than two
        parts is a burst. Of most of what was logged nobody knows which part is odd.
        """
        begins, log = [0], list[int]()
        for n in np.unique(rows.log):
            own = np.flatnonzero(rows.log == n)
            t = rows.t[own]
            some = max(min(INSTANTS, len(own) // 2, int((t[-1] - t[0]) / SHORTEST)), 1)
            cuts = np.unique(np.searchsorted(t, np.linspace(t[0], t[-1], some + 1)[:-1]))
            begins += [*(own[0] + cuts[1:]).tolist(), int(own[-1]) + 1]
            log += [int(n)] * len(cuts)
        every, each = np.arange(len(log)), np.array(log)
        part = np.repeat(every, np.diff(begins))
        patterns = [_drifts(rows, np.array(begins), each)]
        for n in np.unique(each):
            start, some = int(np.argmax(each == n)), int((each == n).sum())
            first, last = start + np.array(np.triu_indices(some + 1, 2))
            may = ((first > start) | (some < len(each))) & (last - first <= len(each) // 2)
            inside = (every >= first[:, None]) & (every < last[:, None])
            on = last == start + some
            patterns += [inside[own].astype(float) for own in (may & on, may & ~on) if own.any()]
        return Stretches(part, np.array(begins), each, tuple(patterns))


def _drifts(rows: Rows, begins: np.ndarray, log: np.ndarray) -> Array:
    """Return how a drift may go, in each part (d, P): in one log, or in the session."""
    t, starts = rows.t[begins[:-1]], [s.motion.start for s in rows.samples]
    lasting = np.array([np.ptp(s.output_times()) for s in rows.samples])
    begun = np.cumsum(lasting) - lasting
    if None not in starts:
        begun = np.array([float(x or 0.0) for x in starts])
    out = []
    for clock in (*(np.where(log == n, t, np.nan) for n in np.unique(log)), t + begun[log]):
        x = (clock - np.nanmin(clock)) / max(float(np.ptp(clock[np.isfinite(clock)])), 1e-9)
        for course in (1.0 - x, np.exp(-x / DECAYS[0]), np.exp(-x / DECAYS[1])):
            out += [np.nan_to_num(course), np.nan_to_num(1.0 - course)]
    return np.array(out)


def find_change(naming: Naming, effects: Collection[str] | None = None) -> Change | None:
    """Return the likeliest change in the middle of a log beside what was named, if it is sure.

    No unseen motion can take it out: it needs what both thresholds ask together, and nothing that
    stays for good, and no drift, may be a rival. Of two logs nobody knows which is odd.

    Parameters
    ----------
    naming : Naming
    effects : collection of str, optional
        Families that may be named; all by default.
    """
    families = [f for f in CHANGING if effects is None or f in effects]
    if not families or not len(naming.fitted):
        return None
    stretches = Stretches.of(naming.fitted)
    found = _differences(naming, families, stretches)
    if len(stretches.patterns) < 2 or not found.said:
        return None
    every = found.model.gains()
    best = _best(found, every)
    for _ in range(ROUNDS):  # what it adds is no noise: once it is roughly known, that is without
        found = replace(found, noise=_noise_without(naming, found, best))
        every, before = found.model.gains(), best
        best = _best(found, every)
        if (best.key, best.member) == (before.key, before.member):
            break
    likely: dict[tuple[str, str], float] = {}
    for t in every:
        (cause,), pattern = found.said[t.key][1]
        what = (found.rows.causes[cause].family, t.group.place)
        if pattern:
            likely[what] = float(np.logaddexp(likely.get(what, -np.inf), t.odds))
    (cause,), pattern = found.said[best.key][1]
    at, own = (found.rows.causes[cause].family, best.group.place), found.patterns[pattern]
    excess, burst = _scatter(found, best)
    drift = max(t.odds for t in every if not found.said[t.key][1][1]) / excess
    lasting = max([drift, *(t.odds for t in naming.before[:1])])
    needed = max(ESTIMATION_RULES.name + ESTIMATION_RULES.keep, lasting)
    way, members = best.member, [replace(best.group, members=(m,)) for m in best.group.members]
    log, on = int(stretches.log[np.argmax(own[way])]), own > 0
    first, last = on.argmax(1), on.shape[1] - on[:, ::-1].argmax(1)
    start, stop = (f(np.flatnonzero(stretches.log == log)) for f in (np.min, np.max))
    begins, ends = first[way] == start, last[way] == stop + 1
    if likely[at] / excess < needed + ESTIMATION_RULES.rival or burst:
        return None
    if begins and ends and len(np.unique(stretches.log)) < FEWEST:
        return None
    rivals = [k for k, odds in likely.items() if odds > likely[at] - ESTIMATION_RULES.rival]
    rows = [*stretches.begins[start : stop + 1].tolist(), int(stretches.begins[stop + 1]) - 1]
    time = naming.fitted.t[rows]
    singles = {id(t.group.members[0]): t.odds for t in found.model.gains((), members)}
    odds = np.array([singles[id(g.members[0])] for g in members])
    began, ended = (_ends(x - start, odds, time) for x in (first, last))
    titles = {(c.family, c.place): c.title for c in found.rows.causes}
    names = [naming.setting.samples[n].name for n in stretches.log]
    (change,) = find_changes(found, (best,), names, {})
    return replace(
        change,
        log=names[start],
        odds=likely[at],
        others=tuple(f"{titles[r]} of {r[1]}" for r in rivals if r != at),
        rivals=tuple(r for r in rivals if r != at),
        start=-np.inf if begins else float(time[first[way] - start]),
        stop=np.inf if ends else float(time[last[way] - start]),
        began=(-np.inf, -np.inf) if begins else began,
        ended=(np.inf, np.inf) if ends else ended,
        weight=float(softmax([likely[at], *(x for k, x in likely.items() if k != at)])[0]),
    )


def _differences(naming: Naming, families: Collection[str], stretches: Stretches) -> Differences:
    """Return what may differ between parts of time, beside the model and friction at reversals."""
    seen, missing = naming.fitted.seen, naming.missing
    fixed = naming.model.fixed - missing.fixed
    always = np.zeros((*seen.y.shape, fixed))
    for (j, k), x in missing.entries.items():
        if k < fixed:
            always[:, j, k] = x
    prior = naming.model.prior
    X = np.concatenate([seen.X, always], axis=2)
    precision = np.diag(prior) if prior.size else np.zeros(X.shape[2])
    robot = naming.setting.structure.robot
    return Differences(
        rows=LogRows.along(seen, X, stretches.part, find_further(robot, seen, families)),
        known=Known(base=np.zeros(X.shape[2]), directions=np.eye(X.shape[2]), precision=precision),
        patterns=stretches.patterns,
        noise=missing.noise,
    )


def _best(found: Differences, every: list[Term]) -> Term:
    return next(t for t in every if found.said[t.key][1][1])


def _noise_without(naming: Naming, found: Differences, best: Term) -> ARNoise:
    """Return the noise that there is where a change is not."""
    (cause,), pattern = found.said[best.key][1]
    on = found.patterns[pattern][best.member][found.rows.log] > 0
    a, b = int(on.argmax()), len(on) - int(on[::-1].argmax())
    asked, joints = naming.asked, list(naming.missing.noise)
    for j in found.rows.causes[cause].torque:
        cuts = [
            (int(c), int(d))
            for s, e in asked.seen.runs.each[j]
            for c, d in ((s, min(e, a)), (max(s, b), e))
        ]
        joints[j] = asked.joint_noise(j, tuple(cut for cut in cuts if cut[0] < cut[1]))
    return tuple(joints)


def _scatter(found: Differences, best: Term) -> tuple[float, bool]:
    """Return how much more scores scatter elsewhere than noise lets them, and if it is a burst.

    A burst is mostly in one part of the time.
    """
    model = found.model
    products, (_, value, _) = model.products, model.values((best,))
    own, held = (products.column[x] for x in (best.columns, np.arange(model.fixed)))
    on, more = products.weights[products.pattern[best.columns[0]]] > 0, value[model.fixed :]
    scores = products.values[:, own, -1]
    scores = scores - products.values[:, own][:, :, held] @ value[: model.fixed]
    squares = products.values[:, own][:, :, own]
    gain = scores[on] @ more - 0.5 * (squares[on] @ more) @ more
    inner, z = np.linalg.pinv(squares[~on], rcond=1e-9, hermitian=True), scores[~on]
    excess = np.einsum("sk,skl,sl->s", z, inner, z).mean() / len(own) if len(z) else 1.0
    return max(float(excess), 1.0), bool(gain.max() > BURST * gain.sum())


def _ends(at: np.ndarray, odds: Array, time: Array) -> tuple[float, float]:
    """Return between which instants 95 % of what is likely lies, a part more on each side."""
    share = np.cumsum(np.bincount(at, np.exp(odds - logsumexp(odds)), len(time)))
    low, high = np.searchsorted(share, [0.025, 0.975]).tolist()
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
    samples = list(setting.samples)
    at = [s.name for s in samples].index(change.log)
    s, t = samples[at], samples[at].motion.t
    rest = np.flatnonzero((t < change.began[0]) | (t > change.ended[1]))
    kept = s.take(rest) if len(rest) else None
    if kept is None or kept.outputs < LOG_RULES.fewest:
        samples.pop(at)
    else:
        samples[at] = replace(kept, notes=(*s.notes, f"{change.when}: left out"))
    if not samples:
        return None
    return replace(setting, samples=tuple(samples), changes=(*setting.changes, change))
