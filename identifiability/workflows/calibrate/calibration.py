"""Operating characteristics on the user's own robot and motion.

How often do 95 % intervals of the model to use hold what their labels mean? How often is a
parameter that is called identifiable wrong by more than half? True robots are drawn around the
estimate and include parameters that the model omits. Noise resembles the residual. The motion has
the errors of the log.
"""

from collections.abc import Iterator, Mapping
from typing import Literal

import numpy as np

from identifiability.foundation.defaults import DEFAULTS
from identifiability.foundation.engines import Engine, Serial
from identifiability.foundation.keyed import Row
from identifiability.foundation.options import Repeated, Replicates, Seed, checked, resolve_count
from identifiability.foundation.presenter import presented
from identifiability.foundation.result import Result
from identifiability.foundation.rounding import REACH
from identifiability.foundation.runs import Progress, quiet, share
from identifiability.foundation.values import Json, frozen
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.result import ModelResult

from .rules import RULES
from .world import Cell, World, count_outcomes

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
    if sure and not cell.wrong.high > RULES.wrong_most:
        return "yes"
    return "not enough trials"


@frozen
class Calibration(Result):
    """Operating characteristics of intervals and verdicts on one motion.

    Attributes
    ----------
    analysis : Analysis
        Whose motion, model and residual were used.
    model : str
    cell : Cell
        Counts of all repetitions, with all causes.
    hints : tuple of str
        Problems of robot file and logs, and reasons for missing measurements.
    provenance : mapping
        Versions, seeds, options and hashes of the analysis and of this calibration.
    """

    schema = "identifiability/calibration/1"

    analysis: Analysis
    model: str
    cell: Cell
    hints: tuple[str, ...]
    provenance: Mapping[str, str]

    @property
    def word(self) -> Word:
        """Yes, no, or undecided by the trials; no if the analysis gives no values."""
        if self.analysis.nothing:
            return "no"
        return decide(self.cell)

    @presented
    def rows_by_name(self) -> Iterator[Row]:
        """Yield the coverage of each parameter's 95 % interval, a share with its own interval."""
        raise NotImplementedError

    def to_dict(self) -> Json:
        """Return the result for JSON."""
        parameters = len(self.cell.names)
        cells = [self.cell.to_dict()]
        seed = int(self.provenance["seed"])
        return {
            "schema": self.schema,
            "robot": self.analysis.robot.name,
            "model": self.model,
            "parameters": parameters,
            "answer": self.word,
            "statement": self.statement,
            "cells": cells,
            "hints": list(self.hints),
            "seed": seed,
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
        Fewer of all of these, unless their number is given.

    Raises
    ------
    OptionError
        If the ladder has no such model.
    LogError
        If the logs do not fit in memory.
    """
    analysis.robot.check_stands("calibration")
    usual = DEFAULTS.repetitions, DEFAULTS.repetitions_quick
    trials = resolve_count(replicates, *usual, quick=quick)
    result = _choose_model(analysis, model)
    repeating, making = np.random.SeedSequence(seed).spawn(2)
    world = World.of(analysis, result, refits, np.random.default_rng(making))
    steps = share(progress or quiet, "simulating repetitions", 0.0, 1.0)
    runner = engine or Serial()
    found = runner.map(world.repeat, repeating.spawn(trials), progress=steps)
    outcomes, truth = zip(*found, strict=True)
    numbers = {"seed": seed, "replicates": trials, "refits": refits}
    cell = count_outcomes(outcomes, np.array(truth), result.submodel.columns)
    return Calibration(
        analysis=analysis,
        model=result.name,
        cell=cell,
        hints=analysis.hints,
        provenance=analysis.provenance | {k: str(v) for k, v in numbers.items()},
    )


def _choose_model(analysis: Analysis, name: str | None) -> ModelResult:
    """Return a model of the ladder; by default the one to use, of a model file its only one."""
    entry = None if analysis.source is None else analysis.source.entry.models
    alone = entry[0] if entry and len(entry) == 1 else analysis.chosen
    return analysis.models[analysis.find_model(name or alone.name)]
