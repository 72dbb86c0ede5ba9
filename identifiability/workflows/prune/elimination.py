"""The path down: from every column to few, one physically meaningful move at a time.

1. Columns that this motion never excites, or excites only in combination, are removed first.
2. Suggested moves come next, in the order merge, zero, tie. A move is refused if it lowers the
   predictive log density of unseen stretches too far. The fall must exceed its standard error and
   the tolerance for smaller models.
3. Then the group is removed that raises the sum of squares least, until none is left. The two
   Coulomb levels of a joint are merged or removed together.

The smallest model of the path that is as good as the best is used.

Autocorrelated noise hides parameters, so whitened rows choose where there are any
(`find_path`). Rows as measured may refute their choice (`is_contradicted`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.linalg import solve_triangular

from identifiability.estimation.estimate import Method, estimate
from identifiability.estimation.estimator import Estimate, combine
from identifiability.estimation.evidence import (
    LEVELS,
    Folds,
    Gain,
    HeldOut,
    Score,
    least_noise,
    may_stand,
)
from identifiability.estimation.gaussian import Normal
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.linalg import ROUNDOFF, unit_coordinates
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

from .moves import Kind, Move, Partition

# Predictions of folds by nested models of one regression, from `Information` alone.
#
# Every model is the full one under linear constraints (a column zero, two columns equal); its fits
# to everything and to each fold's rest are the estimator's own (`Refits`). The
# coordinates are those in which the full information is the unit matrix: nothing is lost by
# squaring. Models of a path are nested, so one triangular factor a fold fits them all.


@frozen
class Step:
    """A model on the path.

    Attributes
    ----------
    partition : Partition
    score : Score
        Prediction of each fold by the fit to the rest. It chooses the model.
    errors : Score
        The score on rows as measured. It differs from `score` if whitened rows choose.
    values : (F + 1, c)
        All columns, fitted to everything, then to the rest of each fold.
    move : Move or None
        Move to this model; None for the start.
    """

    partition: Partition
    score: Score
    errors: Score
    values: Array
    move: Move | None = None

    @property
    def density(self) -> float:
        """Predictive log density of all folds [nats]."""
        return float(self.score.density.sum())


def nested_halves(fit: Normal, h: Array, free: np.ndarray) -> Array:
    """Return ``L⁻¹ h`` of nested models by h (k, M) of each, (k, M).

    The leading part of one triangular factor belongs to each of them.

    Parameters
    ----------
    fit : Normal
    h : (k, M)
    free : (M,) int
        Number of first values that are free; the others are zero.
    """
    inside = np.arange(len(fit.factor))[:, None] < free
    half = solve_triangular(
        fit.factor,
        np.where(inside, h, 0.0),
        lower=True,
    )
    return np.where(inside, half, 0.0)


@frozen
class Refits:
    """Fits of nested models to everything (first) and to the rest of each of F folds.

    Coordinates are ``y = R x`` in which the information of everything is the unit matrix.

    Attributes
    ----------
    centre : (k,)
        y of the fit of all columns to everything.
    grams, right : (F + 1, k, k) and (F + 1, k)
        ``grams (y - centre) = right`` of each fit without constraints.
    """

    centre: Array
    grams: Array
    right: Array

    @staticmethod
    def of(information: Information, full: Estimate, R: Array, train: np.ndarray) -> Refits:
        """Return the fits to all blocks, and to those of each fold's rest.

        Parameters
        ----------
        information : Information
            About k independent columns.
        full : Estimate
        R : (k + 1, k + 1)
            Its loss.
        train : (F, B) bool
            Blocks that each fit uses.
        """
        k = len(R) - 1
        member = np.vstack([np.ones(train.shape[1]), train])
        _, to_x, both = full.estimator.equations(information, full)
        # Prior knowledge counts in each.
        behind = (0, len(both) - member.shape[1])
        member = np.pad(
            member,
            ((0, 0), behind),
            constant_values=1.0,
        )
        sums = np.tensordot(member, both, 1)
        to_y = R[:k, :k] @ to_x  # the unit matrix of least squares
        turned = to_y @ sums[:, :, :k] @ np.linalg.inv(to_y)
        grams = 0.5 * (turned + turned.swapaxes(1, 2))  # as the sum over all blocks is
        return Refits(
            R[:k, k],
            grams,
            sums[:, :, k] @ to_y.T,
        )

    @property
    def whole(self) -> Array:
        """``y - centre`` of the fit of all columns to everything, (k,)."""
        return Normal.ridged(self.grams[0], self.right[0]).value

    def along(self, turn: Array, turned: Array, free: np.ndarray) -> Array:
        """Return ``y - centre`` of each fit of M nested models, (M, F + 1, k).

        Parameters
        ----------
        turn : (k, k)
            Orthonormal; its first columns span the free space of a model.
        turned : (F + 1, k, k)
            The products in these directions.
        free : (M,) int
            How many.
        """
        k = len(self.centre)
        out = np.empty((len(free), *self.right.shape))
        inside = np.arange(k)[:, None] < free
        c = turn.T @ self.centre
        for f, (A, right) in enumerate(zip(turned, self.right, strict=True)):
            b = turn.T @ right
            fit = Normal.ridged(A, b)
            moved = np.where(inside, 0.0, -c[:, None])
            for _ in range(2):  # the second time takes away what the ridge did to the first
                half = nested_halves(fit, b[:, None] - A @ moved, free)
                moved += solve_triangular(
                    fit.factor,
                    half,
                    lower=True,
                    trans="T",
                )
            out[:, f] = (turn @ moved).T
        return out


@frozen(kw_only=True)
class WhitenedRegression:
    """A regression in coordinates ``y = R x`` in which the full information is I, and its folds.

    Attributes
    ----------
    start : Partition
        Of the c columns of the model, of which the motion excites k.
    inverse : (c, k)
        ``x = inverse @ y``; zero where the motion excites nothing.
    unit : float
        Variance of noise of weight 1: the errors of y of the full fit.
    tests : Information
        About y and the residual of the full fit, for predictions of each fold.
    gram : (F, k + 1, k + 1)
        Products for densities: of whitened columns and errors, or of their projections on
        instruments.
    variation : (n,) [torque²]
        Of the torque of each joint about its mean: the scale of its errors.
    folds : Folds
    refits : Refits
        Of all columns, to everything and to the rest of each fold.
    """

    start: Partition
    inverse: Array
    unit: float
    tests: Information
    gram: Array
    variation: Array
    folds: Folds
    refits: Refits

    def along(self, path: Sequence[Made]) -> list[Step]:
        """Return nested models with their fits, and their predictions of the folds.

        Parameters
        ----------
        path : sequence of (Move, Partition)
            The move to each model, beginning with the model of all excited columns.
        """
        partitions = [partition for _, partition in path]
        turn = self._turn(partitions)
        free = np.array(list(map(len, partitions)))
        turned = turn.T @ self.refits.grams @ turn
        delta = self.refits.along(turn, turned, free)
        values = (self.refits.centre + delta) @ self.inverse.T
        ones = np.ones((len(free), self.folds.count, 1))
        left = np.concatenate([-delta[:, 1:], ones], 2)
        squares = self.tests.squares_of_blocks(left)
        about = (self.variation, self.folds.ratio)
        density = self._densities(left, turn, turned[1:] / self.unit, free)
        found = []
        for (move, partition), each, own, x in zip(path, density, squares, values, strict=True):
            score = Score(each, own, *about)
            found.append(Step(partition, score, score, x, move))
        return found

    def _turn(self, partitions: Sequence[Partition]) -> Array:
        """Return orthonormal directions (k, k); the first ones span the free space of a model."""
        rows = [before.rows_to(after) for before, after in pairwise(partitions)]
        none = np.empty((0, len(self.inverse)))
        fixed = np.concatenate([none, *rows]) @ self.inverse
        fixed /= np.linalg.norm(fixed, axis=1, keepdims=True)
        Q, _ = np.linalg.qr(fixed.T, mode="complete")
        return Q[:, ::-1]

    def _densities(self, left: Array, turn: Array, precision: Array, free: np.ndarray) -> Array:
        """Return the predictive log densities of folds under nested models, (M, F) [nats].

        As of `evidence.HeldOut`; the leading parts of one factor belong to all of them.

        Parameters
        ----------
        left : (M, F, k + 1)
            ``[y torque] left`` is the residual of each model in each fold.
        turn : (k, k)
        precision : (F, k, k)
            Of each rest's fit in the directions of `turn`.
        free : (M,) int
        """
        k = len(turn)
        found = np.empty(left.shape[:2])
        none = np.zeros(k)
        for f, (gram, P) in enumerate(zip(self.gram, precision, strict=True)):
            before = Normal.ridged(P, none)
            told = turn.T @ gram[:k, :k] @ turn
            after = Normal.ridged(before.factor @ before.factor.T + told, none)
            residual = left[:, f].T
            own = gram @ residual
            half = nested_halves(after, turn.T @ own[:k], free)
            sizes = [np.log(np.diag(x.factor)) for x in (before, after)]
            volumes = np.append(0.0, np.cumsum(sizes[0] - sizes[1]))[free]
            squares = (half**2).sum(0) - (residual * own).sum(0)
            found[:, f] = volumes + 0.5 * squares
        return found


def whiten_regression(
    information: Information,
    full: Estimate,
    variation: Array | None = None,
    folds: Folds | None = None,
) -> WhitenedRegression:
    """Return the folds of a regression.

    Parameters
    ----------
    information : Information
        About c columns.
    full : Estimate
        Of these; its estimator refits those that it kept, with its weights of the actuators.
    variation : (n,), optional [(N·m)² or N²]
        Of the torque of each joint about its mean; by default the
        torque's sum of squares.
    folds : Folds, optional
        By default those of the estimate's autocorrelation time.

    Raises
    ------
    LogError
        If the logs are too short for folds.
    """
    kept = list(full.kept)
    columns = information.columns
    if len(kept) < len(columns):
        information = information.select(kept)
        full = full.estimator.fit(information)
    k = information.size
    R = full.estimator.loss(information, full)
    length = float(np.linalg.norm(R[:, k]))
    R[k, k] = max(abs(R[k, k]), ROUNDOFF * length, 1e-300)
    turned = unit_coordinates(R[:k, :k])
    folds = folds or Folds.of(information, float(full.times.max()))
    residual = information.reduce(turned, information.columns, turned @ R[:k, k])
    tests = residual.summed(folds.tested)
    lost = {*range(len(columns))} - {*kept}
    unit = np.eye(len(columns))[:, kept]
    return WhitenedRegression(
        start=Partition.of(columns, lost),
        inverse=unit @ turned,
        unit=max(full.unit, least_noise(information)),
        tests=tests,
        gram=_see(information, full, R, tests),
        variation=information.torque if variation is None else variation,
        folds=folds,
        refits=Refits.of(information, full, R, folds.train),
    )


def _see(information: Information, full: Estimate, R: Array, tests: Information) -> Array:
    """Return the products ``[Y, e]ᵀ [Y, e]`` of each fold, for densities, (F, k + 1, k + 1).

    Noise in the motion enters both columns and errors. A model that fits this noise predicts the
    log better and the robot worse. Where there are instruments, columns and errors are projected on
    them, because instruments do not contain this noise.
    """
    k = information.size
    one = np.eye(k + 1)
    weights = 1.0 / np.maximum(full.variance * full.times, least_noise(information))
    if not (full.estimator.instruments and information.instrumented):
        return tests.products(weights, one, one)
    turned = R[:k, :k] @ combine(information, full).left.reshape(2, k, k)
    left = np.vstack([*turned, np.zeros((1, k))])
    errors = np.vstack([np.zeros((k, k + 1)), one])
    both = np.hstack([left, errors])
    out = []
    for own in tests.joint.products(weights, left, both):
        values, vectors = np.linalg.eigh(own[:, :k])
        good = values > ROUNDOFF * values.max(initial=0.0)
        half = (vectors[:, good] / np.sqrt(values[good])).T @ own[:, k:]
        out.append(half.T @ half)
    return np.stack(out)


# Which move is the cheapest.


#: A constraint already holds if earlier constraints leave less than this share of it free.
SATISFIED: Tolerance = 1e-5

# Only the fit to all rows decides which move is cheapest. So this fit alone gives the order. The
# fits without each fold follow for all models at once (`WhitenedRegression.along`), because models
# are nested.


@frozen
class Remaining:
    """The fit to all rows after some moves, with the remaining free directions.

    Attributes
    ----------
    partition : Partition
    values : (c,)
        Of all columns under the constraints so far.
    X : (c, k)
        ``x = X z`` in coordinates z of unit information, in which only free directions move.
    size : (c,)
        Length of each row of X without constraints.
    """

    partition: Partition
    values: Array
    X: Array
    size: Array

    @staticmethod
    def of(own: WhitenedRegression) -> Remaining:
        """Return the state with all columns."""
        refits = own.refits
        values, vectors = np.linalg.eigh(refits.grams[0])
        seen = np.maximum(values, SATISFIED**2 * values.max(initial=0.0))
        X = own.inverse @ (vectors / np.sqrt(seen))
        x = own.inverse @ (refits.centre + refits.whole)
        return Remaining(
            own.start,
            x,
            X,
            np.linalg.norm(X, axis=1),
        )

    def after(self, move: Move) -> tuple[Remaining, float]:
        """Return the state after a move, and the rise of the estimator's loss."""
        partition = self.partition.apply(move)
        rows = self.partition.rows_to(partition)
        rows = rows / (np.abs(rows) @ self.size)[:, None]
        U, s, Vt = np.linalg.svd(rows @ self.X, full_matrices=False)
        free = s > SATISFIED
        off = (U.T @ (rows @ self.values))[free] / s[free]
        along = self.X @ Vt[free].T
        values = self.values - along @ off
        X = self.X - along @ Vt[free]
        return replace(
            self,
            partition=partition,
            values=values,
            X=X,
        ), float(off @ off)

    def cost(self, move: Move) -> float:
        """Return the rise of the estimator's loss per parameter that a move removes."""
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
        lengths = np.linalg.norm(self.X[singles], axis=1)
        least = SATISFIED * self.size[singles]
        spread = np.maximum(lengths, least)
        costs = [*(self.values[singles] / spread) ** 2, *map(self.cost, moves)]
        if not costs:
            return None
        best = int(np.argmin(costs))
        dropped = [Move(Kind.DROP, p.members(g)) for g in singles[best : best + 1]]
        return (dropped or moves[best - len(singles) :])[0]


@frozen
class Plan:
    """Allowed, forced and suggested moves.

    Attributes
    ----------
    suggested : tuple of Move
        Made unless the data contradict them.
    pairs : tuple of Move
        Merges of Coulomb levels; such columns are dropped in pairs only.
    forced : tuple of Move
        Made first, without regard to the data.
    kept : frozenset of str
        Columns that must not be dropped.
    """

    suggested: tuple[Move, ...] = ()
    pairs: tuple[Move, ...] = ()
    forced: tuple[Move, ...] = ()
    kept: frozenset[str] = frozenset()


@frozen
class Refusal:
    """A refused move, and its change of the predictive log density."""

    move: Move
    gain: Gain

    @property
    def reason(self) -> str:
        """Why, in words."""
        return phrase("pruned", "refused", fall=-self.gain.value, se=self.gain.se)


#: The move to a model, and the model.
Made = tuple[Move | None, Partition]


def walk(fit: WhitenedRegression, plan: Plan) -> tuple[list[Step], list[Refusal]]:
    """Return the models from a fit of all columns down, and the refused moves."""
    left, made = _force(Remaining.of(fit), plan.forced)
    refused = []
    for kind in (Kind.LIMIT, Kind.OFFSET, Kind.MERGE, Kind.ZERO, Kind.TIE):
        asked = [move for move in plan.suggested if move.kind is kind]
        while asked := [m for m in asked if len(left.partition.apply(m)) < len(left.partition)]:
            move = asked.pop(int(np.argmin([left.cost(m) for m in asked])))
            after, rise = left.after(move)
            step = move, after.partition
            # Moves that cost less fit than models near the best may lose are not tested on folds.
            gain = _ask_folds(fit, made, step) if rise > 2.0 * LEVELS.nats * fit.unit else None
            if gain is not None and gain.value < -max(LEVELS.nats, gain.se):
                refused.append(Refusal(move, gain))
                continue
            left = after
            made.append(step)
    while (cheapest := left.cheapest(plan)) is not None:
        left = left.after(cheapest)[0]
        made.append((cheapest, left.partition))
    return fit.along(made), refused


def _force(left: Remaining, forced: Sequence[Move]) -> tuple[Remaining, list[Made]]:
    """Return the state after forced moves, and the models on the way."""
    made: list[Made] = [(None, left.partition)]
    for move in forced:
        if left.partition.alive(move.zero):
            left = left.after(move)[0]
            made.append((move, left.partition))
    return left, made


def _ask_folds(fit: WhitenedRegression, made: Sequence[Made], step: Made) -> Gain:
    """Return the change of the predictive log density of folds by one more step."""
    *_, before, then = fit.along([made[0], made[-1], step])
    return then.score.gain(before.score)


# The path of a regression, and which model of it to use: the smallest as good as the best.


@frozen
class Search:
    """A path, with the regression and the plan of the search.

    Attributes
    ----------
    full : Estimate
        Of the starting model.
    whitened : WhitenedRegression
    steps : tuple of Step
        Most parameters first.
    refused : tuple of Refusal
        Suggested moves that were not made.
    """

    full: Estimate
    whitened: WhitenedRegression
    steps: tuple[Step, ...]
    refused: tuple[Refusal, ...] = ()


def find_path(
    information: Information,
    *,
    whitened: Information | None = None,
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
    whitened : Information, optional
        The same rows, whitened by the noise of each joint. They choose the model unless the rows as
        measured contradict them. By default the noise is white.
    variation : (n,), optional [(N·m)² or N²]
        Of the torque of each joint about its mean, as in `whiten_regression`.
    suggested : sequence of Move
        Moves that knowledge of the robot suggests.
    forbid, force : sequence of str
        Columns that must not be dropped, and columns that are always dropped.
    method : str or Estimator
        Its refits are the fits of the path.
    """
    full = estimate(information, method)
    measured = whiten_regression(information, full, variation)
    usable = []
    for move in suggested:
        zero = tuple(c for c in move.zero if c not in forbid)
        usable.append(replace(move, zero=zero))
    asked = phrase("pruned", "asked")
    pairs = tuple(m for m in usable if m.kind is Kind.MERGE)
    forced = tuple(Move(Kind.FORCED, (c,), why=asked) for c in force)
    plan = Plan(
        suggested=tuple(usable),
        pairs=pairs,
        forced=forced,
        kept=frozenset(forbid),
    )
    walked, refused = walk(measured, plan)
    judge = None if whitened is None else _whiten_same(measured, full, whitened)
    if judge is not None:
        steps, others = walk(judge, plan)
        held_out = HeldOut.of(information, full.noise, measured.folds)
        if not is_contradicted(steps, walked, held_out):
            walked = _measure_errors(steps, measured)
            refused = others
    first, *steps = walked
    idle = tuple(measured.start.zeroed())
    if idle:  # the first move drops unexcited columns
        move = Move(Kind.UNEXCITED, idle, why=phrase("pruned", "idle"))
        steps = [replace(first, move=move), *steps]
        first = replace(first, partition=Partition.of(full.columns))
    return Search(full, measured, (first, *steps), tuple(refused))


def _whiten_same(
    measured: WhitenedRegression, full: Estimate, whitened: Information
) -> WhitenedRegression | None:
    """Return the regression of whitened rows, with the folds of rows as measured.

    It is None if the whitened rows do not determine the same columns.
    """
    fit = replace(full.estimator, noise=None).fit(whitened)
    same = fit.kept == full.kept
    if same:
        return whiten_regression(whitened, fit, folds=measured.folds)
    return None


def _measure_errors(steps: Sequence[Step], measured: WhitenedRegression) -> list[Step]:
    """Return steps with the values and errors of rows as measured, which reports state."""
    fitted = measured.along([(step.move, step.partition) for step in steps])
    pairs = zip(steps, fitted, strict=True)
    return [replace(x, values=y.values, errors=y.errors) for x, y in pairs]


def is_contradicted(whitened: Sequence[Step], measured: Sequence[Step], held_out: HeldOut) -> bool:
    """Return whether unseen torque surely contradicts the choice of whitened rows.

    Errors of the model look like slow noise, and whitening then hides parameters that the torque
    needs. So both kinds of rows choose a model, and both models predict the folds as measured.
    Each model keeps the values that its own rows gave.

    Parameters
    ----------
    whitened, measured : sequence of Step
        The models that whitened rows and rows as measured lead to.
    held_out : HeldOut
        Folds of the rows as measured.
    """
    chosen, other = (
        held_out.score(steps[good_steps(steps)[0]].values[1:]) for steps in (whitened, measured)
    )
    return other.gain(chosen).limits(held_out.folds.count)[0] > 0


def first_allowed(steps: Sequence[Step]) -> int:
    """Return the first step after the removals that the motion or the user forces."""
    kinds = [s.move and s.move.kind for s in steps]
    must = (Kind.UNEXCITED, Kind.FORCED)
    return max((k for k, kind in enumerate(kinds) if kind in must), default=0)


def best_step(steps: Sequence[Step]) -> int:
    """Return the allowed step with the best predictive log density."""
    first = first_allowed(steps)
    densities = [s.density for s in steps[first:]]
    return first + int(np.argmax(densities))


def good_steps(steps: Sequence[Step]) -> list[int]:
    """Return the steps that predict as well as the best, the smallest first."""
    best = steps[best_step(steps)].score
    down = range(len(steps) - 1, first_allowed(steps) - 1, -1)
    return [k for k in down if may_stand(steps[k].score, best)]


def weigh_models(densities: Sequence[Array] | Array, rng: np.random.Generator) -> Array:
    """Return pseudo-BMA+ weights of M models, (M,) [Yao 2018].

    Softmax of the summed log densities, averaged over a Bayesian bootstrap of the folds.

    Parameters
    ----------
    densities : (M, F) [nats]
    rng : numpy.random.Generator
    """
    each = np.asarray(densities, float)
    drawn = rng.dirichlet(np.ones(each.shape[1]), LEVELS.draws) * each.shape[1]
    total = drawn @ each.T
    odds = np.exp(total - total.max(1, keepdims=True))
    return (odds / odds.sum(1, keepdims=True)).mean(0)


#: Models up to which all are measured: each takes a time with the third power of its columns.
MEASURED = 64


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
    steps = search.steps
    first = first_allowed(search.steps)
    if len(steps) <= MEASURED + 1:  # of so many columns, with the model that has none
        return search, chosen, ""
    densities = [-s.density for s in steps[first:]]
    best = first + np.argsort(densities, kind="stable")[:MEASURED]
    kept = sorted({*range(first + 1), chosen, *best.tolist()})
    said = Finding("thinned", count=len(steps), shown=len(kept))
    return replace(search, steps=tuple(steps[k] for k in kept)), kept.index(chosen), said
