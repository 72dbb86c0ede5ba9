"""`Prediction`: measured and predicted torque along logs, and how far apart they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.estimation.error_sums import ErrorSums, Layout, Tally
from identifiability.estimation.noise.autocorrelation import autocorrelation_time
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.signals import is_constant

#: Stretches of time whose errors give the standard error of ε_RA, each at least so many
#: autocorrelation times of the error long, as long as `FEWEST` are left.
STRETCHES, MEMORIES, FEWEST = 20, 5.0, 4


@frozen
class Prediction:
    """Measured torque and its prediction by some models along logs.

    Errors are exact sums over every sample. Samples themselves are held as an excerpt: all of
    them where logs are short, else stretches of each log (`errorsums.EXCERPT`).

    Attributes
    ----------
    sums : ErrorSums
    t : tuple of (N_l,) [s]
        Times of the excerpt of each log.
    tau : (N, n) [N·m or N]
        Measured torque of the excerpt, logs one after the other.
    predicted : (N, n, m)
        Prediction of each of m models.
    log : (N,) int
        Which log a sample comes from.
    series : (N,) int
        Which stretch of consecutive samples.
    velocity : (N, n)
        Of the actuated joints.
    """

    sums: ErrorSums
    t: tuple[Array, ...]
    tau: Array
    predicted: Array
    log: np.ndarray
    series: np.ndarray
    velocity: Array

    @staticmethod
    def of(
        t: Sequence[Array],
        tau: Array,
        predicted: Array,
        log: np.ndarray,
        velocity: Array | None = None,
    ) -> Prediction:
        """Return the prediction of some samples that are all held.

        Parameters
        ----------
        t : sequence of (N_l,) [s]
        tau : (N, n)
        predicted : (N, n, m)
        log : (N,) int
        velocity : (N, n), optional
        """
        counts = [int((log == k).sum()) for k in range(len(t))]
        means = np.array([tau[log == k].sum(0) for k in range(len(t))])
        signal = ~is_constant(tau.min(0), tau.max(0))
        tally = Tally(Layout.of(counts, means, STRETCHES, signal), predicted.shape[2])
        for k in range(len(t)):
            tally.add(k, 0, tau[log == k], predicted[log == k])
        speed = np.zeros_like(tau) if velocity is None else velocity
        return Prediction(tally.sums(), tuple(t), tau, predicted, log, log, speed)

    @property
    def samples(self) -> int:
        """Number of samples that the errors are of."""
        return int(self.sums.counts.sum())

    @property
    def whole(self) -> bool:
        """Whether the excerpt is everything."""
        return len(self.tau) == self.samples

    @property
    def residual(self) -> Array:
        """Measured less predicted torque of the excerpt, (N, n, m)."""
        return self.tau[:, :, None] - self.predicted

    @property
    def rms(self) -> Array:
        """Root mean square of the measured torque of each joint, (n,)."""
        squares: Array = self.sums.torque_squares.sum(0)
        return np.sqrt(squares / max(self.samples, 1))

    def first(self, models: int) -> Prediction:
        """Return the prediction of the first few models."""
        return self.select(range(models))

    def select(self, models: Sequence[int]) -> Prediction:
        """Return the prediction of some models."""
        at = list(models)
        return Prediction(
            self.sums.select(at), self.t, self.tau, self.predicted[:, :, at], self.log,
            self.series, self.velocity,
        )  # fmt: skip

    def relative_error(self, log: int | None = None) -> Array:
        """Return ε_RA of each model, ``Σ|τ̂ - τ*| / Σ|τ* - mean τ*|`` [Díaz 2010, Eq. 18], (m,).

        NaN where there is nothing to explain.

        Parameters
        ----------
        log : int, optional
            Of one log by itself, relative to how much its own torque varies.
        """
        rows = slice(None) if log is None else self.sums.log == log
        deviation = self.sums.deviation if log is None else self.sums.local
        error: Array = self.sums.absolute[rows].sum((0, 1)) / _positive(deviation[rows].sum())
        return error

    def constant_error(self) -> float:
        """Return ε_RA of predicting each joint's mean torque: what any model must beat."""
        return float(self.sums.own.sum() / _positive(self.sums.deviation.sum()))

    def joint_error(self) -> Array:
        """Return the same for each joint by itself, (n, m)."""
        spread = self.sums.own.sum(0)
        error: Array = (
            self.sums.absolute.sum(0) / np.where(spread > 0, spread, np.nan)[:, None]
        )  # fmt: skip
        return error

    def standard_error(self, against: int | None = None) -> Array:
        """Return the standard error of ε_RA, or of its difference to a model's, (m,).

        Errors of consecutive samples are dependent; sums over stretches of time that are several
        autocorrelation times long are nearly not. No stretch crosses from one log to another.
        """
        error = np.abs(self.residual).sum(1)
        if against is not None:
            error = error - error[:, [against]]
        return standard_error(self.sums, self._memory(error), against)

    def _memory(self, error: Array) -> Array:
        """Return the autocorrelation time of each model's error, the longest of any series."""
        times = np.ones(error.shape[1])
        for k in np.unique(self.series):
            part = error[self.series == k]
            if len(part) > 1:
                times = np.maximum(times, autocorrelation_time(part))
        return times


def standard_error(sums: ErrorSums, memory: Array | float, against: int | None = None) -> Array:
    """Return the standard error of ε_RA, or of its difference to a model's, (m,).

    Parameters
    ----------
    sums : ErrorSums
    memory : float or (m,) [samples]
        Autocorrelation time of the error of each model.
    against : int, optional
    """
    absolute = sums.absolute.sum(1)
    if against is not None:
        absolute = absolute - absolute[:, [against]]
    least = MEMORIES * np.broadcast_to(memory, absolute.shape[1])
    spread = np.array([_scatter(sums, x, m) for x, m in zip(absolute.T, least, strict=True)])
    error: Array = spread / _positive(sums.deviation.sum())
    return error


def _scatter(sums: ErrorSums, x: Array, least: float) -> float:
    """Return the standard error of Σ x over stretches of at least so many samples."""
    first = sums.merge(least, FEWEST)
    counts = np.add.reduceat(sums.counts, first)
    total = np.add.reduceat(x, first)
    k = len(first)
    if k < 2:
        return float("nan")
    # Stretches differ in length: what counts is how far they are from their share of the sum.
    apart = total - counts * (total.sum() / counts.sum())
    return float(np.sqrt(k / (k - 1) * (apart**2).sum()))


def _positive(total: float) -> float:
    return float(total) if total > 0 else float("nan")
