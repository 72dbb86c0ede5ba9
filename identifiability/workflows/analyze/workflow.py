"""The main job: robot and logs in, one verdict per parameter and a model to use out."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from identifiability.estimation.estimate import Kind, Method, find_estimator, settle_noise
from identifiability.estimation.prediction import Task, predict, predict_all
from identifiability.estimation.verdict import Thresholds
from identifiability.foundation.engines.mapping import Engine, one_thread
from identifiability.foundation.options import (
    NotNegative,
    Replicates,
    Seed,
    checked,
    renamed,
    settle_count,
)
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.longsamples import prepare_log
from identifiability.logs.repeats import Recording
from identifiability.regression.gather import gather_information
from identifiability.regression.reduction import (
    LadderLike,
    build_comparison,
    find_ladder,
    ladder_model,
)
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike
from identifiability.workflows.analyze.assessment import (
    assess_ladder,
    select_model,
    tell_with_file,
)
from identifiability.workflows.analyze.belief import believe
from identifiability.workflows.analyze.cutoff_check import check_cutoff
from identifiability.workflows.analyze.fit import (
    DelayErrors,
    fit_ladder,
    follow_fitted,
    settle_prior,
    weigh_rows,
)
from identifiability.workflows.analyze.result import Analysis
from identifiability.workflows.analyze.words import compare_logs, doubt, state_weak
from identifiability.workflows.band import settle_band
from identifiability.workflows.gravity import Leaning, find_leaning, state_leaning
from identifiability.workflows.instruments import add_instruments
from identifiability.workflows.oddities import MeasuredLogs
from identifiability.workflows.opening import (
    Logs,
    Opening,
    Progress,
    find_missing,
    open_logs,
    read_recordings,
    running,
    share,
)


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
        Held out; without them errors come from blocked cross-validation.
    ladder : path, LadderEntry or result of `prune`, optional
        Models to compare, each also with the unpruned one; by default the ladder beside the robot
        file, else the default one, with torque offsets and without (of logs that hold commands and
        no torque with them).
    preparation : Preparation, optional
        How derivatives are made.
    method : str or Estimator
        ``"wls"`` weights actuators by 1 / (variance × memory) of their noise, ``"ols"`` all alike.
    estimator : {"auto", "ls", "iv"}
        Least squares, or instrumental variables, which noise in the motion does not bias; ``auto``
        takes the latter if any log has a second record of its motion
        (`logs.prepare.instruments`), and else corrects the former by what new noise of the motion
        does to it (`logs.prepare.echo`).
    replicates : int, optional
        Refits of the block bootstrap, 0 for none; by default 2000, or 200 if `quick`.
    posterior : bool
        Also sample the posteriors of the selected model; costs two to three times the rest. Off
        everywhere unless asked for: it says more of what the data leave open, and never changes a
        verdict on what they determine.
    cad_prior : float, optional
        Weight of a log-det prior around the bodies of the robot file when the nearest real robot
        is sought [σ²]; 0 for none. By default the heaviest that predicts stretches of the fitted
        logs as well as the best (`physical.feasibility.choose_prior`).
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
    say = progress or (lambda _text, _share: None)
    base, draws = find_estimator(method), settle_count(replicates, 2000, 200, quick=quick)
    streams = np.random.default_rng(seed).spawn(3)
    with one_thread("blas"):
        robot = robot if isinstance(robot, Robot) else Robot.load(robot)
        source = find_ladder(robot, ladder, beside=True)
        with running(engine) as runner:  # workers are gone when their memory is wanted elsewhere
            say("reading logs", 0.0)
            recordings = read_recordings(
                logs, validate, Conventions.of(robot), preparation, commands=True
            )
            structure = Structure.of(robot, ladder_model(source.entry), streams[0])
            how = settle_band(structure, recordings.fitted, preparation)
            share_, cad_prior = settle_prior(prior, cad_prior, recordings.commanded)
            recordings = follow_fitted(
                recordings,
                structure,
                how,
                streams[0],
                say,
                method=base,
                kind=estimator,
                cad_weight=cad_prior,
                engine=runner,
            )
            reading = share(say, "reading logs", 0.1, 0.3)
            opening = open_logs(
                structure,
                recordings,
                partial(prepare_log, robot, how=how, engine=runner, progress=reading),
            )
            opening, chosen = add_instruments(opening, recordings.fitted, base, estimator)
            structure = opening.structure
            rungs = build_comparison(source.settle(commanded=recordings.commanded), structure)
            regression, silence = opening.regression, opening.silence
            information = gather_information(
                regression,
                engine=runner,
                progress=share(say, "building the regression", 0.3, 0.6),
            )
            say("fitting models", 0.6)
            burst, late = "", DelayErrors.of(opening, recordings, information, chosen, how)
            if not silence:
                information, burst = weigh_rows(robot.joints, opening.samples, information, chosen)
                chosen = settle_noise(chosen, information)
            ladder_ = fit_ladder(structure, rungs, information, chosen, cad_prior, silence)
            models, values = ladder_.models, ladder_.values
            tasks = [Task(values[None])]
            if not opening.validation and not silence:
                tasks.append(ladder_.in_turns())
            predicting = share(say, "predicting torque", 0.65, 0.9)
            fitted, *crossed = predict_all(regression, tasks, engine=runner, progress=predicting)
            del tasks  # with the folds, whose memory the judging needs
            if opening.validation:
                held = structure.regression(opening.validation)
                crossed = [predict(held, values[:, : 2 * len(models)], engine=runner)]
        say("judging parameters", 0.9)
        thresholds, (out,) = Thresholds(), crossed or (fitted,)
        results = assess_ladder(
            models,
            ladder_.robots,
            fitted,
            out,
            thresholds,
            streams[1],
            draws,
            missing := find_missing(opening),
            veto=bool(opening.validation),
            late=late.move,
        )
        at = select_model(results, ladder_.near)
        results, contradicted = tell_with_file(models, results, share_, thresholds)
        results, nothing = doubt(silence or opening.misread, results, at, out)
        leaning, leans = _seek_leaning(opening, recordings.fitted, nothing)
        several = compare_logs(robot.joints, opening.samples, information, results[at])
        belief = None
        if posterior:
            results, belief = believe(
                structure, information, results, at, streams[2], say, silence or opening.misread
            )
        # Exchanged columns, a wrong unit or late torque explain whatever else is odd.
        after = (
            ()
            if opening.explained
            else (state_weak(results[at]), several.hint, results[at].warning)
        )
        return Analysis(
            structure=structure,
            samples=opening.samples,
            validation=opening.validation,
            hints=tuple(
                filter(
                    None,
                    (
                        *leans,
                        *opening.hints,
                        burst,
                        contradicted[at],
                        ladder_.short,
                        # Torque that was calibrated at one cut-off is not that of another.
                        *(
                            ()
                            if recordings.commanded
                            else check_cutoff(opening, recordings, results[at], how)
                        ),
                        *after,
                        belief.hint if belief else None,
                    ),
                )
            ),
            information=information,
            folds=ladder_.folds,
            models=results,
            selected=at,
            fitted=fitted.select(range(len(rungs))),
            held_out=out.select(range(len(rungs))),
            method=base.name,
            seed=seed,
            belief=belief,
            thresholds=thresholds,
            source=source,
            settings={
                "estimator": estimator,
                "replicates": draws,
                "posterior": posterior,
                "cad_prior": cad_prior,
                "prior": share_,
                "preparation": preparation or Preparation(),
            },
            nothing=nothing,
            recordings=recordings.fitted,
            several=several,
            leaning=leaning,
            missing=missing,
            commands=opening.commands,
            moved=recordings.measure_rollouts(robot, results[at].physical.parameters()),
            late=late.move(models[0].rung) @ models[0].rung.M.T,
        )


def _seek_leaning(
    opening: Opening, recordings: Sequence[Recording], nothing: str
) -> tuple[Leaning | None, tuple[str, ...]]:
    """Return where gravity points, and that in words, if no value is believed and it differs."""
    if not nothing or opening.silence:
        return None, ()
    found = find_leaning(MeasuredLogs(opening.structure, tuple(recordings), opening.samples))
    return found, () if found is None else (state_leaning(found),)
