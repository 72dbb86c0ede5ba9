"""The main job: robot and logs in, one verdict per parameter and a model to use out.

Models are fitted, each with the nearest real robot (`settle_robot`); every
parameter is judged by what noise, other motion and what is left out leave open (`decide_model`),
and one model is selected.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from identifiability.effects.base import move_mounting
from identifiability.estimation.estimate import (
    Kind,
    Method,
    estimate_noise,
    find_estimator,
    fit_whole,
    with_known,
)
from identifiability.estimation.estimator import Estimate, Estimator, clip_signs
from identifiability.estimation.evidence import Folds, HeldOut, Score, near_best
from identifiability.estimation.fit import Fit, find_left_out
from identifiability.estimation.groups import MissingEffects
from identifiability.estimation.prediction import Prediction, Task, predict, predict_all
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.verdict import Flag, Verdict, judge, narrow
from identifiability.foundation.defaults import DEFAULTS
from identifiability.foundation.engines import Engine, one_thread
from identifiability.foundation.errors import LogError, ModelError, listing
from identifiability.foundation.findings import Finding
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array
from identifiability.foundation.options import NotNegative, Replicates, Seed, checked, resolve_count
from identifiability.foundation.rounding import REACH
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Dataset, Preparation, prepare_log
from identifiability.logs.prepare.instruments import noise_again
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.logs.spectrum import Band
from identifiability.physical.cad_prior import WEAK, WEIGHTS, combine_with_file, resolve_prior
from identifiability.physical.feasibility import (
    PhysicalResult,
    certify_model,
    choose_prior,
    find_nearest,
)
from identifiability.physical.fitted_model import FittedModel
from identifiability.regression.information import Information, gather_information
from identifiability.regression.reduction import (
    LadderLike,
    Submodel,
    build_comparison,
    find_ladder,
    ladder_model,
)
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike
from identifiability.workflows.analyze.belief import Belief, form_belief, refine_verdicts
from identifiability.workflows.analyze.result import (
    Analysis,
    Laddered,
    ModelResult,
    compare_logs,
    doubt,
)
from identifiability.workflows.session import (
    Logs,
    Progress,
    Session,
    Weighed,
    count_offsets,
    quiet,
    running,
    share,
)

# Models are fitted, and the real robot nearest to each is sought.


@frozen
class Settled:
    """A fitted model with the nearest real robot, and what both predict in turns.

    Attributes
    ----------
    model : FittedModel
    robot : PhysicalResult
    free : Score
        Of the estimated values, on folds.
    real : Score or None
        The same of the nearest real robot; None where there is none.
    crossed : (F, b, 2)
        Base parameters of both, found from each fold's rest.
    """

    model: FittedModel
    robot: PhysicalResult
    free: Score
    real: Score | None
    crossed: Array

    @property
    def values(self) -> Array:
        """Base parameters (b, 4): as estimated, and of the nearest real robot.

        Then what a robot file holds of the latter: of its own format, and of the other.
        """
        free = self.model.submodel.expand(self.model.estimate.value)
        return np.column_stack([free, self.robot.base, *self.robot.in_files])

    @property
    def turned(self) -> Array:
        """The same found from each fold's rest, (F, b, 4); files lack as much as of the whole."""
        lacking = self.values[:, 2:] - self.values[:, 1:2]
        return np.concatenate([self.crossed, self.crossed[:, :, 1:] + lacking], axis=2)


def fit_ladder(
    rows: Weighed, submodels: Sequence[Submodel], cad_weight: float | None
) -> tuple[list[Settled], Folds, str]:
    """Fit models with their real robots; return also the folds, and why they choose nothing.

    Parameters
    ----------
    rows : Weighed
    submodels : sequence of Submodel
    cad_weight : float or None
        Of the prior around the robot file; by default predictions choose it (`choose_prior`).
    """
    structure, information = rows.opening.structure, rows.information
    estimator = estimate_noise(rows.estimator, information)
    held_out, short = hold_folds(information, estimator)
    found: list[Settled] = []
    for submodel in submodels:  # a smaller one asks for no heavier prior than the unpruned
        model = FittedModel.of(structure, submodel, information, estimator)
        heaviest = found[0].robot.cad_weight if found else np.inf
        found.append(settle_robot(model, held_out, cad_weight, heaviest, choose=not short))
    return found, held_out.folds, short


def hold_folds(information: Information, estimator: Estimator) -> tuple[HeldOut, str]:
    """Return folds of the fitted logs; those of logs too short for a choice, and why they are."""
    fit = estimator.fit(information)
    try:
        return HeldOut.of(information, fit.noise), ""
    except LogError as error:
        short = (
            "Whether values of a robot that can exist predict as well, and how strongly the robot "
            f"file's bodies pull, could not be asked: {error}"
        )
        return HeldOut.of(information, fit.noise, Folds.of(information)), short


def settle_robot(
    model: FittedModel,
    held_out: HeldOut,
    cad_weight: float | None,
    heaviest: float = np.inf,
    *,
    choose: bool = True,
    certified: Sequence[Any] = (),
) -> Settled:
    """Return the nearest real robot of a model, and what both predict in turns.

    Parameters
    ----------
    model : FittedModel
    held_out : HeldOut
        Folds of what was fitted.
    cad_weight : float or None
        As in `fit_ladder`.
    heaviest : float
        Weight that is tried.
    choose : bool
        Whether folds may choose; else the prior is weak, unless it is given.
    certified : (Certificate or None, str), optional
        What `certify_model` says of it, where that is known.
    """
    submodel, fit = model.submodel, model.estimate
    free = held_out.refit(fit, submodel.M, submodel.fixed)
    score = held_out.score(free, held_out.roots(fit, submodel.M))
    weight = WEAK if cad_weight is None and not choose else cad_weight
    tried = [w for w in WEIGHTS if w <= heaviest] if weight is None else [weight or WEIGHTS[-1]]
    chosen = choose_prior(model, held_out, score, tried)
    if weight is None:
        weight = WEAK if chosen is None else chosen.weight
    robot = find_nearest(model, weight)
    certificate, said = certified or certify_model(model)
    robot = replace(robot, certificate=certificate, sentence=said + robot.sentence)
    if chosen is None:
        return Settled(model, robot, score, None, np.stack([free, np.full_like(free, np.nan)], 2))
    if choose:
        robot = replace(robot, as_good=chosen.as_good)
    return Settled(model, robot, score, chosen.score, np.stack([free, chosen.values], 2))


@frozen
class SharedErrors:
    """What errors that all samples of a log share do to values.

    ``delay``: of delays and gains of servos. ``bias``: of noise that a cut-off lets into computed
    derivatives, where no second record of the motion takes it away: with as much noise once more
    values move by what it has moved them already [Cook 1994].

    Attributes
    ----------
    information : Information
        About all columns, before rows were weighed.
    others : mapping of str to tuple of Information
        The same, had commands of one log acted one standard deviation of its delay later, or had
        gains that were found been others by one; and with the noise of the motion once more.
    estimator : Estimator
    """

    information: Information
    others: Mapping[str, tuple[Information, ...]]
    estimator: Estimator

    @classmethod
    def of(cls, session: Session, rows: Weighed) -> SharedErrors:
        """Return them for samples that are fitted."""
        opening, how, known = rows.opening, session.how, session.recordings

        def gather(logs: Mapping[int, Log]) -> Information:
            structure, samples = opening.structure, list(opening.samples)
            for k, log in logs.items():
                samples[k] = measure_again(opening.robot, log, samples[k], how)
            return with_known(gather_information(structure.regression(samples)), structure.known)

        asked = {"delay": known.later, "bias": ()}
        band = getattr(how, "band", None)
        loud = opening.robot.base or (band and band.noise > LOG_RULES.small)  # a base always is
        if loud and not (rows.estimator.instruments or known.commanded):
            logs = ((k, log) for k, log in enumerate(known.fitted) if not log.long)
            asked["bias"] = ({k: noise_again(x, np.random.default_rng(0)) for k, x in logs},)
        others = {name: tuple(map(gather, each)) for name, each in asked.items() if each}
        return cls(rows.alike, others, rows.estimator)

    def move(self, submodel: Submodel) -> dict[str, Array]:
        """Return by how much each of them moves the values of a model, (w, k)."""
        own = self.estimator.fit(submodel.reduce(self.information)).value if self.others else None
        return {
            name: np.array([self.estimator.fit(submodel.reduce(x)).value - own for x in others])
            for name, others in self.others.items()
        }

    def together(self, submodel: Submodel) -> Array:
        """Return all of them, (w, k)."""
        return np.vstack([np.zeros((0, len(submodel))), *self.move(submodel).values()])


def measure_again(robot: Robot, log: Log, own: Dataset, how: Preparation) -> Dataset:
    """Return motion and torque as a log measures them again, if that keeps the same rows."""
    moved = prepare_log(robot, log, how)
    alike = np.array_equal(moved.motion.kept, own.motion.kept)
    return replace(own, motion=moved.motion, tau=moved.tau) if alike else own


# What is judged of each.


def decide_model(
    model: FittedModel,
    torque: float,
    rng: np.random.Generator,
    replicates: int,
    full: Estimate | None,
    missing: MissingEffects,
    late: SharedErrors | None = None,
    real: PhysicalResult | None = None,
) -> tuple[Fit, tuple[Verdict, ...], tuple[str, ...]]:
    """Return a fit with all that its model leaves open, its verdicts, and impossible signs.

    Parameters
    ----------
    model : FittedModel
    torque : float [N·m or N]
        Root mean square of the measured torque.
    rng : numpy.random.Generator
    replicates : int
        Of the bootstrap.
    full : Estimate or None
        Of all base parameters.
    missing : MissingEffects
        What may be missing beside these.
    late : SharedErrors, optional
        What errors that all samples share do to the values of a model.
    real : PhysicalResult, optional
        The nearest real robot: it may be right, too, where it predicts as well.
    """
    structure, submodel, estimate = model.structure, model.submodel, model.estimate
    fit = Fit.of(model.information, estimate, rng, replicates)
    shared = dict(fit.shared) | (late.move(submodel) if late else {})
    if real is not None and real.as_good and real.nearest is not None:
        apart = model.to_x @ real.nearest.phi - estimate.value
        shared["prior"] = np.where(estimate.determined, apart, 0.0)[None]
    left_out = find_left_out(structure, submodel, model.whole, estimate, full)
    alternatives = missing.of_labels(submodel, estimate)
    fit = replace(fit, shared=shared, left_out=left_out, alternatives=alternatives)
    stated = np.linalg.lstsq(submodel.M, structure.nominal_base - submodel.fixed, rcond=None)[0]
    signed = submodel.nonnegative & estimate.determined
    forbidden = signed & (clip_signs(model.information, estimate, signed) < 0)
    told = submodel.labels, submodel.units, torque, _aliases(estimate), forbidden, stated
    return fit, judge(fit, *told), tuple(np.array(submodel.columns, object)[forbidden])


def assess_ladder(
    settled: Sequence[Settled],
    fitted: Prediction,
    unseen: Prediction,
    rng: np.random.Generator,
    replicates: int,
    missing: MissingEffects,
    late: SharedErrors | None = None,
) -> tuple[ModelResult, ...]:
    """Return the results of all m models.

    Parameters
    ----------
    settled : sequence of Settled
    fitted, unseen : Prediction
        By the four accounts of each (`Settled.values`), on the logs that were fitted and on others.
    rng, replicates, missing, late
        As of `decide_model`.
    """
    torque, first = float(np.sqrt(np.mean(fitted.rms**2))), settled[0].model
    full = fit_whole(first.estimate.estimator, first.whole) if first.estimate.kept else None
    what, results = (rng, replicates, full, missing, late), []
    for k, one in enumerate(settled):
        model, at = one.model, range(4 * k, 4 * k + 4)
        fit, verdicts, infeasible = decide_model(model, torque, *what, one.robot)
        result = ModelResult(
            submodel=model.submodel,
            estimate=model.estimate,
            fit=fit,
            verdicts=verdicts,
            infeasible=infeasible,
            physical=one.robot,
            fitted=fitted.select(at),
            unseen=unseen.select(at),
        )
        results.append(result)
    return tuple(results)


Answered = TypeVar("Answered", bound=Laddered[Any])


def tell_with_file(found: Answered, share: float) -> Answered:
    """Return an answer whose verdicts say what the file's bodies add, and what logs say of these.

    What logs determine stays; what they leave open may be narrowed by bodies within a share of the
    file's.

    Parameters
    ----------
    found : Laddered
    share : float
        0 for none.
    """
    structure, rules = found.structure, Thresholds()
    stated = structure.robot.prior or structure.robot.said.prior_share
    if found.nothing or not (share or stated):
        return found
    data = found.fit.of_standard
    models, hint = list[Any](), ""
    for model in found.models:
        to_x = np.linalg.pinv(model.submodel.M)
        try:
            both = combine_with_file(structure, data.R, data.z, to_x @ structure.G, share)
        except ValueError:  # bodies that no prior can be around are said elsewhere
            return found
        verdicts, hint = list(model.verdicts), both.hint
        means = both.mean - to_x @ model.submodel.fixed
        for k, (v, mean, sd) in enumerate(zip(verdicts, means, both.sd, strict=True)):
            if v.open and sd**2 < rules.constraint_variance * v.sigma_robust**2:
                low, high = float(mean - REACH * sd), float(mean + REACH * sd)
                text = (
                    f"Who believes {both.words} is left with {low:.3g} … {high:.3g} (95 %); the "
                    "file narrows it, not the log."
                )
                verdicts[k] = narrow(v, Flag.BY_PRIOR, text, (low, high))
        models.append(replace(model, verdicts=tuple(verdicts)))
    hints = tuple(filter(None, (*found.hints, hint)))
    return replace(found, models=tuple(models), hints=hints)


def _aliases(fit: Estimate) -> tuple[str, ...]:
    """Return, for each undetermined parameter, what this motion cannot tell it from."""
    out, leans = [""] * len(fit.columns), np.abs(fit.open)
    for k in np.flatnonzero(~fit.determined):
        shared, own = (leans * leans[k]).max(1, initial=0.0), k in fit.kept
        near = (i for i in np.argsort(-shared) if (i in fit.kept) != own and shared[i] > NEARLY)
        others = [fit.columns[i] for i in near]
        out[k] = (
            f"This motion determines only its combination with {listing(others, 4)}."
            if others
            else "This motion never makes it act on the torque."
        )
    return tuple(out)


def select_model(results: Sequence[ModelResult], near: np.ndarray) -> int:
    """Return the smallest of the models that may stand for the best, possible ones first.

    Folds of the fitted logs choose (`evidence.near_best`); logs that are held out do not.

    Of those that they leave, models come last of which the data call something identifiable that
    physics forbids, and models that a real robot can have first, then those without forbidden
    signs.

    Parameters
    ----------
    results : sequence of m ModelResult
    near : (m,) bool
    """

    def rank(k: int) -> tuple[bool, bool, bool, int, float]:
        r = results[k]
        impossible = bool(r.contradicted), not r.feasible, bool(r.infeasible)
        return *impossible, len(r.submodel), r.error_ra_validation

    return min(np.flatnonzero(near).tolist(), key=rank)


# What is said beside the models: a cut-off that is wrong, and what the fit says of its logs.


def say_band(band: Band | None) -> tuple[str, ...]:
    """Return what to say of a cut-off: it cuts into the motion, or much noise is below it."""
    said = list[Finding]()
    if band is not None and band.cutoff < 2.0 * band.bandwidth:
        least = 0.5 * LOG_RULES.cutoff_wide * band.bandwidth
        numbers = {"least": least, "rate": least / LOG_RULES.cutoff_highest}
        reach = {"cutoff": band.cutoff, "bandwidth": band.bandwidth}
        said.append(Finding("cutoff_low", whose=["the logs"], **numbers, **reach))
    # On one period of a motion intervals hold up to three tenths.
    if band is not None and band.noise > 0.2:
        found = {"cutoff": band.cutoff, "share": min(band.noise, 1.0)}
        said.append(Finding("cutoff_noisy", limit=min(band.limit, band.cutoff), **found))
    return tuple(said)


def say_of_fit(
    session: Session, samples: Sequence[Dataset], result: ModelResult, missing: Sequence[str]
) -> list[str]:
    """Return hints from a fit on its logs: a mounting to correct, logs that disagree.

    Corrections of a mounting are linear where they are small: what is left of a large one is found
    from there.
    """
    sure = {v.name: v.value for v in result.verdicts if v.sure and not v.open}
    entry = move_mounting(session.structure.robot, sure)
    moved = Finding("imu_moved", entry=entry) if entry else ""
    return [*filter(None, (moved, compare_logs(samples, result, missing)))]


def predict_everywhere(
    session: Session, rows: Weighed, own: Settled, which: int, turns: Folds | None
) -> Prediction | None:
    """Return torque along unseen motion where joints stand, too; None where none does.

    Parameters
    ----------
    session : Session
    rows : Weighed
    own : Settled
    which : int
        Of its accounts.
    turns : Folds or None
        Which fold's predicts a sample; of no account where logs are held out.
    """
    opening, known = rows.opening, session.recordings
    samples = opening.validation or opening.samples
    logs = known.held_out if opening.validation else known.fitted
    stand = any((s.survey.rows < s.survey.outputs).any() for s in samples)
    hidden = opening.robot.base is not None or any(x.unmeasured is not None for x in logs)
    if hidden or not stand:
        return None
    regression = replace(opening.unseen or opening.regression, dwelling=True)
    turns = None if opening.validation else turns
    values = own.values[None] if turns is None else own.turned
    return predict_all(regression, [Task(values[:, :, [which]], turns, kept=False)])[0]


# The whole way from logs to the answer.


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
        Refits of the block bootstrap, 0 for none; by default `DEFAULTS.refits`, or
        `DEFAULTS.refits_quick` if `quick`.
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
    draws = resolve_count(replicates, DEFAULTS.refits, DEFAULTS.refits_quick, quick=quick)
    streams = np.random.default_rng(seed).spawn(3)
    with one_thread("blas"):
        robot = Robot.of(robot)
        source = find_ladder(robot, ladder, beside=True)
        with running(engine) as runner:  # workers are gone when their memory is wanted elsewhere
            structure = count_offsets(Structure.of(robot, ladder_model(source.entry)))
            session = Session.read(structure, logs, validate, preparation, say, runner)
            commanded = session.recordings.commanded
            share_, cad_prior = resolve_prior(prior, cad_prior, commanded)
            given = session.follow(streams[0])
            session, opening = given.settle("analyzed")
            entry = source.models_for(commanded=commanded)
            # A model that was given is taken as it is.
            rows = session.weigh(opening, base, estimator, whole=ladder is None)
            try:
                submodels = build_comparison(entry, rows.opening.structure)
            except ModelError:  # its models are of parameters of the model as it was given
                session, rows = given, given.weigh(given.open("analyzed"), base, estimator)
                submodels = build_comparison(entry, rows.opening.structure)
            settings = {
                "method": base.name,
                "seed": seed,
                "estimator": estimator,
                "replicates": draws,
                "posterior": posterior,
                "cad_prior": cad_prior,
                "prior": share_,
                "preparation": preparation or Preparation(),
            }
            found = conclude_analysis(session, rows, submodels, streams[1], settings)
        found = tell_with_file(replace(found, source=source), share_)
        return believe(found, streams[2], say, share_) if posterior else found


def believe(found: Analysis, rng: np.random.Generator, say: Progress, within: float) -> Analysis:
    """Return the analysis with the posteriors of the selected model, bodies within a share."""
    if found.nothing:
        return replace(found, belief=Belief(None, {}, found.nothing))
    chosen, whole = found.chosen, found.information
    part = chosen.submodel.reduce(whole)
    model = FittedModel(found.structure, chosen.submodel, whole, part, chosen.estimate)
    sampling = share(say, "sampling the posterior", 0.9, 0.99)
    belief, models = form_belief(model, rng, share=within, progress=sampling), list(found.models)
    models[found.selected] = replace(chosen, verdicts=refine_verdicts(chosen.verdicts, belief))
    return replace(found, models=tuple(models), belief=belief)


def conclude_analysis(
    session: Session,
    rows: Weighed,
    submodels: Sequence[Submodel],
    rng: np.random.Generator,
    settings: Mapping[str, Any],
    missing: MissingEffects | None = None,
) -> Analysis:
    """Fit the models, predict torque by them, judge every parameter and choose one model."""
    say, opening = session.say, rows.opening
    say("fitting models", 0.6)
    late, whole = SharedErrors.of(session, rows), rows.information
    settled, folds, short = fit_ladder(rows, submodels, settings["cad_prior"])
    scores = [one.free for one in settled]
    near = near_best(scores)
    values = np.concatenate([one.values for one in settled], axis=1)
    turned = np.concatenate([one.turned for one in settled], axis=2)
    tasks = [Task(values[None]), *([] if opening.validation else [Task(turned, folds)])]
    say("predicting torque", 0.65)
    fitted, *others = predict_all(opening.regression, tasks)
    others = others if opening.unseen is None else [predict(opening.unseen, values)]
    unseen, missing = (others or [fitted])[0], missing or rows.missing
    given = rng, settings["replicates"], missing, late
    results = assess_ladder(settled, fitted, unseen, *given)
    at = select_model(results, near)
    results, nothing = doubt(opening.misread, results, at)
    hints = [*opening.hints, rows.burst, short]
    hints += () if session.recordings.commanded else say_band(getattr(session.how, "band", None))
    if not opening.explained:  # exchanged columns, a wrong unit or late torque explain the rest
        hints += say_of_fit(session, opening.samples, results[at], missing.functions)
    used, full = int(results[at].physical_used), settled[0].model.submodel
    return Analysis(
        structure=opening.structure,
        samples=opening.samples,
        validation=opening.validation,
        hints=tuple(filter(None, hints)),
        information=whole,
        models=results,
        selected=at,
        everywhere=predict_everywhere(session, rows, settled[at], used, folds),
        settings=settings,
        nothing=nothing,
        recordings=session.recordings,
        alternative=opening.alternative,
        missing=missing,
        late=late.together(full) @ full.M.T,
    )
