"""`Evidence`: is A a better account of this robot than B? All choices and statements use it.

Accounts are compared by their predictions of motion that was not used to choose them. Three steps::

    folds = Folds.of(information, memory)              # test rows and training rows
    held = Held.of(information, noise, folds)          # sums over each fold, whitened; once
    a = held.score(held.refit(fit), held.roots(fit))   # `Score` of a model's predictions
    M = submodel.M                                     # of one that has fewer parameters
    b = held.score(held.refit(smaller, M, submodel.fixed), held.roots(smaller, M))
    Evidence.of(a, b).limits                           # of the gain, in which A is better

What to use when:

- *A choice* (a model, a weight of a prior, an estimator) is made on blocked folds of the fitted
  logs. `HeldOut.refit` asks the estimator for its fits to each fold's rest; `score` takes values
  ``(F, k)`` that somebody else has fitted to these (`Folds.train`), over the k columns of the
  regression, so a reduced model's are ``fixed + M x``. The smallest model that is as good as the
  best (`near_best`) is used.
- *A veto or a statement* on logs that are held out: ``HeldOut.of(validation, noise)`` and
  ``score(value)``: one model for all folds, and folds do not share data.

The predictive log density of a fold is that of its torque under ``τ ~ N(W φ, S + W Σ Wᵀ)``. The
values φ were fitted to the other folds, and Σ is the covariance of their errors, if given; noise
``S = σ² κ`` of each joint is tempered by its autocorrelation time κ, as in the weights of the fit.
Constants are the same for all accounts with the same noise: judge both with the noise of the
richer. Without the errors one fold with another motion would decide the weight of the file. Each
fold leaves out one autocorrelation time on both sides.

A gain is ``Σ ln p_A - ln p_B`` [nats], or ``ln(e_B / e_A)`` of the error over each joint's own
scale. So A against B is minus B against A. Folds share the data of their fits, and standard errors
know it: ``SE² = s² (1/K + n_test/n_train)`` of the mean over K folds [Nadeau & Bengio 2003]. Limits
are those of Student's t of K - 1; those of n joints hold together [Bonferroni].
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import product

import numpy as np
from scipy.special import stdtrit

from identifiability.foundation.errors import LogError
from identifiability.foundation.linalg import ROUNDOFF, or_one
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information

from .estimator import Estimate
from .gaussian import Normal
from .noise import Noise


@frozen
class Levels:
    """Levels by which evidence gets its words; `report/answers/words.toml` says it in words.

    Attributes
    ----------
    confidence : float
        *Better* if the lower limit of the gain at this confidence is above 0, *worse* if the upper
        one is below.
    rise : float
        *As good* if neither, and the error surely rises by less than this share.
    least_rise : float
        Rise of an error [share of the torque, rad or m] that is none. A noise-free log of the
        robot's own file shows errors of rounding alone.
    nats : float
        The smallest model within so many nats of the best predictive log density is used, or one
        that is as good as the best.
    folds, fewest : int
        Folds of a choice, and the fewest with which one is made.
    halvings : int
        Of a motion, into the regions that are left out.
    draws : int
        Of the Bayesian bootstrap over folds that weights of models are averaged over.
    """

    confidence: float = 0.95
    rise: float = 0.02
    least_rise: float = 5e-4
    nats: float = 2.0
    folds: int = 10
    fewest: int = 5
    halvings: int = 2
    draws: int = 1000


LEVELS = Levels()


@frozen
class Folds:
    """Which blocks of time each of F fits predicts, and which it is fitted to.

    Attributes
    ----------
    test : (B,) int
        Fold in which a block is predicted.
    train : (F, B) bool
        Blocks that the fit of each fold rests on: all blocks but those within its memory.
    ends : (B,) int
        Sample, over all logs, at which each block ends.
    ratio : float
        Samples that are predicted over samples that are fitted, on average.
    memory : float [samples]
        Autocorrelation time that is left out around each fold.
    """

    test: np.ndarray
    train: np.ndarray
    ends: np.ndarray
    ratio: float
    memory: float = 0.0

    @property
    def count(self) -> int:
        """Number of folds F."""
        return len(self.train)

    @property
    def tested(self) -> np.ndarray:
        """Blocks that each fold predicts, (F, B) bool."""
        return self.test == np.arange(self.count)[:, None]

    def at(self, start: int, stop: int) -> np.ndarray:
        """Return the fold that predicts each of the samples [start, stop), (n,) int."""
        return self.test[np.searchsorted(self.ends, np.arange(start, stop), "right")]

    @staticmethod
    def of(information: Information, memory: float = 0.0) -> Folds:
        """Return folds of logs: whole logs where there are enough of them, else stretches.

        Parameters
        ----------
        information : Information
        memory : float [samples]
            Autocorrelation time of the noise, the longest of the actuators'.

        Raises
        ------
        LogError
            If the logs are too short.
        """
        log = information.log
        counts = information.counts
        names = np.unique(log)
        lengths = np.bincount(log, counts).astype(int)
        lengths = lengths[names]
        wanted = _divide(lengths, memory)
        if wanted.sum() < LEVELS.fewest:
            raise LogError(
                f"{int(lengths.sum())} samples whose noise is remembered for {memory:.0f} make "
                f"{int(wanted.sum())} stretches that can be predicted from the others; a choice "
                f"needs {LEVELS.fewest}: give longer or more logs, or a higher cut-off."
            )
        ends = np.cumsum(counts)
        test = np.empty(len(counts), int)
        before = 0
        for name, pieces in zip(names, wanted.tolist(), strict=True):
            rows = np.flatnonzero(log == name)
            centres = ends[rows] - 0.5 * counts[rows]
            first_start = ends[rows[0]] - counts[rows[0]]
            middle = centres - first_start
            share = middle * pieces / counts[rows].sum()
            test[rows] = before + share.astype(int)
            before += pieces
        return Folds._around(information, np.unique(test, return_inverse=True)[1], memory)

    @staticmethod
    def of_regions(information: Information, memory: float = 0.0) -> Folds:
        """Return folds that leave out a region of the motion each, in all logs at once.

        Parameters
        ----------
        information : Information
        memory : float [samples]
        """
        return Folds._around(information, _divide_motion(information), memory)

    @staticmethod
    def _around(information: Information, test: np.ndarray, memory: float) -> Folds:
        """Return folds of the given blocks, whose memory is left out of each fit."""
        counts = information.counts
        log = information.log
        ends = np.cumsum(counts)
        starts = ends - counts
        train = np.ones((test.max() + 1, len(test)), bool)
        for k, fold in enumerate(test):
            near = (starts < ends[k] + memory) & (ends > starts[k] - memory)
            train[fold, near & (log == log[k])] = False
        tested = np.bincount(test, counts)
        ratio = float(np.mean(tested / np.maximum(train @ counts, 1)))
        return Folds(test, train, ends, ratio, memory)


def _divide(lengths: np.ndarray, memory: float) -> np.ndarray:
    """Return the number of folds of each log, (L,)."""
    if len(lengths) >= LEVELS.fewest:
        return np.ones(len(lengths), int)
    most = np.maximum(lengths // max(memory, 1.0), 1).astype(int)
    share = np.round(LEVELS.folds * lengths / lengths.sum()).astype(int)
    return np.clip(share, 1, most)


def _divide_motion(information: Information) -> np.ndarray:
    """Return the region of the motion in which each block lies, (B,) int.

    Blocks are alike if their mean equations are. Each region is halved across the direction in
    which its equations vary most.
    """
    columns = np.eye(information.size + 1)[:, :-1]
    sums = [part.sums @ own for part, own in information.of_actuators(columns)]
    mean = np.hstack(sums) / information.counts[:, None]
    size = mean.std(axis=0)
    varies = size > ROUNDOFF * size.max(initial=0.0)
    state = mean[:, varies] / size[varies]
    region = np.zeros(len(state), int)
    for _ in range(LEVELS.halvings):
        for here in [np.flatnonzero(region == k) for k in range(region.max() + 1)]:
            apart = state[here] - state[here].mean(axis=0)
            along = np.linalg.eigh(apart @ apart.T)[1][:, -1]
            region[here] = 2 * region[here] + (along > np.median(along))
    return np.unique(region, return_inverse=True)[1]


@frozen
class Score:
    """Predictions of F folds by an account that has not seen them.

    Attributes
    ----------
    density : (F,) [nats]
        Predictive log density, up to a constant.
    squares : (F, n) [(N·m)² or N²]
        Sums of squared errors.
    variation : (n,) [(N·m)² or N²]
        Sum of squares of each joint's torque about its mean, over all folds: its own scale. A joint
        without any does not count.
    ratio : float
        Samples predicted over samples fitted; 0 where nothing was refitted.
    """

    density: Array
    squares: Array
    variation: Array
    ratio: float

    @cached_property
    def shares(self) -> Array:
        """Squared errors of each fold over each joint's own scale, (F,)."""
        acts = self.variation > np.finfo(float).tiny  # below that it is rounding
        return self.squares[:, acts] @ (1.0 / self.variation[acts])

    @property
    def error(self) -> float:
        """The error over each joint's own scale, root mean square over the joints."""
        loaded = (self.variation > 0).sum()
        return float(np.sqrt(self.shares.sum() / max(int(loaded), 1)))

    def gain(self, other: Score) -> Gain:
        """Return the gain of its predictive log density over another's of the same folds [nats]."""
        return _sum_gain(self.density - other.density, max(self.ratio, other.ratio))


@frozen
class HeldOut:
    """Sums over the folds of a regression, in which any number of its models are scored.

    Attributes
    ----------
    information : Information
        About k columns.
    folds : Folds
    noise : (n,) [torque²]
        σ² κ of each joint.
    tests : Information
        Of what each fold predicts: a block a fold.
    """

    information: Information
    folds: Folds
    noise: Array
    tests: Information

    @staticmethod
    def of(information: Information, noise: Noise, folds: Folds | None = None) -> HeldOut:
        """Return the sums.

        Parameters
        ----------
        information : Information
        noise : Noise
            Of the richest of the accounts.
        folds : Folds, optional
            By default `Folds.of` with the memory of the noise.
        """
        folds = folds or Folds.of(information, float(np.max(noise.times)))
        own = np.maximum(noise.variance * noise.times, least_noise(information))
        return HeldOut(information, folds, own, information.summed(folds.tested))

    @cached_property
    def regions(self) -> HeldOut:
        """The same about folds that leave out regions of the motion.

        These are the given folds where the rest of a region is smaller than the region.
        """
        folds = Folds.of_regions(self.information, self.folds.memory)
        counts = self.information.counts
        if (folds.train @ counts < folds.tested @ counts).any():
            return self
        return HeldOut(self.information, folds, self.noise, self.information.summed(folds.tested))

    def refit(self, fit: Estimate, M: Array | None = None, fixed: Array | None = None) -> Array:
        """Return the values of a model fitted to each fold's rest, (F, k).

        Parameters
        ----------
        fit : Estimate
            Of the m columns ``W M``; its estimator fits them to each fold's rest.
        M : (k, m), optional
            The model among the k columns; by default it has all of them.
        fixed : (k,), optional
            Values that it holds fixed.
        """
        part = self.information
        if M is not None:
            part = part.reduce(M, fit.columns, fixed)
        values = fit.estimator.refit(part, fit, self.folds.train.astype(float))
        whole = values if M is None else values @ M.T
        return whole if fixed is None else whole + fixed

    def roots(self, fit: Estimate, M: Array | None = None) -> Array:
        """Return roots L of the errors ``L Lᵀ`` of a model fitted to each rest, (F, k, m).

        Of a fit with weights 1/(σ² κ) of the columns that it keeps.
        """
        M = (np.eye(self.information.size) if M is None else M)[:, list(fit.kept)]
        wide = np.vstack([M, np.zeros((1, M.shape[1]))])
        grams = self.information.summed(self.folds.train).products(1.0 / self.noise, wide, wide)
        if self.information.prior is not None:
            known = self.information.prior @ wide
            grams = grams + known.T @ known / self.noise.mean()
        length = or_one(np.sqrt(grams.max(0).diagonal()))
        none = np.zeros(len(length))
        each = [Normal.ridged(gram / length / length[:, None], none).root.T for gram in grams]
        return M / length @ np.stack(each)

    @cached_property
    def products(self) -> Array:
        """Products of the whitened columns and torque in each fold, (F, k + 1, k + 1)."""
        one = np.eye(self.information.size + 1)
        return self.tests.products(1.0 / self.noise, one, one)

    def score(self, values: Array, roots: Array | None = None) -> Score:
        """Return the score of an account.

        Parameters
        ----------
        values : (F, k) or (k,)
            Of the fit to each fold's rest; or of one that has seen none of the folds.
        roots : (F, k, m), optional
            Of the values' errors ``L Lᵀ``.
        """
        ones = np.ones((*values.shape[:-1], 1))
        left = np.concatenate([-values, ones], -1)
        left = np.broadcast_to(left, (self.folds.count, left.shape[-1]))
        squares = self.tests.squares_of_blocks(left)
        density = -0.5 * squares @ (1.0 / self.noise)
        every = np.empty((0, 0, 0)) if roots is None else roots
        for f, chain in product(range(len(every)), self.tests.chains):
            L = every[f, chain]
            L = L[:, L.any(0)]
            half = L.T @ self.products[f, chain]
            # No Cholesky factor: roots of a joint that never moves are long, and rounding of their
            # products leaves the sum indefinite.
            sizes, turn = np.linalg.eigh(half[:, chain] @ L)
            sizes = 1.0 + np.maximum(sizes, 0.0)
            towards = turn.T @ (half @ left[f])
            density[f] += 0.5 * (towards**2 / sizes - np.log(sizes)).sum()
        ratio = self.folds.ratio if values.ndim > 1 else 0.0
        return Score(density, squares, self.information.variation, ratio)


def least_noise(information: Information) -> float:
    """Return σ² κ below which noise is rounding of the torque [torque²]."""
    return 1e-18 * float(information.torque.max(initial=0.0)) + 1e-300


@frozen
class Gain:
    """A gain with its standard error.

    Attributes
    ----------
    value, se : float
    """

    value: float
    se: float

    def limits(self, folds: int) -> tuple[float, float]:
        """Return the limits of Student's t at the confidence of `LEVELS`, for a number of folds."""
        if folds < 2:
            return -np.inf, np.inf
        tail = 0.5 * (1.0 - LEVELS.confidence)
        reach = float(-stdtrit(folds - 1, tail)) * self.se
        return self.value - reach, self.value + reach


@frozen
class Evidence:
    """Predictive evidence for account A against account B.

    Attributes
    ----------
    density : Gain [nats]
        Of the predictive log density.
    error : Gain
        ``ln(e_B / e_A)`` of the error over each joint's own scale: .1 is about 10 % less error.
    folds : int
        That it rests on.
    """

    density: Gain
    error: Gain
    folds: int

    @staticmethod
    def of(a: Score, b: Score) -> Evidence:
        """Return the evidence of two scores of the same folds."""
        error = _error_gain(a.shares, b.shares, max(a.ratio, b.ratio))
        return Evidence(a.gain(b), error, len(a.squares))

    @property
    def limits(self) -> tuple[float, float]:
        """Of the gain of the error over all joints."""
        return self.error.limits(self.folds)

    @property
    def replaceable(self) -> bool:
        """Whether A can replace B: its error surely rises by next to nothing."""
        return bool(self.limits[0] > -np.log1p(LEVELS.rise))


def _sum_gain(each: Array, ratio: float) -> Gain:
    """Return the sum of gains of K folds, (K,), with its standard error."""
    K = len(each)
    apart = each - each.mean()  # np.var of a few numbers takes four times as long
    # A fold that a model cannot predict at all overflows: then the gain is unknown.
    with np.errstate(over="ignore"):
        spread = float(apart @ apart) / (K - 1) if K > 1 else np.inf
    sd = np.sqrt(spread * (1.0 / K + ratio))
    return Gain(float(each.sum()), float(K * sd))


def _error_gain(a: Array, b: Array, ratio: float) -> Gain:
    """Return ``½ ln(Σb / Σa)`` of squares of K folds, (K,), with its standard error.

    Below a share of the torque's squares both are rounding.
    """
    sums = np.maximum([a.sum(), b.sum()], ROUNDOFF**2)
    if (sums == ROUNDOFF**2).all():
        return Gain(0.0, 0.0)
    each = 0.5 * (b / sums[1] - a / sums[0])  # effect of each fold on the logarithm
    ratio_of_sums = sums[1] / sums[0]
    return Gain(0.5 * float(np.log(ratio_of_sums)), _sum_gain(each, ratio).se)


def near_best(scores: Sequence[Score]) -> np.ndarray:
    """Return which of M models are as good as the best of them, (M,) bool.

    All are, where fewer rows than parameters leave none with a density.
    """
    densities = [s.density.sum() for s in scores]
    if not np.isfinite(densities).any():
        return np.ones(len(scores), bool)
    best = scores[int(np.argmax(densities))]
    return np.array([may_stand(score, best) for score in scores])


def may_stand(score: Score, best: Score) -> bool:
    """Return whether a model is as good as the best one.

    Its predictive log density is within some nats; or its error surely rises by next to nothing:
    with many samples, nats distinguish models whose errors are equal.
    """
    near = score.density.sum() >= best.density.sum() - LEVELS.nats
    return bool(near) or Evidence.of(score, best).replaceable
