"""`Fit`: the values of a model's parameters, and each term of their uncertainty.

Noise is measured by the scatter of scores over stretches of time. Refits on resampled blocks are
reported as a second estimate; scatter between logs, and omitted effects, are separate terms. All
from `Information` alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

import numpy as np
from scipy.special import fdtrc, ndtr, ndtri, stdtrit

from identifiability.foundation.findings import phrase
from identifiability.foundation.linalg import ROUNDOFF, TINY, sandwich, unit_coordinates
from identifiability.foundation.names import GROUPED_KINDS, Array, Strings
from identifiability.foundation.rounding import ENDS, REACH
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.regression.reduction import Submodel
from identifiability.regression.structure import Structure

from .estimator import Estimate
from .groups import LabelAlternatives
from .rules import RULES, Thresholds

# Refits on resampled blocks of time, from `Information` alone.
#
# Residuals of robots are autocorrelated; drawing whole blocks of consecutive samples, regressor
# and torque together, keeps the correlation inside a block and makes no model of it [Künsch 1989].
# A replicate is a weighted sum of the blocks' Gram matrices, so its cost does not know the number
# of samples.


def spread_of(values: Array) -> Array:
    """Return the standard deviation of refits (replicates, k): half of the central 68 %, (k,).

    Where blocks are few, some replicates hold too few different ones to be solved well.
    """
    low, high = np.quantile(values, ndtr([-1.0, 1.0]), axis=0)
    return 0.5 * (high - low)


def merge_blocks(information: Information, length: float) -> Information:
    """Return the information with blocks of at least `length` samples, none across logs.

    Parameters
    ----------
    information : Information
    length : float
        Samples; blocks shorter than that are added to the next ones of their log.
    """
    starts = []
    for log in np.unique(information.log):
        rows = np.flatnonzero(information.log == log)
        ends = np.cumsum(information.counts[rows])
        wanted = max(1, int(ends[-1] // max(length, 1.0)))
        # An even division, so that no short block is left at the end.
        piece = (ends - information.counts[rows]) * wanted // ends[-1]
        starts.append(rows[np.unique(piece, return_index=True)[1]])
    return information.merge(np.concatenate(starts))


def merge_stretches(information: Information, time: float) -> Information:
    """Return the information in stretches of several memories, with enough stretches for a scatter.

    Parameters
    ----------
    information : Information
    time : float [samples]
        Autocorrelation time of the residual.
    """
    logs = len(np.unique(information.log))
    fewest = RULES.stretches_fewest
    # Each log but one may cut a stretch short.
    enough = information.samples / (fewest + logs - 0.5)
    return merge_blocks(information, min(RULES.memories * time, enough))


def bootstrap(
    information: Information,
    estimate: Estimate,
    rng: np.random.Generator,
    replicates: int,
) -> Array:
    """Return values of refits on resampled blocks, (replicates, k); zero where none was fitted.

    Parameters
    ----------
    information : Information
        About the columns of `estimate`.
    estimate : Estimate
        Its estimator refits the columns that it kept.
    rng : numpy.random.Generator
    replicates : int
    """
    blocks = len(information.counts)
    counts = rng.multinomial(blocks, np.full(blocks, 1.0 / blocks), size=replicates)
    values = estimate.estimator.refit(information, estimate, counts.astype(float))
    return values[np.isfinite(values).all(1)]


# Standard deviations from the scatter of scores over stretches of time, column by column.
#
# Residuals remember, but not every parameter suffers alike: the memory of the *score* of a column
# (column times residual) counts. Sums of scores over stretches longer than that are independent,
# and the scatter of their effects on the values is the variance of the estimate [Liang & Zeger
# 1986]. The estimator computes these effects.
#
# How many independent outputs such a standard deviation rests on differs from parameter to
# parameter: a few stretches may determine one almost alone, and the residual lacks the noise that a
# fit absorbs there. These are the degrees of freedom of its Student's t [Bell & McCaffrey 2002], so
# intervals grow smoothly where logs get too short for a model, direction by direction.


@frozen
class ScoreScatter:
    """Standard deviations of an estimate from the scatter of its scores.

    Attributes
    ----------
    sd : (k,)
        Infinite where the estimate is not determined.
    freedom : (k,)
        Degrees of freedom of each: independent outputs that its scatter was seen in.
    """

    sd: Array
    freedom: Array

    @property
    def widened(self) -> Array:
        """Standard deviations with which a normal interval has the width of Student's t, (k,)."""
        return self.sd * stdtrit(self.freedom, ENDS[1]) / ndtri(ENDS[1])


def scatter_scores(information: Information, fit: Estimate, time: float) -> ScoreScatter | None:
    """Return the standard deviations of a fit by the scatter of its scores; None without blocks.

    Parameters
    ----------
    information : Information
        About the fitted columns.
    fit : Estimate
    time : float [samples]
        Autocorrelation time of the residual.
    """
    merged = merge_stretches(information, time)
    if not fit.kept or len(merged.counts) < RULES.stretches_fewest:
        return None
    sd = np.linalg.norm(fit.estimator.influence(merged, fit), axis=0)
    sd = np.maximum(sd, rounding_error(information, fit))
    return ScoreScatter(np.where(fit.determined, sd, np.inf), count_freedom(merged, fit))


def rounding_error(information: Information, fit: Estimate) -> Array:
    """Return the largest change of each value by torque that rounding alone makes, (k,).

    Rounding is neither white nor independent from stretch to stretch, so that scores need not
    show it.

    Parameters
    ----------
    information : Information
        About the fitted columns.
    fit : Estimate
    """
    kept = list(fit.kept)
    size = len(fit.kept)
    R = information.select(fit.kept).factor(fit.weights)
    torque = TINY * np.linalg.norm(R[:, size])
    change = np.zeros(information.size)
    change[kept] = torque * np.linalg.norm(unit_coordinates(R[:size, :size]), axis=1)
    return change


def count_freedom(information: Information, fit: Estimate) -> Array:
    """Return the degrees of freedom of each parameter's scatter over blocks, (k,).

    Each block moves the value by some amount. The mean and the variance of the sum of squares of
    these amounts, for white residuals, give the degrees of freedom [Bell & McCaffrey 2002;
    Satterthwaite 1946]. They are one at least.

    Parameters
    ----------
    information : Information
        About the fitted columns, in blocks that are independent.
    fit : Estimate
    """
    freedom = np.ones(information.size)
    part = information.select(fit.kept)
    for chain in part.chains:
        own = part.select(chain.tolist())
        kept = np.array(fit.kept)[chain]
        freedom[kept] = _count_freedom(own, fit.weights)
    return freedom


def _count_freedom(part: Information, weights: Array) -> Array:
    """Return the degrees of freedom of independent columns of one chain, (k,)."""
    k = part.size
    to_x = unit_coordinates(part.factor(weights)[:k, :k])
    change = np.vstack([to_x, np.zeros((1, k))])
    # Block a scatters with b as ``t' (δ_ab A_a - A_a A_b) t`` in the direction t of a parameter.
    Q = part.products(weights, change, change) @ to_x.T
    own = np.einsum("ip,bip->bp", to_x.T, Q)
    taken = (Q * Q).sum(1)
    few = "aip,bip->pab" if len(Q) < k else "aip,ajp->pij"
    both = (np.einsum(few, Q, Q, optimize=True) ** 2).sum((1, 2))
    mean = (own - taken).sum(0)
    variance = (own**2 - 2 * own * taken).sum(0) + both
    return np.maximum(mean**2 / np.maximum(variance, 1e-300), 1.0)


# Do several logs give the same values? Scatter between them enters every interval.
#
# Omitted effects are no noise during one motion: they shift the values equally in every stretch of
# a log, and differently in the next log. So the values of each log by itself are compared, a
# parameter at a time [Bonferroni]. Two or three logs say next to nothing about one parameter's
# excess, so it is one ratio of variance for each kind of parameter (bodies, each friction, offsets
# …): model errors, like noise, affect the least excited parameters most.


#: Blocks that are independent are no shorter than so many autocorrelation times.
LEAST_MEMORIES: Tolerance = 2.0


@frozen
class Motions:
    """Agreement of L logs about k parameters.

    Attributes
    ----------
    which : (L,) int
        Number of each log: those that are too short to be fitted are left out.
    values, sd : (L, k)
        Of each log by itself, with standard deviations; infinite where it does not determine a
        parameter.
    p : (k,)
        Of no difference between logs, adjusted for their number; 1 where fewer than two determine
        a parameter.
    between : (k,)
        What the value of another log scatters by, with which a normal interval has the width of
        Student's t; zero where logs do not differ.
    """

    which: np.ndarray
    values: Array
    sd: Array
    p: Array
    between: Array

    @property
    def moved(self) -> np.ndarray:
        """Parameters whose values differ for sure, (k,) bool."""
        return self.p < Thresholds.sign_level


def compare_motions(information: Information, fit: Estimate, time: float) -> Motions | None:
    """Return the agreement of logs about each parameter; None where fewer than two can be fitted.

    Parameters
    ----------
    information : Information
        About the fitted columns.
    fit : Estimate
        To all of them.
    time : float [samples]
        Autocorrelation time of the residual.
    """
    logs = np.unique(information.log)
    found = []
    if len(logs) < 2 or fit.rss.sum() <= ROUNDOFF**2 * information.torque.sum():
        return None
    for log in logs:
        part = information.take(information.log == log)
        dof = float(np.sum(part.rows_each / fit.times)) - len(fit.kept)
        if dof < RULES.stretches_fewest:  # it determines nothing, and its values would be rounding
            continue
        alone = fit.estimator.fit(part)
        found.append((int(log), alone.value, alone.sigma * np.sqrt(time), dof))
    if len(found) < 2:
        return None
    which, values, sd, each = (np.array(x) for x in zip(*found, strict=True))
    sd = np.where(fit.determined & (sd > 0), sd, np.inf)
    own, p, free = _differ(values, sd, each)
    p = np.minimum(len(p) * p, 1.0)
    # One ratio of variance, where logs surely differ, for each kind of parameter.
    kinds = np.array([name.rsplit(".", 1)[-1] for name in fit.columns])
    kinds = np.where(np.isin(kinds, GROUPED_KINDS), "bodies", kinds)
    moved = p < Thresholds.sign_level
    ratio = np.ones(len(p))
    few = np.maximum(free, 1)
    for kind in np.unique(kinds[moved]):
        at = (kinds == kind) & (free > 0)
        typical = own[at].mean()
        at_least = np.where(moved[at], own[at], 1.0)
        ratio[at] = np.maximum(typical, at_least)
        few[at] = free[at].sum()
    wide = stdtrit(few, ENDS[1]) / REACH
    judged = np.isfinite(sd).sum(0)
    precision = (sd**-2.0).sum(0)
    sampling = judged / np.maximum(precision, 1e-300)
    excess = np.where(free > 0, sampling, 0.0) * np.maximum(ratio - 1.0, 0.0)
    return Motions(which, values, sd, p, wide * np.sqrt(excess))


def _differ(values: Array, sd: Array, dof: Array) -> tuple[Array, Array, Array]:
    """Return F of the values of logs, its p-value, and logs less one, of each parameter, (k,).

    Parameters
    ----------
    values, sd : (L, k)
    dof : (L,)
        Of the standard deviations.
    """
    weight = sd**-2.0
    free = np.maximum(np.isfinite(sd).sum(0) - 1, 0)
    mean = (weight * values).sum(0) / np.maximum(weight.sum(0), 1e-300)
    ratio = (weight * (values - mean) ** 2).sum(0) / np.maximum(free, 1)
    exceeded = fdtrc(np.maximum(free, 1), dof.sum(), ratio)
    return ratio, np.where(free > 0, exceeded, 1.0), free


# Effective combinations of a reduced model's values, and their distance from the labels.
#
# A parameter that is left out although it is not zero does not vanish: the survivors take it over.
# With base parameters β, a model ``β = held + M x`` and its fit ``x = P (β - held)`` of torque
# without noise, P is the pseudo-inverse of M in the distance that the fit minimises, or of its
# instruments. A label means ``M⁺ (β - held)`` instead; the difference ``D (β - held)``,
# ``D = P - M⁺``, is no noise, so no interval of the residual holds it. Its possible size follows
# from two sources. The robot file states masses and places of bodies to ± `body_share`. The logs
# have information on omitted parameters: the residual has the part of their torque that no kept
# parameter absorbs. Both together are a normal posterior. Friction and rotors are taken to be as
# the file says; torque offsets, which no file states, may be as large as the unpruned model says.
#
# A file can be further from the robot than that, and a model may omit effects that no file states.
# The unpruned model shows it: where its own interval for a label does not reach that of the model,
# σ grows until it does, and the verdict says so.


_M = GROUPED_KINDS.index("m")
_DIAGONAL = tuple(GROUPED_KINDS.index(k) for k in ("Ixx", "Iyy", "Izz"))


@frozen
class LeftOut:
    """Effect of the omitted parameters on the k parameters of a model.

    Attributes
    ----------
    sigma : (k,) [unit of each parameter]
        Root mean square of value less label over the robots that file and logs make likely, without
        noise. Zero where nothing is left out or known.
    projected : (k,)
        Values that the fit would find on the robot of the file.
    stands_for : tuple of str
        Each value as the combination that it is, such as ``slider1.Jr + 0.02·platform.m``; empty
        where it is its label.
    unknown : bool
        Whether the model omits a parameter without a value in the robot file.
    disputed : (k,)
        What the unpruned model finds for the label, where that contradicts what file and logs make
        likely; NaN elsewhere.
    """

    sigma: Array
    projected: Array
    stands_for: Strings
    unknown: bool
    disputed: Array


def body_scatter(structure: Structure) -> Array:
    """Return the possible distance of the bodies' parameters from the file's, (p,) [their units].

    Zero for columns that belong to no body, and for bodies without a mass in the file.
    """
    scatter = np.zeros(len(structure.columns))
    rows = structure.inertial
    theta = structure.nominal[rows]
    mass = np.maximum(theta[:, _M], 0.0)
    # tr I = 2 ∫ r² dm about the origin of the body's frame.
    second = np.maximum(0.5 * theta[:, _DIAGONAL].sum(1), 0.0)
    first = np.sqrt(mass * second)
    moments = (*[second] * 6, *[first] * 3, mass)  # in the order of GROUPED_KINDS
    for column, moment in zip(rows.T, moments, strict=True):
        scatter[column] = RULES.body_share * moment
    return scatter


def _offset_scatter(structure: Structure, submodel: Submodel, full: Estimate) -> Array:
    """Return the possible sizes of omitted torque offsets, which no file states, (p,).

    Each has a normal prior about zero, and its variance makes the fitted value likeliest. It is
    zero for an offset within its standard error.
    """
    variance = np.diag(full.covariance) * float(np.max(full.times))
    squares = np.maximum((full.value - submodel.fixed) ** 2 - variance, 0.0)
    squares = np.where(full.determined & ~submodel.M.any(1), squares, 0.0)
    size = dict(zip(structure.base.names, np.sqrt(squares).tolist(), strict=True))
    return np.array([size.get(n, 0.0) * n.endswith(".off") for n in structure.columns])


def find_left_out(
    structure: Structure,
    submodel: Submodel,
    information: Information,
    fit: Estimate,
    full: Estimate | None = None,
) -> LeftOut:
    """Return the effect of the omitted parameters on those that a model keeps.

    Parameters
    ----------
    structure : Structure
    submodel : Submodel
    information : Information
        About all b base parameters.
    fit : Estimate
        Of the model.
    full : Estimate, optional
        Of all base parameters, with the information of the logs on the omitted ones; by default
        only the file does.
    """
    kept = list(fit.kept)
    P = fit.estimator.project(information, fit, submodel.M[:, kept])
    difference = P - submodel.inverse[kept]
    difference[np.abs(difference) < ROUNDOFF * np.abs(P).max(1, initial=0.0, keepdims=True)] = 0.0
    stated = structure.nominal_base - submodel.fixed
    scatter = body_scatter(structure)
    if full is not None:
        scatter = np.hypot(scatter, _offset_scatter(structure, submodel, full))
    shift = difference @ stated
    spread = (difference @ structure.G) * scatter
    if full is not None:
        loss = full.estimator.loss(information, full)
        R = loss[:-1, :-1]
        columns = R @ structure.G * scatter
        span = np.linalg.qr(R @ submodel.M[:, kept])[0]
        left = np.column_stack([columns, loss[:-1, -1] - R @ structure.nominal_base])
        left -= span @ (span.T @ left)
        density = float(np.max(full.weights * full.variance * full.times))
        mean, root = _learn(left / np.sqrt(density))
        shift = shift + spread @ mean
        spread = spread @ root
    sigma = np.zeros(len(submodel))
    projected = np.full(len(submodel), np.nan)
    disputed = projected.copy()
    sigma[kept] = np.hypot(shift, np.linalg.norm(spread, axis=1))
    projected[kept] = P @ stated
    if full is not None:
        sigma[kept], disputed[kept] = _widen_disputed(
            P - difference, submodel, fit, full, sigma[kept]
        )
    texts = [""] * len(submodel)
    names = structure.base.names
    size = np.linalg.norm(structure.G * scatter, axis=1)
    for row, column in enumerate(kept):
        texts[column] = _combination(submodel.columns[column], names, difference[row], size)
    lost = (difference @ structure.G[:, structure.inertial.ravel()]).any()
    unknown = bool(lost and not scatter.any())
    return LeftOut(sigma, projected, tuple(texts), unknown, disputed)


def _widen_disputed(
    meant: Array, submodel: Submodel, fit: Estimate, full: Estimate, sigma: Array
) -> tuple[Array, Array]:
    """Return σ that covers the intervals of the unpruned model, (k,), and its values.

    The values are NaN where σ was large enough.

    Parameters
    ----------
    meant : (k, b)
        Labels of the k parameters that `fit` determines, by base parameters.
    submodel : Submodel
    fit, full : Estimate
        Of the model, and of all base parameters.
    sigma : (k,)
        By file and logs.
    """
    kept = list(fit.kept)
    largest = np.abs(meant).max(1, keepdims=True)
    meant = np.where(np.abs(meant) < ROUNDOFF * largest, 0.0, meant)
    known = ~(meant[:, ~full.determined] != 0).any(1)
    value = meant @ (np.where(full.determined, full.value, 0.0) - submodel.fixed)
    at = list(full.kept)
    block = full.covariance[np.ix_(at, at)]
    own = np.einsum("ka,ab,kb->k", meant[:, at], block, meant[:, at])
    reach = REACH * np.sqrt(np.maximum(own, 0.0) * float(np.max(full.times)))
    apart = np.abs(fit.value[kept] - value)
    grown = known & (apart - reach > REACH * np.hypot(sigma, fit.sigma[kept]))
    return np.where(grown, (apart + reach) / REACH, sigma), np.where(grown, value, np.nan)


def _learn(left: Array) -> tuple[Array, Array]:
    """Return mean (p,) and root (p, p) of the covariance of p parameters, by file and logs.

    Parameters
    ----------
    left : (r, p + 1)
        What no kept parameter can take over, over the noise: of each parameter's column, in units
        of the standard deviation that the file leaves it, and of the torque less what the file's
        robot needs.
    """
    A = left[:, :-1]
    _, s, Vt = np.linalg.svd(A)
    narrower = np.ones(len(Vt))
    narrower[: len(s)] = 1.0 / np.hypot(1.0, s)
    root = Vt.T * narrower
    return root @ (root.T @ (A.T @ left[:, -1])), root


def _combination(name: str, members: Sequence[str], coefficients: Array, size: Array) -> str:
    """Return a parameter with the omitted ones in its effective combination, the largest first."""
    share = np.abs(coefficients) * size
    least = Thresholds.negligible_share * np.linalg.norm(share)
    # Most members of an effective combination that a sentence lists.
    shown = [j for j in np.argsort(-share, kind="stable")[:3] if share[j] > least]
    signs = ["−" if coefficients[j] < 0 else "+" for j in shown]
    parts = [f"{abs(coefficients[j]):.2g}·{members[j]}" for j in shown]
    told = " ".join([name, *(f"{sign} {x}" for sign, x in zip(signs, parts, strict=True))])
    if not shown:
        return ""
    if np.count_nonzero(share) > len(shown):
        return f"{told} + …"
    return told


# `Fit`: the terms of uncertainty.


@frozen(kw_only=True)
class Fit:
    """A model that was fitted: its k values, and each term of their uncertainty.

    Attributes
    ----------
    estimate : Estimate
    column_rms : (k,)
        Root mean square of each column of the regressor: torque per unit of the parameter.
    column_noise : (k,)
        The largest over joints of the column's rms in units of the joint's own residual.
    scores : ScoreScatter or None
        Scatter of each column's scores over stretches of time; None if there are too few.
    bootstrap : (k,) or None
        Standard deviations over refits on resampled blocks, beside it; None where none were asked
        for or blocks are few.
    note : str
        Why blocks are too few, if they are.
    motions : Motions or None
        Agreement of the logs; None of one log, or of too short ones.
    shared : mapping of str to (w, k)
        Errors that move all samples alike, so that no residual can show them. ``delay``: one
        standard deviation of the delay of each log's commands. ``bias``: of the bias that noise in
        the motion leaves. ``prior``: distance of the nearest physically consistent values, where
        the estimate does not surely predict better. If the data cannot decide between the two,
        labels hold for both.
    left_out : LeftOut or None
        Effect of the omitted parameters on those of the model.
    alternatives : LabelAlternatives or None
        What groups that may be missing do to them.
    excluded : tuple of (str, ...)
        Joints of which each parameter is sure only without a torque offset; empty if not computed.
    """

    estimate: Estimate
    column_rms: Array
    column_noise: Array
    scores: ScoreScatter | None
    bootstrap: Array | None = None
    note: str = ""
    motions: Motions | None = None
    shared: Mapping[str, Array] = field(default_factory=dict)
    left_out: LeftOut | None = None
    alternatives: LabelAlternatives | None = None
    excluded: tuple[Strings, ...] = ()

    @staticmethod
    def of(
        information: Information, fit: Estimate, rng: np.random.Generator, replicates: int
    ) -> Fit:
        """Return an estimate with the uncertainty from noise and from differences between logs.

        Parameters
        ----------
        information : Information
            About the fitted columns.
        fit : Estimate
        rng : numpy.random.Generator
        replicates : int
            Of the bootstrap; 0 for none.
        """
        stretches = merge_stretches(information, fit.memory)
        note = ""
        drawn = None
        apart = information.samples / max(LEAST_MEMORIES * fit.memory, 1.0)
        blocks = min(int(apart), len(stretches.counts))
        if fit.kept and blocks < RULES.blocks_fewest:
            told = {"memory": fit.memory, "samples": information.samples, "blocks": blocks}
            note = phrase("verdict", "blocks", least=RULES.blocks_fewest, **told)
        elif replicates and fit.kept:
            drawn = spread_of(bootstrap(stretches, fit, rng, replicates))
        scores = scatter_scores(information, fit, fit.memory)
        motions = compare_motions(information, fit, fit.memory)
        shared = {} if fit.bias is None else {"bias": fit.bias}
        return Fit(
            estimate=fit,
            column_rms=column_rms(information),
            column_noise=column_noise(information, fit),
            scores=scores,
            bootstrap=drawn,
            note=note,
            motions=motions,
            shared=shared,
        )

    @property
    def noise(self) -> Array:
        """Standard deviations by the scatter of scores, which allows for autocorrelation, (k,).

        Infinite where there are too few scores: a formula is believed only as far as its model of
        the noise, and few samples do not show that.
        """
        wide = np.inf if self.scores is None else self.scores.widened
        return np.where(np.isfinite(self.estimate.sigma), wide, np.inf)

    @property
    def terms(self) -> dict[str, Array]:
        """Standard deviations of the labels by source, (k,) each."""
        none = np.zeros(len(self.estimate.columns))
        found = dict.fromkeys(TERMS, none) | {"noise": self.noise}
        if self.motions is not None:
            found["logs"] = self.motions.between
        for name, rows in self.shared.items():
            found[name] = np.hypot(found[name], np.linalg.norm(rows, axis=0))
        if self.left_out is not None:
            found["omitted"] = self.left_out.sigma
        if self.alternatives is not None:
            found["alternatives"] = self.alternatives.sigma
        return found

    @property
    def together(self) -> Array:
        """Joint deviations that move all samples alike, and that no residual can show, (w, k)."""
        none = np.empty((0, len(self.estimate.columns)))
        return np.vstack([none, *self.shared.values()])

    @property
    def robust(self) -> Array:
        """Standard deviations of the values, for their effective combinations, (k,)."""
        terms = self.terms
        return np.linalg.norm([terms[name] for name in OF_VALUES], axis=0)

    @property
    def value(self) -> Array:
        """Values of the labels: corrected for missing functions, and for a known bias, (k,)."""
        value = self.estimate.value
        if self.estimate.bias is None and "bias" in self.shared:
            value = value - self.shared["bias"][0]
        if self.alternatives is None:
            return value
        return value - self.alternatives.shift

    @property
    def used(self) -> Array:
        """Values of the model as it is: physically consistent where they predict as well, (k,)."""
        prior = self.shared.get("prior")
        return self.estimate.value if prior is None else self.estimate.value + prior[0]

    @property
    def sigma(self) -> Array:
        """Standard deviations of the labelled parameters, (k,)."""
        return np.linalg.norm(list(self.terms.values()), axis=0)

    def why_unjudged(self, rules: Thresholds) -> Strings:
        """Return why a parameter cannot be judged, or "" where it can, (k,).

        Parameters
        ----------
        rules : Thresholds
        """
        if self.note or self.scores is None:
            return (self.note or phrase("verdict", "few"),) * len(self.estimate.columns)
        least = rules.outputs_per_parameter
        return tuple(
            "" if freedom >= least else phrase("verdict", "outputs", freedom=freedom, least=least)
            for freedom in self.scores.freedom
        )


#: Terms of the interval of a label, and those that are the value's own.
TERMS = ("noise", "logs", "alternatives", "omitted", "delay", "bias", "shape", "prior")
OF_VALUES = ("noise", "logs", "delay", "bias", "shape", "prior")


def remembering_covariance(information: Information, fit: Estimate) -> Array:
    """Return the covariance of the kept columns under autocorrelated noise, (kept, kept).

    Parameters
    ----------
    information : Information
        About the fitted columns.
    fit : Estimate
    """
    k = len(fit.kept)
    part = information.select(fit.kept)
    noise = fit.weights**2 * fit.variance * fit.times
    factor = part.factor(fit.weights)
    noise_factor = part.factor(noise)[:, :k]
    return sandwich(factor[:k, :k], noise_factor)


def column_rms(information: Information) -> Array:
    """Return the root mean square of each column over all rows, (k,)."""
    length = np.linalg.norm(information.factor()[:, :-1], axis=0)
    return length / np.sqrt(max(information.rows, 1))


def column_noise(information: Information, fit: Estimate) -> Array:
    """Return the largest over joints of column rms over residual rms, per unit, (k,)."""
    squares = information.squares(np.eye(information.size + 1)[:, :-1])
    floor = 1e-18 * float(np.max(fit.rss, initial=0.0)) + 1e-300
    variance = np.maximum(fit.rss, floor)[:, None]
    return np.sqrt(squares / variance).max(0)
