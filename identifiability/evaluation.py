"""Prediction errors of models: ε_RA in sample, on held-out logs, by blocked cross-validation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identifiability.information import Information
from identifiability.model import Regression
from identifiability.names import Array

#: Folds of the blocked cross-validation when there is one log.
FOLDS = 5

#: Stretches of time whose errors give the standard error of ε_RA.
STRETCHES = 20


@dataclass(frozen=True)
class Prediction:
    """Measured torque and its prediction by some models along logs.

    Attributes
    ----------
    t : tuple of (N_l,) [s]
        Times of each log.
    tau : (N, n) [N·m or N]
        Measured torque, logs one after the other.
    predicted : (N, n, m)
        Prediction of each of m models.
    log : (N,) int
        Which log a sample comes from.
    """

    t: tuple[Array, ...]
    tau: Array
    predicted: Array
    log: np.ndarray

    @property
    def residual(self) -> Array:
        """Measured less predicted torque, (N, n, m)."""
        return self.tau[:, :, None] - self.predicted

    def first(self, models: int) -> Prediction:
        """Return the prediction of the first few models."""
        return Prediction(self.t, self.tau, self.predicted[:, :, :models], self.log)

    def relative_error(self) -> Array:
        """Return ε_RA of each model, ``Σ|τ̂ - τ*| / Σ|τ* - mean τ*|`` [Díaz 2010, Eq. 18], (m,)."""
        error: Array = np.abs(self.residual).sum((0, 1)) / self._spread()
        return error

    def constant_error(self) -> float:
        """Return ε_RA of predicting each joint's mean torque: what any model must beat."""
        return float(np.abs(self.tau - self.tau.mean(0)).sum() / self._spread())

    def joint_error(self) -> Array:
        """Return the same for each joint by itself, (n, m)."""
        spread = np.abs(self.tau - self.tau.mean(0)).sum(0)
        error: Array = np.abs(self.residual).sum(0) / np.where(spread > 0, spread, np.nan)[:, None]
        return error

    def standard_error(self, against: int | None = None) -> Array:
        """Return the standard error of ε_RA, or of its difference to a model's, (m,).

        Errors of consecutive samples are dependent; sums over `STRETCHES` stretches of time are
        nearly not.
        """
        absolute = np.abs(self.residual).sum(1)
        if against is not None:
            absolute = absolute - absolute[:, [against]]
        parts = np.array_split(absolute, min(STRETCHES, len(absolute)))
        sums = np.array([p.sum(0) for p in parts])
        k = len(sums)
        if k < 2:
            return np.full(absolute.shape[1], np.nan)
        spread: Array = sums.std(0, ddof=1) * np.sqrt(k) / self._spread()
        return spread

    def _spread(self) -> float:
        total = float(np.abs(self.tau - self.tau.mean()).sum())
        return total if total > 0 else np.nan


def predict(regression: Regression, values: Array, folds: np.ndarray | None = None) -> Prediction:
    """Predict torque with base parameter values of m models.

    Parameters
    ----------
    regression : Regression
    values : (b, m) or (F, b, m)
        Base parameters of each model; with `folds`, one set for each fold.
    folds : (N,) int, optional
        Which set predicts a sample.
    """
    values = values if values.ndim == 3 else values[None]
    taus, predictions, logs = [], [], []
    at = 0
    for log, _, W, tau in regression.chunks():
        rows = slice(at, at + len(tau))
        at += len(tau)
        predicted = np.empty((*tau.shape, values.shape[2]))
        which = np.zeros(len(tau), int) if folds is None else folds[rows]
        for fold in np.unique(which):
            predicted[which == fold] = W[which == fold] @ values[fold]
        taus.append(tau)
        predictions.append(predicted)
        logs.append(np.full(len(tau), log))
    times = tuple(s.output_times() for s in regression.samples)
    return Prediction(
        times, np.concatenate(taus), np.concatenate(predictions), np.concatenate(logs)
    )


def choose_folds(information: Information) -> np.ndarray:
    """Return the fold of each block: whole logs where there are several, else stretches of one."""
    if information.log.max(initial=0) > 0:
        return information.log
    blocks = len(information.counts)
    return (np.arange(blocks) * min(FOLDS, blocks)) // blocks


def fold_of_samples(information: Information, folds: np.ndarray) -> np.ndarray:
    """Return the fold of each sample from that of its block, (N,)."""
    return np.repeat(folds, information.counts)


def leave_out(information: Information, folds: np.ndarray, fold: int) -> Information:
    """Return the information of all blocks but those of one fold."""
    kept = folds != fold
    return Information(
        information.columns, information.basis, information.gram[kept],
        information.counts[kept], information.log[kept],
    )  # fmt: skip


def parameter_error(value: Array, exact: Array, chosen: Sequence[bool] | np.ndarray) -> float:
    """Return ε_AV over the chosen parameters, ``mean |φ - φ̂|/|φ|`` [Díaz 2010, Eq. 19].

    The paper averages over all parameters; with exact values of zero that cannot be, and its
    numbers fit the mean over the properly identified ones.
    """
    used = np.asarray(chosen, bool) & (np.abs(exact) > 1e-12 * np.abs(exact).max(initial=0.0))
    if not used.any():
        return float("nan")
    return float(np.mean(np.abs((value[used] - exact[used]) / exact[used])))
