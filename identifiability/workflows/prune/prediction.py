"""ε_RA of every rung, from one pass over the logs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.estimation.estimator import Estimate
from identifiability.estimation.prediction import Prediction, Task, predict_all, take_turns
from identifiability.estimation.torque_errors import standard_error
from identifiability.foundation.engines.mapping import Engine, Steps
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical.feasibility import PhysicalResult
from identifiability.regression.information import Information
from identifiability.regression.reduction import Rung
from identifiability.regression.regression import Regression
from identifiability.workflows.prune.search import Search


@frozen
class RungErrors:
    """Relative torque errors of m rungs.

    Attributes
    ----------
    error_ra : (m,)
        ε_RA [Díaz 2010, Eq. 18].
    difference_se : (m,)
        Standard error of the difference to the reference rung's.
    """

    error_ra: Array
    difference_se: Array

    @staticmethod
    def of(prediction: Prediction, reference: int, memory: float) -> RungErrors:
        """Return the errors of rungs along logs.

        Parameters
        ----------
        prediction : Prediction
        reference : int
            The rung that others are compared with.
        memory : float [samples]
            Autocorrelation time of the residual.
        """
        spread = standard_error(prediction.sums, memory, reference)
        return RungErrors(prediction.relative_error(), spread)


@frozen
class Predictions:
    """What the rungs predict.

    Attributes
    ----------
    fitted, unseen : Prediction
        Of all rungs, on the logs they were fitted to, and on stretches (or logs) of these by
        models fitted to the others; sums only.
    outside : Prediction or None
        Of all rungs, on validation logs.
    chosen, chosen_held : Prediction
        Of the chosen rung, the nearest real robot and what a robot file holds of it, fitted and on
        validation logs; the former stands for the latter without any.
    """

    fitted: Prediction
    unseen: Prediction
    outside: Prediction | None
    chosen: Prediction
    chosen_held: Prediction


def predict_rungs(
    regression: Regression,
    held: Regression | None,
    models: Sequence[Rung],
    fits: Sequence[Estimate],
    chosen: int,
    physical: PhysicalResult,
    unseen: Task,
    *,
    engine: Engine | None = None,
    progress: Steps | None = None,
) -> Predictions:
    """Return what the rungs predict, going through the logs once.

    Parameters
    ----------
    regression, held : Regression
        Of the fitted and of the validation logs, if any.
    models, fits : sequences
        The rungs and their estimates.
    chosen : int
    physical : PhysicalResult
        The nearest real robot of the chosen rung.
    unseen : Task
        See `plan_unseen`.
    engine : Engine, optional
    progress : callable(int, int), optional
    """
    values = np.stack([m.expand(e.value) for m, e in zip(models, fits, strict=True)], 1)
    pair = np.stack([values[:, chosen], physical.base, physical.in_file], 1)
    every, two = Task(values[None], excerpt=False), Task(pair[None])
    fitted, crossed, own = predict_all(
        regression, [every, unseen, two], engine=engine, progress=progress
    )
    if held is None:
        return Predictions(fitted, crossed, None, own, own)
    outside, own_held = predict_all(held, [every, two], engine=engine)
    return Predictions(fitted, crossed, outside, own, own_held)


def plan_unseen(search: Search, start: Rung, information: Information) -> Task:
    """Return how stretches (or logs) are predicted by models fitted to the others."""
    folds = search.folds
    fits = np.stack([s.values[1:] for s in search.path.steps], 2)
    values = start.held[:, None] + start.M @ fits
    return Task(values, take_turns(information, folds.fold[folds.stretch]), excerpt=False)
