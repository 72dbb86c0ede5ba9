"""Bayes factors of hypotheses, from products of whitened rows.

Rows are whitened by the noise of each joint and by what the hypothesis at hand leaves; of them only
products are kept, so that a question costs the same for 10³ and 10⁵ samples. The parameters of a
part have a normal prior as wide as effects usually are [Jeffreys 1961; Liang 2008]; those of
the model a flat one. What a joint leaves beyond its noise divides its information.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import nnls
from scipy.special import log_ndtr

from identifiability.estimation.noise import ARNoise, runs_of, take_data, whiten
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.columns import Candidate
from identifiability.workflows.diagnose.rows import Rows
from identifiability.workflows.diagnose.rules import Rules

#: Directions below this share of the largest are rounding, in products of unit columns.
ROUNDING: Tolerance = 1e-10
#: Misfits are taken in steps of this factor, so that products are used again; and those below a
#: quarter of the noise are none.
STEP: Tolerance = 2.0**0.5
LEAST: Tolerance = 0.25

#: Rounds in which the width of a function's prior is found, and bounds of it.
WIDEST: tuple[Tolerance, Tolerance] = (0.1, 100.0)


class Products:
    """Products of whitened rows of some logs: torque, model and dictionary, joint by joint.

    Parameters
    ----------
    rows : Rows
    noise : ARNoise

    Attributes
    ----------
    sizes : (c,)
        Typical values of the columns.
    """

    def __init__(self, rows: Rows, noise: ARNoise) -> None:
        self.rows, self.noise, self.sizes = rows, noise, np.empty(0)
        self.ids = [rows.D.columns(j) for j in range(rows.joints)]
        self._grams: dict[tuple[int, int], Array] = {}
        self._places: dict[int, np.ndarray] = {}

    def whitened(self, j: int, step: int, columns: Sequence[int] | np.ndarray) -> Array:
        """Return torque, model and some columns of the dictionary in a joint, (R, 1 + b + k)."""
        rows = self.rows
        D = rows.D.acting(j, columns)
        A = np.concatenate([rows.tau[:, j, None], rows.X[:, j], D], axis=1)
        return self._white(A, j, step)

    def whiten(self, errors: Array, j: int, step: int) -> Array:
        """Return whitened errors of a joint (R,) from those of all (N, n)."""
        return self._white(errors[:, j, None], j, step)[:, 0]

    def _white(self, A: Array, j: int, step: int) -> Array:
        noise = self.noise.joints[j]
        pacf, sigma = noise.beside(_misfit(step, noise.left))
        runs, (A,) = take_data(runs_of(self.rows.moving, j), A)
        return whiten(A, runs, pacf) / sigma

    def gram(self, j: int, step: int) -> Array:
        """Return the products of all that acts in a joint, (1 + b + k, 1 + b + k)."""
        old, k = self._grams.get((j, step)), 1 + self.rows.X.shape[2] + len(self.ids[j])
        if old is None or len(old) < k:
            # Further columns come behind; products of steps that nobody asks for stay as they are.
            n = 0 if old is None else len(old)
            A = self.whitened(j, step, self.ids[j])
            new = np.empty((k, k))
            if old is not None:
                new[:n, :n] = old
            new[:, n:] = A.T @ A[:, n:]
            new[n:, :n] = new[:n, n:].T
            self._grams[j, step] = new
        return self._grams[j, step]

    def total(self, steps: np.ndarray, weights: Array, columns: Sequence[int]) -> Array:
        """Return the products over all joints of torque, model and some columns, (1 + b + k, ·)."""
        b = self.rows.X.shape[2]
        at = np.r_[: 1 + b, 1 + b + np.asarray(columns, int)]
        out = np.zeros((len(at), len(at)))
        for j in range(self.rows.joints):
            where = self.places(j)[at]
            here = np.flatnonzero(where >= 0)
            own = self.gram(j, int(steps[j]))[np.ix_(where[here], where[here])]
            out[np.ix_(here, here)] += weights[j] * own
        if self.rows.root is not None:
            out[1 : 1 + b, 1 : 1 + b] += self.rows.root.T @ self.rows.root
        return out

    def places(self, j: int) -> np.ndarray:
        """Return where torque, model and each column are among those of a joint, -1 for nowhere."""
        b, ids = self.rows.X.shape[2], self.ids[j]
        if len(self._places.get(j, ())) != 1 + b + self.rows.D.width:
            where = np.full(1 + b + self.rows.D.width, -1)
            where[np.r_[: 1 + b, 1 + b + ids]] = np.arange(1 + b + len(ids))
            self._places[j] = where
        return self._places[j]

    def extend(self, rows: Rows) -> None:
        """Take the rows with further columns, behind those that there are."""
        self.rows = rows
        self.ids = [rows.D.columns(j) for j in range(rows.joints)]


def step_of(misfit: float, left: float) -> int:
    """Return the step of a misfit, in factors of `STEP` of the noise; zero for none."""
    if not misfit > LEAST * left > 0:
        return 0
    return max(1, 1 + round(float(np.log(misfit / (LEAST * left)) / np.log(STEP))))


def _misfit(step: int, left: float) -> float:
    return LEAST * left * STEP ** (step - 1) if step else 0.0


def factor_of(G: Array) -> Array:
    """Return F (r, m) with F'F the pseudo-inverse of products (m, m), whatever their units."""
    if not len(G):
        return np.empty((0, 0))
    # What rounding leaves of a column that others explain may have products but no square.
    square = np.diag(G)
    size = np.sqrt(np.where(square > 0, square, np.inf))
    values, vectors = np.linalg.eigh(G / np.outer(size, size))
    seen = values > ROUNDING * max(float(values[-1]), 1e-300)
    factor: Array = (vectors[:, seen] / np.sqrt(values[seen])).T / size
    return factor


class NormalEquations:
    """What rows say of hypotheses, beside the model: each column over its typical value.

    Parameters
    ----------
    products : Products
    steps : (n,) int
        Of the misfit of each joint.
    weights : (n,)
        Of each joint's products.
    sizes : (c,)
        Typical values.
    """

    def __init__(self, products: Products, steps: np.ndarray, weights: Array, sizes: Array) -> None:
        self.products, self.steps, self.weights, self.sizes = products, steps, weights, sizes
        rows = products.rows
        b, width = rows.X.shape[2], rows.D.width
        head, diagonal = np.zeros((1 + b, 1 + b + width)), np.zeros(1 + b + width)
        for j, ids in enumerate(products.ids):
            at, own = np.r_[: 1 + b, 1 + b + ids], weights[j] * products.gram(j, int(steps[j]))
            head[:, at] += own[: 1 + b]
            diagonal[at] += np.diag(own)
        if rows.root is not None:
            head[1:, 1 : 1 + b] += rows.root.T @ rows.root
        self.factor = factor_of(head[1:, 1 : 1 + b])
        self.C = self.factor @ head[1:, 1 + b :] * sizes
        self.z = self.project(head[:, 0], head[0, 1 + b :])
        #: Squares of columns, the model's share with them, and beside it.
        self.own = diagonal[1 + b :] * sizes**2
        self.left = self.own - (self.C**2).sum(0)
        self._rows: dict[int, Array] = {}
        self._blocks: dict[int, Array] = {}
        self._beside: dict[tuple[int, ...], Beside] = {}
        self._place: dict[int, int] = {}
        self._square = np.empty((0, 0))

    def project(self, model: Array, columns: Array) -> Array:
        """Return products of columns (c, …) with a torque beside the model, from (1 + b, …)."""
        sizes = self.sizes.reshape(-1, *[1] * (columns.ndim - 1))
        found: Array = columns * sizes - self.C.T @ (self.factor @ model[1:])
        return found

    def row(self, k: int) -> Array:
        """Return the products of a column with all, beside the model, (c,)."""
        if k not in self._rows:
            products, b = self.products, self.products.rows.X.shape[2]
            out = np.zeros(len(self.sizes))
            for j, ids in enumerate(products.ids):
                at = products.places(j)[1 + b + k]
                if at >= 0:
                    own = products.gram(j, int(self.steps[j]))[at]
                    out[ids] += self.weights[j] * own[1 + b :]
            out *= self.sizes * self.sizes[k]
            self._rows[k] = out - self.C[:, k] @ self.C
        return self._rows[k]

    def among(self, several: np.ndarray) -> Array:
        """Return the products of columns with one another, beside the model, (m, k, k)."""
        products, b = self.products, self.products.rows.X.shape[2]
        m, k = several.shape
        out = np.zeros((m, k, k))
        for j in range(products.rows.joints):
            at = products.places(j)[1 + b + several]
            here = np.flatnonzero((at >= 0).any(1))
            at = at[here]
            own = products.gram(j, int(self.steps[j]))[at[:, :, None], at[:, None]]
            own *= (at >= 0)[:, :, None] & (at >= 0)[:, None]
            out[here] += self.weights[j] * own
        size = self.sizes[several]
        C = self.C[:, several]
        beside: Array = out * size[:, :, None] * size[:, None]
        beside -= np.einsum("rmi,rmj->mij", C, C, optimize=True)
        return beside

    def square(self, at: Sequence[int]) -> Array:
        """Return the products of columns with one another, beside the model, (k, k)."""
        if new := [k for k in dict.fromkeys(at) if k not in self._place]:
            every = [*self._place, *new]
            self._place.update((k, n) for n, k in enumerate(every))
            P = np.array([self.row(k)[every] for k in every])
            self._square = 0.5 * (P + P.T)
        places = np.array([self._place[k] for k in at], int)
        found: Array = self._square[places[:, None], places]
        return found

    def log_bayes(self, at: Sequence[int]) -> float:
        """Return the logarithm of the Bayes factor of columns over none of them."""
        some = list(at)
        if not some:
            return 0.0
        L = np.linalg.cholesky(np.eye(len(some)) + self.square(some))
        u = np.linalg.solve(L, self.z[some])
        return float(0.5 * u @ u - np.log(np.diag(L)).sum())

    def volume(self, at: Sequence[int]) -> float:
        """Return half the log-determinant by which a prior is wider than what data leave of it."""
        return 0.5 * float(np.linalg.slogdet(np.eye(len(at)) + self.square(at))[1])

    def beside(self, rest: Sequence[int], z: Array | None = None) -> Beside:
        """Return what is left of columns beside the model and some of them.

        Parameters
        ----------
        rest : sequence of int
        z : (c, T), optional
            Products with other torques than the measured one.
        """
        key = tuple(rest)
        if z is None and key in self._beside:
            return self._beside[key]
        some, at = list(rest), self.z if z is None else z
        P = np.array([self.row(k) for k in some]).reshape(len(some), len(self.sizes))
        L = np.linalg.cholesky(np.eye(len(some)) + self.square(some))
        inverse = np.linalg.solve(L, np.eye(len(some)))
        C = inverse @ P
        u = inverse @ at[some]
        found = Beside(self, key, at - C.T @ u, self.left - (C**2).sum(0), inverse, C, u)
        if z is None:
            self._beside[key] = found
        return found

    def gains(
        self, rest: Sequence[int], options: Options, alias: float, z: Array | None = None
    ) -> Array:
        """Return the log Bayes factors of candidates beside some columns, (k,) or (k, T)."""
        return self.beside(rest, z).gains(options, alias)

    def blocks(self, number: int, several: np.ndarray) -> Array:
        """Return the products of columns with one another, of many candidates, (m, k, k)."""
        if len(self._blocks.get(number, ())) != len(several):
            self._blocks[number] = self.among(several)
        return self._blocks[number]


class Beside:
    """What is left of columns beside the model and some of them; and without one of these.

    What goes is added back to what is there, so that a neighbour of a hypothesis costs as much as
    what it differs by [Sherman & Morrison 1950].

    Attributes
    ----------
    evidence : NormalEquations
    rest : tuple of int
    z : (c, …)
        Products with the torque.
    left : (c,)
        Squares of columns.
    """

    def __init__(
        self,
        evidence: NormalEquations,
        rest: tuple[int, ...],
        z: Array,
        left: Array,
        inverse: Array,
        C: Array,
        u: Array,
        back: tuple[Beside, Array] | None = None,
    ) -> None:
        self.evidence, self.rest, self.z, self.left = evidence, rest, z, left
        self._inverse, self._C, self._u, self._back = inverse, C, u, back
        self._blocks: dict[int, Array] = {}

    def without(self, gone: Collection[int]) -> Beside:
        """Return what is left beside all but some columns."""
        at = [n for n, k in enumerate(self.rest) if k in gone]
        own = self._inverse[:, at]
        F = np.linalg.cholesky(own.T @ own)
        inner = solve_triangular(F, own.T, lower=True, check_finite=False)
        U, u = inner @ self._C, inner @ self._u
        rest = tuple(k for k in self.rest if k not in gone)
        nothing = np.empty((0, 0))
        return Beside(self.evidence, rest, self.z + U.T @ u, self.left + (U**2).sum(0),
                      nothing, nothing, nothing, (self, U))  # fmt: skip

    def volume(self, gone: Collection[int]) -> float:
        """Return half the log-determinant of some of the columns, beside the others with them."""
        own = self._inverse[:, [n for n, k in enumerate(self.rest) if k in gone]]
        return -0.5 * float(np.linalg.slogdet(own.T @ own)[1])

    def _products(self, number: int, several: np.ndarray) -> Array:
        """Return the products of columns with one another, of many candidates, (m, k, k)."""
        if self._back is not None:
            before, U = self._back
            own = U[:, several].transpose(1, 2, 0)
            more: Array = before._products(number, several) + own @ own.transpose(0, 2, 1)
            return more
        if len(self._blocks.get(number, ())) != len(several):
            own = self._C[:, several].transpose(1, 2, 0)
            blocks = self.evidence.blocks(number, several)
            self._blocks[number] = blocks - own @ own.transpose(0, 2, 1)
        return self._blocks[number]

    def gains(
        self,
        options: Options,
        alias: float,
        allowed: np.ndarray | None = None,
        *,
        signed: bool = True,
    ) -> Array:
        """Return the log Bayes factors of candidates, (k,) or (k, T).

        Minus infinity where less than a share `alias` of a candidate is outside of what is there,
        or it is not allowed.

        Parameters
        ----------
        options : Options
        alias : float
        allowed : (k,) bool, optional
        signed : bool
            Whether values of known sign that come out with the other one count against.
        """
        evidence, z, left = self.evidence, self.z, self.left
        out = np.full((options.count, *z.shape[1:]), -np.inf)
        at = options.single
        s, y = np.maximum(left[at], 0.0), z[at]
        wide = s.reshape(-1, *[1] * (y.ndim - 1))
        value = 0.5 * y**2 / (1 + wide) - 0.5 * np.log1p(wide)
        signs = options.positive.reshape(wide.shape) & signed
        value = np.where(signs, value + np.log(2) + log_ndtr(y / np.sqrt(1 + wide)), value)
        seen = (s > alias**2 * evidence.own[at]) & (evidence.own[at] > 0)
        out[options.of_single[seen]] = value[seen]
        for number, (of, several) in enumerate(options.several):
            visible = left[several].max(1) > alias**2 * evidence.own[several].max(1)
            if allowed is not None:
                visible &= allowed[of]
            if not visible.any():
                continue
            k = several.shape[1]
            S = self._products(number, several)[visible]
            L = np.linalg.cholesky(S + np.eye(k) * (1 + 1e-9 * np.maximum(
                np.einsum("mii->m", S), 0.0)[:, None, None]))  # fmt: skip
            u = np.linalg.solve(L, z[several[visible]].reshape(len(S), k, -1))
            volume = np.log(np.einsum("mii->mi", L)).sum(1)
            value = 0.5 * (u**2).sum(1) - volume[:, None]
            if z.ndim == 1 and signed:
                inside = options.forbidden[number][visible]
                value[:, 0] -= _lost_to_signs(L, u[:, :, 0], inside & (value[:, 0] > 0))
            out[of[visible]] = value.reshape(-1, *z.shape[1:])
        if allowed is not None:
            out[~allowed] = -np.inf
        return out

    def widths(self, options: Options) -> Array:
        """Return how wide the prior of each candidate must be, over its typical size, (k,).

        It is the likeliest one, no narrower than usual and with a tail as a Cauchy prior has it, a
        mixture of normal ones [Zellner & Siow 1980; Liang 2008].
        """
        # Widths that are tried of each name's prior, a third of a factor of two apart.
        tried = np.r_[1.0, WIDEST[1] ** np.linspace(0.0, 1.0, 21)[1:]]
        out = np.ones(options.count)
        each = [
            (options.of_single, self.left[options.single][:, None], self.z[options.single][:, None])
        ]
        for number, (of, several) in enumerate(options.several):
            values, vectors = np.linalg.eigh(self._products(number, several))
            each.append((of, values, np.einsum("mij,mi->mj", vectors, self.z[several])))
        for of, s, y in each:
            scaled = np.maximum(s, 0.0)[:, :, None] * tried**2
            value = 0.5 * (y[:, :, None] * tried) ** 2 / (1 + scaled) - 0.5 * np.log1p(scaled)
            out[of] = tried[np.argmax(value.sum(1) - np.log(tried), axis=1)]
        return out


def _lost_to_signs(L: Array, u: Array, asked: np.ndarray) -> Array:
    """Return how much less is explained where no value may be negative, (m,).

    Parameters
    ----------
    L : (m, k, k)
        Lower factors of products, prior included.
    u : (m, k)
        What the columns explain, rotated: its squares are twice the evidence.
    asked : (m,) bool
    """
    out = np.zeros(len(u))
    for n in np.flatnonzero(asked).tolist():
        free = solve_triangular(L[n].T, u[n], check_finite=False)
        if (free < 0).any():
            out[n] = 0.5 * float(nnls(L[n].T, u[n])[1]) ** 2
    return out


def explain(P: Array, z: Array, own: Array, alias: float) -> tuple[float, int]:
    """Return the squares of a torque that columns explain, and in how many directions.

    Parameters
    ----------
    P : (k, k)
        Products of the columns beside a model.
    z : (k,)
        Their products with the torque.
    own : (k,)
        Squares of the columns, the model's share with them.
    alias : float
        A direction of which less than this share is outside the model says nothing.
    """
    size = np.sqrt(np.maximum(own, 1e-300))
    values, vectors = np.linalg.eigh(P / np.outer(size, size))
    seen = values > alias**2
    return float(np.sum((vectors[:, seen].T @ (z / size)) ** 2 / values[seen])), int(seen.sum())


class Options:
    """Where the columns of candidates are, those of one column apart."""

    def __init__(self, candidates: Sequence[Candidate]) -> None:
        self.count = len(candidates)
        one = [k for k, c in enumerate(candidates) if len(c.columns) == 1]
        self.of_single = np.array(one, int)
        self.single = np.array([candidates[k].columns[0] for k in one], int)
        self.positive = np.array([candidates[k].positive for k in one], bool)
        widths: dict[int, list[int]] = {}
        for k, c in enumerate(candidates):
            if len(c.columns) > 1:
                widths.setdefault(len(c.columns), []).append(k)
        self.several = [
            (np.array(of, int), np.array([candidates[k].columns for k in of], int))
            for of in widths.values()
        ]
        #: Of which candidates of several columns none may be negative.
        self.forbidden = [
            np.array([candidates[k].positive for k in of], bool) for of in widths.values()
        ]


@frozen
class View:
    """Rows weighed as one hypothesis leaves them: beside it others are compared.

    Attributes
    ----------
    products : Products
        Of the fitted rows.
    steps : (n,) int
        Of the misfit of each joint.
    tempered : (n,)
        What each joint's information is divided by, one at least.
    sizes : (c,)
        Typical values of the columns that there were.
    """

    products: Products
    steps: np.ndarray
    tempered: Array
    sizes: Array

    @property
    def typical(self) -> Array:
        """Typical values of all columns: some may have come since."""
        later = self.products.sizes[len(self.sizes) :]
        return np.concatenate([self.sizes, later]) if len(later) else self.sizes

    @property
    def evidence(self) -> NormalEquations:
        """What the rows say of hypotheses."""
        sizes = self.typical
        if len(sizes) not in self._evidence:
            self._evidence.clear()
            weights = 1.0 / self.tempered
            self._evidence[len(sizes)] = NormalEquations(self.products, self.steps, weights, sizes)
        return self._evidence[len(sizes)]

    @cached_property
    def _evidence(self) -> dict[int, NormalEquations]:
        """What was made, for so many columns."""
        return {}

    def total(self, columns: Sequence[int], where: Products | None = None) -> Array:
        """Return the products of torque, model and some columns, of these rows or of others."""
        return (where or self.products).total(self.steps, 1.0 / self.tempered, columns)

    def solve(self, columns: Sequence[int], ridge: Sequence[int]) -> tuple[Array, Array]:
        """Return the values (b + k,) of the model with some columns, and their covariance.

        Those of functions have a prior, without which they are anything where no data are; how wide
        it is the data say [MacKay 1992].

        Parameters
        ----------
        columns : sequence of int
        ridge : sequence of int
            Which function each of them belongs to, -1 for none.
        """
        key = tuple(columns), tuple(ridge)
        if key not in self._solved:
            self._solved[key] = self._solve(columns, ridge)
        return self._solved[key]

    @cached_property
    def _solved(self) -> dict[tuple[tuple[int, ...], tuple[int, ...]], tuple[Array, Array]]:
        """What was solved."""
        return {}

    def _solve(self, columns: Sequence[int], ridge: Sequence[int]) -> tuple[Array, Array]:
        G = self.total(columns)
        y, G = G[1:, 0], G[1:, 1:]
        size, of = self.typical[list(columns)], np.array(ridge, int)
        at = len(G) - len(size) + np.flatnonzero((of >= 0) & (size > 0))
        size, of = size[at - len(G)], of[at - len(G)]
        G[at, at] += 1 / (self._widths(G, y, at, size, of) * size) ** 2
        F = factor_of(G)
        covariance: Array = F.T @ F
        value: Array = covariance @ y
        return value, covariance

    def _widths(self, G: Array, y: Array, at: np.ndarray, size: Array, of: np.ndarray) -> Array:
        """Return how wide the priors of functions are, over their typical sizes, (k,)."""
        width = np.ones(len(at))
        if not len(at):
            return width
        rest = np.setdiff1d(np.arange(len(G)), at)
        F = factor_of(G[np.ix_(rest, rest)])
        C = F @ G[np.ix_(rest, at)]
        S, u = G[np.ix_(at, at)] - C.T @ C, y[at] - C.T @ (F @ y[rest])
        # Rounds in which the width of a function's prior is found, and bounds of it.
        for _ in range(8 - 1):
            covariance = np.linalg.inv(S + np.diag(1 / (width * size) ** 2))
            value = covariance @ u
            for k in set(of.tolist()):
                own = of == k
                w = float(width[own][0])
                known = np.sum(1.0 - np.diag(covariance)[own] / (w * size[own]) ** 2)
                square = np.sum((value[own] / size[own]) ** 2)
                width[own] = np.clip(np.sqrt(square / max(float(known), 1e-9)), *WIDEST)
        return width


def tempering(
    errors: Sequence[Array], fitted: float, lag: float = Rules.lag, usual: float = Rules.usual
) -> Array:
    """Return what divides each joint's information: what it leaves above its noise, (n,).

    Parameters
    ----------
    errors : sequence of (R,)
        Whitened, of each joint.
    fitted : float
        Values that were fitted, as a share of the joints.
    lag, usual : float
        See `Rules`.
    """
    out = np.ones(len(errors))
    for j, e in enumerate(errors):
        if len(e) < 3 or not (square := float(e @ e)) > 0:
            continue
        excess = square / max(len(e) - fitted, len(e) / 3)
        own = float(np.clip(e[1:] @ e[:-1] / square, 0.0, lag))
        out[j] = max(1.0, excess * ((1 + own) / (1 - own) if excess > usual else 1.0))
    return out
