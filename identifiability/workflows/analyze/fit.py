"""Fit the models of a ladder, and find the real robots nearest to them; predict in turns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.estimation.estimator import Estimator
from identifiability.estimation.evidence import Folds, Held, Score, near_best
from identifiability.estimation.least_squares import Noise, leave_open
from identifiability.estimation.prediction import Task
from identifiability.estimation.torque_errors import take_turns
from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Samples, prepare_samples
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
from identifiability.regression.reduction import Rung
from identifiability.regression.structure import Structure
from identifiability.workflows.session import Session, Weighed


@frozen
class DelayErrors:
    """What errors of the delays of commands do to values: all samples of a log share them.

    Attributes
    ----------
    information : Information
        About all columns, before rows were weighed.
    later : tuple of Information
        The same, had commands of one log acted one standard deviation of its delay later.
    estimator : Estimator
    """

    information: Information
    later: tuple[Information, ...]
    estimator: Estimator

    @classmethod
    def of(cls, session: Session, rows: Weighed) -> DelayErrors:
        """Return them for samples that are fitted; none where torque comes from no command."""
        opening, later = rows.opening, list[Information]()
        for k, log in () if opening.silence else session.recordings.later.items():
            samples = list(opening.samples)
            own, moved = samples[k], prepare_samples(opening.robot, log, session.how)
            if isinstance(own, Samples) and moved.tau.shape == own.tau.shape:
                samples[k] = replace(own, tau=moved.tau)
                later.append(gather_information(opening.structure.regression(samples)))
        return cls(rows.alike, tuple(later), rows.estimator)

    def move(self, rung: Rung) -> Array:
        """Return by how much each of them moves the values of a model, (L, k)."""
        if not self.later:
            return np.zeros((0, len(rung)))
        first, *others = (
            self.estimator.fit(rung.reduce(x)).value for x in (self.information, *self.later)
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
        fits = [m.rung.expand(m.estimate.value) for m in self.models]
        robots = [p.base for p in self.robots]
        files = [p.in_files[k] for k in range(2) for p in self.robots]
        return np.stack([*fits, *robots, *files], 1)

    def in_turns(self) -> Task:
        """Return how stretches (or logs) are predicted by models fitted to the others."""
        assert self.folds is not None
        return Task(self.crossed, take_turns(self.models[0].whole, self.folds.test))


def fit_ladder(
    structure: Structure,
    rungs: Sequence[Rung],
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
        parts = [rung.reduce(information) for rung in rungs]
        open_ = tuple(
            FittedModel(structure, rung, information, part, leave_open(part, estimator))
            for rung, part in zip(rungs, parts, strict=True)
        )
        undecided = tuple(leave_undecided(structure, rung, silence) for rung in rungs)
        none = np.empty((0, information.size, 0))
        return FittedLadder(open_, undecided, none, None, np.zeros(len(rungs), bool))
    models = tuple(FittedModel.of(structure, rung, information, estimator) for rung in rungs)
    held, short = hold_folds(information, estimator)
    found: list[Settled] = []
    for model in models:  # a smaller one asks for no heavier prior than the unpruned
        heaviest = found[0].robot.cad_weight if found else np.inf
        found.append(settle_robot(model, held, cad_weight, heaviest, choose=not short))
    robots = tuple(
        one.robot.with_certificate(*certify_model(model))
        for one, model in zip(found, models, strict=True)
    )
    crossed = np.concatenate([one.crossed for one in found], 2)
    m = len(models)
    order = [*range(0, 2 * m, 2), *range(1, 2 * m, 2)]
    near = near_best([one.free for one in found])
    near |= stand_for_impossible(near, [len(r) for r in rungs], robots, [one.real for one in found])
    return FittedLadder(models, robots, crossed[:, :, order], held.folds, near, short)


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


def hold_folds(information: Information, estimator: Estimator) -> tuple[Held, str]:
    """Return folds of the fitted logs; those of logs too short for a choice, and why they are."""
    fit = estimator.fit(information)
    noise = Noise(fit.variance, fit.times)
    try:
        return Held.of(information, noise), ""
    except LogError as error:
        short = (
            "Whether values of a robot that can exist predict as well, and how strongly the robot "
            f"file's bodies pull, could not be asked: {error}"
        )
        return Held.of(information, noise, Folds.short(information)), short


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
    held: Held,
    cad_weight: float | None,
    heaviest: float = np.inf,
    *,
    choose: bool = True,
) -> Settled:
    """Return the nearest real robot of a model, and what both predict in turns.

    Parameters
    ----------
    model : FittedModel
    held : Held
        Folds of what was fitted.
    cad_weight : float or None
        As in `fit_ladder`.
    heaviest : float
        Weight that is tried.
    choose : bool
        Whether folds may choose; else the prior is weak, unless it is given.
    """
    rung, fit = model.rung, model.estimate
    free = held.refit(fit, rung.M, rung.held)
    score = held.score_roots(free, held.roots(rung.M[:, list(fit.kept)]))
    weight = WEAK if cad_weight is None and not choose else cad_weight
    tried = [w for w in WEIGHTS if w <= heaviest] if weight is None else [weight or WEIGHTS[-1]]
    chosen = choose_prior(model, held, score, tried)
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
