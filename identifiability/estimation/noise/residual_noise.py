"""Noise that resembles a residual: autoregressive at each actuator, for simulated repetitions.

A residual looks whiter and smaller than the noise was, because slow noise is swallowed by the
columns that are fitted; on the motion of one log a correlation of 0.97 from sample to sample looks
like 0.75. So the noise is fitted beside these columns by restricted likelihood [Harville 1977].
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from identifiability.estimation.noise.autoregression import (
    JointRuns,
    Runs,
    autocovariance,
    colour,
    levinson,
    runs_of,
    take_data,
)
from identifiability.estimation.noise.restricted_likelihood import RestrictedLikelihood
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import signals
from identifiability.logs.prepare import Samples

#: Rows that are fitted; more tell nothing new of the noise.
MOST_ROWS = 20_000
#: White noise that is taken to be there beside the residual, as a share of its variance.
FLOOR = 1e-4
#: Singular values below this share of the largest are rounding.
RANK = 1e-9
#: A residual below this share of the torque is rounding, and has no correlation to speak of.
ROUNDING = 1e-8


@frozen
class ResidualNoise:
    """Stationary autoregressive noise; actuators are independent.

    Attributes
    ----------
    pacf : tuple of (p,)
        Partial autocorrelations of each actuator; empty for white noise.
    innovation : (n,) [N·m or N]
        Standard deviation of what is new in each sample.
    """

    pacf: tuple[Array, ...]
    innovation: Array

    @staticmethod
    def first_order(sd: Array, rho: float) -> ResidualNoise:
        """Return AR(1) noise of a size (n,) and a correlation from sample to sample."""
        return ResidualNoise(tuple(np.array([rho]) for _ in sd), sd * np.sqrt(1 - rho**2))

    @property
    def orders(self) -> tuple[int, ...]:
        """Order at each actuator."""
        return tuple(len(p) for p in self.pacf)

    @property
    def sd(self) -> Array:
        """Standard deviation of the noise at each actuator, (n,) [N·m or N]."""
        unit = [float(autocovariance(p, 0)[0]) for p in self.pacf]
        size: Array = self.innovation * np.sqrt(unit)
        return size

    @property
    def times(self) -> Array:
        """Integrated autocorrelation time at each actuator, (n,) [samples]."""
        out = []
        for p in self.pacf:
            predictors, _ = levinson(p)
            out.append(1.0 / (1.0 - predictors[-1].sum()) ** 2 / autocovariance(p, 0)[0])
        return np.array(out)

    def scaled(self, level: float) -> ResidualNoise:
        """Return the same noise of another size."""
        return ResidualNoise(self.pacf, level * self.innovation)

    def simulate(self, runs: Runs, rng: np.random.Generator) -> Array:
        """Return noise, each stretch by itself, (N, n).

        Parameters
        ----------
        runs : sequence of (start, stop)
            Stretches without gaps; together they are all samples.
        rng : numpy.random.Generator
        """
        out = rng.standard_normal((runs[-1][1], len(self.pacf)))
        for j, pacf in enumerate(self.pacf):
            for start, stop in runs:
                out[start:stop, j] = colour(out[start:stop, j], pacf)
        return out * self.innovation


def fit_residual_noise(tau: Array, W: Array, runs: Runs | JointRuns) -> ResidualNoise:
    """Return the noise of torque beside the columns that are fitted to it.

    Parameters
    ----------
    tau : (N, n)
    W : (N, n, k)
    runs : sequence of (start, stop)
        Stretches without gaps.
    """
    fits = []
    for j in range(tau.shape[1]):
        own, (y, X) = take_data(runs_of(runs, j), tau[:, j], W[:, j])
        shown = _first_rows(own, MOST_ROWS)
        rows = shown[-1][1] if shown else 0
        fits.append(_fit(y[:rows], X[:rows], shown) if rows else (np.empty(0), 0.0))
    return ResidualNoise(tuple(p for p, _ in fits), np.array([s for _, s in fits]))


def find_runs(samples: Sequence[Samples]) -> list[tuple[int, int]]:
    """Return the stretches without gaps of the rows of a regression, as (start, stop)."""
    runs: list[tuple[int, int]] = []
    start = 0
    for s in samples:
        t = s.output_times()
        breaks = np.flatnonzero(signals.has_gap(t)) + 1
        runs += pairwise([start, *(start + breaks).tolist(), start + len(t)])
        start += len(t)
    return runs


def _first_rows(runs: Runs, most: int) -> list[tuple[int, int]]:
    return [(a, min(b, most)) for a, b in runs if a < most]


def _fit(y: Array, X: Array, runs: Runs) -> tuple[Array, float]:
    """Return partial autocorrelations and innovation sd of y (N,) beside X (N, k), least BIC."""
    length = np.linalg.norm(X, axis=0)
    U, s, _ = np.linalg.svd(X[:, length > 0] / length[length > 0], full_matrices=False)
    basis = U[:, s > RANK * s.max(initial=0.0)]
    left = y - basis @ (basis.T @ y)
    if np.linalg.norm(left) <= ROUNDING * np.linalg.norm(y):
        return np.empty(0), float(np.linalg.norm(left) / np.sqrt(max(len(y) - basis.shape[1], 1)))
    problem = RestrictedLikelihood.of(y, basis, runs, FLOOR)
    best = problem.maximise()
    return np.tanh(best), problem.sigma(best)
