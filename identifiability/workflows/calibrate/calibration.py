"""Operating characteristics on the user's own robot and motion.

How often do 95 % intervals of the model to use hold what their labels mean? How often is a
parameter that is called identifiable wrong by more than half? Truth is a robot around the likeliest
one, with what the model leaves out; noise is like the residual; the motion errs as the log's does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import chain, islice
from typing import Annotated

import numpy as np

from identifiability.estimation.instrumental import InstrumentalVariables
from identifiability.estimation.noise.residual_noise import ResidualNoise, find_runs
from identifiability.foundation.engines.local import Engine, Serial
from identifiability.foundation.engines.mapping import Steps
from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array
from identifiability.foundation.options import (
    Correlations,
    Levels,
    Replicates,
    Seed,
    at_least,
    checked,
    renamed,
    settle_count,
)
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, Samples
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.assessment import RungResult
from identifiability.workflows.calibrate.answer import Effect, compare, decide, find_remedy
from identifiability.workflows.calibrate.motion_errors import MotionErrors
from identifiability.workflows.calibrate.outcome import (
    Cell,
    Experiment,
    Outcome,
    Seeds,
    count_outcomes,
    spawn_seeds,
)
from identifiability.workflows.calibrate.ranks import check_ranks
from identifiability.workflows.calibrate.result import Calibration
from identifiability.workflows.calibrate.true_robots import TrueRobots
from identifiability.workflows.calibrate.world import (
    EVERYTHING,
    Cause,
    World,
    build_world,
    repeat,
)
from identifiability.workflows.diagnose import measure_false_names
from identifiability.workflows.opening import Progress, in_memory, require_signal, share

__all__ = ["Calibration", "calibrate"]

#: How many times more repetitions the first cell has, by which single parameters are judged.
FIRST = 4

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
    replicates: Annotated[int, at_least(2)] | None = None,
    refits: Replicates = 200,
    sbc: Annotated[int, at_least(0)] | None = None,
    names: Annotated[int, at_least(0)] | None = None,
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
        Simulated repetitions a cell; the first cell has `FIRST` times as many, because single
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
    trials = settle_count(replicates, 60, 8, quick=quick)
    sbc = settle_count(sbc, 1000, 200, quick=quick)
    names = settle_count(names, 40, 4, quick=quick)
    require_signal(analysis.samples, "calibrated")
    result = analysis.models[analysis.find_model(model or _asked(analysis))]
    *streams, last, making = np.random.default_rng(seed).spawn(len(noise) * len(rho) + 2)
    world, own = _world(analysis, result, refits, making)
    pairs = [(level, r) for r in rho for level in noise]
    counts = [FIRST * trials, *[trials] * (len(pairs) - 1)]
    seeds = [spawn_seeds(rng, count) for rng, count in zip(streams, counts, strict=True)]
    runner, say = engine or Serial(), progress or (lambda _text, _share: None)
    sizes = world.noise.sd

    def simulate(
        wanted: Sequence[tuple[ResidualNoise, Cause, Seeds]], steps: Steps
    ) -> list[list[tuple[Outcome, Array]]]:
        """Return the repetitions of each cell."""
        items = [
            (like, causes, own[k : k + BATCH])
            for like, causes, own in wanted
            for k in range(0, len(own), BATCH)
        ]
        found = chain.from_iterable(runner.map(partial(repeat, world), items, progress=steps))
        return [list(islice(found, len(own))) for _, _, own in wanted]

    def count(trials: Sequence[tuple[Outcome, Array]], level: float, r: float) -> Cell:
        outcomes, truths = zip(*trials, strict=True)
        return count_outcomes(outcomes, result.rung.columns, np.array(truths), level, r)

    like = [world.noise if np.isnan(r) else ResidualNoise.first_order(sizes, r) for _, r in pairs]
    wanted = [
        (n.scaled(level), EVERYTHING, own_seeds)
        for n, (level, _), own_seeds in zip(like, pairs, seeds, strict=True)
    ]
    found = simulate(wanted, share(say, "simulating repetitions", 0.0, 0.7))
    cells = tuple(count(f, *pair) for f, pair in zip(found, pairs, strict=True))
    effects: tuple[Effect, ...] = ()
    if not analysis.nothing and decide(cells[0]) == "no":
        again = [(wanted[0][0], EVERYTHING & ~cause, seeds[0][: 2 * trials]) for cause in Cause]
        remedy = partial(
            find_remedy,
            instruments=isinstance(result.estimate.estimator, InstrumentalVariables),
            record=all(m.exact for m in world.motion),
            rates=all(m.log.dq is not None and m.log.ddq is not None for m in world.motion),
        )
        looking = share(say, "looking for the cause", 0.7, 0.9)
        effects = tuple(
            compare(cause, count(f, *pairs[0]), found[0][: 2 * trials], f, cells[0], remedy(cause))
            for cause, f in zip(Cause, simulate(again, looking), strict=True)
        )
    ranks, named, unmeasured = None, None, ""
    if sbc:
        ranking = share(say, "ranking planted values", 0.9, 1.0)
        part = result.rung.reduce(analysis.information)
        ranks = check_ranks(result, part, last, replicates=sbc, engine=runner, progress=ranking)
    if names:
        asked = analysis.settings.get("preparation")
        how = asked if isinstance(asked, Preparation) and asked != Preparation() else None
        try:
            named = measure_false_names(
                analysis.robot,
                analysis.recordings,
                model=analysis.effects,
                trials=names,
                seed=seed,
                preparation=how,
                progress=progress,
                engine=runner,
            )
        except LogError as error:  # too short a log has no part to verify names on
            unmeasured = f"How often a name is false was not measured: {error}"
    numbers = {"replicates": trials, "refits": refits, "sbc": sbc, "names": names}
    return Calibration(
        robot=analysis.robot.name,
        model=result.name,
        parameters=len(result.rung),
        cells=cells,
        seed=seed,
        ranks=ranks,
        joints=analysis.robot.joints,
        own=own,
        false_names=named,
        unmeasured=unmeasured,
        provenance=analysis.provenance | {k: str(v) for k, v in {"seed": seed, **numbers}.items()},
        hints=analysis.hints,
        effects=effects,
        nothing=analysis.nothing,
        analysis=analysis,
    )


def _asked(analysis: Analysis) -> str:
    """Return the model of a model file, else the one to use."""
    entry = None if analysis.source is None else analysis.source.entry.models
    return entry[0].name if entry and len(entry) == 1 else analysis.chosen.name


def _world(
    analysis: Analysis, result: RungResult, replicates: int, rng: np.random.Generator
) -> tuple[World, ResidualNoise]:
    """Return the world that is like the logs, and the noise that the residual is like."""
    samples = in_memory(analysis.samples, Samples)
    how = analysis.settings.get("preparation")
    how = how if isinstance(how, Preparation) else Preparation()
    experiment = replace(
        Experiment.of(analysis.regression, result.rung),
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
