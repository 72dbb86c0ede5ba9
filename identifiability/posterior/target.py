"""The posterior of the parameters, in the coordinates where its Gaussian is diagonal.

A `Prior` states the user's knowledge before the data: a normal distribution per parameter.
"""

from __future__ import annotations

from functools import cached_property
from typing import Self

import numpy as np

from identifiability.foundation.linalg import ROUNDOFF, or_one
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical.fitted_model import Fixed, LeastSquares, PhysicalSet
from identifiability.physical.pseudo_inertia import THIN

# Prior knowledge of the user: a normal distribution per parameter.


#: A body is at least this thick, as a share of its second moment, where a scale is taken from it.


@frozen
class Prior:
    """Independent normal priors.

    Attributes
    ----------
    mean : (p,)
    sd : (p,) > 0
    """

    mean: Array
    sd: Array

    @classmethod
    def around(cls, phi: Array, bodies: np.ndarray, relative: float, floor: Array) -> Self:
        """Prior around a nominal robot, with each sd a share of the body's scale.

        Moments of inertia and the mass are their own scales. Products of inertia and first moments
        have the most that a body may have: ``√(Σxx Σyy)`` and ``√(m Σxx)`` with the second moment Σ
        of the material along each axis. An equal scale along all axes would give a rod's prior the
        width of a ball's: around a thin body almost all possible bodies are then thicker. That
        pulls the measured combinations too (1.3 standard deviations on an arm).

        Parameters
        ----------
        phi : (p,)
        bodies : (nb, 10) int
        relative : float
        floor : (p,)
            sd of the other parameters that are zero in `phi`; the rest get ``relative · |phi|``.
        """
        size = np.abs(phi)
        sd = np.where(size > 0, relative * size, floor)
        theta = phi[bodies]
        mass = np.abs(theta[:, 9])
        inertia = np.abs(theta[:, [0, 3, 5]])
        second = inertia.sum(axis=1)[:, None] / 2
        stated = (mass > 0) & (second[:, 0] > 0)
        if not stated.all():
            body = int(np.argmin(stated))
            raise ValueError(
                f"prior around CAD: body {body + 1} has no mass or no inertia; expected nominal "
                "values to take a scale from; state mean and sd of this body yourself."
            )
        along = np.maximum(second - inertia, THIN * second)
        root = np.sqrt(np.column_stack([along, mass]))
        first = root[:, [0, 0, 0, 1, 1, 2, 0, 1, 2, 3]]
        size = first * root[:, [0, 1, 2, 1, 2, 2, 3, 3, 3, 3]]
        size[:, [0, 3, 5]] = np.maximum(inertia, THIN * second)
        sd[bodies] = relative * size
        return cls(phi, sd)


# The posterior of the parameters, in the coordinates where its Gaussian is diagonal.
#
# Likelihood: normal errors whose variance v is unknown and marginalised, a Student-t in
# ``‖R phi − z‖``. The data count independent samples alone (`LeastSquares.likelihood`):
#
# v | phi ~ InvGamma((dof + b) / 2, (‖R phi − z‖² + rss_min) / 2), b = rank R
# phi | v ~ Normal (least squares × prior), restricted to the physical set
#
# This is the textbook posterior under the prior 1/σ² [Gelman 2013, §14.2].


@frozen
class Diagonal:
    """The posterior without its constraints: a standard normal prior seen through diagonal data.

    Attributes
    ----------
    gain : (p,) [torque]
        Coordinate i is measured as ``signal[i] = gain[i] eta[i] + noise``; zero where the data are
        blind.
    signal : (p,) or (K, p) [torque]
        One data set, or one for each of K chains.
    rss_min : float or (K,) [torque²]
        What no parameters explain.
    shape : float
        ``(dof + b) / 2``, shape of the inverse gamma of the noise variance.
    variance : float, optional [torque²]
        The noise variance, when it is known.
    """

    gain: Array
    signal: Array
    rss_min: float | Array
    shape: float
    variance: float | None

    def conditional(self, v: Array) -> tuple[Array, Array]:
        """Gaussian of ``eta`` given the noise variance.

        Parameters
        ----------
        v : (K,) [torque²]

        Returns
        -------
        mean, sd : (K, p)
        """
        precision = self.gain**2 + v[:, None]
        return self.gain * self.signal / precision, np.sqrt(v[:, None] / precision)

    def typical_variance(self, eta: Array) -> Array:
        """Noise variance (K,) [torque²] that is likely at coordinates ``(K, p)``."""
        if self.variance is not None:
            return np.full(len(eta), self.variance)
        return self.rss(eta) / 2 / self.shape

    def draw_variance(self, eta: Array, rng: np.random.Generator) -> Array:
        """Draw the noise variance given the parameters.

        Parameters
        ----------
        eta : (K, p)
        rng : numpy.random.Generator

        Returns
        -------
        (K,) [torque²]
        """
        if self.variance is not None:
            return np.full(len(eta), self.variance)
        return self.rss(eta) / 2 / rng.gamma(self.shape, size=len(eta))

    def log_density(self, eta: Array) -> Array:
        """Logarithm of likelihood × prior ``(K,)`` of coordinates ``(K, p)``, up to a constant."""
        prior: Array = -0.5 * np.einsum("kp,kp->k", eta, eta)
        if self.variance is not None:
            return prior - self.rss(eta) / (2 * self.variance)
        return prior - self.shape * np.log(self.rss(eta))

    def rss(self, eta: Array) -> Array:
        """Residual sum of squares ``(K,)`` [torque²] of coordinates ``(K, p)``."""
        residual = self.signal - self.gain * eta
        return np.einsum("kp,kp->k", residual, residual) + self.rss_min


@frozen
class Target:
    """The posterior: the likelihood of the data, the prior, and the set of possible robots.

    Attributes
    ----------
    data : LeastSquares
    prior : Prior
    region : PhysicalSet
        May have no bodies: then only signs and bounds constrain.
    variance : float, optional [torque²]
        Known noise variance; without it, it is marginalised.
    fixed : Fixed, optional
        Combinations of the p parameters that keep their k values, so that q = p − k coordinates are
        left; `region` must not bound parameters that are fixed individually.
    """

    data: LeastSquares
    prior: Prior
    region: PhysicalSet
    variance: float | None = None
    fixed: Fixed | None = None

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.prior.mean.size

    @property
    def held(self) -> Fixed:
        """Combinations that keep their values, be they none."""
        return self.fixed or Fixed.none(self.size)

    @cached_property
    def plane(self) -> tuple[Array, Array]:
        """Plane of the fixed combinations, in scaled coordinates.

        A point (p,) from the prior's mean [prior sd], and the free directions (p, q).
        """
        away = self.held.value - self.held.rows @ self.prior.mean
        return Fixed(self.held.rows, away).span(self.prior.sd)

    @cached_property
    def seen(self) -> Array:
        """Torque (r, q) that a prior sd makes along the plane: the data where a prior is one."""
        return (self.data.R * self.prior.sd) @ self.plane[1]

    @cached_property
    def rotation(self) -> tuple[Array, Array, Array]:
        """Singular value decomposition of `seen`: U (r, r), s (min(r, q),), Vᵀ (q, q)."""
        U, s, Vt = np.linalg.svd(self.seen, full_matrices=True)
        return U, s, Vt

    @cached_property
    def axes(self) -> Array:
        """Directions (q, p) of the coordinates eta, in prior sd."""
        return self.rotation[2] @ self.plane[1].T

    @cached_property
    def basis(self) -> Array:
        """(p, q): ``phi = origin + basis @ eta``."""
        return self.prior.sd[:, None] * self.axes.T

    @cached_property
    def origin(self) -> Array:
        """The parameters (p,) in the plane that the prior likes best."""
        return self.prior.mean + self.prior.sd * self.plane[0]

    @cached_property
    def root(self) -> Array:
        """(p, q): ``root rootᵀ`` is the covariance with data and prior, without the region."""
        scaled = self.seen / np.sqrt(self.data.variance)
        # inv(I + SᵀS) by QR: its diagonal is never negative, however exact the data are.
        rows = np.vstack([np.eye(scaled.shape[1]), scaled])
        factor = np.linalg.qr(rows, mode="r")
        free = self.prior.sd[:, None] * self.plane[1]
        return free @ np.linalg.inv(factor)

    @cached_property
    def diagonal(self) -> Diagonal:
        """The Gaussian part in coordinates ``eta``."""
        U, s, _ = self.rotation
        length = or_one(np.linalg.norm(self.seen, axis=0))
        rank = int(np.linalg.matrix_rank(self.seen / length, rtol=ROUNDOFF))
        gain, signal = np.zeros((2, len(self.axes)))
        gain[:rank] = s[:rank]
        seen = (self.data.z - self.data.R @ self.origin) @ U
        signal[:rank] = seen[:rank]
        # Noise-free data leave nothing to estimate a variance from.
        floor = 1e-6 * self.data.unit**2
        rest = np.maximum(np.sum(seen[rank:] ** 2) + self.data.rss_min, floor)
        shape = (self.data.dof + rank) / 2
        return Diagonal(gain, signal, rest, shape, self.variance)

    def to_phi(self, eta: Array) -> Array:
        """Parameters ``(..., p)`` of coordinates ``(..., q)``."""
        return self.held.impose(self.origin + eta @ self.basis.T)

    def to_eta(self, phi: Array) -> Array:
        """Coordinates ``(..., q)`` of parameters ``(..., p)``, the nearest of the plane."""
        return ((phi - self.origin) / self.prior.sd) @ self.axes.T
