"""The path down: from every column to few, one physically meaningful move at a time.

1. What this motion never excites, or excites only together with something else, goes first.
2. Moves that knowledge of the robot suggests, in the order merge, zero, tie: each is made unless
   the data contradict it (held-out error up by more than one standard error, and the difference
   it denies is significant) or it makes the model less feasible.
3. Then the group whose loss raises the sum of squares least, until nothing is left. A joint's two
   Coulomb levels are merged or dropped together, never torn apart.

The path ends where nothing is left; which rung of it to use is `selection`'s to say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

import numpy as np
from scipy.stats import f as f_distribution

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.workflows.prune.folds import Errors, Fit
from identifiability.workflows.prune.moves import Kind, Move, Partition

#: A suggested move is refused only if the data deny it at this level.
LEVEL = 0.01

#: Estimates correlated beyond this are one quantity to these logs: "either".
EITHER = 0.95


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
class Evidence:
    """What the data say of a move.

    Attributes
    ----------
    cost : float
        Rise of the weighted sum of squares, relative to that of the full model.
    p_value : float
        Of what the move denies being zero, by the scatter between folds.
    sigma_percent : float
        Standard deviation of what the move denies, by the same scatter, relative to its value [%].
    rise, rise_se : float
        Rise of the held-out error and its standard error, relative to the full model's.
    either : str
        The parameter that these logs can hardly tell it from.
    """

    cost: float
    p_value: float
    sigma_percent: float
    rise: float
    rise_se: float
    either: str = ""

    def say_rise(self, mood: str = "") -> str:
        """Return what becomes of the held-out squares, in words."""
        if self.rise > 10:
            times = f"{1 + self.rise:.0f}" if self.rise < 1e6 else "more than a million"
            return f"the held-out squares {mood}become {times} times as large"
        change = "rise" if self.rise > 0 else "fall"
        size = f"{100 * abs(self.rise):.3g} ± {100 * self.rise_se:.3g} %"
        return f"the held-out squares {mood}{change} by {size}"


@frozen
class Step:
    """A model on the path.

    Attributes
    ----------
    partition : Partition
    errors : Errors
    violations : int
        Free parameters with a sign that physics forbids.
    values : (F + 1, k)
        Parameters fitted to everything, then to the rest of each fold.
    move : Move or None
        What led here; None for the start.
    evidence : Evidence or None
    """

    partition: Partition
    errors: Errors
    violations: int
    values: Array
    move: Move | None = None
    evidence: Evidence | None = None


@frozen
class Refusal:
    """A suggested move that was not made."""

    move: Move
    evidence: Evidence
    reason: str


@frozen
class Path:
    """The steps, most parameters first, and what was refused on the way."""

    steps: tuple[Step, ...]
    refused: tuple[Refusal, ...] = ()


def walk(fit: Fit, partition: Partition, plan: Plan) -> Path:
    """Return the path from a fit down.

    Parameters
    ----------
    fit : Fit
        Of all free columns of the partition.
    partition : Partition
    plan : Plan
    """
    walker = _Walker(fit, partition, plan)
    for move in plan.forced:
        walker.make(move)
    for kind in (Kind.MERGE, Kind.ZERO, Kind.TIE):
        walker.suggest([m for m in plan.suggested if m.kind is kind])
    while (cheapest := walker.cheapest()) is not None:
        walker.make(cheapest)
    return Path(tuple(walker.steps), tuple(walker.refused))


class _Walker:
    """The state of a walk; it lives as long as `walk`."""

    def __init__(self, fit: Fit, partition: Partition, plan: Plan) -> None:
        self.fit, self.partition, self.plan = fit, partition, plan
        self.unit = max(fit.errors().total, 1e-300)
        self.base = max(fit.folds.scale**2, 1e-300)
        self.steps = [Step(partition, fit.errors(), fit.violations(), fit.values)]
        self.refused: list[Refusal] = []

    def make(self, move: Move) -> None:
        """Make a move, if there is anything left for it to do."""
        rows = self.partition.rows(move)
        if len(rows):
            L = self.fit.folds.whiten(rows)
            self._step(move, L, self.fit.constrain(L))

    def _step(self, move: Move, L: Array, after: Fit) -> None:
        evidence = self._evidence(move, L, after)
        self.fit, self.partition = after, self.partition.apply(move)
        self.steps.append(
            Step(self.partition, after.errors(), after.violations(), after.values, move, evidence)
        )

    def suggest(self, moves: Sequence[Move]) -> None:
        """Make those moves that the data do not contradict, cheapest first."""
        left = list(moves)
        while left:
            rows = [self.partition.rows(m) for m in left]
            left = [m for m, r in zip(left, rows, strict=True) if len(r)]
            costs = []
            for r in rows:
                if len(r):
                    rise, rank = self.fit.cost(self.fit.folds.whiten(r))
                    costs.append(rise / max(rank, 1))
            if not left:
                return
            self._try(left.pop(int(np.argmin(costs))))

    def _try(self, move: Move) -> None:
        L = self.fit.folds.whiten(self.partition.rows(move))
        after = self.fit.constrain(L)
        evidence = self._evidence(move, L, after)
        if evidence.rise > evidence.rise_se and evidence.p_value < LEVEL:
            reason = (
                f"The data contradict it: {evidence.say_rise('would ')}, and what it denies is "
                f"significant (p = {evidence.p_value:.2g})."
            )
            self.refused.append(Refusal(move, evidence, reason))
        elif after.violations() > self.fit.violations() and evidence.p_value < LEVEL:
            reason = "It would give another parameter a sign that physics forbids."
            self.refused.append(Refusal(move, evidence, reason))
        else:
            self._step(move, L, after)

    def _evidence(self, move: Move, L: Array, after: Fit) -> Evidence:
        rise, spread = after.errors().above(self.fit.errors())
        return Evidence(
            self.fit.cost(L)[0] / self.base, *_significance(self.fit, L), rise / self.unit,
            spread / self.unit, self._either(move),
        )  # fmt: skip

    def _either(self, move: Move) -> str:
        """Return the parameter that a dropped one can hardly be told from."""
        if move.kind is not Kind.DROP:
            return ""
        gone = self.partition.alive(move.zero)
        others = [g for g in self.partition.leaders if g not in gone]
        if len(gone) != 1 or not others:
            return ""
        X = self.fit.folds.inverse[[*gone, *others]]
        C = X @ self.fit.C[0] @ X.T
        size = np.sqrt(np.maximum(np.diag(C), 1e-300))
        rho = np.abs(C[0, 1:]) / (size[0] * size[1:])
        best = int(np.argmax(rho))
        return self.partition.columns[others[best]] if rho[best] > EITHER else ""

    def cheapest(self) -> Move | None:
        """Return the move whose loss raises the sum of squares least per parameter."""
        p = self.partition
        paired: set[int] = set()
        moves = []
        for pair in self.plan.pairs:
            leaders = p.alive(pair.columns)
            if len(leaders) == 2:
                paired.update(leaders)
                moves.append(pair)
                moves.append(Move(Kind.DROP, tuple(p.columns[g] for g in leaders)))
        singles = [Move(Kind.DROP, p.members(g)) for g in p.leaders if g not in paired]
        moves = [
            m for m in [*singles, *moves]
            if m.kind is not Kind.DROP or not self.plan.kept.intersection(m.zero)
        ]  # fmt: skip
        costs = self._costs(moves)
        return moves[int(np.argmin(costs))] if moves else None

    def _costs(self, moves: Sequence[Move]) -> list[float]:
        rows = [self.partition.rows(m) for m in moves]
        if not rows:
            return []
        whole = self.fit.folds.whiten(np.concatenate(rows))
        single, _ = self.fit.costs(whole)
        costs, at = [], 0
        for r in rows:
            if len(r) == 1:
                costs.append(float(single[at]))
            else:
                rise, rank = self.fit.cost(whole[at : at + len(r)])
                costs.append(rise / max(rank, 1))
            at += len(r)
        return costs


def _significance(fit: Fit, L: Array) -> tuple[float, float]:
    """Return the p-value of ``L y = 0`` by Hotelling's T², and σ%, by the jackknife over folds."""
    d, covariance = fit.jackknife(L)
    F, r = len(fit.delta) - 1, len(d)
    single = float(np.mean(d**2 / np.maximum(np.diag(covariance), 1e-300)))
    percent = 100.0 / np.sqrt(max(single, 1e-300))
    if r + 1 >= F:  # too few folds for their covariance: the mean of the single tests
        return float(f_distribution.sf(single, 1, max(F - 1, 1))), percent
    t2 = float(d @ np.linalg.pinv(covariance, hermitian=True) @ d)
    return float(f_distribution.sf(t2 * (F - r) / (r * (F - 1)), r, F - r)), percent
