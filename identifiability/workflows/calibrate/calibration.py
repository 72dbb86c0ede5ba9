"""Operating characteristics on the user's own robot and motion.

How often do 95 % intervals of the model to use hold what their labels mean? How often is a
parameter that is called identifiable wrong by more than half? Truth is a robot around the likeliest
one, with what the model leaves out; noise is like the residual; the motion errs as the log's does.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, Literal

import numpy as np
import pandas as pd

from identifiability.foundation.defaults import DEFAULTS
from identifiability.foundation.engines import Engine, Serial
from identifiability.foundation.keyed import Row
from identifiability.foundation.options import Repeated, Replicates, Seed, checked, resolve_count
from identifiability.foundation.result import Result
from identifiability.foundation.rounding import REACH
from identifiability.foundation.runs import Progress, quiet, share
from identifiability.foundation.values import frozen
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.calibrate.rules import RULES
from identifiability.workflows.calibrate.world import Cell, World, count_outcomes

# May intervals and verdicts be trusted?


Word = Literal["yes", "no", "not enough trials"]


def decide(cell: Cell) -> Word:
    """Return whether intervals and verdicts can be trusted, if the trials say so."""
    reach = REACH * cell.coverage_se
    if (
        cell.not_judged > 0.5
        or cell.coverage + reach < RULES.coverage
        or cell.wrong.low > RULES.wrong_most
        or min(s.high for s in cell.each) < RULES.coverage_single
    ):
        return "no"
    sure = cell.coverage - reach >= RULES.coverage
    return "yes" if sure and not cell.wrong.high > RULES.wrong_most else "not enough trials"


@frozen
class Calibration(Result):
    """Operating characteristics of intervals and verdicts on one motion.

    Attributes
    ----------
    analysis : Analysis
        Whose motion, model and residual were used.
    model : str
    cell : Cell
        What was counted, with all causes.
    hints : tuple of str
        What is odd about robot file and logs, and why something was not measured.
    provenance : mapping
        What decided the numbers of the analysis and these.
    """

    schema: ClassVar[str] = "identifiability/calibration/1"

    analysis: Analysis
    model: str
    cell: Cell
    hints: tuple[str, ...]
    provenance: Mapping[str, str]

    @property
    def word(self) -> Word:
        """Yes, no, or that the trials do not say; of what the analysis does not believe, no."""
        return "no" if self.analysis.nothing else decide(self.cell)

    def rows_by_name(self) -> Iterator[Row]:
        """Yield the coverage of each parameter's 95 % interval, a share with its own interval."""
        told = f"coverage of the 95 % interval in {len(self.cell.held)} repetitions."
        for name, covered in zip(self.cell.names, self.cell.each, strict=True):
            low = name in self.cell.below
            yield Row(
                name=name,
                estimate=covered.value,
                standard_error=(covered.high - covered.low) / (2 * REACH),
                interval=(covered.low, covered.high),
                verdict="below 95 %" if low else "not below 95 %",
                reason=told,
                details=vars(covered),
            )

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter, the worst first: coverage with its Monte-Carlo interval."""
        return super().to_frame()

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON."""
        return {
            "schema": self.schema,
            "robot": self.analysis.robot.name,
            "model": self.model,
            "parameters": len(self.cell.names),
            "answer": self.word,
            "statement": self.statement,
            "cells": [self.cell.to_dict()],
            "hints": list(self.hints),
            "seed": int(self.provenance["seed"]),
            "provenance": self.provenance,
        }


@checked
def calibrate(
    analysis: Analysis,
    *,
    model: str | None = None,
    replicates: Repeated | None = None,
    refits: Replicates = 200,
    seed: Seed = 0,
    progress: Progress | None = None,
    engine: Engine | None = None,
    quick: bool = False,
) -> Calibration:
    """Measure how far intervals and verdicts can be trusted on the motion of an analysis.

    Parameters
    ----------
    analysis : Analysis
        Whose motion, model and residual are used.
    model : str, optional
        Which model of the ladder; by default the one to use, of a model file its only one.
    replicates : int, optional
        Simulated repetitions; by default `DEFAULTS.repetitions`, or
        `DEFAULTS.repetitions_quick` if `quick`.
    refits : int
        Of the bootstrap in each.
    seed : int
    progress : callable(str, float), optional
    engine : Engine, optional
        Where repetitions are simulated; by default here. The result does not depend on it.
    quick : bool
        Fewer of all of these, where nobody says how many.

    Raises
    ------
    OptionError
        If the ladder has no such model.
    LogError
        If the logs do not fit in memory.
    """
    analysis.robot.check_stands("calibration")
    trials = resolve_count(
        replicates,
        DEFAULTS.repetitions,
        DEFAULTS.repetitions_quick,
        quick=quick,
    )
    entry = None if analysis.source is None else analysis.source.entry.models
    alone = entry[0].name if entry and len(entry) == 1 else analysis.chosen.name
    result = analysis.models[analysis.find_model(model or alone)]
    repeating, making = np.random.SeedSequence(seed).spawn(2)
    runner, say = engine or Serial(), progress or quiet
    world = World.of(
        analysis,
        result,
        refits,
        np.random.default_rng(making),
    )
    steps = share(
        say,
        "simulating repetitions",
        0.0,
        1.0,
    )
    found = runner.map(
        world.repeat,
        repeating.spawn(trials),
        progress=steps,
    )
    outcomes, truth = zip(*found, strict=True)
    cell = count_outcomes(
        outcomes,
        np.array(truth),
        result.submodel.columns,
    )
    numbers = {"seed": seed, "replicates": trials, "refits": refits}
    return Calibration(
        analysis=analysis,
        model=result.name,
        cell=cell,
        hints=analysis.hints,
        provenance=analysis.provenance | {k: str(v) for k, v in numbers.items()},
    )
