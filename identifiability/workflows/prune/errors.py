"""`Errors`: what a model of the path does on motion that its fits have not seen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.estimation.worse import surely_above
from identifiability.foundation.linalg import triangular_factor
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.actuator_blocks import ActuatorBlocks
from identifiability.regression.information import Information

#: `Folds.scored` and `Folds.unseen`.
Scored = tuple[tuple[ActuatorBlocks, Array, Array], ...]
Unseen = tuple[tuple[Array, np.ndarray], ...]


@frozen
class Errors:
    """Squares on motion that the fits have not seen, every joint on its own scale.

    A model is judged by their sum, and by each joint: where one joint is hard to predict, its
    scatter would hide what a model does to the others.

    Attributes
    ----------
    held : (S, n)
        Of each stretch under the fit to the others.
    scatter : (F, n)
        What the scatter of the fits does on states drawn from the ranges of the log, by fold.
    """

    held: Array
    scatter: Array

    @property
    def total(self) -> float:
        """The sum of all."""
        return float(self.held.sum() + self.scatter.sum())

    @property
    def by_joint(self) -> Array:
        """The sum of each joint, (n,)."""
        total: Array = self.held.sum(0) + self.scatter.sum(0)
        return total

    @property
    def standard_error(self) -> float:
        """Standard error of the total, from the scatter over stretches and folds."""
        return float(_spread(self.held.sum(1), self.scatter.sum(1)))

    def above(self, other: Errors) -> tuple[float, float]:
        """Return by how much the total is larger than another's, and the SE of that."""
        held, scatter = self.held - other.held, self.scatter - other.scatter
        rise = float(held.sum() + scatter.sum())
        return rise, float(_spread(held.sum(1), scatter.sum(1)))

    def as_good(self, other: Errors) -> bool:
        """Return whether neither the total nor any joint is surely above another model's."""
        rise, spread = self.above(other)
        return rise <= spread and not bool(self.joints_above(other).any())

    def near(self, other: Errors) -> bool:
        """Return whether total and joints stay within the standard errors of another's own."""
        within = self.total <= other.total + other.standard_error
        return within and not bool(self.joints_above(other).any())

    def joints_above(self, other: Errors) -> np.ndarray:
        """Return the joints that surely rise, (n,) bool."""
        held, scatter = self.held - other.held, self.scatter - other.scatter
        same = len(held) == len(scatter)
        rise = held + (scatter if same else scatter.sum(0) / len(held))
        return surely_above(rise, other.by_joint)


def measure_errors(
    scored: Scored, unseen: Unseen, grams: Sequence[Array], fold: np.ndarray, moved: Array
) -> list[Errors]:
    """Return the held-out errors of M models.

    Parameters
    ----------
    scored, unseen, fold
        Of the folds.
    grams : sequence of (S, r, r)
        Of each stretch, of each joint.
    moved : (M, F, k)
        Values of the fits without each fold, less those of the full one.
    """
    M, F, _ = moved.shape
    apart = moved - moved.mean(1, keepdims=True)
    held = np.empty((M, len(fold), len(grams)))
    scatter = np.empty((M, F, len(grams)))
    joints = zip(scored, grams, unseen, strict=True)
    for a, ((part, columns, rest), gram, (root, at)) in enumerate(joints):
        left = (rest - moved[:, :, part.columns] @ columns.T).swapaxes(0, 1)[fold]
        held[:, :, a] = ((left @ gram) * left).sum(2).T
        scatter[:, :, a] = (F - 1) / F * ((apart[:, :, at] @ root.T) ** 2).sum(2)
    return [Errors(*each) for each in zip(held, scatter, strict=True)]


def _spread(held: Array, scatter: Array) -> Array:
    """Return the standard error of sums over stretches (S, …) and folds (F, …)."""
    # With one log, stretches and folds are the same pieces and their errors rise together.
    parts = [held + scatter] if len(held) == len(scatter) else [held, scatter]
    variances = [x.var(axis=0, ddof=1) * len(x) for x in parts if len(x) > 1]
    spread: Array = np.sqrt(np.sum(variances, axis=0))
    return spread


def score_joints(information: Information, scale: Array, rest: Array) -> Scored:
    """Return `Folds.scored`, `rest` (k + 1,) being what gives the full fit's residual."""
    parts, k = information.parts, information.size
    if information.instrumented:  # these say nothing of errors and are half of what is held
        wanted = np.eye(2 * k + 1)[:, k:]
        parts = tuple(part.reduce(wanted) for part in parts)
    return tuple(
        (part, root * part.basis[:, :-1], root * part.basis @ rest[[*part.columns, k]])
        for part, root in zip(parts, scale, strict=True)
    )


def factor_unseen(unseen: Array | None, weights: Array, samples: int) -> Unseen:
    """Return `Folds.unseen`; in a tree a joint feels the bodies that it moves alone."""
    if unseen is None or not len(unseen):
        return ((np.zeros((0, 0)), np.zeros(0, int)),) * len(weights)
    scale = np.sqrt(weights * (samples / len(unseen)))
    acts = [np.flatnonzero(rows.any(0)) for rows in unseen.swapaxes(0, 1)]
    return tuple(
        (triangular_factor(unseen[:, a, at] * root), at)
        for a, (at, root) in enumerate(zip(acts, scale, strict=True))
    )
