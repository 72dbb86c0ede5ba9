"""Errors on motion that was not fitted: held-out logs, or one log or stretch left out at a time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identifiability.diagnosis.rows import Candidate, Rows
from identifiability.names import Array

#: Stretches that one log is divided into when there is no other.
FOLDS = 5
#: Stretches of time whose errors are resampled for intervals.
STRETCHES = 24


@dataclass(frozen=True)
class Gap:
    """Prediction errors of several models on the same unseen rows.

    Attributes
    ----------
    tau : (N, n)
        Measured torque.
    residual : (N, n, m)
    rows : Rows
        Where they are.
    """

    tau: Array
    residual: Array
    rows: Rows

    def relative_error(self) -> Array:
        """Return ε_RA of each model [Díaz 2010, Eq. 18], (m,)."""
        error: Array = np.abs(self.residual).sum((0, 1)) / self._spread()
        return error

    def interval(
        self, first: int, second: int, rng: np.random.Generator, draws: int = 2000
    ) -> tuple[float, float]:
        """Return the 95 % interval of the change of ε_RA from one model to another.

        Whole stretches of time are drawn again and again [Künsch 1989].
        """
        both = np.abs(self.residual[:, :, [first, second]]).sum(1)
        parts = [p for p in np.array_split(both, STRETCHES) if len(p)]
        spread = np.abs(self.tau - self.tau.mean()).sum(1)
        size = np.array([p.sum() for p in np.array_split(spread, STRETCHES) if len(p)])
        change = np.array([float(np.sum(p[:, 1] - p[:, 0])) for p in parts])
        counts = rng.multinomial(len(parts), np.full(len(parts), 1 / len(parts)), size=draws)
        ratio = (counts @ change) / (counts @ size)
        low, high = np.quantile(ratio, [0.025, 0.975])
        return float(low), float(high)

    def _spread(self) -> float:
        return float(np.abs(self.tau - self.tau.mean()).sum()) or float("nan")


@dataclass(frozen=True)
class HeldOut:
    """Fits on some rows, predicts others.

    Attributes
    ----------
    train : Rows
    validation : Rows or None
        Rows of held-out logs; None for cross-validation.
    """

    train: Rows
    validation: Rows | None

    @property
    def kind(self) -> str:
        """In words."""
        if self.validation is not None:
            return "on motion that was not fitted, though it helped to choose the name,"
        if self.train.log.max(initial=0) > 0:
            return "by leaving out one log at a time"
        return "by leaving out one stretch of the log at a time"

    def error(self, chosen: Sequence[Candidate]) -> float:
        """Return the mean absolute error, every joint in units of its own noise."""
        residual = self.residual(chosen)
        scale = np.sqrt(np.mean(self.residual(()) ** 2, axis=0)) if chosen else None
        scale = np.sqrt(np.mean(residual**2, axis=0)) if scale is None else scale
        return float(np.mean(np.abs(residual) / np.where(scale > 0, scale, 1.0)))

    def residual(self, chosen: Sequence[Candidate]) -> Array:
        """Return the errors of the model with some candidates on unseen rows, (N, n)."""
        if self.validation is not None:
            value = fit_weighted(self.train, chosen)
            left: Array = self.validation.tau - self.validation.columns(chosen) @ value
            return left
        folds = self.folds()
        columns = self.train.columns(chosen)
        out = np.array(self.train.tau)
        for fold in np.unique(folds):
            test = folds == fold
            value = fit_weighted(self.train, chosen, ~test)
            out[test] -= columns[test] @ value
        return out

    def folds(self) -> np.ndarray:
        """Return the fold of every training row."""
        if self.train.log.max(initial=0) > 0:
            return self.train.log
        return (np.arange(len(self.train)) * FOLDS) // len(self.train)

    def gap(self, models: Sequence[Sequence[Candidate]]) -> Gap:
        """Return the errors of several models side by side."""
        residual = np.stack([self.residual(m) for m in models], axis=2)
        where = self.validation if self.validation is not None else self.train
        return Gap(where.measured, residual, where)

    def fitted_residual(self, chosen: Sequence[Candidate]) -> Array:
        """Return the errors on the rows that were fitted, (N, n)."""
        value = fit_weighted(self.train, chosen)
        left: Array = self.train.tau - self.train.columns(chosen) @ value
        return left

    def fitted_gap(self, models: Sequence[Sequence[Candidate]]) -> Gap:
        """Return the errors of several models on the rows they were fitted to."""
        parts = [self.fitted_residual(m) for m in models]
        return Gap(self.train.measured, np.stack(parts, axis=2), self.train)


def fit_weighted(rows: Rows, chosen: Sequence[Candidate], mask: np.ndarray | None = None) -> Array:
    """Return least-squares values, joints weighted by their own residual variance, (m,)."""
    W, tau = rows.columns(chosen), rows.tau
    if mask is not None:
        W, tau = W[mask], tau[mask]
    m = W.shape[2]
    if not m:
        return np.empty(0)
    length = np.sqrt(np.einsum("ijk,ijk->k", W, W))
    W = W / np.where(length > 0, length, 1.0)
    weight: Array = np.ones(tau.shape[1])
    value: Array = np.zeros(m)
    for _ in range(2):
        A = (W * weight[:, None]).reshape(-1, m)
        value = np.linalg.lstsq(A, (tau * weight).ravel(), rcond=1e-8)[0]
        rms = np.sqrt(np.mean((tau - W @ value) ** 2, axis=0))
        weight = 1.0 / np.maximum(rms, 1e-9 * (rms.max() or 1.0))
    scaled: Array = value / np.where(length > 0, length, 1.0)
    return scaled
