"""Operating characteristics on the user's own robot and motion.

How often do nominal 95 % intervals hold the truth under autocorrelated noise? How often is a
parameter that is called identifiable wrong by more than half? Truth is planted at the fitted
values, noise has the size and the correlation of the residual.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from identifiability.analysis import Analysis
from identifiability.errors import ModelError, near_match
from identifiability.model import Model, Regression
from identifiability.names import Array
from identifiability.outcome import Cell, count_outcomes, judge_outcome
from identifiability.output import write_json
from identifiability.ranks import RankCheck, check_ranks
from identifiability.replicates import Experiment, outcomes

SCHEMA = "identifiability/calibration/1"


@dataclass(frozen=True)
class Calibration:
    """Operating characteristics of the verdicts on one motion.

    Attributes
    ----------
    robot, model : str
    parameters : int
    cells : tuple of Cell
    seed : int
    ranks : RankCheck or None
        Simulation-based calibration of the posterior, where it was asked for.
    """

    robot: str
    model: str
    parameters: int
    cells: tuple[Cell, ...]
    seed: int
    ranks: RankCheck | None = None

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
            + ("" if self.ranks is None else f" {self.ranks.statement}")
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
            "posterior": None if self.ranks is None else self.ranks.to_dict(),
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
        return f"<p>{escape(self.statement)}</p>{self.to_frame().to_html()}"


def calibrate(
    analysis: Analysis,
    *,
    model: str | None = None,
    noise: Sequence[float] = (1.0, 0.3, 3.0),
    rho: Sequence[float] = (float("nan"), 0.0, 0.9),
    trials: int = 60,
    replicates: int = 200,
    sbc: int = 0,
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
    sbc : int
        Simulated experiments for the simulation-based calibration of the posterior; 0 for none.
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
    *streams, last = np.random.default_rng(seed).spawn(len(pairs) + 1)
    with threadpool_limits(1, "blas"):
        for k, ((level, r), rng) in enumerate(zip(pairs, streams, strict=True)):
            if progress:
                progress(f"noise × {level:g}", k / len(pairs))
            correlation = own if np.isnan(r) else np.full(len(sd), r)
            trial = [
                judge_outcome(
                    result.rung,
                    experiment,
                    information,
                    tau,
                    rng,
                    method=analysis.method,
                    thresholds=analysis.thresholds,
                    replicates=replicates,
                )
                for information, tau in outcomes(
                    experiment, truth, level * sd, correlation, rng, trials
                )
            ]
            cells.append(count_outcomes(trial, truth, level, r))
        ranks = None
        if sbc:
            information = result.rung.reduce(analysis.information)
            ranks = check_ranks(
                result, information, last, replicates=sbc, progress=_steps(progress)
            )
    return Calibration(analysis.robot.name, result.name, len(truth), tuple(cells), seed, ranks)


def _steps(progress: Callable[[str, float], None] | None) -> Callable[[int, int], None] | None:
    if progress is None:
        return None
    return lambda done, total: progress("ranking planted values", done / total)


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
