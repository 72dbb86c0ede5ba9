"""What many models of one regression predict of folds, from `Information` alone.

Every model is the full one under linear constraints (a column zero, two columns equal); its fits
to everything and to each fold's rest are the estimator's own (`estimation.refits`). The coordinates
are those in which the full information is the unit matrix: nothing is lost by squaring. Models of a
path are nested, so one triangular factor a fold scores them all (`evidence.nested_density`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from identifiability.estimation.estimator import Estimate
from identifiability.estimation.evidence import Folds, Score, nested_density
from identifiability.estimation.instrumental import InstrumentalVariables, combine
from identifiability.estimation.least_squares import noise_scale
from identifiability.estimation.refits import Asked, Equations, Refits, UpdatedRefits
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.information import ActuatorBlocks, Information
from identifiability.workflows.prune.moves import Move, Partition

#: A constraint whose share of its first variance is below this holds already.
SATISFIED: Tolerance = 1e-10


@frozen(kw_only=True)
class WhitenedRegression:
    """Blocks of a regression in coordinates ``y = R x`` in which the full information is I.

    Attributes
    ----------
    columns : tuple of str
    inverse : (k, k)
        ``x = inverse @ y``.
    centre : (k,)
        y of the full fit.
    scale : float
        Root of its residual sum of squares.
    noise : (n,) [torque²]
        σ² κ of each joint, beside the full model.
    unit : float
        Variance of noise of weight 1: the errors of y of the full fit.
    parts : tuple of ActuatorBlocks
        Blocks of each joint, without instruments.
    bases : tuple of (r, k + 1)
        ``[W R⁻¹, e] = Z basis`` of each joint, e being what the full fit leaves.
    seen : (B, k, 2k + 1)
        ``Zᵀ [Z, W R⁻¹, e]`` of each block, whitened, of the instruments Z that the estimator
        combines; without instruments (0, k, 2k + 1).
    variation : (n,) [torque²]
        Of the torque of each joint about its mean: the scale of its errors.
    folds : Folds
    nonnegative : (k,) bool
    samples : int
        Of the logs.
    refitter : Equations or Asked
        What refits: updates of normal equations, those of least squares being the Gram matrix of
        ``Z`` where the residual is ``Z (centre - y, scale)``; or the estimator.
    """

    columns: tuple[str, ...]
    inverse: Array
    centre: Array
    scale: float
    noise: Array
    unit: float
    parts: tuple[ActuatorBlocks, ...]
    bases: tuple[Array, ...]
    seen: Array
    variation: Array
    folds: Folds
    nonnegative: np.ndarray
    samples: int
    refitter: Equations | Asked

    @property
    def size(self) -> int:
        """Number of columns k."""
        return len(self.columns)

    def whole(self, tests: Sequence[Array]) -> Array:
        """Return ``[Y, e]ᵀ [Y, e]`` of each fold, whitened, (F, k + 1, k + 1)."""
        each = zip(tests, self.bases, self.noise, strict=True)
        return np.asarray(sum(basis.T @ test @ basis / noise for test, basis, noise in each))

    def project(self, weights: Array) -> Array:
        """Return what instruments see of each fold, ``[Y, e]ᵀ P [Y, e]``, (F, k + 1, k + 1).

        Noise in the motion is in columns and errors alike: a model that fits it would predict the
        log's torque better and the robot's worse. Instruments have no part in it.
        """
        k, out = self.size, []
        for f in range(self.folds.count):
            own = np.tensordot((self.folds.test == f) * weights, self.seen, 1)
            values, vectors = np.linalg.eigh(own[:, :k])
            good = values > SATISFIED * values.max(initial=0.0)
            half = (vectors[:, good] / np.sqrt(values[good])).T @ own[:, k:]
            out.append(half.T @ half)
        return np.stack(out)

    def score(
        self,
        tests: Sequence[Array],
        gram: Array,
        precision: Array,
        delta: Array,
        turn: Array,
        free: Array,
    ) -> list[Score]:
        """Return what M nested models predict.

        Parameters
        ----------
        tests : sequence of (F, r, r)
            ``Zᵀ Z`` of what each fold predicts, of each joint.
        gram : (F, k + 1, k + 1)
            What the density is of (`whole`, or `project`).
        precision : (F, k, k)
            Of y, fitted to each fold's rest.
        delta : (M, F, k)
            ``y - centre`` of each fit.
        turn : (k, k)
            Orthonormal; its first columns span what a model leaves free.
        free : (M,) int
            How many.
        """
        change = np.concatenate([-delta, np.ones((*delta.shape[:2], 1))], 2)
        squares = np.empty((*delta.shape[:2], len(tests)))
        for a, (test, basis) in enumerate(zip(tests, self.bases, strict=True)):
            left = (change @ basis.T).swapaxes(0, 1)
            squares[:, :, a] = ((left @ test) * left).sum(2).T
        density = nested_density(gram, precision, delta, turn, free)
        return [
            Score(d, s, self.variation, self.folds.ratio)
            for d, s in zip(density, squares, strict=True)
        ]

    def whiten(self, rows: Array) -> Array:
        """Return constraints ``L x = 0`` (r, k) in the coordinates y, rows of unit length."""
        L = rows @ self.inverse
        unit: Array = L / np.linalg.norm(L, axis=1, keepdims=True)
        return unit

    def fit(self, counts: Array | None = None) -> FoldFits:
        """Return the fits of all columns to everything and to each fold's rest.

        Parameters
        ----------
        counts : (B,), optional
            How often each block counts, for a bootstrap replicate.
        """
        folds = self.folds
        weights = np.ones(len(folds.test)) if counts is None else counts
        tests = [part.merge_weighted(folds.test, weights) for part in self.parts]
        refits: Refits
        if isinstance(self.refitter, Equations):
            equations = self.refitter.of_rests(folds.train, counts)
            refits = UpdatedRefits.of(equations, self.centre, self.scale)
        else:
            every = np.ones(len(folds.test), bool)
            refits = self.refitter.start(weights, np.vstack([every, folds.train]).astype(float))
        gram = self.project(weights) if len(self.seen) else self.whole(tests)
        return FoldFits(self, Partition.of(self.columns), tuple(tests), gram, refits)


@frozen
class FoldFits:
    """Fits of one model to everything (first) and to the rest of each of F folds.

    Attributes
    ----------
    whitened : WhitenedRegression
    partition : Partition
        What became of each column.
    tests : tuple of (F, r, r)
        ``Zᵀ Z`` of what each fold predicts, of each joint.
    gram : (F, k + 1, k + 1)
        What densities are of: all of it, or what instruments see of it.
    refits : Refits
    """

    whitened: WhitenedRegression
    partition: Partition
    tests: tuple[Array, ...]
    gram: Array
    refits: Refits

    @property
    def y(self) -> Array:
        """Parameters of each fit in the coordinates of the regression, (F + 1, k)."""
        return self.whitened.centre + self.refits.delta

    @cached_property
    def values(self) -> Array:
        """Parameters of each fit, (F + 1, k)."""
        x: Array = self.y @ self.whitened.inverse.T
        return x

    @property
    def alone(self) -> FoldFits:
        """The fit to everything without the others."""
        assert isinstance(self.refits, UpdatedRefits)
        return replace(self, refits=self.refits.alone)

    def rows(self, move: Move) -> Array:
        """Return what a move denies, ``L y = 0`` with L (r, k); none if it is void."""
        return self.whitened.whiten(self.partition.rows(move))

    def after(self, move: Move) -> FoldFits:
        """Return the fits of the model after a move."""
        L, partition = self.rows(move), self.partition.apply(move)
        left = L @ self.refits.C @ L.T
        if len(L) == 1:  # as most are, thousands of times; it is its own eigenvector
            L = L[left[0] > SATISFIED]
        else:
            values, vectors = np.linalg.eigh(left)
            L = vectors[:, values > SATISFIED].T @ L
        refits = self.refits.constrain(L, partition.matrix) if len(L) else self.refits
        return replace(self, partition=partition, refits=refits)

    def costs(self, moves: Sequence[Move]) -> Array:
        """Return the rise of the estimator's loss per parameter that each move takes away."""
        rows = [self.partition.rows(m) for m in moves]
        if not rows:
            return np.empty(0)
        L = self.whitened.whiten(np.concatenate(rows))
        d = L @ self.y[0]
        variance = ((L @ self.refits.C) * L).sum(1)
        free = variance > SATISFIED
        single = np.where(free, d**2 / np.where(free, variance, 1.0), 0.0)
        costs, at = [], 0
        for r in rows:
            if len(r) == 1:
                costs.append(float(single[at]))
            else:
                rise, rank = self._rise(L[at : at + len(r)])
                costs.append(rise / max(rank, 1))
            at += len(r)
        return np.array(costs)

    def cost(self, move: Move) -> float:
        """Return the rise of the estimator's loss under a move; the sum of squares has no other."""
        return self._rise(self.rows(move))[0]

    def _rise(self, L: Array) -> tuple[float, int]:
        """Return the rise of the loss under more constraints L y = 0, and their rank."""
        d = L @ self.y[0]
        values, vectors = np.linalg.eigh(L @ self.refits.C @ L.T)
        free = values > SATISFIED
        return float(((vectors.T @ d)[free] ** 2 / values[free]).sum()), int(free.sum())

    def jackknife(self, move: Move) -> tuple[Array, Array]:
        """Return what a move denies (r,) and its covariance by leaving out folds (r, r)."""
        y = self.y @ self.rows(move).T
        F, ratio = len(y) - 1, self.whitened.folds.ratio
        apart = y[1:] - y[1:].mean(0)
        # Of fits without a share 1/F this is the (F - 1)/F of the jackknife.
        return y[0], apart.T @ apart / (F * ratio)

    @cached_property
    def score(self) -> Score:
        """What the model predicts of each fold."""
        free = np.linalg.solve(self.whitened.inverse, self.partition.matrix)
        turn = np.linalg.qr(free, mode="complete")[0]
        return self._score(self.refits.delta[None], turn, [free.shape[1]])[0]

    def _score(self, delta: Array, turn: Array, free: Sequence[int]) -> list[Score]:
        precision = self.refits.grams[1:] / self.whitened.unit
        own = delta[:, 1:]
        return self.whitened.score(self.tests, self.gram, precision, own, turn, np.asarray(free))

    def along(self, fixed: Array, models: Sequence[tuple[Partition, int]]) -> list[FoldFits]:
        """Return the fits of nested models, for what they say and not for more moves.

        Parameters
        ----------
        fixed : (r, k)
            All constraints ``fixed y = 0``, those of this fit first.
        models : sequence of (Partition, int)
            And how many of the constraints hold in each.
        """
        refits = self.refits
        assert isinstance(refits, UpdatedRefits)
        counts = [count for _, count in models]
        delta = refits.along(fixed, counts)
        fits = [
            replace(self, partition=p, refits=replace(refits, fixed=fixed[:r], delta=d))
            for (p, r), d in zip(models, delta, strict=True)
        ]
        turn = np.linalg.qr(fixed.T, mode="complete")[0][:, ::-1]
        scores = self._score(delta, turn, [self.whitened.size - count for count in counts])
        for fit, score in zip(fits, scores, strict=True):
            vars(fit)["score"] = score  # those of all models at once are a tenth of the work
        return fits

    def violations(self) -> int:
        """Return how many free parameters have a sign that physics forbids."""
        of = self.whitened
        size = max(float(np.linalg.norm(of.centre)), 1e-300)
        tiny = 1e-9 * np.linalg.norm(of.inverse, axis=1) * size
        return int((of.nonnegative & (self.values[0] < -tiny)).sum())


def whiten_regression(
    information: Information,
    full: Estimate,
    nonnegative: np.ndarray,
    variation: Array | None = None,
) -> WhitenedRegression:
    """Return the folds of a regression whose columns are independent.

    Parameters
    ----------
    information : Information
    full : Estimate
        Whose weights (n,) the actuators have, and whose estimator refits.
    nonnegative : (k,) bool
    variation : (n,), optional [(N·m)² or N²]
        Of the torque of each joint about its mean (`torque_errors.joint_weights`); by default the
        torque's sum of squares.

    Raises
    ------
    LogError
        If the logs are too short for folds.
    """
    k, squares = information.size, information.torque
    R = full.estimator.loss(information, full)
    length = float(np.linalg.norm(R[:, k]))
    R[k, k] = max(abs(R[k, k]), 1e-9 * length, 1e-300)
    inverse = np.linalg.inv(R)
    centre, turned = R[:k, k].copy(), inverse[:k, :k]
    equations = Equations.of(information, full, R, inverse)
    change = np.column_stack([np.vstack([turned, np.zeros(k)]), inverse[:, k] * R[k, k]])
    plain, floor = information, 1e-18 * squares.max(initial=0.0) + 1e-300
    noise, seen = np.maximum(full.variance * full.times, floor), np.empty((0, k, 2 * k + 1))
    estimator = full.estimator
    if information.instrumented:  # instruments say nothing of errors and are half of what is held
        if isinstance(estimator, InstrumentalVariables):
            left = combine(information, full.weights).left
            left = np.vstack([left, np.zeros((1, k))])
            right = np.vstack([np.zeros((k, k + 1)), change])
            both = np.hstack([left, right])
            seen = information.joint.products(1.0 / noise, left, both)
        wanted = np.eye(2 * k + 1)[:, k:]
        own = tuple(part.reduce(wanted) for part in information.parts)
        plain = replace(information, parts=own, instrumented=False)
    parts, bases = zip(*plain.of_actuators(change), strict=True)
    unit = noise_scale(information, full.weights, full.times, full.rss)
    return WhitenedRegression(
        columns=information.columns,
        inverse=turned,
        centre=centre,
        scale=float(R[k, k]),
        noise=noise,
        unit=max(unit, floor),
        parts=parts,
        bases=bases,
        seen=seen,
        variation=squares if variation is None else variation,
        folds=Folds.of(information, float(np.max(full.times))),
        nonnegative=np.asarray(nonnegative, bool),
        samples=information.samples,
        refitter=equations or Asked(full.estimator, information, turned, centre),
    )
