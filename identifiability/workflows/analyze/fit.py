"""Fit the models of a ladder and find the real robots nearest to them; plan cross-validation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.estimation.least_squares import leave_open
from identifiability.estimation.prediction import Task, leave_out, take_turns
from identifiability.estimation.torque_errors import choose_folds
from identifiability.foundation.names import Array
from identifiability.physical.feasibility import (
    FittedModel,
    PhysicalResult,
    assess_feasibility,
    find_nearest,
    leave_undecided,
)
from identifiability.regression.information import Information
from identifiability.regression.reduction import Rung
from identifiability.regression.regression import Regression
from identifiability.regression.structure import Structure


def fit_ladder(
    structure: Structure,
    rungs: Sequence[Rung],
    information: Information,
    estimator: Estimator,
    cad_weight: float = 0.0,
    silence: str = "",
) -> tuple[list[Estimate], list[PhysicalResult], Array]:
    """Return the estimates, the nearest real robots, and the base parameters of both, (b, 2 m).

    With `silence`, which says why there is nothing to explain, nothing is fitted.
    """
    fits, physical = [], []
    for rung in rungs:
        if silence:
            fits.append(leave_open(rung.reduce(information), estimator))
            physical.append(leave_undecided(structure, rung, silence))
            continue
        fitted = FittedModel.of(structure, rung, information, estimator)
        fits.append(fitted.estimate)
        physical.append(assess_feasibility(fitted, cad_weight))
    return fits, physical, _base_values(rungs, fits, physical)


def plan_cross_validation(
    regression: Regression,
    structure: Structure,
    information: Information,
    rungs: Sequence[Rung],
    estimator: Estimator,
) -> Task:
    """Return how every stretch of the logs is predicted by models fitted to the others."""
    folds = choose_folds(information.log)
    values = []
    for fold in range(int(folds.max()) + 1):
        rest = leave_out(information, folds, fold)
        fitted = [FittedModel.of(structure, rung, rest, estimator) for rung in rungs]
        real = [find_nearest(model) for model in fitted]
        values.append(_base_values(rungs, [model.estimate for model in fitted], real))
    return Task(np.stack(values), take_turns(information, folds))


def _base_values(
    rungs: Sequence[Rung], fits: Sequence[Estimate], physical: Sequence[PhysicalResult]
) -> Array:
    """Return the base parameters of all fits, then of all nearest real robots, (b, 2 m)."""
    values = [r.expand(e.value) for r, e in zip(rungs, fits, strict=True)]
    return np.stack([*values, *(p.base for p in physical)], 1)
