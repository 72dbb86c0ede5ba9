"""Instrumental variables: estimates that noise in the motion does not bias.

Instruments are combined so that each stands for one direction of the columns.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.linalg import solve_triangular

from identifiability.estimation.estimator import Correction, Estimate, correct
from identifiability.estimation.least_squares import (
    OrdinaryLeastSquares,
    WeightedLeastSquares,
    correct_leverage,
    noise_scale,
)
from identifiability.estimation.rules import RULES
from identifiability.foundation.linalg import ROUNDING, few_at_once, solve_each, triangular_factor
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs.prepare.samples import Record
from identifiability.regression.information import Information

# Instruments combined so that each stands for one direction of the columns.
#
# Instruments are worth as much as they are correlated with W. The canonical correlations r say
# that direction by direction: where they are weak the column itself stays, which is least squares.
# How much is enough depends on the record. One that was measured again is the motion: what W has
# beside it is noise, least squares keeps r² of a value, and a first-stage ``F = N r²/(1 - r²)`` of
# 104.7 is enough for intervals of ± 1.96 σ to hold [Lee, McCrary, Moreira, Porter 2022]. One that
# shares some noise, or a command, which the robot did not follow to the letter, errs by what 1/r
# multiplies.


#: Instruments are told apart down to this share of their columns' length.
APART: Tolerance = 1e-8

#: Share of a direction below which it is noise.
LEFT: Tolerance = 1e-3


@frozen
class Combined:
    """Instruments combined so that each stands for one direction of W.

    Attributes
    ----------
    left : (2k, k)
        Coefficients T of the instruments ``[V W] T``, with ``([V W] T)ᵀ W B = I``.
    B : (k, k)
        Directions of the parameters, one a column.
    length : (k,)
        Lengths of the instruments, which are at right angles: 1 over the canonical correlation,
        or 1 where the direction stays with least squares.
    value : (k,)
    weak : (k,) bool
        Directions that stay with least squares.
    lost : (2, k)
        What instruments would change in these, and its variance under noise of variance 1.
    """

    left: Array
    B: Array
    length: Array
    value: Array
    weak: np.ndarray
    lost: Array

    def residual(self) -> Array:
        """Return z with ``τ - W x = [V W τ] z``, (2k + 1,)."""
        return np.concatenate([np.zeros(len(self.value)), -self.value, [1.0]])

    def bias(self, scale: float) -> Array:
        """Return the mean square bias that least squares may have in each direction, (k,).

        It is what instruments would change, as far as noise of that variance lets it be known.
        """
        moved, variance = self.lost
        square: Array = moved**2 + scale * variance
        return square

    def root(self, scale: float) -> Array:
        """Return D (k, k), ``scale (DᵀD)⁻¹`` being the covariance of the values with their bias."""
        wider = self.bias(scale) / scale if scale > 0 else 0.0
        return _undo(self.B * np.sqrt(self.length**2 + wider))

    def moments(self, information: Information, weights: Array) -> tuple[Array, Array]:
        """Return each block's ``Ẑᵀ W B`` (B, k, k) and ``Ẑᵀ e`` (B, k)."""
        both = self.equations(information, weights)
        return both[:, :, :-1], both[:, :, -1]

    def equations(self, information: Information, weights: Array) -> Array:
        """Return both beside each other, (B, k, k + 1)."""
        k = len(self.value)
        left = np.vstack([self.left, np.zeros((1, k))])
        right = np.zeros((2 * k + 1, k + 1))
        right[k : 2 * k, :k] = self.B
        right[:, k] = self.residual()
        return information.joint.products(weights, left, right)


def combine(
    information: Information, weights: Array, record: Record, plain: Array | None = None
) -> Combined:
    """Return the instruments of independent columns and their values (of `plain`, if given)."""
    make = partial(_combine, information, weights, record, plain)
    if plain is not None:
        return make()
    found: Combined = information.remember((record, weights.tobytes()), make)
    return found


def _combine(
    information: Information, weights: Array, record: Record, plain: Array | None
) -> Combined:
    k, N = information.size, max(information.samples, 1)
    R = information.joint.factor(weights)
    Q, root = np.linalg.qr(R[:, k : 2 * k])
    U, to_U = _span(R[:k, :k])
    left, strength, Yt = np.linalg.svd(U.T @ Q[:k])  # min(rank, k) correlations
    strength = np.append(strength, np.zeros(k - len(strength)))
    # A direction follows its instrument from this canonical correlation on.
    least = np.sqrt(RULES.instrument_f / (N + RULES.instrument_f)) if record == "measured" else 0.9
    weak = strength < least
    good = np.flatnonzero(~weak)
    B = _solve(root, Yt.T)
    T = np.zeros((2 * k, k))
    T[:k, good] = to_U @ left[:, good] / strength[good]
    T[k:, weak] = B[:, weak]
    x = _solve(root, Q.T @ R[:, 2 * k]) if plain is None else plain
    e = R[:, 2 * k] - R[:, k : 2 * k] @ x  # what least squares leaves has digits of its own
    x = x + B[:, good] @ ((U @ left[:, good]).T @ e[:k] / strength[good])
    length = np.where(weak, 1.0, 1.0 / np.where(weak, 1.0, strength))
    lost = np.zeros((2, k))
    if record != "command":  # it is another motion, so what it would change is no bias
        # Noise alone correlates by 1/√N.
        lean, seen = np.maximum(strength, 1.0 / np.sqrt(N)), np.zeros(k)
        seen[: left.shape[1]] = (U @ left).T @ e[:k]
        lost = np.where(weak, [seen / lean, 1.0 / lean**2 - 1.0], 0.0)
    return Combined(T, B, length, x, weak, lost)


def _span(V: Array) -> tuple[Array, Array]:
    """Return U, orthonormal, of what a triangular V (k, k) spans, and what makes it ``U = V T``."""
    size = np.linalg.norm(V, axis=0)
    unit = V / np.where(size > 0, size, 1.0)
    if np.diag(unit).all():  # mostly V spans all directions, which costs a tenth to see
        inverse = solve_triangular(unit, np.eye(len(V)))
        if APART * np.linalg.norm(unit) * np.linalg.norm(inverse) < 1.0:
            return np.eye(len(V)), inverse / size[:, None]
    U, s, Yt = np.linalg.svd(unit)
    own = s > APART * s.max(initial=0.0)
    return U[:, own], Yt[own].T / s[own] / np.where(size > 0, size, 1.0)[:, None]


# Instrumental variables: estimates that noise in the motion does not bias.
#
# Noise in q, dq and ddq makes the columns of W noisy. Least squares takes that for motion and
# pulls values towards zero, and more data do not help. Instruments V, the same columns along a
# second record of the motion whose noise is another one, are correlated with the motion and not
# with the noise: ``(Vᵀ W)⁻¹ Vᵀ τ`` converges to what noise-free columns would give [Janot,
# Vandanjon, Gautier 2014]. The difference to least squares is the bias that would have been
# believed [Hausman 1978].


@frozen
class InstrumentalVariables:
    """Instrumental variables in the directions in which instruments are strong.

    Information without instruments is fitted by least squares.

    Attributes
    ----------
    base : OrdinaryLeastSquares or WeightedLeastSquares
        Gives the weights of the actuators, and the directions without a strong instrument.
    record : {"measured", "smoothed", "command"}
        The second record of the motion: measured again, or the same smoothed, or the command.
    """

    base: OrdinaryLeastSquares = WeightedLeastSquares()
    record: Record = "measured"
    name: str = "iv"

    @property
    def description(self) -> str:
        """What it is, in the words of a report."""
        return f"instrumental variables ({self.base.name} weights)"

    def fit(self, information: Information) -> Estimate:
        """Return the estimate; it says what least squares gives."""
        plain = self.base.fit(information)
        kept = list(plain.kept)
        if not information.instrumented or not kept:
            return plain
        part = information.select(kept)
        found = combine(part, plain.weights, self.record, plain.value[kept])
        rss = part.squares(np.append(-found.value, 1.0))
        scale = noise_scale(part, plain.weights, plain.times, rss)
        covariance = _white_covariance(part, found, plain, scale)
        noise, bias = np.sqrt(scale) * found.B * found.length, found.B * np.sqrt(found.bias(scale))
        mended = Correction.of(plain, noise, bias, found.weak)
        return correct(plain, self, found.value, covariance, rss, mended)

    def refit(self, information: Information, fit: Estimate, counts: Array) -> Array:
        """Return the values of the same instruments for weighted sums of blocks, (R, k)."""
        kept = list(fit.kept)
        if not information.instrumented or not kept:
            return self.base.refit(information, fit, counts)
        part = information.select(kept)
        found = self._combine(part, fit)
        both, k = found.equations(part, fit.weights), len(kept)
        flat, values = both.reshape(len(both), -1), np.zeros((len(counts), information.size))
        for at in few_at_once(len(counts), both[0].nbytes):
            sums = (counts[at] @ flat).reshape(-1, k, k + 1)
            values[at, kept] = found.value + solve_each(sums) @ found.B.T
        return values

    def influence(self, information: Information, fit: Estimate) -> Array:
        """Return the leverage-corrected score of each block's instruments, (B, k)."""
        kept = list(fit.kept)
        if not information.instrumented or not kept:
            return self.base.influence(information, fit)
        part = information.select(kept)
        found = self._combine(part, fit)
        A, c = found.moments(part, fit.weights)
        scores = correct_leverage(c, A)
        moved = np.zeros((len(scores), information.size))
        moved[:, kept] = scores @ found.B.T
        return moved

    def loss(self, information: Information, fit: Estimate) -> Array:
        """Return the triangular factor of what instruments see of the residual, (k + 1, k + 1).

        Its square is the estimate's distance in the unit of its own covariance, on top of the
        residual sum of squares.
        """
        kept = list(fit.kept)
        if not information.instrumented or not kept:
            return self.base.loss(information, fit)
        part = information.select(kept)
        found = combine(part, fit.weights, self.record)
        scale, k = noise_scale(part, fit.weights, fit.times, fit.rss), information.size
        F = np.zeros((len(kept) + 1, k + 1))
        F[:-1, kept] = found.root(scale)
        F[:-1, k] = F[:-1, kept] @ fit.value[kept]
        F[-1, k] = np.sqrt(fit.weights @ fit.rss)
        return triangular_factor(np.vstack([F, np.zeros((k - len(kept), k + 1))]))

    def project(self, information: Information, fit: Estimate, M: Array) -> Array:
        """Return what the fit finds of torque without noise, for each of b parameters, (k, b)."""
        P = self.base.project(information, fit, M)
        if not information.instrumented:
            return P
        b, k = M.shape
        found = combine(information.reduce(M, [""] * k), fit.weights, self.record)
        R = information.joint.factor(fit.weights)
        V, W = R[:, :b], R[:, b : 2 * b]
        Z = V @ M @ found.left[:k] + W @ M @ found.left[k:]
        seen: Array = P + found.B @ (Z.T @ (W - W @ M @ P))
        return seen

    def moments(
        self, information: Information, fit: Estimate, R: Array, *, anew: bool = False
    ) -> Array:
        """Return the normal equations of each block, for refits without some, (B, k + 1, k + 1).

        Parameters
        ----------
        information : Information
            About k independent columns.
        fit : Estimate
        R : (k + 1, k + 1)
            The loss; equations are in ``R x``, less those of the fit, in units of ``R[k, k]``.
            They are made symmetric, as their sum is.
        anew : bool
            Whether the blocks are those of a resampled log, for which instruments are combined
            anew: those of the log would leave its weak directions less than no information.
        """
        k = information.size
        own, root = fit.value[list(fit.kept)], R[:k, :k]
        found = combine(information, fit.weights, self.record)
        if anew:
            rss = information.squares(found.residual()[k:])
            root = found.root(noise_scale(information, fit.weights, fit.times, rss))
        else:
            found = replace(found, value=own)
        A, c = found.moments(information, fit.weights)
        to_y = root @ found.B  # of directions into coordinates of the loss
        turned = to_y @ A @ np.linalg.inv(to_y)
        out = np.zeros((len(A), k + 1, k + 1))
        out[:, :k, :k] = 0.5 * (turned + turned.swapaxes(1, 2))
        out[:, :k, k] = c @ to_y.T
        if anew:  # from its own coordinates and values to those of all blocks
            change = root @ np.linalg.inv(R[:k, :k])
            out[:, :k] = change.T @ out[:, :k]
            out[:, :k, :k] = out[:, :k, :k] @ change
            out[:, :k, k] += out[:, :k, :k] @ (R[:k, :k] @ (found.value - own))
        out[:, :k, k] /= R[k, k]
        out[:, k, :k] = out[:, :k, k]
        return out

    def _combine(self, information: Information, fit: Estimate) -> Combined:
        """Return the instruments, with the values of the fit."""
        found = combine(information, fit.weights, self.record)
        return replace(found, value=fit.value[list(fit.kept)])


def _white_covariance(
    information: Information, found: Combined, plain: Estimate, scale: float
) -> Array:
    """Return the covariance under independent residuals, whatever the weights know, (k, k)."""
    factor = information.joint.factor(plain.weights / plain.times)
    Z = factor[:, : 2 * information.size] @ found.left
    spread = scale * Z.T @ Z
    white: Array = found.B @ (spread + np.diag(found.bias(scale))) @ found.B.T
    return white


# Least squares corrected by the map that noise in the motion makes of true values.
#
# Where positions alone were measured there is no second record: derivatives share the positions'
# noise. What noise does can be tried instead. Along a smoothed motion, torque is what any values
# say; the same motion with new noise of the log's own size is what would be measured; least
# squares makes ``B θ`` of the values θ. The log's own noise did the same to its own, so ``B⁻¹ θ̂``
# is closer.


@frozen
class RenoisedLeastSquares:
    """Least squares, and the inverse of what new noise makes of it.

    Information without an echo is fitted by least squares.

    Attributes
    ----------
    base : OrdinaryLeastSquares or WeightedLeastSquares
    """

    base: OrdinaryLeastSquares = WeightedLeastSquares()
    name: str = "renoised"

    @property
    def description(self) -> str:
        """What it is, in the words of a report."""
        return (
            f"least squares ({self.base.name} weights), corrected by what new noise of the "
            "motion's own size does to it"
        )

    def fit(self, information: Information) -> Estimate:
        """Return the estimate; it says what least squares gives."""
        plain = self.base.fit(information)
        kept = list(plain.kept)
        if information.echo is None or not kept:
            return plain
        part = information.select(kept)
        found, spread = _shrinkage(part, plain.weights), plain.covariance[np.ix_(kept, kept)]
        spread = np.where(np.isfinite(spread), spread, 0.0)  # the rest has no variance
        value = found.H @ plain.value[kept]
        rss = part.squares(np.append(-value, 1.0))
        mended = Correction.of(plain, *found.leave(plain.value[kept], spread), found.weak)
        bias = mended.bias[:, kept]
        covariance = found.H @ spread @ found.H.T + bias.T @ bias
        return correct(plain, self, value, covariance, rss, mended)

    def refit(self, information: Information, fit: Estimate, counts: Array) -> Array:
        """Return the corrected values for weighted sums of blocks, (R, k)."""
        values = self.base.refit(information, fit, counts)
        return values @ self._correction(information, fit).T

    def influence(self, information: Information, fit: Estimate) -> Array:
        """Return by how much each block moves the corrected values, (B, k)."""
        moved = self.base.influence(information, _plain(fit))
        return moved @ self._correction(information, fit).T

    def loss(self, information: Information, fit: Estimate) -> Array:
        """Return the triangular factor of least squares at what noise makes of values."""
        return triangular_factor(
            self.base.loss(information, fit) @ self.map_noise(information, fit)
        )

    def map_noise(self, information: Information, fit: Estimate) -> Array:
        """Return what noise makes of values and torque, (k + 1, k + 1)."""
        whole = np.eye(information.size + 1)
        whole[:-1, :-1] = np.linalg.inv(self._correction(information, fit))
        return whole

    def project(self, information: Information, fit: Estimate, M: Array) -> Array:
        """Return what the fit finds of torque without noise, for each of b parameters, (k, b)."""
        P = self.base.project(information, fit, M)
        if information.echo is None:
            return P
        b = len(M)
        R = information.echo.joint.factor(fit.weights)
        V, W = R[:, :b], R[:, b : 2 * b]
        H = _noise_map(V @ M, W @ M).H
        # Of its own columns it finds what they are.
        moved = np.linalg.lstsq(V @ M, W - W @ M @ P, rcond=None)[0]
        seen: Array = P + H @ moved
        return seen

    def _correction(self, information: Information, fit: Estimate) -> Array:
        """Return what turns values of least squares into corrected ones, (k, k)."""
        H = np.eye(information.size)
        kept = list(fit.kept)
        if information.echo is not None and kept:
            H[np.ix_(kept, kept)] = _shrinkage(information.select(kept), fit.weights).H
        return H


def _plain(fit: Estimate) -> Estimate:
    """Return the estimate by least squares beneath a corrected one."""
    return fit if fit.correction is None else replace(fit, value=fit.correction.least_squares)


@frozen
class Shrinkage:
    """What noise makes of the values of k independent columns, direction by direction.

    Attributes
    ----------
    left : (k, k)
        Rows that turn values of least squares into directions.
    share : (k,)
        Of each true one that noise leaves.
    weak : (k,) bool
        Directions that stay with least squares.
    right : (k, k)
        What each direction is of the corrected values, one a column.
    rest : (k, k)
        What of the values is in no direction, and stays.
    """

    left: Array
    share: Array
    weak: np.ndarray
    right: Array
    rest: Array

    @property
    def H(self) -> Array:
        """What turns values of least squares into corrected ones, (k, k)."""
        H: Array = self.rest + self.right @ self.left
        return H

    def leave(self, value: Array, covariance: Array) -> tuple[Array, Array]:
        """Return what noise, and the bias that stays, move, a direction a column, (k, k) each.

        The bias is what the correction would change, as far as noise lets that be known.
        """
        variance = np.maximum(np.einsum("ij,jk,ik->i", self.left, covariance, self.left), 0.0)
        more = 1.0 / np.maximum(self.share, LEFT) - 1.0
        bias = np.where(self.weak, more * np.sqrt((self.left @ value) ** 2 + variance), 0.0)
        return self.right * np.sqrt(variance), self.right * bias


def _shrinkage(information: Information, weights: Array) -> Shrinkage:
    """Return what noise makes of independent columns' values."""
    k, echo = information.size, information.echo
    assert echo is not None

    def make() -> Shrinkage:
        R = echo.joint.factor(weights)
        return _noise_map(R[:, :k], R[:, k : 2 * k])

    found: Shrinkage = information.remember(("echo", weights.tobytes()), make)
    return found


def _noise_map(V: Array, W: Array) -> Shrinkage:
    """Return what noise makes of values, from rows with new noise and without, (m, k) each.

    In the metric of rows with noise the map is symmetric but for what is odd in the noise: no
    direction is turned into another.
    """
    k = V.shape[1]
    R = triangular_factor(np.hstack([V, W]))
    root = R[:k, :k]
    back = _inverse(root)
    U, s, Yt = np.linalg.svd(root @ back @ R[:k, k:] @ back)
    # Directions of which noise leaves less than this share stay with least squares: what is
    # known of the noise is not enough to multiply them by more.
    weak = s < 0.5
    right = np.where(weak, U, Yt.T / np.where(weak, 1.0, s))
    return Shrinkage(U.T @ root, s, weak, back @ right, np.eye(k) - back @ root)


def _solve(root: Array, right: Array) -> Array:
    """Return what a triangular factor (k, k) makes a right side of, as far as it determines it."""
    if (np.abs(np.diag(root)) > ROUNDING * np.linalg.norm(root, axis=0)).all():
        return np.asarray(solve_triangular(root, right))
    return np.asarray(_inverse(root) @ right)


def _undo(A: Array) -> Array:
    """Return the inverse of a map (k, k); zero where it leads nowhere."""
    scale = np.linalg.norm(A, axis=1)[:, None]
    scale = np.where(scale > 0, scale, 1.0)
    s = np.linalg.svd(A / scale, compute_uv=False)
    if len(s) and not s[-1] > ROUNDING * s[0]:
        return np.asarray(np.linalg.pinv(A / scale, rcond=ROUNDING) / scale.T)
    return np.asarray(np.linalg.inv(A))


def _inverse(root: Array) -> Array:
    """Return the inverse of a triangular factor (k, k), of what it determines.

    A fold of a short log need not determine what the whole does.
    """
    scale = np.linalg.norm(root, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    inverse: Array = np.linalg.pinv(root / scale, rcond=APART) / scale[:, None]
    return inverse
