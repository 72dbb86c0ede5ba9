"""`Errors`: what a model of the path does on motion that its fits have not seen."""

from __future__ import annotations

import numpy as np

from identifiability.estimation.worse import surely_above
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen


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


def _spread(held: Array, scatter: Array) -> Array:
    """Return the standard error of sums over stretches (S, …) and folds (F, …)."""
    # With one log, stretches and folds are the same pieces and their errors rise together.
    parts = [held + scatter] if len(held) == len(scatter) else [held, scatter]
    variances = [x.var(axis=0, ddof=1) * len(x) for x in parts if len(x) > 1]
    spread: Array = np.sqrt(np.sum(variances, axis=0))
    return spread
