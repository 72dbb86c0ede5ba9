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

from identifiability.foundation.answers import Answer, Column, Table
from identifiability.foundation.defaults import DEFAULTS
from identifiability.foundation.engines import Engine, Serial
from identifiability.foundation.keyed import Row
from identifiability.foundation.options import Repeated, Replicates, Seed, checked, resolve_count
from identifiability.foundation.result import Result, by_name
from identifiability.foundation.rounding import REACH, join, rough_percent
from identifiability.foundation.runs import Progress, quiet, share
from identifiability.foundation.values import frozen
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.answers import answer_next, reserve
from identifiability.workflows.calibrate.rules import RULES
from identifiability.workflows.calibrate.world import Cell, World, count_outcomes
from identifiability.workflows.commands import (
    given_paths,
    held_back,
    ladder_option,
    name_logs,
    source_name,
)

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
        pairs = zip(
            self.cell.names,
            self.cell.each,
            strict=True,
        )
        rows = pd.DataFrame([{"parameter": name, **vars(found)} for name, found in pairs])
        return by_name(rows.sort_values("value", kind="stable"))

    def answers(self) -> tuple[Answer, ...]:
        """Return whether to trust, how often verdicts are wrong, where, what to do next."""
        asked = _trust(self), _wrong(self), _weakest(self)
        return (*reserve(asked, self.warnings), answer_next(_next_commands(self)))

    def tables(self) -> tuple[Table, ...]:
        """Return the coverage of every parameter, the worst first."""
        rows = self.to_frame().itertuples(index=False)
        return (Table.of("Coverage of every parameter", EACH, rows),)

    @property
    def statement(self) -> str:
        """The answer in plain words, and what is odd about the logs."""
        told = [f"{a.short} {a.text}".strip() for a in self.answers()[:3]]
        return "\n".join([*told, *self.warnings, *self.remarks])

    @property
    def warnings(self) -> tuple[str, ...]:
        """Findings that change a decision, as of the analysis."""
        return self.analysis.warnings

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


# What is answered first: may intervals be trusted, how often are verdicts wrong, where, what next?


#: What the answer begins with, and its tone.
STARTS = {
    "yes": ("Yes.", "green"),
    "no": ("No.", "vermilion"),
    "not enough trials": ("Not enough trials to say.", "amber"),
}


def _trust(calibration: Calibration) -> Answer:
    cell = calibration.cell
    short, tone = STARTS[calibration.word]
    if calibration.word == "yes" and calibration.analysis.missing.statement:
        short, tone = "Only if nothing is missing.", "amber"
    elif calibration.word == "yes" and calibration.warnings:
        short, tone = "Only if the warning is settled.", "amber"
    text = (
        f"Of 95 % intervals of {calibration.model}, {100 * cell.coverage:.1f} ± "
        f"{100 * cell.coverage_se:.1f} % hold the truth in {len(cell.held)} simulated repetitions."
    )
    return Answer("May intervals and verdicts be trusted here?", short, text, tone)


def _wrong(calibration: Calibration) -> Answer:
    cell, wrong = calibration.cell, calibration.cell.wrong
    short, text, tone = "Never: nothing is called identifiable.", "", "grey"
    if cell.called:
        off = rough_percent(wrong.value) if wrong.value else "None"
        short = f"{off} of what is called identifiable is off by more than half."
        text = f"At most {rough_percent(wrong.high)} by these trials. "
        tone = "green" if wrong.high <= RULES.wrong_most else "amber"
    if cell.not_judged:
        text += f"In {rough_percent(cell.not_judged)} of the repetitions nothing is judged."
    return Answer(
        "How often is a verdict wrong?",
        short,
        text.strip(),
        tone,
    )


def _weakest(calibration: Calibration) -> Answer:
    cell = calibration.cell
    worst = calibration.to_frame().iloc[0]
    held = rough_percent(worst["value"])
    short = f"In {worst['parameter']}: {held} of its intervals hold the truth."
    narrow = f"Too few beyond chance: {join(list(cell.below))}. " if cell.below else ""
    tone = "amber" if narrow else ""
    return Answer(
        "Where is it weakest, and why?",
        short,
        f"{narrow}{_reason(calibration)}",
        tone,
    )


def _reason(calibration: Calibration) -> str:
    """Return why the answer is no, and what to do about it; else what it rests on."""
    analysis, word = calibration.analysis, calibration.word
    if analysis.nothing:
        return f"The analysis believes no verdict, because {analysis.nothing}."
    if word == "yes":
        # Repetitions are made by the model: what it lacks altogether is in none of them.
        missing = analysis.missing.statement
        usual = "This is so if no effect is missing: diagnose looks for one."
        return f"But {missing}: diagnose." if missing else usual
    if word == "not enough trials":
        return f"Repeat with more trials (--replicates {4 * len(calibration.cell.held)})."
    return (
        "The noise may remember longer than the log, the model leave out what moves, or the "
        "measured motion err: give longer logs, a larger model (--model) or instruments "
        "(--set estimator=auto)."
    )


def _next_commands(calibration: Calibration) -> list[tuple[str, str]]:
    analysis, word = calibration.analysis, calibration.word
    robot, how = analysis.robot, analysis.settings.get("preparation")
    given, name = given_paths(analysis.samples), source_name(robot)
    logs = f"{name_logs(robot, given, how=how)}{ladder_option(robot, analysis.source)}"
    more = f"--replicates {4 * len(calibration.cell.held)} --report calibration.html"
    begun = name_logs(
        robot,
        given,
        "--start-from",
        how,
    )
    usual = {
        "yes": ("Use intervals and verdicts:", f"analyze {name} {logs} --report report.html"),
        "no": ("Find a motion to measure next:", f"excite {name} {begun} --out next.json"),
        "not enough trials": ("Ask again with more trials:", f"calibrate {name} {logs} {more}"),
    }
    found = [usual[word]]
    if word == "yes" and analysis.missing.functions:
        held = held_back(analysis.validation)
        line = f"diagnose {name} {logs}{held} --report missing.html"
        found.insert(0, ("Find out what the model misses:", line))
    return [(what, f"identifiability {line}") for what, line in found]


EACH = (
    Column("parameter"),
    Column(
        "coverage",
        rough_percent,
        hint="Share of its 95 % intervals that hold the truth.",
    ),
    Column(
        "at least",
        rough_percent,
        hint="Lower end of the Monte-Carlo interval.",
    ),
    Column(
        "at most",
        rough_percent,
        hint="Upper end of the Monte-Carlo interval.",
    ),
)
