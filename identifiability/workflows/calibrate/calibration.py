"""Operating characteristics on the user's own robot and motion.

How often do nominal 95 % intervals hold the truth under autocorrelated noise? How often is a
parameter that is called identifiable wrong by more than half? Truth is planted at the fitted
values, noise has the size and the correlation of the residual, of any order at each actuator.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from functools import partial
from itertools import chain, islice
from typing import Annotated, Any, ClassVar

import numpy as np
import pandas as pd

from identifiability.estimation.noise.residual_noise import (
    ResidualNoise,
    find_runs,
    fit_residual_noise,
)
from identifiability.foundation.engines.local import Engine, Serial
from identifiability.foundation.errors import LogError
from identifiability.foundation.options import (
    Correlations,
    Levels,
    Replicates,
    Seed,
    at_least,
    checked,
)
from identifiability.foundation.result import Result
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Samples
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.calibrate.outcome import (
    Cell,
    Experiment,
    count_outcomes,
    repeat,
    spawn_seeds,
)
from identifiability.workflows.calibrate.ranks import RankCheck, check_ranks
from identifiability.workflows.diagnose import FalseNames, measure_false_names
from identifiability.workflows.opening import Logs, Progress, in_memory, require_signal, share

#: How many times more repetitions the first cell has, by which single parameters are judged.
FIRST = 4

#: Repetitions that one item of an engine does, some tenths of a second.
BATCH = 10


@frozen
class Calibration(Result):
    """Operating characteristics of the verdicts on one motion.

    Attributes
    ----------
    robot, model : str
    parameters : int
    cells : tuple of Cell
    seed : int
    ranks : RankCheck or None
        Simulation-based calibration of the posterior, where it was asked for.
    joints : tuple of str
        The actuators, for `own`.
    own : ResidualNoise or None
        The noise like the residual, which the first cell simulates.
    false_names : FalseNames or None
        Names that a diagnosis gives where nothing is missing, where that was asked for.
    unmeasured : str
        Why that could not be measured.
    provenance : mapping
        What decided the numbers of the analysis and these.
    hints : tuple of str
        What seems to be wrong with robot file and logs, for the user to check.
    """

    schema: ClassVar[str] = "identifiability/calibration/1"

    robot: str
    model: str
    parameters: int
    cells: tuple[Cell, ...]
    seed: int
    ranks: RankCheck | None = None
    joints: tuple[str, ...] = ()
    own: ResidualNoise | None = None
    false_names: FalseNames | None = None
    unmeasured: str = ""
    provenance: Mapping[str, str] = field(default_factory=dict)
    hints: tuple[str, ...] = ()

    def to_frame(self) -> pd.DataFrame:
        """Return one row a cell."""
        return pd.DataFrame([c.to_row() for c in self.cells])

    def parameters_frame(self) -> pd.DataFrame:
        """Return one row a parameter: coverage under the first cell's noise, with its interval."""
        first = self.cells[0]
        rows = [{"parameter": n, **vars(s)} for n, s in zip(first.names, first.each, strict=True)]
        return pd.DataFrame(rows)

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        own = self.cells[0]
        worst = max(self.cells, key=lambda c: c.wrong)
        return (
            f"On this motion the robust 95 % intervals of {self.model} hold the truth in "
            f"{100 * own.coverage_robust:.1f} ± {100 * own.coverage_se:.1f} % of {own.trials} "
            f"simulated repetitions with {_noise_words(own)} (white-noise intervals: "
            f"{100 * own.coverage_white:.0f} %). {self.worst_statement} Of the "
            f"parameters called identifiable at most {100 * worst.wrong:.2g} % are wrong by more "
            f"than half, at any noise tried (within the Monte-Carlo error up to "
            f"{100 * float(np.nanmax([0.0, *(c.wrong_high for c in self.cells)])):.2g} %); of "
            f"those that pass the 10× rule up to "
            f"{100 * max(c.paper_wrong for c in self.cells):.2g} %."
            + self._unjudged_statement
            + ("" if self.ranks is None else f" {self.ranks.statement}")
            + ("" if self.false_names is None else f" {self.false_names.statement}")
            + "".join(f" {text}" for text in (self.unmeasured, *self.hints) if text)
        )

    @property
    def _unjudged_statement(self) -> str:
        most = max(c.not_judged for c in self.cells)
        if not most:
            return ""
        return (
            f" In up to {100 * most:.0f} % of the repetitions nothing is judged, for want of "
            "independent outputs or of blocks to resample: give longer logs."
        )

    @property
    def worst_statement(self) -> str:
        """What the pooled coverage hides, in plain words."""
        own = self.cells[0]
        name, share = own.names[own.worst], own.each[own.worst]
        text = (
            f"Of single parameters {name} fares worst: {100 * share.value:.0f} % (between "
            f"{100 * share.low:.0f} and {100 * share.high:.0f} %, allowing for the choice among "
            f"{len(own.each)})"
        )
        if not own.below:
            return f"{text}, which chance explains."
        many = f"{len(own.below)} parameters" if len(own.below) > 1 else "it"
        return f"{text}; the intervals of {many} are too narrow beyond chance."

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON."""
        return {
            "schema": self.schema,
            "robot": self.robot,
            "model": self.model,
            "parameters": self.parameters,
            "statement": self.statement,
            "cells": [c.to_dict() for c in self.cells],
            "noise": self._noise_rows(),
            "posterior": None if self.ranks is None else self.ranks.to_dict(),
            "diagnosis": None if self.false_names is None else self.false_names.to_dict(),
            "hints": list(self.hints),
            "seed": self.seed,
            "provenance": self.provenance,
        }

    def _noise_rows(self) -> list[dict[str, Any]]:
        """Return the noise like the residual, one row a joint."""
        own = self.own
        if own is None:
            return []
        columns = zip(self.joints, own.orders, own.sd, own.times, strict=True)
        return [
            {"joint": j, "order": p, "sd": s, "autocorrelation_time": t} for j, p, s, t in columns
        ]


@checked
def calibrate(
    analysis: Analysis,
    *,
    model: str | None = None,
    noise: Levels = (1.0, 0.3, 3.0),
    rho: Correlations = (float("nan"), 0.0, 0.9),
    trials: Annotated[int, at_least(2)] = 60,
    replicates: Replicates = 200,
    sbc: Annotated[int, at_least(0)] = 0,
    logs: Logs = (),
    diagnoses: Annotated[int, at_least(0)] = 0,
    seed: Seed = 0,
    progress: Progress | None = None,
    engine: Engine | None = None,
) -> Calibration:
    """Measure how far intervals and verdicts can be trusted on the motion of an analysis.

    Parameters
    ----------
    analysis : Analysis
        Whose motion, model and residual are used.
    model : str, optional
        Which model of the ladder; by default its first one.
    noise : sequence of float
        Multiples of the residual's standard deviation.
    rho : sequence of float
        Correlations from sample to sample of AR(1) noise; NaN for noise like the residual,
        autoregressive of the order that suits each actuator.
    trials : int
        Simulated repetitions a cell; the first cell has `FIRST` times as many, because single
        parameters are judged by it.
    replicates : int
        Of the bootstrap in each.
    sbc : int
        Simulated experiments for the simulation-based calibration of the posterior; 0 for none.
    logs : log, path, DataFrame, or several
        The raw logs of the analysis; needed for `diagnoses`.
    diagnoses : int
        Simulated repetitions of the logs that are diagnosed with nothing missing; 0 for none.
    seed : int
    progress : callable(str, float), optional
    engine : Engine, optional
        Where repetitions are simulated; by default here. The result does not depend on it.

    Raises
    ------
    OptionError
        If the ladder has no such model.
    LogError
        If the logs do not fit in memory, or have nothing to explain.
    """
    require_signal(analysis.samples, "calibrated")
    result = analysis.models[analysis.find_model(model or analysis.first)]
    runs = find_runs(in_memory(analysis.samples, Samples))
    experiment = replace(
        Experiment.of(analysis.regression, result.rung),
        method=result.estimate.estimator,
        thresholds=analysis.thresholds,
        replicates=replicates,
    )
    truth = result.estimate.value
    own = fit_residual_noise(experiment.tau, experiment.W, runs)
    pairs = [(level, r) for r in rho for level in noise]
    *streams, last = np.random.default_rng(seed).spawn(len(pairs) + 1)
    counts = [FIRST * trials, *[trials] * (len(pairs) - 1)]
    items = []
    for (level, r), count, rng in zip(pairs, counts, streams, strict=True):
        like = own if np.isnan(r) else ResidualNoise.first_order(own.sd, r)
        seeds = spawn_seeds(rng, count)
        items += [(like.scaled(level), seeds[k : k + BATCH]) for k in range(0, count, BATCH)]
    runner, say = engine or Serial(), progress or (lambda _text, _share: None)
    simulating = share(say, "simulating repetitions", 0.0, 0.9)
    found = runner.map(partial(repeat, experiment, truth, runs), items, progress=simulating)
    outcomes = chain.from_iterable(list(found))
    cells = tuple(
        count_outcomes(list(islice(outcomes, count)), result.rung.columns, truth, *pair)
        for count, pair in zip(counts, pairs, strict=True)
    )
    ranks, named, unmeasured = None, None, ""
    if sbc:
        ranking = share(say, "ranking planted values", 0.9, 1.0)
        part = result.rung.reduce(analysis.information)
        ranks = check_ranks(result, part, last, replicates=sbc, engine=runner, progress=ranking)
    if diagnoses:
        try:
            named = measure_false_names(
                analysis.robot, logs, model=analysis.effects, trials=diagnoses, seed=seed,
                progress=progress, engine=runner,
            )  # fmt: skip
        except LogError as error:  # too short a log has no part to verify names on
            unmeasured = f"How often a name is false was not measured: {error}"
    numbers = {"trials": trials, "replicates": replicates, "sbc": sbc, "diagnoses": diagnoses}
    return Calibration(
        robot=analysis.robot.name,
        model=result.name,
        parameters=len(truth),
        cells=cells,
        seed=seed,
        ranks=ranks,
        joints=analysis.robot.joints,
        own=own,
        false_names=named,
        unmeasured=unmeasured,
        provenance=analysis.provenance | {k: str(v) for k, v in {"seed": seed, **numbers}.items()},
        hints=analysis.hints,
    )


def _noise_words(cell: Cell) -> str:
    """Return what a cell simulates, for the middle of a sentence."""
    size = "" if cell.noise == 1 else f"{cell.noise:g} times "
    like = "noise like the residual" if np.isnan(cell.rho) else f"AR(1) noise, ρ = {cell.rho:g}"
    return size + like
