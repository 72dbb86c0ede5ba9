"""The path down: from every column to few, one physically meaningful move at a time.

1. What this motion never excites, or excites only together with something else, goes first.
2. Moves that knowledge of the robot suggests, in the order merge, zero, tie: each is made unless
   the judge refuses it: the model after it predicts unseen stretches worse than the one before.
3. Then the group whose loss raises the sum of squares least, until nothing is left. A joint's two
   Coulomb levels are merged or dropped together, never torn apart.

Of the path the smallest model as good as the best is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace
from functools import partial

import numpy as np

from identifiability.estimation.estimate import Method, estimate
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.evidence import LEVELS, Gain, may_stand
from identifiability.foundation.engines.local import Serial
from identifiability.foundation.engines.mapping import Engine, Steps
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.workflows.prune.folds import (
    FoldFits,
    Step,
    WhitenedRegression,
    whiten_regression,
)
from identifiability.workflows.prune.moves import ZERO, Kind, Move, Partition

#: A constraint of which so small a share is left beside those before it holds already.
SATISFIED: Tolerance = 1e-5

# Only the fit to everything says what is cheapest. So the order is found with that fit alone, and
# those without each fold follow for all models at once (`FoldFits.along`): they are nested.


@frozen
class Remaining:
    """What is left to be taken away from the fit to everything.

    Attributes
    ----------
    partition : Partition
    values : (k,)
        Of all columns under the constraints so far.
    X : (k, k)
        ``x = X z`` in coordinates z of unit information, in which only what is free moves.
    size : (k,)
        Length of each row of X without constraints.
    """

    partition: Partition
    values: Array
    X: Array
    size: Array

    @staticmethod
    def of(fit: FoldFits) -> Remaining:
        """Return what all columns are."""
        own, refits = fit.whitened, fit.refits
        values, vectors = np.linalg.eigh(refits.grams[0])
        seen = np.maximum(values, SATISFIED**2 * values.max(initial=0.0))
        X = own.inverse @ (vectors / np.sqrt(seen))
        x = own.inverse @ (own.centre + refits.whole)
        return Remaining(Partition.of(own.columns), x, X, np.linalg.norm(X, axis=1))

    def after(self, move: Move) -> tuple[Remaining, float]:
        """Return what is left after a move, and by how much the estimator's loss rises."""
        partition = self.partition.apply(move)
        rows = self.partition.rows_to(partition)
        rows = rows / (np.abs(rows) @ self.size)[:, None]
        U, s, Vt = np.linalg.svd(rows @ self.X, full_matrices=False)
        free = s > SATISFIED
        off = (U.T @ (rows @ self.values))[free] / s[free]
        along = self.X @ Vt[free].T
        values, X = self.values - along @ off, self.X - along @ Vt[free]
        return replace(self, partition=partition, values=values, X=X), float(off @ off)

    def cost(self, move: Move) -> float:
        """Return the rise of the estimator's loss per parameter that a move takes away."""
        after, rise = self.after(move)
        return rise / max(len(self.partition) - len(after.partition), 1)

    def cheapest(self, plan: Plan) -> Move | None:
        """Return the move whose loss raises the sum of squares least per parameter."""
        p = self.partition
        paired: set[int] = set()
        moves = []
        for pair in plan.pairs:
            leaders = p.alive(pair.columns)
            if len(leaders) == 2:
                paired.update(leaders)
                moves += [pair, Move(Kind.DROP, tuple(p.columns[g] for g in leaders))]
        moves = [m for m in moves if not plan.kept.intersection(m.zero)]
        bound = paired.union(p.alive(plan.kept))
        singles = [g for g in p.leaders if g not in bound]
        spread = np.maximum(np.linalg.norm(self.X[singles], axis=1), SATISFIED * self.size[singles])
        costs = [*(self.values[singles] / spread) ** 2, *map(self.cost, moves)]
        if not costs:
            return None
        best = int(np.argmin(costs))
        dropped = [Move(Kind.DROP, p.members(g)) for g in singles[best : best + 1]]
        return (dropped or moves[best - len(singles) :])[0]


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
class Refusal:
    """A suggested move that was not made, and what it would do to the predictive log density."""

    move: Move
    gain: Gain

    @property
    def reason(self) -> str:
        """Why, in words."""
        return (
            "The predictive log density of unseen stretches would fall by "
            f"{-self.gain.value:.3g} ± {self.gain.se:.2g} nats."
        )


@frozen
class Path:
    """The steps, most parameters first, and what was refused on the way."""

    steps: tuple[Step, ...]
    refused: tuple[Refusal, ...] = ()


def walk(fit: FoldFits, plan: Plan) -> Path:
    """Return the path from a fit of all columns down."""
    left = Remaining.of(fit)
    made: list[tuple[Move | None, Partition]] = [(None, left.partition)]
    refused = []
    for move in plan.forced:
        left = left.after(move)[0]
        made.append((move, left.partition))
    for kind in (Kind.OFFSET, Kind.MERGE, Kind.ZERO, Kind.TIE):
        asked = [move for move in plan.suggested if move.kind is kind]
        while asked := [m for m in asked if len(left.partition.apply(m)) < len(left.partition)]:
            move = asked.pop(int(np.argmin([left.cost(m) for m in asked])))
            after, rise = left.after(move)
            # What costs no more of the fit than models near the best may is not asked of folds.
            if rise > 2.0 * LEVELS.nats * fit.whitened.unit:
                *_, before, then = fit.along([made[0], made[-1], (move, after.partition)])
                if not may_stand(then.score, before.score):
                    refused.append(Refusal(move, then.score.gain(before.score)))
                    continue
            left = after
            made.append((move, left.partition))
    while (cheapest := left.cheapest(plan)) is not None:
        left = left.after(cheapest)[0]
        made.append((cheapest, left.partition))
    return Path(tuple(fit.along(made)), tuple(refused))


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

    def embed(self, step: Step) -> Step:
        """Return a step over the independent columns as one over all columns."""
        columns, at = self.full.columns, np.array(self.full.kept, int)
        group = np.full(len(columns), ZERO)
        inner = step.partition.group
        group[at] = np.where(inner == ZERO, ZERO, at[inner])
        values = np.zeros((len(step.values), len(columns)))
        values[:, at] = step.values
        return replace(step, partition=Partition(columns, group), values=values)

    def choose(self) -> int:
        """Return the step to use, physics aside."""
        return good_steps(self.path.steps)[0]


def find_path(
    information: Information,
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
    whitened = whiten_regression(part, own, variation)
    plan = _plan(suggested, forbid, force, part.columns)
    walked = walk(whitened.fit(), plan)
    search = Search(full, whitened, plan, walked)
    steps = [search.embed(step) for step in walked.steps]
    idle = tuple(steps[0].partition.zeroed())
    if idle:  # what the motion does not excite is the first move
        why = "The motion does not excite it, or only together with what is left"
        whole = replace(steps[0], partition=Partition.of(full.columns))
        steps[:1] = [whole, replace(steps[0], move=Move(Kind.UNEXCITED, idle, why=why))]
    return replace(search, path=replace(walked, steps=tuple(steps)))


def _plan(
    suggested: Sequence[Move], forbid: Sequence[str], force: Sequence[str], columns: Sequence[str]
) -> Plan:
    """Return the plan over the columns that the motion excites."""
    known = set(columns)
    usable = []
    for move in suggested:
        zero = tuple(c for c in move.zero if c in known and c not in forbid)
        tie = tuple(t for s in move.tie if len(t := tuple(c for c in s if c in known)) > 1)
        usable.append(replace(move, zero=zero, tie=tie))
    pairs = tuple(m for m in usable if m.kind is Kind.MERGE and m.tie)
    forced = tuple(Move(Kind.FORCED, (c,), why="You asked for it") for c in force if c in known)
    return Plan(tuple(usable), pairs, forced, frozenset(forbid).intersection(known))


def first_allowed(steps: Sequence[Step]) -> int:
    """Return the first step after what must go: what the motion or the user leaves out."""
    must = (Kind.UNEXCITED, Kind.FORCED)
    return max((k for k, s in enumerate(steps) if s.move and s.move.kind in must), default=0)


def best_step(steps: Sequence[Step]) -> int:
    """Return the step with the best predictive log density of those that may be used."""
    first = first_allowed(steps)
    return first + int(np.argmax([s.density for s in steps[first:]]))


def good_steps(steps: Sequence[Step]) -> list[int]:
    """Return the steps that may stand for the best, the smallest first."""
    best = steps[best_step(steps)].score
    down = range(len(steps) - 1, first_allowed(steps) - 1, -1)
    return [k for k in down if may_stand(steps[k].score, best)]


# How much of a pruned model is the robot, and how much the luck of one log.
#
# The whole path, from the unpruned model to the chosen model, is walked again on resampled blocks
# of time. The selection is part of what is resampled, so the answer speaks of it, not of one fixed
# model.


#: Replicates that one item of an engine walks, some tenths of a second.
BATCH = 10


@frozen
class Stability:
    """What the replicates chose.

    Attributes
    ----------
    columns : tuple of str
        Of the starting model.
    survives : (k,)
        Share of replicates in which a column is not zero.
    sizes : (replicates,) int
        Number of parameters chosen.
    same : float
        Share of replicates that chose exactly the columns that the logs themselves chose.
    """

    columns: tuple[str, ...]
    survives: np.ndarray
    sizes: np.ndarray
    same: float

    @property
    def replicates(self) -> int:
        """Number of replicates."""
        return len(self.sizes)

    @property
    def statement(self) -> str:
        """The answer in one sentence."""
        if not self.replicates:
            return "No log was resampled, so nothing is known of the stability of the choice."
        low, high = np.round(np.quantile(self.sizes, [0.05, 0.95]))
        return (
            f"Of {self.replicates} resampled logs {100 * self.same:.0f} % lead to exactly this "
            f"model, and 90 % to {low:.0f} to {high:.0f} parameters."
        )


def assess_stability(
    search: Search,
    chosen: Partition,
    rng: np.random.Generator,
    *,
    replicates: int,
    length: float,
    progress: Steps | None = None,
    engine: Engine | None = None,
) -> Stability:
    """Walk the path again on resampled logs.

    Parameters
    ----------
    search : Search
    chosen : Partition
        What the logs themselves chose.
    rng : numpy.random.Generator
    replicates : int
    length : float
        Samples a block must have at least to be nearly independent of the next.
    progress : callable(int, int), optional
    engine : Engine, optional
        Where the replicates are walked; by default here.
    """
    own = search.whitened
    unit = _units(own, max(1, round(length * len(own.folds.test) / max(own.samples, 1))))
    count = int(unit.max()) + 1
    # Drawn here, so that a replicate is the same whoever walks it.
    draws = rng.multinomial(count, np.full(count, 1 / count), size=replicates)
    items = [draws[k : k + BATCH] for k in range(0, replicates, BATCH)]
    parts = (engine or Serial()).map(partial(_walk_again, search, unit), items, progress=progress)
    drawn = np.array([group for part in parts for group in part]).reshape(-1, len(chosen.columns))
    return Stability(
        columns=chosen.columns,
        survives=(drawn != ZERO).mean(0) if replicates else np.full(len(chosen.columns), np.nan),
        sizes=(drawn == np.arange(len(chosen.columns))).sum(1),
        same=float((drawn == chosen.group).all(1).mean()) if replicates else np.nan,
    )


#: Columns up to which the path is walked as often as was asked, how often it is walked at least,
#: and models up to which all are measured: these take a time with the third power of the columns.
WALKED, FEWEST_WALKS, MEASURED = 128, 8, 64


def count_walks(search: Search, draws: int) -> int:
    """Return how many resampled logs the path is walked on, of so many where it costs little."""
    share = (WALKED / max(len(search.whitened.columns), WALKED)) ** 3
    return max(min(draws, FEWEST_WALKS), round(draws * share))


def thin_path(search: Search, chosen: int) -> tuple[Search, int, str]:
    """Return a path of the models to measure, which of them to use, and one sentence on it.

    To measure a model takes a time with the third power of its parameters, too; those that predict
    best are mixed.

    Parameters
    ----------
    search : Search
    chosen : int
        The step to use.
    """
    steps, first = search.path.steps, first_allowed(search.path.steps)
    if len(steps) <= MEASURED + 1:  # of so many columns, with the model that has none
        return search, chosen, ""
    best = first + np.argsort([-s.density for s in steps[first:]], kind="stable")[:MEASURED]
    kept = sorted({*range(first + 1), chosen, *best.tolist()})
    said = f"Of the {len(steps)} models of the path the {len(kept)} that predict best are shown."
    path = replace(search.path, steps=tuple(steps[k] for k in kept))
    return replace(search, path=path), kept.index(chosen), said


def _walk_again(search: Search, unit: np.ndarray, draws: np.ndarray) -> list[np.ndarray]:
    """Return the groups of columns that some replicates choose.

    Parameters
    ----------
    search : Search
    unit : (B,) int
        Of each block.
    draws : (r, units) int
        How often each replicate draws a unit.
    """
    chosen = []
    for row in draws:
        steps = walk(search.whitened.fit(row[unit].astype(float)), search.plan).steps
        chosen.append(search.embed(steps[good_steps(steps)[0]]).partition.group)
    return chosen


def _units(own: WhitenedRegression, blocks: int) -> np.ndarray:
    """Return the unit of resampling of each block: runs of `blocks` within a fold."""
    test, at = own.folds.test, 0
    unit = np.empty(len(test), int)
    for f in range(own.folds.count):
        rows = np.flatnonzero(test == f)
        runs = max(1, len(rows) // blocks)
        unit[rows] = at + np.arange(len(rows)) * runs // len(rows)
        at += runs
    return unit
