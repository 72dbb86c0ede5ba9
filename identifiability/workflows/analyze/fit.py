"""Fit the models of a ladder and find the real robots nearest to them; plan cross-validation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.estimation.estimator import Estimator
from identifiability.estimation.layout import choose_folds, leave_out, take_turns
from identifiability.estimation.least_squares import leave_open
from identifiability.estimation.prediction import Task
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


def fit_ladder(
    structure: Structure,
    rungs: Sequence[Rung],
    information: Information,
    estimator: Estimator,
    cad_weight: float,
    silence: str,
) -> tuple[list[FittedModel], list[PhysicalResult]]:
    """Return the models fitted, and what physics says of each.

    With `silence`, which says why there is nothing to explain, nothing is fitted.
    """
    if silence:
        parts = [rung.reduce(information) for rung in rungs]
        open_ = [
            FittedModel(structure, rung, information, part, leave_open(part, estimator))
            for rung, part in zip(rungs, parts, strict=True)
        ]
        return open_, [leave_undecided(structure, rung, silence) for rung in rungs]
    models = [FittedModel.of(structure, rung, information, estimator) for rung in rungs]
    return models, [assess_feasibility(model, cad_weight) for model in models]


def plan_cross_validation(
    structure: Structure, rungs: Sequence[Rung], information: Information, estimator: Estimator
) -> Task:
    """Return how every stretch of the logs is predicted by models fitted to the others."""
    folds = choose_folds(information.log)
    values = []
    for fold in range(int(folds.max()) + 1):
        rest = leave_out(information, folds, fold)
        models = [FittedModel.of(structure, rung, rest, estimator) for rung in rungs]
        values.append(base_values(models, [find_nearest(model) for model in models]))
    return Task(np.stack(values), take_turns(information, folds))


def base_values(models: Sequence[FittedModel], physical: Sequence[PhysicalResult]) -> Array:
    """Return the base parameters of all fits, then of all nearest real robots, (b, 2 m)."""
    values = [model.rung.expand(model.estimate.value) for model in models]
    return np.stack([*values, *(p.base for p in physical)], 1)
