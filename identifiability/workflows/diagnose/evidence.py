"""How strongly the data speak for each candidate, and how strongly noise alone would.

In rows whitened by the noise and by what the model does not explain yet. Two numbers a candidate:
its fit, the fall of the (quasi-)likelihood, decides which name is the best; its score, the fit in
units of what simulated noise reaches for this very candidate, decides whether there is anything to
be named. Both are negative logarithms of tail probabilities, so that candidates with one column
and with several compare. A level that physics wants positive counts only if it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from scipy.special import log_ndtr

from identifiability.estimation.noise import ARNoise
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import log_tail
from identifiability.foundation.values import frozen, remember
from identifiability.workflows.diagnose.dictionary import Block, Stacked
from identifiability.workflows.diagnose.rows import Candidate, Rows
from identifiability.workflows.diagnose.smooth import is_smooth
from identifiability.workflows.diagnose.spans import orthonormal, project_out
from identifiability.workflows.diagnose.straight import score_straight, straight_first

#: Directions of a candidate below this share of its length are not there.
NEGLIGIBLE = 1e-4
#: Rows of a joint, and rows for each of its columns, beyond which they are compressed.
MANY, TALL = 1500, 4
#: Models whose basis is kept.
REMEMBERED = 6
#: Simulated series that are whitened together.
AT_ONCE = 100


@frozen
class Whitened:
    """Rows in units of their noise, joints one below the other, compressed where they are many.

    Attributes
    ----------
    y : (R,)
    X : (R, b)
    D : (R, c) or Stacked
        Columns of candidates.
    scale : (R, B)
        Simulated noise that gives every candidate its unit.
    noise : (R, B)
        Simulated noise that gives the limits; both whitened by the same filter.
    """

    y: Array
    X: Array
    D: Array | Stacked
    scale: Array
    noise: Array

    def columns(self, chosen: Sequence[Candidate]) -> Array:
        """Return the columns of the model with some candidates."""
        return np.column_stack([self.X, *(self.D[:, list(c.columns)] for c in chosen)])

    def basis(self, chosen: Sequence[Candidate]) -> Array:
        """Return an orthonormal basis of these columns (R, m), which many ask for in turn."""
        key = tuple(k for c in chosen for k in c.columns)
        return remember(self._bases, key, lambda: orthonormal(self.columns(chosen)), REMEMBERED)

    @cached_property
    def _bases(self) -> dict[tuple[int, ...], Array]:
        return {}


@frozen
class Bench:
    """Rows, their noise, and simulated noise: whitened anew for every model.

    Attributes
    ----------
    rows : Rows
    noise : ARNoise
    simulated : (N, n, 2 B)
        In single precision: it is the largest thing of all, and random.
    errors : (d, 2 B), optional
        Simulated errors of the values that are known beforehand, in units of their spread.
    """

    rows: Rows
    noise: ARNoise
    simulated: Array
    errors: Array | None = None

    @staticmethod
    def of(rows: Rows, noise: ARNoise, draws: int, rng: np.random.Generator) -> Bench:
        """Simulate noise for some rows."""
        simulated = noise.simulate(len(rows), 2 * draws, rng, rows.moving, np.float32)
        if rows.root is None:
            return Bench(rows, noise, simulated)
        return Bench(rows, noise, simulated, rng.standard_normal((len(rows.root), 2 * draws)))

    def whiten(self, misfit: Array | None = None) -> Whitened:
        """Return whitened rows; `misfit` (n,) is variance that the model does not explain yet."""
        rows, draws = self.rows, self.simulated.shape[2] // 2
        left = np.zeros(rows.joints) if misfit is None else misfit
        each = (self._joint(j, float(size)) for j, size in enumerate(left))
        parts, others = map(list, zip(*each, strict=True))
        known = 0 if rows.root is None else len(rows.root)
        y, X, D = rows.stack(parts, known)
        if rows.root is not None:
            X[len(X) - known :] = rows.root
            others.append(np.zeros((known, 2 * draws)) if self.errors is None else self.errors)
        simulated = np.concatenate(others)
        return Whitened(y, X, D, simulated[:, :draws], simulated[:, draws:])

    @cached_property
    def plain(self) -> Whitened:
        """Rows whitened by the noise alone."""
        return self.whiten()

    def _joint(self, j: int, misfit: float) -> tuple[Array, Array]:
        """Return whitened columns and simulated noise of a joint, compressed.

        Most joints have no misfit, in whatever model, and so the same whitened rows.
        """
        if misfit == 0.0 and j in self._plain:
            return self._plain[j]
        own, left = ARNoise((self.noise.joints[j],)), np.array([misfit])
        runs = self.rows.moving.each[j]

        def whiten(x: Array) -> Array:
            return own.whiten(x[:, None], runs, left)[:, 0]

        found = compress(whiten(self.rows.joint_columns(j)), self.simulated[:, j], whiten)
        if misfit == 0.0:
            self._plain[j] = found
        return found

    @cached_property
    def _plain(self) -> dict[int, tuple[Array, Array]]:
        """Return the whitened rows of joints without misfit."""
        return {}

    def misfit(self, residual: Array) -> Array:
        """Return the variance of a residual (N, n) that noise does not explain, (n,)."""
        return self.noise.misfit(residual, self.rows.counts)


def compress(
    A: Array, Z: Array, change: Callable[[Array], Array] = lambda same: same
) -> tuple[Array, Array]:
    """Return columns A (N, k) and other series (N, B), in k rows each where N is far more.

    These are R and Q'Z of A = QR: every product of columns with one another and with other series
    stays what it was, and no more is asked of them.

    Parameters
    ----------
    A : (N, k)
    Z : (N, B)
    change : callable((N, m)) -> (N, m), optional
        Done to the other series first, a few at a time.
    """
    parts = [Z[:, k : k + AT_ONCE] for k in range(0, Z.shape[1], AT_ONCE)]
    Q = None
    if len(A) > max(MANY, TALL * A.shape[1]):
        # Where nothing else is asked for, Q would cost as much again.
        Q, A = np.linalg.qr(A) if parts else (None, np.asarray(np.linalg.qr(A, mode="r")))
    found = (
        [change(part.astype(float)) for part in parts]
        if Q is None
        else [Q.T @ change(part.astype(float)) for part in parts]
    )
    return A, np.concatenate([np.empty((len(A), 0)), *found], axis=1)


@frozen
class Scores:
    """Scores of candidates beside a model.

    Attributes
    ----------
    fit : (C,)
        Fall of the negative logarithm of the (quasi-)likelihood.
    data : (C,)
        The same in units of simulated noise; -inf where a candidate leaves nothing.
    null : (C, B)
        What simulated noise reaches in these units.
    """

    fit: Array
    data: Array
    null: Array


def score_candidates(
    white: Whitened, Q: Array, candidates: Sequence[Candidate], *, null: bool = True
) -> Scores:
    """Return the scores of candidates beside a model with the orthonormal basis Q (R, m)."""
    targets = np.column_stack([white.y, white.scale, *([white.noise] if null else [])])
    targets, draws = project_out(Q, targets), white.scale.shape[1]
    D = white.D
    if not isinstance(D, Stacked):
        D = Stacked((Block(np.arange(D.shape[1]), D),), D.shape[1])
    scores = _score(D, Q, targets, draws, candidates)
    return Scores(scores[:, 0], scores[:, 1], scores[:, 2:])


def _score(
    D: Stacked, Q: Array, targets: Array, draws: int, candidates: Sequence[Candidate]
) -> Array:
    """Return fit, data and null (C, 2 + B) of candidates beside the span of Q.

    Products of columns are all it takes: over the rows of all joints these are far larger.
    """
    at = [k for c in candidates for k in c.columns]
    length = D.lengths[at]
    there = length > 0
    length = np.where(there, length, 1.0)
    products = D.times(at, np.column_stack([Q, targets])) / length[:, None]
    inside, z = products[:, : Q.shape[1]], products[:, Q.shape[1] :]
    left = np.sqrt(np.maximum(there - np.sum(inside**2, axis=1), 0.0))
    widths = np.array([len(c.columns) for c in candidates], int)
    positive = np.array([c.positive for c in candidates], bool)
    first = np.cumsum(widths) - widths
    seen = np.maximum.reduceat(left, first) > NEGLIGIBLE
    scores = np.full((len(candidates), targets.shape[1] - draws + 1), -np.inf)
    one = np.flatnonzero(seen & (widths == 1))
    levels = z[first[one]] / left[first[one], None]
    scores[one] = _score_single(_in_units(levels, draws), positive[one])
    for k in np.flatnonzero(seen & (widths > 1)).tolist():
        part, c = slice(first[k], first[k] + widths[k]), candidates[k]
        G = D.gram(at[part]) / np.outer(length[part], length[part])
        G -= inside[part] @ inside[part].T
        if c.family.unnamed and is_smooth(c):
            directions, counts = straight_first(c, G, length[part])
            scores[k] = score_straight(_in_units(directions.T @ z[part], draws), counts)
        else:
            scores[k] = _score_group(G, z[part], draws, positive=bool(positive[k]))
    return scores


def _in_units(w: Array, draws: int) -> Array:
    """Return w (K, 1 + draws + B) as: data, data in units of the draws, the rest in these units."""
    unit = np.sqrt(np.mean(w[:, 1 : 1 + draws] ** 2, axis=1, keepdims=True)) if draws else 1.0
    return np.column_stack([w[:, :1], w[:, :1] / unit, w[:, 1 + draws :] / unit])


def _score_single(z: Array, positive: np.ndarray) -> Array:
    """Return scores (K, T) of standardised levels; a forbidden sign scores nothing."""
    one_sided = np.where(z > 0, -log_ndtr(-z), 0.0)
    two_sided = -(np.log(2.0) + log_ndtr(-np.abs(z)))
    scores: Array = np.where(positive[:, None], one_sided, two_sided)
    return scores


def _score_group(G: Array, z: Array, draws: int, *, positive: bool) -> Array:
    """Return scores (2 + B,) of several columns U together from ``UᵀU`` and ``Uᵀ targets``."""
    values, vectors = np.linalg.eigh(G)
    used = values > NEGLIGIBLE**2
    half = vectors[:, used] / np.sqrt(values[used])
    units = _in_units(half.T @ z, draws)
    if positive and used.all():
        # Back to the columns, where a sign means something, and out with forbidden ones.
        size = _squares_positive(np.linalg.inv(half @ half.T), np.linalg.inv(half.T) @ units)
    else:
        size = (units**2).sum(0)
    return -log_tail(size, int(used.sum()))


def _squares_positive(G: Array, z: Array) -> Array:
    """Return the explained squares ``zᵀ G⁻¹ z`` (T,) with columns of negative level left out."""
    level = np.linalg.solve(G, z)
    size: Array = (level * z).sum(0)
    used = level > 0
    at = np.flatnonzero(~used.all(0))
    for _ in range(2):
        own = used[:, at].T
        # Left out are the equations of a column, too: its level is zero.
        both, right = own[:, :, None] & own[:, None, :], np.where(own, z[:, at].T, 0.0)
        left = np.linalg.solve(np.where(both, G, np.eye(len(G))), right[:, :, None])[:, :, 0]
        size[at] = (left * right).sum(1)
        used[:, at] = (left > 0).T
        at = at[(own != used[:, at].T).any(1)]
    return size
