"""How long the noise of each actuator remembers, from what a fit leaves of the blocks of time.

Slow noise makes the sums of residuals over blocks of time scatter more than white noise does. How
much more, with the blocks before and after, is the integrated autocorrelation time κ: ``σ² κ`` is
what the noise weighs in an average over many samples, so 1/(σ² κ) is the weight of an actuator
[Aitken 1935, with a noise that is slow beside the columns].

Slow noise is also what a fit swallows first, so that what is left looks small and forgetful: of 750
samples with a correlation of .98 from each to the next, 39 columns leave a residual that seems to
remember 30 samples, and not 99. So the scatter is not compared with the number of samples, but with
what the columns leave of noise of the weights' own size: each lag less its part of the projection,
which sums of columns over blocks tell. On a six-axis arm with 58 columns that gives 19 to 21 where
19 is true (the residual alone 9 to 13), and half of what is true where 750 samples remember 99.

The residual sample by sample says no more than that and would cost a pass over all logs, and for
long ones their regressor, before the fit.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri, polygamma

from identifiability.estimation.estimator import Estimate
from identifiability.estimation.noise.residual_noise import ROUNDING
from identifiability.foundation.linalg import unit_coordinates
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

#: Lags are summed up to so many times the sum so far [Sokal 1997].
WINDOW = 5.0

#: At least this share of the samples is taken to be left by the columns.
LEFT = 0.25

#: Of fewer blocks of time it cannot be seen what is slow; the noise is then taken as white.
FEWEST = 8

#: Times are told apart from this share of the distribution on that equal ones would have.
DIFFERENT = 0.95


@frozen
class Noise:
    """The noise of n actuators.

    Attributes
    ----------
    variance : (n,) [torque²]
    times : (n,)
        Integrated autocorrelation times [samples].
    """

    variance: Array
    times: Array

    def count_left(self, information: Information, fit: Estimate) -> Array:
        """Return the mean square of what a fit leaves, with what its columns took of noise, (n,).

        Parameters
        ----------
        information : Information
        fit : Estimate
            By least squares.
        """
        _, taken = _take(information.select(fit.kept), fit.weights)
        left: Array = (fit.rss + self.variance * self.times * taken) / information.rows_each
        return left


@frozen
class LogNoise(Noise):
    """The noise of logs, measured beside a whole model of them.

    Attributes
    ----------
    left : (2, n)
        What the whole model leaves (`count_left`), fitted with equal weights and with its own
        [torque²].
    """

    left: Array

    def beside(self, information: Information, fit: Estimate, whole: Array) -> Noise:
        """Return the noise with what a smaller model leaves more than the whole one.

        What is left out is no noise, but an error of the model's equations all the same, which
        is as large at an actuator whatever the logs' noise is there.

        Parameters
        ----------
        information : Information
        fit : Estimate
            Of the smaller model, by least squares.
        whole : (n,) [torque²]
            What the whole one leaves.
        """
        more = np.maximum(self.count_left(information, fit) - whole, 0.0)
        return Noise(self.variance + more, self.times)


def measure_memory(information: Information, fit: Estimate) -> tuple[Array, Array]:
    """Return variance [torque²] and autocorrelation time [samples, at least 1] of noise, (n,) each.

    Parameters
    ----------
    information : Information
    fit : Estimate
        By least squares, with weights that are about right.
    """
    k, N, B = len(fit.kept), information.samples, len(information.counts)
    own_rows = information.rows_each
    part = information.select(fit.kept)
    turn, taken = _take(part, fit.weights)
    change = np.column_stack([turn, np.append(-fit.value[list(fit.kept)], 1.0)])
    rounding = ROUNDING**2 * part.torque
    slow, known = fit.rss / own_rows, np.full(information.actuators, np.inf)
    for a, ((own, turned), rss) in enumerate(zip(part.of_actuators(change), fit.rss, strict=True)):
        if rss <= rounding[a]:
            continue  # what rounding left has no memory to speak of
        sums = own.sums @ turned
        scatter = _sum_lags(sums[:, k:], information.log)
        left = own_rows[a] - fit.weights[a] * _sum_lags(sums[:, :k], information.log)
        ratio = scatter / np.maximum(left, LEFT * own_rows[a])
        # Blocks at a lag hold pairs of samples that are half a block farther apart on average.
        apart = (np.arange(B) + 0.5) * N / B
        enough = apart >= WINDOW * scatter / rss
        summed = int(enough.argmax()) + 1 if enough.any() else B
        # The largest on the way: what a fit swallowed makes later lags negative.
        slow[a], known[a] = ratio[:summed].max(), B / (2 * summed - 1)
    variance = (fit.rss + slow * taken) / own_rows
    raw = np.divide(slow, variance, out=np.ones_like(slow), where=variance > 0)
    return variance, np.maximum(_share(raw, known, B, N / B), 1.0)


def taken_of_blocks(information: Information, fit: Estimate) -> Array:
    """Return what a fit's columns take of noise of variance 1 in each block, (n, B)."""
    part = information.select(fit.kept)
    turn, _ = _take(part, fit.weights)
    taken: Array = fit.weights[:, None] * part.squares_of_blocks(turn)
    return taken


def _take(part: Information, weights: Array) -> tuple[Array, Array]:
    """Return unit coordinates (k + 1, k), and what columns take of noise of variance 1, (n,)."""
    k = part.size
    turn = np.vstack([unit_coordinates(part.factor(weights)[:k, :k]), np.zeros((1, k))])
    return turn, weights * part.squares(turn).sum(1)


def _share(times: Array, known: Array, blocks: int, block: float) -> Array:
    """Return one time for all actuators where theirs do not differ more than can be told, (n,).

    Parameters
    ----------
    times : (n,) [samples]
    known : (n,)
        Independent squares of which each is made; infinite where it is certain.
    blocks : int
    block : float [samples]
    """
    open_ = np.isfinite(known) & (times > 0)
    if open_.sum() < 2:
        return times
    same = float(np.average(times[open_], weights=known[open_]))
    # How far such times would be apart: of squares so many the logarithm has this variance.
    lags = np.ceil(max(WINDOW * same / block - 0.5, 0.0))
    spread = polygamma(1, 0.5 * blocks / (2.0 * lags + 1.0))
    apart = float(np.log(times[open_]).var(ddof=0) * open_.sum() / spread)
    different = apart > chdtri(open_.sum() - 1, 1.0 - DIFFERENT)
    return times if different else np.where(open_, same, times)


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
        size = 1 << (2 * len(own) - 1).bit_length()
        power = (np.abs(np.fft.rfft(own, size, axis=0)) ** 2).sum(1)
        total[: len(own)] += np.fft.irfft(power, size)[: len(own)]
    sums: Array = 2.0 * np.cumsum(total) - total[0]
    return sums
