"""From robot and logs to the reduced model worth using, without a simulated robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np

from identifiability.estimation.estimate import Kind, Method, find_estimator, settle_noise
from identifiability.estimation.evidence import HeldOut, Score, near_best
from identifiability.estimation.least_squares import Noise
from identifiability.foundation.engines.mapping import Engine, one_thread
from identifiability.foundation.errors import IdentifiabilityError, ModelError, listing, near_match
from identifiability.foundation.options import (
    Names,
    NotNegative,
    Replicates,
    Seed,
    checked,
    renamed,
    settle_count,
)
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.samples import find_signal
from identifiability.physical.feasibility import (
    Certificate,
    PhysicalResult,
    certify_model,
    choose_prior,
)
from identifiability.physical.fitted_model import FittedModel
from identifiability.regression.reduction import (
    LadderEntry,
    LadderLike,
    Submodel,
    build_ladder,
    find_ladder,
    full_model,
    ladder_model,
    unused_ladder,
)
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike
from identifiability.workflows.analyze.fit import DelayErrors, check_cutoff, settle_robot
from identifiability.workflows.analyze.words import compare_logs, state_mounting, state_weak
from identifiability.workflows.opening import Logs, Progress, quiet, running, share
from identifiability.workflows.prune.elimination import (
    Search,
    Step,
    best_step,
    find_path,
    good_steps,
)
from identifiability.workflows.prune.models import (
    Measured,
    Question,
    Stability,
    absorb,
    assess_stability,
    contradicts,
    count_walks,
    measure_models,
    state_disagreement,
    state_foreign,
    thin_path,
)
from identifiability.workflows.prune.moves import propose_moves
from identifiability.workflows.prune.result import Ladder
from identifiability.workflows.session import Session, Weighed, settle_prior

#: A step, its model, and the certificate with its sentence.
Candidate = tuple[int, FittedModel, tuple[Certificate | None, str]]

#: Models as good as the best whose physical certificate is asked for, the preferred one first.
CERTIFIED = 4


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
        Logs held out from everything, which are only reported on.
    ladder : path, LadderEntry or result of `prune`, optional
        Its first model is where pruning starts; by default every base parameter, with
        torque offsets.
    forbid : sequence of str
        Parameters that must not be dropped.
    force : sequence of str
        Parameters that are dropped whatever the data say.
    preparation : Preparation, optional
        How derivatives are made.
    method : str or Estimator
        As for `analyze`.
    estimator : {"auto", "ls", "iv"}
        As for `analyze`.
    replicates : int, optional
        Resampled logs on which the pruning is repeated; by default 200, or 20 if `quick`, and fewer
        of more than 128 parameters.
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
    say, base = progress or quiet, find_estimator(method)
    draws = settle_count(replicates, 200, 20, quick=quick)
    streams = np.random.default_rng(seed).spawn(4)
    with one_thread("blas"):
        with running(engine) as runner:
            robot = Robot.of(robot)
            source = find_ladder(robot, ladder, beside=False)
            structure = Structure.of(robot, ladder_model(source.entry), streams[0])
            session = Session.read(structure, logs, validate, preparation, say, runner)
            commanded = session.recordings.commanded
            share_, cad_prior = settle_prior(prior, cad_prior, commanded)
            session = session.follow_fitted(streams[0], base, estimator, cad_prior)
            session, opening = session.settle("pruned")
            rows = session.weigh(opening, base, estimator)
            question = _ask(session, rows, source.entry)
            search = _walk(session, rows, question, forbid, force)
            selected, physical = _choose(question, search, cad_prior)
            search, selected, thinned = thin_path(search, selected)
            measuring = share(say, "measuring errors", 0.5, 0.7)
            measured = measure_models(
                question, search, selected, physical, draws, streams[2], runner, measuring
            )
        say("resampling", 0.7)
        measured, contradicted = measured.beside_file(question, share_)
        stability = assess_stability(
            search,
            measured.models[selected].step.partition,
            streams[3],
            replicates=count_walks(search, draws) if replicates is None else draws,
            length=measured.result.uncertainty.block,
            progress=share(say, "resampling", 0.7, 1.0),
            engine=engine,
        )
        settings = {
            "estimator": estimator,
            "forbid": list(forbid),
            "force": list(force),
            "replicates": draws,
            "cad_prior": cad_prior,
            "prior": share_,
            "preparation": preparation or Preparation(),
        }
        known = {"method": base.name, "seed": seed, "source": source, "settings": settings}
        found = _tell(session, rows, question, search, selected, measured, stability, known)
        first = 2 * (rows.opening.alternative is not None)  # under what all is said
        told = filter(None, (*found.hints[:first], contradicted, *found.hints[first:], thinned))
        return replace(found, hints=(*told, *unused_ladder(robot, ladder)))


def _ask(session: Session, rows: Weighed, entry: LadderEntry) -> Question:
    """Return where pruning starts, and by what it fits."""
    start = build_ladder(LadderEntry(models=entry.models[:1]), session.structure)[0]
    return Question(
        opening=rows.opening,
        information=rows.information,
        start=start,
        estimator=settle_noise(rows.estimator, start.reduce(rows.information)),
        delays=DelayErrors.of(session, rows),
    )


def _tell(
    session: Session,
    rows: Weighed,
    question: Question,
    search: Search,
    selected: int,
    measured: Measured,
    stability: Stability,
    known: Mapping[str, Any],
) -> Ladder:
    """Return the result, with where the effect of removed parameters went and what seems wrong."""
    submodels, part = measured.models, question.start.reduce(rows.information)
    chosen, result = submodels[selected], measured.result
    return Ladder(
        structure=session.structure,
        samples=rows.opening.samples,
        validation=rows.opening.validation,
        hints=_hint(session, rows, measured),
        commands=rows.opening.commands,
        information=rows.information,
        start=question.start,
        selected=selected,
        least=best_step(search.path.steps),
        refused=search.path.refused,
        stability=stability,
        absorption=absorb(part, submodels[0].estimate, chosen.estimate, chosen.step.partition),
        moved=session.recordings.measure_rollouts(
            session.structure.robot, result.physical.parameters()
        ),
        rolled=session.recordings.rolled,
        late=question.delays.move(full_model(session.structure.base)),
        **known,
        **vars(measured),
    )


def _walk(
    session: Session,
    rows: Weighed,
    question: Question,
    forbid: Sequence[str],
    force: Sequence[str],
) -> Search:
    """Return the path down from the model where pruning starts."""
    start, surveys = question.start, [s.survey for s in rows.opening.samples]
    session.say("walking down the ladder", 0.4)
    _check_wishes(start, forbid, force)
    return find_path(
        start.reduce(question.information),
        start.nonnegative,
        variation=rows.alike.variation * find_signal(surveys),
        suggested=propose_moves(session.structure, start.columns),
        forbid=forbid,
        force=force,
        method=question.estimator,
    )


def _hint(session: Session, rows: Weighed, measured: Measured) -> tuple[str, ...]:
    """Return what seems to be wrong with robot file, logs and their cut-off."""
    result, opening = measured.result, rows.opening
    joints, first = session.structure.robot.joints, 2 * (opening.alternative is not None)
    said = (
        *opening.hints[:first],
        *state_foreign(measured),
        *state_disagreement(measured),
        rows.burst,
        state_weak(result),
        state_mounting(session.structure.robot, result.verdicts),
        *opening.hints[first:],
        *check_cutoff(opening, session.recordings, session.how),
        compare_logs(joints, opening.samples, result).hint,
    )
    return tuple(filter(None, said))


def _check_wishes(start: Submodel, forbid: Sequence[str], force: Sequence[str]) -> None:
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
    question: Question, search: Search, cad_prior: float | None
) -> tuple[int, PhysicalResult]:
    """Return the step to use: the first as good as the best that a real robot can have."""
    steps = search.path.steps
    asked: list[Candidate] = []
    problems: list[IdentifiabilityError] = []
    good = list(good_steps(steps))
    sound = (k for k in good if not contradicts(question.fit(steps[k]), question.full))
    for k in list(islice(sound, CERTIFIED)) or good[:CERTIFIED]:
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
    held_out = HeldOut.of(question.information, noise, search.whitened.folds)
    if not feasible:
        feasible = _find_possible(question, steps, asked[0][0], held_out)
    k, model, proved = (feasible or asked)[0]
    return k, settle_robot(model, held_out, cad_prior).robot.with_certificate(*proved)


def _find_possible(
    question: Question, steps: Sequence[Step], impossible: int, held_out: HeldOut
) -> list[Candidate]:
    """Return the largest smaller model whose values a real robot has, if it predicts as well.

    What a model with impossible values says of the robot is its nearest real robot, and that of a
    smaller one has what its bodies cannot do without: the two are compared.
    """
    best = _score_robot(question.fit(steps[impossible]), held_out)
    for k, step in list(enumerate(steps))[impossible + 1 :][:CERTIFIED]:
        model = question.fit(step)
        try:
            proved = certify_model(model)
        except IdentifiabilityError:
            continue
        if proved[0] is not None and proved[0].feasible:
            own = _score_robot(model, held_out)
            near = best is not None and own is not None and near_best([own, best])[0]
            return [(k, model, proved)] if near else []
    return []


def _score_robot(model: FittedModel, held_out: HeldOut) -> Score | None:
    """Return what the nearest real robot predicts; None where there is none."""
    fit, submodel = model.estimate, model.submodel
    found = choose_prior(model, held_out, held_out.score_fit(fit, submodel.M, submodel.fixed))
    return None if found is None else found.score
