"""Simulated experiments with known truth, fitted and judged, and what many of them come to.

`check_ranks` asks whether the posterior is right on the user's own motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from identifiability.estimation.decide import decide_submodel, find_left_out
from identifiability.estimation.estimate import Method, find_estimator, fit_whole, settle_noise
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.uncertainty import assess_uncertainty
from identifiability.estimation.verdict import Class
from identifiability.foundation.engines.local import Engine, Serial
from identifiability.foundation.engines.mapping import Steps
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import (
    LEVEL,
    REACH,
    Share,
    clustered_share,
    each_share,
    holm,
)
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.fitted_model import LeastSquares
from identifiability.posterior.diagnostics import Calibration, calibrate_posterior
from identifiability.posterior.target import Prior, Target
from identifiability.regression.information import Information
from identifiability.regression.reduction import Submodel
from identifiability.regression.regression import Regression
from identifiability.regression.structure import Structure
from identifiability.workflows.analyze.assessment import ModelResult

# Simulated experiments with known truth, fitted and judged; and what many of them come to.
#
# Operating characteristics (coverage, false verdicts) are properties of a motion; they are
# measured on the motion itself, the user's own regressor, with planted parameters and noise that
# we made.


#: What an item of an engine carries of its randomness, so that any worker can do it.
Seeds = Sequence[np.random.SeedSequence]


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

    def holds(self, truth: Array) -> np.ndarray:
        """Return which robust intervals hold the truth (k,), (k,) bool."""
        covered: np.ndarray = np.abs(self.value - truth) <= REACH * self.robust
        return covered

    def wrong(self, truth: Array) -> np.ndarray:
        """Return which values are off by more than half of the truth (k,), (k,) bool."""
        off: np.ndarray = np.abs(self.value - truth) > 0.5 * np.abs(truth)
        return off


@frozen(kw_only=True)
class Experiment:
    """A motion under one model, held in memory, and how its outcomes are judged.

    Attributes
    ----------
    submodel : Submodel
        The model, of k parameters.
    W : (N, n, k)
        Its columns.
    tau : (N, n) [N·m or N]
        The measured torque less what the model holds.
    log : (N,) int
    block : int
        Samples a block of the information.
    method, thresholds, replicates
        As in `analyze`.
    structure : Structure or None
        What is behind the columns: with it intervals know what the model leaves out.
    echo : Information or None
        What new noise of the motion does to all base parameters' columns.
    moves : (N, n) bool or None
        Where torque is data: joints do not dwell; elsewhere columns and torque are zero.
    """

    submodel: Submodel
    W: Array
    tau: Array
    log: np.ndarray
    block: int
    method: Method = "wls"
    thresholds: Thresholds = Thresholds()
    replicates: int = 200
    structure: Structure | None = None
    echo: Information | None = None
    moves: np.ndarray | None = None

    @staticmethod
    def of(regression: Regression, submodel: Submodel) -> Experiment:
        """Return the experiment of a regression under a model."""
        log, W, tau, moves = [], [], [], []
        for chunk in (c for part in regression.parts(whole=True) for c in part.chunks()):
            log.append(np.full(len(chunk.tau), chunk.log))
            W.append(chunk.W @ submodel.M)
            tau.append(chunk.tau - chunk.W @ submodel.fixed)
            moves.append(chunk.data)
        # Blocks of the information about an experiment.
        return Experiment(
            submodel=submodel,
            W=np.concatenate(W),
            tau=np.concatenate(tau),
            log=np.concatenate(log),
            block=max(1, -(-sum(map(len, W)) // 256)),
            moves=np.concatenate(moves),
        )

    def outcome(self, truth: Array, noise: Array) -> tuple[Information, Array]:
        """Return the information of one outcome, and its torque (N, n).

        Parameters
        ----------
        truth : (k,)
        noise : (N, n) [N·m or N]
        """
        tau = self.W @ truth + (noise if self.moves is None else noise * self.moves)
        columns = self.submodel.columns
        found = Information.of_rows(columns, self.W, tau, self.log, self.block, moves=self.moves)
        return found, tau

    def judge(
        self,
        information: Information,
        tau: Array,
        rng: np.random.Generator,
        whole: Information | None = None,
    ) -> Outcome:
        """Fit and judge one outcome.

        Parameters
        ----------
        information : Information
            About the columns and the torque.
        tau : (N, n) [N·m or N]
        rng : numpy.random.Generator
        whole : Information, optional
            About all base parameters' columns: noise is measured beside them, and the outcome is
            asked what the model leaves out.
        """
        method = find_estimator(self.method)
        method = method if whole is None else settle_noise(method, whole)
        fit = method.fit(information)
        residual, rules = tau - self.W @ fit.value, self.thresholds
        spread = assess_uncertainty(information, fit, residual, self.log, rng, self.replicates)
        torque, aliases = float(np.sqrt(np.mean(tau**2))), ("",) * len(self.submodel)
        left = None
        if self.structure is not None and whole is not None:
            full = fit_whole(method, whole)
            left = find_left_out(self.structure, self.submodel, whole, fit, full)
        verdicts = decide_submodel(
            self.submodel, information, fit, spread, torque, aliases, rules, left_out=left
        )
        ends = np.array([v.interval95 for v in verdicts]).reshape(-1, 2)
        return Outcome(
            value=fit.value,
            white=spread.white,
            robust=(ends[:, 1] - ends[:, 0]) / (2 * REACH),
            identifiable=np.array([v.verdict is Class.IDENTIFIABLE for v in verdicts]),
            paper=fit.paper_rule,
            judged=not all(spread.why_unjudged(rules)),
        )


def spawn_seeds(rng: np.random.Generator, count: int) -> Seeds:
    """Return independent seeds."""
    return list(rng.bit_generator.seed_seq.spawn(count))  # type: ignore[attr-defined]


@frozen(kw_only=True)
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
    wrong_low, wrong_high, paper_wrong_high : float
        Ends of 95 % intervals of the shares that are off, by Monte-Carlo error.
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
    wrong_low: float = float("nan")
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


def count_outcomes(
    trials: Sequence[Outcome], names: Sequence[str], truth: Array, noise: float, rho: float
) -> Cell:
    """Return how often intervals held the truth and verdicts were wrong.

    Parameters
    ----------
    trials : sequence of Outcome
    names : sequence of str
        Of the k parameters.
    truth : (k,) or (T, k)
        What the labels meant, in all trials or in each.
    noise, rho : float
        What was simulated.
    """
    value = np.array([t.value for t in trials])
    each = np.broadcast_to(truth, value.shape)
    white = np.abs(value - each) <= REACH * np.array([t.white for t in trials])
    robust = np.array([t.holds(x) for t, x in zip(trials, each, strict=True)])
    wrong = np.array([t.wrong(x) for t, x in zip(trials, each, strict=True)])
    called = np.array([t.identifiable for t in trials])
    paper = np.array([t.paper for t in trials])
    share = clustered_share(wrong, called, ~robust)
    return Cell(
        noise=noise,
        rho=rho,
        trials=len(trials),
        coverage_white=float(white.mean()),
        coverage_robust=float(robust.mean()),
        coverage_se=_error(robust),
        called=float(called.sum(1).mean()),
        wrong=_share(wrong, called),
        paper_called=float(paper.sum(1).mean()),
        paper_wrong=_share(wrong, paper),
        coverage_white_se=_error(white),
        wrong_low=share.low,
        wrong_high=share.high,
        paper_wrong_high=clustered_share(wrong, paper, ~robust).high,
        names=tuple(names),
        each=each_share(robust),
        not_judged=float(np.mean([not t.judged for t in trials])),
    )


def _error(covered: np.ndarray) -> float:
    """Return the Monte-Carlo standard error of a share, by trials (rows)."""
    by_trial = covered.mean(1)
    return float(by_trial.std(ddof=1) / np.sqrt(len(covered))) if len(covered) > 1 else float("nan")


def _share(wrong: np.ndarray, called: np.ndarray) -> float:
    """Return the share of called parameters that are wrong; 0 when none was called."""
    return float((wrong & called).sum() / max(called.sum(), 1))


# Is the posterior right on the user's own motion? Simulation-based calibration of one model.
#
# Truth is drawn from a prior around the fitted values, data from the truth, and the truth is
# ranked among draws of its posterior with signs: the ranks are uniform if the posterior is right.


#: Width of the prior in robust σ: data and prior both matter, and so do signs near zero.
PRIOR_WIDTH: Tolerance = 3.0

#: Draws of each posterior, and bins of the histogram of ranks; the bins divide the ranks.
DRAWS, BINS = 31, 8

#: Most experiments that are simulated together; the parts are the same on every engine.
PART = 250


@frozen
class RankCheck:
    """Ranks of planted values among draws of their posterior.

    Attributes
    ----------
    names : (p,) str
    counts : (p, b)
        Ranks in each of b equal bins.
    p_values : (p,)
        Chi-square test that the ranks of a parameter are uniform.
    replicates : int
    """

    names: tuple[str, ...]
    counts: Array
    p_values: Array
    replicates: int

    @property
    def adjusted(self) -> Array:
        """p-values adjusted for their number by Holm's method, (p,)."""
        return holm(self.p_values)

    @property
    def worst(self) -> int:
        """The parameter with the smallest p-value."""
        return int(np.argmin(self.p_values))

    @property
    def uniform(self) -> bool:
        """Whether no parameter's ranks are other than uniform."""
        return bool(self.adjusted.min(initial=1.0) > ESTIMATION_RULES.unasked_level)

    @property
    def band(self) -> tuple[float, float]:
        """Counts between which 99 % of the bins of uniform ranks lie."""
        low, high = binom.interval(0.99, self.replicates, 1 / self.counts.shape[1])
        return float(low), float(high)

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        least = f"smallest adjusted p-value {self.adjusted.min():.2g}, {self.names[self.worst]}"
        verdict, ranked = ("is", "rank") if self.uniform else ("is not", "do not rank")
        return (
            f"The posterior {verdict} calibrated on this motion: over {self.replicates} simulated "
            f"experiments planted values {ranked} uniformly among its draws ({least})."
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON."""
        columns = zip(self.names, self.p_values, self.adjusted, self.counts, strict=True)
        return {
            "replicates": self.replicates,
            "uniform": self.uniform,
            "parameters": [
                {"name": n, "p_value": float(p), "adjusted": float(a), "counts": [*map(int, c)]}
                for n, p, a, c in columns
            ],
        }


def check_ranks(
    result: ModelResult,
    information: Information,
    rng: np.random.Generator,
    *,
    replicates: int = 1000,
    progress: Steps | None = None,
    engine: Engine | None = None,
) -> RankCheck:
    """Rank planted values among draws of the posterior of a model's parameters, with signs.

    Parameters
    ----------
    result : ModelResult
    information : Information
        About the model's columns.
    rng : numpy.random.Generator
    replicates : int
        Simulated experiments.
    progress : callable, optional
        Called with the number of parts done and to do.
    engine : Engine, optional
        Where parts of the experiments are simulated; by default here.
    """
    target, start = build_target(result, information)
    sizes = [len(part) for part in np.array_split(np.arange(replicates), -(-replicates // PART))]
    items = list(zip(sizes, spawn_seeds(rng, len(sizes)), strict=True))
    parts = (engine or Serial()).map(partial(_rank, target, start), items, progress=progress)
    found = Calibration(np.concatenate(list(parts)), DRAWS)
    names = result.submodel.columns
    return RankCheck(names, found.counts(BINS), found.p_values(BINS), replicates)


def _rank(
    target: Target, start: Array, item: tuple[int, np.random.SeedSequence]
) -> NDArray[np.int64]:
    """Return the ranks of some simulated experiments, (replicates, p)."""
    replicates, seed = item
    rng = np.random.default_rng(seed)
    return calibrate_posterior(target, start, rng, replicates=replicates, draws=DRAWS).ranks


def build_target(result: ModelResult, information: Information) -> tuple[Target, Array]:
    """Return the posterior that is checked, and a point inside it."""
    fit = result.estimate
    data = LeastSquares.likelihood(information, fit)
    region = PhysicalSet(
        np.empty((0, 10), int), result.submodel.nonnegative, columns=result.submodel.columns
    )
    sd = PRIOR_WIDTH * result.uncertainty.robust
    reach = np.linalg.norm(data.R, axis=0)
    wide = float(np.linalg.norm(data.z)) / np.where(reach > 0, reach, np.inf)
    usable = np.isfinite(sd) & (sd > 0)
    sd = np.where(usable, sd, np.where(wide > 0, wide, 1.0))
    mean = np.where(fit.determined, fit.value, 0.0)
    start = np.where(result.submodel.nonnegative, np.maximum(mean, 0.01 * sd), mean)
    return Target(data, Prior(mean, sd), region), start
