"""What noise remembers: autocorrelation times, autoregression, restricted likelihood.

`ARNoise` is fitted to the residual of each joint, given all columns that explain it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import scipy

from identifiability.foundation.linalg import RANK_TOLERANCE, ROUNDOFF, TINY
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import signals
from identifiability.regression.regression import Chunk

from .rules import RULES

# Noise from residuals: its autocorrelation and the effect on σ.


#: White noise that is assumed in addition to the residual, as a share of its variance: logs that
#: were filtered before they were stored have empty bands, which whitening would amplify.
FLOOR: Tolerance = 1e-2
#: Smallest part of a unit column that is outside the model; below it the column is absent.
THIN: Tolerance = 1e-6
#: Trial precisions of candidates, in units of that of the innovations; the last is that of absent
#: ones. Then the rounds in which the precisions of all functions and the noise are updated in turn.
PRECISIONS = np.append(np.geomspace(1e-6, 1e5, 12), np.inf)
ROUNDS = 4
#: Most columns of candidates in the model when the noise is measured.
DIRECTIONS = 120


# Autoregressive series by their partial autocorrelations: predict and whiten.
#
# Any partial autocorrelations inside (-1, 1) make a stationary series [Monahan 1984]; innovations
# have unit variance throughout.


Runs = Sequence[tuple[int, int]]


#: Stretches of samples by joint, as (start, stop): between them its torque is no data.
JointRuns = tuple[Runs, ...]


def split_runs(runs: Runs, data: np.ndarray) -> JointRuns:
    """Return the parts of stretches at which torque of each joint is `data` (N, n)."""
    return tuple(_data_runs(runs, own) for own in data.T)


def _data_runs(runs: Runs, data: np.ndarray) -> Runs:
    out: list[tuple[int, int]] = []
    for start, stop in runs:
        edges = start + np.flatnonzero(np.diff(data[start:stop], prepend=False, append=False))
        starts = edges[::2].tolist()
        stops = edges[1::2].tolist()
        out += zip(starts, stops, strict=True)
    return out


def levinson(pacf: Array) -> tuple[list[Array], Array]:
    """Return predictors of order 0 … p and their error variances, the last one 1.

    Parameters
    ----------
    pacf : (p,)
        Partial autocorrelations.
    """
    predictors = [np.empty(0)]
    for r in pacf:
        before = predictors[-1]
        predictors.append(np.append(before - r * before[::-1], r))
    shrink = np.append(1.0, np.cumprod(1 - pacf**2))
    return predictors, shrink / shrink[-1]


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


def whiten_joints(x: Array, runs: JointRuns, noise: ARNoise) -> Array:
    """Return the whitened rows of each joint in the unit of the rows.

    Parameters
    ----------
    x : (N, n, ...)
        Rows of each of the n joints.
    runs : JointRuns
        Stretches of data of each joint. Rows between them become zero.
    noise : ARNoise
    """
    each = zip(x.swapaxes(0, 1), runs, noise, strict=True)
    return np.stack([whiten(rows, stretches, joint.pacf) for rows, stretches, joint in each], 1)


def whiten_chunk(chunk: Chunk, noise: ARNoise) -> Chunk:
    """Return a chunk of a regression with whitened columns, instruments and torque.

    Each chunk begins a new stretch. That costs at most one row per chunk and joint.
    """
    N = len(chunk.t)
    gaps = np.flatnonzero(signals.has_gap(chunk.t)) + 1 if N > 1 else np.empty(0, int)
    stretches = list(pairwise([0, *gaps.tolist(), N]))
    runs = split_runs(stretches, chunk.data)
    V = chunk.instruments
    W = whiten_joints(chunk.W, runs, noise)
    tau = whiten_joints(chunk.tau, runs, noise)
    instruments = None if V is None else whiten_joints(V, runs, noise)
    return replace(
        chunk,
        W=W,
        tau=tau,
        instruments=instruments,
    )


# Restricted likelihood of autoregressive noise, with columns that are fitted together with it.


#: Highest order that is tried.
HIGHEST_ORDER = 4
#: Partial autocorrelations are held below tanh(this): slower noise is not distinguishable from a
#: drift.
BOUND: Tolerance = 3.5


@frozen
class LaggedProducts:
    """Products of rows with rows a few samples later, for whitening by a short memory.

    Rows are read once for any number of noise models. Let a = (1, -φ) be a filter that whitens a
    series of n ≥ p samples. The whitened series has the products
    ``Σ a_i a_j Σ_t z_(i+t) z_(j+t), t < n - i - j`` [Box & Jenkins 1976, A7.5].

    Attributes
    ----------
    products : (p + 1, p + 1, m, m)
        By i and j, made symmetric.
    rows, runs : int
        How many there are; shorter stretches than the highest order are left out.
    """

    products: Array
    rows: int
    runs: int

    @staticmethod
    def of(Z: Array, runs: Runs) -> LaggedProducts:
        """Return the lagged products of rows (N, m) in stretches."""
        P = HIGHEST_ORDER
        m = Z.shape[1]
        runs = [(a, b) for a, b in runs if b - a >= P]
        first, stop = np.array(runs, int).reshape(-1, 2).T
        out = np.empty((P + 1, P + 1, m, m))
        for lag in range(P + 1):
            ranges = (np.arange(a, b - lag) for a, b in runs)
            at = np.concatenate([np.arange(0), *ranges])
            own = Z[at].T @ Z[at + lag]
            for i in range(P + 1 - lag):
                for ends in (first + i - 1, stop - i - lag) if i else ():
                    own = own - Z[ends].T @ Z[ends + lag]
                out[i, i + lag] = out[i + lag, i] = 0.5 * (own + own.T)
        return LaggedProducts(out, int((stop - first).sum()), len(runs))

    def among(self, columns: np.ndarray) -> LaggedProducts:
        """Return the lagged products of a subset of columns."""
        own = self.products[:, :, columns][..., columns]
        return replace(self, products=np.ascontiguousarray(own))

    @property
    def white(self) -> Array:
        """Squares to be expected of white noise of unit variance after each lag, (p + 1,)."""
        return self.rows - 2.0 * self.runs * np.arange(HIGHEST_ORDER + 1)


def whitening_filter(pacf: Array) -> Array:
    """Return the filters (…, P + 1) of the highest order that whiten, linear in each of pacf.

    Parameters
    ----------
    pacf : (…, p)
        Partial autocorrelations.
    """
    a = np.zeros((*pacf.shape[:-1], HIGHEST_ORDER + 1))
    a[..., 0] = 1.0
    for k in range(pacf.shape[-1]):
        before = a[..., : k + 2]
        reflected = pacf[..., [k]] * before[..., ::-1]
        a[..., : k + 2] = before - reflected
    return a


class RestrictedLikelihood:
    """Restricted likelihood of autoregressive noise.

    Random columns have a precision in units of that of the innovations; it is infinite for absent
    ones; fixed columns have none.

    Parameters
    ----------
    y : (N,)
    basis : (N, k)
        Orthonormal, of what is fixed.
    runs : Runs
    random : sequence of (N, …), optional
        Functions that may be there.
    floor : float, optional
    """

    def __init__(
        self,
        y: Array,
        basis: Array,
        runs: Runs,
        random: Sequence[Array] = (),
        floor: float = FLOOR,
    ) -> None:
        self.scale = float(np.linalg.norm(y)) or 1.0
        beside = y / self.scale
        beside = beside - basis @ (basis.T @ beside)
        Z = np.concatenate([basis, *random], axis=1)
        # By a pivoted factor: singular values do not always converge.
        explained = scipy.linalg.lstsq(Z, beside, cond=THIN, lapack_driver="gelsy")[0]
        rest = beside - Z @ explained
        widths = [basis.shape[1], *(x.shape[1] for x in random)]
        self.owner = np.repeat(np.arange(-1, len(random)), widths)
        self.lagged = LaggedProducts.of(np.column_stack([Z, beside]), runs)
        self.rows = self.lagged.rows
        self.dof = max(self.rows - basis.shape[1], 1)
        self.floor = floor * float(rest @ rest) / self.rows
        self.rounding = float(rest @ rest) <= RANK_TOLERANCE**2
        self.rest = float(np.linalg.norm(rest)) * self.scale

    def whitened(self, a: Array, lagged: LaggedProducts) -> Array:
        """Return products of columns and y that a filter leaves white."""
        G = np.tensordot(np.outer(a, a), lagged.products)
        G[-1, -1] += self.floor * float(a**2 @ lagged.white)
        # Slow noise reduces slow columns to the rounding of their products.
        diagonal = np.diag(lagged.products[0, 0])
        G.ravel()[:: len(G) + 1][:-1] += TINY * diagonal[:-1]
        return G

    def profile(self, values: Array) -> Callable[[Array], tuple[float, Array, float]]:
        """Return a function of transformed partial autocorrelations (p,), with sigma profiled out.

        It gives minus twice the log-likelihood, its slope (p,) and sigma.

        Parameters
        ----------
        values : (f,)
            Precision of each function.
        """
        prior = np.append(values, 0.0)[self.owner]
        there = np.isfinite(prior)
        lagged = self.lagged.among(np.append(there, True))
        prior = np.append(prior[there], 0.0)
        none = -float(np.log(prior[prior > 0]).sum())

        def of(theta: Array) -> tuple[float, Array, float]:
            pacf = np.tanh(theta)
            a = whitening_filter(pacf)
            G = self.whitened(a, lagged) + np.diag(prior)
            root = np.linalg.cholesky(G)
            size = 2.0 * float(np.log(np.diag(root)).sum())
            inverse = np.linalg.inv(G)
            order = 2.0 * lagged.runs * np.arange(1, len(pacf) + 1)
            square = max(1.0 / float(inverse[-1, -1]), TINY**2)
            sized = inverse + (self.dof - 1) * square * np.outer(inverse[-1], inverse[-1])
            turn = 0.5 * (whitening_filter(pacf + 2 * np.eye(len(pacf))) - a)
            by = np.tensordot(lagged.products, sized) @ a
            by += self.floor * sized[-1, -1] * lagged.white * a
            value = self.dof * np.log(square / self.dof) - np.log(square) + size + none
            value -= 0.5 * float(order @ np.log1p(-(pacf**2)))
            slope = order * pacf + 2.0 * (1 - pacf**2) * (turn @ by)
            return value, slope, float(np.sqrt(square / self.dof)) * self.scale

        return of

    def maximise(self, values: Array) -> Array:
        """Return the transformed partial autocorrelations (p,) of the order with the least BIC.

        A higher order may have two optima. From the last order alone rounding chooses one of them,
        so each order also starts nearer to white noise, and the better optimum counts.
        """
        profile = self.profile(values)
        best = theta = np.empty(0)
        least = profile(best)[0]
        how = {"ftol": 1e-3 / self.rows, "gtol": 0.0}
        for order in range(1, HIGHEST_ORDER + 1):
            start = np.append(theta, 0.3 if order == 1 else 0.0)
            limits = [(-BOUND, BOUND)] * order
            starts = [start] if order == 1 else [start, 0.5 * start]
            try:
                each = [
                    scipy.optimize.minimize(
                        lambda x: profile(x)[:2], x, jac=True, bounds=limits, options=how
                    )
                    for x in starts
                ]
            except np.linalg.LinAlgError:  # noise that slow leaves nothing of the columns
                break
            found = min(each, key=lambda x: x.fun)
            theta = found.x
            value = float(found.fun) + order * np.log(self.rows)
            if value < least - ROUNDOFF:
                best = theta
                least = value
            elif order - len(best) == 2:  # of no use, nor was the one before
                break
        return best

    def backfit(self, values: Array, best: Array) -> tuple[float, JointNoise]:
        """Return deviance with prices, and noise, where functions and noise took turns.

        Parameters
        ----------
        values, best : (f,) and (p,)
            Precision of each function at first, and transformed partial autocorrelations.
        """
        price = 2.0 * RULES.smooth_price
        none = PRECISIONS[-1]
        for _ in range(ROUNDS):
            before = values
            values = values.copy()
            G = self.whitened(whitening_filter(np.tanh(best)), self.lagged)
            for k in range(len(values)):
                own = np.append(self.owner == k, True)
                prior = np.append(np.append(values, 0.0)[self.owner], none)
                beside = np.isfinite(prior) & ~own
                # Residual of it and of y after all others, then its principal directions.
                A = G[np.ix_(beside, beside)] + np.diag(prior[beside])
                B = G[np.ix_(beside, own)]
                S = G[np.ix_(own, own)] - B.T @ np.linalg.solve(A, B)
                squares, turn = np.linalg.eigh(S[:-1, :-1])
                share = (turn.T @ S[:-1, -1]) ** 2
                squares = np.maximum(squares, 0.0)
                tried = PRECISIONS[:, None]
                explained = (share / (squares + tried)).sum(1)
                left = np.maximum(S[-1, -1] - explained, TINY**2)
                each = self.dof * np.log(left) + np.log1p(squares / tried).sum(1)
                values[k] = PRECISIONS[np.argmin(each)] if each[-1] - min(each) > price else none
            if np.array_equal(values, before):
                break
            best = self.maximise(values)
        deviance, _, sigma = self.profile(values)(best)
        paid = price * np.sum(values < none) + len(best) * np.log(self.rows)
        return deviance + float(paid), JointNoise(np.tanh(best), sigma)


# `ARNoise`: autoregressive noise of each joint, fitted together with the whole dictionary.
#
# Residuals of a fit look whiter than the noise was, because the columns absorb slow noise. The
# likelihood of the residual after projection (REML [Harville 1977]) has no such bias. It is fitted
# together with the base model and the whole dictionary, so that a large slow effect is not taken
# for slow noise either. Coefficients are held as partial autocorrelations, which keeps every model
# stationary [Monahan 1984].


@frozen
class JointNoise:
    """Stationary autoregressive noise of one joint.

    Attributes
    ----------
    pacf : (p,)
        Partial autocorrelations; none for white noise.
    sigma : float [N·m or N]
        Standard deviation of the innovations.
    """

    pacf: Array
    sigma: float


#: Noise of all joints, which are independent.
ARNoise = tuple[JointNoise, ...]


@frozen
class Noise:
    """Size and memory of the noise of n joints.

    Attributes
    ----------
    variance : (n,) [torque²]
    times : (n,) [samples]
        Integrated autocorrelation time, at least 1.
    """

    variance: Array
    times: Array


def principal_columns(X: Array) -> tuple[Array, Array]:
    """Return right-angled columns (N, k) of unit columns X, the longest first, and their squares.

    Of the products: the singular value decomposition of some columns does not converge.
    """
    length = np.linalg.norm(X, axis=0)
    unit = X[:, length > 0] / length[length > 0]
    squares, vectors = np.linalg.eigh(unit.T @ unit)
    kept = np.flatnonzero(squares > THIN)[::-1]
    return unit @ vectors[:, kept], squares[kept]


def span_columns(X: Array, most: int) -> Array:
    """Return an orthonormal basis (N, k) of the largest directions of columns, at most `most`."""
    columns, squares = principal_columns(X)
    return (columns / np.sqrt(squares))[:, :most]


def rich_noise(blocks: Sequence[Array], y: Array, runs: Runs, least: float = 0.0) -> JointNoise:
    """Return the noise of a joint by restricted likelihood, with all candidates in the model.

    With the plain model alone, missing effects would count as noise, and hide themselves; without
    the restriction, slow noise would count as a missing effect.

    Parameters
    ----------
    blocks : sequence of (N, k)
        Columns of the model, then of candidates, the most important first; zero between the
        stretches.
    y : (N,)
    runs : Runs
    least : float, optional [N·m or N]
        Smallest standard deviation of the innovations that is returned: the norm of torque that
        rounding and preparation may leave. Such torque gains no more than half a nat, whatever
        its course in time.
    """
    silent = JointNoise(np.empty(0), np.inf)
    rows = sum(b - a for a, b in runs)
    if not any(b - a >= HIGHEST_ORDER for a, b in runs):
        return silent
    most = int(RULES.columns_most * rows)
    basis = span_columns(blocks[0], most)
    # As many columns as rows would leave nothing, and no noise.
    room = min(2 * most - basis.shape[1], DIRECTIONS)
    parts = _choose_parts([np.sqrt(rows) * principal_columns(Z)[0] for Z in blocks[1:]], room)
    every = RestrictedLikelihood(y, basis, runs, parts)
    if every.rounding or every.rest <= least:
        if least > 0:
            return JointNoise(np.empty(0), least)
        return silent
    # All is noise at first, or what is missing.
    none = np.full(len(parts), PRECISIONS[-1])
    from_largest = every.backfit(none, every.maximise(none))
    from_ones = every.backfit(np.ones(len(parts)), none[:0])
    found = from_largest, from_ones
    noise = min(found, key=lambda x: x[0])[1]
    return replace(noise, sigma=max(noise.sigma, least))


def _choose_parts(parts: Sequence[Array], room: int) -> list[Array]:
    """Return the first parts (N, k) whose columns fit into `room` together."""
    chosen = list[Array]()
    for part in parts:
        if 0 < part.shape[1] <= room:
            chosen.append(part)
            room -= part.shape[1]
    return chosen
