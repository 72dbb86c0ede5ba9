"""The main job: robot and logs in, one verdict per parameter and a model to use out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.estimation.estimate import Kind, Method, find_estimator, settle_noise
from identifiability.estimation.prediction import Task, predict, predict_all
from identifiability.estimation.rules import Thresholds
from identifiability.foundation.engines.mapping import Engine, one_thread
from identifiability.foundation.errors import ModelError
from identifiability.foundation.options import (
    NotNegative,
    Replicates,
    Seed,
    checked,
    renamed,
    settle_count,
)
from identifiability.logs.prepare import Preparation
from identifiability.regression.reduction import (
    LadderLike,
    Submodel,
    build_comparison,
    find_ladder,
    ladder_model,
)
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike
from identifiability.workflows.analyze.assessment import assess_ladder, select_model, tell_with_file
from identifiability.workflows.analyze.belief import believe
from identifiability.workflows.analyze.fit import SharedErrors, fit_ladder, say_band
from identifiability.workflows.analyze.result import Analysis
from identifiability.workflows.analyze.words import compare_logs, doubt, state_mounting, state_weak
from identifiability.workflows.opening import Logs, Progress, find_missing, quiet, running, share
from identifiability.workflows.session import Session, Weighed, settle_prior


@renamed(cad_weight="cad_prior")
@checked
def analyze(
    robot: RobotLike,
    logs: Logs,
    validate: Logs = (),
    ladder: LadderLike | None = None,
    *,
    preparation: Preparation | None = None,
    method: Method = "wls",
    estimator: Kind = "auto",
    replicates: Replicates | None = None,
    posterior: bool = False,
    cad_prior: NotNegative | None = None,
    prior: NotNegative | None = None,
    seed: Seed = 0,
    progress: Progress | None = None,
    engine: Engine | None = None,
    quick: bool = False,
) -> Analysis:
    """Say which parameters the logs determine, and which model of a ladder to use.

    Parameters
    ----------
    robot : Robot, path or shipped name
    logs : log, path, DataFrame, or several
        Fitted to.
    validate : the same, optional
        Logs held out; without them errors come from blocked cross-validation.
    ladder : path, LadderEntry or result of `prune`, optional
        Models to compare, each also with the unpruned one; by default the ladder beside the robot
        file, else the default one, with torque offsets and without (of logs that hold commands and
        no torque with them).
    preparation : Preparation, optional
        How derivatives are made.
    method : str or Estimator
        Weight actuators by 1 / (variance × memory) of their noise (``wls``), or all alike
        (``ols``).
    estimator : {"auto", "ls", "iv"}
        Least squares, or instrumental variables, which noise in the motion does not bias; ``auto``
        takes the latter if any log has a second record of its motion.
    replicates : int, optional
        Refits of the block bootstrap, 0 for none; by default 2000, or 200 if `quick`.
    posterior : bool
        Also sample the posteriors of the selected model; costs two to three times the rest. Off
        everywhere unless asked for: it says more of what the data leave open, and never changes a
        verdict on what they determine.
    cad_prior : float, optional
        Weight of a log-det prior around the bodies of the robot file when the nearest real robot
        is sought [σ²]; 0 for none. By default the heaviest that predicts stretches of the fitted
        logs as well as the best.
    prior : float, optional
        Share within which the bodies are those of the robot file, such as 0.2: it is a `cad_prior`
        of 1 / (2 share²), and verdicts say what it narrows. By default 0.2 where logs hold commands
        and no torque, and none where they hold torque; 0 for none.
    seed : int
        Of every random choice.
    progress : callable(str, float), optional
        Called with what is being done and the share that is done.
    engine : Engine, optional
        Where stretches of logs that are too long for memory are worked on; by default in several
        processes.
    quick : bool
        Fewer replicates, where nobody says how many.

    Raises
    ------
    IdentifiabilityError
        With one sentence on what to do.
    """
    say, base = progress or quiet, find_estimator(method)
    draws = settle_count(replicates, 2000, 200, quick=quick)
    streams = np.random.default_rng(seed).spawn(3)
    with one_thread("blas"):
        robot = Robot.of(robot)
        source = find_ladder(robot, ladder, beside=True)
        with running(engine) as runner:  # workers are gone when their memory is wanted elsewhere
            structure = Structure.of(robot, ladder_model(source.entry), streams[0])
            session = Session.read(structure, logs, validate, preparation, say, runner)
            commanded = session.recordings.commanded
            share_, cad_prior = settle_prior(prior, cad_prior, commanded)
            session = session.follow_fitted(streams[0], base, estimator, cad_prior)
            given, (session, opening) = session, session.settle()
            entry, other = source.settle(commanded=commanded), opening.alternative
            try:
                submodels = build_comparison(entry, opening.structure)
            except ModelError:
                if other is None:
                    raise
                # Its models are of parameters that there are under the model as it was given.
                session, opening = given, given.open(seek=False)
                opening = replace(opening, hints=(other.statement, *opening.hints))
                submodels = build_comparison(entry, opening.structure)
            rows = session.weigh(opening, base, estimator)
            settings = {
                "estimator": estimator,
                "replicates": draws,
                "posterior": posterior,
                "cad_prior": cad_prior,
                "prior": share_,
                "preparation": preparation or Preparation(),
            }
            how = {"method": base.name, "seed": seed, "settings": settings}
            told = streams[1], draws, cad_prior, share_, how
            found = _conclude(session, rows, submodels, *told)
        moved = session.recordings.measure_rollouts(
            session.structure.robot, found.chosen.physical.parameters()
        )
        found = replace(found, source=source, moved=moved)
        return _sample(found, streams[2], say, share_) if posterior else found


def _sample(found: Analysis, rng: np.random.Generator, say: Progress, within: float) -> Analysis:
    """Return the analysis with the posteriors of the selected model, bodies within a share."""
    known = found.structure, found.information, found.models, found.selected
    models, belief = believe(*known, rng, say, found.silence or found.misread, within)
    hint = (belief.hint,) if belief and belief.hint else ()
    return replace(found, models=models, belief=belief, hints=(*found.hints, *hint))


def _conclude(
    session: Session,
    rows: Weighed,
    submodels: Sequence[Submodel],
    rng: np.random.Generator,
    draws: int,
    cad_prior: float | None,
    within: float,
    how: Mapping[str, Any],
) -> Analysis:
    """Fit the models, predict torque by them, judge every parameter and choose one model.

    Parameters
    ----------
    session : Session
    rows : Weighed
    submodels : sequence of Submodel
    rng : numpy.random.Generator
    draws : int
        Of the bootstrap.
    cad_prior : float or None
    within : float
        Share within which bodies are the file's, 0 for none.
    how : mapping
        As asked for.
    """
    say, engine, opening = session.say, session.engine, rows.opening
    say("fitting models", 0.6)
    delays, estimator = SharedErrors.of(session, rows), rows.estimator
    if not opening.silence:
        estimator = settle_noise(estimator, rows.information)
    ladder = fit_ladder(
        opening.structure, submodels, rows.information, estimator, cad_prior, opening.silence
    )
    values = ladder.values
    tasks = [Task(values[None])]
    if not opening.validation and not opening.silence:
        tasks.append(ladder.in_turns())
    predicting = share(say, "predicting torque", 0.65, 0.9)
    fitted, *others = predict_all(opening.regression, tasks, engine=engine, progress=predicting)
    if opening.unseen is not None:
        others = [predict(opening.unseen, values[:, : 2 * len(ladder.models)], engine=engine)]
    out = (others or [fitted])[0]
    recordings, thresholds = session.recordings, Thresholds()
    missing = find_missing(opening)
    results = assess_ladder(
        ladder.models,
        ladder.robots,
        fitted,
        out,
        thresholds,
        rng,
        draws,
        missing,
        late=delays.move,
        judged=ladder.judged,
    )
    at = select_model(results, ladder.near)
    results, contradicted = tell_with_file(ladder.models, results, within, thresholds)
    results, nothing = doubt(opening.silence or opening.misread, results, at, out)
    several = compare_logs(opening.samples, results[at])
    hints = [*opening.hints, rows.burst, contradicted[at], ladder.short]
    hints += () if recordings.commanded else say_band(session.how)
    if not opening.explained:  # exchanged columns, a wrong unit or late torque explain the rest
        mounting = state_mounting(session.structure.robot, results[at].verdicts)
        hints += [state_weak(results[at]), mounting, several.hint, results[at].warning]
    whole = ladder.models[0].submodel
    return Analysis(
        structure=opening.structure,
        samples=opening.samples,
        validation=opening.validation,
        hints=tuple(filter(None, hints)),
        information=rows.information,
        folds=ladder.folds,
        models=results,
        selected=at,
        fitted=fitted.select(range(len(results))),
        held_out=out.select(range(len(results))),
        **how,
        thresholds=thresholds,
        nothing=nothing,
        recordings=recordings.fitted,
        several=several,
        missing=missing,
        commands=opening.commands,
        rolled=recordings.rolled,
        late=delays.together(whole) @ whole.M.T,
    )
