"""Restricted likelihood of autoregressive noise beside columns that are fitted with it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from identifiability.estimation.noise.autoregression import Runs, levinson
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

#: Highest order that is tried.
HIGHEST_ORDER = 4
#: Partial autocorrelations are held below tanh(this): slower noise cannot be told from a drift.
BOUND = 3.5
#: White noise that is taken to be there beside the residual, as a share of its variance: logs that
#: were filtered before they were stored have empty bands, which whitening would blow up.
FLOOR = 0.05
#: Shares of the trace below which directions are rounding, the next where one does not suffice.
ROUNDING = (1e-14, 1e-12, 1e-10)
#: When the search of one order ends, and the step of its derivatives.
STOP, STEP = {"maxiter": 30, "ftol": 1e-6}, 1e-4


def _lay_out() -> tuple[list[Array], list[Array], dict[tuple[str, int, int], int]]:
    """Return what lagged products count for in those of filtered rows.

    For each order p, and each number m of first rows that are known: the coefficients of all M
    lagged products by pairs of lags, (M, (p + 1)²).
    """
    P = HIGHEST_ORDER
    keys = [("all", 0, d) for d in range(P + 1)]
    keys += [("first", s, d) for s in range(P) for d in range(s + 1)]
    keys += [("last", r, d) for r in range(P) for d in range(P + 1)]
    at = {key: k for k, key in enumerate(keys)}
    whole = [np.zeros((len(keys), p + 1, p + 1)) for p in range(P + 1)]
    begun = [np.zeros((len(keys), m + 1, m + 1)) for m in range(P)]
    for p, out in enumerate(whole):
        for i, j in np.ndindex(p + 1, p + 1):
            d, late = abs(i - j), min(i, j)
            out[at["all", 0, d], i, j] += 1.0
            for s in range(d, p - late):
                out[at["first", s, d], i, j] -= 1.0
            for r in range(late):
                out[at["last", r, d], i, j] -= 1.0
    for m, out in enumerate(begun):
        for i, j in np.ndindex(m + 1, m + 1):
            out[at["first", m - min(i, j), abs(i - j)], i, j] += 1.0
    return [w.reshape(len(keys), -1) for w in whole], [w.reshape(len(keys), -1) for w in begun], at


_WHOLE, _BEGUN, _AT = _lay_out()


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

    @property
    def plain(self) -> Array:
        """Products of the rows as they are, (m, m)."""
        total: Array = self.products[:: len(_AT)].sum(0)
        return total

    def times(self, T: Array) -> LaggedProducts:
        """Return those of other columns, rows @ T with T (m, k)."""
        return LaggedProducts(T.T @ self.products @ T, self.lengths, self.counts)

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
        ones = np.ones((1, pacf.shape[1]))
        filters = [np.concatenate([ones, -a]) for a in predictors]
        squares = [(c[:, None] * c).reshape(-1, pacf.shape[1]) for c in filters]
        p, weights = len(pacf), np.zeros((len(self.lengths), len(_AT), pacf.shape[1]))
        logdet, white = np.zeros((2, pacf.shape[1]))
        for k, (n, (runs, rows)) in enumerate(zip(self.lengths, self.counts, strict=True)):
            if p <= n:
                weights[k] += _WHOLE[p] @ squares[p]
                white += (rows - p * runs) * squares[p][:: p + 2].sum(0)
            for m in range(min(p, n)):
                weights[k] += _BEGUN[m] @ squares[m] / variances[m]
                logdet += runs * np.log(variances[m])
                white += runs * squares[m][:: m + 2].sum(0) / variances[m]
        return weights.reshape(-1, pacf.shape[1]), logdet, white

    def weighed(self, weights: Array) -> Array:
        """Return the sum of products by weights, (m, m)."""
        flat = self.products.reshape(len(weights), -1)
        total: Array = (weights @ flat).reshape(self.products.shape[1:])
        return total

    def whitened(self, pacf: Array) -> Array:
        """Return the products of what noise leaves of the rows, (m, m)."""
        return self.weighed(self.weigh(pacf[:, None])[0][:, 0])


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
    """

    def __init__(
        self, lagged: LaggedProducts, left: float, scale: float, floor: float = FLOOR
    ) -> None:
        self.lagged, self.scale, self.k = lagged, scale, lagged.products.shape[1] - 1
        self.rows = lagged.rows
        self.dof = max(self.rows - self.k, 1)
        self.floor = floor * left / self.rows
        self.left = left * scale**2 / self.dof

    @staticmethod
    def of(y: Array, basis: Array, runs: Runs, floor: float = FLOOR) -> RestrictedLikelihood:
        """Return that of a series y (N,) beside an orthonormal basis (N, k)."""
        scale = float(np.linalg.norm(y)) or 1.0
        left = y / scale
        left = left - basis @ (basis.T @ left)
        lagged = LaggedProducts.of(np.column_stack([basis, left]), runs)
        return RestrictedLikelihood(lagged, float(left @ left), scale, floor)

    def _factor(self, theta: Array) -> tuple[Array, float]:
        (weights,), (logdet,), (white,) = (x.T for x in self.lagged.weigh(np.tanh(theta)[:, None]))
        G = self.lagged.weighed(weights)
        G[-1, -1] += self.floor * white
        for share in ROUNDING:
            G.ravel()[:: len(G) + 1] += share * np.trace(G)
            try:
                return np.linalg.cholesky(G), logdet
            except np.linalg.LinAlgError:  # slow noise leaves nothing of slow columns
                continue
        raise np.linalg.LinAlgError("The whitened columns are not finite.")

    def deviance(self, theta: Array) -> float:
        """Return minus twice the restricted log-likelihood, sigma profiled out."""
        return self._deviance(*self._factor(theta))

    def _deviance(self, L: Array, logdet: float) -> float:
        diagonal = np.diag(L)
        rss = max(diagonal[-1] ** 2, 1e-300)
        return float(self.dof * np.log(rss / self.dof) + logdet + 2 * np.log(diagonal[:-1]).sum())

    def slope(self, theta: Array) -> tuple[float, Array]:
        """Return the deviance and its derivatives, (p,).

        Products are met once: what changes with theta is what each of them counts for.
        """
        L, logdet = self._factor(theta)
        inverse = scipy.linalg.solve_triangular(L, np.eye(len(L)), lower=True, check_finite=False)
        inner, last = inverse[:-1], inverse[-1] * np.sqrt(self.dof)
        toward = inner.T @ inner + np.outer(last, last)  # derivative by the whitened products
        flat = self.lagged.products.reshape(len(self.lagged.products), -1) @ toward.ravel()
        p, steps = len(theta), STEP * np.eye(len(theta))
        near = np.tanh(theta[:, None] + np.concatenate([steps, -steps], axis=1))
        weights, logdets, white = self.lagged.weigh(near)
        around = flat @ weights + logdets + toward[-1, -1] * self.floor * white
        return self._deviance(L, logdet), (around[:p] - around[p:]) / (2 * STEP)

    def sigma(self, theta: Array) -> float:
        """Return the standard deviation of the innovations."""
        L, _ = self._factor(theta)
        return max(float(L[-1, -1]) * self.scale / float(np.sqrt(self.dof)), 1e-12 * self.scale)

    def spread(self, theta: Array) -> Array:
        """Return the covariance of theta from the curvature of the deviance."""
        p = len(theta)
        h = 0.05
        H = np.zeros((p, p))
        unit = h * np.eye(p)
        for i in range(p):
            for j in range(i + 1):
                signs = ((1, 1), (1, -1), (-1, 1), (-1, -1))
                total = sum(
                    a * b * self.deviance(theta + a * unit[i] + b * unit[j]) for a, b in signs
                )
                H[i, j] = H[j, i] = total / (8 * h * h)
        values, vectors = np.linalg.eigh(H)
        limited = np.maximum(values, self.dof / 6)  # sd of Fisher's z is about 1/√dof
        covariance: Array = (vectors / limited) @ vectors.T
        return covariance

    def maximise(self) -> Array:
        """Return the transformed partial autocorrelations (p,) of the order with the least BIC."""
        best = theta = np.empty(0)
        least = self.deviance(theta)
        for order in range(1, HIGHEST_ORDER + 1):
            start, bounds = np.append(theta, 0.3 if order == 1 else 0.0), [(-BOUND, BOUND)] * order
            found = scipy.optimize.minimize(
                self.slope, start, method="L-BFGS-B", jac=True, bounds=bounds, options=STOP
            )
            theta = found.x
            value = found.fun + order * np.log(self.dof)
            if value < least - 1e-9:
                best, least = theta, value
        return best
