"""Operating characteristics on the user's own robot and motion.

How often do nominal 95 % intervals hold the truth under autocorrelated noise? How often is a
parameter that is called identifiable wrong by more than half? Truth is planted at the fitted
values, noise has the size and the correlation of the residual.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from identifiability.analysis import Analysis
from identifiability.engine import Engine, Serial
from identifiability.errors import ModelError, near_match
from identifiability.estimation import Method
from identifiability.ladder import Rung
from identifiability.model import Model, Regression
from identifiability.names import Array
from identifiability.outcome import Cell, Outcome, count_outcomes, judge_outcome
from identifiability.output import write_json
from identifiability.ranks import RankCheck, check_ranks
from identifiability.replicates import Experiment, correlated_noise, spawn_seeds
from identifiability.verdict import Thresholds

SCHEMA = "identifiability/calibration/1"

#: Repetitions that one item of an engine does, some tenths of a second.
BATCH = 10


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
    engine: Engine | None = None,
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
    engine : Engine, optional
        Where repetitions are simulated; by default here. The result does not depend on it.

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
    pairs = [(level, r) for r in rho for level in noise]
    *streams, last = np.random.default_rng(seed).spawn(len(pairs) + 1)
    judged = _Judged(
        experiment, result.rung, truth, replicates, analysis.method, analysis.thresholds
    )
    items = [
        _Repetitions(level * sd, own if np.isnan(r) else np.full(len(sd), r), part)
        for (level, r), rng in zip(pairs, streams, strict=True)
        for part in _parts(spawn_seeds(rng, trials))
    ]
    runner, say = engine or Serial(), progress or (lambda _text, _share: None)
    found = runner.map(
        partial(_judge, judged), items,
        progress=lambda done, total: say("simulating repetitions", 0.9 * done / total),
    )  # fmt: skip
    outcomes = iter([outcome for part in found for outcome in part])
    cells = [count_outcomes(list(islice(outcomes, trials)), truth, *pair) for pair in pairs]
    ranks = None
    if sbc:
        information = result.rung.reduce(analysis.information)
        ranks = check_ranks(
            result, information, last, replicates=sbc, engine=runner,
            progress=lambda done, total: say("ranking planted values", 0.9 + 0.1 * done / total),
        )  # fmt: skip
    return Calibration(analysis.robot.name, result.name, len(truth), tuple(cells), seed, ranks)


@dataclass(frozen=True)
class _Judged:
    """What every repetition has in common."""

    experiment: Experiment
    rung: Rung
    truth: Array
    replicates: int
    method: Method
    thresholds: Thresholds


@dataclass(frozen=True)
class _Repetitions:
    """Standard deviation and correlation of the noise (n,), and the seed of each repetition."""

    sd: Array
    rho: Array
    seeds: tuple[np.random.SeedSequence, ...]


def _parts(seeds: list[np.random.SeedSequence]) -> list[tuple[np.random.SeedSequence, ...]]:
    return [tuple(seeds[k : k + BATCH]) for k in range(0, len(seeds), BATCH)]


def _judge(judged: _Judged, item: _Repetitions) -> list[Outcome]:
    """Simulate and judge some repetitions."""
    outcomes = []
    for rng in map(np.random.default_rng, item.seeds):
        noise = correlated_noise(judged.experiment.log, item.sd, item.rho, rng)
        information, tau = judged.experiment.outcome(judged.truth, noise)
        outcomes.append(
            judge_outcome(
                judged.rung, judged.experiment, information, tau, rng, method=judged.method,
                thresholds=judged.thresholds, replicates=judged.replicates,
            )
        )  # fmt: skip
    return outcomes


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
