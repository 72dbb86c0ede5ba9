"""`ARNoise`: autoregressive noise of each joint, fitted beside whatever the dictionary explains.

Residuals of a fit look whiter than the noise was, because slow noise is swallowed by the columns.
The likelihood of what is left after projection (REML [Harville 1977]) has no such bias: it is
fitted beside the base model and the whole dictionary, so that a large slow effect is not taken
for slow noise either. Coefficients are held as partial autocorrelations, which keeps every model
stationary [Monahan 1984].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from identifiability.estimation.noise.autoregression import (
    JointRuns,
    Runs,
    autocovariance,
    colour_many,
    durbin,
    runs_of,
    take_data,
    whiten,
)
from identifiability.estimation.noise.restricted_likelihood import BOUND, RestrictedLikelihood
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

#: Order of the whitening filter when misfit is added to the noise.
MISFIT_ORDER = 8
#: Columns that explain the noise-free part may take at most this share of a joint's rows.
MOST_COLUMNS = 0.45
#: Directions of unit columns below this length are left to the noise.
THIN = 1e-3


@frozen
class JointNoise:
    """Noise of one joint.

    Attributes
    ----------
    theta : (p,)
        Inverse hyperbolic tangents of the partial autocorrelations.
    covariance : (p, p)
        Of theta, from the curvature of the likelihood.
    sigma : float [N·m or N]
        Standard deviation of the innovations.
    dof : float
        Degrees of freedom that sigma was estimated with.
    left : float [(N·m)² or N²]
        Variance of the residual beside base model and dictionary.
    """

    theta: Array
    covariance: Array
    sigma: float
    dof: float
    left: float

    @cached_property
    def _root(self) -> Array:
        """A root of the covariance, (p, p)."""
        vectors, squares, _ = np.linalg.svd(self.covariance)
        root: Array = vectors * np.sqrt(squares)
        return root

    @property
    def pacf(self) -> Array:
        """Partial autocorrelations, (p,)."""
        partial: Array = np.tanh(self.theta)
        return partial

    def beside(self, misfit: float) -> tuple[Array, float]:
        """Return partial autocorrelations and innovation sd of the noise plus a white misfit.

        Parameters
        ----------
        misfit : float [(N·m)² or N²]
            Variance of what the model does not explain yet.
        """
        if misfit <= 0:
            return self.pacf, self.sigma
        covariance = self.sigma**2 * autocovariance(self.pacf, MISFIT_ORDER)
        covariance[0] += misfit
        return durbin(covariance)

    def draw(self, rng: np.random.Generator) -> tuple[Array, float]:
        """Return partial autocorrelations and sigma as uncertain as the data leave them."""
        theta = self.theta
        if len(theta):
            theta = np.clip(theta + self._root @ rng.standard_normal(len(theta)), -BOUND, BOUND)
        return np.tanh(theta), self.sigma * float(np.sqrt(self.dof / rng.chisquare(self.dof)))


@frozen
class ARNoise:
    """Noise of all joints; joints are independent."""

    joints: tuple[JointNoise, ...]

    def whiten(self, values: Array, runs: Runs | JointRuns, misfit: Array | None = None) -> Array:
        """Return values (N, n) or (N, n, k) whose noise would be white with unit variance.

        `misfit` (n,) is the variance of what the model does not explain yet, taken as white: while
        it is large the rows weigh as in ordinary least squares.
        """
        out = np.empty_like(values)
        for j, noise in enumerate(self.joints):
            pacf, sigma = noise.beside(0.0 if misfit is None else float(misfit[j]))
            out[:, j] = whiten(values[:, j], runs_of(runs, j), pacf) / sigma
        return out

    def misfit(self, residual: Array, rows: Array | None = None) -> Array:
        """Return the variance of a residual (N, n) that noise does not explain, (n,).

        `rows` (n,) are those of each joint that are data; the residual is zero in the others.
        """
        left = np.array([j.left for j in self.joints])
        square = np.sum(residual**2, axis=0) / (len(residual) if rows is None else rows)
        excess: Array = np.maximum(square - 2 * left, 0.0)
        return excess

    def simulate(
        self,
        count: int,
        draws: int,
        rng: np.random.Generator,
        runs: Runs | JointRuns,
        precision: type[np.floating[Any]] = np.float64,
    ) -> Array:
        """Return noise (count, n, draws) with coefficients as uncertain as the data leave them.

        It is zero between the stretches.
        """
        out = np.zeros((count, len(self.joints), draws), precision)
        if not draws:
            return out
        for j, noise in enumerate(self.joints):
            drawn = [noise.draw(rng) for _ in range(draws)]
            pacf = np.array([p for p, _ in drawn]).T
            e = rng.standard_normal((count, draws))
            size = np.array([sigma for _, sigma in drawn])
            for start, stop in runs_of(runs, j):
                out[start:stop, j] = colour_many(e[start:stop], pacf) * size
        return out


def fit_noise(
    tau: Array, blocks: Callable[[int], Sequence[Array]], runs: Runs | JointRuns
) -> ARNoise:
    """Return the noise of every joint beside columns that may explain its torque.

    Parameters
    ----------
    tau : (N, n)
    blocks : callable(joint) -> sequence of (N, k)
        What acts in a joint: base model, then the families of the dictionary, the ones that must
        not be left out first.
    runs : sequence of (start, stop)
        Stretches without gaps.
    """
    return ARNoise(tuple(fit_joint(y, blocks(j), runs_of(runs, j)) for j, y in enumerate(tau.T)))


def fit_joint(y: Array, blocks: Sequence[Array], runs: Runs) -> JointNoise:
    """Return the noise of one joint; the order is the one with the least BIC."""
    runs, (y, *blocks) = take_data(runs, y, *blocks)
    if not len(y):
        return JointNoise(np.empty(0), np.empty((0, 0)), 1.0, 1.0, 0.0)
    problem = RestrictedLikelihood.of(y, _span(blocks, int(MOST_COLUMNS * len(y))), runs)
    best = problem.maximise()
    sigma = problem.sigma(best)
    return JointNoise(best, problem.spread(best), sigma, float(problem.dof), problem.left)


def _span(blocks: Sequence[Array], most: int) -> Array:
    """Return an orthonormal basis (N, k) of blocks of columns, block by block while there is room.

    Of a block that does not fit whole the directions that stand out most are taken.
    """
    basis = np.empty((len(blocks[0]), 0))
    for block in blocks:
        length = np.linalg.norm(block, axis=0)
        unit = block[:, length > 0] / length[length > 0]
        left = unit - basis @ (basis.T @ unit)
        left -= basis @ (basis.T @ left)
        if not left.shape[1] or basis.shape[1] >= most:
            continue
        U, s, _ = np.linalg.svd(left, full_matrices=False)
        count = min(int((s > THIN).sum()), most - basis.shape[1])
        basis = np.column_stack([basis, U[:, :count]])
    return basis
