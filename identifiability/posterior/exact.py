"""Exact draws from a posterior: noise variance and parameters in turn, many chains at once.

What to use when: `ExactSampler.step` alone is the fastest way to a posterior whose model is the one
of `target`, and to many replicates of an experiment at once (calibration). `ensemble` runs it
inside emcee, where other likelihoods and priors may be multiplied in, and where independent
ensembles give the diagnostics.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.posterior.bouncing import travel
from identifiability.posterior.centre import find_centre
from identifiability.posterior.cone import UPPER, Cone
from identifiability.posterior.target import Diagonal, Target

#: Distance of starting points from an inner one, in posterior standard deviations.
SPREAD = 1.5

#: How far outside is inside, as a share of what a prior standard deviation changes.
ROUNDING = 1e-11

#: Called with the number of steps done and to do.
Progress = Callable[[int, int], None]


@frozen
class ExactSampler:
    """A transition that leaves the posterior unchanged, for K chains at once.

    Attributes
    ----------
    model : Diagonal
    region : Cone
    root : (p, p)
        ``root rootᵀ`` is the covariance of the velocities; any is right, the posterior's is best.
    """

    model: Diagonal
    region: Cone
    root: Array

    def centred(self, eta: Array) -> tuple["ExactSampler", Array]:
        """Return the sampler with velocities as wide as its posterior, and the middle of that.

        Parameters
        ----------
        eta : (p,)
            Inside the region.
        """
        centre, root = find_centre(self.model, self.region, eta)
        return replace(self, root=root), centre

    def step(self, eta: Array, rng: np.random.Generator) -> Array:
        """Move every chain once.

        The step is reversible: drawing v given eta and then moving eta given v is a symmetric
        exchange.

        Parameters
        ----------
        eta : (K, p)
            Inside the region.
        rng : numpy.random.Generator

        Returns
        -------
        (K, p)
        """
        return self.fly(eta, rng)[0]

    def fly(self, eta: Array, rng: np.random.Generator) -> tuple[Array, int]:
        """Move every chain once, and count the straight pieces of the longest path."""
        mean, sd = self.model.conditional(self.model.draw_variance(eta, rng))
        return travel(self.region, self.root, eta, mean, sd, rng)

    def contains(self, eta: Array) -> np.ndarray:
        """Whether coordinates (K, p) are inside the region."""
        return self.region.contains(self.region.offset + eta @ self.region.map.T)

    def disperse(self, eta: Array, count: int, rng: np.random.Generator) -> Array:
        """Starting points around an inner point, farther apart than the posterior is wide.

        Parameters
        ----------
        eta : (p,)
        count : int
        rng : numpy.random.Generator

        Returns
        -------
        (count, p), shortened towards `eta` until inside
        """
        start = np.repeat(eta[None], count, axis=0)
        step = SPREAD * rng.standard_normal(start.shape) @ self.root.T
        for _ in range(60):
            outside = ~self.contains(start + step)
            if not outside.any():
                break
            step[outside] /= 2
        return np.where(self.contains(start + step)[:, None], start + step, start)


def build_sampler(target: Target) -> ExactSampler:
    """Prepare the exact sampler of a posterior."""
    origin = target.origin
    matrices = np.concatenate([target.region.cone_map, target.region.ellipsoid_map])
    entries = matrices[:, UPPER].reshape(-1, target.size)
    m = len(target.region.rows)
    both = np.vstack([target.region.rows, entries])
    # What rounding takes outside is inside: rows and diagonals of matrices have this much room.
    room = ROUNDING * np.abs(both) @ target.proper_prior.sd
    room[m:] *= np.tile(UPPER % 5 == 0, len(entries) // 10)
    room[:m] -= target.region.least
    region = Cone(both @ target.basis, both @ origin + room, m)
    model = target.diagonal
    best = np.divide(model.signal, model.gain, out=0 * model.gain, where=model.gain > 0)
    _, sd = model.conditional(model.typical_variance(best[None]))
    return ExactSampler(model, region, np.diag(sd[0]))


def interior(target: Target, sampler: ExactSampler, start: Array) -> Array:
    """Coordinates of a starting point that is inside.

    Parameters
    ----------
    target : Target
    sampler : ExactSampler
    start : (p,)

    Raises
    ------
    ValueError
        When it is not; what is violated is said.
    """
    eta = target.to_eta(start)
    if not sampler.contains(eta[None])[0]:
        found = " ".join(target.region.violations(start)) or "It lies on the boundary of the set."
        raise ValueError(
            f"posterior: the starting point is not inside the physical set. {found} Expected an "
            "inner point; use the projection with a margin, project(data, region, margin=1e-3).phi."
        )
    return eta
