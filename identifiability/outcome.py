"""One simulated experiment with known truth, fitted and judged; and what many of them come to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identifiability.assessment import (
    assess_uncertainty,
    column_noise,
    column_rms,
    recurrence,
)
from identifiability.estimation import Method, estimate
from identifiability.information import Information
from identifiability.ladder import Rung
from identifiability.names import Array
from identifiability.replicates import Experiment
from identifiability.verdict import Class, Evidence, Thresholds, judge

#: A parameter is wrong if it is off by more than this share of its true value.
WRONG = 0.5


@dataclass(frozen=True)
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


@dataclass(frozen=True)
class Outcome:
    """One simulated experiment, fitted and judged as `analyze` would: arrays over k parameters.

    Small on purpose: thousands of them come back from other processes.
    """

    value: Array
    white: Array
    robust: Array
    identifiable: np.ndarray
    paper: np.ndarray


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
    evidence = Evidence(
        fit,
        spread.robust,
        recurrence(fit, spread, rules),
        column_rms(information),
        column_noise(information, fit),
        float(np.sqrt(np.mean(tau**2))),
        ("",) * len(rung),
    )
    verdicts = judge(rung.labels, rung.units, evidence, None, rules)
    called = np.array([v.verdict is Class.IDENTIFIABLE for v in verdicts])
    return Outcome(fit.value, spread.white, spread.robust, called, fit.paper_rule)


def count_outcomes(trials: Sequence[Outcome], truth: Array, noise: float, rho: float) -> Cell:
    """Return how often intervals held the truth and verdicts were wrong."""
    value = np.array([t.value for t in trials])
    off = np.abs(value - truth)
    white = off <= 1.96 * np.array([t.white for t in trials])
    robust = off <= 1.96 * np.array([t.robust for t in trials])
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
    )


def _error(held: np.ndarray) -> float:
    """Return the Monte-Carlo standard error of a share, by trials (rows)."""
    by_trial = held.mean(1)
    return float(by_trial.std(ddof=1) / np.sqrt(len(held))) if len(held) > 1 else float("nan")


def _share(wrong: np.ndarray, called: np.ndarray) -> float:
    """Return the share of called parameters that are wrong; 0 when none was called."""
    return float((wrong & called).sum() / max(called.sum(), 1))
