"""Operating characteristics on the user's own robot and motion.

How often do 95 % intervals of the model to use hold what their labels mean? How often is a
parameter that is called identifiable wrong by more than half? Truth is a robot around the likeliest
one, with what the model leaves out; noise is like the residual; the motion errs as the log's does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar, Literal

import numpy as np
import pandas as pd

from identifiability.effects import bring, find_families
from identifiability.estimation.noise import split_runs
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.estimation.rules import Thresholds
from identifiability.foundation.answers import Answer, Column, Table
from identifiability.foundation.engines import Engine, Serial, Steps
from identifiability.foundation.errors import LogError
from identifiability.foundation.options import (
    Repeated,
    Replicates,
    Seed,
    Whole,
    checked,
    settle_count,
)
from identifiability.foundation.result import Result, by_name
from identifiability.foundation.rounding import REACH, Share, exact_share, join, rough_percent
from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import prepare_log
from identifiability.robot.closure import known_torque
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.answers import answer_next
from identifiability.workflows.calibrate.rules import RULES
from identifiability.workflows.calibrate.world import (
    Cell,
    World,
    count_outcomes,
    find_runs,
    fit_residual_noise,
    simulate_noise,
)
from identifiability.workflows.commands import (
    given_paths,
    held_back,
    ladder_option,
    name_logs,
    source_name,
)
from identifiability.workflows.diagnose import diagnose
from identifiability.workflows.session import Progress, in_memory, quiet, share

# How often does `diagnose` name what is not there, on this robot and this motion? The whole path is
# repeated from the raw log on: tests alone would miss false names by filters.


@frozen
class FalseNames:
    """Names given to simulated logs in which nothing is missing: one for every trial with some."""

    trials: int
    named: tuple[str, ...]

    @property
    def rate(self) -> Share:
        """Share of trials with a false name, with its 95 % interval [Clopper & Pearson 1934]."""
        return exact_share(len(self.named), self.trials)

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON."""
        rate, counts = self.rate, {"trials": self.trials, "false_names": len(self.named)}
        told = {"rate": rate.value, "interval95": [rate.low, rate.high]}
        return {**counts, **told, "named": list(self.named), "statement": self.statement}

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        value, low, high = (100 * x for x in vars(self.rate).values())
        return (
            f"In {self.trials} simulated repetitions of these logs with nothing missing, "
            f"{len(self.named)} {'was' if len(self.named) == 1 else 'were'} given a name "
            f"({value:.0f} %, 95 %: {low:.0f} … {high:.0f} %){': ' if self.named else ''}"
            f"{'; '.join(self.named)}."
        )


def measure_false_names(
    analysis: Analysis, trials: int, seed: int, engine: Engine, steps: Steps
) -> FalseNames:
    """Diagnose logs of the same motion whose torque is that of the model and like noise.

    The model is fitted beside the effects that a diagnosis names, which are left out.
    """
    robot, logs = analysis.robot, in_memory(analysis.recordings.fitted)
    how: Any = analysis.settings["preparation"]
    judge = partial(
        diagnose,
        robot,
        preparation=how,
        quick=True,
    )
    found = judge(logs, model=analysis.effects, seed=seed)
    samples = [prepare_log(robot, x, replace(how, decimate=1)) for x in logs]
    moves = [s.weight > 0 for s in samples]
    data, tau = np.concatenate(moves), np.concatenate([s.tau for s in samples])
    W = np.concatenate([found.model.regressor(robot, s.motion) for s in samples])
    runs = find_runs(samples)
    noise = fit_residual_noise(tau, W, split_runs(runs, data))
    # Joints weigh by their torque, and where one sticks torque is what it was.
    rows = data / np.maximum(np.sqrt(np.mean(tau**2 * data, axis=0)), 1e-12)
    A, b = (W * rows[:, :, None]).reshape(data.size, -1), (tau * rows).ravel()
    base, value = len(found.structure.parameters), np.linalg.lstsq(A, b, rcond=None)[0]
    each = np.split(W[:, :, :base] @ value[:base], np.cumsum([len(m) for m in moves])[:-1])
    whole = [
        (log.select(robot.joints), s.motion.kept, part + known_torque(robot, s.motion), m)
        for log, s, part, m in zip(logs, samples, each, moves, strict=True)
    ]
    again = partial(judge, model=found.structure.model)
    named = partial(
        _name,
        again,
        find_families(None),
        whole,
        partial(simulate_noise, noise, runs),
    )
    items = [(seed + k, s) for k, s in enumerate(np.random.SeedSequence(seed).spawn(trials))]
    return FalseNames(trials, tuple(filter(None, engine.map(named, items, progress=steps))))


def _name(judge: Any, families: Any, logs: Any, simulate: Any, item: Any) -> str:
    """Return the names that one repetition is given, if any."""
    seed, stream = item
    noise, at, fake = simulate(np.random.default_rng(stream)), 0, []
    for log, kept, exact, moves in logs:
        tau = np.array(log.tau)
        tau[kept] = np.where(
            moves,
            exact + noise[at : at + len(exact)],
            tau[kept],
        )
        fake.append(replace(log, tau=tau))
        at += len(exact)
    d = judge(fake, effects=bring(families), seed=seed)  # workers do not know plugins
    return "; ".join(f"{e.name} in {', '.join(e.joints)}" for e in d.effects)


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
    false_names : FalseNames or None
        Names that a diagnosis gives where nothing is missing, where that was asked for.
    hints : tuple of str
        What is odd about robot file and logs, and why something was not measured.
    provenance : mapping
        What decided the numbers of the analysis and these.
    """

    schema: ClassVar[str] = "identifiability/calibration/1"

    analysis: Analysis
    model: str
    cell: Cell
    false_names: FalseNames | None
    hints: tuple[str, ...]
    provenance: Mapping[str, str]

    @property
    def word(self) -> Word:
        """Yes, no, or that the trials do not say; of what the analysis does not believe, no."""
        return "no" if self.analysis.nothing else decide(self.cell)

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
        return (_trust(self), _wrong(self), _weakest(self), answer_next(_next_commands(self)))

    def decided_by(self) -> tuple[RuleTable, ...]:
        """Return the numbers by which it was decided, the verb's own first."""
        return (RULES, Thresholds(), ESTIMATION_RULES)

    def tables(self) -> tuple[Table, ...]:
        """Return the coverage of every parameter, the worst first."""
        rows = self.to_frame().itertuples(index=False)
        return (Table.of("Coverage of every parameter", EACH, rows),)

    @property
    def statement(self) -> str:
        """The answer in plain words, what else was measured, and what is odd about the logs."""
        told = [f"{a.short} {a.text}".strip() for a in self.answers()[:3]]
        told += [self.false_names.statement] if self.false_names is not None else []
        return "\n".join([*told, *self.hints])

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
            "causes": [],
            "noise": [],
            "posterior": None,
            "diagnosis": None if self.false_names is None else self.false_names.to_dict(),
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
    names: Whole | None = None,
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
        Simulated repetitions; by default 240, or 28 if `quick`.
    refits : int
        Of the bootstrap in each.
    names : int, optional
        Simulated repetitions of the logs that are diagnosed with nothing missing, 0 for none; by
        default 40, or none if `quick`: a few say nothing of how often a name is false.
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
    trials = settle_count(replicates, 240, 28, quick=quick)
    names = settle_count(names, 40, 0, quick=quick)
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
    steps = share(say, "simulating repetitions", 0.0, 0.6)
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
    named, hints = None, analysis.hints
    if names:
        steps = share(say, "diagnosing repetitions", 0.6, 1.0)
        try:
            named = measure_false_names(analysis, names, seed, runner, steps)
        except LogError as error:  # too short a log has no part to verify names on
            hints = (*hints, f"How often a name is false was not measured: {error}")
    numbers = {"seed": seed, "replicates": trials, "refits": refits, "names": names}
    return Calibration(
        analysis=analysis,
        model=result.name,
        cell=cell,
        false_names=named,
        hints=hints,
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
    return Answer("How often is a verdict wrong?", short, text.strip(), tone)


def _weakest(calibration: Calibration) -> Answer:
    cell = calibration.cell
    worst = calibration.to_frame().iloc[0]
    held = rough_percent(worst["value"])
    short = f"In {worst['parameter']}: {held} of its intervals hold the truth."
    narrow = f"Too few beyond chance: {join(list(cell.below))}. " if cell.below else ""
    tone = "amber" if narrow else ""
    return Answer("Where is it weakest, and why?", short, f"{narrow}{_reason(calibration)}", tone)


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
    begun = name_logs(robot, given, "--start-from", how)
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
    Column("coverage", rough_percent, hint="Share of its 95 % intervals that hold the truth."),
    Column("at least", rough_percent, hint="Lower end of the Monte-Carlo interval."),
    Column("at most", rough_percent, hint="Upper end of the Monte-Carlo interval."),
)
