"""What noise remembers: autocorrelation times, autoregression, restricted likelihood.

`ARNoise` is fitted to each joint beside whatever columns explain; simulated repetitions have noise
that resembles a residual.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from copy import copy
from itertools import pairwise

import numpy as np
import scipy

from identifiability.estimation.rules import RULES
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import signals
from identifiability.logs.prepare import Dataset

# What residuals say about the noise: autocorrelation and what it does to σ.


#: White noise that is taken to be there beside the residual, as a share of its variance: logs
#: that were filtered before they were stored have empty bands, which whitening would blow up.
FLOOR: Tolerance = 0.05


def autocorrelation(residual: Array) -> Array:
    """Return the autocorrelation of each column of residuals (N, n) by FFT, (N, n); 1 at lag 0."""
    size = 1 << (2 * len(residual) - 1).bit_length()
    spectrum = np.fft.rfft(residual - residual.mean(0), size, axis=0)
    acf = np.fft.irfft(np.abs(spectrum) ** 2, size, axis=0)[: len(residual)]
    variance = np.where(acf[0] > 0, acf[0], 1.0)
    scaled: Array = acf / variance
    return scaled


def autocorrelation_time(residual: Array) -> Array:
    """Return the integrated autocorrelation time of each column of (N, n), at least 1, (n,).

    ``1 + 2 Σ ρ_k`` up to the first lag beyond `memories` times the sum so far. Variances of
    means grow by it; standard deviations of white-noise formulas by its root.
    """
    return np.maximum(integrate_correlation(autocorrelation(residual)), 1.0)


def integrate_correlation(acf: Array) -> Array:
    """Return the integrated autocorrelation time of correlations at lags 0, 1, … (N, n), (n,)."""
    times = 2.0 * np.cumsum(acf, axis=0) - 1.0
    beyond = np.arange(len(acf))[:, None] >= RULES.memories * times
    window = np.where(beyond.any(0), beyond.argmax(0), len(acf) - 1)
    time: Array = times[window, np.arange(acf.shape[1])]
    return time


# Autoregressive series by their partial autocorrelations: predict, whiten, colour.
#
# Any partial autocorrelations inside (-1, 1) make a stationary series [Monahan 1984]; innovations
# have unit variance throughout.


Runs = Sequence[tuple[int, int]]


@frozen
class JointRuns:
    """Stretches of samples by joint, as (start, stop): between them its torque is no data.

    Attributes
    ----------
    each : tuple of Runs, (n,)
    """

    each: tuple[Runs, ...]

    @staticmethod
    def of(runs: Runs, data: np.ndarray) -> JointRuns:
        """Return the parts of stretches at which torque of each joint is `data` (N, n)."""
        if data.all():
            return JointRuns((runs,) * data.shape[1])
        return JointRuns(tuple(_data_runs(runs, own) for own in data.T))


def _data_runs(runs: Runs, data: np.ndarray) -> Runs:
    out: list[tuple[int, int]] = []
    for start, stop in runs:
        edges = start + np.flatnonzero(np.diff(data[start:stop], prepend=False, append=False))
        out += zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return out


def take_data(runs: Runs, y: Array, *others: Array) -> tuple[Runs, list[Array]]:
    """Return rows (N, …) that lie in stretches, and the stretches among them."""
    if sum(stop - start for start, stop in runs) == len(y):
        return runs, [y, *others]
    inside = np.concatenate([np.arange(0), *(np.arange(a, b) for a, b in runs)])
    ends = np.cumsum([0, *(b - a for a, b in runs)]).tolist()
    return list(pairwise(ends)), [x[inside] for x in (y, *others)]


def runs_of(runs: Runs | JointRuns, joint: int) -> Runs:
    """Return the stretches of a joint."""
    return runs.each[joint] if isinstance(runs, JointRuns) else runs


def levinson(pacf: Array) -> tuple[list[Array], Array]:
    """Return predictors of order 0 … p and their error variances, the last one 1.

    Parameters
    ----------
    pacf : (p,) or (p, B)
        Partial autocorrelations, of several series side by side.
    """
    predictors = [np.empty((0, *pacf.shape[1:]))]
    for r in pacf:
        before = predictors[-1]
        longer = np.empty((len(before) + 1, *pacf.shape[1:]))
        longer[:-1], longer[-1] = before - r * before[::-1], r
        predictors.append(longer)
    ones = np.ones((1, *pacf.shape[1:]))
    shrink = np.concatenate([ones, np.cumprod(1 - pacf**2, axis=0)])
    return predictors, shrink / shrink[-1]


def innovation_filter(predictor: Array) -> Array:
    """Return the filter (m + 1,) that leaves of a series what m samples before do not predict."""
    out = np.ones(len(predictor) + 1)
    np.negative(predictor, out=out[1:])
    return out


def colour(e: Array, pacf: Array) -> Array:
    """Return stationary autoregressive noise with innovations e (N,)."""
    predictors, variances = levinson(pacf)
    p = min(len(pacf), len(e))
    x = np.array(e, float)
    for m in range(p):
        x[m] *= np.sqrt(variances[m])
        x[m] += predictors[m] @ x[:m][::-1]
    if len(e) > p > 0:
        a = innovation_filter(predictors[-1])
        start = scipy.signal.lfiltic([1.0], a, x[:p][::-1])
        x[p:] = scipy.signal.lfilter([1.0], a, e[p:], zi=start)[0]
    return x


def autocovariance(pacf: Array, most: int) -> Array:
    """Return autocovariances at lags 0 … most for unit innovations, (most + 1,)."""
    predictors, variances = levinson(pacf)
    p = len(pacf)
    out = np.zeros(most + 1)
    out[0] = variances[0]
    for k in range(1, most + 1):
        if k > p:
            out[k] = predictors[p] @ out[k - p : k][::-1]
        else:  # the last partial autocorrelation of an order gives the next lag [Levinson 1947]
            out[k] = pacf[k - 1] * variances[k - 1] + predictors[k - 1] @ out[1:k][::-1]
    return out


def whiten(x: Array, runs: Runs, pacf: Array) -> Array:
    """Return one-step prediction errors of x (N, …) in units of their standard deviation.

    They are zero between the stretches.
    """
    predictors, variances = levinson(pacf)
    # All stretches at once: rows that are data may come in hundreds of short ones.
    first, stop = np.array(runs, int).reshape(-1, 2).T
    out = np.array(x, float)
    for k, a in enumerate(predictors[-1], start=1):
        out[k:] -= a * x[:-k]
    for m in range(len(pacf)):
        at = (first + m)[first + m < stop]
        error = x[at]
        for k, a in enumerate(predictors[m], start=1):
            error = error - a * x[at - k]
        out[at] = error / np.sqrt(variances[m])
    edges = np.zeros(len(x) + 1, int)
    np.add.at(edges, first, 1)
    np.add.at(edges, stop, -1)
    out[np.cumsum(edges[:-1]) == 0] = 0.0
    return out


# Restricted likelihood of autoregressive noise beside columns that are fitted with it.


#: Highest order that is tried.
HIGHEST_ORDER = 4
#: Partial autocorrelations are held below tanh(this): slower noise cannot be told from a drift.
BOUND: Tolerance = 3.5
#: Shares of the trace below which directions are rounding, the next where one does not suffice.
ROUNDING: tuple[Tolerance, ...] = (1e-14, 1e-12, 1e-10)
#: A residual below this share of the torque is rounding, and has no correlation to speak of.
RESIDUAL_ROUNDING: Tolerance = 1e-8
#: Steps of the search of one order, and how often one is halved, at most; the share of what its
#: slope promises by which it has to descend, and the promise of deviance at which the search ends.
DESCENTS, HALVINGS = 30, 10
DESCENDS: Tolerance = 1e-4
CLOSE: Tolerance = 1e-3
#: Step of the derivatives in the search of one order.
STEP: Tolerance = 1e-4


def _lay_out() -> tuple[dict[tuple[int, int], Array], dict[tuple[str, int, int], int]]:
    """Return what lagged products count for in those of filtered rows.

    For each order p, and each length n of stretches: the coefficients of all M lagged products by
    what number m of rows are known before, and by pairs of lags, (M, (p + 1) · (p + 1)²).
    """
    P = HIGHEST_ORDER
    keys = [("all", 0, d) for d in range(P + 1)]
    keys += [("first", s, d) for s in range(P) for d in range(s + 1)]
    keys += [("last", r, d) for r in range(P) for d in range(P + 1)]
    at = {key: k for k, key in enumerate(keys)}
    tables = {}
    for p, n in np.ndindex(P + 1, P + 1):
        out = np.zeros((len(keys), p + 1, p + 1, p + 1))
        for m, i, j in np.ndindex(out.shape[1:]):
            d, late = abs(i - j), min(i, j)
            if m == p <= n:
                out[at["all", 0, d], m, i, j] += 1.0
                for s in range(d, p - late):
                    out[at["first", s, d], m, i, j] -= 1.0
                for r in range(late):
                    out[at["last", r, d], m, i, j] -= 1.0
            elif max(i, j) <= m < min(p, n):
                out[at["first", m - late, d], m, i, j] += 1.0
        tables[p, n] = out.reshape(len(keys), -1)
    return tables, at


_TABLES, _AT = _lay_out()


@frozen
class LaggedProducts:
    """Products of rows with those a few samples before: what whitening by a short memory needs.

    Products of rows that autoregressive noise whitens are sums over pairs of lags, and all pairs of
    one lag differ by the ends of stretches alone. So rows are met once, however many noises are
    tried.

    Attributes
    ----------
    products : (l M, m, m)
        Of stretches of l lengths, those as long as the highest order or longer together: at every
        lag, of each of the first rows with those before it, and of each of the last ones.
    lengths : tuple of int
        Of the stretches, at most the highest order.
    counts : tuple of (int, int)
        How many stretches and rows there are of each.
    """

    products: Array
    lengths: tuple[int, ...]
    counts: tuple[tuple[int, int], ...]

    @staticmethod
    def of(Z: Array, runs: Runs) -> LaggedProducts:
        """Return those of rows (N, m) in stretches."""
        lengths = sorted({min(b - a, HIGHEST_ORDER) for a, b in runs if b > a})
        parts = [[Z[a:b] for a, b in runs if min(b - a, HIGHEST_ORDER) == n] for n in lengths]
        counts = tuple((len(own), sum(map(len, own))) for own in parts)
        none = np.zeros((0, *Z.shape[1:], *Z.shape[1:]))
        return LaggedProducts(
            np.concatenate([none, *map(_multiply, parts)]), tuple(lengths), counts
        )

    @property
    def rows(self) -> int:
        """Number of rows."""
        return sum(rows for _, rows in self.counts)

    def weigh(self, pacf: Array) -> tuple[Array, Array, Array]:
        """Return what products count for in those of what noise leaves of the rows.

        Its innovations have unit variance.

        Parameters
        ----------
        pacf : (p, B)
            Partial autocorrelations of B noises.

        Returns
        -------
        weights : (l M, B)
        logdet : (B,)
            Of the covariance of a series.
        white : (B,)
            Sum of the squares to be expected of white noise of unit variance in their stead.
        """
        predictors, variances = levinson(pacf)
        p, B = pacf.shape
        filters = np.zeros((p + 1, p + 1, B))
        filters[:, 0] = 1.0
        for m, a in enumerate(predictors):
            np.negative(a, out=filters[m, 1 : m + 1])
        filters /= np.sqrt(variances)[:, None]
        squares = (filters[:, :, None] * filters[:, None]).reshape(-1, B)
        lengths, logs = (filters**2).sum(1), np.log(variances)
        weights = np.empty((len(self.lengths), len(_AT), B))
        logdet, white = np.zeros((2, B))
        for k, (n, (runs, rows)) in enumerate(zip(self.lengths, self.counts, strict=True)):
            weights[k], most = _TABLES[p, n] @ squares, min(p, n)
            logdet += runs * logs[:most].sum(0)
            white += runs * lengths[:most].sum(0)
            if p <= n:
                white += (rows - p * runs) * lengths[p]
        return weights.reshape(-1, pacf.shape[1]), logdet, white

    def weighed(self, weights: Array) -> Array:
        """Return the sum of products by weights, (m, m)."""
        flat = self.products.reshape(len(weights), -1)
        total: Array = (weights @ flat).reshape(self.products.shape[1:])
        return total


def _multiply(parts: Sequence[Array]) -> Array:
    """Return the products of a stack, symmetric, (M, m, m)."""
    out = np.zeros((len(_AT), parts[0].shape[1], parts[0].shape[1]))
    for (where, place, d), k in _AT.items():
        if where == "all":
            for z in parts:
                out[k] += z[: max(len(z) - d, 0)].T @ z[d:]
        else:
            at = [place if where == "first" else len(z) - 1 - place for z in parts]
            known = [(z, i) for z, i in zip(parts, at, strict=True) if d <= i < len(z)]
            if known:
                out[k] = np.array([z[i - d] for z, i in known]).T @ np.array(
                    [z[i] for z, i in known]
                )
    return 0.5 * (out + out.transpose(0, 2, 1))


class RestrictedLikelihood:
    """Restricted likelihood of autoregressive noise.

    Parameters
    ----------
    lagged : LaggedProducts
        Of an orthonormal basis (N, k) and of what it leaves of a series of unit length.
    left : float
        Sum of squares of what it leaves.
    scale : float
        Length of the series.
    floor : float, optional
    prior : (k,), optional
        Precision of what is random, in that of the innovations; zero for what is fixed, as all is
        by default.
    """

    def __init__(
        self,
        lagged: LaggedProducts,
        left: float,
        scale: float,
        floor: float = FLOOR,
        prior: Array | None = None,
    ) -> None:
        self.lagged, self.scale, self.k = lagged, scale, lagged.products.shape[1] - 1
        self.rows = lagged.rows
        self.prior = np.zeros(self.k) if prior is None else prior
        self.dof = max(self.rows - int(np.sum(self.prior == 0)), 1)
        self.floor = floor * left / self.rows
        self.left = left * scale**2 / self.dof

    @property
    def silent(self) -> bool:
        """Whether what is left is rounding."""
        return bool(self.left * self.dof <= (RESIDUAL_ROUNDING * self.scale) ** 2)

    @staticmethod
    def of(y: Array, basis: Array, runs: Runs, floor: float = FLOOR) -> RestrictedLikelihood:
        """Return that of a series y (N,) beside an orthonormal basis (N, k)."""
        scale = float(np.linalg.norm(y)) or 1.0
        left = y / scale
        left = left - basis @ (basis.T @ left)
        lagged = LaggedProducts.of(np.column_stack([basis, left]), runs)
        return RestrictedLikelihood(lagged, float(left @ left), scale, floor)

    def with_prior(self, prior: Array) -> RestrictedLikelihood:
        """Return that of the same rows under another prior (k,)."""
        other = copy(self)
        other.prior = prior
        other.dof = max(self.rows - int(np.sum(prior == 0)), 1)
        return other

    def deviances(self, theta: Array, at: np.ndarray, precisions: Array) -> Array:
        """Return the deviance where columns (b,) have each of several precisions (c,), (c,).

        The others as the prior says: what they leave is met once.
        """
        weights, (logdet,), (white,) = self.lagged.weigh(np.tanh(theta)[:, None])
        G, others = self._products(weights[:, 0], white), np.delete(np.arange(self.k), at)
        G[others, others] += self.prior[others]
        L = np.linalg.cholesky(G[np.ix_(others, others)])
        own = np.append(at, self.k)
        half = scipy.linalg.solve_triangular(L, G[np.ix_(others, own)], lower=True)
        left = G[np.ix_(own, own)] - half.T @ half
        e, U = np.linalg.eigh(left[:-1, :-1])
        total = np.maximum(e, 0.0) + precisions[:, None]
        rss = np.maximum(left[-1, -1] - ((U.T @ left[:-1, -1]) ** 2 / total).sum(1), 1e-300)
        known = np.log(self.prior[others][self.prior[others] > 0]).sum()
        size = 2 * np.log(np.diag(L)).sum() + np.log(total / precisions[:, None]).sum(1) - known
        found: Array = self.dof * np.log(rss / self.dof) + logdet + size
        return found

    def _products(self, weights: Array, white: float) -> Array:
        G = self.lagged.weighed(weights)
        G[-1, -1] += self.floor * white
        G.ravel()[:: len(G) + 1] += ROUNDING[0] * np.trace(G)
        return G

    def _factor(self, weights: Array, white: float) -> Array:
        G = self._products(weights, white)
        G[range(self.k), range(self.k)] += self.prior
        for share in ROUNDING:
            G.ravel()[:: len(G) + 1] += share * np.trace(G)
            try:
                return np.linalg.cholesky(G)
            except np.linalg.LinAlgError:  # slow noise leaves nothing of slow columns
                continue
        raise np.linalg.LinAlgError("The whitened columns are not finite.")

    def deviance(self, theta: Array) -> float:
        """Return minus twice the restricted log-likelihood, sigma profiled out."""
        weights, (logdet,), (white,) = self.lagged.weigh(np.tanh(theta)[:, None])
        return self._deviance(self._factor(weights[:, 0], white), logdet)

    def _deviance(self, L: Array, logdet: float) -> float:
        diagonal = np.diag(L)
        rss = max(diagonal[-1] ** 2, 1e-300)
        known = np.log(self.prior[self.prior > 0]).sum()
        size = 2 * np.log(diagonal[:-1]).sum() - known
        return float(self.dof * np.log(rss / self.dof) + logdet + size)

    def slope(self, theta: Array) -> tuple[float, Array]:
        """Return the deviance and its derivatives, (p,).

        Products are met once: what changes with theta is what each of them counts for.
        """
        p, steps = len(theta), STEP * np.eye(len(theta))
        near = theta[:, None] + np.concatenate([np.zeros((p, 1)), steps, -steps], axis=1)
        weights, logdets, white = self.lagged.weigh(np.tanh(near))
        L = self._factor(weights[:, 0], white[0])
        inverse, _ = scipy.linalg.lapack.dtrtri(L, lower=1)
        inverse[-1] *= np.sqrt(self.dof)
        toward = inverse.T @ inverse  # derivative by the whitened products
        flat = self.lagged.products.reshape(len(weights), -1) @ toward.ravel()
        around = flat @ weights + logdets + toward[-1, -1] * self.floor * white
        slope = (around[1 : p + 1] - around[p + 1 :]) / (2 * STEP)
        return self._deviance(L, float(logdets[0])), slope

    def sigma(self, theta: Array) -> float:
        """Return the standard deviation of the innovations."""
        weights, _, (white,) = self.lagged.weigh(np.tanh(theta)[:, None])
        L = self._factor(weights[:, 0], white)
        return max(float(L[-1, -1]) * self.scale / float(np.sqrt(self.dof)), 1e-12 * self.scale)

    def maximise(self) -> Array:
        """Return the transformed partial autocorrelations (p,) of the order with the least BIC.

        None explains more than the highest: orders between are tried while they may pay by that.
        """
        best = theta = np.empty(0)
        if self.silent:
            return best
        price, least, lowest = np.log(self.dof), self.deviance(best), -np.inf
        for order in range(1, HIGHEST_ORDER + 1):
            if lowest + order * price >= least:
                break
            try:
                theta, deviance = self.descend(np.append(theta, 0.3 if order == 1 else 0.0))
            except np.linalg.LinAlgError:  # noise that slow leaves nothing of the columns
                break
            value = deviance + order * price
            if value < least - ROUNDOFF:
                best, least = theta, value
            if order == 1:
                with suppress(np.linalg.LinAlgError):
                    lowest = self.descend(np.pad(theta, (0, HIGHEST_ORDER - 1)))[1]
        return best

    def descend(self, start: Array) -> tuple[Array, float]:
        """Return where the deviance is least for the order of a start (p,), and how much it is.

        By BFGS steps, halved until they descend. SciPy's take as many, and longer to import.
        """
        usual = 0.5 / self.dof * np.eye(len(start))  # steps are about as long as they should be
        theta, inverse, (least, slope) = start, usual, self.slope(start)
        for _ in range(DESCENTS):
            step = np.clip(theta - inverse @ slope, -BOUND, BOUND) - theta
            promised = -float(slope @ step)
            for share in 0.5 ** np.arange(HALVINGS if promised > CLOSE else 0):
                value, there = self.slope(theta + share * step)
                if value <= least - DESCENDS * share * promised:
                    break
            else:
                if inverse is usual:
                    break
                inverse = usual
                continue
            move, turn = share * step, there - slope
            if (along := float(move @ turn)) > 0:
                left = np.eye(len(start)) - np.outer(move, turn) / along
                inverse = left @ inverse @ left.T + np.outer(move, move) / along
            theta, least, slope = theta + move, value, there
        return theta, least


# `ARNoise`: autoregressive noise of each joint, fitted beside whatever the dictionary explains.
#
# Residuals of a fit look whiter than the noise was, because slow noise is swallowed by the
# columns. The likelihood of what is left after projection (REML [Harville 1977]) has no such bias:
# it is fitted beside the base model and the whole dictionary, so that a large slow effect is not
# taken for slow noise either. Coefficients are held as partial autocorrelations, which keeps every
# model stationary [Monahan 1984].


@frozen
class JointNoise:
    """Noise of one joint.

    Attributes
    ----------
    pacf : (p,)
        Partial autocorrelations.
    sigma : float [N·m or N]
        Standard deviation of the innovations.
    """

    pacf: Array
    sigma: float


#: Noise of all joints, which are independent.
ARNoise = tuple[JointNoise, ...]


def span_columns(blocks: Sequence[Array], most: int) -> Array:
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
        # Of the products: the singular value decomposition of some blocks does not converge.
        squares, vectors = np.linalg.eigh(left.T @ left)
        first = max(
            int((squares <= RULES.column_short**2).sum()), len(squares) - (most - basis.shape[1])
        )
        kept = (left @ (vectors[:, first:] / np.sqrt(squares[first:])))[:, ::-1]
        basis = np.column_stack([basis, kept])
    return basis


# Noise that resembles a residual: autoregressive at each actuator, for simulated repetitions.
#
# A residual looks whiter and smaller than the noise was, because slow noise is swallowed by the
# columns that are fitted; on the motion of one log a correlation of 0.97 from sample to sample
# looks like 0.75. So the noise is fitted beside these columns by restricted likelihood [Harville
# 1977].


#: Rows that are fitted; more tell nothing new of the noise.
MOST_ROWS = 20_000


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
        shown = [(a, min(b, MOST_ROWS)) for a, b in own if a < MOST_ROWS]
        rows = shown[-1][1] if shown else 0
        fits.append(_fit(y[:rows], X[:rows], shown) if rows else (np.empty(0), 0.0))
    return ResidualNoise(tuple(p for p, _ in fits), np.array([s for _, s in fits]))


def find_runs(samples: Sequence[Dataset]) -> list[tuple[int, int]]:
    """Return the stretches without gaps of the rows of a regression, as (start, stop)."""
    runs: list[tuple[int, int]] = []
    start = 0
    for s in samples:
        t = s.output_times()
        breaks = np.flatnonzero(signals.has_gap(t)) + 1
        runs += pairwise([start, *(start + breaks).tolist(), start + len(t)])
        start += len(t)
    return runs


def _fit(y: Array, X: Array, runs: Runs) -> tuple[Array, float]:
    """Return partial autocorrelations and innovation sd of y (N,) beside X (N, k), least BIC."""
    length = np.linalg.norm(X, axis=0)
    U, s, _ = np.linalg.svd(X[:, length > 0] / length[length > 0], full_matrices=False)
    basis = U[:, s > ROUNDOFF * s.max(initial=0.0)]
    # White noise that is taken to be there beside the residual, as a share of its variance.
    problem = RestrictedLikelihood.of(y, basis, runs, 1e-4)
    if problem.silent:
        return np.empty(0), float(np.sqrt(problem.left))
    best = problem.maximise()
    return np.tanh(best), problem.sigma(best)
