"""Exact draws from a Gaussian inside a convex region: Hamiltonian Monte Carlo with hard walls.

A particle flies straight, is kicked by the slope of the density at equal times (leapfrog), and is
reflected where it meets the boundary [Afshar 2015]; what the kicks get wrong, the Metropolis rule
corrects. Straight paths leave a cone by 4×4 eigenvalues, and velocities may have any scale: with
that of the posterior and its boundary, a narrow corner reflects no more often than a wide one.
(Between kicks that are exact [Pakman 2014] the path is a circle and the scale that of the Gaussian
alone: up to 230 reflections a draw on seven robots, for 30 here, and each costs more.)

Many chains run at once, as rows of the arrays. `cone.Cone` is the region and finds the first exit.
"""

import numpy as np

from identifiability.foundation.names import Array
from identifiability.posterior.cone import Cone

#: Range of the time of one transition; in a quarter turn, 1.6, a Gaussian forgets where it was.
TURN = (1.5, 2.5)

#: Kicks of one transition: nine of ten are accepted with a hundred parameters.
KICKS = 7

#: A path of more straight pieces is given up: the chain stays, so the sampler stays exact.
PIECES = 2000


def travel(
    region: Cone, root: Array, eta: Array, mean: Array, sd: Array, rng: np.random.Generator
) -> tuple[Array, int]:
    """One exact transition of K chains that leaves each Normal(mean, sd²) on the region unchanged.

    The transition is reversible, so it may also serve as a Metropolis proposal.

    Parameters
    ----------
    region : Cone
    root : (p, p)
        ``root rootᵀ`` is the covariance of the velocities; best that of the draws.
    eta : (K, p)
        Positions inside the region.
    mean, sd : (K, p)
    rng : numpy.random.Generator

    Returns
    -------
    eta : (K, p)
    pieces : int
        Straight pieces of the chain that had the most.
    """
    push, turn = rng.standard_normal(eta.shape), rng.uniform(*TURN, len(eta))
    flight = Flight(region, root, eta, mean, sd, push, turn)
    pieces = 0
    while pieces < PIECES and not flight.advance():
        pieces += 1
    rise = flight.energy() - flight.start
    kept = flight.arrived & (rise < rng.standard_exponential(len(eta)))
    return np.where(kept[:, None], flight.x, eta), pieces


class Flight:
    """Positions and velocities of the chains on the way, in eta and in the region's y."""

    def __init__(
        self,
        region: Cone,
        root: Array,
        eta: Array,
        mean: Array,
        sd: Array,
        push: Array,
        turn: Array,
    ) -> None:
        self.region, self.root, self.scale = region, root, root @ root.T
        self.mean, self.sd, self.x = mean, sd, np.array(eta)
        self.v = push @ root.T
        self.y = region.offset + eta @ region.map.T
        self.dy = self.v @ region.map.T
        self.gap = turn / KICKS
        self.left, self.kicks = np.array(self.gap), np.full(len(eta), KICKS)
        self.start = self.energy()
        self._kick(np.arange(len(eta)), self.gap / 2)

    @property
    def arrived(self) -> np.ndarray:
        """Which chains are at the end of their way and inside the region, (K,) bool."""
        return np.asarray((self.kicks == 0) & self.region.contains(self.y))

    def energy(self) -> Array:
        """Minus the logarithm (K,) of the density of positions and velocities."""
        off, push = (self.x - self.mean) / self.sd, np.linalg.solve(self.root, self.v.T)
        total: Array = (np.einsum("kp,kp->k", off, off) + np.einsum("pk,pk->k", push, push)) / 2
        return total

    def advance(self) -> bool:
        """Go to the next kick or wall of every chain still on its way; True when all arrived."""
        k = np.flatnonzero(self.kicks > 0)
        if not k.size:
            return True
        time, hit, inward = self.region.first_exit(self.y[k], self.dy[k], self.left[k])
        self.x[k] += time[:, None] * self.v[k]
        self.y[k] += time[:, None] * self.dy[k]
        self.left[k] -= time
        self._reflect(k[hit], inward[hit] @ self.region.map)
        k = k[~hit & (self.left[k] <= 0)]
        self.kicks[k] -= 1
        self.left[k] = self.gap[k]
        self._kick(k, self.gap[k] / np.where(self.kicks[k] > 0, 1, 2))
        return False

    def _reflect(self, k: np.ndarray, normal: Array) -> None:
        """Turn velocities that go against a normal, with the velocities' own scale."""
        push = normal @ self.scale
        speed = np.einsum("kp,kp->k", normal, self.v[k]) / np.einsum("kp,kp->k", normal, push)
        self._push(k, -2 * np.minimum(speed, 0.0)[:, None] * push)

    def _kick(self, k: np.ndarray, time: Array) -> None:
        slope = (self.x[k] - self.mean[k]) / self.sd[k] ** 2
        self._push(k, -time[:, None] * slope @ self.scale)

    def _push(self, k: np.ndarray, change: Array) -> None:
        self.v[k] += change
        self.dy[k] += change @ self.region.map.T
