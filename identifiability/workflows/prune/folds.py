"""What nested models of one regression predict of folds, from `Information` alone.

Every model is the full one under linear constraints (a column zero, two columns equal); its fits
to everything and to each fold's rest are the estimator's own (`estimation.refits`). The coordinates
are those in which the full information is the unit matrix: nothing is lost by squaring. Models of a
path are nested, so one triangular factor a fold scores them all (`evidence.nested_density`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from identifiability.estimation.estimator import Estimate
from identifiability.estimation.evidence import Folds, Score, nested_density
from identifiability.estimation.instrumental import InstrumentalVariables, combine
from identifiability.estimation.least_squares import noise_scale
from identifiability.estimation.refits import Asked, Equations, Refits
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.information import ActuatorBlocks, Information
from identifiability.workflows.prune.moves import Move, Partition

#: Instruments see nothing of a direction below this share of what they see best.
UNSEEN: Tolerance = 1e-10


@frozen
class Step:
    """A model on the path.

    Attributes
    ----------
    partition : Partition
    score : Score
        What it predicts of each fold, fitted to the rest.
    values : (F + 1, k)
        All columns, fitted to everything, then to the rest of each fold.
    move : Move or None
        What led here; None for the start.
    """

    partition: Partition
    score: Score
    values: Array
    move: Move | None = None

    @property
    def density(self) -> float:
        """Predictive log density of all folds [nats]."""
        return float(self.score.density.sum())


@frozen(kw_only=True)
class WhitenedRegression:
    """Blocks of a regression in coordinates ``y = R x`` in which the full information is I.

    Attributes
    ----------
    columns : tuple of str
        The k that the motion excites.
    inverse : (k, k)
        ``x = inverse @ y``.
    centre : (k,)
        y of the full fit.
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
    samples : int
        Of the logs.
    refitter : Equations or Asked
        What refits: equations of the estimator, or the estimator itself.
    """

    columns: tuple[str, ...]
    inverse: Array
    centre: Array
    noise: Array
    unit: float
    parts: tuple[ActuatorBlocks, ...]
    bases: tuple[Array, ...]
    seen: Array
    variation: Array
    folds: Folds
    samples: int
    refitter: Equations | Asked

    def _see(self, tests: Sequence[Array], weights: Array) -> Array:
        """Return what densities are of, ``[Y, e]ᵀ [Y, e]`` of each fold, (F, k + 1, k + 1).

        Noise in the motion is in columns and errors alike: a model that fits it would predict the
        log's torque better and the robot's worse. Where there are instruments, all is projected on
        what they see: they have no part in it.
        """
        if not len(self.seen):
            each = zip(tests, self.bases, self.noise, strict=True)
            return np.asarray(sum(basis.T @ test @ basis / noise for test, basis, noise in each))
        k, out = len(self.columns), []
        for f in range(self.folds.count):
            own = np.tensordot((self.folds.test == f) * weights, self.seen, 1)
            values, vectors = np.linalg.eigh(own[:, :k])
            good = values > UNSEEN * values.max(initial=0.0)
            half = (vectors[:, good] / np.sqrt(values[good])).T @ own[:, k:]
            out.append(half.T @ half)
        return np.stack(out)

    def fit(self, counts: Array | None = None) -> FoldFits:
        """Return the fits of all columns to everything and to each fold's rest.

        Parameters
        ----------
        counts : (B,), optional
            How often each block counts, for a bootstrap replicate.
        """
        folds = self.folds
        weights = np.ones(len(folds.test)) if counts is None else counts
        tests = tuple(part.merge_weighted(folds.test, weights) for part in self.parts)
        refits = self.refitter.start(folds.train, counts)
        return FoldFits(self, tests, self._see(tests, weights), refits)


@frozen
class FoldFits:
    """Fits of all columns to everything (first) and to the rest of each of F folds.

    Attributes
    ----------
    whitened : WhitenedRegression
    tests : tuple of (F, r, r)
        ``Zᵀ Z`` of what each fold predicts, of each joint.
    gram : (F, k + 1, k + 1)
        What densities are of: all of it, or what instruments see of it.
    refits : Refits
    """

    whitened: WhitenedRegression
    tests: tuple[Array, ...]
    gram: Array
    refits: Refits

    def along(self, path: Sequence[tuple[Move | None, Partition]]) -> list[Step]:
        """Return nested models with their fits, and what these predict of the folds.

        Parameters
        ----------
        path : sequence of (Move, Partition)
            What led to each model, of all columns first.
        """
        own = self.whitened
        k, partitions = len(own.columns), [partition for _, partition in path]
        rows = [before.rows_to(after) for before, after in pairwise(partitions)]
        fixed = np.concatenate([np.empty((0, k)), *rows]) @ own.inverse
        fixed /= np.linalg.norm(fixed, axis=1, keepdims=True)
        turn = np.linalg.qr(fixed.T, mode="complete")[0][:, ::-1]
        free = np.array([len(partition) for partition in partitions])
        delta = self.refits.along(turn, free, [partition.matrix for partition in partitions])
        values = (own.centre + delta) @ own.inverse.T
        steps = zip(path, self._score(delta[:, 1:], turn, free), values, strict=True)
        return [Step(p, score, value, move) for (move, p), score, value in steps]

    def _score(self, delta: Array, turn: Array, free: np.ndarray) -> list[Score]:
        """Return what models predict whose fits to the rests are off the full one, (M, F, k)."""
        own = self.whitened
        change = np.concatenate([-delta, np.ones((*delta.shape[:2], 1))], 2)
        squares = np.empty((*delta.shape[:2], len(self.tests)))
        for a, (test, basis) in enumerate(zip(self.tests, own.bases, strict=True)):
            left = (change @ basis.T).swapaxes(0, 1)
            squares[:, :, a] = ((left @ test) * left).sum(2).T
        precision = self.refits.grams[1:] / own.unit
        density = nested_density(self.gram, precision, delta, turn, free)
        return [
            Score(d, s, own.variation, own.folds.ratio)
            for d, s in zip(density, squares, strict=True)
        ]


def whiten_regression(
    information: Information, full: Estimate, variation: Array | None = None
) -> WhitenedRegression:
    """Return the folds of a regression whose columns are independent.

    Parameters
    ----------
    information : Information
    full : Estimate
        Whose weights (n,) the actuators have, and whose estimator refits.
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
    if information.instrumented:  # instruments say nothing of errors and are half of what is held
        if isinstance(full.estimator, InstrumentalVariables):
            left = combine(information, full.weights).left
            left = np.vstack([left, np.zeros((1, k))])
            right = np.vstack([np.zeros((k, k + 1)), change])
            both = np.hstack([left, right])
            seen = information.joint.products(1.0 / noise, left, both)
        wanted = np.eye(2 * k + 1)[:, k:]
        own = tuple(part.reduce(wanted) for part in information.parts)
        plain = replace(information, parts=own, instrumented=False, echo=None)
    parts, bases = zip(*plain.of_actuators(change), strict=True)
    unit = noise_scale(information, full.weights, full.times, full.rss)
    return WhitenedRegression(
        columns=information.columns,
        inverse=turned,
        centre=centre,
        noise=noise,
        unit=max(unit, floor),
        parts=parts,
        bases=bases,
        seen=seen,
        variation=squares if variation is None else variation,
        folds=Folds.of(information, float(np.max(full.times))),
        samples=information.samples,
        refitter=equations or Asked(full.estimator, information, turned, centre),
    )
