"""`diagnose`: find, name, add, verify; each stage can be called by itself.

`alternatives` first looks for another reading of the torque columns, or gravity far from the
file's. Under a wrong model many effects seem to be missing. The diagnosis then uses the model that
the fitted logs prefer.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from identifiability.effects import Part, Placed, default_effects, find_families, title_of
from identifiability.effects.base import GravityTilt
from identifiability.effects.measurement import CommandDelay
from identifiability.effects.registry import is_loaded
from identifiability.estimation.estimate import Outliers
from identifiability.estimation.groups import NO_MISSING_EFFECTS, MissingEffects, place_of
from identifiability.estimation.mixed_model import EVERYWHERE, Term
from identifiability.estimation.prediction import Prediction
from identifiability.estimation.rules import RULES
from identifiability.foundation.engines import Engine, Serial, one_thread
from identifiability.foundation.errors import ModelError
from identifiability.foundation.findings import phrase
from identifiability.foundation.linalg import NEARLY, rms_of, solve_least
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.options import Effects, Seed, checked
from identifiability.foundation.runs import First, Progress, Run, quiet
from identifiability.foundation.values import Fields, Json, frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Dataset, Preparation, Samples
from identifiability.logs.prepare.dataset import require_signal
from identifiability.logs.prepare.excerpt import most_rows, thin_all
from identifiability.physical.cad_prior import load_by_fit, resolve_prior, with_loads
from identifiability.quality.hints import where_outlying
from identifiability.quality.recordings import Logs, Recordings
from identifiability.reading import Reading
from identifiability.regression.information import Information, gather_information
from identifiability.regression.reduction import (
    USUAL_EFFECTS,
    LadderEntry,
    LadderSource,
    ModelLike,
    Submodel,
    build_comparison,
    choose_model,
    find_ladder,
    free_again,
    full_model,
    ladder_model,
)
from identifiability.regression.structure import Structure, count_offsets
from identifiability.robot import Robot, RobotLike, complete_motion
from identifiability.workflows.analyze.judge import (
    assess_ladder,
    doubt_springs,
    select_model,
    tell_with_file,
)
from identifiability.workflows.analyze.ladder import compute_ladder
from identifiability.workflows.analyze.workflow import (
    SERVOS,
    choose_settings,
    conclude_analysis,
    say_band,
)
from identifiability.workflows.case import Case, Data, take_case, with_regression
from identifiability.workflows.changes import Change
from identifiability.workflows.predict import state_reading
from identifiability.workflows.provenance import state_provenance
from identifiability.workflows.roles import require_held_out
from identifiability.workflows.sides import report_loads

from .elastic import ask_bending
from .naming import (
    Naming,
    find_change_in_log,
    judge_all_rows,
    leave_out,
    look,
    name_missing,
    with_parts,
    without_outliers,
    without_parts,
)
from .problem import (
    Given,
    KnownValues,
    Problem,
    Recommended,
    WeighedFit,
    along_rollouts,
    change_of,
    find_discrepancies,
    know_file,
    know_fit,
    know_nothing,
    know_share,
    read_given,
    weigh_fit,
)
from .result import Curve, Diagnosis, NamedEffect, Odds, Placement, Rival, simulate_forward


@checked
def diagnose(
    robot: RobotLike | Case,
    logs: Logs = (),
    validate: Logs = (),
    *,
    effects: Effects | None = None,
    model: ModelLike | None = None,
    fixed: Given = False,
    preparation: Preparation | None = None,
    seed: Seed = 0,
    quick: bool = False,
    forward: bool = True,
    bending: bool = False,
    progress: Progress | None = None,
    engine: Engine | None = None,
    first: First | None = None,
) -> Diagnosis:
    """Find disagreements of model and data, name missing effects, add and verify them.

    Parameters
    ----------
    robot : Robot, path, shipped name, or Case
        A case has its own logs and preparation, and shares its stages with other verbs.
    logs : log, path, DataFrame, or several
        Logs from which the model is fitted and effects are named.
    validate : the same, optional
        Held-out logs: they may refute a name, and measure the gap. Without any, the last log (or
        the last quarter of the only one) is held out.
    effects : iterable of str, optional
        Families that may be named, such as stribeck_friction; by default all that are registered.
    model : Model, sequence of str, path of a model file or result of `prune`, optional
        Effects of the model to diagnose; by default rigid body, viscous and symmetric Coulomb
        friction and actuator inertia. Parameters that a model file omits, fixes or ties are free.
    fixed : bool, float, path, Fit or result
        Keep values instead of refitting them; then wrong masses, payloads and gravity are
        candidates too. True: those of the robot file, as if they were exact. A share: those of the
        robot file, which may be off by it, such as 0.1 (a standard deviation); what the file does
        not state is free. A result: those of an `analyze`, `prune` or `diagnose`, of its JSON or
        its `Fit`, with their covariance, for the model that is diagnosed. Torque that these errors
        explain is not named as an effect.
    preparation : Preparation, optional
        How derivatives are made.
    seed : int
    quick : bool
        Leave out the simulation of `forward`.
    forward : bool
        Also simulate the verifying motion, without and with the named effects (half a second).
    bending : bool
        Also ask which joints of an open chain bend, in a wider band of the torque (seconds).
    progress : callable(str, float), optional
    engine : Engine, optional
        Where logs are prepared; here by default. The result does not depend on it.
    first : callable(Result), optional
        Called with a first answer from some windows of long logs of commands, as in `analyze`.

    Raises
    ------
    IdentifiabilityError
    """
    of_intervals, of_motion = map(np.random.default_rng, np.random.SeedSequence(seed).spawn(2))
    find_families(effects)  # a misspelt name is refused before logs are read
    with one_thread():
        case = take_case(robot, logs, validate, preparation)
        run = Run(progress or quiet, engine or Serial(), seed, first)
        fit, _ = read_given(fixed, case.robot)
        # Values that are kept belong to the reading of their logs.
        case = case if fit is None else case.with_(reading=fit.reading)
        recordings = case.recordings(run)
        require_held_out(recordings)
        model = case.model if model is None else model  # type: ignore[assignment]
        prior, fixed = _choose_prior(fixed, recordings)
        request = Request(effects, model, fixed, prior)
        found, data = _diagnose_logs(case, request, run, of_intervals)
        found = _with_context(case, request, found, data, quick=quick, seed=seed)
        found = judge_completed(case, request, found, data, run)
        if fit is not None:
            said = state_reading(fit, case, found.samples, run)
            found = replace(found, hints=(*said, *found.hints))
        if not quick and forward and found.included and found.robot.base is None:
            run.say("simulating forward", 0.95)
            found = replace(found, forward=simulate_forward(found, of_motion))
        if bending:
            run.say("asking which joints bend", 0.97)
            found = replace(found, bending=ask_bending(case, data, found.structure, run))
        # Columns are large and no longer needed.
        return replace(found, problem=replace(found.problem, columns=()))


@frozen
class Request:
    """Options of the search for effects.

    Attributes
    ----------
    effects : iterable of str or None
        Families that may be named.
    model : ModelLike or None
        The model to diagnose.
    fixed : Given
        Values that are kept.
    prior : float
        Share within which bodies are the file's, of logs of commands; 0 for none.
    """

    effects: Effects | None
    model: ModelLike | None
    fixed: Given
    prior: float

    @property
    def keeps(self) -> bool:
        """Whether the values of the file or of a result are kept."""
        return self.fixed is not False


def _choose_prior(fixed: Given, recordings: Recordings) -> tuple[float, Given]:
    """Return the share within which bodies are the file's, and which values are kept.

    Without measured torque, the share of the robot file's bodies is a prior.
    """
    share = isinstance(fixed, int | float) and fixed is not True
    if not (recordings.commanded and share):
        return 0.0, fixed
    given = fixed if fixed is not False else None
    return resolve_prior(given, None, True)[0], False  # type: ignore[arg-type]


def _diagnose_logs(
    case: Case,
    request: Request,
    run: Run,
    rng: np.random.Generator,
    recordings: Recordings | None = None,
) -> tuple[Diagnosis, Data]:
    """Return the diagnosis of the logs of a case, and the data.

    If a delay common to joints is found, they are diagnosed again with commands that act later.

    Parameters
    ----------
    case, request, run
    rng : numpy.random.Generator
        For intervals.
    recordings : Recordings, optional
        With torque of their servos; by default those of the case.
    """
    problem, data = pose_problem(case, request, run, recordings)
    if data.recordings.commanded:
        run = run.after(SERVOS)
    # Values that are kept are those of the file, and a wrong scale or sign is an effect.
    effects = () if data.misread and not request.keeps else request.effects
    found = name_effects(problem, effects, run, rng)
    servo = data.robot.servo
    if recordings is not None or servo is None:
        return found, data
    later = common_delay(found.effects, data.robot.motor_joints)
    if not later:
        return found, data
    from identifiability.servos import delay_commands  # noqa: PLC0415 - MuJoCo

    delayed = delay_commands(data.recordings, servo, later)
    return _diagnose_logs(case, request, run, rng, delayed)


def common_delay(effects: Sequence[NamedEffect], joints: Sequence[str]) -> float:
    """Return the median over joints of the command delay that is not yet corrected [s].

    The delay of a log is estimated from all joints together. One delayed joint, or one with a wrong
    gain, makes the others seem early. The delay that most joints share belongs to the log.
    """
    placements = [p for e in effects if e.name == CommandDelay.name for p in e.placements]
    delays = {p.place: float(p.values[0]) for p in placements}
    every = sorted(delays.get(joint, 0.0) for joint in joints)
    return every[(len(every) - 1) // 2]


def _with_context(
    case: Case, request: Request, found: Diagnosis, data: Data, *, quick: bool, seed: int
) -> Diagnosis:
    """Return a diagnosis with the hints on its logs, options and model."""
    # Torque of commands is calibrated with the cut-off.
    band = getattr(found.preparation, "band", None)
    said = () if found.commanded else say_band(band, names=True)
    loads = report_loads(data, full_model(data.structure.base), found.error_after, found.gap)
    others = free_again(request.model)
    hints = (*loads, *found.known.hints, *found.hints, *data.hints, *said, *others)
    if request.prior:
        hints = (found.known.hint, *hints)
    if request.fixed is True:
        hints = (phrase("kept", "exact"), *hints)
    logs = (*found.samples, *found.validation)
    options = _list_options(case, request, found)
    nothing = "" if found.fixed else data.misread
    statement = "" if data.confirmed is None else data.confirmed.statement
    provenance = state_provenance(found.robot, logs, seed, None, options | {"quick": quick})
    found = replace(
        found,
        nothing=nothing,
        alternative=statement,
        reading=data.recordings.reading,
        began=data.recordings.began,
        hints=hints,
        provenance=provenance,
    )
    return found.moved_by(data.recordings)


def _list_options(case: Case, request: Request, found: Diagnosis) -> Json:
    """Return the options that decided the numbers."""
    kept = request.fixed
    model = request.model
    names = [model] if isinstance(model, (str, Path)) else model
    effects = "all" if request.effects is None else list(request.effects)
    fixed = kept if isinstance(kept, bool | float | str | Path) else found.known.words
    options: Fields = {
        "effects": effects,
        "fixed": fixed,
        "preparation": case.preparation or Preparation(),
    }
    if isinstance(names, (list, tuple)) and names:
        options["model"] = ",".join(map(str, names))
    if request.prior:
        options["prior"] = request.prior
    return options


# From a case to the problem of a diagnosis.


def pose_problem(
    case: Case, request: Request, run: Run, recordings: Recordings | None = None
) -> tuple[Problem, Data]:
    """Return the problem and the logs under the reading that fits them.

    The problem has samples of commanded robots along their rollouts, the logs have them as logged.

    Parameters
    ----------
    case, request, run
    recordings : Recordings, optional
        With torque of their servos; by default those of the case.
    """
    robot = case.known_robot(run)
    commanded = case.recordings(run).commanded
    structure, known = _choose_values(case, robot, request, commanded=commanded)
    if commanded:
        torque, structure = case.torque(structure, run)
        recordings = recordings or torque
    ladder = case.stages.once(find_ladder, case.robot, None, True)
    pilot = None
    if not (request.keeps or commanded or request.model is not None):
        pilot = case.structure(robot, ladder_model(ladder.entry))
    logged, reference = _read_logs(case, request, structure, pilot, run, recordings)
    problem, data = _problem_of(case, request, known, logged, run)
    logged = data if data.recordings.rolled is None else logged
    if request.keeps or problem.known.precision.any():
        return problem, logged
    entry = None
    if request.model is None:
        entry = case.stages.once(LadderSource.models_for, ladder, commanded)
    return recommend(case, problem, data, reference, entry, run), logged


def _problem_of(
    case: Case, request: Request, known: KnownValues, data: Data, run: Run
) -> tuple[Problem, Data]:
    """Return the problem of prepared logs, and the samples whose errors are stated.

    Parameters
    ----------
    case, request
    known : KnownValues
        Prior knowledge of the values that are kept.
    data : Data
    run : Run
    """
    data, excerpts = _look_at(case, data)
    if not data.validation:  # the part that was set aside has nothing to explain
        _refuse_silent_part(case, data, run)
    run.say("building columns", 0.1)
    if request.prior:
        known = know_share(request.prior, data.structure, refitted=True)
    elif not request.keeps:
        known = know_nothing(data.structure)
    how = case.preparation if data.preparation.cutoff is None else data.preparation
    along = data.regression, data.structure.regression(excerpts[1] or data.validation)
    problem = Problem(
        structure=data.structure,
        samples=data.samples,
        known=known,
        validation=data.validation,
        excerpt=excerpts[0],
        unseen_excerpt=excerpts[1],
        fixed=request.keeps,
        verified_on=data.recordings.verified_on,
        preparation=how or Preparation(),
        commanded=data.recordings.commanded,
        seed=run.seed,
        columns=tuple((data.structure, columns) for columns in along),
    )
    return problem, data


def _read_logs(
    case: Case,
    request: Request,
    structure: Structure,
    pilot: Structure | None,
    run: Run,
    recordings: Recordings | None,
) -> tuple[Data, Data | None]:
    """Return the logs prepared for a model, and for the unpruned model of `analyze`.

    The latter is None where both cannot share their rows: values are kept, or logs are read
    otherwise. Of logs that are too long for memory excerpts are prepared.
    """
    raw = recordings or case.recordings(run)
    most = most_rows(raw.fitted) if raw.long else None
    seek = not request.keeps
    data = case.data(structure, run, "diagnosed", recordings=recordings, seek=seek, most=most)
    if request.keeps:
        return data, None
    reference = None
    if pilot is not None and data.confirmed is None:
        reference = case.data(pilot, run, "diagnosed", seek=False, most=most)
    return case.at_fit(data, run, named=True), reference


def _unless_all(samples: Samples, excerpt: Samples) -> Samples:
    """Return an excerpt, or nothing where it has all rows of the samples."""
    pairs = zip(samples, excerpt, strict=True)
    every = all(a.motion is b.motion and a.decimation is b.decimation for a, b in pairs)
    return () if every else excerpt


def _refuse_silent_part(case: Case, data: Data, run: Run) -> None:
    """Raise an error if held-out motion has nothing to explain.

    Raises
    ------
    LogError
    """
    recordings = data.recordings
    most = most_rows(recordings.fitted) if recordings.long else None
    prepared = case.prepared(data.robot, recordings, data.preparation, run, most)
    require_signal(prepared.held_out, "verified")


#: Excerpts of fitted and of held-out logs; empty where all rows are used.
Excerpts = tuple[Samples, Samples]


def _look_at(case: Case, data: Data) -> tuple[Data, Excerpts]:
    """Return data with second records of the motion, and excerpts for the search of effects.

    Samples of commanded robots are taken along the motion of their rollouts.
    """
    recordings = data.recordings
    most = most_rows(data.recordings.fitted)
    excerpts: Excerpts = (), ()
    if not recordings.long:
        pairs = (data.samples, recordings.fitted), (data.validation, recordings.held_out)
        excerpts = tuple(  # type: ignore[assignment]
            _unless_all(samples, case.stages.once(thin_all, samples, logs, case.preparation, most))
            for samples, logs in pairs
        )
    if recordings.rolled is None:
        return case.instrumented(data, "auto"), excerpts

    def move(samples: Samples, logs: Sequence[Log]) -> Samples:
        if not samples:  # all rows are looked at, or nothing was held out
            return ()
        inputs = data.structure, samples, logs, recordings.rolled
        return case.stages.once(along_rollouts, *inputs)

    samples = move(data.samples, recordings.fitted)
    validation = move(data.validation, recordings.held_out)
    excerpts = move(excerpts[0], recordings.fitted), move(excerpts[1], recordings.held_out)
    regression = case.regression(data.structure, samples)
    moved = replace(data, samples=samples, validation=validation, regression=regression)
    return moved, excerpts


def recommend(
    case: Case,
    problem: Problem,
    data: Data,
    reference: Data | None,
    entry: LadderEntry | None,
    run: Run,
) -> Problem:
    """Return the problem with the model and values that `analyze` recommends.

    Parameters
    ----------
    case, problem, data
    reference : Data or None
        The logs under the unpruned model of the ladder, where they were prepared for it.
    entry : LadderEntry or None
        Models that `analyze` compares; None where a model was given.
    run : Run
    """
    models: tuple[Submodel, ...] = (full_model(problem.structure.base),)
    compared = data
    if entry is not None:
        other = reference or _under_ladder(case, data, entry, run)
        with suppress(ModelError):  # its models are of parameters of the model as it was given
            models = case.stages.once(build_comparison, entry, other.structure)
            compared = other
    rows = case.weigh(compared, "wls", "auto", run, complete=False)
    fitted = case.stages.once(compute_ladder, rows, models, None, run=run)
    rng = np.random.default_rng(problem.seed)
    results = assess_ladder(fitted, rng, 0, NO_MISSING_EFFECTS)
    chosen = results[select_model(results, fitted.near)]
    assert chosen.physical is not None  # each model of a ladder has its nearest robot
    best = Recommended.of(chosen.submodel, chosen.estimate.value, chosen.physical, chosen.real)
    tilt = () if entry is None else rows.data.tilt
    problem = replace(problem, ladder=entry, found=tilt)
    structure = compared.structure
    same = _as_diagnosed(structure, problem.structure, best.base)
    if same is not None:
        return replace(problem, recommended=Recommended.of_base(problem.structure, same))
    columns = (*problem.columns, (structure, compared.regression))
    return replace(problem, recommended=best, under=structure, columns=columns)


def _as_diagnosed(structure: Structure, diagnosed: Structure, base: Array) -> Array | None:
    """Return recommended values as base parameters of the diagnosed model; None if it lacks some.

    Both models are the same if the recommended one omits all that the diagnosed one lacks.
    """
    common = [n for n in structure.columns if n in diagnosed.columns]
    G, to = (s.G[:, [s.columns.index(n) for n in common]] for s in (structure, diagnosed))
    phi = solve_least(G, base)
    apart = np.linalg.norm(G @ phi - base)
    if apart <= NEARLY * np.linalg.norm(base):
        return to @ phi
    return None


def _under_ladder(case: Case, data: Data, entry: LadderEntry, run: Run) -> Data:
    """Return data under the unpruned model of a ladder, with the same reading."""
    structure = case.structure(data.robot, ladder_model(entry))
    if data.confirmed is not None:
        structure = case.stages.once(Reading.structure, data.confirmed, structure)
    return case.at_fit(case.under(data, structure), run)


# From a problem to its diagnosis.


def name_effects(
    problem: Problem, effects: Effects | None, run: Run, rng: np.random.Generator
) -> Diagnosis:
    """Name missing effects, add and verify them.

    Rows of low weight, given the named effects, are not used to name effects. They count in fits
    and errors as in `analyze`.

    Parameters
    ----------
    problem : Problem
    effects : iterable of str or None
        Families that may be named.
    run : Run
    rng : numpy.random.Generator
        For intervals.
    """
    found = _name_between_changes(problem, effects, run)
    hint = ""
    if not problem.fixed:
        hint, outliers = _find_outliers(problem, found)
        if outliers is not None:
            where = where_outlying(problem.robot.joints, problem.samples, outliers)
            hint = (
                hint or f"{where} The search left these rows out. Check the robot and the log then."
            )
            found = _name_between_changes(without_outliers(problem, outliers), effects, run)
            if not found.problem.changes:
                found = judge_all_rows(found, problem)
    run.say("verifying", 0.9)
    found = take_loads(found, run.engine)
    diagnosis = conclude(found, rng)
    omits = diagnosis.problem.left_out and not diagnosis.included
    if omits and diagnosis.gap.surely_better(0, -1):
        # Without the rows of a change too little motion may be left.
        diagnosis = conclude(judge_all_rows(found, problem), rng)
    hints = (hint,) if hint else ()
    return replace(diagnosis, hints=hints)


def take_loads(naming: Naming, engine: Engine) -> Naming:
    """Return a naming whose load-dependent columns are those of the fit with all names.

    Without the named effects masses are wrong. A wrong scale then multiplies a wrong torque.
    """
    problem = naming.problem
    loaded = is_loaded(naming.completed.parameters)
    if not (naming.parts and loaded and problem.known.tells_nothing):
        return naming
    fitted = load_by_fit(naming.completed, naming.regression, engine=engine)
    loads = fitted.robot.reference
    under = None if problem.under is None else with_loads(problem.under, loads)
    structure = with_loads(problem.structure, loads)
    problem = replace(problem, structure=structure, under=under)
    return with_parts(replace(naming, problem=problem), naming.parts)


def _find_outliers(problem: Problem, found: Naming) -> tuple[str, Outliers | None]:
    """Return a sentence on outlying rows, and the rows left out before the search for effects."""
    samples = problem.samples
    changes = found.problem.changes
    weighed = found.weighed
    if changes:  # an outlier segment may look like one
        rows = gather_information(found.completed.regression(samples))
        weighed = weigh_fit(problem.robot, samples, rows)
    *_, hint, outliers = weighed
    light = None if outliers is None else outliers.below()
    if light is None or _last(changes, samples):
        return ("" if changes else hint), None
    return hint, light


def _name_between_changes(problem: Problem, effects: Effects | None, run: Run) -> Naming:
    """Return the naming of logs without the rows of a change in the middle of a log.

    The rows of a change that explains more than any effect are left out before the search. The
    search would otherwise name the change as several effects.
    """
    looked = look(problem, effects)
    run.say("naming effects", 0.3)
    change = None if problem.fixed else find_change_in_log(looked, effects)
    # What was left out already, and is found again, is no change in the middle of a log.
    is_new = change is not None and change.when not in [c.when for c in problem.changes]
    without = leave_out(problem, change) if change is not None and is_new else None
    if without is None:
        return name_missing(looked)
    return _name_between_changes(without, effects, run)


def _last(changes: Sequence[Change], samples: Sequence[Dataset]) -> bool:
    """Whether a change lasts longer than a low-passed outlier segment."""
    for c in changes:
        own = next(s for s in samples if s.name == c.log)
        t = own.output_times()
        d = own.decimation
        during = (t >= c.start) & (t <= c.stop)
        reach = 0.0 if d is None else 2 * d.reach / d.factor
        if np.sum(during) > reach:
            return True
    return False


def _choose_values(
    case: Case, robot: Robot, request: Request, *, commanded: bool
) -> tuple[Structure, KnownValues]:
    """Return the diagnosed model, and the knowledge of the values that it keeps."""
    fixed = request.fixed
    fit, name = read_given(fixed, robot)
    if fit is not None and request.model is None:
        structure = fit.structure
    else:
        model = choose_model(request.model, usual_effects(robot, commanded=commanded))
        structure = case.stages.once(Structure.of, robot, model)
    if fit is not None:
        return structure, know_fit(fit, structure, name)
    if fixed is True:
        return structure, know_file(structure)
    if isinstance(fixed, int | float) and fixed is not False:
        return structure, know_share(float(fixed), structure)
    structure = case.stages.once(count_offsets, structure)
    return structure, know_nothing(structure)


def usual_effects(robot: Robot, *, commanded: bool) -> Strings:
    """Return the effects of the model that is diagnosed when none is given.

    Zeros of commands and encoders differ, and servos turn the difference into torque. Logs of
    commands therefore have torque offsets, as in every verb.
    """
    offsets = ("torque_offset",) if commanded else ()
    return default_effects(robot, (*USUAL_EFFECTS, *offsets))


@frozen(kw_only=True)
class Verified:
    """The named effects that unseen motion leaves in the model.

    Attributes
    ----------
    included, used, gap, fitted, held_before, held_after
        As of `Diagnosis`.
    completed, information, weighed
        The same; `weighed` wherever values were fitted.
    """

    included: int
    used: Recommended
    gap: Prediction
    fitted: Prediction
    held_before: float
    held_after: float
    completed: Structure
    information: Information
    weighed: WeighedFit | None


def verify_effects(naming: Naming, fits: Sequence[Array], plain: Recommended) -> Verified:
    """Return the effects that predict better on folds and that unseen motion does not refute.

    Folds of the fitted logs choose the effects, and unseen motion may refute them. The last effect
    found is removed first, place by place.

    Parameters
    ----------
    naming : Naming
    fits : sequence of (b,)
        Base parameters without any family, then with one more family each.
    plain : Recommended
        The plain model.
    """
    problem = naming.problem
    count = len(naming.parts)
    for n in range(count, -1, -1):
        used = naming if n == count else with_parts(naming, naming.parts[:n])
        best = used.best if n or problem.left_out else plain
        last = naming.of(used.completed) @ best.base
        # The best values stand for the fit of all families.
        each = [*fits[: len(fits) - (0 < n == count)], last]
        gap = naming.predict_unseen(each)
        if not n or ((problem.fixed or used.predicts) and not _is_refuted(gap)):
            break
    held = gap.relative_error().tolist()
    weighed = used.weighed if problem.known.tells_nothing else None
    fitted = naming.predict_fitted([fits[0], last])
    return Verified(
        included=n,
        used=best,
        gap=gap,
        fitted=fitted,
        held_before=held[0],
        held_after=held[-1],
        completed=used.completed,
        information=used.information,
        weighed=weighed,
    )


def find_harmful(naming: Naming) -> list[int]:
    """Return the part without which the error on unseen motion is surely least, if any is harmful.

    What other parts explain would hide it from `verify_effects`.
    """
    every = [*range(len(naming.parts))]
    if not every or not naming.problem.validation:
        return []
    kept = _leave_worst(naming, every, RULES.harmful)
    return [k for k in every if k not in kept]


def _leave_worst(naming: Naming, kept: list[int], errors: float = 1.0) -> list[int]:
    """Return parts without the worst of those that surely harm, by some standard errors."""
    fewer = [[n for n in kept if n != k] for k in kept]
    gap = naming.predict_unseen([naming.fit(subset) for subset in (kept, *fewer)])
    without = gap.relative_error()[1:]
    harmful = [k for k in range(len(fewer)) if gap.surely_better(k + 1, 0, errors)]
    return fewer[min(harmful, key=without.__getitem__)] if harmful else kept


def find_impossible(naming: Naming) -> list[int]:
    """Return the parts whose values would be negative, which their law excludes."""
    positive = [k for k, part in enumerate(naming.parts) if part.candidate.positive]
    return [k for k in positive if (naming.values(k)[0] <= 0).all()]


def find_doubtful(naming: Naming) -> list[int]:
    """Return the parts without which unseen motion errs less, the most harmful first.

    Errors of other parts may refute a right one together with them. So each part that surely harms
    goes first, even if by one standard error.
    """
    every = kept = [*range(len(naming.parts))]
    while kept and (fewer := _leave_worst(naming, kept)) != kept:
        kept = fewer
    return [k for k in every if k not in kept]


def _is_refuted(gap: Prediction) -> bool:
    """Return whether the first model surely errs less on unseen motion than the last one."""
    return gap.surely_better(0, -1) or gap.surely_better_in_all(0, -1, RULES.harmful)


def conclude(naming: Naming, rng: np.random.Generator) -> Diagnosis:
    """Return the diagnosis.

    Parameters
    ----------
    naming : Naming
        The missing effects.
    rng : numpy.random.Generator
        For intervals.
    """
    harmful = find_harmful(naming)
    if harmful:
        return conclude(without_parts(naming, harmful), rng)
    impossible = find_impossible(naming)
    if impossible:
        others = without_parts(naming, impossible)
        return conclude(replace(others, possible=naming.possible), rng)
    problem = naming.problem
    parts = naming.parts
    placed = _place_families(naming)
    order = [k for own in placed for k in own]
    ends = np.cumsum([len(own) for own in placed]).tolist()
    plain = problem.recommended or with_parts(naming, ()).best
    plain_fit = naming.of(problem.plain)
    later_fits = (naming.fit(order[:n]) for n in ends)
    fits = [plain_fit @ plain.base, *later_fits]
    fitted = naming.predict_excerpt(fits[-1])
    found = verify_effects(naming, fits, plain)
    if 0 < found.included < len(parts):
        return conclude(without_parts(naming, range(found.included, len(parts))), rng)
    if not found.included:
        doubtful = find_doubtful(naming)
        if 0 < len(doubtful) < len(parts):
            return conclude(without_parts(naming, doubtful), rng)
    curves = tuple(_curve(naming, fitted, k, p) for own in placed for k, p in own.items())
    discrepancies = tuple(
        find_discrepancies(naming.fitted, fitted.residual[..., 0], problem.robot.joints)
    )
    computed = naming.regression, naming.unseen_regression, naming.excerpt_regression
    more = tuple((naming.completed, own) for own in computed)
    problem = replace(problem, columns=problem.columns + more)
    return Diagnosis(
        problem=problem,
        effects=tuple(_list_effects(naming, placed, found.gap, rng)),
        curves=curves,
        refuted=tuple(_odds_of(*x) for x in naming.refuted),
        possible=tuple(_odds_of(*x) for x in naming.possible),
        interval=change_of(found.gap, 0, -1, rng),
        discrepancies=discrepancies,
        refusals=naming.refusals,
        evidence=_list_evidence(naming),
        lacked=_list_lacked(naming, found.included),
        **vars(found),
    )


def _list_lacked(naming: Naming, included: int) -> MissingEffects:
    """Return the effects that the search found and that the completed model still lacks."""
    left_out = [part.term for part in naming.parts[included:]]
    removed = [term for term, _, needed in naming.possible if np.isnan(needed)]
    named = tuple(dict.fromkeys(left_out + removed))
    return MissingEffects(named, (), noise=naming.search.missing.noise)


def judge_completed(
    case: Case, request: Request, found: Diagnosis, data: Data, run: Run
) -> Diagnosis:
    """Return a diagnosis with the verdicts of `analyze` on its completed model.

    `analyze` would search again for effects that the model still lacks. The search of the diagnosis
    serves instead, if it was for all effects, which saves most of the time. Kept values have no
    verdicts.

    Parameters
    ----------
    case, request, found
    data : Data
        The logs before they are moved along rollouts.
    run : Run
    """
    if found.fixed:
        return found
    later = run.after(0.93)
    rows, searched = _under_completed(found, data)
    weighed = case.weigh(rows, "wls", "auto", later, complete=False)
    # A search for some families alone tells nothing of others.
    known = replace(searched, lacked=found.lacked) if request.effects is None else weighed
    full, reduction = full_model(found.completed.base), found.used.reduction
    models = [full, reduction] if len(reduction) < len(full) else [full]
    options = {"method": "wls", "estimator": "auto", "replicates": 0}
    settings = choose_settings(case, run, found.known.share, None, **options)
    settings["preparation"] = found.preparation
    fitted = compute_ladder(weighed, models, settings["cad_prior"], run=later, rollouts=False)
    # The diagnosis has selected the model.
    fitted = replace(fitted, near=np.eye(len(models), dtype=bool)[-1])
    rng = np.random.default_rng(run.seed)
    judged = conclude_analysis(fitted, rng, settings, known.missing)
    judged = tell_with_file(doubt_springs(judged), found.known.share)
    return _restate_tilt(replace(found, judged=judged))


def _under_completed(found: Diagnosis, data: Data) -> tuple[Data, Data]:
    """Return data under the completed model: rows to fit, and rows that were searched."""
    left_out = {change.log for change in found.changes if change.whole}
    fitted = tuple(log for log in data.recordings.fitted if log.name not in left_out)
    data = replace(data, recordings=replace(data.recordings, fitted=fitted))
    logged = tuple(s for s in data.samples if s.name not in left_out)
    # Errors of delays are measured along the logged motion, not along rollouts.
    samples = logged if found.commanded else found.samples
    columns = partial(found.problem.regression, found.completed)
    under = partial(with_regression, data, found.completed)
    searched = found.problem.excerpt or found.samples
    both = under(samples, columns(samples)), under(searched, columns(searched))
    if data.validation:
        # The diagnosis has computed these columns already.
        vars(both[0])["unseen"] = vars(both[1])["unseen"] = columns(data.validation)
    return both


def _restate_tilt(d: Diagnosis) -> Diagnosis:
    """Return a diagnosis whose table has the angles of the refitted model, as headline and file.

    A tilt that the case had found is in the searched model, too: its part has the rest only.
    """
    names = d.completed.base.names
    effects = list(d.effects)
    for k, e in enumerate(effects[: d.included]):
        rows = [names.index(n) for n in e.placements[0].parameters if n in names]
        if e.name == GravityTilt.name and len(rows) == len(e.placements[0].parameters):
            errors = np.sqrt(np.diag(d.fit.base_covariance)[rows])
            tilt = replace(e.placements[0], values=d.values[rows], errors=errors)
            effects[k] = replace(e, placements=(tilt,))
    return replace(d, effects=tuple(effects))


def _place_families(naming: Naming) -> list[dict[int, Placement]]:
    """Return the placements of each named family by their part, that which explains most first.

    Effects that the case has found go before those of the search. Of the placements of a family the
    largest torque goes first.
    """
    families = defaultdict[str, dict[int, Placement]](dict)
    for k, part in enumerate(naming.parts):
        families[part.candidate.family.name][k] = _place(naming, k)
    started = {t.group.family for t in naming.problem.found}
    odds = {name: max(p.odds for p in own.values()) for name, own in families.items()}
    order = sorted(families, key=lambda name: (name not in started, -odds[name]))
    return [_largest_first(families[name]) for name in order]


def _largest_first(placements: dict[int, Placement]) -> dict[int, Placement]:
    """Return placements in the order of their largest torque."""
    order = sorted(placements, key=lambda k: -placements[k].peak)
    return {k: placements[k] for k in order}


def _list_effects(
    naming: Naming,
    placed: Sequence[dict[int, Placement]],
    gap: Prediction,
    rng: np.random.Generator,
) -> Iterator[NamedEffect]:
    """Yield the named effects, family by family, with the errors before and after each."""
    robot = naming.problem.robot
    errors = gap.relative_error()
    for at, parts in enumerate(placed):
        own = [naming.parts[k] for k in parts]
        family = own[0].candidate.family
        near = [title_of(t.group.family) for p in own for t in p.nearest]
        everywhere = 1 < len(family.places(robot)) == sum(p.sure for p in parts.values())
        yield NamedEffect(
            name=family.name,
            placements=tuple(parts.values()),
            before=float(errors[at]),
            after=float(errors[at + 1]),
            interval=change_of(gap, at, at + 1, rng),
            everywhere=everywhere,
            nearest=tuple(dict.fromkeys(near)),
        )


def _odds_of(term: Term, unseen: float, needed: float = np.nan) -> Odds:
    """Return the odds of a term with its gain on rows to which it was not fitted."""
    return Odds(term.group.family, place_of(term), term.odds, unseen=unseen, needed=needed)


def _list_evidence(naming: Naming) -> tuple[Odds, ...]:
    """Return the log odds of all groups, without and with the named effects."""
    after = {t.key: t.odds for t in naming.after}
    return tuple(
        Odds(t.group.family, place_of(t), t.odds, after.get(t.key, np.nan)) for t in naming.before
    )


def _measure_torque(naming: Naming, k: int, value: Array) -> Fields:
    """Return size and place of the torque of a part, as fields of `Placement`.

    At a motor of several joints it is the torque of this motor, else of the joint where it is
    largest.
    """
    robot, place = naming.problem.robot, naming.parts[k].candidate.place
    sizes = {j: float(rms_of(naming.columns([k], j) @ value)) for j in naming.acts(k)}
    joint = max(sizes, key=sizes.__getitem__, default=0)
    size = sizes.get(joint, 0.0)
    peak = float(np.abs(_law(naming, k, joint) @ value).max(initial=0.0))
    whole = naming.fitted.measured[naming.fitted.seen.data[:, joint], joint]
    share = size / (float(whole.std()) or np.inf)
    lever, unit = 1.0, robot.torque_units[joint]
    for axis in robot.axes:
        if axis.name == place and axis.mixed and axis.row is not None:
            lever = abs(float(axis.row[joint]))
            unit = "N" if axis.prismatic else "N·m"
    sizes_there: Fields = {"rms": size / lever, "peak": peak / lever, "torque_unit": unit}
    return sizes_there | {"joint": robot.joints[joint], "share": share}


def _place(naming: Naming, k: int) -> Placement:
    """Return the placement of a part: values, torque, odds and rivals."""
    part = naming.parts[k]
    c = part.candidate
    value, covariance = naming.values(k)
    if c.positive:
        value = np.maximum(value, 0.0)
    parameters = part.parameters(naming.problem.robot)
    rivals = [r.key for r in part.rivals]  # a family everywhere is here, too
    here = (Rival(name, place.replace(EVERYWHERE, c.place)) for name, place in rivals)
    return Placement(
        place=c.place,
        shape=c.shape,
        shape_error=naming.shape_error(k),
        exponent=getattr(c.effect, "exponent", None) or np.nan,
        parameters=tuple(x.name for x in parameters),
        units=tuple(x.unit for x in parameters),
        values=value,
        errors=np.sqrt(np.maximum(np.diag(covariance), 0.0) + part.spread**2),
        **_measure_torque(naming, k, value),
        rivals=tuple(dict.fromkeys(here)),
        weight=part.weight,
        odds=part.term.odds,
        unseen=part.unseen,
        sure=bool(np.isfinite(part.left_out)),
    )


def _unfiltered(naming: Naming, part: Part) -> Array:
    """Return the columns of a part without the low-pass, (N, n, m).

    Low-passed columns depend on the past of the motion.
    """
    robot = naming.problem.robot
    rows = naming.fitted
    effect = Placed([part])
    columns = np.zeros((*rows.measured.shape, len(effect.parameters(robot))))
    effect.fill(robot, complete_motion(robot, rows.seen.t, *rows.states), columns)
    return columns


def _law(naming: Naming, k: int, j: int) -> Array:
    """Return the columns of a part at a joint, (N, m); of a law of the motion without low-pass."""
    c = naming.parts[k].candidate
    remembers = c.family.remembers or naming.problem.robot.closed
    if remembers or c.family.against not in ("velocity", "position"):
        return naming.columns([k], j)
    return _unfiltered(naming, c.part)[:, j]


def _curve(naming: Naming, fitted: Prediction, k: int, placed: Placement) -> Curve:
    """Return the learned law of a part along the fitted motion."""
    c = naming.parts[k].candidate
    j = naming.problem.robot.joints.index(placed.joint)
    of = c.effect.drawn_over(naming.problem.robot, j)
    measured = fitted.data[:, j]
    data = fitted.residual[:, j, 0] + naming.columns([k], j) @ placed.values
    law = _law(naming, k, j)[measured]
    x = naming.fitted.along(of)[c.family.against]
    variance = law**2 @ placed.errors**2
    return Curve(
        title=c.family.title,
        joint=j,
        of=of,
        against=c.family.against,
        x=x[measured],
        learned=law @ placed.values,
        spread=np.sqrt(variance),
        data=data[measured],
    )
