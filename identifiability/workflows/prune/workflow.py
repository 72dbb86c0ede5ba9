"""From robot and logs to the reduced model worth using, without a simulated robot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from identifiability.estimation.estimate import (
    Kind,
    Method,
    estimate_noise,
    fit_whole,
    weigh_outliers,
    with_known,
)
from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.estimation.evidence import Evidence, HeldOut, near_best
from identifiability.estimation.noise import whiten_chunk
from identifiability.estimation.prediction import Prediction, Task, predict_all
from identifiability.foundation.defaults import DEFAULTS
from identifiability.foundation.engines import Engine, one_thread
from identifiability.foundation.errors import IdentifiabilityError, ModelError, near_match
from identifiability.foundation.findings import of_key, phrase
from identifiability.foundation.options import (
    Names,
    NotNegative,
    Replicates,
    Seed,
    checked,
    resolve_count,
)
from identifiability.foundation.runs import Progress, Run, quiet, running
from identifiability.foundation.values import Fields, frozen
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.dataset import find_signal
from identifiability.physical.feasibility import PhysicalResult, certify_model
from identifiability.physical.fitted_model import FittedModel
from identifiability.quality.recordings import Logs
from identifiability.regression.information import Information, gather_information
from identifiability.regression.reduction import (
    LadderEntry,
    LadderLike,
    LadderSource,
    Submodel,
    build_ladder,
    full_model,
    ladder_model,
)
from identifiability.robot import RobotLike
from identifiability.workflows.analyze.judge import (
    decide_model,
    doubt_springs,
    rms_torque,
    tell_with_file,
)
from identifiability.workflows.analyze.ladder import ACCOUNTS, LadderFit, fit_with_robot
from identifiability.workflows.analyze.profiles import find_noise, profile_shapes
from identifiability.workflows.analyze.result import WORSE
from identifiability.workflows.analyze.shared_errors import SharedErrors, measure_shared_errors
from identifiability.workflows.analyze.workflow import (
    choose_settings,
    list_measured,
    predict_everywhere,
    say_band,
    say_of_fit,
)
from identifiability.workflows.case import Case, WeightedRows, take_case
from identifiability.workflows.sides import report_loads

from .elimination import (
    Search,
    Step,
    best_step,
    find_path,
    first_allowed,
    good_steps,
    thin_path,
    weigh_models,
)
from .moves import limit_moves, propose_moves
from .result import Ladder, PrunedModel

#: Models as good as the best, and smaller ones, for which a physical certificate is computed.
CERTIFIED = 4


@checked
def prune(
    robot: RobotLike | Case,
    logs: Logs = (),
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
    robot : Robot, path, shipped name, or Case
        A case has its own logs and preparation, and shares its stages with other verbs.
    logs : log, path, DataFrame, or several
        The size of the model is chosen on these only.
    validate : the same, optional
        Held-out logs, which serve only for reported errors. Without any, the last log (or the last
        quarter of the only one) is held out; with "none" all logs are fitted.
    ladder : path, LadderEntry or result of `prune`, optional
        Its first model is where pruning starts; by default every base parameter, with
        torque offsets.
    forbid : sequence of str
        Parameters that must not be dropped.
    force : sequence of str
        Parameters that are always dropped.
    preparation : Preparation, optional
        How derivatives are made.
    method : str or Estimator
        As for `analyze`.
    estimator : {"auto", "ls", "iv"}
        As for `analyze`.
    replicates : int, optional
        Resampled logs of the bootstrap; by default `DEFAULTS.resampled`, or
        `DEFAULTS.resampled_quick` if `quick`.
    cad_prior : float, optional
        As for `analyze`: keeps the nearest physical robot near the robot file.
    prior : float, optional
        The same as the share within which the bodies are the file's, as for `analyze`.
    seed : int
        Of every random choice.
    progress : callable(str, float), optional
        Called with the current stage and the finished share.
    engine : Engine, optional
        Where stretches of logs that are too long for memory are processed; by default in several
        processes. The result does not depend on it.
    quick : bool
        Fewer replicates, unless their number is given.

    Raises
    ------
    IdentifiabilityError
        With one sentence on what to do.
    """
    draws = resolve_count(replicates, DEFAULTS.resampled, DEFAULTS.resampled_quick, quick=quick)
    options = {"method": method, "estimator": estimator, "replicates": draws}
    wishes = {"forbid": list(forbid), "force": list(force)}
    with one_thread("blas"):
        case = take_case(robot, logs, validate, preparation)
        with running(engine) as runner:
            run = Run(progress or quiet, runner, seed)
            settings = choose_settings(case, run, prior, cad_prior, **options, **wishes)
            source = case.ladder(ladder, beside=False)
            # A model that was given is taken as it is.
            complete = ladder is None and case.model is None
            rows = weigh_unpruned(case, source, run, method, estimator, complete)
            found = _reduce(pose_question(case, source, rows), source, settings, run)
        return tell_with_file(doubt_springs(found), settings["prior"])


def _reduce(
    question: Question, source: LadderSource, settings: Mapping[str, Any], run: Run
) -> Ladder:
    """Walk the path from a model, choose a step and measure the models of the path.

    Parameters
    ----------
    question, source
    settings : mapping
        As of `Laddered`.
    run : Run
    """
    data = question.rows.data
    wishes = [settings[name] for name in ("forbid", "force")]
    _check_wishes(question.start, *wishes)
    run.say("walking down the ladder", 0.4)
    search = walk_down(question, whiten_rows(question.rows, run), *wishes)
    selected, fit = _choose(question, search, settings["cad_prior"])
    search, selected, thinned = thin_path(search, selected)
    run.say("measuring errors", 0.5)
    rng = np.random.default_rng(settings["seed"]).spawn(3)[2]
    draws = settings["replicates"]
    measured = measure_models(question, search, selected, fit, replicates=draws, rng=rng)
    chosen = measured["models"][selected]
    loads = report_loads(data, question.start, chosen.error_ra, chosen.used[1])
    hints = *loads, *_hint(question.rows, measured["models"], selected), thinned
    remarks = tuple(filter(None, hints))
    shared = question.shared.together(full_model(data.structure.base))
    return Ladder(
        structure=data.structure,
        samples=data.samples,
        validation=data.validation,
        hints=remarks,
        recordings=data.recordings,
        information=question.rows.information,
        start=question.start,
        selected=selected,
        least=best_step(search.steps),
        refused=search.refused,
        late=shared,
        source=source,
        settings=settings,
        **measured,
    )


def weigh_unpruned(
    case: Case, source: LadderSource, run: Run, method: Method, estimator: Kind, complete: bool
) -> WeightedRows:
    """Return the weighted rows of a case under the first model of a ladder."""
    given = case.structure(case.known_robot(run), ladder_model(source.entry))
    data = case.data(given, run, "pruned")
    return case.weigh(data, method, estimator, run, complete=complete)


def pose_question(case: Case, source: LadderSource, rows: WeightedRows) -> Question:
    """Return the question: the first model of a ladder, on weighted rows."""
    entry = LadderEntry(models=source.entry.models[:1])
    start = build_ladder(entry, rows.data.structure)[0]
    noise_known = estimate_noise(rows.estimator, start.reduce(rows.information))
    shared = case.stages.once(measure_shared_errors, rows)
    return Question(rows, start, noise_known, shared)


def whiten_rows(rows: WeightedRows, run: Run) -> Information | None:
    """Return the rows whitened by the noise of each joint; None if the noise is white.

    Autocorrelated noise hides a parameter from least squares that whitened rows show. The noise is
    measured in the presence of all columns and of all effects that may be missing. Without them,
    errors of the model would count as noise.
    """
    data = rows.data
    noise = data.missing.noise
    if not any(joint.pacf.size for joint in noise):
        return None
    transform = partial(whiten_chunk, noise=noise)
    information = gather_information(
        data.regression,
        transform=transform,
        engine=run.engine,
    )
    unweighted = with_known(information, data.structure.known)
    return weigh_outliers(unweighted, replace(rows.estimator, noise=None))[0]


def walk_down(
    question: Question,
    whitened: Information | None,
    forbid: Sequence[str],
    force: Sequence[str],
) -> Search:
    """Return the path of ever smaller models from the model that pruning starts from.

    Parameters
    ----------
    question : Question
    whitened : Information or None
        Whitened rows of all base parameters, as `whiten_rows` returned them.
    forbid, force : sequence of str
        Parameters that are always kept, and parameters that are always dropped.
    """
    rows = question.rows
    start = question.start
    data = rows.data
    signal = find_signal([s.survey for s in data.samples])
    noise = find_noise(data.missing.noise, rows.information)
    curves = profile_shapes(data.structure, data.samples, noise, start.columns)
    limits = limit_moves(data.structure, start.columns, curves)
    rows_reduced = start.reduce(rows.information)
    whitened_reduced = None if whitened is None else start.reduce(whitened)
    proposed = propose_moves(data.structure, start.columns)
    return find_path(
        rows_reduced,
        whitened=whitened_reduced,
        variation=rows.unweighted.variation * signal,
        suggested=[*limits, *proposed],
        forbid=forbid,
        force=force,
        method=question.estimator,
    )


def _hint(rows: WeightedRows, models: Sequence[PrunedModel], selected: int) -> tuple[str, ...]:
    """Return findings on robot file, logs and their cut-off."""
    data = rows.data
    hints = data.remarks(list_measured(models[selected]))
    other = of_key(hints, "alternative")
    foreign = _state_foreign(models[0]) if data.validation else ""
    others = (hint for hint in hints if hint not in other)
    band = () if data.recordings.commanded else say_band(data.band)
    of_fit = say_of_fit(data, models[selected], data.missing.functions)
    return (
        *other,  # under which all is said
        foreign,
        rows.outlier_hint,
        *others,
        *band,
        *of_fit,
    )


def _state_foreign(full: PrunedModel) -> str:
    """Return a sentence if held-out logs look like those of another robot; else empty."""
    error = full.error_ra_validation
    own = full.error_ra_unseen
    constant = full.unseen.constant_error()
    if not error > max(constant, 2.0 * own):
        return ""
    return phrase("pruned", "foreign", error=error, constant=constant, own=own)


def _check_wishes(start: Submodel, forbid: Sequence[str], force: Sequence[str]) -> None:
    unknown = [name for name in (*forbid, *force) if name not in start.columns]
    if unknown:
        near = near_match(unknown[0], start.columns)
        names = phrase("pruned", "unknown", name=unknown[0], near=near, columns=start.columns)
        raise ModelError(names)
    both = sorted(set(forbid) & set(force))
    if both:
        raise ModelError(phrase("pruned", "both", name=both[0]))


def _choose(question: Question, search: Search, cad_prior: float | None) -> tuple[int, LadderFit]:
    """Return the step to use, the smallest as good as the best, and its nearest physical robot.

    A model whose values are not physically consistent is replaced by its nearest physical robot. If
    a smaller model with physically consistent values predicts equally well, that model is used.
    """
    steps = search.steps
    tried = []
    held_out = HeldOut.of(
        question.rows.information,
        search.full.noise,
        search.whitened.folds,
    )
    for k in range(good_steps(steps)[0], len(steps))[: 1 + CERTIFIED]:
        model = question.fit(steps[k])
        try:
            certificate, said = certify_model(model)
        except IdentifiabilityError as error:
            certificate = None
            said = str(error)
        tried.append((k, model, certificate, said))
        if certificate is not None and certificate.feasible:
            break
    found = []
    for k, model, *certified in tried[:1] + tried[1:][-1:]:
        fit = fit_with_robot(model, held_out, cad_prior, certified=certified)
        found.append((k, fit))
    (_, first), (_, last) = found[0], found[-1]
    pair = [x.real for x in (last, first) if x.real is not None]
    alike = len(pair) > 1 and near_best(pair)[0]
    if last.robot.feasible and alike:
        return found[-1]
    return found[0]


# The models of the path, measured.


@frozen
class Question:
    """The model to prune, and the information of the logs on all its base parameters.

    Attributes
    ----------
    rows : WeightedRows
    start : Submodel
        The model that pruning starts from.
    estimator : Estimator
    shared : SharedErrors
    """

    rows: WeightedRows
    start: Submodel
    estimator: Estimator
    shared: SharedErrors

    @cached_property
    def full(self) -> Estimate | None:
        """The fit of all base parameters; None where the logs are too short for it."""
        return fit_whole(self.estimator, self.rows.information)

    def fit(self, step: Step) -> FittedModel:
        """Fit the model of a step down."""
        submodel = self.start
        size = len(step.partition)
        if step.move is not None:
            name = f"{size} parameter{'' if size == 1 else 's'}"
            submodel = step.partition.submodel(submodel, name)
        return FittedModel.of(
            self.rows.data.structure,
            submodel,
            self.rows.information,
            self.estimator,
        )


@frozen
class PathPredictions:
    """Predictions by the models of a path, from one pass through the logs.

    Attributes
    ----------
    fits : tuple of (Submodel, Estimate)
        Of each step.
    fitted, unseen : Prediction
        Along fitted and unseen motion: by each step, then by the accounts of the model to use
        (`LadderFit.values`).
    crossed : Prediction
        Along stretches (or logs) by models fitted to the others.
    """

    fits: tuple[tuple[Submodel, Estimate], ...]
    fitted: Prediction
    unseen: Prediction
    crossed: Prediction


def predict_path(question: Question, search: Search, chosen: LadderFit) -> PathPredictions:
    """Return the predictions by the models of a path.

    Parameters
    ----------
    question, search
    chosen : LadderFit
        The fit of the step to use, and its nearest robot.
    """
    data = question.rows.data
    steps = search.steps
    start = question.start
    fits = tuple((m.submodel, m.estimate) for m in map(question.fit, steps))
    values = np.stack([submodel.expand(fit.value) for submodel, fit in fits], 1)
    folds_of_steps = np.stack([s.values[1:] for s in steps], 2)
    rests = start.fixed[:, None] + start.M @ folds_of_steps
    along = [Task(np.column_stack([values, chosen.values])[None], kept=False)]
    both = np.concatenate([rests, chosen.turned], axis=2)
    tasks = [*along, Task(both, search.whitened.folds, kept=False)]
    fitted, crossed = predict_all(data.regression, tasks)
    unseen = crossed
    if data.unseen is not None:
        (unseen,) = predict_all(data.unseen, along)
    return PathPredictions(fits, fitted, unseen, crossed)


def measure_models(
    question: Question,
    search: Search,
    selected: int,
    chosen: LadderFit,
    *,
    replicates: int,
    rng: np.random.Generator,
) -> Fields:
    """Fit every model of a path, measure its predictions, and return fields of a `Ladder`.

    Parameters
    ----------
    question : Question
    search : Search
    selected : int
        The step to use.
    chosen : LadderFit
        Its fit, and its nearest robot.
    replicates : int
        Of the bootstrap.
    rng : numpy.random.Generator
    """
    data = question.rows.data
    steps = search.steps
    found = predict_path(question, search, chosen)
    weights = np.zeros(len(steps))
    first = first_allowed(steps)
    weights[first:] = weigh_models([step.score.density for step in steps[first:]], rng)
    models = []
    for k in range(len(steps)):
        robot = chosen.robot if k == selected else None
        # Intermediate models are judged by σ alone.
        draws = replicates if k in (0, selected) else 0
        model = judge_step(question, search, found, k, robot, draws, rng)
        models.append(replace(model, weight=float(weights[k])))
    result = models[selected]
    better = len(result) and result.error_ra_unseen < found.crossed.constant_error()
    nothing = data.misread or (result.contradicted if better else WORSE)
    models = [pruned.withdraw(nothing) for pruned in models] if nothing else models
    account = int(result.physical_used)
    everywhere = predict_everywhere(data, chosen, account, search.whitened.folds)
    return {
        "models": tuple(models),
        "everywhere": everywhere,
        "nothing": nothing,
        "missing": data.missing,
    }


def judge_step(
    question: Question,
    search: Search,
    found: PathPredictions,
    k: int,
    robot: PhysicalResult | None,
    draws: int,
    rng: np.random.Generator,
) -> PrunedModel:
    """Return a model of a path with its verdicts and errors.

    Parameters
    ----------
    question, search, found
    k : int
        Its step.
    robot : PhysicalResult or None
        Its nearest robot, where it is the model to use.
    draws : int
        Of the bootstrap.
    rng : numpy.random.Generator
    """
    steps = search.steps
    submodel, estimate = found.fits[k]
    rows = question.rows
    # All of them at once would fill the memory.
    model = FittedModel.recall(rows.data.structure, submodel, rows.information, estimate)
    torque = rms_torque(found.fitted)
    how = rng, draws, question.full, rows.data.missing, question.shared
    fit, verdicts, infeasible = decide_model(model, torque, *how, real=robot)
    best = steps[best_step(steps)]
    density = steps[k].score.gain(best.score)
    error = Evidence.of(steps[k].errors, best.errors).error
    accounts = [k] if robot is None else range(len(steps), len(steps) + ACCOUNTS)
    return PrunedModel(
        step=steps[k],
        submodel=submodel,
        estimate=estimate,
        fit=fit,
        verdicts=verdicts,
        infeasible=infeasible,
        physical=robot,
        fitted=found.fitted.select(accounts),
        unseen=found.unseen.select(accounts),
        crossed=found.crossed.select(accounts),
        spread=error.se,
        density=density.value,
        density_se=density.se,
        weight=0.0,
    )
