"""The main job: robot and logs in, one verdict per parameter and a model to use out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.estimation.estimate import Kind, Method, find_estimator, settle_noise
from identifiability.estimation.estimator import Estimator, Noise, leave_open
from identifiability.estimation.evidence import Evidence, Folds, HeldOut, Score, near_best
from identifiability.estimation.prediction import Task, predict, predict_all
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.torque_errors import take_turns
from identifiability.foundation.engines.mapping import Engine, one_thread
from identifiability.foundation.errors import LogError, ModelError
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array
from identifiability.foundation.options import (
    NotNegative,
    Replicates,
    Seed,
    checked,
    renamed,
    settle_count,
)
from identifiability.foundation.rounding import format_number, join
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Dataset, Preparation, prepare_log
from identifiability.logs.prepare.instruments import noise_again
from identifiability.logs.prepare.preparation import SettledPreparation, settle_cutoff
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.logs.spectrum import Band
from identifiability.physical.cad_prior import WEAK, WEIGHTS
from identifiability.physical.feasibility import (
    PhysicalResult,
    certify_model,
    choose_prior,
    find_nearest,
    leave_undecided,
)
from identifiability.physical.fitted_model import FittedModel
from identifiability.regression.gather import gather_information
from identifiability.regression.information import Information
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
from identifiability.workflows.analyze.result import (
    Analysis,
    compare_logs,
    doubt,
    state_mounting,
    state_weak,
)
from identifiability.workflows.opening import Logs, Progress, quiet, running, share
from identifiability.workflows.session import Session, Weighed, find_missing, settle_prior


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
        opening, how = rows.opening, session.how
        if opening.silence:
            return cls(rows.alike, {}, rows.estimator)
        delay, bias = list[Information](), tuple[Information, ...]()
        for logs in session.recordings.later:
            samples = list(opening.samples)
            for k, log in logs.items():
                own, moved = samples[k], prepare_log(opening.robot, log, how)
                if moved.tau.shape == own.tau.shape:
                    samples[k] = replace(own, tau=moved.tau)
            delay.append(gather_information(opening.structure.regression(samples)))
        band = how.band if isinstance(how, SettledPreparation) else None
        loud = band is not None and band.noise > LOG_RULES.noise_share
        if loud and not (rows.estimator.instruments or session.recordings.commanded):
            pairs = zip(session.recordings.fitted, opening.samples, strict=True)
            samples = [_noisier(opening.robot, log, own, how) for log, own in pairs]
            bias = (gather_information(opening.structure.regression(samples)),)
        each = {"delay": tuple(delay), "bias": bias}
        return cls(rows.alike, {name: x for name, x in each.items() if x}, rows.estimator)

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


def _noisier(robot: Robot, log: Log, own: Dataset, how: Preparation) -> Dataset:
    """Return samples along a motion with as much noise once more, if it is in memory."""
    if own.long:
        return own
    moved = prepare_log(robot, noise_again(log, np.random.default_rng(0)), how)
    alike = np.array_equal(moved.motion.kept, own.motion.kept)
    return replace(own, motion=moved.motion) if alike else own


@frozen
class FittedLadder:
    """Models that were fitted, with the nearest real robot of each.

    Attributes
    ----------
    models : tuple of FittedModel
    robots : tuple of PhysicalResult
    crossed : (F, b, 2m)
        Base parameters of the m models, and of their nearest real robots, found from each fold's
        rest.
    folds : Folds or None
        None where nothing was fitted.
    near : (m,) bool
        Which models may stand for the one that predicts the folds best; none where nothing was
        fitted.
    judged : tuple of Evidence
        Of each model against that one; empty where nothing was fitted.
    short : str
        That predictions choose nothing, and why; empty where they do.
    """

    models: tuple[FittedModel, ...]
    robots: tuple[PhysicalResult, ...]
    crossed: Array
    folds: Folds | None
    near: np.ndarray
    judged: tuple[Evidence, ...] = ()
    short: str = ""

    @property
    def values(self) -> Array:
        """Base parameters (b, 4m) of the m models, then of their nearest real robots.

        Then what robot files of their own format hold of these, and of the other.
        """
        fits = [m.submodel.expand(m.estimate.value) for m in self.models]
        robots = [p.base for p in self.robots]
        files = [p.in_files[k] for k in range(2) for p in self.robots]
        return np.stack([*fits, *robots, *files], 1)

    def in_turns(self) -> Task:
        """Return how stretches (or logs) are predicted by models fitted to the others."""
        assert self.folds is not None
        return Task(self.crossed, take_turns(self.models[0].whole, self.folds.test))


def fit_ladder(
    structure: Structure,
    submodels: Sequence[Submodel],
    information: Information,
    estimator: Estimator,
    cad_weight: float | None,
    silence: str,
) -> FittedLadder:
    """Fit models, and say what physics says of each.

    With `silence`, which says why there is nothing to explain, nothing is fitted.

    Parameters
    ----------
    cad_weight : float or None
        Of the prior around the robot file; by default predictions choose it (`choose_prior`).
    """
    if silence:
        parts = [submodel.reduce(information) for submodel in submodels]
        open_ = tuple(
            FittedModel(structure, submodel, information, part, leave_open(part, estimator))
            for submodel, part in zip(submodels, parts, strict=True)
        )
        undecided = tuple(leave_undecided(structure, submodel, silence) for submodel in submodels)
        none = np.empty((0, information.size, 0))
        return FittedLadder(open_, undecided, none, None, np.zeros(len(submodels), bool))
    models = tuple(
        FittedModel.of(structure, submodel, information, estimator) for submodel in submodels
    )
    held_out, short = hold_folds(information, estimator)
    found: list[Settled] = []
    for model in models:  # a smaller one asks for no heavier prior than the unpruned
        heaviest = found[0].robot.cad_weight if found else np.inf
        found.append(settle_robot(model, held_out, cad_weight, heaviest, choose=not short))
    robots = tuple(
        one.robot.with_certificate(*certify_model(model))
        for one, model in zip(found, models, strict=True)
    )
    crossed = np.concatenate([one.crossed for one in found], 2)
    m = len(models)
    order = [*range(0, 2 * m, 2), *range(1, 2 * m, 2)]
    scores = [one.free for one in found]
    best = max(scores, key=lambda score: float(score.density.sum()))
    judged = tuple(Evidence.of(score, best) for score in scores)
    crossed, near = crossed[:, :, order], near_best(scores)
    return FittedLadder(models, robots, crossed, held_out.folds, near, judged, short)


def hold_folds(information: Information, estimator: Estimator) -> tuple[HeldOut, str]:
    """Return folds of the fitted logs; those of logs too short for a choice, and why they are."""
    fit = estimator.fit(information)
    noise = Noise(fit.variance, fit.times)
    try:
        return HeldOut.of(information, noise), ""
    except LogError as error:
        short = (
            "Whether values of a robot that can exist predict as well, and how strongly the robot "
            f"file's bodies pull, could not be asked: {error}"
        )
        return HeldOut.of(information, noise, Folds.short(information)), short


@frozen
class Settled:
    """The nearest real robot of a model, and what both predict.

    Attributes
    ----------
    robot : PhysicalResult
    free : Score
        Of the estimated values, on the folds.
    real : Score or None
        Of the nearest real robot; None where there is none.
    crossed : (F, b, 2)
        Base parameters of both, found from each fold's rest.
    """

    robot: PhysicalResult
    free: Score
    real: Score | None
    crossed: Array


def settle_robot(
    model: FittedModel,
    held_out: HeldOut,
    cad_weight: float | None,
    heaviest: float = np.inf,
    *,
    choose: bool = True,
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
    """
    submodel, fit = model.submodel, model.estimate
    free = held_out.refit(fit, submodel.M, submodel.fixed)
    score = held_out.score_roots(free, held_out.roots(submodel.M[:, list(fit.kept)]))
    weight = WEAK if cad_weight is None and not choose else cad_weight
    tried = [w for w in WEIGHTS if w <= heaviest] if weight is None else [weight or WEIGHTS[-1]]
    chosen = choose_prior(model, held_out, score, tried)
    values = np.full(free.shape, np.nan) if chosen is None else chosen.values
    if weight is None:
        weight = WEAK if chosen is None else chosen.weight
    nearest = find_nearest(model, weight)
    if chosen is not None and choose:
        nearest = replace(nearest, as_good=chosen.as_good)
    real = None if chosen is None else chosen.score
    return Settled(nearest, score, real, np.stack([free, values], 2))


# The low-pass of computed derivatives: does it cut the motion, does it let noise in?


def say_band(how: Preparation | None) -> tuple[str, ...]:
    """Return what to say of the cut-off for all logs: does it cut the motion, let noise in?"""
    band = how.band if isinstance(how, SettledPreparation) else None
    found = () if band is None else (_say_cut(band, "the logs"), _say_noise(band))
    return tuple(filter(None, found))


def say_unseen(session: Session) -> str:
    """Return one sentence on a cut-off in the band of held-out motion alone, or nothing."""
    how, logs = session.how, session.recordings.held_out
    both = (how, settle_cutoff(session.structure.robot, logs, how))
    own, seen = (x.band if isinstance(x, SettledPreparation) else None for x in both)
    if own is None or seen is None or _say_cut(own, ""):
        return ""
    return _say_cut(seen, join([log.name for log in logs]))


def _say_cut(band: Band, whose: str) -> str:
    """Return one sentence on a cut-off in the band of the motion, or nothing."""
    # A cut-off below so many times the band of the motion cuts into it.
    if band.cutoff >= 2.0 * band.bandwidth:
        return ""
    least = LOG_RULES.cutoff_lowered * LOG_RULES.cutoff_wide * band.bandwidth
    remedy = f"set it to {format_number(least, 2)} Hz or more (--set cutoff)"
    if least > LOG_RULES.cutoff_highest * band.rate:
        rate = format_number(least / LOG_RULES.cutoff_highest, 2)
        remedy = f"sample at {rate} Hz or faster, or move slower"
    return (
        f"The cut-off of {band.cutoff:.3g} Hz cuts into the motion of {whose}, which reaches "
        f"{band.bandwidth:.3g} Hz: accelerations are missing, and values are wrong; {remedy}."
    )


def _say_noise(band: Band) -> str:
    """Return one sentence on noise below the cut-off, or nothing."""
    # On one period of a motion intervals hold up to three tenths.
    if band.noise <= 0.2:
        return ""
    remedy = "measure velocities, or let the robot accelerate more"
    if band.limit < band.cutoff:
        remedy = f"set it to {format_number(band.limit, 2)} Hz (--set cutoff), {remedy}"
    return (
        f"Noise of what is differentiated has {100 * min(band.noise, 1.0):.0f} % of the power of "
        f"an acceleration below the cut-off of {band.cutoff:.3g} Hz, which pulls inertias towards "
        f"zero: {remedy}."
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
                opening = replace(
                    opening, hints=(Finding("alternative", text=other.statement), *opening.hints)
                )
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
    hints += () if recordings.commanded else (*say_band(session.how), say_unseen(session))
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
        rolled=recordings.rolled,
        late=delays.together(whole) @ whole.M.T,
    )
