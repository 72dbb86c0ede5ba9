"""Fit the models of a ladder, and find the real robots nearest to them; predict in turns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from identifiability.estimation.estimate import settle_noise
from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.estimation.evidence import Folds, HeldOut, Score, near_best
from identifiability.estimation.least_squares import Noise, leave_open
from identifiability.estimation.prediction import Task
from identifiability.estimation.torque_errors import take_turns
from identifiability.estimation.verdict import Class
from identifiability.foundation.errors import IdentifiabilityError, LogError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.foundation.rounding import format_number
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Preparation, Samples, prepare_samples
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
    stands_elsewhere,
)
from identifiability.physical.fitted_model import FittedModel
from identifiability.regression.gather import gather_information
from identifiability.regression.information import Information
from identifiability.regression.reduction import Submodel
from identifiability.regression.structure import Structure
from identifiability.workflows.analyze.assessment import ModelResult
from identifiability.workflows.analyze.rules import RULES
from identifiability.workflows.instruments import follow
from identifiability.workflows.opening import Opening, Recordings
from identifiability.workflows.session import Session, Weighed, enough_samples, settle_band


@frozen
class DelayErrors:
    """What errors of delays and gains of servos do to values: all samples of a log share them.

    Attributes
    ----------
    information : Information
        About all columns, before rows were weighed.
    later : tuple of Information
        The same, had commands of one log acted one standard deviation of its delay later, or had
        gains that were found been others by one.
    estimator : Estimator
    """

    information: Information
    later: tuple[Information, ...]
    estimator: Estimator

    @classmethod
    def of(cls, session: Session, rows: Weighed) -> DelayErrors:
        """Return them for samples that are fitted; none where torque comes from no command."""
        opening, later = rows.opening, list[Information]()
        for logs in () if opening.silence else session.recordings.later:
            samples = list(opening.samples)
            for k, log in logs.items():
                own, moved = samples[k], prepare_samples(opening.robot, log, session.how)
                if isinstance(own, Samples) and moved.tau.shape == own.tau.shape:
                    samples[k] = replace(own, tau=moved.tau)
            later.append(gather_information(opening.structure.regression(samples)))
        return cls(rows.alike, tuple(later), rows.estimator)

    def move(self, submodel: Submodel) -> Array:
        """Return by how much each of them moves the values of a model, (L, k)."""
        if not self.later:
            return np.zeros((0, len(submodel)))
        first, *others = (
            self.estimator.fit(submodel.reduce(x)).value for x in (self.information, *self.later)
        )
        return np.array(others) - first


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
    short : str
        That predictions choose nothing, and why; empty where they do.
    """

    models: tuple[FittedModel, ...]
    robots: tuple[PhysicalResult, ...]
    crossed: Array
    folds: Folds | None
    near: np.ndarray
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
    near = near_best([one.free for one in found])
    near |= stand_for_impossible(
        near, [len(r) for r in submodels], robots, [one.real for one in found]
    )
    return FittedLadder(models, robots, crossed[:, :, order], held_out.folds, near, short)


def stand_for_impossible(
    near: np.ndarray,
    sizes: Sequence[int],
    robots: Sequence[PhysicalResult],
    real: Sequence[Score | None],
) -> np.ndarray:
    """Return which model stands where none that folds choose is possible, (m,) bool.

    What a model with impossible values says of the robot is its nearest real robot, and that of a
    smaller one has what its bodies cannot do without: the two are compared, as `prune` does.

    Parameters
    ----------
    near : (m,) bool
        What folds choose.
    sizes : sequence of int
        Parameters of the m models.
    robots : sequence of PhysicalResult
        With their certificates.
    real : sequence of Score or None
        What the nearest real robots predict of the folds.
    """
    out = np.zeros(len(near), bool)
    good = [int(k) for k in np.flatnonzero(near)]
    chosen = [k for k in good if real[k] is not None]
    if not chosen or any(robots[k].feasible for k in good):
        return out
    best = min(chosen, key=lambda k: sizes[k])
    smaller = [k for k, r in enumerate(robots) if r.feasible and sizes[k] < sizes[best]]
    if smaller:
        at = max(smaller, key=lambda k: sizes[k])
        own, other = real[at], real[best]
        out[at] = own is not None and other is not None and near_best([own, other])[0]
    return out


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
        good = chosen.as_good
        elsewhere = (
            not good and nearest.nearest is not None and stands_elsewhere(model, nearest.base)
        )
        nearest = replace(nearest, as_good=good, elsewhere=elsewhere)
    real = None if chosen is None else chosen.score
    return Settled(nearest, score, real, np.stack([free, values], 2))


# The low-pass of computed derivatives: does it cut the motion, let noise in, do values follow it?
#
# The model is fitted again, as it was, with torque up to half and to double of where it is kept;
# the motion is low-passed there too where it was, and else no lower than before. Where the band is
# right, little changes: a value moves by what the rows that were added or lost knew of it
# [Hausman 1978]. Where noise, flexibility or the motion itself lie at the edge of the band, values
# follow the cut-off.


#: Multiples of the cut-off that are tried.
FACTORS: tuple[Tolerance, Tolerance] = (0.5, 2.0)

#: Windows in which samples lie that are fitted again, where logs are longer.
WINDOWS = 4

#: Parameters that a hint names.
NAMED = 3


def check_cutoff(
    opening: Opening,
    recordings: Recordings,
    information: Information,
    result: ModelResult,
    how: Preparation,
) -> tuple[str, ...]:
    """Return what to say of the cut-off: of what it lets through, and of what follows it.

    Parameters
    ----------
    opening : Opening
    recordings : Recordings
        What its samples were prepared from.
    information : Information
        About all columns, each row weighed by its noise.
    result : ModelResult
        The model whose values are looked at.
    how : Preparation
        With the cut-off for all logs.
    """
    # Torque of commands is calibrated along rollouts at one cut-off, and is not that of another.
    if recordings.commanded or not isinstance(how, SettledPreparation) or how.band is None:
        return ()
    held_out = settle_band(opening.structure, recordings.held_out, how)
    seen = held_out.band if isinstance(held_out, SettledPreparation) else None
    names = " and ".join(log.name for log in recordings.held_out)
    unseen = _say_cut(seen, names) if seen and not _say_cut(how.band, "") else ""
    varied = vary_cutoff(opening, recordings.fitted, information, result, how)
    return (*say_band(how), *filter(None, (unseen, varied)))


def say_band(how: Preparation | None) -> tuple[str, ...]:
    """Return what to say of the cut-off for all logs: does it cut the motion, let noise in?"""
    band = how.band if isinstance(how, SettledPreparation) else None
    found = () if band is None else (_say_cut(band, "the logs"), _say_noise(band))
    return tuple(filter(None, found))


def _say_cut(band: Band, whose: str) -> str:
    """Return one sentence on a cut-off in the band of the motion, or nothing."""
    if band.cutoff >= RULES.cutoff_inside * band.bandwidth:
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
    if band.noise <= RULES.cutoff_loud:
        return ""
    remedy = "measure velocities, or let the robot accelerate more"
    if band.limit < band.cutoff:
        remedy = f"set it to {format_number(band.limit, 2)} Hz (--cutoff), {remedy}"
    return (
        f"Noise of what is differentiated has {100 * min(band.noise, 1.0):.0f} % of the power of "
        f"an acceleration below the cut-off of {band.cutoff:.3g} Hz, which pulls inertias towards "
        f"zero: {remedy}."
    )


def vary_cutoff(
    opening: Opening,
    logs: Sequence[Recording],
    information: Information,
    result: ModelResult,
    how: SettledPreparation,
) -> str:
    """Return one sentence on identifiable values that follow the cut-off, or nothing.

    Where noise is small up to the cut-off but not up to double of it, values may follow it there:
    then only half of it says something.
    """
    known = np.array([v.verdict is Class.IDENTIFIABLE for v in result.verdicts])
    structure = opening.structure
    bands = [(s.cutoff, s.band) for s in opening.samples if s.cutoff and s.band]
    if not known.any() or len(bands) < len(opening.samples):
        return ""
    windows = _windows([len(log) for log in logs], enough_samples(structure.robot))

    def refit(factor: float) -> Estimate | None:
        cut = []
        for k, _, _ in windows:
            wide, kept = bands[k]
            widest = max(wide, factor * kept) if wide > kept else factor * kept
            cut.append(replace(how, cutoff=widest, outputs=factor * kept))
        try:
            samples = tuple(
                prepare_samples(structure.robot, logs[k].rows(a, b), at)
                for (k, a, b), at in zip(windows, cut, strict=True)
            )
        except IdentifiabilityError:  # nothing is left of one at such a cut-off
            return None
        parts = [(logs[k].rows(a, b), s) for (k, a, b), s in zip(windows, samples, strict=True)]
        own = result.estimate.estimator
        again = gather_information(structure.regression(follow(own, structure.robot, parts)))
        shares = [(k, a / len(logs[k]), b / len(logs[k])) for k, a, b in windows]
        again = _weigh_alike(again, shares, information)
        return settle_noise(own, again).fit(result.submodel.reduce(again))

    whole = sum(b - a for _, a, b in windows) == sum(len(log) for log in logs)
    base = result.estimate if whole else refit(1.0)
    if base is None:
        return ""
    found = []
    b = how.band
    silent = b is not None and b.cutoff <= b.limit
    for factor in FACTORS:
        if b is not None and silent and factor * b.outputs > b.limit:
            continue
        other = refit(factor)
        if other is None:
            continue
        moved = _moves(result, base, other)
        at = np.flatnonzero(known & (np.abs(moved) > 0))
        if len(at):
            band = " … ".join(sorted({f"{factor * kept:.3g}" for _, kept in bands}, key=float))
            order = at[np.argsort(-moved[at])]
            names = (f"{result.submodel.columns[k]} by {moved[k]:.2g} σ" for k in order)
            found.append(f"{listing(names, NAMED)} at {band} Hz")
    if not found:
        return ""
    now = " … ".join(sorted({f"{kept:.3g}" for _, kept in bands}, key=float))
    return (
        f"Identifiable values follow the cut-off of {now} Hz and leave their intervals: "
        f"{'; '.join(found)}. Set it from the band of the motion (--cutoff) and use what stays."
    )


def _weigh_alike(
    again: Information, windows: Sequence[tuple[int, float, float]], information: Information
) -> Information:
    """Return rows of another band with the weights that rows at their time had.

    Parameters
    ----------
    again : Information
        Of windows, each a log.
    windows : sequence of (log, start, stop)
        Shares of the logs.
    information : Information
        Weighed.
    """
    if information.weights is None:
        return again
    place = np.empty(len(again.counts), int)
    for w, (k, a, b) in enumerate(windows):
        there, own = np.flatnonzero(information.log == k), again.log == w
        stop, ends = (np.cumsum(x) for x in (information.counts[there], again.counts[own]))
        middle = (ends - 0.5 * again.counts[own]) / ends[-1]
        at = np.searchsorted(stop / stop[-1], a + middle * (b - a))
        place[own] = there[np.minimum(at, len(there) - 1)]
    weights = information.weights[:, place]
    echo = again.echo
    if echo is not None:  # it has as many logs of its own for each
        of_log = echo.log * len(windows) // (int(echo.log.max()) + 1)
        means = [weights[:, again.log == w].mean(1) for w in range(len(windows))]
        echo = echo.weigh(np.stack(means, 1)[:, of_log])
    return replace(again.weigh(weights), echo=echo)


def _moves(result: ModelResult, base: Estimate, other: Estimate) -> Array:
    """Return by how many robust σ values move, (k,); 0 where that is within what it may be."""
    robust = np.asarray(result.uncertainty.robust, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        # White formulas miss what the residual remembers; and of fewer rows less is known.
        wider = np.maximum(robust / result.estimate.sigma, 1.0)
        fewer = np.maximum(base.sigma / result.estimate.sigma, 1.0)
        chance = wider * np.sqrt(np.abs(other.sigma**2 - base.sigma**2))
        move = np.abs(other.value - base.value)
        beyond = (move > REACH * fewer * robust) & (move > RULES.cutoff_sure * chance)
        sizes: Array = np.where(beyond & base.determined & other.determined, move / robust, 0.0)
    if other.correction is not None:  # there noise was not mended, which says nothing of the band
        sizes[[c in other.correction.touched for c in other.columns]] = 0.0
    return sizes


def _windows(lengths: Sequence[int], enough: int) -> list[tuple[int, int, int]]:
    """Return log, first and last (exclusive) row of what is fitted again: all, or evenly spaced."""
    if sum(lengths) <= enough:
        return [(k, 0, length) for k, length in enumerate(lengths)]
    pieces = []
    for k, length in enumerate(lengths):
        edges = np.linspace(0, length, -(-length * WINDOWS // enough) + 1).astype(int).tolist()
        pieces += [(k, a, b) for a, b in pairwise(edges)]
    return pieces[:: -(-sum(lengths) // enough)]
