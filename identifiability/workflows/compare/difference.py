"""`Difference`: by how much the values of a model differ, and all that is not known of it.

Three roads. *Results*: their values, and the sum of their covariances. *Logs*: the same model
fitted to each side, with the scatter of scores over time, and of each side's motions.
*Pairs*: where both sides made the same motion, one regression of the difference of the torques,

    τ₂ − τ₁ − (W₂ − W₁) x₁ = W₂ (x₂ − x₁) + noise,

in which nothing is left of what the model gets wrong along that motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import add
from typing import Literal

import numpy as np

from identifiability.estimation.bootstrap import merge_blocks
from identifiability.estimation.estimate import estimate, forget_noise
from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.estimation.motions import MOST_STRETCHES, compare_motions
from identifiability.estimation.scores import MEMORIES, scatter_scores
from identifiability.estimation.uncertainty import remembering_covariance
from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.gather import BLOCKS
from identifiability.regression.information import Information
from identifiability.regression.reduction import Rung
from identifiability.regression.structure import Structure
from identifiability.workflows.pairs import Pair
from identifiability.workflows.predict import Fit


@frozen(kw_only=True)
class Difference:
    """Values of k parameters before and after.

    Attributes
    ----------
    kind : {"pairs", "logs", "results"}
        What it was found from.
    kept : (k,) int
        Which of the rung's columns they are.
    onto : (k, m)
        What a change of all m columns of the rung does to these.
    before, change : (k,)
    known : (k, k)
        Covariance of `before`.
    covariance : (k, k)
        Of `change`.
    moves : (B, k)
        By how much independent stretches of time move it; none of results.
    dof : float
        Degrees of freedom with which that is known.
    """

    kind: Literal["pairs", "logs", "results"]
    kept: np.ndarray
    onto: Array
    before: Array
    change: Array
    known: Array
    covariance: Array
    moves: Array
    dof: float

    @staticmethod
    def of_fits(one: Fit, other: Fit) -> Difference:
        """Return the difference of two results of one model."""
        size = np.minimum(np.diag(one.covariance), np.diag(other.covariance))
        kept = np.flatnonzero(size > 0)
        dropped = np.setdiff1d(np.arange(len(size)), kept)
        onto = np.zeros((len(kept), len(size)))
        onto[:, kept] = np.eye(len(kept))
        if len(dropped):
            unknown = np.hstack([one.spread.unknown, other.spread.unknown])
            lean = unknown[kept] @ np.linalg.pinv(unknown[dropped])
            onto[:, dropped] = -lean
        at = np.ix_(kept, kept)
        return Difference(
            kind="results",
            kept=kept,
            onto=onto,
            before=one.values[kept],
            change=(other.values - one.values)[kept],
            known=one.covariance[at],
            covariance=one.covariance[at] + other.covariance[at],
            moves=np.zeros((0, len(kept))),
            dof=float(min(one.spread.dof.sum(), other.spread.dof.sum())),
        )

    @staticmethod
    def of_logs(information: Information, after: np.ndarray, estimator: Estimator) -> Difference:
        """Return the difference of two sides of some logs, each fitted by itself.

        Parameters
        ----------
        information : Information
            About the rung's columns along all logs.
        after : (B,) bool
            Blocks of the second side.
        estimator : Estimator

        Raises
        ------
        LogError
            If a side is too short to be fitted by itself.
        """
        fresh = forget_noise(estimator)
        sides = [information.take(side) for side in (~after, after)]
        fits = [fresh.fit(side) for side in sides]
        kept = sorted(set(fits[0].kept) & set(fits[1].kept))
        parts = [side.select(kept) for side in sides]
        one, other = (_Side.of(part, fresh.fit(part)) for part in parts)
        return Difference(
            kind="logs",
            kept=np.array(kept, int),
            onto=_onto(information, kept, fits[0]),
            before=one.fit.value,
            change=other.fit.value - one.fit.value,
            known=one.covariance,
            covariance=one.covariance + other.covariance,
            moves=np.vstack([one.moves, other.moves]),
            dof=min(one.dof, other.dof),
        )

    @staticmethod
    def of_pairs(
        structure: Structure, rung: Rung, pairs: Sequence[Pair], before: Information
    ) -> Difference:
        """Return the difference of logs that made the same motions.

        Parameters
        ----------
        structure : Structure
        rung : Rung
        pairs : sequence of Pair
        before : Information
            About the rung's columns along the logs before.

        Raises
        ------
        LogError
            If they are too short.
        """
        own = estimate(before)
        base = rung.expand(own.value)
        whole = reduce(add, (_differences(structure, rung, pair, base) for pair in pairs))
        kept = list(estimate(whole).kept)
        part = whole.select(kept)
        found = _Side.of(part, estimate(part))
        serves = [pair.at[1] for pair in pairs]
        shared = max((serves.count(k) + 1) / 2 for k in serves)
        side = before.select(kept)
        return Difference(
            kind="pairs",
            kept=np.array(kept, int),
            onto=_onto(whole, kept, found.fit),
            before=own.value[kept],
            change=found.fit.value,
            known=remembering_covariance(side, estimate(side)),
            covariance=shared * found.covariance,
            moves=np.sqrt(shared) * found.moves,
            dof=found.dof,
        )


def _differences(structure: Structure, rung: Rung, pair: Pair, base: Array) -> Information:
    """Return the information of what the torques of a pair differ by."""
    W, tau, other, later, both = pair.rows(structure)
    torque = later - tau - (other - W) @ base
    size = -(-len(tau) // BLOCKS)
    log = np.zeros(len(tau), int)
    return Information.of_rows(rung.columns, other @ rung.M, torque, log, size, moves=both)


@frozen(kw_only=True)
class _Side:
    """A fit of k values, their covariance, and how B stretches of time move them, (B, k)."""

    fit: Estimate
    covariance: Array
    moves: Array
    dof: float

    @staticmethod
    def of(part: Information, fit: Estimate) -> _Side:
        """Return a fit with what is known of it.

        Where scores scatter more than the formula says, all of it is larger by one factor: what few
        values do not know of each other, a combination may know well. Several logs add what
        scatters between them where they disagree.

        Raises
        ------
        LogError
        """
        time = max(fit.memory, part.samples / MEMORIES / MOST_STRETCHES)
        scores = scatter_scores(part, fit, time)
        if scores is None or len(fit.kept) < part.size:
            raise LogError(
                f"{part.samples} samples are too few to compare {part.size} values; give longer or "
                "more logs, or a smaller model (--ladder)."
            )
        formula = remembering_covariance(part, fit)
        sd = np.sqrt(np.diag(formula))
        covariance = formula * max(float(np.mean((scores.sd / sd) ** 2)), 1.0)
        merged = merge_blocks(part, part.samples / scores.stretches)
        moves = fit.estimator.influence(merged, fit)
        moves = moves * np.mean(scores.sd / np.sqrt((moves**2).sum(0)))  # short stretches
        motions = compare_motions(part, fit, fit.memory)
        if motions is not None:
            covariance = covariance + np.diag(motions.between**2)
        return _Side(fit=fit, covariance=covariance, moves=moves, dof=scores.stretches - 1.0)


def _onto(information: Information, kept: Sequence[int], fit: Estimate) -> Array:
    """Return what a change of every column does to those that are kept, (k, m)."""
    R = information.factor(fit.weights)[:, :-1]
    found: Array = np.linalg.lstsq(R[:, list(kept)], R, rcond=None)[0]
    return found
