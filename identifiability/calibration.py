"""Operating characteristics on the user's own robot and motion.

How often do nominal 95 % intervals hold the truth under autocorrelated noise? How often is a
parameter that is called identifiable wrong by more than half? Truth is planted at the fitted
values, noise has the size and the correlation of the residual.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from identifiability.analysis import Analysis
from identifiability.assessment import Uncertainty, assess_uncertainty, column_rms, recurrence
from identifiability.errors import ModelError, near_match
from identifiability.estimation import estimate
from identifiability.model import Model, Regression
from identifiability.names import Array
from identifiability.output import write_json
from identifiability.replicates import Experiment, outcomes
from identifiability.verdict import Class, Evidence, judge

SCHEMA = "identifiability/calibration/1"

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


@dataclass(frozen=True)
class Calibration:
    """Operating characteristics of the verdicts on one motion.

    Attributes
    ----------
    robot, model : str
    parameters : int
    cells : tuple of Cell
    seed : int
    """

    robot: str
    model: str
    parameters: int
    cells: tuple[Cell, ...]
    seed: int

    def to_frame(self) -> pd.DataFrame:
        """Return one row a cell."""
        return pd.DataFrame([vars(c) for c in self.cells])

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        own = self.cells[0]
        worst = max(self.cells, key=lambda c: c.wrong)
        return (
            f"On this motion the robust 95 % intervals of {self.model} hold the truth in "
            f"{100 * own.coverage_robust:.0f} % of simulated repetitions with noise like the "
            f"residual (white-noise intervals: {100 * own.coverage_white:.0f} %). Of the "
            f"parameters called identifiable at most {100 * worst.wrong:.2g} % are wrong by more "
            f"than half, at any noise tried; of those that pass the 10× rule up to "
            f"{100 * max(c.paper_wrong for c in self.cells):.2g} %."
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON."""
        return {
            "schema": SCHEMA,
            "robot": self.robot,
            "model": self.model,
            "parameters": self.parameters,
            "statement": self.statement,
            "cells": [vars(c) for c in self.cells],
            "seed": self.seed,
        }

    def to_json(self, path: str | Path) -> Path:
        """Write the result as JSON, whole or not at all."""
        return write_json(path, self.to_dict())

    def write_report(self, path: str | Path) -> Path:
        """Write the result as one self-contained HTML file."""
        from identifiability.report.calibration_report import (  # noqa: PLC0415 - roof above us
            write_calibration_report,
        )

        return write_calibration_report(self, path)

    def _repr_html_(self) -> str:
        return f"<p>{self.statement}</p>{self.to_frame().to_html()}"


def calibrate(
    analysis: Analysis,
    *,
    model: str | None = None,
    noise: Sequence[float] = (1.0, 0.3, 3.0),
    rho: Sequence[float] = (float("nan"), 0.0, 0.9),
    trials: int = 60,
    replicates: int = 200,
    seed: int = 0,
    progress: Callable[[str, float], None] | None = None,
) -> Calibration:
    """Measure how far intervals and verdicts can be trusted on the motion of an analysis.

    Parameters
    ----------
    analysis : Analysis
        Whose motion, model and residual are used.
    model : str, optional
        Which model of the ladder; by default the unpruned one.
    noise : sequence of float
        Multiples of the residual's standard deviation.
    rho : sequence of float
        Correlations from sample to sample; NaN for the residual's own.
    trials : int
        Simulated repetitions a cell.
    replicates : int
        Of the bootstrap in each.
    seed : int
    progress : callable(str, float), optional

    Raises
    ------
    ModelError
        If the ladder has no such model.
    """
    names = [m.name for m in analysis.models]
    if model is not None and model not in names:
        raise ModelError(
            f"There is no model '{model}'{near_match(model, names)} The models are "
            f"{', '.join(names)}."
        )
    at = 0 if model is None else names.index(model)
    result = analysis.models[at]
    experiment = _experiment(analysis, at)
    truth = result.estimate.value
    sd = np.sqrt(result.estimate.variance)
    own = _lag_one(analysis.fitted.residual[:, :, at])
    cells = []
    pairs = [(level, r) for r in rho for level in noise]
    streams = np.random.default_rng(seed).spawn(len(pairs))
    with threadpool_limits(1, "blas"):
        for k, ((level, r), rng) in enumerate(zip(pairs, streams, strict=True)):
            if progress:
                progress(f"noise × {level:g}", k / len(pairs))
            correlation = own if np.isnan(r) else np.full(len(sd), r)
            trial = [
                _judge_outcome(analysis, at, information, tau, experiment, rng, replicates)
                for information, tau in outcomes(
                    experiment, truth, level * sd, correlation, rng, trials
                )
            ]
            cells.append(_count(trial, truth, level, r))
    return Calibration(analysis.robot.name, result.name, len(truth), tuple(cells), seed)


def _experiment(analysis: Analysis, at: int) -> Experiment:
    regression = Regression(
        analysis.robot, Model.of(*analysis.effects), analysis.samples, analysis.base.kept
    )
    rung = analysis.models[at].rung
    return Experiment.of(regression, rung.M, rung.columns)


def _lag_one(residual: Array) -> Array:
    """Return the correlation of neighbouring residuals at each actuator, (n,)."""
    centred = residual - residual.mean(0)
    square = np.sum(centred**2, 0)
    lagged = np.sum(centred[1:] * centred[:-1], 0)
    rho: Array = np.clip(lagged / np.where(square > 0, square, 1.0), 0.0, 0.995)
    return rho


@dataclass(frozen=True)
class _Trial:
    value: Array
    uncertainty: Uncertainty
    identifiable: np.ndarray
    paper: np.ndarray


def _judge_outcome(
    analysis: Analysis,
    at: int,
    information: Any,
    tau: Array,
    experiment: Experiment,
    rng: np.random.Generator,
    replicates: int,
) -> _Trial:
    """Fit and judge one outcome as `analyze` would."""
    rung = analysis.models[at].rung
    fit = estimate(information, analysis.method)
    residual = tau - experiment.W @ fit.value
    spread = assess_uncertainty(information, fit, residual, experiment.log, rng, replicates)
    evidence = Evidence(
        fit,
        spread.robust,
        recurrence(fit, spread, analysis.thresholds),
        column_rms(information),
        float(np.sqrt(np.mean(tau**2))),
        float(np.sqrt(np.mean(residual**2))),
        ("",) * len(rung),
    )
    verdicts = judge(rung.labels, rung.units, evidence, None, analysis.thresholds)
    called = np.array([v.verdict is Class.IDENTIFIABLE for v in verdicts])
    return _Trial(fit.value, spread, called, fit.paper_rule)


def _count(trials: Sequence[_Trial], truth: Array, noise: float, rho: float) -> Cell:
    value = np.array([t.value for t in trials])
    off = np.abs(value - truth)
    white = off <= 1.96 * np.array([t.uncertainty.white for t in trials])
    robust = off <= 1.96 * np.array([t.uncertainty.robust for t in trials])
    wrong = off > WRONG * np.abs(truth)
    called = np.array([t.identifiable for t in trials])
    paper = np.array([t.paper for t in trials])
    by_trial = robust.mean(1)
    return Cell(
        noise,
        rho,
        len(trials),
        float(white.mean()),
        float(robust.mean()),
        float(by_trial.std(ddof=1) / np.sqrt(len(trials))) if len(trials) > 1 else float("nan"),
        float(called.sum(1).mean()),
        _share(wrong, called),
        float(paper.sum(1).mean()),
        _share(wrong, paper),
    )


def _share(wrong: np.ndarray, called: np.ndarray) -> float:
    """Return the share of called parameters that are wrong; 0 when none was called."""
    return float((wrong & called).sum() / max(called.sum(), 1))
