"""Fit the models of a ladder and find the real robots nearest to them; plan cross-validation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.estimation.estimator import Estimator
from identifiability.estimation.layout import choose_folds, leave_out, take_turns
from identifiability.estimation.least_squares import leave_open
from identifiability.estimation.prediction import Prediction, Task
from identifiability.foundation.names import Array
from identifiability.physical.feasibility import (
    PhysicalResult,
    assess_feasibility,
    find_nearest,
    leave_undecided,
)
from identifiability.physical.fitted_model import FittedModel
from identifiability.regression.information import Information
from identifiability.regression.reduction import Rung
from identifiability.regression.structure import Structure

#: The nearest real robots of a model, the strongest prior first.
Candidates = tuple[PhysicalResult, ...]


def fit_ladder(
    structure: Structure,
    rungs: Sequence[Rung],
    information: Information,
    estimator: Estimator,
    cad_weight: float | None,
    silence: str,
) -> tuple[list[FittedModel], list[Candidates]]:
    """Return the models fitted, and what physics says of each (`assess_feasibility`).

    With `silence`, which says why there is nothing to explain, nothing is fitted.
    """
    if silence:
        parts = [rung.reduce(information) for rung in rungs]
        open_ = [
            FittedModel(structure, rung, information, part, leave_open(part, estimator))
            for rung, part in zip(rungs, parts, strict=True)
        ]
        return open_, [(leave_undecided(structure, rung, silence),) for rung in rungs]
    models = [FittedModel.of(structure, rung, information, estimator) for rung in rungs]
    return models, [assess_feasibility(model, cad_weight) for model in models]


def plan_cross_validation(
    structure: Structure,
    rungs: Sequence[Rung],
    information: Information,
    estimator: Estimator,
    cad_weight: float | None,
) -> Task:
    """Return how every stretch of the logs is predicted by models fitted to the others."""
    folds = choose_folds(information.log)
    values = []
    for fold in range(int(folds.max()) + 1):
        rest = leave_out(information, folds, fold)
        models = [FittedModel.of(structure, rung, rest, estimator) for rung in rungs]
        values.append(base_values(models, [find_nearest(m, cad_weight) for m in models])[0])
    return Task(np.stack(values), take_turns(information, folds))


def base_values(
    models: Sequence[FittedModel], candidates: Sequence[Candidates]
) -> tuple[Array, Array]:
    """Return the base parameters (b, m + c m) of m fits, then of their nearest real robots.

    Of these come the first of each model, then the second of each, and so on. The second array
    (b, m + 3 c m) goes on with what robot files of their own format hold of them, and of the other.
    """
    values = [model.rung.expand(model.estimate.value) for model in models]
    robots = [p for each in zip(*candidates, strict=True) for p in each]
    whole = np.stack([*values, *(p.base for p in robots)], 1)
    files = [p.in_files[k] for k in range(2) for p in robots]
    return whole, np.column_stack([whole, *files])


def settle_robots(
    candidates: Sequence[Candidates], held_out: Prediction, predictions: Sequence[Prediction]
) -> tuple[list[PhysicalResult], list[Prediction]]:
    """Return the nearest real robot to use of each model, and predictions by these alone.

    Parameters
    ----------
    candidates : sequence of tuples of PhysicalResult
        Of each model equally many, the strongest prior first.
    held_out : Prediction
        By all estimates, then as in `base_values`.
    predictions : sequence of Prediction
        The same, perhaps with as many more by what robot files hold of the robots, twice.
    """
    chosen = settle_prior(candidates, held_out)
    robots = [each[at] for each, at in zip(candidates, chosen, strict=True)]
    return robots, [_keep(candidates, chosen, p) for p in predictions]


def settle_prior(candidates: Sequence[Candidates], held_out: Prediction) -> list[int]:
    """Return which nearest real robot of each of m models to use.

    It is the one that the strongest prior drew to the robot file of those that predict unseen
    motion as well as the best: within one standard error of the difference, over all torque and
    over each joint's own scale.

    Parameters
    ----------
    candidates : sequence of tuples of PhysicalResult
        Of each model equally many, the strongest prior first.
    held_out : Prediction
        By all estimates, then as in `base_values`.
    """
    m = len(candidates)
    chosen = []
    for k, each in enumerate(candidates):
        found = [c for c, robot in enumerate(each) if robot.nearest is not None] or [0]
        several = held_out.select([m * (1 + c) + k for c in found])
        measures = (
            (several.relative_error(), several.standard_error),
            (several.error_over_joints(), several.standard_error_over_joints),
        )
        good = np.ones(len(found), bool)
        for error, spread in measures:
            if np.isfinite(error).all() and len(found) > 1:
                best = int(np.argmin(error))
                good &= error - error[best] <= spread(best)
        if not good.any():
            good[np.argmin(measures[1][0])] = True
        chosen.append(found[int(np.argmax(good))])
    return chosen


def _keep(
    candidates: Sequence[Candidates], chosen: Sequence[int], prediction: Prediction
) -> Prediction:
    m, count = len(chosen), len(candidates[0])
    robots = np.array([m * (1 + c) + k for k, c in enumerate(chosen)], int)
    files = [*(robots + m * count), *(robots + 2 * m * count)]
    held = files if prediction.predicted.shape[2] > m * (1 + count) else []
    return prediction.select([*range(m), *robots, *held])
