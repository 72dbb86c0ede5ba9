"""ε_RA of every rung in one pass over the logs, without keeping their predictions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identifiability.evaluation import STRETCHES
from identifiability.model import Regression
from identifiability.names import Array


@dataclass(frozen=True)
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


def measure_errors(
    regression: Regression,
    values: Array,
    folds: np.ndarray | None = None,
    reference: int = 0,
) -> RungErrors:
    """Return the errors of rungs along logs.

    Parameters
    ----------
    regression : Regression
    values : (F, b, m)
        Base parameters, one set for each fold.
    folds : (N,) int, optional
        Which set predicts a sample; the first without.
    reference : int
        The rung that others are compared with.
    """
    total = sum(s.outputs for s in regression.samples)
    which = np.zeros(total, int) if folds is None else folds
    mean, count = 0.0, 0
    for _, _, _, tau in regression.chunks():
        mean, count = mean + float(tau.sum()), count + tau.size
    mean /= max(count, 1)
    parts = min(STRETCHES, max(total, 1))
    sums, spread, at = np.zeros((parts, values.shape[2])), 0.0, 0
    for _, _, W, tau in regression.chunks():
        rows = np.arange(at, at + len(tau))
        at += len(tau)
        spread += float(np.abs(tau - mean).sum())
        size = np.empty((len(tau), values.shape[2]))
        for fold in np.unique(which[rows]):
            mine = which[rows] == fold
            size[mine] = np.abs(tau[mine][:, :, None] - W[mine] @ values[fold]).sum(1)
        np.add.at(sums, rows * parts // total, size)
    spread = spread if spread > 0 else np.nan
    apart = sums - sums[:, [reference]]
    se = apart.std(0, ddof=1) * np.sqrt(parts) if parts > 1 else np.full(values.shape[2], np.nan)
    return RungErrors(sums.sum(0) / spread, se / spread)
