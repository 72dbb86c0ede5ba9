"""From robot and logs to the reduced model worth using, without a simulated robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.estimation.estimate import Kind, Method, find_estimator, settle_noise
from identifiability.estimation.evidence import HeldOut, near_best
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
from identifiability.workflows.prune.elimination import Search, best_step, find_path, good_steps
from identifiability.workflows.prune.models import (
    Measured,
    Question,
    Stability,
    assess_stability,
    count_walks,
    measure_models,
    state_disagreement,
    state_foreign,
    thin_path,
)
from identifiability.workflows.prune.moves import propose_moves
from identifiability.workflows.prune.result import Ladder
from identifiability.workflows.session import Session, Weighed, settle_prior

#: Models as good as the best, and smaller ones, whose physical certificate is asked for.
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
            measured, contradicted = measure_models(
                *(question, search, selected, physical),
                *(share_, draws, streams[2], runner, measuring),
            )
        say("resampling", 0.7)
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
        held_out=rows.held_out,
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
    """Return the result, with what seems wrong."""
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
        moved=session.recordings.measure_rollouts(
            session.structure.robot, measured.result.physical.parameters()
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
        compare_logs(joints, opening, rows.information, result).hint,
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
    """Return the step to use: the smallest as good as the best that a real robot can have.

    What a model with impossible values says of the robot is its nearest real robot. Where no real
    robot has what is as good, a smaller model that one has stands for it if these predict alike.
    """
    steps = search.path.steps
    noise = Noise(search.full.variance, search.full.times)
    held_out = HeldOut.of(question.information, noise, search.whitened.folds)
    good = good_steps(steps)
    first = question.fit(steps[good[0]])
    smaller = range(good[0] + 1, len(steps))
    chosen = good[0], first, _certify(first)
    for k in (*good[:CERTIFIED], *smaller[:CERTIFIED]):
        model = first if k == good[0] else question.fit(steps[k])
        proof = chosen[2] if k == good[0] else _certify(model)
        if proof[0] is not None and proof[0].feasible:
            near = k <= good[0] or _near(model, first, held_out)
            chosen = (k, model, proof) if near else chosen
            break
    k, model, proof = chosen
    return k, settle_robot(model, held_out, cad_prior).robot.with_certificate(*proof)


def _certify(model: FittedModel) -> tuple[Certificate | None, str]:
    """Return whether a real robot has a model's values, with its sentence."""
    try:
        return certify_model(model)
    except IdentifiabilityError as error:
        return None, str(error)


def _near(model: FittedModel, other: FittedModel, held_out: HeldOut) -> bool:
    """Return whether the real robot nearest to a model predicts as well as that of another."""
    found = []
    for each in (model, other):
        fit, submodel = each.estimate, each.submodel
        free = held_out.score_fit(fit, submodel.M, submodel.fixed)
        found.append(choose_prior(each, held_out, free))
    one, best = found
    return bool(one and best and near_best([one.score, best.score])[0])
