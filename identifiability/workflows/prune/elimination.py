"""The path down: from every column to few, one physically meaningful move at a time.

The cheapest move goes first; of the path the smallest model as good as the best is used.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import field, replace

import numpy as np
from scipy.special import fdtrc

from identifiability.estimation.estimate import Method, estimate
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.evidence import Score, may_stand
from identifiability.estimation.least_squares import dependence
from identifiability.estimation.refits import UpdatedRefits
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.estimation.rules import Thresholds
from identifiability.foundation.errors import listing
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.workflows.prune.folds import (
    SATISFIED,
    FoldFits,
    WhitenedRegression,
    whiten_regression,
)
from identifiability.workflows.prune.moves import ZERO, Kind, Move, Partition

# Which move is the cheapest, and the order in which all that is left goes.
#
# Only the fit to everything says what is cheapest. So the order is found with that fit alone, and
# those without each fold follow for all models at once (`UpdatedRefits.along`): they are nested.


@frozen
class Descent:
    """A move down, with what the fit to everything says of it.

    Attributes
    ----------
    move : Move
    cost : float
        Rise of the estimator's loss.
    either : str
        The parameter that a dropped one can hardly be told from.
    after : Partition
    fixed : (r, k)
        All constraints ``fixed y = 0`` after it.
    """

    move: Move
    cost: float
    either: str
    after: Partition
    fixed: Array


def descend(
    fit: FoldFits, pairs: Sequence[Move], kept: Collection[str], *, explained: bool = True
) -> Iterator[Descent]:
    """Yield the cheapest moves until nothing is left that may go.

    Parameters
    ----------
    fit : FoldFits
        Whose refits are updates.
    pairs : sequence of Move
        Merges of Coulomb levels; such columns are dropped in pairs only.
    kept : collection of str
        Columns that must not be dropped.
    explained : bool
        Whether costs and what can hardly be told apart are wanted.
    """
    fit, X = fit.alone, fit.whitened.inverse
    square, spread = (X**2).sum(1), measure_spread(fit)
    while True:
        free = spread > SATISFIED * square
        drops = np.where(free, fit.values[0] ** 2 / np.where(free, spread, 1.0), 0.0)
        move = find_cheapest(fit, pairs, kept, drops)
        if move is None:
            return
        after = fit.after(move)
        before, then = (f.refits for f in (fit, after))
        assert isinstance(before, UpdatedRefits)
        assert isinstance(then, UpdatedRefits)
        said = (fit.cost(move), find_either(fit, move, spread)) if explained else (np.nan, "")
        yield Descent(move, *said, after.partition, then.fixed)
        if then.solved == before.solved:
            new = then.fixed[len(before.fixed) :]
            gone = before.C @ new.T
            of_x = X @ gone
            spread = spread - ((of_x @ np.linalg.inv(new @ gone)) * of_x).sum(1)
        else:
            spread = measure_spread(after)
        fit = after


def measure_spread(fit: FoldFits) -> Array:
    """Return the inverse information of each column's value, (k,)."""
    X = fit.whitened.inverse
    spread: Array = ((X @ fit.refits.C) * X).sum(1)
    return spread


def find_cheapest(
    fit: FoldFits, pairs: Sequence[Move], kept: Collection[str], drops: Array | None = None
) -> Move | None:
    """Return the move whose loss raises the sum of squares least per parameter.

    Parameters
    ----------
    fit, pairs, kept
        As in `descend`.
    drops : (k,), optional
        What dropping each group by itself costs, at its leader; the fit is asked without.
    """
    p = fit.partition
    paired: set[int] = set()
    moves = []
    for pair in pairs:
        leaders = p.alive(pair.columns)
        if len(leaders) == 2:
            paired.update(leaders)
            moves.append(pair)
            moves.append(Move(Kind.DROP, tuple(p.columns[g] for g in leaders)))
    bound = set(p.alive(kept))
    moves = [m for m in moves if not set(m.zero).intersection(kept)]
    singles = [g for g in p.leaders if g not in paired and g not in bound]
    if drops is None:
        own = fit.costs([Move(Kind.DROP, p.members(g)) for g in singles])
    else:
        own = drops[singles]
    costs = np.concatenate([own, fit.costs(moves)])
    if not len(costs):
        return None
    best = int(np.argmin(costs))
    if best < len(singles):
        return Move(Kind.DROP, p.members(singles[best]))
    return moves[best - len(singles)]


def find_either(fit: FoldFits, move: Move, spread: Array | None = None) -> str:
    """Return the parameter that a dropped one can hardly be told from.

    Parameters
    ----------
    fit : FoldFits
    move : Move
    spread : (k,), optional
        As `measure_spread` has it.
    """
    if move.kind is not Kind.DROP:
        return ""
    partition = fit.partition
    gone = partition.alive(move.zero)
    others = [g for g in partition.leaders if g not in gone]
    if len(gone) != 1 or not others:
        return ""
    X = fit.whitened.inverse
    square = measure_spread(fit) if spread is None else spread
    size = np.sqrt(np.maximum(square, 1e-300))
    rho = np.abs(X[others] @ (fit.refits.C @ X[gone[0]])) / (size[gone[0]] * size[others])
    best = int(np.argmax(rho))
    # Estimates correlated beyond this are one quantity to these logs: "either".
    return partition.columns[others[best]] if rho[best] > 0.95 else ""


# The path down: from every column to few, one physically meaningful move at a time.
#
# 1. What this motion never excites, or excites only together with something else, goes first.
# 2. Moves that knowledge of the robot suggests, in the order merge, zero, tie: each is made unless
#    the data contradict it (the predictive log density falls by more than its standard error, and
#    the difference that it denies is significant) or it surely makes the model less feasible.
# 3. Then the group whose loss raises the sum of squares least, until nothing is left. A joint's two
#    Coulomb levels are merged or dropped together, never torn apart.
#
# The path ends where nothing is left; which model of it to use is `selection`'s to say.


@frozen
class Plan:
    """What may be done.

    Attributes
    ----------
    suggested : tuple of Move
        Made unless the data contradict them.
    pairs : tuple of Move
        Merges of Coulomb levels; such columns are dropped in pairs only.
    forced : tuple of Move
        Made first, whatever the data say.
    kept : frozenset of str
        Columns that must not be dropped.
    """

    suggested: tuple[Move, ...] = ()
    pairs: tuple[Move, ...] = ()
    forced: tuple[Move, ...] = ()
    kept: frozenset[str] = field(default_factory=frozenset)


@frozen
class MoveTest:
    """What the data say of a move.

    Attributes
    ----------
    cost : float
        Rise of the weighted sum of squares, relative to that of the full model.
    p_value : float
        Of what the move denies being zero, by the scatter between folds.
    sigma_percent : float
        Standard deviation of what the move denies, by the same scatter, relative to its value [%].
    gain, gain_se : float
        Of the predictive log density of stretches that the fits have not seen [nats].
    either : str
        The parameter that these logs can hardly tell it from.
    """

    cost: float
    p_value: float
    sigma_percent: float
    gain: float
    gain_se: float
    either: str = ""

    def say_gain(self, mood: str = "") -> str:
        """Return what becomes of the predictive density, in words."""
        change = "rise" if self.gain > 0 else "fall"
        change = change if mood else f"{change}s"
        size = f"{abs(self.gain):.3g} ± {self.gain_se:.2g} nats"
        return f"the predictive log density of unseen stretches {mood}{change} by {size}"


@frozen
class Step:
    """A model on the path.

    Attributes
    ----------
    partition : Partition
    score : Score
        What it predicts of each fold, fitted to the rest.
    violations : int
        Free parameters with a sign that physics forbids.
    values : (F + 1, k)
        Parameters fitted to everything, then to the rest of each fold.
    move : Move or None
        What led here; None for the start.
    evidence : MoveTest or None
    """

    partition: Partition
    score: Score
    violations: int
    values: Array
    move: Move | None = None
    evidence: MoveTest | None = None

    @property
    def density(self) -> float:
        """Predictive log density of all folds [nats]."""
        return float(self.score.density.sum())

    @staticmethod
    def of(fit: FoldFits, move: Move | None = None, evidence: MoveTest | None = None) -> Step:
        """Return the step to the model of some fits."""
        return Step(fit.partition, fit.score, fit.violations(), fit.values, move, evidence)


def explain(step: Step) -> str:
    """Return why a move was made."""
    move, evidence = step.move, step.evidence
    if move is None or evidence is None:
        return f"{move.why}." if move is not None else "Every base parameter of the model."
    change = evidence.say_gain()
    if move.kind is Kind.FORCED:
        return f"{move.why}; {change}."
    if move.kind is Kind.DROP:
        text = (
            "Not significant"
            if evidence.p_value > Thresholds.sign_level
            else "The least costly of what is left"
        ) + f" (p = {evidence.p_value:.2g}); {change}."
        if evidence.either:
            text += (
                f" These logs hardly tell it from {evidence.either}: either of the two can stand "
                "for both."
            )
        return text
    if evidence.p_value > Thresholds.sign_level:
        verdict = "the data do not contradict it"
    elif evidence.gain >= -evidence.gain_se:
        verdict = "the difference is significant but does not help on unseen motion"
    else:
        verdict = "the data speak against it, but not clearly enough to refuse it"
    return f"{move.why}; {verdict} (p = {evidence.p_value:.2g}); {change}."


@frozen
class Refusal:
    """A suggested move that was not made."""

    move: Move
    evidence: MoveTest
    reason: str


@frozen
class Path:
    """The steps, most parameters first, and what was refused on the way."""

    steps: tuple[Step, ...]
    refused: tuple[Refusal, ...] = ()


def walk(fit: FoldFits, plan: Plan, *, explained: bool = True) -> Path:
    """Return the path from a fit down.

    Parameters
    ----------
    fit : FoldFits
        Of all columns.
    plan : Plan
    explained : bool
        Whether each step says what the data say of it, and what was refused; who walks again on
        resampled logs asks for the models alone, which takes half as long.
    """
    walker = _Walker(fit, plan, explained=explained)
    for move in plan.forced:
        walker.make(move)
    for kind in (Kind.OFFSET, Kind.MERGE, Kind.ZERO, Kind.TIE):
        walker.suggest([m for m in plan.suggested if m.kind is kind])
    walker.descend()
    return Path(walker.path(), tuple(walker.refused))


class _Walker:
    """The state of a walk; it lives as long as `walk`."""

    def __init__(self, fit: FoldFits, plan: Plan, *, explained: bool) -> None:
        self.start = self.fit = fit
        self.plan = plan
        #: Fits of an estimator that has its own refits are scored one by one in any case.
        self.explained = explained or not isinstance(fit.refits, UpdatedRefits)
        self.base = max(fit.whitened.scale**2, 1e-300)
        self.steps = [Step.of(fit)] if self.explained else []
        #: Moves, and the models and constraints after them, of steps that say nothing.
        self.made: list[tuple[Move | None, Partition, Array]] = []
        if isinstance(fit.refits, UpdatedRefits):
            self.made.append((None, fit.partition, fit.refits.fixed))
        self.refused: list[Refusal] = []

    def path(self) -> tuple[Step, ...]:
        """Return the steps; those that say nothing are scored here, all at once."""
        if self.explained:
            return tuple(self.steps)
        moves, partitions, fixed = zip(*self.made, strict=True)
        fits = self.start.along(fixed[-1], list(zip(partitions, map(len, fixed), strict=True)))
        return tuple(Step.of(fit, move) for fit, move in zip(fits, moves, strict=True))

    def make(self, move: Move) -> None:
        """Make a move, if there is anything left for it to do."""
        if len(self.fit.rows(move)):
            self._step(self.fit.after(move), move)

    def _step(self, after: FoldFits, move: Move) -> None:
        if self.explained:
            self.steps.append(Step.of(after, move, self._evidence(move, after)))
        elif isinstance(after.refits, UpdatedRefits):
            self.made.append((move, after.partition, after.refits.fixed))
        self.fit = after

    def suggest(self, moves: Sequence[Move]) -> None:
        """Make those moves that the data do not contradict, cheapest first."""
        left = list(moves)
        while left := [m for m in left if len(self.fit.rows(m))]:
            self._try(left.pop(int(np.argmin(self.fit.costs(left)))))

    def _try(self, move: Move) -> None:
        after, contradicted, forbidden = self.fit.after(move), False, False
        if self._significance(move)[0] < ESTIMATION_RULES.unasked_level:
            gain = after.score.gain(self.fit.score)
            contradicted = gain.value < -gain.se
            forbidden = after.violations() > self.fit.violations()
        if not (contradicted or forbidden):
            self._step(after, move)
        elif self.explained:
            evidence = self._evidence(move, after)
            reason = "It would give another parameter a sign that physics forbids."
            if contradicted:
                reason = (
                    f"The data contradict it: {evidence.say_gain('would ')}, and what it denies is "
                    f"significant (p = {evidence.p_value:.2g})."
                )
            self.refused.append(Refusal(move, evidence, reason))

    def descend(self) -> None:
        """Make the cheapest moves until nothing is left that may go."""
        plan, fit = self.plan, self.fit
        if not isinstance(fit.refits, UpdatedRefits):
            while (move := find_cheapest(self.fit, plan.pairs, plan.kept)) is not None:
                self.make(move)
            return
        made = list(descend(fit, plan.pairs, plan.kept, explained=self.explained))
        if not self.explained:
            self.made += [(d.move, d.after, d.fixed) for d in made]
            return
        fixed = made[-1].fixed if made else fit.refits.fixed
        for d, after in zip(
            made, fit.along(fixed, [(d.after, len(d.fixed)) for d in made]), strict=True
        ):
            evidence = self._weigh(d.move, after, d.cost, d.either)
            self.steps.append(Step.of(after, d.move, evidence))
            self.fit = after

    def _evidence(self, move: Move, after: FoldFits) -> MoveTest:
        fit = self.fit
        return self._weigh(move, after, fit.cost(move), find_either(fit, move))

    def _weigh(self, move: Move, after: FoldFits, cost: float, either: str) -> MoveTest:
        gain, (p_value, percent) = after.score.gain(self.fit.score), self._significance(move)
        return MoveTest(
            cost=cost / self.base,
            p_value=p_value,
            sigma_percent=percent,
            gain=gain.value,
            gain_se=gain.se,
            either=either,
        )

    def _significance(self, move: Move) -> tuple[float, float]:
        return _significance(*self.fit.jackknife(move), self.fit.whitened.folds.count)


def _significance(denied: Array, covariance: Array, folds: int) -> tuple[float, float]:
    """Return the p-value of what a move denies being zero by Hotelling's T², and its σ%.

    Parameters
    ----------
    denied : (r,)
    covariance : (r, r)
        By the jackknife over the folds.
    folds : int
    """
    F, r = folds, len(denied)
    single = float(np.mean(denied**2 / np.maximum(np.diag(covariance), 1e-300)))
    percent = 100.0 / np.sqrt(max(single, 1e-300))
    if r + 1 >= F:  # too few folds for their covariance: the mean of the single tests
        return float(fdtrc(1, max(F - 1, 1), single)), percent
    t2 = float(denied @ np.linalg.pinv(covariance, hermitian=True) @ denied)
    return float(fdtrc(r, F - r, t2 * (F - r) / (r * (F - 1)))), percent


# The path of a regression, and which model of it to use: the smallest as good as the best.


@frozen
class Search:
    """A path and what it was walked with.

    Attributes
    ----------
    full : Estimate
        Of the starting model.
    whitened : WhitenedRegression
        Of its independent columns.
    plan : Plan
    path : Path
        Its partitions are of all columns of the starting model.
    """

    full: Estimate
    whitened: WhitenedRegression
    plan: Plan
    path: Path

    def embed(self, path: Path) -> Path:
        """Return a path over the independent columns as one over all columns."""
        columns, at = self.full.columns, np.array(self.full.kept, int)
        steps = []
        for step in path.steps:
            inner = step.partition.group
            group = np.full(len(columns), ZERO)
            group[at] = [at[g] if g != ZERO else ZERO for g in inner]
            values = np.zeros((len(step.values), len(columns)))
            values[:, at] = step.values
            steps.append(replace(step, partition=Partition(columns, group), values=values))
        return replace(path, steps=tuple(steps))

    def choose(self) -> int:
        """Return the step to use, physics aside."""
        return choose_step(self.path.steps)


def find_path(
    information: Information,
    nonnegative: np.ndarray,
    *,
    variation: Array | None = None,
    suggested: Sequence[Move] = (),
    forbid: Sequence[str] = (),
    force: Sequence[str] = (),
    method: Method = "wls",
) -> Search:
    """Walk from all columns of a regression down to none.

    Parameters
    ----------
    information : Information
        About the k columns of the starting model.
    nonnegative : (k,) bool
        Whether physics forbids a value below zero.
    variation : (n,), optional [(N·m)² or N²]
        Of the torque of each joint about its mean, as in `whiten_regression`.
    suggested : sequence of Move
        What knowledge of the robot suggests.
    forbid, force : sequence of str
        Columns that must not be dropped, and that are dropped whatever the data say.
    method : str or Estimator
        Its refits are the fits of the path.
    """
    full = estimate(information, method)
    kept = list(full.kept)
    part = information.select(kept)
    own = full if len(kept) == information.size else estimate(part, method)
    whitened = whiten_regression(part, own, np.asarray(nonnegative)[kept], variation)
    plan = _plan(suggested, forbid, force, part.columns)
    walked = walk(whitened.fit(), plan)
    search = Search(full, whitened, plan, walked)
    return replace(search, path=_with_idle(search, walked, information))


def _plan(
    suggested: Sequence[Move], forbid: Sequence[str], force: Sequence[str], columns: Sequence[str]
) -> Plan:
    """Return the plan over the columns that the motion excites."""
    known = set(columns)
    usable = []
    for move in suggested:
        zero = tuple(c for c in move.zero if c in known and c not in forbid)
        tie = tuple(t for s in move.tie if len(t := tuple(c for c in s if c in known)) > 1)
        if zero or tie:
            usable.append(replace(move, zero=zero, tie=tie))
    pairs = tuple(m for m in usable if m.kind is Kind.MERGE)
    forced = tuple(Move(Kind.FORCED, (c,), why="You asked for it") for c in force if c in known)
    return Plan(tuple(usable), pairs, forced, frozenset(forbid))


def _with_idle(search: Search, walked: Path, information: Information) -> Path:
    """Return the path over all columns, what the motion does not excite being its first move."""
    path, full = search.embed(walked), search.full
    idle = [c for k, c in enumerate(full.columns) if k not in set(full.kept)]
    if not idle:
        return path
    move = Move(Kind.UNEXCITED, tuple(idle), why=_why_idle(information, full, idle))
    whole = replace(path.steps[0], partition=Partition.of(full.columns))
    return replace(path, steps=(whole, replace(path.steps[0], move=move), *path.steps[1:]))


def _why_idle(information: Information, full: Estimate, idle: Sequence[str]) -> str:
    """Return what each idle column cannot be told from."""
    leans = np.abs(dependence(information, full.kept, full.weights))
    alone, either = [], []
    for k, name in enumerate(idle):
        partners = [full.kept[i] for i in np.argsort(-leans[:, k]) if leans[i, k] > NEARLY]
        if not partners:
            alone.append(name)
        elif len(partners) == 1:
            other = information.columns[partners[0]]
            either.append(f"either {other} or {name} can stand for both")
        else:
            others = listing([information.columns[p] for p in partners], 3)
            either.append(f"{name} acts only together with {others}")
    parts = [f"the motion never makes {listing(alone, 4)} act"] if alone else []
    text = "; ".join([*parts, *either[:3]])
    if len(either) > 3:
        text += f"; and {len(either) - 3} more act only together with others"
    return text[:1].upper() + text[1:]


def best_step(steps: Sequence[Step]) -> int:
    """Return the step with the best predictive log density of those that may be used."""
    first = first_allowed(steps)
    return first + int(np.argmax([s.density for s in steps[first:]]))


def first_allowed(steps: Sequence[Step]) -> int:
    """Return the first step after what must go: what the motion or the user leaves out."""
    must = (Kind.UNEXCITED, Kind.FORCED)
    return max((k for k, s in enumerate(steps) if s.move and s.move.kind in must), default=0)


def good_steps(steps: Sequence[Step]) -> Iterator[int]:
    """Yield the steps that may be used, the preferred one first.

    Preferred is the smallest of those with the fewest forbidden signs; the others follow for the
    case that no real robot can have its values.
    """
    best, allowed = best_step(steps), range(first_allowed(steps), len(steps))
    for k in sorted(allowed, key=lambda k: (steps[k].violations, len(steps[k].partition))):
        if may_stand(steps[k].score, steps[best].score):
            yield k


def choose_step(steps: Sequence[Step]) -> int:
    """Return the step to use, the physical certificate aside."""
    return next(good_steps(steps))
