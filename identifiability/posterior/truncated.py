"""Exact Hamiltonian Monte Carlo for a Gaussian inside a convex region [Pakman 2014].

A Gaussian with unit covariance makes every trajectory a circle ``x(t) = μ + a sin t + b cos t``; it
is followed exactly, without a step size, and reflected where it meets the boundary. After a quarter
turn the position is the old velocity, so without constraints the draws are nearly independent. The
turn is drawn anew each time: a fixed one can resonate with the bounces, when the mean is far
outside. Every proposal is accepted.

Many chains run at once, as rows of the arrays. The region enters only through linear coordinates
``y = offset + map @ eta`` and a function that finds the first exit; `HalfSpaces` here has the exit
through linear inequalities in closed form, `cone` adds matrix inequalities.
"""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from identifiability.foundation.values import frozen

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

#: Range of the turn of one transition [rad].
TURN = (np.pi / 4, 3 * np.pi / 4)

#: A trajectory with more reflections is given up: the chain stays, so the sampler stays exact.
BOUNCES = 2000


@frozen
class Circles:
    """Trajectories ``y(t) = centre + sine sin t + cosine cos t`` of K chains, in the coordinates y.

    Attributes
    ----------
    centre, sine, cosine : (K, M)
    """

    centre: Floats
    sine: Floats
    cosine: Floats

    def at(self, t: Floats) -> Floats:
        """Positions (K, M) at times (K,)."""
        return self.centre + self.sine * np.sin(t)[:, None] + self.cosine * np.cos(t)[:, None]


class Region(Protocol):
    """A convex region in the coordinates ``eta``.

    Attributes
    ----------
    map : (M, p)
    offset : (M,)
    """

    @property
    def map(self) -> Floats:
        """Linear part of the coordinates y."""

    @property
    def offset(self) -> Floats:
        """Constant part of the coordinates y."""

    def first_exit(self, path: Circles, limit: Floats) -> tuple[Floats, Bools, Floats]:
        """Find the first exit before ``limit (K,)``.

        Returns
        -------
        time : (K,)
            Exit time, or a time not after `limit` up to which the path is inside.
        hit : (K,) bool
        inward : (K, M)
            Gradient of the boundary function that was hit, in y.
        """

    def contains(self, y: Floats) -> Bools:
        """Whether points (K, M) are inside."""


@frozen
class HalfSpaces:
    """``offset + map @ eta ≥ 0``.

    Attributes
    ----------
    map : (m, p)
    offset : (m,)
    """

    map: Floats
    offset: Floats

    def first_exit(self, path: Circles, limit: Floats) -> tuple[Floats, Bools, Floats]:
        """First exit; see `Region`."""
        time, row = exit_through_rows(path)
        hit = time < limit
        inward = np.zeros_like(path.centre)
        inward[hit, row[hit]] = 1.0
        return np.minimum(time, limit), hit, inward

    def contains(self, y: Floats) -> Bools:
        """Whether points are inside; see `Region`."""
        return np.asarray((y >= 0).all(axis=1))


def exit_through_rows(path: Circles) -> tuple[Floats, NDArray[np.intp]]:
    """First time at which a coordinate turns negative.

    ``c + r cos(t − φ)`` falls through zero once a turn, at ``φ + arccos(−c/r)``; the rise is not an
    exit, so a path that starts on the boundary, just reflected, needs no special case.

    Parameters
    ----------
    path : Circles

    Returns
    -------
    time : (K,)
        Infinite when no coordinate ever does.
    row : (K,) int
    """
    radius = np.hypot(path.sine, path.cosine)
    reaches = radius > np.abs(path.centre)
    ratio = np.divide(-path.centre, radius, out=np.zeros_like(radius), where=reaches)
    turn = (np.arctan2(path.sine, path.cosine) + np.arccos(ratio)) % (2 * np.pi)
    times = np.where(reaches, turn, np.inf)
    if times.shape[1] == 0:
        return np.full(len(times), np.inf), np.zeros(len(times), np.intp)
    row = times.argmin(axis=1)
    return times[np.arange(len(row)), row], row


def travel(
    region: Region, eta: Floats, mean: Floats, sd: Floats, rng: np.random.Generator
) -> Floats:
    """One exact transition of K chains that leaves each Normal(mean, sd²) on the region unchanged.

    The transition is reversible, so it may also serve as a Metropolis proposal.

    Parameters
    ----------
    region : Region
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
        self,
        region: Region,
        eta: Floats,
        mean: Floats,
        sd: Floats,
        velocity: Floats,
        left: Floats,
    ) -> None:
        self.region, self.mean, self.sd = region, mean, sd
        self.x, self.v = (eta - mean) / sd, velocity
        map_T = region.map.T
        self.centre = region.offset + mean @ map_T
        self.y, self.dy = (self.x * sd) @ map_T, (self.v * sd) @ map_T
        self.left = left

    def advance(self) -> bool:
        """Go to the next reflection of every chain still on its way; True when all arrived."""
        k = np.flatnonzero(self.left > 0)
        if not k.size:
            return True
        path = Circles(self.centre[k], self.dy[k], self.y[k])
        t, hit, inward = self.region.first_exit(path, self.left[k])
        self._turn(k, t)
        self.left[k] -= t
        self._reflect(k[hit], inward[hit])
        return False

    def _turn(self, k: NDArray[np.intp], t: Floats) -> None:
        sin, cos = np.sin(t)[:, None], np.cos(t)[:, None]
        for position, velocity in ((self.x, self.v), (self.y, self.dy)):
            old, speed = position[k], velocity[k]
            position[k] = speed * sin + old * cos
            velocity[k] = speed * cos - old * sin

    def _reflect(self, k: NDArray[np.intp], inward: Floats) -> None:
        normal = (inward @ self.region.map) * self.sd[k]
        speed = np.einsum("kp,kp->k", normal, self.v[k]) / np.einsum("kp,kp->k", normal, normal)
        bounce = -2 * np.minimum(speed, 0.0)[:, None] * normal
        self.v[k] += bounce
        self.dy[k] += (bounce * self.sd[k]) @ self.region.map.T

    def result(self, start: Floats) -> Floats:
        """Where the chains arrived; those that did not, or left the region by rounding, stay."""
        arrived = (self.left <= 0) & self.region.contains(self.centre + self.y)
        return np.where(arrived[:, None], self.mean + self.sd * self.x, start)
