"""Exact Hamiltonian Monte Carlo for a Gaussian inside a convex region [Pakman 2014].

A Gaussian with unit covariance makes every trajectory a circle ``x(t) = μ + a sin t + b cos t``; it
is followed exactly, without a step size, and reflected where it meets the boundary. After a quarter
turn the position is the old velocity, so without constraints the draws are nearly independent. The
turn is drawn anew each time: a fixed one can resonate with the bounces, when the mean is far
outside. Every proposal is accepted.

Many chains run at once, as rows of the arrays. `cone.Cone` is the region and finds the first exit.
"""

import numpy as np

from identifiability.foundation.names import Array
from identifiability.posterior.cone import Circles, Cone

#: Range of the turn of one transition [rad].
TURN = (np.pi / 4, 3 * np.pi / 4)

#: A trajectory with more reflections is given up: the chain stays, so the sampler stays exact.
BOUNCES = 2000


def travel(region: Cone, eta: Array, mean: Array, sd: Array, rng: np.random.Generator) -> Array:
    """One exact transition of K chains that leaves each Normal(mean, sd²) on the region unchanged.

    The transition is reversible, so it may also serve as a Metropolis proposal.

    Parameters
    ----------
    region : Cone
    eta : (K, p)
        Positions inside the region.
    mean, sd : (K, p)
    rng : numpy.random.Generator

    Returns
    -------
    (K, p)
    """
    velocity, turn = rng.standard_normal(eta.shape), rng.uniform(*TURN, len(eta))
    state = _State(region, eta, mean, sd, velocity, turn)
    for _ in range(BOUNCES):
        if state.advance():
            break
    return state.result(eta)


class _State:
    """Positions and velocities of the chains on the way, in unit coordinates and in y."""

    def __init__(
        self, region: Cone, eta: Array, mean: Array, sd: Array, velocity: Array, left: Array
    ) -> None:
        self.region, self.mean, self.sd, self.left = region, mean, sd, left
        self.x, self.v = (eta - mean) / sd, velocity
        map_T = region.map.T
        self.centre = region.offset + mean @ map_T
        self.y, self.dy = (self.x * sd) @ map_T, (self.v * sd) @ map_T

    def advance(self) -> bool:
        """Go to the next reflection of every chain still on its way; True when all arrived."""
        k = np.flatnonzero(self.left > 0)
        if not k.size:
            return True
        path = Circles(self.centre[k], self.dy[k], self.y[k])
        t, hit, inward = self.region.first_exit(path, self.left[k])
        sin, cos = np.sin(t)[:, None], np.cos(t)[:, None]
        for position, velocity in ((self.x, self.v), (self.y, self.dy)):
            old, speed = position[k], velocity[k]
            position[k] = speed * sin + old * cos
            velocity[k] = speed * cos - old * sin
        self.left[k] -= t
        self._reflect(k[hit], inward[hit])
        return False

    def _reflect(self, k: np.ndarray, inward: Array) -> None:
        normal = (inward @ self.region.map) * self.sd[k]
        speed = np.einsum("kp,kp->k", normal, self.v[k]) / np.einsum("kp,kp->k", normal, normal)
        bounce = -2 * np.minimum(speed, 0.0)[:, None] * normal
        self.v[k] += bounce
        self.dy[k] += (bounce * self.sd[k]) @ self.region.map.T

    def result(self, start: Array) -> Array:
        """Where the chains arrived; those that did not, or left the region by rounding, stay."""
        arrived = (self.left <= 0) & self.region.contains(self.centre + self.y)
        return np.where(arrived[:, None], self.mean + self.sd * self.x, start)
