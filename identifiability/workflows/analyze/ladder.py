"""Fitted models of a ladder, their nearest physically consistent robots, and their predictions."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.effects.vocabulary import file_values
from identifiability.estimation.estimate import estimate_noise
from identifiability.estimation.estimator import Estimator
from identifiability.estimation.evidence import Folds, HeldOut, Score, near_best
from identifiability.estimation.prediction import Prediction, Task, predict, predict_all
from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array, name_each
from identifiability.foundation.runs import Run
from identifiability.foundation.values import frozen
from identifiability.logs.commands import of_commands
from identifiability.physical.cad_prior import WEAK, WEIGHTS
from identifiability.physical.feasibility import (
    PhysicalResult,
    certify_model,
    choose_prior,
    find_nearest,
    with_values,
)
from identifiability.physical.fitted_model import FittedModel
from identifiability.regression.information import Information
from identifiability.regression.reduction import Submodel
from identifiability.regression.structure import Structure
from identifiability.workflows.case import Data, WeightedRows

from .shared_errors import SharedErrors, measure_shared_errors

#: Number of value sets for which each fitted model is judged (`LadderFit.values`).
ACCOUNTS = 6


@frozen
class LadderFit:
    """A fitted model, the nearest physically consistent robot, and cross-validation of both.

    Attributes
    ----------
    model : FittedModel
    robot : PhysicalResult
    free : Score
        Of the estimated values, on folds.
    real : Score or None
        The same of the nearest physically consistent robot; None where there is none.
    crossed : (F, b, 2)
        Base parameters of both, found from each fold's rest.
    """

    model: FittedModel
    robot: PhysicalResult
    free: Score
    real: Score | None
    crossed: Array

    @property
    def written(self) -> Score:
        """The score of the values that predictions and files have."""
        if self.robot.as_good and self.real is not None:
            return self.real
        return self.free

    @property
    def values(self) -> Array:
        """Base parameters (b, `ACCOUNTS`): estimated, and of the nearest physical robot.

        Two columns follow for the latter as a robot file can hold it, in its format and in the
        other one. The last two columns are the same for the given robot.
        """
        structure = self.model.structure
        free = self.model.submodel.expand(self.model.estimate.value)
        stated = name_each(structure.columns, structure.nominal)
        files = file_values(structure.robot, stated)
        given = [structure.G @ [held[name] for name in structure.columns] for held in files]
        return np.column_stack([free, self.robot.base, *self.robot.in_files, *given])

    @property
    def turned(self) -> Array:
        """The same found from each fold's rest, (F, b, `ACCOUNTS`).

        Robot files lack the same part as for the whole, and the given robot is not fitted.
        """
        values = self.values
        written, given = np.split(values[:, 2:], 2, axis=1)
        in_files = self.crossed[:, :, 1:] + written - values[:, 1:2]
        in_given = np.broadcast_to(given, in_files.shape)
        return np.concatenate([self.crossed, in_files, in_given], axis=2)


def fit_ladder(
    structure: Structure,
    submodels: Sequence[Submodel],
    information: Information,
    estimator: Estimator,
    cad_weight: float | None = None,
) -> tuple[list[LadderFit], Folds, str]:
    """Fit models and their physical robots; return also the folds, and why they choose nothing.

    Parameters
    ----------
    structure : Structure
    submodels : sequence of Submodel
    information : Information
        About all base parameters, with weighted rows.
    estimator : Estimator
        With the noise of these rows.
    cad_weight : float or None
        Of the prior around the robot file; by default predictions choose it (`choose_prior`).
    """
    held_out, short = hold_folds(information, estimator)
    found: list[LadderFit] = []
    for submodel in submodels:  # a smaller one asks for no heavier prior than the unpruned
        model = FittedModel.of(structure, submodel, information, estimator)
        heaviest = found[0].robot.cad_weight if found else np.inf
        found.append(fit_with_robot(model, held_out, cad_weight, heaviest, choose=not short))
    return found, held_out.folds, short


def hold_folds(information: Information, estimator: Estimator) -> tuple[HeldOut, str]:
    """Return folds of the fitted logs, and the reason if the logs are too short for a choice."""
    fit = estimator.fit(information)
    try:
        return HeldOut.of(information, fit.noise), ""
    except LogError as error:
        short = (
            "Whether values of a robot that can exist predict as well, and how strongly the robot "
            f"file's bodies pull, could not be asked: {error}"
        )
        return HeldOut.of(information, fit.noise, Folds.of(information)), short


def fit_with_robot(
    model: FittedModel,
    held_out: HeldOut,
    cad_weight: float | None,
    heaviest: float = np.inf,
    *,
    choose: bool = True,
    certified: Sequence[Any] = (),
) -> LadderFit:
    """Return the nearest physically consistent robot of a model, and cross-validate both.

    Parameters
    ----------
    model : FittedModel
    held_out : HeldOut
        Folds of the fitted logs.
    cad_weight : float or None
        As in `fit_ladder`.
    heaviest : float
        Largest weight to try.
    choose : bool
        Whether folds may choose; else the prior is weak, unless it is given.
    certified : (Certificate or None, str), optional
        Result of `certify_model`, where it is known.
    """
    submodel = model.submodel
    fit = model.estimate
    free = held_out.refit(fit, submodel.M, submodel.fixed)
    score = held_out.score(free, held_out.roots(fit, submodel.M))
    weight = WEAK if cad_weight is None and not choose else cad_weight
    tried = [w for w in WEIGHTS if w <= heaviest] if weight is None else [weight or WEIGHTS[-1]]
    chosen = choose_prior(model, held_out, tried)
    if weight is None:
        weight = WEAK if chosen is None else chosen.weight
    robot = find_nearest(model, weight)
    certificate, said = certified or certify_model(model)
    robot = replace(robot, certificate=certificate, sentence=said + robot.sentence)
    if chosen is None:
        unknown = np.full_like(free, np.nan)
        return LadderFit(model, robot, score, None, np.stack([free, unknown], 2))
    if choose:
        robot = replace(robot, as_good=chosen.as_good)
    return LadderFit(model, robot, score, chosen.score, np.stack([free, chosen.values], 2))


def move_by_rollouts(fit: LadderFit, data: Data) -> LadderFit:
    """Return a fit whose robot has the numbers of rollouts, if they follow the logs better.

    Least squares of torque weights errors of positions by the gains, and loses precision with each
    row without torque.
    """
    from identifiability.servos import follows_better  # noqa: PLC0415 - MuJoCo

    robot = data.structure.robot
    rolled = data.recordings.rolled
    logs = [log.select(robot.joints) for log in data.recordings.fitted if of_commands(log)]
    if fit.robot.nearest is None or not follows_better(robot, logs, rolled, fit.robot.parameters()):
        return fit
    known = {**robot.nominal, **rolled.parameters}
    phi = np.array([known.get(name, 0.0) for name in data.structure.columns])
    moved = with_values(fit.robot, fit.model, phi)
    if moved.within(fit.model.submodel) is None:
        return fit
    crossed = fit.crossed.copy()
    crossed[:, :, 1] += moved.base - fit.robot.base
    return replace(fit, robot=moved, crossed=crossed)


@frozen
class FittedLadder:
    """Fitted models of a ladder and their predictions.

    Attributes
    ----------
    rows : WeightedRows
    fits : tuple of m LadderFit
    folds : Folds
        Stretches of the fitted logs that are predicted by models fitted to the others.
    short : str
        Why folds choose nothing; empty where they do.
    near : (m,) bool
        Models that predict as well as the best.
    fitted, unseen : Prediction
        By the accounts of each model (`LadderFit.values`), on fitted and on unseen motion.
    shared : SharedErrors
        Changes of the values by errors that all samples of a log share.
    """

    rows: WeightedRows
    fits: tuple[LadderFit, ...]
    folds: Folds
    short: str
    near: np.ndarray
    fitted: Prediction
    unseen: Prediction
    shared: SharedErrors


def compute_ladder(
    rows: WeightedRows,
    submodels: Sequence[Submodel],
    cad_weight: float | None,
    *,
    run: Run,
    rollouts: bool = True,
) -> FittedLadder:
    """Fit the models of a ladder and predict torque by them, going through the logs once.

    Parameters
    ----------
    rows, submodels
    cad_weight : float or None
        As of `fit_ladder`.
    run : Run
    rollouts : bool
        Whether the robot gets the numbers of rollouts where they follow the logs better.
    """
    data = rows.data
    run.say("fitting models", 0.6)
    estimator = estimate_noise(rows.estimator, rows.information)
    weighted = rows.information, estimator
    fits, folds, short = fit_ladder(data.structure, submodels, *weighted, cad_weight)
    if rollouts and data.recordings.rolled is not None:
        fits = [move_by_rollouts(one, data) for one in fits]
    values = np.concatenate([one.values for one in fits], axis=1)
    crossed = np.concatenate([one.turned for one in fits], axis=2)
    tasks = [Task(values[None]), *([] if data.validation else [Task(crossed, folds)])]
    run.say("predicting torque", 0.65)
    fitted, *others = predict_all(data.regression, tasks)
    if data.unseen is not None:
        others = [predict(data.unseen, values)]
    written = [one.written for one in fits]
    held_out = others[0] if others else fitted
    return FittedLadder(
        rows=rows,
        fits=tuple(fits),
        folds=folds,
        short=short,
        near=near_best(written),
        fitted=fitted,
        unseen=held_out,
        shared=measure_shared_errors(rows),
    )
