"""Simulated experiments with known truth, fitted and judged, and what many of them come to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from identifiability.estimation.estimate import Method, find_estimator, fit_whole, settle_noise
from identifiability.estimation.estimator import forbidden_signs
from identifiability.estimation.fit import Fit, find_left_out
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.verdict import Class, judge
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import LEVEL, REACH, Share, clustered_share, each_share
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.regression.reduction import Submodel
from identifiability.regression.regression import Regression
from identifiability.regression.structure import Structure

# Simulated experiments with known truth, fitted and judged; and what many of them come to.
#
# Operating characteristics (coverage, false verdicts) are properties of a motion; they are
# measured on the motion itself, the user's own regressor, with planted parameters and noise that
# we made.


@frozen
class Outcome:
    """One simulated experiment, fitted and judged as `analyze` would: arrays over k parameters.

    Small on purpose: thousands of them come back from other processes.
    """

    value: Array
    white: Array
    robust: Array
    identifiable: np.ndarray
    paper: np.ndarray
    judged: bool = True


@frozen(kw_only=True)
class Experiment:
    """A motion, held in memory, and how its outcomes are judged under one model.

    Attributes
    ----------
    submodel : Submodel
        The model, of k parameters.
    names : tuple of str
        Of the b base parameters.
    W : (N, n, b)
        Their columns.
    tau : (N, n) [N·m or N]
        The measured torque.
    log : (N,) int
    moves : (N, n) bool
        Where torque is data: joints do not dwell; elsewhere columns and torque are zero.
    method, thresholds, replicates
        As in `analyze`.
    structure : Structure or None
        What is behind the columns: with it intervals know what the model leaves out.
    """

    submodel: Submodel
    names: tuple[str, ...]
    W: Array
    tau: Array
    log: np.ndarray
    moves: np.ndarray
    method: Method = "wls"
    thresholds: Thresholds = Thresholds()
    replicates: int = 200
    structure: Structure | None = None

    @staticmethod
    def of(regression: Regression, submodel: Submodel, **how: Any) -> Experiment:
        """Return the experiment of a regression under a model; the rest says how it is judged."""
        chunks = [c for part in regression.parts(whole=True) for c in part.chunks()]
        return Experiment(
            submodel=submodel,
            names=tuple(p.name for p in regression.parameters),
            W=base_columns(regression)[0],
            tau=np.concatenate([c.tau for c in chunks]),
            log=np.concatenate([np.full(len(c.tau), c.log) for c in chunks]),
            moves=np.concatenate([c.data for c in chunks]),
            **how,
        )

    def gather(self, tau: Array, W: Array, V: Array | None = None) -> Information:
        """Return the information about all base parameters in one outcome.

        Parameters
        ----------
        tau : (N, n) [N·m or N]
        W : (N, n, b)
            Columns along the motion as it was measured.
        V : (N, n, b), optional
            Their instruments.
        """
        block = max(1, -(-len(tau) // 256))
        return Information.of_rows(self.names, W, tau, self.log, block, V, self.moves)

    def judge(self, whole: Information, tau: Array, W: Array, rng: np.random.Generator) -> Outcome:
        """Fit and judge one outcome; the arguments are those of `gather`, and what it returned."""
        submodel, rules = self.submodel, self.thresholds
        information = submodel.reduce(whole)
        method = settle_noise(find_estimator(self.method), whole)
        fit = method.fit(information)
        left = tau - W @ submodel.fixed
        known = Fit.of(information, fit, rng, self.replicates)
        if self.structure is not None:
            full = fit_whole(method, whole)
            known = replace(
                known, left_out=find_left_out(self.structure, submodel, whole, fit, full)
            )
        forbidden = forbidden_signs(information, fit, submodel.nonnegative)
        torque, aliases = float(np.sqrt(np.mean(left**2))), ("",) * len(submodel)
        about = submodel.labels, submodel.units, torque, aliases, forbidden
        verdicts = judge(known, *about, rules=rules)
        ends = np.array([v.interval95 for v in verdicts]).reshape(-1, 2)
        return Outcome(
            value=fit.value,
            white=fit.sigma,
            robust=(ends[:, 1] - ends[:, 0]) / (2 * REACH),
            identifiable=np.array([v.verdict is Class.IDENTIFIABLE for v in verdicts]),
            paper=fit.paper_rule,
            judged=not all(known.why_unjudged(rules)),
        )


def base_columns(regression: Regression) -> tuple[Array, Array | None]:
    """Return the columns of a regression in memory, (N, n, b), and instruments if it has any."""
    wide = np.concatenate([c.wide for p in regression.parts(whole=True) for c in p.chunks()])
    if regression.instruments is None:
        return wide, None
    V, W = np.split(wide, 2, axis=2)
    return W, V


@frozen
class Cell:
    """What was counted in simulated repetitions.

    Attributes
    ----------
    names : tuple of str
        Of the k parameters.
    held : (T, k) bool
        Whether the 95 % interval of the label held the truth, in each of T trials.
    called : float
        Parameters called identifiable, a trial.
    wrong : Share
        Of these, off by more than half.
    not_judged : float
        Share of trials whose parameters are not judged, for want of outputs or blocks.
    """

    names: tuple[str, ...]
    held: np.ndarray
    called: float
    wrong: Share
    not_judged: float = 0.0

    @property
    def coverage(self) -> float:
        """Share of intervals that held the truth, over parameters and trials."""
        return float(self.held.mean())

    @property
    def coverage_se(self) -> float:
        """Its Monte-Carlo standard error, by trials."""
        return float(self.held.mean(1).std(ddof=1) / np.sqrt(len(self.held)))

    @cached_property
    def each(self) -> tuple[Share, ...]:
        """Coverage of every parameter; the intervals are all right together at 95 %."""
        return each_share(self.held)

    @property
    def worst(self) -> int:
        """The parameter whose intervals hold the truth least often."""
        return int(np.argmin([s.value for s in self.each]))

    @property
    def below(self) -> tuple[str, ...]:
        """Parameters whose coverage is below 95 % beyond Monte-Carlo error."""
        pairs = zip(self.names, self.each, strict=True)
        return tuple(name for name, share in pairs if share.high < LEVEL)

    def to_dict(self) -> dict[str, Any]:
        """Return the cell for JSON."""
        pairs = zip(self.names, self.each, strict=True)
        return {
            "trials": len(self.held),
            "coverage_robust": self.coverage,
            "coverage_se": self.coverage_se,
            "called": self.called,
            "wrong": self.wrong.value,
            "wrong_low": self.wrong.low,
            "wrong_high": self.wrong.high,
            "not_judged": self.not_judged,
            "each": [
                {"name": n, "coverage": s.value, "interval95": [s.low, s.high]} for n, s in pairs
            ],
            "below": list(self.below),
        }


def count_outcomes(trials: Sequence[Outcome], truth: Array, names: Sequence[str]) -> Cell:
    """Return how often intervals held the truth and verdicts were wrong.

    Parameters
    ----------
    trials : sequence of Outcome
    truth : (k,) or (T, k)
        What the labels meant, in all trials or in each.
    names : sequence of str
        Of the k parameters.
    """
    off = np.abs(np.array([t.value for t in trials]) - truth)
    held = off <= REACH * np.array([t.robust for t in trials])
    called = np.array([t.identifiable for t in trials])
    return Cell(
        names=tuple(names),
        held=held,
        called=float(called.sum(1).mean()),
        wrong=clustered_share(off > 0.5 * np.abs(truth), called, ~held),
        not_judged=float(np.mean([not t.judged for t in trials])),
    )
