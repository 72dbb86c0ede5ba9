"""Operating characteristics on the user's own robot and motion.

`Trust` says in three lines whether intervals and verdicts of the model to use may be trusted,
`Calibration` holds what that rests on, `calibrate` makes it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import partial
from itertools import chain, islice
from shlex import quote
from typing import Any, ClassVar, Literal

import numpy as np
import pandas as pd

from identifiability.estimation.instrumental import InstrumentalVariables
from identifiability.estimation.noise import ResidualNoise, find_runs
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.estimation.rules import Thresholds
from identifiability.foundation.answers import Answer, Column, Table
from identifiability.foundation.engines.local import Engine, Serial
from identifiability.foundation.engines.mapping import Steps
from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH, percent
from identifiability.foundation.options import (
    Correlations,
    Levels,
    Repeated,
    Replicates,
    Seed,
    Whole,
    checked,
    renamed,
    settle_count,
)
from identifiability.foundation.result import Result
from identifiability.foundation.rounding import NONE, join, rough_percent, whole_percent
from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, Samples
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.assessment import ModelResult
from identifiability.workflows.answers import answer_next, with_hints
from identifiability.workflows.calibrate.outcome import (
    Cell,
    Experiment,
    Outcome,
    RankCheck,
    Seeds,
    check_ranks,
    count_outcomes,
    spawn_seeds,
)
from identifiability.workflows.calibrate.rules import RULES
from identifiability.workflows.calibrate.world import (
    EVERYTHING,
    Cause,
    MotionErrors,
    TrueRobots,
    World,
    build_world,
    repeat,
)
from identifiability.workflows.commands import (
    given_paths,
    held_back,
    ladder_option,
    name_logs,
    source_name,
)
from identifiability.workflows.diagnose import FalseNames, measure_false_names
from identifiability.workflows.opening import Progress, in_memory, quiet, require_signal, share

# `Trust`: may the intervals and verdicts of the model to use be trusted? In three lines.


Word = Literal["yes", "no", "not enough trials"]

#: What a cause is called.
WORDS = {
    Cause.NOISE_MEMORY: "noise that remembers",
    Cause.LEFT_OUT: "left-out parameters",
    Cause.MOTION: "errors of the measured motion",
}


def find_remedy(cause: Cause, *, instruments: bool, record: bool, rates: bool) -> str:
    """Return what to do about a cause.

    Parameters
    ----------
    cause : Cause
    instruments : bool
        Whether instrumental variables were used.
    record : bool
        Whether every log has a second record of its motion, of which they could be made.
    rates : bool
        Whether velocities and accelerations were measured.
    """
    if cause is Cause.NOISE_MEMORY:
        return "give longer logs"
    if cause is Cause.LEFT_OUT:
        return "use a model that leaves out less (--model)"
    if instruments:
        return "low-pass the motion more (--cutoff)"
    if record:
        return "use instrumental variables (--estimator auto)"
    if rates:
        return "repeat the motion, for instrumental variables"
    return "log '<joint>.dq' and '<joint>.ddq' as measured, for instrumental variables"


@frozen
class Effect:
    """What switching off one cause does.

    Attributes
    ----------
    cause : Cause
    cell : Cell
        What was counted without it.
    gain, gain_se : float
        By how much the failed share (of intervals, verdicts or judgements) gets better, in the same
        repetitions, and its Monte-Carlo standard error.
    remedy : str
        What to do about it.
    """

    cause: Cause
    cell: Cell
    gain: float
    gain_se: float
    remedy: str

    @property
    def harmful(self) -> bool:
        """Whether the cause does harm beyond Monte-Carlo error."""
        return self.gain > REACH * self.gain_se and self.gain > 0


@frozen
class Trust:
    """The answer, and what it rests on.

    Attributes
    ----------
    model : str
    cell : Cell
        Repetitions with all causes.
    effects : tuple of Effect
        What each cause does, where the answer is no.
    nothing : str
        Why the analysis believes no verdict, for after "because"; empty where it does.
    missing : str
        What the model surely misses, in words; repetitions are made by the model and have it not.
    """

    model: str
    cell: Cell
    effects: tuple[Effect, ...] = ()
    nothing: str = ""
    missing: str = ""

    @property
    def word(self) -> Word:
        """Yes, no, or that the trials do not say."""
        return "no" if self.nothing else decide(self.cell)

    @property
    def enough(self) -> int:
        """Trials that would probably tell, as `calibrate` counts them."""
        return _enough(self.cell)

    @property
    def lines(self) -> tuple[str, str, str]:
        """The answer in three lines: intervals, verdicts, and the weakest point or the reason."""
        return self._intervals, self._verdicts, self._weakest

    @property
    def _intervals(self) -> str:
        cell = self.cell
        start = {"yes": "Yes", "no": "No", "not enough trials": "Not enough trials to say"}
        if self.missing:
            start["yes"] = "Only if nothing is missing"
        if not self.nothing and fails(cell) == "single":
            start["no"] = "No, not for every parameter"
        return (
            f"{start[self.word]}: of 95 % intervals of {self.model}, "
            f"{100 * cell.coverage_robust:.1f} ± {100 * cell.coverage_se:.1f} % hold the truth "
            f"in {cell.trials} simulated repetitions."
        )

    @property
    def _verdicts(self) -> str:
        cell = self.cell
        silent = ""
        if cell.not_judged:
            silent = (
                f" In {100 * cell.not_judged:.0f} % of the repetitions nothing is judged, for want "
                "of independent outputs or of blocks to resample."
            )
        if not cell.called:
            return f"Wrong by more than half: none, for none is called identifiable.{silent}"
        return (
            f"Wrong by more than half: {100 * cell.wrong:.1f} % of those called identifiable (at "
            f"most {100 * cell.wrong_high:.1f} %; {cell.called:.1f} of {len(cell.names)} are "
            f"called so).{silent}"
        )

    @property
    def _weakest(self) -> str:
        cell = self.cell
        name, share = cell.names[cell.worst], cell.each[cell.worst]
        least = f"Least sure: {name}, {100 * share.value:.0f} %"
        if self.nothing:
            return f"Why: the analysis believes no verdict, because {self.nothing}."
        if self.word == "yes" and self.missing:
            return f"{least} of its intervals hold the truth. But {self.missing}: diagnose."
        if self.word == "yes":
            # Repetitions are made by the model: what it lacks altogether is in none of them.
            return (
                f"{least} of its intervals hold the truth. This is so if no effect is missing: "
                "diagnose looks for one."
            )
        if self.word == "not enough trials":
            return f"{least}; repeat with more trials (--replicates {self.enough})."
        blamed = sorted((e for e in self.effects if e.harmful), key=lambda e: -e.gain)
        fault = fails(cell)
        if not blamed and fault == "silent":
            return "Why: too little is measured to judge; give longer logs."
        if not blamed:
            return f"{least}; no single cause explains it: give longer or other logs."
        first, others = blamed[0], blamed[1:]
        better = first.cell
        without = {
            "silent": f"{100 * (1 - better.not_judged):.0f} % are judged",
            "verdicts": f"{100 * better.wrong:.1f} % are wrong",
        }.get(fault, f"{100 * better.coverage_robust:.0f} % hold")
        why = WORDS[first.cause] + "".join(f", then {WORDS[e.cause]}" for e in others)
        weak = "" if fault == "silent" else f" ({least[0].lower()}{least[1:]})"
        remedy = f"{first.remedy[:1].upper()}{first.remedy[1:]}"
        return f"Why: {why}; without it {without}{weak}. {remedy}."


def fails(cell: Cell) -> str:
    """Return what surely is not as it should be: nothing, or one of the four that follow."""
    faults = {
        "silent": cell.not_judged > 0.5,
        "coverage": cell.coverage_robust + REACH * cell.coverage_se < RULES.coverage,
        "verdicts": cell.wrong_low > RULES.wrong_most,
        "single": min(s.high for s in cell.each) < RULES.coverage_single,
    }
    return next((name for name, holds in faults.items() if holds), "")


def decide(cell: Cell) -> Word:
    """Return whether intervals and verdicts can be trusted, if the trials say so."""
    if fails(cell):
        return "no"
    covered = cell.coverage_robust - REACH * cell.coverage_se >= RULES.coverage
    return "yes" if covered and not cell.wrong_high > RULES.wrong_most else "not enough trials"


def _enough(cell: Cell) -> int:
    """Return how many trials (a quarter of the first cell's) would probably tell."""
    room = max(abs(cell.coverage_robust - RULES.coverage), 0.01)
    by_coverage = (2 * REACH * cell.coverage_se / room) ** 2
    by_wrong = 2 * cell.wrong_high / RULES.wrong_most if cell.wrong_high > RULES.wrong_most else 0.0
    more = float(np.nanmax([2.0, by_coverage, by_wrong]))
    return int(np.ceil(cell.trials / 4 * min(more, 40.0) / 10) * 10)


def compare(
    cause: Cause,
    cell: Cell,
    all_: Sequence[tuple[Outcome, Array]],
    without: Sequence[tuple[Outcome, Array]],
    failed: Cell,
    remedy: str = "",
) -> Effect:
    """Return what a cause does, from the same repetitions with and without it.

    Parameters
    ----------
    cause : Cause
    cell : Cell
        Of the repetitions without it.
    all_, without : sequences of (Outcome, truth)
    failed : Cell
        With all causes: what of it is not as it should be is compared.
    remedy : str
        What to do about the cause.
    """
    fault = fails(failed)

    def bad(outcome: Outcome, truth: Array) -> float:
        if fault == "silent":
            return float(not outcome.judged)
        if fault == "verdicts":
            return float((outcome.wrong(truth) & outcome.identifiable).sum())
        missed = ~outcome.holds(truth)
        return float(missed[failed.worst] if fault == "single" else missed.mean())

    pairs = zip(all_, without, strict=True)
    gains = np.array([bad(*one) - bad(*other) for one, other in pairs])
    if fault == "verdicts":
        gains = gains / max(failed.called, 1e-9)
    error = float(gains.std(ddof=1) / np.sqrt(len(gains))) if len(gains) > 1 else float("inf")
    return Effect(cause, cell, float(gains.mean()), error, remedy)


# `Calibration`: the answer, and the operating characteristics that it rests on.


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
    def answer(self) -> Trust:
        """May intervals and verdicts be trusted?"""
        missing = "" if self.analysis is None else self.analysis.missing.statement
        return Trust(self.model, self.cells[0], self.effects, self.nothing, missing)

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

    def answers(self) -> tuple[Answer, ...]:
        """Return whether to trust, how often verdicts are wrong, where, what to do next."""
        answers = (_trust(self), _wrong(self), _weakest(self))
        commands = _next_commands(self)
        return (*answers, answer_next(commands)) if commands else answers

    def decided_by(self) -> tuple[RuleTable, ...]:
        """Return the numbers by which it was decided, the verb's own first."""
        return (RULES, Thresholds(), ESTIMATION_RULES)

    def tables(self) -> tuple[Table, ...]:
        """Return how often verdicts are wrong, one row a simulated noise."""
        return (Table.of("Verdicts by noise", VERDICTS, self.cells),)

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


# Operating characteristics on the user's own robot and motion.
#
# How often do 95 % intervals of the model to use hold what their labels mean? How often is a
# parameter that is called identifiable wrong by more than half? Truth is a robot around the
# likeliest one, with what the model leaves out; noise is like the residual; the motion errs as the
# log's does.


#: Repetitions that one item of an engine does, some tenths of a second.
BATCH = 10


@renamed(trials="replicates", diagnoses="names", logs="")
@checked
def calibrate(
    analysis: Analysis,
    *,
    model: str | None = None,
    noise: Levels = (1.0, 0.3, 3.0),
    rho: Correlations = (float("nan"), 0.0, 0.9),
    replicates: Repeated | None = None,
    refits: Replicates = 200,
    sbc: Whole | None = None,
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
    noise : sequence of float
        Multiples of the residual's standard deviation.
    rho : sequence of float
        Correlations from sample to sample of AR(1) noise; NaN for noise like the residual,
        autoregressive of the order that suits each actuator.
    replicates : int, optional
        Simulated repetitions a cell; the first cell has four times as many, because single
        parameters are judged by it. By default 60, or 8 if `quick`.
    refits : int
        Of the bootstrap in each.
    sbc : int, optional
        Simulated experiments for the simulation-based calibration of the posterior, 0 for none; by
        default 1000, or 200 if `quick`.
    names : int, optional
        Simulated repetitions of the logs that are diagnosed with nothing missing, 0 for none; by
        default 40, or 4 if `quick`.
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
        If the logs do not fit in memory, or have nothing to explain.
    """
    analysis.robot.check_stands("calibration")
    trials = settle_count(replicates, 60, 8, quick=quick)
    sbc = settle_count(sbc, 1000, 200, quick=quick)
    names = settle_count(names, 40, 4, quick=quick)
    require_signal(analysis.samples, "calibrated")
    result = analysis.models[analysis.find_model(model or _asked(analysis))]
    *streams, last, making = np.random.default_rng(seed).spawn(len(noise) * len(rho) + 2)
    world, own = _world(analysis, result, refits, making)
    runner, say = engine or Serial(), progress or quiet
    trial = _Trials(world, runner, result.submodel.columns)
    pairs = [(level, r) for r in rho for level in noise]
    # How many times more repetitions the first cell has, by which single parameters are
    # judged.
    counts = [4 * trials, *[trials] * (len(pairs) - 1)]
    wanted = [
        (_noise_like(world, r).scaled(level), EVERYTHING, spawn_seeds(rng, count))
        for (level, r), rng, count in zip(pairs, streams, counts, strict=True)
    ]
    found = trial.simulate(wanted, share(say, "simulating repetitions", 0.0, 0.7))
    cells = tuple(trial.count(f, *pair) for f, pair in zip(found, pairs, strict=True))
    effects: tuple[Effect, ...] = ()
    if not analysis.nothing and decide(cells[0]) == "no":
        like, _, seeds = wanted[0]
        first = found[0][: 2 * trials], (like, EVERYTHING, seeds[: 2 * trials]), pairs[0]
        looking = share(say, "looking for the cause", 0.7, 0.9)
        effects = _find_causes(trial, result, cells[0], *first, looking)
    ranks, named, unmeasured = None, None, ""
    if sbc:
        ranking = share(say, "ranking planted values", 0.9, 1.0)
        part = result.submodel.reduce(analysis.information)
        ranks = check_ranks(result, part, last, replicates=sbc, engine=runner, progress=ranking)
    if names:
        named, unmeasured = _count_names(analysis, names, seed, progress, runner)
    numbers = {"seed": seed, "replicates": trials, "refits": refits, "sbc": sbc, "names": names}
    return Calibration(
        robot=analysis.robot.name,
        model=result.name,
        parameters=len(result.submodel),
        cells=cells,
        seed=seed,
        ranks=ranks,
        joints=analysis.robot.joints,
        own=own,
        false_names=named,
        unmeasured=unmeasured,
        provenance=analysis.provenance | {k: str(v) for k, v in numbers.items()},
        hints=analysis.hints,
        effects=effects,
        nothing=analysis.nothing,
        analysis=analysis,
    )


#: Noise, causes and seeds of the repetitions of a cell.
Wanted = tuple[ResidualNoise, Cause, Seeds]

#: What came of each repetition, and the truth.
Found = list[tuple[Outcome, Array]]


@frozen
class _Trials:
    """Repetitions in a world, simulated by an engine.

    Attributes
    ----------
    world : World
    engine : Engine
    columns : tuple of str
        Parameters of the model.
    """

    world: World
    engine: Engine
    columns: tuple[str, ...]

    def simulate(self, wanted: Sequence[Wanted], steps: Steps) -> list[Found]:
        """Return the repetitions of each cell."""
        items = [
            (like, causes, own[k : k + BATCH])
            for like, causes, own in wanted
            for k in range(0, len(own), BATCH)
        ]
        each = self.engine.map(partial(repeat, self.world), items, progress=steps)
        found = chain.from_iterable(each)
        return [list(islice(found, len(own))) for _, _, own in wanted]

    def count(self, trials: Found, level: float, r: float) -> Cell:
        """Return what was counted in a cell, of a level and a correlation of noise."""
        outcomes, truths = zip(*trials, strict=True)
        return count_outcomes(outcomes, self.columns, np.array(truths), level, r)


def _noise_like(world: World, rho: float) -> ResidualNoise:
    return world.noise if np.isnan(rho) else ResidualNoise.first_order(world.noise.sd, rho)


def _find_causes(
    trial: _Trials,
    result: ModelResult,
    failed: Cell,
    found: Found,
    wanted: Wanted,
    pair: tuple[float, float],
    steps: Steps,
) -> tuple[Effect, ...]:
    """Return what each cause does: the same repetitions without it.

    Parameters
    ----------
    trial : _Trials
    result : ModelResult
    failed : Cell
        With all causes.
    found : list of (Outcome, truth)
        What came of the wanted repetitions with all causes.
    wanted : Wanted
    pair : (level, rho)
    steps : callable
    """
    like, causes, seeds = wanted
    motion = trial.world.motion
    remedy = partial(
        find_remedy,
        instruments=isinstance(result.estimate.estimator, InstrumentalVariables),
        record=all(m.exact for m in motion),
        rates=all(m.log.dq is not None and m.log.ddq is not None for m in motion),
    )
    again = trial.simulate([(like, causes & ~cause, seeds) for cause in Cause], steps)
    return tuple(
        compare(cause, trial.count(f, *pair), found, f, failed, remedy(cause))
        for cause, f in zip(Cause, again, strict=True)
    )


def _count_names(
    analysis: Analysis, trials: int, seed: int, progress: Progress | None, engine: Engine
) -> tuple[FalseNames | None, str]:
    """Return how often a diagnosis names what is not there, or why that was not measured."""
    asked = analysis.settings.get("preparation")
    how = asked if isinstance(asked, Preparation) and asked != Preparation() else None
    try:
        named = measure_false_names(
            analysis.robot,
            analysis.recordings,
            model=analysis.effects,
            trials=trials,
            seed=seed,
            preparation=how,
            progress=progress,
            engine=engine,
        )
    except LogError as error:  # too short a log has no part to verify names on
        return None, f"How often a name is false was not measured: {error}"
    return named, ""


def _asked(analysis: Analysis) -> str:
    """Return the model of a model file, else the one to use."""
    entry = None if analysis.source is None else analysis.source.entry.models
    return entry[0].name if entry and len(entry) == 1 else analysis.chosen.name


def _world(
    analysis: Analysis, result: ModelResult, replicates: int, rng: np.random.Generator
) -> tuple[World, ResidualNoise]:
    """Return the world that is like the logs, and the noise that the residual is like."""
    samples = in_memory(analysis.samples, Samples)
    how = analysis.settings.get("preparation")
    how = how if isinstance(how, Preparation) else Preparation()
    experiment = replace(
        Experiment.of(analysis.regression, result.submodel),
        method=result.estimate.estimator,
        thresholds=analysis.thresholds,
        replicates=replicates,
        structure=analysis.structure,
        echo=analysis.information.echo,
    )
    logs = in_memory(analysis.recordings, Log)
    motion = tuple(
        MotionErrors.of(analysis.robot, s, raw, how) for s, raw in zip(samples, logs, strict=True)
    )
    robots = TrueRobots.of(analysis, result)
    chunks = [(tau, W.copy()) for _, _, W, tau in analysis.regression.chunks()]
    tau, W = (np.concatenate(x) for x in zip(*chunks, strict=True))
    sizes = np.sqrt(analysis.full.estimate.variance)
    return build_world(experiment, robots, motion, (tau, W), find_runs(samples), sizes, rng)


TONES = {"yes": "green", "no": "vermilion", "not enough trials": "amber"}


def _trust(calibration: Calibration) -> Answer:
    start, _, rest = calibration.lines[0].partition(": ")
    text = f"{rest[:1].upper()}{rest[1:]}"
    answer = calibration.answer
    tone = "amber" if answer.word == "yes" and answer.missing else TONES[answer.word]
    return Answer("May intervals and verdicts be trusted here?", f"{start}.", text, tone)


def _wrong(calibration: Calibration) -> Answer:
    cell, question = calibration.cells[0], "How often is a verdict wrong?"
    if not cell.called:
        return Answer(question, "Never: nothing is called identifiable.", tone="grey")
    share = rough_percent(cell.wrong) if cell.wrong else "None"
    short = f"{share} of what is called identifiable is off by more than half."
    tone = "green" if cell.wrong_high <= RULES.wrong_most else "amber"
    text = f"At most {rough_percent(cell.wrong_high)} by these trials."
    if cell.not_judged:
        text += f" In {whole_percent(cell.not_judged)} of the repetitions nothing is judged."
    return Answer(question, short, text, "vermilion" if cell.wrong_low > RULES.wrong_most else tone)


def _weakest(calibration: Calibration) -> Answer:
    cell = calibration.cells[0]
    name, share = cell.names[cell.worst], whole_percent(cell.each[cell.worst].value)
    short = f"In {name}: {share} of its intervals hold the truth."
    text = calibration.lines[2] if calibration.answer.word == "no" else ""
    if cell.below and share != NONE:
        text = f"Too few beyond chance: {join(list(cell.below))}. {text}".strip()
    return Answer("Where is it weakest, and why?", short, text, "amber" if cell.below else "")


def _next_commands(calibration: Calibration) -> list[tuple[str, str]]:
    analysis = calibration.analysis
    if analysis is None:
        return []
    robot, how = source_name(analysis.robot), analysis.settings.get("preparation")
    names = given_paths(analysis.samples)
    logs = name_logs(analysis.robot, names, how=how) + ladder_option(
        analysis.robot, analysis.source
    )
    word = calibration.answer.word
    use = (
        "Use intervals and verdicts:",
        f"identifiability analyze {robot} {logs} --report report.html --json analyze.json",
    )
    begun = name_logs(analysis.robot, names, "--start-from", how)
    longer = (
        "Find a motion to measure next, for longer and other logs:",
        f"identifiability excite {robot} {begun} --out next.json",
    )
    if word == "yes" and analysis.missing.functions:
        held = held_back(analysis.validation)
        line = f"identifiability diagnose {robot} {logs}{held} --report missing.html"
        return [("Find out what the model misses:", line), use]
    if word == "yes":
        return [use]
    if word == "not enough trials":
        again = f"--replicates {calibration.answer.enough} --report calibration.html"
        return [
            ("Ask again with more trials:", f"identifiability calibrate {robot} {logs} {again}")
        ]
    blamed = {e.cause for e in calibration.effects if e.harmful}
    if Cause.LEFT_OUT in blamed and analysis.full.name != calibration.model:
        model = f"--model {quote(analysis.full.name)} --report calibration.html"
        text = "Ask the same of the model that leaves nothing out:"
        return [(text, f"identifiability calibrate {robot} {logs} {model}"), longer]
    return [longer]


def _rare(share: float) -> str:
    return NONE if np.isnan(share) else f"{percent(share, 2)}"


def label(cell: Cell) -> str:
    """Return what a cell simulates, ``noise × 0.3, ρ = 0.9``."""
    rho = "as the residual" if np.isnan(cell.rho) else f"ρ = {cell.rho:g}"
    return f"noise × {cell.noise:g}, {rho}"


VERDICTS = with_hints(
    "verdicts",
    Column("simulated noise", get=label),
    Column("called identifiable", "{:.1f}".format, "called"),
    Column("of these wrong", _rare, "wrong"),
    Column("at most", _rare, "wrong_high"),
    Column("not judged", whole_percent, "not_judged"),
    Column("pass the 10× rule", "{:.1f}".format, "paper_called"),
    Column("of these wrong", _rare, "paper_wrong"),
)
