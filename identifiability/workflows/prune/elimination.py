"""The path down: from every column to few, one physically meaningful move at a time.

1. What this motion never excites, or excites only together with something else, goes first.
2. Moves that knowledge of the robot suggests, in the order merge, zero, tie: each is made unless
   the data contradict it (the predictive log density falls by more than its standard error, and the
   difference that it denies is significant) or it surely makes the model less feasible.
3. Then the group whose loss raises the sum of squares least, until nothing is left. A joint's two
   Coulomb levels are merged or dropped together, never torn apart.

The path ends where nothing is left; which rung of it to use is `selection`'s to say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

import numpy as np
from scipy.stats import f as f_distribution

from identifiability.estimation.evidence import Evidence, Score
from identifiability.estimation.updated_refits import UpdatedRefits
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.workflows.prune.descent import descend, find_cheapest, find_either
from identifiability.workflows.prune.folds import Fit
from identifiability.workflows.prune.moves import Kind, Move, Partition

#: A suggested move is refused only if the data deny it at this level.
LEVEL = 0.01


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
    def of(fit: Fit, move: Move | None = None, evidence: MoveTest | None = None) -> Step:
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
            "Not significant" if evidence.p_value > 0.05 else "The least costly of what is left"
        ) + f" (p = {evidence.p_value:.2g}); {change}."
        if evidence.either:
            text += (
                f" These logs hardly tell it from {evidence.either}: either of the two can stand "
                "for both."
            )
        return text
    if evidence.p_value > 0.05:
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


def walk(fit: Fit, plan: Plan) -> Path:
    """Return the path from a fit down.

    Parameters
    ----------
    fit : Fit
        Of all columns.
    plan : Plan
    """
    walker = _Walker(fit, plan)
    for move in plan.forced:
        walker.make(move)
    for kind in (Kind.OFFSET, Kind.MERGE, Kind.ZERO, Kind.TIE):
        walker.suggest([m for m in plan.suggested if m.kind is kind])
    walker.descend()
    return Path(tuple(walker.steps), tuple(walker.refused))


class _Walker:
    """The state of a walk; it lives as long as `walk`."""

    def __init__(self, fit: Fit, plan: Plan) -> None:
        self.fit, self.plan = fit, plan
        self.base = max(fit.whitened.scale**2, 1e-300)
        self.steps = [Step.of(fit)]
        self.refused: list[Refusal] = []

    def make(self, move: Move) -> None:
        """Make a move, if there is anything left for it to do."""
        if len(self.fit.rows(move)):
            after = self.fit.after(move)
            self._step(after, move, self._evidence(move, after))

    def _step(self, after: Fit, move: Move, evidence: MoveTest) -> None:
        self.fit = after
        self.steps.append(Step.of(after, move, evidence))

    def suggest(self, moves: Sequence[Move]) -> None:
        """Make those moves that the data do not contradict, cheapest first."""
        left = list(moves)
        while left := [m for m in left if len(self.fit.rows(m))]:
            self._try(left.pop(int(np.argmin(self.fit.costs(left)))))

    def _try(self, move: Move) -> None:
        after = self.fit.after(move)
        evidence = self._evidence(move, after)
        sure = evidence.p_value < LEVEL
        if sure and evidence.gain < -evidence.gain_se:
            reason = (
                f"The data contradict it: {evidence.say_gain('would ')}, and what it denies is "
                f"significant (p = {evidence.p_value:.2g})."
            )
        elif sure and after.violations() > self.fit.violations():
            reason = "It would give another parameter a sign that physics forbids."
        else:
            self._step(after, move, evidence)
            return
        self.refused.append(Refusal(move, evidence, reason))

    def descend(self) -> None:
        """Make the cheapest moves until nothing is left that may go."""
        plan, fit = self.plan, self.fit
        if not isinstance(fit.refits, UpdatedRefits):
            while (move := find_cheapest(self.fit, plan.pairs, plan.kept)) is not None:
                self.make(move)
            return
        made = list(descend(fit, plan.pairs, plan.kept))
        held = made[-1].held if made else fit.refits.held
        for d, after in zip(
            made, fit.along(held, [(d.after, len(d.held)) for d in made]), strict=True
        ):
            self._step(after, d.move, self._weigh(d.move, after, d.cost, d.either))

    def _evidence(self, move: Move, after: Fit) -> MoveTest:
        fit = self.fit
        return self._weigh(move, after, fit.cost(move), find_either(fit, move))

    def _weigh(self, move: Move, after: Fit, cost: float, either: str) -> MoveTest:
        gain = Evidence.of(after.score, self.fit.score).density
        p_value, percent = _significance(*self.fit.jackknife(move), self.fit.whitened.folds.count)
        return MoveTest(
            cost=cost / self.base,
            p_value=p_value,
            sigma_percent=percent,
            gain=gain.value,
            gain_se=gain.se,
            either=either,
        )


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
        return float(f_distribution.sf(single, 1, max(F - 1, 1))), percent
    t2 = float(denied @ np.linalg.pinv(covariance, hermitian=True) @ denied)
    return float(f_distribution.sf(t2 * (F - r) / (r * (F - 1)), r, F - r)), percent
