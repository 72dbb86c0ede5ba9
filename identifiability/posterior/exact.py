"""Exact draws from a posterior: noise variance and parameters in turn, many chains at once.

Parameters are drawn from a Gaussian inside the cone of pseudo-inertias by Hamiltonian Monte Carlo
with hard walls, from the middle of the posterior on.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.foundation.linalg import TINY
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen

from .target import Diagonal, Target

# The exit of a straight path from the cone of pseudo-inertias, and the barrier of the cone.
#
# A body that is inside at both ends of a stretch is inside in between. Only the others cost an
# eigenvalue problem, a symmetric one of 4×4.


#: A symmetric matrix from its ten entries ``y[..., TRIANGLE]``.
TRIANGLE = np.array([[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]])

#: The ten entries among the flattened sixteen.
UPPER = np.array([0, 1, 2, 3, 5, 6, 7, 10, 11, 15])


@frozen
class Cone:
    """Coordinates eta (p,) in a convex region, by linear coordinates ``y = offset + map @ eta``.

    They are m rows ``y ≥ 0`` followed by ten entries of each matrix that must be positive definite.

    Attributes
    ----------
    map : (m + 10 nb, p)
    offset : (m + 10 nb,)
    rows : int
        ``m``
    """

    map: Array
    offset: Array
    rows: int

    def contains(self, y: Array) -> np.ndarray:
        """Whether points (K, M) are inside, (K,) bool."""
        inside: np.ndarray = np.all(y[:, : self.rows] >= 0, axis=1)
        matrices = self._matrices(y)
        return inside & positive(matrices).all(axis=1)

    def first_exit(self, y: Array, dy: Array, limit: Array) -> tuple[Array, np.ndarray, Array]:
        """Find the first exit of the paths ``y + t dy`` before ``limit (K,)``.

        Parameters
        ----------
        y, dy : (K, M)
            From points inside, or on the boundary.
        limit : (K,)

        Returns
        -------
        time : (K,)
            The exit, or `limit`.
        hit : (K,) bool
        inward : (K, M)
            Gradient of the boundary function that was hit, in y.
        """
        m = self.rows
        inward = np.zeros_like(y)
        time, row = exit_through_rows(y[:, :m], dy[:, :m])
        hit = time < limit
        inward[hit, row[hit]] = 1.0
        time = np.minimum(time, limit)
        if m == y.shape[1]:
            return time, hit, inward
        J = self._matrices(y)
        D = self._matrices(dy)
        out = ~positive(J + time[:, None, None, None] * D)
        if not out.any():
            return time, hit, inward
        chain, body, when, null = _crossings(J, D, time, out)
        if chain.size:
            first = np.lexsort((when, chain))
            first = first[np.unique(chain[first], return_index=True)[1]]
            k = chain[first]
            columns = m + 10 * body[first, None] + np.arange(10)
            time[k] = when[first]
            hit[k] = True
            inward[k] = 0.0
            inward[k[:, None], columns] = _gradient(null[first])
        return time, hit, inward

    def barrier(self, eta: Array) -> tuple[float, Array, Array]:
        """Logarithmic barrier of the region, infinite outside.

        Parameters
        ----------
        eta : (p,)

        Returns
        -------
        value : float
        gradient : (p,)
        root : (r, p)
            ``rootᵀ root`` is the second derivative.
        """
        y = self.offset + self.map @ eta
        p = len(eta)
        m = self.rows
        if not (self.contains(y[None])[0] and (y[:m] > 0).all()):
            return np.inf, np.zeros(p), np.zeros((0, p))
        rows = y[:m]
        J = self._matrices(y[None])[0]
        slopes = self.map[m:].reshape(-1, 10, p)[:, TRIANGLE]
        lower = np.linalg.inv(np.linalg.cholesky(J))
        turned = np.einsum("bij,bjkp,blk->bilp", lower, slopes, lower, optimize=True)
        diagonals = np.diagonal(lower, axis1=1, axis2=2)
        value = 2 * np.log(diagonals).sum() - np.log(rows).sum()
        scaled = self.map[:m] / rows[:, None]
        gradient = -scaled.sum(0) - np.einsum("biip->p", turned)
        return float(value), gradient, np.vstack([scaled, turned.reshape(-1, p)])

    def _matrices(self, y: Array) -> Array:
        numbers = y[:, self.rows :].reshape(len(y), -1, 10)
        return numbers[..., TRIANGLE]


def exit_through_rows(y: Array, dy: Array) -> tuple[Array, np.ndarray]:
    """First time at which a coordinate of ``y + t dy`` turns negative.

    One that rises is on its way in, so a path that starts on the boundary, just reflected, needs no
    special case.

    Parameters
    ----------
    y, dy : (K, m)

    Returns
    -------
    time : (K,)
        Infinite when no coordinate ever does.
    row : (K,) int
    """
    if y.shape[1] == 0:
        return np.full(len(y), np.inf), np.zeros(len(y), np.intp)
    room = np.maximum(y, 0.0)
    never = np.full_like(y, np.inf)
    times = np.divide(room, -dy, out=never, where=dy < 0)
    row = times.argmin(axis=1)
    return times[np.arange(len(row)), row], row


def _crossings(
    J: Array, D: Array, time: Array, out: np.ndarray
) -> tuple[np.ndarray, np.ndarray, Array, Array]:
    """Chains, bodies, times and null vectors of all exits of those that are `out` at `time`.

    From a point R inside, ``R + s D = L (1 + s M) Lᵀ`` first turns singular at −1 over the smallest
    eigenvalue of M. A point at least a third of the way there makes that good to all digits, also
    where the path starts on the boundary.
    """
    chain, body = np.nonzero(out)
    J = J[chain, body]
    D = D[chain, body]
    inner = time[chain]
    outside = np.arange(len(chain))
    # A stretch is cut to its first third at most so often until a body is inside at its end.
    for _ in range(60):
        inner[outside] /= 3
        point = J[outside] + inner[outside, None, None] * D[outside]
        outside = outside[~positive(point)]
        if not outside.size:
            break
    # Only rounding makes a body leave at once; where it does, the end of the path is refused.
    found = np.delete(np.arange(len(chain)), outside)
    chain = chain[found]
    body = body[found]
    D = D[found]
    inner = inner[found]
    reached = J[found] + inner[:, None, None] * D
    lower = np.linalg.inv(np.linalg.cholesky(reached))
    value, vectors = np.linalg.eigh(lower @ D @ lower.transpose(0, 2, 1))
    where = inner - 1 / value[:, 0]
    normals = np.einsum("kji,kj->ki", lower, vectors[:, :, 0])
    return chain, body, where, normals


def _gradient(null: Array) -> Array:
    outer = null[:, :, None] * null[:, None, :]
    return outer.reshape(-1, 16)[:, UPPER] * np.where(UPPER % 5 == 0, 1.0, 2.0)


def positive(J: Array) -> np.ndarray:
    """Whether symmetric matrices are positive definite, by their pivots.

    Parameters
    ----------
    J : (..., n, n)

    Returns
    -------
    (...) bool
    """
    rest = J
    pivot = rest[..., 0, 0]
    good: np.ndarray = pivot > 0
    for _ in range(J.shape[-1] - 1):
        column = rest[..., 1:, 0]
        safe = np.where(good, pivot, 1.0)[..., None]
        lower = rest[..., 1:, 1:]
        scaled = (column / safe)[..., :, None]
        rest = lower - scaled * column[..., None, :]
        pivot = rest[..., 0, 0]
        good = good & (pivot > 0)
    return good


# Exact draws from a Gaussian inside a convex region: Hamiltonian Monte Carlo with hard walls.
#
# A particle flies straight, is kicked by the slope of the density at equal times (leapfrog), and is
# reflected where it meets the boundary [Afshar 2015]; the Metropolis rule corrects the errors of
# the kicks. Straight paths leave a cone by 4×4 eigenvalues, and velocities may have any scale: with
# that of the posterior and its boundary, a narrow corner reflects no more often than a wide one.
# (Between kicks that are exact [Pakman 2014] the path is a circle and the scale that of the
# Gaussian alone: up to 230 reflections a draw on seven robots, for 30 here, and each costs more.)
#
# Many chains run at once, as rows of the arrays. `cone.Cone` is the region and finds the first
# exit.


#: Range of the time of one transition; in a quarter turn, 1.6, a Gaussian forgets where it was.
TURN: tuple[Tolerance, Tolerance] = (1.5, 2.5)

#: Kicks of one transition: nine of ten are accepted with a hundred parameters.
KICKS = 7


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
    push = rng.standard_normal(eta.shape)
    turn = rng.uniform(*TURN, len(eta))
    flight = Flight(region, root, eta, mean, sd, push, turn)
    pieces = 0
    # A path of more straight pieces is given up: the chain stays, so the sampler stays exact.
    while pieces < 2000 and not flight.advance():
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
        self.region = region
        self.root = root
        self.scale = root @ root.T
        self.mean = mean
        self.sd = sd
        self.x = np.array(eta)
        self.v = push @ root.T
        self.y = region.offset + eta @ region.map.T
        self.dy = self.v @ region.map.T
        self.gap = turn / KICKS
        self.left = np.array(self.gap)
        self.kicks = np.full(len(eta), KICKS)
        self.start = self.energy()
        self._kick(np.arange(len(eta)), self.gap / 2)

    @property
    def arrived(self) -> np.ndarray:
        """Which chains are at the end of their way and inside the region, (K,) bool."""
        return (self.kicks == 0) & self.region.contains(self.y)

    def energy(self) -> Array:
        """Minus the logarithm (K,) of the density of positions and velocities."""
        off = (self.x - self.mean) / self.sd
        push = np.linalg.solve(self.root, self.v.T)
        return (np.einsum("kp,kp->k", off, off) + np.einsum("pk,pk->k", push, push)) / 2

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
        halves = np.where(self.kicks[k] > 0, 1, 2)
        self._kick(k, self.gap[k] / halves)
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


# The middle of a posterior with its boundary, and how wide it is there.
#
# Both come from the density times a logarithmic barrier [Nesterov 1994]. Where the data push
# against the boundary at a rate d the barrier's optimum is 1/d away from it and 1/d wide, like the
# posterior; between two walls it is in the middle and a third of the gap wide. No draws are needed.


#: Newton's method stops when it may still gain this much of the logarithm of the density, and
#: after so many steps; it needs ten to thirty.
GAIN: Tolerance = 1e-3
STEPS = 200


def find_centre(model: Diagonal, region: Cone, start: Array) -> tuple[Array, Array]:
    """Find the optimum of density and barrier.

    Parameters
    ----------
    model : Diagonal
        Of one data set.
    region : Cone
    start : (p,)
        Inside the region.

    Returns
    -------
    centre : (p,)
    root : (p, p)
        ``root rootᵀ`` is about the covariance of the posterior.
    """
    eta = start
    root = np.eye(len(start))
    # Rounds of noise variance and parameters in turn.
    for _ in range(3):
        v = model.typical_variance(eta[None])
        mean, sd = model.conditional(v)
        eta, root = _climb(mean[0], sd[0], region, eta)
    return eta, root


def _climb(mean: Array, sd: Array, region: Cone, eta: Array) -> tuple[Array, Array]:
    """Newton's method for a Gaussian and the barrier, which are self-concordant together."""
    value, slope, bend = _cost(eta, mean, sd, region)
    for _ in range(STEPS):
        root = np.linalg.inv(np.linalg.qr(bend, mode="r"))
        step = root @ (root.T @ slope)
        gain = float(slope @ step)
        if gain < GAIN:
            break
        # A step this short stays inside and gains; a longer one is tried first.
        share = 1.0
        safe = 1 / (1 + np.sqrt(gain))
        while True:
            new = _cost(eta - share * step, mean, sd, region)
            # Share of the promised gain that a step must bring [Armijo 1966].
            if share <= safe or new[0] < value - 0.1 * share * gain:
                break
            share = max(share / 2, safe)
        eta = eta - share * step
        value, slope, bend = new
    return eta, root


def _cost(eta: Array, mean: Array, sd: Array, region: Cone) -> tuple[float, Array, Array]:
    """Minus the logarithm of density and barrier, its slope, and a root of its bend."""
    value, slope, bend = region.barrier(eta)
    off = (eta - mean) / sd
    penalty = float(off @ off) / 2
    bends = np.vstack([np.diag(1 / sd), bend])
    return value + penalty, slope + off / sd, bends


# Exact draws from a posterior: noise variance and parameters in turn, many chains at once.
#
# What to use when: `ExactSampler.step` alone is the fastest way to a posterior whose model is the
# one of `target`, and to many replicates of an experiment at once (calibration). `ensemble` runs
# it inside emcee, where independent ensembles give the diagnostics.


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

    def centred(self, eta: Array) -> tuple[ExactSampler, Array]:
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
        # Distance of starting points from an inner one, in posterior standard deviations.
        step = 1.5 * rng.standard_normal(start.shape) @ self.root.T
        for _ in range(60):
            outside = ~self.contains(start + step)
            if not outside.any():
                break
            step[outside] /= 2
        return np.where(self.contains(start + step)[:, None], start + step, start)


def build_sampler(target: Target) -> ExactSampler:
    """Prepare the exact sampler of a posterior."""
    entries = target.region.cone_map[:, UPPER].reshape(-1, target.size)
    m = len(target.region.rows)
    both = np.vstack([target.region.rows, entries])
    # Points that are outside by rounding count as inside: rows and diagonals of matrices have this
    # tolerance. How far outside is inside, as a share of the change by one prior standard
    # deviation.
    room = TINY * np.abs(both) @ target.prior.sd
    room[m:] *= np.tile(UPPER % 5 == 0, len(entries) // 10)
    room[:m] -= target.region.least
    region = Cone(both @ target.basis, both @ target.origin + room, m)
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
        When it is not.
    """
    eta = target.to_eta(start)
    if not sampler.contains(eta[None])[0]:
        raise ValueError(
            "posterior: the starting point is not inside the physical set. Expected an inner "
            "point; use the projection with a margin, project(data, region, margin=1e-3).phi."
        )
    return eta
