"""`Estimate`, and the `Estimator` that made it and computes its refits, loss and projections.

Least squares on `Information`, ordinary or weighted by actuator, by instruments where there are
any. The autocorrelation time of each actuator's noise is measured in the residuals of blocks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import chdtri, polygamma

from identifiability.foundation.linalg import (
    NEARLY,
    RANK_TOLERANCE,
    ROUNDOFF,
    TINY,
    few_at_once,
    find_chains,
    or_one,
    sandwich,
    scan_columns,
    solve_each,
    triangular_factor,
    unit_coordinates,
)
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen, remember
from identifiability.regression.information import Information

from .noise import Noise
from .rules import RULES, Thresholds


@frozen
class Estimate:
    """Parameter values with their covariance under white noise.

    Attributes
    ----------
    columns : tuple of str
    value : (k,)
        Columns that depend on others are held at zero.
    covariance : (k, k)
        Under independent residuals; infinite variance where not determined.
    determined : (k,) bool
        False for parameters that this motion determines in combination with others only, or
        not at all.
    kept : tuple of int
        Independent columns, the ones that were fitted.
    variance : (n,)
        Noise variance of each actuator, with what the columns swallow of it [torque²].
    rss : (n,)
        Residual sum of squares of each actuator.
    rows : (n,)
        Rows of each actuator, one at least.
    open : (k, d)
        Changes of values that change no torque, in columns of length one: one for each column that
        was not fitted.
    condition : float
        Condition number of the column-scaled matrix of determined columns.
    weights : (n,)
        Weight of each actuator.
    times : (n,)
        Integrated autocorrelation time of each actuator's noise [samples].
    estimator : Estimator
        What made it.
    bias : (weak, k) or None
        What the root mean square of the bias moves that least squares may have in each direction
        that stays with it, because noise drowns the motion there; None without instruments.
    """

    columns: Strings
    value: Array
    covariance: Array
    determined: np.ndarray
    kept: tuple[int, ...]
    variance: Array
    rss: Array
    rows: np.ndarray
    open: Array
    condition: float
    weights: Array
    times: Array
    estimator: Estimator
    bias: Array | None = None

    @property
    def noise(self) -> Noise:
        """That of the actuators."""
        return Noise(self.variance, self.times)

    @property
    def memory(self) -> float:
        """Autocorrelation time of the actuators that carry the residual [samples]."""
        share = self.weights * self.variance
        total = share.sum()
        if not total > 0:
            return float(self.times.mean())
        return float((share * self.times).sum() / total)

    @property
    def dof(self) -> int:
        """Rows less fitted columns."""
        return int(self.rows.sum()) - len(self.kept)

    @property
    def unit(self) -> float:
        """Variance of noise of weight 1, whose independent rows pay for the columns."""
        independent = float(np.sum(self.rows / self.times)) - len(self.kept)
        return float(self.weights @ self.rss) / max(independent, 1.0)

    @cached_property
    def sigma(self) -> Array:
        """Standard deviations, (k,)."""
        return np.sqrt(np.diag(self.covariance))

    @cached_property
    def sigma_percent(self) -> Array:
        """Relative standard deviations σ%, ``100 σ/|φ|``, (k,) [%]."""
        with np.errstate(divide="ignore", invalid="ignore"):
            percent = 100 * self.sigma / np.abs(self.value)
        return np.where(self.determined & np.isfinite(percent), percent, np.inf)

    @cached_property
    def paper_rule(self) -> np.ndarray:
        """The 10× rule: σ% below ten times the smallest of the model, (k,) bool."""
        percent = self.sigma_percent
        least = percent.min(initial=np.inf)
        return percent < RULES.paper_factor * least


def clip_signs(information: Information, fit: Estimate, nonnegative: np.ndarray) -> Array:
    """Return the values (k,), with negative ones at zero if the difference is rounding.

    Parameters
    ----------
    information : Information
        About the columns that were fitted.
    fit : Estimate
    nonnegative : (k,) bool
        Parameters that physics does not allow below zero.
    """
    root = information.factor()
    reach = ROUNDOFF * np.linalg.norm(root[:, -1])
    rounded = nonnegative & (fit.value < 0)
    rounded &= -fit.value * np.linalg.norm(root[:, :-1], axis=0) <= reach
    return np.where(rounded, 0.0, fit.value)


# Least squares without the bias of noise in the motion, by instruments.
#
# Noise in q, dq and ddq makes the columns of W noisy. Least squares takes that for motion and pulls
# values towards zero, and more data do not help. Instruments V, the same columns along a second
# record of the motion whose noise is another one, are correlated with the motion and not with the
# noise: ``(Vᵀ W)⁻¹ Vᵀ τ`` converges to the values of noise-free columns [Janot, Vandanjon, Gautier
# 2014]. Their value depends on their correlation with W; canonical correlations measure it
# direction by direction. The difference to least squares is the bias that would have been believed
# [Hausman 1978].


#: Directions that follow noise-free columns by less than this share stay with least squares: the
#: noise is not known well enough for a larger factor.
WEAK: Tolerance = 0.5


@frozen
class Combined:
    """Instruments, combined so that each belongs to one direction of W.

    Attributes
    ----------
    left : (2k, k)
        Coefficients T of the instruments ``[V W] T``, with ``([V W] T)ᵀ W B = I``.
    B : (k, k)
        Directions of the parameters, one a column.
    value : (k,)
    rss : (n,)
        What they leave at each actuator.
    scale : float
        Variance of noise of weight 1.
    bias : (weak, k)
        Root mean square of the bias that least squares may have in each direction that stays with
        it: the change by instruments, as far as noise of that variance makes it certain.
    root : (k, k)
        D, ``scale (DᵀD)⁻¹`` being the covariance of the values with their bias.
    """

    left: Array
    B: Array
    value: Array
    rss: Array
    scale: float
    bias: Array
    root: Array

    def moments(self, information: Information, weights: Array) -> Array:
        """Return each block's ``Ẑᵀ [W B, e]``, (B, k, k + 1)."""
        k = len(self.value)
        left = np.vstack([self.left, np.zeros((1, k))])
        right = np.zeros((2 * k + 1, k + 1))
        last_row = np.append(-self.value, 1.0)
        right[k : 2 * k, :k] = self.B
        right[k:, k] = last_row
        joint = information.joint
        both = joint.products(weights, left, right)
        if joint.prior is None:
            return both
        known = (joint.prior @ left).T @ (joint.prior @ right)
        return np.concatenate([both, known[None]])


def combine(information: Information, plain: Estimate) -> Combined:
    """Return the instruments of independent columns and their values, for weights of a fit."""
    weights = plain.weights

    def make() -> Combined:
        k = information.size
        N = max(information.samples, 1)
        R = information.joint.factor(weights)
        V = R[:k, :k]
        Q, root = np.linalg.qr(R[:, k : 2 * k])
        to_V = _inverse(V)
        to_W = _inverse(root)
        left, strength, Yt = np.linalg.svd(V @ to_V @ Q[:k])
        weak = strength < WEAK
        B = to_W @ Yt.T
        share = np.where(weak, 1.0, strength)
        strong = np.where(weak, 0.0, to_V @ left / share)
        T = np.vstack([strong, np.where(weak, B, 0.0)])
        x = to_W @ (Q.T @ R[:, 2 * k])
        rest = R[:k, 2 * k] - R[:k, k : 2 * k] @ x
        moved = left.T @ rest
        x = x + B @ np.where(weak, 0.0, moved / share)
        lean = np.maximum(strength, 1.0 / np.sqrt(N))  # noise alone correlates by that
        rss = information.squares(np.append(-x, 1.0))
        scale = replace(plain, rss=rss, rows=information.rows_each).unit
        square = np.where(weak, (moved / lean) ** 2 + scale * (1.0 / lean**2 - 1.0), 0.0)
        wider = np.sqrt(1.0 / share**2 + (square / scale if scale > 0 else 0.0))
        bias = (B * np.sqrt(square))[:, weak].T
        return Combined(T, B, x, rss, scale, bias, Yt @ root / wider[:, None])

    key = "instruments", weights.tobytes(), plain.times.tobytes()
    return remember(information.made, key, make, 4)


# Effect of a block of time on a fit, as if it had not pulled the fit towards itself.


#: The residual of a block in a direction that it determines almost alone is raised to this.
ALONE: Tolerance = 0.05


def correct_leverage(scores: Array, shares: Array) -> Array:
    """Return scores as if each block had not pulled the fit towards itself, (B, k).

    Parameters
    ----------
    scores : (B, k)
    shares : (B, k, k)
        Of each block in the whole information, which is the unit matrix; made symmetric.
    """
    corrected = np.empty(scores.shape)
    for at in few_at_once(len(scores), shares[:1].nbytes):
        own = 0.5 * (shares[at] + shares[at].swapaxes(1, 2))
        values, vectors = np.linalg.eigh(np.eye(scores.shape[1]) - own)
        lever = 1.0 / np.sqrt(np.maximum(values, ALONE))
        corrected[at] = np.einsum(
            "bij,bj,bkj,bk->bi", vectors, lever, vectors, scores[at], optimize=True
        )
    return corrected


def _inverse(root: Array) -> Array:
    """Return the inverse of a triangular factor (k, k), on the space that it determines.

    A fold of a short log may determine fewer directions than all rows together.
    """
    scale = or_one(np.linalg.norm(root, axis=0))
    return np.linalg.pinv(root / scale, rcond=RANK_TOLERANCE) / scale[:, None]


# Memory of the noise of each actuator, from the residuals of blocks of time.
#
# Slow noise makes the sums of residuals over blocks of time scatter more than white noise does. How
# much more, with the blocks before and after, is the integrated autocorrelation time κ: ``σ² κ`` is
# the effect of the noise on an average over many samples, so 1/(σ² κ) is the weight of an actuator
# [Aitken 1936, with a noise that is slow beside the columns].
#
# A fit absorbs slow noise first, so that the residual looks small and white: of 750 samples with a
# correlation of .98 from each to the next, 39 columns leave a residual that seems to remember 30
# samples, and not 99. So the scatter is not compared with the number of samples. It is compared
# with the residual of noise of the weights' size: each lag minus its part of the projection, by
# sums of columns over blocks. On a six-axis arm with 58 columns that gives 19 to 21 where 19 is
# true (the residual alone 9 to 13), and half of the true value where 750 samples have a memory of
# 99.
#
# The residual sample by sample says no more than that and would cost a pass over all logs, and for
# long ones their regressor, before the fit.


#: At least this share of the samples is taken to be left by the columns.
LEFT: Tolerance = 0.25


def measure_memory(information: Information, fit: Values | Estimate) -> Noise:
    """Return the noise of actuators, their autocorrelation times at least 1.

    Parameters
    ----------
    information : Information
    fit : Values or Estimate
        By least squares, with weights that are about right.
    """
    k = len(fit.kept)
    N = information.samples
    B = len(information.counts)
    own_rows = information.rows_each
    part = information.select(fit.kept)
    unit = unit_coordinates(part.factor(fit.weights)[:k, :k])
    turn = np.vstack([unit, np.zeros((1, k))])
    taken = np.zeros(information.actuators)  # of noise of variance 1
    kept = fit.value[list(fit.kept)]
    change = np.column_stack([turn, np.append(-kept, 1.0)])
    rounding = RANK_TOLERANCE**2 * part.torque
    slow = fit.rss / own_rows
    known = np.full(information.actuators, np.inf)
    for a, ((own, turned), rss) in enumerate(zip(part.of_actuators(change), fit.rss, strict=True)):
        acting = turned[:, :k][:, turned[:, :k].any(0)]
        taken[a] = fit.weights[a] * np.square(own.root @ acting).sum()
        if rss <= rounding[a]:
            continue  # rounding errors have no memory
        scatter = _sum_lags(own.sums @ turned[:, k:], information.log)
        absorbed = fit.weights[a] * _sum_lags(own.sums @ acting, information.log)
        left = own_rows[a] - absorbed
        ratio = scatter / np.maximum(left, LEFT * own_rows[a])
        # Blocks at a lag hold pairs of samples that are half a block farther apart on average.
        apart = (np.arange(B) + 0.5) * N / B
        enough = apart >= RULES.memories * scatter / rss
        summed = int(enough.argmax()) + 1 if enough.any() else B
        # The largest along the lags: noise that a fit absorbed makes later lags negative.
        slow[a] = ratio[:summed].max()
        known[a] = B / (2 * summed - 1)
    variance = (fit.rss + slow * taken) / own_rows
    times = np.divide(slow, variance, out=np.ones_like(slow), where=variance > 0)
    return Noise(variance, np.maximum(_shrink(times, known), 1.0))


def _shrink(times: Array, known: Array) -> Array:
    """Return times (n,) shrunk towards each other as far as chance may set them apart.

    Parameters
    ----------
    times : (n,) [samples]
    known : (n,)
        Independent squares of which each is made; infinite where it is certain.
    """
    own = np.isfinite(known) & (times > 0)
    if own.sum() < 2:
        return times
    apart = np.log(times[own] / np.average(times[own], weights=known[own]))
    shrunk = times.copy()
    # Of the squares' mean the logarithm has this variance.
    chance_of_one = polygamma(1, 0.5 * known[own].mean())
    critical = chdtri(own.sum() - 1, Thresholds.sign_level)
    chance = chance_of_one * critical
    explained = chance / max(own.sum() * apart.var(), TINY)
    shrunk[own] *= np.exp(-apart * min(explained, 1.0))
    return shrunk


def _sum_lags(x: Array, log: np.ndarray) -> Array:
    """Return sums of ``x_b · x_c`` over blocks up to each lag apart, of one log, (B,).

    Parameters
    ----------
    x : (B, m)
    log : (B,)
    """
    total = np.zeros(len(x))
    for which in np.unique(log):
        own = x[log == which]
        blocks = len(own)
        pairs = np.triu(own @ own.T)
        # In rows that are longer by one, each diagonal of the matrix is a column.
        longer = np.append(pairs, np.zeros(blocks)).reshape(blocks, blocks + 1)
        total[:blocks] += longer[:, :blocks].sum(0)
    return 2.0 * np.cumsum(total) - total[0]


# Least squares on `Information`: ordinary, or weighted per actuator.
#
# What to use when: ``ols`` reproduces the literature (one variance for all actuators); ``wls``
# weights each actuator by the variance of its noise times its memory. It is the better estimate
# whenever joints differ in size or in the memory of their noise.


@frozen
class Estimator:
    """A method of estimation, with the equations that it implies for blocks of time.

    Refits keep the weights of the fit.

    Attributes
    ----------
    weighted : bool
        Whether each actuator weighs ``1/(σ² κ)`` of its noise, σ² being its variance and κ its
        autocorrelation time: what the noise weighs in an average.
    instruments : bool
        Whether instruments remove the bias of noise in the motion, in the directions in which they
        are strong; information without any is fitted by least squares.
    noise : Noise or None
        That of the logs, where it is known (`estimate.estimate_noise`); else it is measured in what
        each fit leaves.
    """

    weighted: bool = True
    instruments: bool = False
    noise: Noise | None = None

    @property
    def name(self) -> str:
        """Name for `analyze`, `prune` and the command line."""
        if self.instruments:
            return "iv"
        if self.weighted:
            return "wls"
        return "ols"

    def fit(self, information: Information) -> Estimate:
        """Return the estimate; one by instruments keeps the weights and noise of least squares.

        Effects that a model omits are not noise, but errors of its equations: an actuator whose
        torque the model cannot explain must not decide parameters that others need, however quiet
        it is.
        """
        plain = self._fit_plain(information)
        if not (self.instruments and information.instrumented and plain.kept):
            return plain
        kept = list(plain.kept)
        part = information.select(kept)
        found = combine(part, plain)
        # Under independent residuals, for any weights.
        Z = part.joint.factor(plain.weights / plain.times)[:, : 2 * part.size] @ found.left
        value = plain.value.copy()
        spread = plain.covariance.copy()
        value[kept] = found.value
        white = found.scale * found.B @ Z.T @ Z @ found.B.T
        spread[np.ix_(kept, kept)] = white + found.bias.T @ found.bias
        both = np.logical_and.outer(plain.determined, plain.determined)
        bias = np.zeros((len(found.bias), len(value)))
        bias[:, kept] = found.bias
        added_rss = np.maximum(found.rss - plain.rss, 0.0) * len(plain.rss)
        more = added_rss / plain.rows.sum()
        wider = np.where(both, spread, plain.covariance)
        return replace(
            plain,
            value=value,
            covariance=wider,
            rss=found.rss,
            variance=plain.variance + more,
            estimator=self,
            bias=bias,
        )

    def _fit_plain(self, information: Information) -> Estimate:
        plain = replace(self, instruments=False)
        equal = find_values(information, np.ones(information.actuators))
        noise = self.noise or measure_noise(information, equal)
        if not self.weighted:
            unit_times = np.ones(information.actuators)
            fit = _estimate(information, equal, plain, unit_times)
            return replace(fit, variance=noise.variance, times=noise.times)
        left = np.maximum(noise.variance, equal.rss / information.rows_each)
        weights = weigh(information, left * noise.times)
        values = find_values(information, weights)
        return replace(_estimate(information, values, plain, noise.times), variance=left)

    def refit(self, information: Information, fit: Estimate, counts: Array) -> Array:
        """Return the values when block b counts ``counts[r, b]`` times, (replicates, k).

        Columns that `fit` dropped stay zero; a replicate that determines no values is NaN.
        `counts` is (replicates, B), of resampling or of leaving out folds.
        """
        values = np.zeros((len(counts), information.size))
        for columns, start, to_x, both in self._equations_of_chains(information, fit):
            # The prior counts once in each.
            more = ((0, 0), (0, len(both) - len(information.counts)))
            each = np.pad(counts, more, constant_values=1.0)
            flat = both.reshape(len(both), -1)
            for at in few_at_once(len(each), flat[:1].nbytes):
                sums = (each[at] @ flat).reshape(-1, *both.shape[1:])
                values[at, columns] = start + solve_each(sums) @ to_x.T
        return values

    def influence(self, information: Information, fit: Estimate) -> Array:
        """Return the change of the values by each block, (B, k) [unit of each parameter].

        The squares, summed over independent blocks, are the variance of the values: leverage is
        allowed for [Bell & McCaffrey 2002]. Columns that `fit` dropped are zero.
        """
        blocks = len(information.counts)
        moved = np.zeros((blocks, information.size))
        for columns, _, to_x, both in self._equations_of_chains(information, fit):
            of_blocks = both[:blocks]
            corrected = correct_leverage(of_blocks[:, :, -1], of_blocks[:, :, :-1])
            moved[:, columns] = corrected @ to_x.T
        return moved

    def _equations_of_chains(
        self, information: Information, fit: Estimate
    ) -> Iterator[tuple[np.ndarray, Array, Array, Array]]:
        """Yield the kept columns of each chain, and their `equations`."""
        part = information.select(fit.kept)
        together = [np.arange(part.size)] if fit.kept else []
        for chain in together if self.instruments else part.chains:
            columns = np.array(fit.kept)[chain]
            yield columns, *self.equations(part.select(chain.tolist()), fit)

    def equations(self, part: Information, fit: Estimate) -> tuple[Array, Array, Array]:
        """Return values (k,), coordinates (k, k) and equations of blocks in these, (B, k, k + 1).

        Their unknowns are corrections to the values. So the large part of τ that the values explain
        never enters a difference of squares. A prior is one more block.
        """
        if self.instruments:
            found = combine(part, fit)
            return found.value, found.B, found.moments(part, fit.weights)
        k = part.size
        R = part.factor(fit.weights)
        to_x = unit_coordinates(R[:k, :k])
        value = to_x @ R[:k, k]
        change = np.zeros((k + 1, k + 1))
        change[:k, :k] = to_x
        change[:, k] = np.append(-value, 1.0)
        both = part.products(fit.weights, change[:, :k], change)
        if part.prior is not None:
            known = part.prior @ change
            both = np.concatenate([both, (known[:, :k].T @ known)[None]])
        return value, to_x, both

    def loss(self, information: Information, fit: Estimate) -> Array:
        """Return upper triangular F, (k + 1, k + 1) [torque]: ``|F (x, -1)|²`` is least at the fit.

        The physically consistent projection minimises this distance, and posteriors use it as
        likelihood. By instruments it measures the projection of the residual on them: the
        estimate's distance in the unit of its own covariance, on top of the residual sum of
        squares.
        """
        if not self.instruments:
            return information.factor(fit.weights)
        kept = list(fit.kept)
        k = information.size
        part = information.select(kept)
        F = np.zeros((k + 1, k + 1))
        F[: len(kept), kept] = combine(part, fit).root
        F[:k, k] = F[:k, :k] @ fit.value
        F[k, k] = np.sqrt(fit.weights @ fit.rss)
        return triangular_factor(F)

    def project(self, information: Information, fit: Estimate, M: Array) -> Array:
        """Return the fitted values (k, b) for a unit of each of b parameters, without noise.

        Parameters
        ----------
        information : Information
            About all b parameters.
        fit : Estimate
            Of k combinations of them.
        M : (b, k)
            These combinations, of the columns that the fit kept.
        """
        R = information.factor(fit.weights)[:, :-1]
        return np.linalg.lstsq(R @ M, R, rcond=None)[0]


def measure_noise(information: Information, equal: Values) -> Noise:
    """Return the noise in the residual of a fit with equal weights.

    Large or slow noise at one actuator leaks into the residuals of the others. So the noise is
    measured twice more, each time after a fit with weights by the noise that was measured before.
    """
    noise = Noise(equal.variance, np.ones(information.actuators))
    enough = len(information.counts) >= RULES.blocks_fewest
    for _ in range(2 if enough and equal.variance.any() else 0):
        weights = weigh(information, noise.variance * noise.times)
        noise = measure_memory(information, find_values(information, weights))
    return noise


def weigh(information: Information, density: Array) -> Array:
    """Return the weight of each actuator by variance times memory of its noise (n,), (n,)."""
    floor = TINY * float(np.max(density, initial=0.0))
    mean_square = float(information.torque.sum()) / max(information.rows, 1)
    density = np.maximum(density, max(floor, TINY**2 * mean_square))
    if density.all():
        return float(np.mean(density)) / density
    return np.ones(information.actuators)


@frozen
class Values:
    """Values of a fit, without their covariance.

    Attributes
    ----------
    weights : (n,)
        Weight of each actuator.
    kept : tuple of int
        The m independent columns.
    value : (k,)
        Columns that depend on others are held at zero.
    rss, variance : (n,)
        Residual sum of squares of each actuator, and per row that is not spent on a column.
    open : (k, d)
        As in `Estimate`.
    factor : (m, m)
        Triangular factor of the kept columns.
    length : (k,)
        Norm of each column.
    """

    weights: Array
    kept: tuple[int, ...]
    value: Array
    rss: Array
    variance: Array
    open: Array
    factor: Array
    length: Array


def find_values(information: Information, weights: Array) -> Values:
    """Return the values of weighted least squares."""
    k = information.size
    R = information.factor(weights)
    length = np.linalg.norm(R[:, :k], axis=0)
    acts = length > RANK_TOLERANCE * length.max(initial=0.0)
    unit = np.where(acts, R[:, :k] / np.where(acts, length, 1.0), 0.0)
    kept = scan_columns(unit, np.flatnonzero(acts).tolist())
    dropped = np.delete(np.arange(k), kept)
    never = np.eye(k)[:, dropped]
    m = len(kept)
    value = np.zeros(k)
    if kept and len(dropped):
        never[kept] = -np.linalg.lstsq(unit[:, kept], unit[:, dropped], rcond=None)[0]
        R = triangular_factor(R[:, [*kept, k]])
    if kept:
        value[kept] = solve_triangular(R[:m, :m], R[:m, m])
    rss = information.squares(np.append(-value, 1.0))
    # Each actuator pays for its share of the parameters in proportion to its rows.
    freedom = information.rows_each * (1 - m / max(information.rows, 1))
    variance = rss / np.maximum(freedom, 1.0)
    return Values(weights, tuple(kept), value, rss, variance, never, R[:m, :m], length)


def _estimate(
    information: Information, values: Values, estimator: Estimator, times: Array
) -> Estimate:
    """Return values with their covariance, for noise of the autocorrelation times."""
    k = information.size
    kept = np.array(values.kept, int)
    covariance = np.zeros((k, k))
    # Weights that know of memory are those of σ² κ; independent residuals would have σ² alone.
    white = information.factor(values.weights / times)
    spans = [np.ones(1)]
    for chain in find_chains(values.factor != 0):
        at = kept[chain]
        own = values.factor[np.ix_(chain, chain)]
        covariance[np.ix_(at, at)] = sandwich(own, white[:, at])
        spans.append(np.linalg.svd(own / values.length[at], compute_uv=False))
    span = np.concatenate(spans[1:] or spans)
    # A column that a dropped one leans on has a value only as long as that one is zero.
    determined = np.abs(values.open).max(1, initial=0.0) < NEARLY
    covariance[~determined] = covariance[:, ~determined] = 0.0
    found = Estimate(
        columns=information.columns,
        value=values.value,
        covariance=covariance,
        determined=determined,
        kept=values.kept,
        variance=values.variance,
        rss=values.rss,
        rows=information.rows_each,
        open=values.open,
        condition=float(span.max() / span.min()),
        weights=values.weights,
        times=times,
        estimator=estimator,
    )
    undetermined = np.diag(np.where(determined, 0, np.inf))
    return replace(found, covariance=found.unit * covariance + undetermined)
