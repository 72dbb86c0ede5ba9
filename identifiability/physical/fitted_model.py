"""A fitted model, and the problem that it poses in the standard parameters of bodies.

What the data say is a compressed least-squares problem; what a model leaves out, holds or ties is
known to it.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.foundation.linalg import SPAN_TOLERANCE
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical.feasible_set import PhysicalSet, physical_set
from identifiability.regression.information import Information
from identifiability.regression.reduction import Submodel
from identifiability.regression.structure import Structure

# What the data say about the parameters: a compressed least-squares problem.


@frozen
class LeastSquares:
    """Residual sum of squares of a linear model, ``‖R phi − z‖² + rss_min``.

    The three hundred thousand rows of a log enter the physical and the Bayesian stages only through
    these numbers. `R` may have a null space, and it is never squared: ``RᵀR`` loses half the
    digits.

    Attributes
    ----------
    R : (r, p) [torque / parameter], weighted rows
    z : (r,) [torque], weighted
    rss_min : float [torque²]
        Residual sum of squares that no parameter vector can remove.
    dof : float
        Samples minus rank: ``rss_min / dof`` estimates the noise variance.
    """

    R: Array
    z: Array
    rss_min: float
    dof: float

    @staticmethod
    def of_fit(information: Information, estimate: Estimate) -> LeastSquares:
        """Return the loss that an estimate made least, in its own k parameters.

        Parameters
        ----------
        information : Information
            That was fitted.
        estimate : Estimate
        """
        F = estimate.estimator.loss(information, estimate)
        variance = float(estimate.weights @ estimate.rss) / max(estimate.dof, 1)
        rss = max(float(F[-1, -1] ** 2), variance * 1e-12)
        return LeastSquares(F[:-1, :-1], F[:-1, -1], rss, max(float(estimate.dof), 1.0))

    @staticmethod
    def likelihood(information: Information, estimate: Estimate) -> LeastSquares:
        """Return the same for a posterior: it counts as many rows as are independent.

        To it data without noise have a little of it.
        """
        tau = float(np.linalg.norm(estimate.estimator.loss(information, estimate)[:, -1]))
        rss = max(float(estimate.weights @ estimate.rss), (1e-9 * tau) ** 2)
        dof = max(information.rows / estimate.memory - len(estimate.kept), 1.0)
        return replace(LeastSquares.of_fit(information, estimate), rss_min=rss, dof=dof)

    def through(self, to_x: Array) -> LeastSquares:
        """Return the problem in other parameters phi, of which these are ``to_x (p, q) phi``."""
        return replace(self, R=self.R @ to_x)

    def beside(self, rows: Array, aim: Array) -> LeastSquares:
        """Return the problem with further squares ``rows (m, p) phi − aim (m,)`` [torque]."""
        return replace(self, R=np.vstack([self.R, rows]), z=np.concatenate([self.z, aim]))

    @property
    def variance(self) -> float:
        """Estimate of the noise variance [torque²]."""
        return self.rss_min / self.dof

    @property
    def unit(self) -> float:
        """Residual that counts as one: the noise sd [torque], never below 1e-6 of the signal."""
        return float(
            max(np.sqrt(self.variance), 1e-6 * np.linalg.norm(self.z), np.finfo(float).tiny)
        )

    def rss(self, phi: Array) -> Array:
        """Residual sum of squares (...) [torque²] of parameter vectors ``phi (..., p)``."""
        residual = np.asarray(phi) @ self.R.T - self.z
        total: Array = np.einsum("...r,...r->...", residual, residual) + self.rss_min
        return total


# What a model leaves out, holds or ties, as a projection knows it.
#
# Base parameters are ``G phi``, and the model says that they are ``value + M x``.


@frozen
class Fixed:
    """Independent combinations of parameters with their values; of no inertial parameter.

    Attributes
    ----------
    rows : (k, p)
    value : (k,)
    """

    rows: Array
    value: Array

    @staticmethod
    def none(size: int) -> Fixed:
        """Return the absence of held combinations of so many parameters."""
        return Fixed(np.zeros((0, size)), np.zeros(0))

    @cached_property
    def alone(self) -> np.ndarray:
        """Which combinations are of one parameter, (k,) bool."""
        mask: np.ndarray = np.count_nonzero(self.rows, axis=1) == 1
        return mask

    @property
    def parameters(self) -> np.ndarray:
        """The parameters that are held by themselves, (p,) bool."""
        mask: np.ndarray = (self.rows[self.alone] != 0).any(axis=0)
        return mask

    def settle(self, phi: Array) -> Array:
        """Return parameters (..., p), those that are held by themselves at exactly their values."""
        out, rows = np.array(phi), self.rows[self.alone]
        at = np.argmax(rows != 0, axis=1)
        out[..., at] = self.value[self.alone] / rows[np.arange(len(at)), at]
        return out

    def span(self, scale: Array) -> tuple[Array, Array]:
        """Return what is left to scaled parameters ``phi = scale * x``.

        Returns
        -------
        origin : (p,)
        along : (p, p − k)
            Orthonormal directions.
        """
        k = len(self.rows)
        Q, R = np.linalg.qr((self.rows * scale).T, mode="complete")
        return Q[:, :k] @ np.linalg.solve(R[:k].T, self.value), Q[:, k:]


def find_fixed(region: PhysicalSet, G: Array, M: Array, value: Array) -> Fixed:
    """Return what a model leaves out, holds or ties outside the bodies.

    Parameters
    ----------
    region : PhysicalSet
        Of the p standard parameters.
    G : (b, p)
    M : (b, m)
    value : (b,)

    Raises
    ------
    ValueError
        If it holds what no real robot has: a sum of friction levels below zero, for one.
    """
    outside = ~np.any(G[:, np.unique(region.bodies)] != 0, axis=1)
    alone = outside & ~M.any(axis=1)
    tied = outside & ~alone
    _, s, Vt = np.linalg.svd(M[tied].T)
    apart = Vt[int((s > SPAN_TOLERANCE * s.max(initial=0.0)).sum()) :]
    found: dict[bytes, tuple[Array, float]] = {}
    for row, at in zip(
        [*G[alone], *apart @ G[tied]], [*value[alone], *apart @ value[tied]], strict=True
    ):
        members = np.flatnonzero(row)
        signed = bool((row[members] > 0).all() and region.nonnegative[members].all())
        if signed and at < 0:
            raise ValueError(
                f"the model holds {region.columns[members[0]]} at {at:g}, and no real robot has "
                "it below zero."
            )
        # A sum of what cannot be negative is zero only if every one is.
        parts = np.eye(len(row))[members] if signed and at == 0 else row[None]
        found |= {part.tobytes(): (part, float(at)) for part in parts}
    rows = np.array([row for row, _ in found.values()]).reshape(-1, region.size)
    return Fixed(rows, np.array([at for _, at in found.values()]))


# A fitted model, and the problem that it poses in the standard parameters of bodies.
#
# The information about base parameters becomes a problem in the full standard parameters, ``W_base
# G phi``, for the nearest real robot and for the posterior alike.
#
# What a model leaves out is never free. Of friction, rotors and whatever else belongs to no body
# it is exactly zero (or what it is held at, or equal to what it is tied to). Of bodies that may be
# impossible: a body whose mass were zero has no first moment. There its torque counts as error in
# full, and as no help in explaining the log.


@frozen
class FittedModel:
    """A model of a robot that was fitted, and what the fit says of the standard parameters.

    The model says that base parameters are ``fixed + M x``; the part of ``G phi`` outside the span
    of M is what the model leaves out, and does not enter its prediction.

    Attributes
    ----------
    structure : Structure
        With its b base and p standard parameters.
    submodel : Submodel
        The model, of m parameters x.
    whole, information : Information
        About all base parameters, and about the model's columns.
    estimate : Estimate
    """

    structure: Structure
    submodel: Submodel
    whole: Information
    information: Information
    estimate: Estimate

    @staticmethod
    def of(
        structure: Structure, submodel: Submodel, whole: Information, estimator: Estimator
    ) -> FittedModel:
        """Fit a model."""
        part = submodel.reduce(whole)
        return FittedModel(structure, submodel, whole, part, estimator.fit(part))

    @cached_property
    def to_x(self) -> Array:
        """The model's parameters of standard ones, (m, p); tied columns take the mean."""
        to_x: Array = np.linalg.pinv(self.submodel.M) @ self.structure.G
        return to_x

    @property
    def determined(self) -> bool:
        """Whether there are parameters and the motion determines each."""
        return 0 < len(self.submodel) == len(self.estimate.kept)

    @cached_property
    def data(self) -> LeastSquares:
        """The estimate's loss in the standard parameters, of what the model does not leave out."""
        return LeastSquares.of_fit(self.information, self.estimate).through(self.to_x)

    @cached_property
    def fixed(self) -> Fixed:
        """What the model leaves out, holds or ties outside the bodies.

        Raises
        ------
        ValueError
            If it holds what no real robot has.
        """
        region = physical_set(self.structure)
        return find_fixed(region, self.structure.G, self.submodel.M, self.submodel.fixed)

    @cached_property
    def region(self) -> PhysicalSet:
        """What a real robot can have; what is held by itself needs no sign."""
        region = physical_set(self.structure)
        return replace(region, nonnegative=region.nonnegative & ~self.fixed.parameters)

    @cached_property
    def left_out(self) -> tuple[Array, Array]:
        """Torque of what the model leaves out, ``rows phi − aim``: (b, p) and (b,)."""
        R, M = self.whole.factor(self.estimate.weights)[:-1, :-1], self.submodel.M
        rest = R @ (np.eye(len(M)) - M @ np.linalg.pinv(M)) if M.size else R
        return rest @ self.structure.G, rest @ self.submodel.fixed
