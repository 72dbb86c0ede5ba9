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

import numpy as np

from identifiability.estimation.estimate import Method, estimate
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.evidence import LEVELS, Gain, may_stand
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
