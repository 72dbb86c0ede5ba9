"""Fit the models of a ladder, and find the real robots nearest to them; predict in turns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from identifiability.estimation.estimator import Estimator, Noise, leave_open
from identifiability.estimation.evidence import Evidence, Folds, HeldOut, Score, near_best
from identifiability.estimation.prediction import Task
from identifiability.estimation.torque_errors import take_turns
from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import format_number
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, Samples, prepare_samples
from identifiability.logs.prepare.instruments import noise_again
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.logs.prepare.preparation import SettledPreparation
from identifiability.logs.repeats import Recording
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
from identifiability.regression.reduction import Submodel
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.session import Session, Weighed


@frozen
class SharedErrors:
    """What errors that all samples of a log share do to values.

    ``delay``: of delays and gains of servos. ``bias``: of noise that a cut-off lets into computed
    derivatives, where no second record of the motion takes it away: with as much noise once more
    values move by what it has moved them already [Cook & Stefanski 1994].

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
                own, moved = samples[k], prepare_samples(opening.robot, log, how)
                if isinstance(own, Samples) and moved.tau.shape == own.tau.shape:
                    samples[k] = replace(own, tau=moved.tau)
            delay.append(gather_information(opening.structure.regression(samples)))
        band = how.band if isinstance(how, SettledPreparation) else None
        loud = band is not None and band.noise > LOG_RULES.noise_share
        if loud and not (rows.estimator.instruments or session.recordings.commanded):
            pairs = zip(session.recordings.fitted, opening.samples, strict=True)
            samples = [_noisier(opening.robot, log, own, how) for log, own in pairs]
            bias = (gather_information(opening.structure.regression(samples)),)
        return cls(rows.alike, {"delay": tuple(delay), "bias": bias}, rows.estimator)

    def move(self, submodel: Submodel) -> dict[str, Array]:
        """Return by how much each of them moves the values of a model, (w, k)."""
        own = self.estimator.fit(submodel.reduce(self.information)).value if self.others else None
        return {
            name: np.array([self.estimator.fit(submodel.reduce(x)).value - own for x in others])
            for name, others in self.others.items()
            if others
        }

    def together(self, submodel: Submodel) -> Array:
        """Return all of them, (w, k)."""
        return np.vstack([np.zeros((0, len(submodel))), *self.move(submodel).values()])


def _noisier(robot: Robot, log: Recording, own: Prepared, how: Preparation) -> Prepared:
    """Return samples along a motion with as much noise once more, if it is in memory."""
    if not (isinstance(log, Log) and isinstance(own, Samples)):
        return own
    moved = prepare_samples(robot, noise_again(log, np.random.default_rng(0)), how)
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


def _say_cut(band: Band, whose: str) -> str:
    """Return one sentence on a cut-off in the band of the motion, or nothing."""
    # A cut-off below so many times the band of the motion cuts into it.
    if band.cutoff >= 2.0 * band.bandwidth:
        return ""
    least = LOG_RULES.cutoff_lowered * LOG_RULES.cutoff_wide * band.bandwidth
    remedy = f"set it to {format_number(least, 2)} Hz or more (--cutoff)"
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
        remedy = f"set it to {format_number(band.limit, 2)} Hz (--cutoff), {remedy}"
    return (
        f"Noise of what is differentiated has {100 * min(band.noise, 1.0):.0f} % of the power of "
        f"an acceleration below the cut-off of {band.cutoff:.3g} Hz, which pulls inertias towards "
        f"zero: {remedy}."
    )
