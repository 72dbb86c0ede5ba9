"""From robot and logs to the reduced model worth using, without a simulated robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from identifiability.estimation.estimate import Method, find_estimator
from identifiability.estimation.estimator import Estimator
from identifiability.estimation.prediction import Prediction
from identifiability.estimation.uncertainty import resample
from identifiability.estimation.verdict import Thresholds, withdraw
from identifiability.foundation.engines.mapping import Engine, Steps
from identifiability.foundation.errors import IdentifiabilityError, ModelError, listing, near_match
from identifiability.foundation.options import (
    Names,
    NotNegative,
    Positive,
    Replicates,
    Seed,
    checked,
)
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.longsamples import prepare_log
from identifiability.physical.feasibility import FittedModel, PhysicalResult, assess_feasibility
from identifiability.regression.information import Information, gather_information
from identifiability.regression.reduction import (
    LadderEntry,
    LadderLike,
    Rung,
    build_ladder,
    find_ladder,
    ladder_model,
    unused_ladder,
)
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike
from identifiability.workflows.analyze.assessment import RungResult, assess_ladder
from identifiability.workflows.analyze.cutoff_check import check_cutoff
from identifiability.workflows.analyze.words import WORSE
from identifiability.workflows.opening import (
    Logs,
    Opening,
    Progress,
    open_logs,
    read_recordings,
    running,
    share,
)
from identifiability.workflows.prune.absorption import absorb
from identifiability.workflows.prune.moves import Move
from identifiability.workflows.prune.prediction import RungErrors, plan_unseen, predict_rungs
from identifiability.workflows.prune.proposals import merge_moves, propose_moves
from identifiability.workflows.prune.result import Ladder
from identifiability.workflows.prune.rung import PrunedRung, build_rung, rung_of
from identifiability.workflows.prune.search import Search, Wishes, find_path
from identifiability.workflows.prune.selection import Criterion, good_steps, least_error
from identifiability.workflows.prune.stability import assess_stability
from identifiability.workflows.prune.unseen import unseen_regressor

#: Rungs as good as the best whose physical certificate is asked for, the preferred one first.
CERTIFIED = 4


@checked
def prune(
    robot: RobotLike,
    logs: Logs,
    validate: Logs = (),
    ladder: LadderLike | None = None,
    *,
    forbid: Names = (),
    force: Names = (),
    criterion: Criterion = "identifiable",
    propose: bool = True,
    reach: Positive = 1.0,
    preparation: Preparation | None = None,
    method: Method = "wls",
    replicates: Replicates = 200,
    cad_weight: NotNegative = 0.0,
    seed: Seed = 0,
    progress: Progress | None = None,
    engine: Engine | None = None,
) -> Ladder:
    """Reduce the full base model of a robot to the one worth using, from logs alone.

    Parameters
    ----------
    robot : Robot, path or shipped name
    logs : log, path, DataFrame, or several
        The size of the model is chosen on these only.
    validate : the same, optional
        Held out from everything; only reported.
    ladder : path, LadderEntry or result of `prune`, optional
        Its first model is where pruning starts; by default every base parameter with asymmetric
        friction.
    forbid : sequence of str
        Parameters that must not be dropped.
    force : sequence of str
        Parameters that are dropped whatever the data say.
    criterion : {"identifiable", "one-se-of-difference", "one-se", "best"}
        How much held-out error a smaller model may cost; see `selection.Criterion`.
    propose : bool
        Whether symmetries that the robot's kinematics suggest are tried.
    reach : float
        How many times faster than in the logs the robot is going to move with the model: what
        only slow motion shows badly weighs more then.
    preparation : Preparation, optional
        How derivatives are made.
    method : str or Estimator
        As for `analyze`.
    replicates : int
        Resampled logs on which the pruning is repeated.
    cad_weight : float
        As for `analyze`: keeps the nearest real robot near the robot file.
    seed : int
        Of every random choice.
    progress : callable(str, float), optional
        Called with what is being done and the share that is done.
    engine : Engine, optional
        Where stretches of logs that are too long for memory are worked on, and the resampled logs
        are pruned; by default in several processes and here. The result does not depend on it.

    Raises
    ------
    IdentifiabilityError
        With one sentence on what to do.
    """
    say = progress or (lambda _text, _share: None)
    estimator = find_estimator(method)
    streams = np.random.default_rng(seed).spawn(4)
    with threadpool_limits(1, "blas"), running(engine) as runner:
        robot = robot if isinstance(robot, Robot) else Robot.load(robot)
        source = find_ladder(robot, ladder, beside=False)
        say("reading logs", 0.0)
        recordings = read_recordings(logs, validate)
        structure = Structure.of(robot, ladder_model(source.entry), streams[0])
        reading = share(say, "reading logs", 0.0, 0.1)
        prepare = partial(prepare_log, robot, how=preparation, engine=runner, progress=reading)
        opening = open_logs(structure, recordings, prepare, "pruned")
        building = share(say, "building the regression", 0.1, 0.4)
        information = gather_information(opening.regression, engine=runner, progress=building)
        start = build_ladder(LadderEntry(models=source.entry.models[:1]), structure)[0]
        task = _Task(opening, information, start, estimator)
        say("walking down the ladder", 0.4)
        wishes = _check_wishes(task.start, forbid, force)
        search = _search(task, wishes, streams[1], propose=propose, reach=reach)
        chosen, physical = _choose(task, search, criterion, cad_weight)
        rungs, result, nothing, found = _measure(
            task, search, chosen, physical, streams[2], replicates, runner,
            share(say, "measuring errors", 0.5, 0.7),
        )  # fmt: skip
    with threadpool_limits(1, "blas"):
        if not opening.validation:
            result = replace(result, error_ra_validation=rungs[chosen].error_ra_unseen)
        say("resampling", 0.7)
        stability = assess_stability(
            search, search.path.steps[chosen].partition, criterion, streams[3],
            replicates=replicates, length=result.uncertainty.block,
            samples=task.information.samples, say=lambda s: say("resampling", 0.7 + 0.3 * s),
            engine=engine,
        )  # fmt: skip
        bands = check_cutoff(opening, recordings, result, estimator, preparation)
        absorption = absorb(
            task.start.reduce(task.information), rungs[0].estimate, rungs[chosen].estimate,
            search.path.steps[chosen].partition,
        )  # fmt: skip
        return Ladder(
            structure=structure,
            samples=opening.samples,
            validation=opening.validation,
            hints=(*opening.hints, *bands, *unused_ladder(robot, ladder)),
            information=task.information,
            start=task.start,
            rungs=rungs,
            selected=chosen,
            result=result,
            refused=search.path.refused,
            stability=stability,
            absorption=absorption,
            criterion=criterion,
            method=estimator.name,
            seed=seed,
            least=least_error(search.path.steps),
            source=source,
            settings={
                "forbid": list(forbid),
                "force": list(force),
                "propose": propose,
                "reach": reach,
                "replicates": replicates,
                "cad_weight": cad_weight,
                "preparation": preparation or Preparation(),
            },
            fitted=found[0],
            held_out=found[1],
            nothing=nothing,
        )


@frozen
class _Task:
    """What is pruned: a model, and what the logs say of all its base parameters."""

    opening: Opening
    information: Information
    start: Rung
    estimator: Estimator

    @property
    def structure(self) -> Structure:
        """The robot under the unpruned model."""
        return self.opening.structure


def _check_wishes(start: Rung, forbid: Sequence[str], force: Sequence[str]) -> Wishes:
    for name in (*forbid, *force):
        if name not in start.columns:
            raise ModelError(
                f"'{name}' is not a parameter that can be kept or dropped"
                f"{near_match(name, start.columns)} The model has {listing(start.columns)}."
            )
    both = sorted(set(forbid) & set(force))
    if both:
        raise ModelError(f"'{both[0]}' is to be kept and to be dropped; say which.")
    return Wishes(frozenset(forbid), tuple(force))


def _search(
    task: _Task, wishes: Wishes, rng: np.random.Generator, *, propose: bool, reach: float
) -> Search:
    start, structure = task.start, task.structure
    unseen = unseen_regressor(structure, task.opening.samples, rng, reach) @ start.M
    suggested: list[Move] = (
        propose_moves(structure, start.columns)
        if propose
        else merge_moves(structure.robot, start.columns)
    )
    return find_path(
        start.reduce(task.information), start.nonnegative, unseen=unseen, suggested=suggested,
        wishes=wishes, method=task.estimator,
    )  # fmt: skip


def _choose(
    task: _Task, search: Search, criterion: Criterion, cad_weight: float
) -> tuple[int, PhysicalResult]:
    """Return the step to use: the first as good as the best that a real robot can have."""
    steps = search.path.steps
    asked: list[tuple[int, PhysicalResult]] = []
    problem: IdentifiabilityError | None = None
    for k in good_steps(steps, criterion)[:CERTIFIED]:
        rung = rung_of(task.start, steps[k])
        fitted = FittedModel.of(task.structure, rung, task.information, task.estimator)
        try:
            physical = assess_feasibility(fitted, cad_weight)
        except IdentifiabilityError as error:
            problem = error
            continue
        if physical.feasible:
            return k, physical
        asked.append((k, physical))
    if asked:
        return asked[0]
    assert problem is not None
    raise problem


def _measure(
    task: _Task,
    search: Search,
    chosen: int,
    physical: PhysicalResult,
    rng: np.random.Generator,
    replicates: int,
    engine: Engine,
    progress: Steps,
) -> tuple[tuple[PrunedRung, ...], RungResult, str, tuple[Prediction, Prediction]]:
    """Return the rungs, the chosen one with verdicts, why no verdict is believed, its errors."""
    steps = search.path.steps
    models = [rung_of(task.start, s) for s in steps]
    parts = [m.reduce(task.information) for m in models]
    fits = [task.estimator.fit(p) for p in parts]
    opening = task.opening
    held = opening.structure.regression(opening.validation) if opening.validation else None
    found = predict_rungs(
        opening.regression, held, models, fits, chosen, physical,
        plan_unseen(search, task.start, task.information), engine=engine, progress=progress,
    )  # fmt: skip
    (result,) = assess_ladder(
        [models[chosen]], [fits[chosen]], task.information, [physical], found.chosen,
        found.chosen_held, task.structure.nominal_base, Thresholds(), rng, replicates,
    )  # fmt: skip
    spread = result.uncertainty
    times = float(spread.times.mean())
    fitted, unseen = (RungErrors.of(p, chosen, times) for p in (found.fitted, found.unseen))
    none = np.full(len(steps), np.nan)
    outside = none if found.outside is None else found.outside.relative_error()
    best = steps[least_error(steps)]
    unit = max(steps[0].errors.total, 1e-300)
    rungs = tuple(
        build_rung(
            steps[k], models[k], fits[k], parts[k],
            resample(parts[k], fits[k], spread.times, spread.block, rng, replicates),
            (float(fitted.error_ra[k]), float(unseen.error_ra[k]),
             float(unseen.difference_se[k]), float(outside[k])),
            best, unit,
        )
        for k in range(len(steps))
    )  # fmt: skip
    outer = found.unseen if found.outside is None else found.outside
    errors = (found.fitted.select([chosen]), outer.select([chosen]))
    if len(rungs[chosen]) and unseen.error_ra[chosen] < found.unseen.constant_error():
        return rungs, result, "", errors
    doubted = tuple(replace(r, verdicts=withdraw(r.verdicts, WORSE)) for r in rungs)
    return doubted, result.withdraw(WORSE), WORSE, errors
