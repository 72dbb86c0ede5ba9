"""`Folds`: rows of a model that are left out in turn, compressed once for all fits without one.

And `Made`: what came of them, for the same models are asked for again and again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from identifiability.estimation.estimate import estimate
from identifiability.estimation.estimator import Estimate
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.workflows.diagnose.rows import Candidate, Key

#: Rows of a fold for each of its columns beyond which it is held by factors.
TALL = 2
#: Models whose compressed rows are kept.
REMEMBERED = 4

#: A model that is fitted: what is added to the base model, in the order of the values.
Model = tuple[tuple[Key, bool], ...]


def name_model(chosen: Sequence[Candidate]) -> Model:
    """Return what a model with some candidates is, whatever numbers their columns have."""
    return tuple((c.key, c.positive) for c in chosen)


@frozen
class Folds:
    """What the rows of each fold say of some columns.

    A fold of far more rows than columns is held by the triangular factors of its joints, whose
    products are those of the rows: leaving each of F folds out in turn then costs one pass over the
    rows, not F - 1. Factors, not Gram matrices: a column that acts in one fold alone stays exactly
    zero in the others.

    Attributes
    ----------
    parts : tuple of (m, n, k + 1)
        Of each fold: columns and torque, of its rows or of what holds them.
    counts : tuple of int
        Rows of each fold.
    """

    parts: tuple[Array, ...]
    counts: tuple[int, ...]

    @staticmethod
    def of(rows: Array, folds: np.ndarray) -> Folds:
        """Return the folds of columns and torque (N, n, k + 1); `folds` (N,) ascends from 0."""
        counts = np.bincount(folds).tolist()
        edges = np.cumsum([0, *counts]).tolist()
        return Folds(tuple(_compress(rows[a:b]) for a, b in pairwise(edges)), tuple(counts))

    @property
    def width(self) -> int:
        """Columns and torque."""
        return int(self.parts[0].shape[2])

    def rows(self, left_out: int | None = None) -> Array:
        """Return rows (·, k + 1) with the products of all rows, or of all but those of a fold."""
        kept = [part for k, part in enumerate(self.parts) if k != left_out]
        rows: Array = np.concatenate(kept).reshape(-1, self.width)
        return rows

    def fit(self, left_out: int | None = None) -> tuple[Information, Estimate]:
        """Return what all rows say, or all but those of one fold, and the free fit to that.

        Kept: a fit of a real robot, and one beside known values, begin with it again.
        """
        if left_out not in self._fits:
            information = self._without(left_out)
            self._fits[left_out] = information, estimate(information)
        return self._fits[left_out]

    @cached_property
    def _fits(self) -> dict[int | None, tuple[Information, Estimate]]:
        return {}

    def _without(self, fold: int | None) -> Information:
        kept = [k for k in range(len(self.parts)) if k != fold]
        rows = np.concatenate([self.parts[k] for k in kept])
        samples = np.array([sum(self.counts[k] for k in kept)])
        found = _information_of(rows)
        return replace(found, counts=samples, data=np.tile(samples[:, None], found.actuators))


@dataclass
class Made:
    """What was fitted to some rows with some noise.

    Attributes
    ----------
    folds : dict
        The last models' rows: folds and bounds ask for the same ones again.
    values : dict
        Of a model, without a fold or none, of a real robot or not, beside the values of another.
    errors : dict
        Of what it has, in whatever order, of a real robot or not, beside the values of another.
    """

    folds: dict[Model, Folds] = field(default_factory=dict)
    values: dict[tuple[Model, int | None, bool, Model | None], Array] = field(default_factory=dict)
    errors: dict[tuple[frozenset[tuple[Key, bool]], bool, Model | None], Array] = field(
        default_factory=dict
    )

    def recall(self, before: Made) -> None:
        """Take over what was made before of the same rows with the same noise."""
        self.folds.update(before.folds)
        self.values.update(before.values)
        self.errors.update(before.errors)


def _compress(rows: Array) -> Array:
    """Return rows (N, n, k + 1), or triangular factors of each joint's, (k + 1, n, k + 1)."""
    if len(rows) <= TALL * rows.shape[2]:
        return rows
    factors: Array = np.asarray(np.linalg.qr(rows.swapaxes(0, 1), mode="r"))
    return factors.swapaxes(0, 1)


def _information_of(rows: Array) -> Information:
    """Return the information of columns and torque (m, n, k + 1)."""
    names = tuple(map(str, range(rows.shape[2] - 1)))
    W, tau = rows[:, :, :-1], rows[:, :, -1]
    return Information.of_rows(names, W, tau, np.zeros(len(rows), int), len(rows))
