"""From robot and logs to the reduced model worth using, without a simulated robot."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from identifiability.estimation.estimate import Kind, Method, find_estimator, settle_noise
from identifiability.estimation.evidence import Held, Score, near_best
from identifiability.estimation.least_squares import Noise
from identifiability.foundation.engines.mapping import Engine, one_thread
from identifiability.foundation.errors import IdentifiabilityError, ModelError, listing, near_match
from identifiability.foundation.options import (
    Names,
    NotNegative,
    Positive,
    Replicates,
    Seed,
    checked,
    renamed,
    settle_count,
)
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.longsamples import prepare_log
from identifiability.logs.prepare.samples import find_signal
from identifiability.physical.certify import Certificate
from identifiability.physical.feasibility import PhysicalResult, certify_model, choose_prior
from identifiability.physical.fitted_model import FittedModel
from identifiability.regression.gather import gather_information
from identifiability.regression.reduction import (
    LadderEntry,
    LadderLike,
    Rung,
    build_ladder,
    find_ladder,
    full_rung,
    ladder_model,
    unused_ladder,
)
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike
from identifiability.workflows.analyze.cutoff_check import check_cutoff
from identifiability.workflows.analyze.fit import (
    DelayErrors,
    follow_fitted,
    settle_prior,
    settle_robot,
    weigh_rows,
)
from identifiability.workflows.analyze.words import compare_logs, state_weak
from identifiability.workflows.band import settle_band
from identifiability.workflows.instruments import add_instruments
from identifiability.workflows.opening import (
    Logs,
    Progress,
    open_logs,
    read_recordings,
    running,
    share,
)
from identifiability.workflows.prune.elimination import (
    Criterion,
    Search,
    Step,
    best_step,
    find_path,
    good_steps,
)
from identifiability.workflows.prune.moves import merge_moves, propose_moves
from identifiability.workflows.prune.result import Ladder
from identifiability.workflows.prune.rung import (
    Question,
    absorb,
    assess_stability,
    contradicts,
    measure_rungs,
    state_disagreement,
    state_foreign,
)

#: A step, its model, and the certificate with its sentence.
Candidate = tuple[int, FittedModel, tuple[Certificate | None, str]]

#: Rungs as good as the best whose physical certificate is asked for, the preferred one first.
CERTIFIED = 4

IDLE_REACH = (
    "The option 'reach' does nothing any more: the model is chosen by what it predicts of "
    "stretches of the logs; log the faster motion to be sure of it."
)


@renamed(cad_weight="cad_prior")
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
    estimator: Kind = "auto",
    replicates: Replicates | None = None,
    cad_prior: NotNegative | None = None,
    prior: NotNegative | None = None,
    seed: Seed = 0,
    progress: Progress | None = None,
    engine: Engine | None = None,
    quick: bool = False,
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
        Its first model is where pruning starts; by default every base parameter, with
        torque offsets.
    forbid : sequence of str
        Parameters that must not be dropped.
    force : sequence of str
        Parameters that are dropped whatever the data say.
    criterion : {"identifiable", "one-se-of-difference", "one-se", "best"}
        How much held-out error a smaller model may cost; see `search.Criterion`.
    propose : bool
        Whether symmetries that the robot's kinematics suggest are tried.
    reach : float
        Does nothing any more: models are chosen by what they predict of the logs, not of motion
        that nobody has seen. Other values than 1 are noted among the hints.
    preparation : Preparation, optional
        How derivatives are made.
    method : str or Estimator
    estimator : {"auto", "ls", "iv"}
        As for `analyze`.
    replicates : int, optional
        Resampled logs on which the pruning is repeated; by default 200, or 20 if `quick`.
    cad_prior : float, optional
        As for `analyze`: keeps the nearest real robot near the robot file.
    prior : float, optional
        The same as the share within which the bodies are the file's, as for `analyze`.
    seed : int
        Of every random choice.
    progress : callable(str, float), optional
        Called with what is being done and the share that is done.
    engine : Engine, optional
        Where stretches of logs that are too long for memory are worked on, and the resampled logs
        are pruned; by default in several processes and here. The result does not depend on it.
    quick : bool
        Fewer replicates, where nobody says how many.

    Raises
    ------
    IdentifiabilityError
        With one sentence on what to do.
    """
    say = progress or (lambda _text, _share: None)
    base, draws = find_estimator(method), settle_count(replicates, 200, 20, quick=quick)
    streams = np.random.default_rng(seed).spawn(4)
    with one_thread("blas"), running(engine) as runner:
        robot = robot if isinstance(robot, Robot) else Robot.load(robot)
        source = find_ladder(robot, ladder, beside=False)
        say("reading logs", 0.0)
        recordings = read_recordings(
            logs, validate, Conventions.of(robot), preparation, commands=True
        )
        structure = Structure.of(robot, ladder_model(source.entry), streams[0])
        reading = share(say, "reading logs", 0.0, 0.1)
        how = settle_band(structure, recordings.fitted, preparation)
        prior, cad_prior = settle_prior(prior, cad_prior, recordings.commanded)
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
        prepare = partial(prepare_log, robot, how=how, engine=runner, progress=reading)
        opening = open_logs(structure, recordings, prepare, "pruned")
        opening, asked = add_instruments(opening, recordings.fitted, base, estimator)
        building = share(say, "building the regression", 0.1, 0.4)
        information = gather_information(opening.regression, engine=runner, progress=building)
        start = build_ladder(LadderEntry(models=source.entry.models[:1]), structure)[0]
        variation = information.variation * find_signal([s.survey for s in opening.samples])
        delays = DelayErrors.of(opening, recordings, information, asked, how)
        information, burst = weigh_rows(robot.joints, opening.samples, information, asked)
        asked = settle_noise(asked, start.reduce(information))
        question = Question(
            opening=opening, information=information, start=start, estimator=asked, delays=delays
        )
        say("walking down the ladder", 0.4)
        _check_wishes(start, forbid, force)
        suggest = propose_moves if propose else merge_moves
        search = find_path(
            start.reduce(information),
            start.nonnegative,
            variation=variation,
            suggested=suggest(structure, start.columns),
            forbid=forbid,
            force=force,
            method=asked,
        )
        selected, physical = _choose(question, search, criterion, cad_prior)
        measuring = share(say, "measuring errors", 0.5, 0.7)
        measured = measure_rungs(
            question, search, selected, physical, draws, streams[2], runner, measuring
        )
    with one_thread("blas"):
        say("resampling", 0.7)
        chosen = measured.rungs[selected]
        stability = assess_stability(
            search,
            chosen.step.partition,
            criterion,
            streams[3],
            replicates=draws,
            length=measured.result.uncertainty.block,
            progress=share(say, "resampling", 0.7, 1.0),
            engine=engine,
        )
        bands = check_cutoff(opening, recordings, measured.result, how)
        compared = compare_logs(robot.joints, opening.samples, information, measured.result)
        several = filter(None, [compared.hint])
        part, full = start.reduce(information), measured.rungs[0].estimate
        result = measured.result
        said = filter(None, (burst, state_weak(result)))
        idle = (IDLE_REACH,) if reach != 1.0 else ()
        return Ladder(
            structure=structure,
            samples=opening.samples,
            validation=opening.validation,
            hints=(
                *idle,
                *state_foreign(measured),
                *state_disagreement(measured),
                *said,
                *opening.hints,
                *bands,
                *several,
                *unused_ladder(robot, ladder),
            ),
            commands=opening.commands,
            information=information,
            start=start,
            selected=selected,
            least=best_step(search.path.steps),
            refused=search.path.refused,
            stability=stability,
            absorption=absorb(part, full, chosen.estimate, chosen.step.partition),
            criterion=criterion,
            method=base.name,
            seed=seed,
            source=source,
            settings={
                "estimator": estimator,
                "forbid": list(forbid),
                "force": list(force),
                "propose": propose,
                "reach": reach,
                "replicates": draws,
                "cad_prior": cad_prior,
                "prior": prior,
                "preparation": preparation or Preparation(),
            },
            moved=recordings.measure_rollouts(robot, result.physical.parameters()),
            late=delays.move(full_rung(structure.base)),
            **vars(measured),
        )


def _check_wishes(start: Rung, forbid: Sequence[str], force: Sequence[str]) -> None:
    for name in (*forbid, *force):
        if name not in start.columns:
            raise ModelError(
                f"'{name}' is not a parameter that can be kept or dropped"
                f"{near_match(name, start.columns)} The model has {listing(start.columns)}."
            )
    both = sorted(set(forbid) & set(force))
    if both:
        raise ModelError(f"'{both[0]}' is to be kept and to be dropped; say which.")


def _choose(
    question: Question, search: Search, criterion: Criterion, cad_prior: float | None
) -> tuple[int, PhysicalResult]:
    """Return the step to use: the first as good as the best that a real robot can have."""
    steps = search.path.steps
    asked: list[Candidate] = []
    problems: list[IdentifiabilityError] = []
    good = good_steps(steps, criterion)
    sound = [k for k in good if not contradicts(question.fit(steps[k]), question.full)]
    for k in (sound or good)[:CERTIFIED]:
        model = question.fit(steps[k])
        try:
            asked.append((k, model, certify_model(model)))
        except IdentifiabilityError as error:
            problems.append(error)
            continue
        if asked[-1][2][0] is not None and asked[-1][2][0].feasible:
            break
    if not asked:
        raise problems[-1]
    feasible = [a for a in asked if a[2][0] is not None and a[2][0].feasible]
    noise = Noise(search.full.variance, search.full.times)
    held = Held.of(question.information, noise, search.whitened.folds)
    if not feasible and criterion == "identifiable":
        feasible = _find_possible(question, steps, asked[0][0], held)
    k, model, proved = (feasible or asked)[0]
    return k, settle_robot(model, held, cad_prior).robot.with_certificate(*proved)


def _find_possible(
    question: Question, steps: Sequence[Step], impossible: int, held: Held
) -> list[Candidate]:
    """Return the largest smaller model whose values a real robot has, if it predicts as well.

    What a model with impossible values says of the robot is its nearest real robot, and that of a
    smaller one has what its bodies cannot do without: the two are compared.
    """
    best = _score_robot(question.fit(steps[impossible]), held)
    for k, step in list(enumerate(steps))[impossible + 1 :][:CERTIFIED]:
        model = question.fit(step)
        try:
            proved = certify_model(model)
        except IdentifiabilityError:
            continue
        if proved[0] is not None and proved[0].feasible:
            own = _score_robot(model, held)
            near = best is not None and own is not None and near_best([own, best])[0]
            return [(k, model, proved)] if near else []
    return []


def _score_robot(model: FittedModel, held: Held) -> Score | None:
    """Return what the nearest real robot predicts; None where there is none."""
    fit, rung = model.estimate, model.rung
    found = choose_prior(model, held, held.score_fit(fit, rung.M, rung.held))
    return None if found is None else found.score
