"""The main workflow: from robot and logs to one verdict per parameter and a model to use.

Models are fitted, each with its nearest robot (`ladder`). Every parameter is judged by the noise,
other motion and omitted effects (`judge`), and one model is selected.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.effects.base import move_mounting
from identifiability.effects.measurement import CommandDelay
from identifiability.estimation.cutoff import STEP
from identifiability.estimation.estimate import Kind, Method, find_estimator
from identifiability.estimation.evidence import LEVELS, Folds
from identifiability.estimation.groups import MissingEffects
from identifiability.estimation.mixed_model import EVERYWHERE
from identifiability.estimation.prediction import Prediction, Task, predict_all
from identifiability.estimation.rules import RULES
from identifiability.estimation.search import is_unknown_age
from identifiability.foundation.defaults import DEFAULTS
from identifiability.foundation.engines import Engine, one_thread
from identifiability.foundation.errors import ModelError
from identifiability.foundation.findings import Finding
from identifiability.foundation.options import (
    Names,
    NotNegative,
    Replicates,
    Seed,
    checked,
    resolve_count,
)
from identifiability.foundation.rounding import REACH, join
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.runs import First, Progress, Run, quiet, running, share
from identifiability.foundation.values import Fields
from identifiability.logs.prepare import Preparation
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.logs.spectrum import Band
from identifiability.physical.cad_prior import resolve_prior
from identifiability.physical.fitted_model import FittedModel
from identifiability.quality.recordings import Logs
from identifiability.reading.candidates import list_legs
from identifiability.regression.reduction import (
    LadderLike,
    LadderSource,
    Submodel,
    build_comparison,
    ladder_model,
)
from identifiability.robot import Robot, RobotLike
from identifiability.workflows.case import Case, Data, WeightedRows, take_case
from identifiability.workflows.sides import report_loads

from .belief import Belief, form_belief, refine_verdicts
from .judge import assess_ladder, doubt_springs, select_model, tell_with_file
from .ladder import FittedLadder, LadderFit, compute_ladder
from .profiles import check_numbers, profile_numbers
from .result import Analysis, ModelResult, compare_logs, doubt

# Further findings: an unsuitable cut-off, and remarks of the fit on its logs.


def say_band(band: Band | None, *, names: bool = False) -> Iterator[Finding]:
    """Yield findings on a cut-off: slow sampling, a better cut-off, or noise.

    Parameters
    ----------
    band : Band or None
    names : bool
        Whether effects are named, which a band that is too wide makes unreliable.
    """
    if band is None:
        return
    advice = band.advice
    if advice is None and band.sampled_slowly:
        rate = 2.0 * band.bandwidth / LOG_RULES.cutoff_highest
        reach = {"cutoff": band.cutoff, "bandwidth": band.bandwidth}
        yield Finding("cutoff_low", rate=rate, **reach)
    if advice is not None and advice.given > (1.0 + LEVELS.rise) * advice.error:
        errors = {"given": advice.given, "error": advice.error}
        yield Finding("cutoff_set", cutoff=band.cutoff, better=advice.cutoff, **errors)
    # On one period of a motion intervals hold up to three tenths.
    elif band.noise > 0.2:
        yield Finding("cutoff_noisy", cutoff=band.cutoff, share=min(band.noise, 1.0))
    if names and advice is not None and band.outputs > STEP * advice.outputs:
        yield Finding("cutoff_wide", band=band.outputs, better=advice.outputs)


def say_of_fit(data: Data, result: ModelResult, missing: Sequence[str]) -> list[str]:
    """Return hints from a fit on its logs: a mounting to correct, offsets, logs that disagree.

    Corrections of a mounting are linear where they are small. A large one is corrected step by
    step: the rest is found from the corrected mounting.
    """
    sure = {v.name: v.value for v in result.verdicts if v.sure and not v.open}
    entry = move_mounting(data.robot, sure)
    moved = Finding("imu_moved", entry=entry) if entry else ""
    apart = compare_logs(data.samples, result, missing)
    found = moved, say_excluded_offsets(result), apart, *say_unequal(data.robot, result)
    return [*filter(None, found)]


def list_measured(result: ModelResult) -> dict[str, tuple[float, float]]:
    """Return fitted values, among them scales and delays of the torque (`case.Measured`).

    Where the logs determine only differences of scales, those of the nearest robot are returned.
    """
    physical = {} if result.physical is None else result.physical.parameters()
    found = {name: (value, np.nan) for name, value in physical.items()}
    alone = (v for v in result.verdicts if not v.others)
    return found | {v.name: (v.value, REACH * v.sigma_label) for v in alone}


def say_excluded_offsets(result: ModelResult) -> Finding | str:
    """Return parameters, with joints, that only a model without torque offsets identifies."""
    names = [
        f"{'one' if k else 'an offset'} of {join(joints)} from "
        f"{'the combination with ' * bool(v.others)}{v.name}"
        for k, (v, joints) in enumerate(result.without_offsets)
    ]
    return Finding("excluded_offsets", names=names) if names else ""


def say_unequal(robot: Robot, result: ModelResult) -> Iterator[Finding]:
    """Yield values that are many times those of joints that are equal by the robot file.

    Their intervals have nothing in common. Joints of equal legs with equal values are equal.
    """
    known = {v.name: v for v in result.verdicts if not v.open}
    for joints in zip(*list_legs(robot), strict=True):
        for kind in ("Ia", "Fc", "Fv"):
            names = [f"{robot.joints[k]}.{kind}" for k in joints]
            stated = {robot.nominal.get(name, 0.0) for name in names}
            legs = [known[name] for name in names if name in known]
            if len(legs) < 3 or len(stated) > 1:
                continue
            for v in legs:
                others = [x for x in legs if x is not v]
                usual = float(np.median([x.value for x in others]))
                apart = v.interval95[0] > max(x.interval95[1] for x in others)
                if apart and v.value > RULES.contradicted * usual:
                    yield Finding("unequal", name=v.name, value=v.value, others=usual)


def say_delays(robot: Robot, missing: MissingEffects) -> Iterator[Finding]:
    """Yield by how much commands act later than was stated or found, where they seem to."""
    for effect in missing.shares:
        group = effect.term.group
        if group.family != CommandDelay.name or 1 - effect.weight > effect.weight:
            continue
        if is_unknown_age(effect, robot):
            continue
        assert robot.servo is not None
        joints = robot.motor_joints if group.place == EVERYWHERE else (group.place,)
        sd = np.linalg.norm(effect.root, axis=0)
        values = zip(joints, 1e3 * effect.value, 1e3 * sd, strict=False)
        sure = [x for x in values if abs(x[1]) > REACH * x[2]]
        each = [f"{joint} {late:+.3g} ± {error:.2g}" for joint, late, error in sure]
        if each:
            yield Finding("late_commands", each=each, stated=robot.servo.delay is not None)


def predict_everywhere(
    data: Data, fit: LadderFit, account: int, folds: Folds | None
) -> Prediction | None:
    """Return torque along unseen motion, including joints at rest; None without joints at rest.

    Parameters
    ----------
    data : Data
    fit : LadderFit
    account : int
        Which of its accounts predicts.
    folds : Folds or None
        Which fold's values predict a sample; ignored where logs are held out.
    """
    samples = data.validation or data.samples
    recordings = data.recordings
    logs = recordings.held_out if data.validation else recordings.fitted
    surveys = [s.survey for s in samples]
    stand = any((x.rows < x.outputs).any() for x in surveys)
    hidden = data.robot.base is not None or any(x.unmeasured is not None for x in logs)
    if hidden or not stand:
        return None
    regression = replace(data.unseen or data.regression, dwelling=True)
    folds = None if data.validation else folds
    values = fit.values[None] if folds is None else fit.turned
    task = Task(values[:, :, [account]], folds, kept=False)
    return predict_all(regression, [task])[0]


# The whole way from logs to the answer.


#: Share of the time of an analysis of commands after which their torque is known.
SERVOS: Tolerance = 0.55


@checked
def analyze(
    robot: RobotLike | Case,
    logs: Logs = (),
    validate: Logs = (),
    ladder: LadderLike | None = None,
    *,
    preparation: Preparation | None = None,
    method: Method = "wls",
    estimator: Kind = "auto",
    replicates: Replicates | None = None,
    posterior: bool = False,
    profile: Names = (),
    cad_prior: NotNegative | None = None,
    prior: NotNegative | None = None,
    seed: Seed = 0,
    progress: Progress | None = None,
    engine: Engine | None = None,
    quick: bool = False,
    first: First | None = None,
) -> Analysis:
    """Say which parameters the logs determine, and which model of a ladder to use.

    Parameters
    ----------
    robot : Robot, path, shipped name, or Case
        A case has its own logs and preparation, and shares its stages with other verbs.
    logs : log, path, DataFrame, or several
        Fitted to.
    validate : the same, optional
        Held-out logs. Without any, the last log (or the last quarter of the only one) is set
        aside. With "none", or if the log is too short for that, all logs are fitted, and errors
        come from blocked cross-validation.
    ladder : path, LadderEntry or result of `prune`, optional
        Models to compare, each also with the unpruned one. By default those of the case, or the
        ladder in the folder of the robot file, else the default one. The default has a model with
        torque offsets and one without. For logs of commands without torque, the default has
        offsets.
    preparation : Preparation, optional
        How derivatives are made.
    method : str or Estimator
        Weight actuators by 1 / (variance × autocorrelation time) of their noise (``wls``), or
        equally (``ols``).
    estimator : {"auto", "ls", "iv"}
        Least squares, or instrumental variables, which noise in the motion does not bias; ``auto``
        takes the latter if any log has a second record of its motion.
    replicates : int, optional
        Refits of the block bootstrap, 0 for none; by default `DEFAULTS.refits`, or
        `DEFAULTS.refits_quick` if `quick`.
    posterior : bool
        Also sample the posteriors of the selected model; costs two to three times the rest. It is
        off by default. It narrows parameters that the data do not determine, and never changes a
        verdict on the others.
    profile : sequence of str
        Numbers whose profile is computed besides those of the stated shapes and delays: a
        parameter, a shape such as ``joint_2.stribeck_friction``, ``total_mass``, or the largest
        torque of a joint along the fitted logs, ``joint_2.torque``.
    cad_prior : float, optional
        Weight of a log-det prior around the bodies of the robot file in the search for the nearest
        physical robot [σ²]; 0 for none. By default the heaviest that predicts stretches of the
        fitted logs as well as the best.
    prior : float, optional
        Share within which the bodies are those of the robot file, such as 0.2: it is a `cad_prior`
        of 1 / (2 share²), and verdicts state parameters that it narrows. By default 0.2 where logs
        hold commands and no torque, and none where they hold torque; 0 for none.
    seed : int
        Of every random choice.
    progress : callable(str, float), optional
        Called with the current stage and the finished share.
    engine : Engine, optional
        Where stretches of logs that are too long for memory are processed; by default in several
        processes.
    quick : bool
        Fewer replicates, unless their number is given.
    first : callable(Result), optional
        Called with a first answer from some windows of long logs of commands, in about a quarter of
        the time of the whole answer.

    Raises
    ------
    IdentifiabilityError
        With one sentence on what to do.
    """
    draws = resolve_count(replicates, DEFAULTS.refits, DEFAULTS.refits_quick, quick=quick)
    options = {"method": method, "estimator": estimator, "replicates": draws}
    with one_thread("blas"):
        case = take_case(robot, logs, validate, preparation)
        with running(engine) as runner:  # workers are gone when their memory is wanted elsewhere
            run = Run(progress or quiet, runner, seed, first)
            settings = choose_settings(case, run, prior, cad_prior, posterior=posterior, **options)
            found = _fit_case(case, run, ladder, method, settings, profile)
        found = tell_with_file(doubt_springs(found), settings["prior"])
        if posterior:
            return believe(found, run.say)
        return found


def _fit_case(
    case: Case,
    run: Run,
    ladder: LadderLike | None,
    method: Method,
    settings: Mapping[str, Any],
    profiled: Sequence[str],
) -> Analysis:
    """Return the models of a ladder, judged, and which one to use."""
    source = case.ladder(ladder, beside=True)
    # A model that was given is taken as it is.
    complete = ladder is None and case.model is None
    stages = run
    # Shares at which effects are looked for, parameters judged and numbers profiled.
    shares = 0.75, 0.8, 0.9
    # The torque of servos takes more than half of the time; it is computed before the other stages.
    # Most of the rest is the search for missing effects.
    if case.recordings(run).commanded:
        case.torque(case.first_structure(run, ladder), run)
        shares = 0.65, 0.9, 0.95
        stages = run.after(SERVOS, shares[0])
    estimator = settings["estimator"]
    rows, submodels = prepare_ladder(case, source, stages, method, estimator, complete)
    check_numbers(rows.data.structure, profiled)
    fitted = case.stages.once(compute_ladder, rows, submodels, settings["cad_prior"], run=stages)
    rng = np.random.default_rng(settings["seed"]).spawn(2)[1]
    run.say("looking for missing effects", shares[0])
    missing = rows.missing
    run.say("judging parameters", shares[1])
    found = conclude_analysis(fitted, rng, settings, missing)
    chosen = found.chosen
    loads = report_loads(rows.data, submodels[0], chosen.error_ra, chosen.used[1])
    found = replace(found, source=source, hints=(*loads, *found.hints))
    run.say("profiling", shares[2])
    return replace(found, profiles=profile_numbers(found, profiled))


def choose_settings(
    case: Case, run: Run, prior: float | None, cad_prior: float | None, **options: Any
) -> Fields:
    """Return the options that determine the numbers of a ladder, in the form of its result.

    Parameters
    ----------
    case, run
    prior, cad_prior, options
        As of `analyze` or `prune`.
    """
    method = find_estimator(options["method"]).name
    share, weight = resolve_prior(prior, cad_prior, case.recordings(run).commanded)
    chosen = {"method": method, "seed": run.seed, "cad_prior": weight, "prior": share}
    return options | chosen | {"preparation": case.preparation or Preparation()}


def prepare_ladder(
    case: Case,
    source: LadderSource,
    run: Run,
    method: Method,
    kind: Kind,
    complete: bool,
) -> tuple[WeightedRows, tuple[Submodel, ...]]:
    """Return the weighted rows of a case under the unpruned model of a ladder, and its models.

    Parameters
    ----------
    case, source, run, method, kind
    complete : bool
        Whether the model gets the errors of measurement that it surely lacks.
    """
    given = case.structure(case.known_robot(run), ladder_model(source.entry))
    data = case.data(given, run, "analyzed")
    entry = case.stages.once(LadderSource.models_for, source, data.recordings.commanded)
    rows = case.weigh(data, method, kind, run, complete=complete)
    try:
        return rows, case.stages.once(build_comparison, entry, rows.data.structure)
    except ModelError:  # its models are of parameters of the model as it was given
        literal = case.data(given, run, "analyzed", apply=False)
        rows = case.weigh(literal, method, kind, run)
        return rows, case.stages.once(build_comparison, entry, rows.data.structure)


def believe(found: Analysis, say: Progress) -> Analysis:
    """Return the analysis with the posteriors of the selected model."""
    if found.nothing:
        return replace(found, belief=Belief(None, {}, found.nothing))
    chosen = found.chosen
    what = chosen.submodel, found.information, chosen.estimate
    model = FittedModel.recall(found.structure, *what)
    sampling = share(say, "sampling the posterior", 0.9, 0.99)
    within = found.settings["prior"]
    models = list(found.models)
    rng = np.random.default_rng(found.settings["seed"]).spawn(3)[2]
    belief = form_belief(model, rng, share=within, progress=sampling)
    verdicts = refine_verdicts(chosen.verdicts, belief)
    models[found.selected] = replace(chosen, verdicts=verdicts)
    return replace(found, models=tuple(models), belief=belief)


def conclude_analysis(
    found: FittedLadder,
    rng: np.random.Generator,
    settings: Mapping[str, Any],
    missing: MissingEffects,
) -> Analysis:
    """Judge every parameter of the fitted models and choose one model."""
    rows = found.rows
    data = found.rows.data
    results = assess_ladder(found, rng, settings["replicates"], missing)
    selected = select_model(results, found.near)
    results, nothing = doubt(data.misread, results, selected)
    fitted = list_measured(results[selected])
    hints = [*data.remarks(fitted), rows.outlier_hint, found.short]
    hints += () if data.recordings.commanded else say_band(data.band)
    hints += say_delays(data.robot, missing)
    if not data.explained:  # exchanged columns, a wrong unit or late torque explain the rest
        hints += say_of_fit(data, results[selected], missing.functions)
    account = int(results[selected].physical_used)
    unpruned = found.fits[0].model.submodel
    remarks = tuple(filter(None, hints))
    everywhere = predict_everywhere(data, found.fits[selected], account, found.folds)
    together = found.shared.together(unpruned)
    return Analysis(
        structure=data.structure,
        samples=data.samples,
        validation=data.validation,
        hints=remarks,
        information=rows.information,
        models=results,
        selected=selected,
        everywhere=everywhere,
        settings=settings,
        nothing=nothing,
        recordings=data.recordings,
        alternative=data.confirmed,
        missing=missing,
        late=together @ unpruned.M.T,
    )
