"""`Calibration`: the answer, and the operating characteristics that it rests on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any, ClassVar

import pandas as pd

from identifiability.estimation.noise.residual_noise import ResidualNoise
from identifiability.foundation.result import Result
from identifiability.foundation.values import frozen
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.calibrate.answer import Answer, Effect
from identifiability.workflows.calibrate.outcome import Cell
from identifiability.workflows.calibrate.ranks import RankCheck
from identifiability.workflows.diagnose import FalseNames


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
    effects : tuple of Effect
        What noise memory, left-out parameters and errors of the motion do, where the answer is no.
    nothing : str
        Why the analysis believes no verdict, for after "because"; empty where it does.
    analysis : Analysis or None
        Whose motion, model and residual were used.
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
    effects: tuple[Effect, ...] = ()
    nothing: str = ""
    analysis: Analysis | None = None

    @property
    def answer(self) -> Answer:
        """May intervals and verdicts be trusted?"""
        missing = "" if self.analysis is None else self.analysis.missing.statement
        return Answer(self.model, self.cells[0], self.effects, self.nothing, missing)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a cell."""
        return pd.DataFrame([c.to_row() for c in self.cells])

    def parameters_frame(self) -> pd.DataFrame:
        """Return one row a parameter: coverage under the first cell's noise, with its interval."""
        first = self.cells[0]
        rows = [{"parameter": n, **vars(s)} for n, s in zip(first.names, first.each, strict=True)]
        return pd.DataFrame(rows)

    @property
    def lines(self) -> tuple[str, str, str]:
        """The answer in three lines."""
        return self.answer.lines

    @property
    def statement(self) -> str:
        """The answer in plain words: three lines, and what seems to be wrong with the logs."""
        return "\n".join((*self.lines, *self.hints))

    @property
    def notes(self) -> tuple[str, ...]:
        """What else was measured, a paragraph each."""
        found = [x.statement for x in (self.ranks, self.false_names) if x is not None]
        return (*found, self.unmeasured) if self.unmeasured else tuple(found)

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
            "answer": self.answer.word,
            "statement": self.statement,
            "lines": list(self.lines),
            "cells": [c.to_dict() for c in self.cells],
            "causes": [
                {"without": e.cause.name, "gain": e.gain, "gain_se": e.gain_se, **e.cell.to_dict()}
                for e in self.effects
            ],
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
