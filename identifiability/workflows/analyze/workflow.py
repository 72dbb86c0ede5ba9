"""The main job: robot and logs in, one verdict per parameter and a model to use out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.effects.base import move_mounting
from identifiability.estimation.estimate import Kind, Method, find_estimator, settle_noise
from identifiability.estimation.estimator import Estimator
from identifiability.estimation.prediction import Prediction, Task, predict, predict_all
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.torque_errors import Turns
from identifiability.foundation.engines import Engine, one_thread
from identifiability.foundation.errors import ModelError
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import Array
from identifiability.foundation.options import NotNegative, Replicates, Seed, checked, settle_count
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Dataset, Preparation, prepare_log
from identifiability.logs.prepare.instruments import noise_again
from identifiability.logs.prepare.preparation import SettledPreparation, settle_cutoff
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.logs.spectrum import Band
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
from identifiability.workflows.analyze.assessment import (
    ModelResult,
    Settled,
    assess_ladder,
    fit_ladder,
    select_model,
    tell_with_file,
)
from identifiability.workflows.analyze.belief import Belief, form_belief, refine_verdicts
from identifiability.workflows.analyze.result import Analysis, compare_logs, doubt
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


# What is said beside the models: a cut-off that is wrong, and what the fit says of its logs.


def say_band(how: Preparation | None) -> tuple[str, ...]:
    """Return what to say of the cut-off for all logs: does it cut the motion, let noise in?"""
    band = how.band if isinstance(how, SettledPreparation) else None
    if band is None:
        return ()
    return (*_say_cut(band, ["the logs"]), *_say_noise(band))


def say_unseen(session: Session) -> tuple[str, ...]:
    """Return what to say of a cut-off in the band of held-out motion alone."""
    how, logs = session.how, session.recordings.held_out
    both = (how, settle_cutoff(session.structure.robot, logs, how))
    own, seen = (x.band if isinstance(x, SettledPreparation) else None for x in both)
    if own is None or seen is None or _say_cut(own, []):
        return ()
    return _say_cut(seen, [log.name for log in logs])


def _say_cut(band: Band, whose: Sequence[str]) -> tuple[str, ...]:
    """Return what to say of a cut-off in the band of the motion, if it is there."""
    # A cut-off below so many times the band of the motion cuts into it.
    if band.cutoff >= 2.0 * band.bandwidth:
        return ()
    least = LOG_RULES.cutoff_lowered * LOG_RULES.cutoff_wide * band.bandwidth
    remedy = "higher" if least <= LOG_RULES.cutoff_highest * band.rate else "faster"
    numbers = {"least": least, "rate": least / LOG_RULES.cutoff_highest}
    reach = {"cutoff": band.cutoff, "bandwidth": band.bandwidth}
    remedy = phrase("cutoff_low", remedy, **numbers)
    return (Finding("cutoff_low", whose=list(whose), remedy=remedy, **reach),)


def _say_noise(band: Band) -> tuple[str, ...]:
    """Return what to say of noise below the cut-off, if there is much."""
    # On one period of a motion intervals hold up to three tenths.
    if band.noise <= 0.2:
        return ()
    lower = phrase("cutoff_noisy", "lower", limit=band.limit) if band.limit < band.cutoff else ""
    numbers = {"cutoff": band.cutoff, "share": min(band.noise, 1.0)}
    return (Finding("cutoff_noisy", lower=lower, **numbers),)


def say_of_fit(session: Session, samples: Sequence[Dataset], result: ModelResult) -> list[str]:
    """Return what a fit says of its logs: a mounting to correct, logs that disagree.

    Corrections of a mounting are linear where they are small: what is left of a large one is found
    from there.
    """
    sure = {v.name: v.value for v in result.verdicts if v.sure}
    entry = move_mounting(session.structure.robot, sure)
    said, disagree = compare_logs(samples, result)
    found = [Finding("imu_moved", entry=entry)] if entry else []
    return [*found, said] if disagree else [*found]


def predict_everywhere(
    session: Session, rows: Weighed, own: Settled, which: int, turns: Turns | None
) -> Prediction | None:
    """Return torque along unseen motion where joints stand, too; None where none does.

    Parameters
    ----------
    session : Session
    rows : Weighed
    own : Settled
    which : int
        Of its accounts.
    turns : Turns or None
        Which fold's predicts a sample, where no logs are held out.
    """
    opening, known = rows.opening, session.recordings
    samples, logs = opening.samples, known.fitted
    if opening.validation:
        samples, logs = opening.validation, known.held_out
    stand = any((s.survey.rows < s.survey.outputs).any() for s in samples)
    hidden = opening.robot.base is not None or any(x.unmeasured is not None for x in logs)
    if opening.silence or hidden or not stand:
        return None
    regression = replace(opening.unseen or opening.regression, dwelling=True, memory=None)
    values = own.values[None] if turns is None else own.turned
    task = Task(values[:, :, [which]], turns, kept=False)
    return predict_all(regression, [task], engine=session.engine)[0]


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
            session.structure.robot, found.real_robot["parameters"]
        )
        found = replace(found, source=source, moved=moved)
        return believe(found, streams[2], say, share_) if posterior else found


def believe(found: Analysis, rng: np.random.Generator, say: Progress, within: float) -> Analysis:
    """Return the analysis with the posteriors of the selected model, bodies within a share.

    Where there is nothing to explain nothing is sampled: the posterior of a robot that never moved
    is the prior along a handful of exact equations, which no chain walks.
    """
    silence = found.silence or found.misread
    if silence:
        return replace(found, belief=Belief(None, None, None, silence))
    chosen, at = found.chosen, found.selected
    part = chosen.submodel.reduce(found.information)
    what = found.structure, chosen.submodel, found.information, part, chosen.estimate
    sampling = share(say, "sampling the posterior", 0.9, 0.99)
    belief = form_belief(FittedModel(*what), rng, share=within, progress=sampling)
    models = list(found.models)
    models[at] = replace(chosen, verdicts=refine_verdicts(chosen, belief))
    hints = tuple(filter(None, (*found.hints, belief.hint)))
    return replace(found, models=tuple(models), belief=belief, hints=hints)


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
    shared, estimator = SharedErrors.of(session, rows), rows.estimator
    if not opening.silence:
        estimator = settle_noise(estimator, rows.information)
    ladder = fit_ladder(
        opening.structure, submodels, rows.information, estimator, cad_prior, opening.silence
    )
    tasks = [Task(ladder.values[None])]
    if not opening.validation and not opening.silence:
        tasks.append(ladder.in_turns())
    predicting = share(say, "predicting torque", 0.65, 0.9)
    fitted, *others = predict_all(opening.regression, tasks, engine=engine, progress=predicting)
    if opening.unseen is not None:
        others = [predict(opening.unseen, ladder.values, engine=engine)]
    unseen, recordings = (others or [fitted])[0], session.recordings
    thresholds, missing = Thresholds(), find_missing(opening)
    what = ladder.settled, fitted, unseen, thresholds, rng, draws, missing
    results = assess_ladder(*what, late=shared.move, judged=ladder.judged)
    at = select_model(results, ladder.near)
    both = [
        tell_with_file(own.model, one, within, thresholds)
        for own, one in zip(ladder.settled, results, strict=True)
    ]
    results, contradicted = tuple(one for one, _ in both), both[at][1]
    results, nothing = doubt(opening.silence or opening.misread, results, at)
    used = ladder.settled[at], int(results[at].physical_used)
    hints = [*opening.hints, rows.burst, contradicted, ladder.short]
    hints += () if recordings.commanded else (*say_band(session.how), *say_unseen(session))
    if not opening.explained:  # exchanged columns, a wrong unit or late torque explain the rest
        hints += say_of_fit(session, opening.samples, results[at])
    whole = ladder.settled[0].model.submodel
    return Analysis(
        structure=opening.structure,
        samples=opening.samples,
        validation=opening.validation,
        hints=tuple(filter(None, hints)),
        alternative=opening.alternative,
        information=rows.information,
        folds=ladder.folds,
        models=results,
        selected=at,
        everywhere=predict_everywhere(session, rows, *used, tasks[-1].turns),
        **how,
        thresholds=thresholds,
        nothing=nothing,
        recordings=recordings.fitted,
        missing=missing,
        rolled=recordings.rolled,
        late=shared.together(whole) @ whole.M.T,
    )
