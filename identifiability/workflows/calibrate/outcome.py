"""One simulated experiment with known truth, fitted and judged; and what many of them come to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from identifiability.estimation.estimate import Method, estimate
from identifiability.estimation.uncertainty import assess_uncertainty
from identifiability.estimation.verdict import Class, Thresholds
from identifiability.foundation.names import Array
from identifiability.foundation.shares import LEVEL, REACH, Share, clustered_share, each_share
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.regression.reduction import Rung
from identifiability.workflows.analyze.assessment import judge_rung
from identifiability.workflows.calibrate.replicates import Experiment

#: A parameter is wrong if it is off by more than this share of its true value.
WRONG = 0.5


@frozen
class Cell:
    """What was counted at one noise level and correlation.

    Attributes
    ----------
    noise : float
        Multiple of the residual's standard deviation.
    rho : float
        Correlation from sample to sample; NaN for the residual's own.
    trials : int
    coverage_white, coverage_robust : float
        Share of 95 % intervals that hold the truth, over parameters and trials.
    called, wrong : float
        Parameters called identifiable, a trial; share of them off by more than half.
    paper_called, paper_wrong : float
        The same for the 10× rule.
    coverage_se : float
        Monte-Carlo standard error of the robust coverage, by trials.
    coverage_white_se : float
        The same of the coverage of white-noise intervals.
    wrong_high, paper_wrong_high : float
        Upper ends of 95 % intervals of the shares that are off, by Monte-Carlo error.
    names : tuple of str
        Of the parameters.
    each : tuple of Share
        Coverage of every parameter's robust intervals, all right together at 95 %.
    not_judged : float
        Share of trials whose parameters are not judged, for want of outputs or blocks.
    """

    noise: float
    rho: float
    trials: int
    coverage_white: float
    coverage_robust: float
    coverage_se: float
    called: float
    wrong: float
    paper_called: float
    paper_wrong: float
    coverage_white_se: float = float("nan")
    wrong_high: float = float("nan")
    paper_wrong_high: float = float("nan")
    names: tuple[str, ...] = ()
    each: tuple[Share, ...] = ()
    not_judged: float = 0.0

    @property
    def worst(self) -> int:
        """The parameter whose intervals hold the truth least often."""
        return int(np.argmin([s.value for s in self.each]))

    @property
    def below(self) -> tuple[str, ...]:
        """Parameters whose coverage is below 95 % beyond Monte-Carlo error."""
        pairs = zip(self.names, self.each, strict=True)
        return tuple(name for name, share in pairs if share.high < LEVEL)

    def to_row(self) -> dict[str, Any]:
        """Return the numbers of the cell as one row of a table."""
        row = {k: v for k, v in vars(self).items() if k not in ("names", "each")}
        if self.each:
            row |= {"worst": self.names[self.worst], "worst_coverage": self.each[self.worst].value}
        return row

    def to_dict(self) -> dict[str, Any]:
        """Return the cell for JSON, with every parameter's coverage and its interval."""
        pairs = zip(self.names, self.each, strict=True)
        each = [{"name": n, "coverage": s.value, "interval95": [s.low, s.high]} for n, s in pairs]
        return self.to_row() | {"each": each, "below": list(self.below)}


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


def judge_outcome(
    rung: Rung,
    experiment: Experiment,
    information: Information,
    tau: Array,
    rng: np.random.Generator,
    *,
    method: Method = "wls",
    thresholds: Thresholds | None = None,
    replicates: int = 200,
) -> Outcome:
    """Fit and judge one outcome of an experiment.

    Parameters
    ----------
    rung : Rung
    experiment : Experiment
        Of the rung's columns.
    information : Information
        About them and the torque.
    tau : (N, n)
    rng : numpy.random.Generator
    method, thresholds, replicates
        As in `analyze`.
    """
    rules = thresholds or Thresholds()
    fit = estimate(information, method)
    residual = tau - experiment.W @ fit.value
    spread = assess_uncertainty(information, fit, residual, experiment.log, rng, replicates)
    torque = float(np.sqrt(np.mean(tau**2)))
    verdicts = judge_rung(rung, information, fit, spread, torque, ("",) * len(rung), rules)
    called = np.array([v.verdict is Class.IDENTIFIABLE for v in verdicts])
    judged = not spread.why_unjudged(len(fit.kept), rules)
    return Outcome(fit.value, spread.white, spread.robust, called, fit.paper_rule, judged)


def count_outcomes(
    trials: Sequence[Outcome], names: Sequence[str], truth: Array, noise: float, rho: float
) -> Cell:
    """Return how often intervals held the truth and verdicts were wrong.

    Parameters
    ----------
    trials : sequence of Outcome
    names : sequence of str
        Of the k parameters.
    truth : (k,)
    noise, rho : float
        What was simulated.
    """
    value = np.array([t.value for t in trials])
    off = np.abs(value - truth)
    white = off <= REACH * np.array([t.white for t in trials])
    robust = off <= REACH * np.array([t.robust for t in trials])
    wrong = off > WRONG * np.abs(truth)
    called = np.array([t.identifiable for t in trials])
    paper = np.array([t.paper for t in trials])
    return Cell(
        noise,
        rho,
        len(trials),
        float(white.mean()),
        float(robust.mean()),
        _error(robust),
        float(called.sum(1).mean()),
        _share(wrong, called),
        float(paper.sum(1).mean()),
        _share(wrong, paper),
        _error(white),
        clustered_share(wrong, called, ~robust).high,
        clustered_share(wrong, paper, ~robust).high,
        tuple(names),
        each_share(robust),
        float(np.mean([not t.judged for t in trials])),
    )


def _error(held: np.ndarray) -> float:
    """Return the Monte-Carlo standard error of a share, by trials (rows)."""
    by_trial = held.mean(1)
    return float(by_trial.std(ddof=1) / np.sqrt(len(held))) if len(held) > 1 else float("nan")


def _share(wrong: np.ndarray, called: np.ndarray) -> float:
    """Return the share of called parameters that are wrong; 0 when none was called."""
    return float((wrong & called).sum() / max(called.sum(), 1))
