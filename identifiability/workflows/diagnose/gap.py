"""`Gap`: prediction errors of several models on the same unseen rows; and where a residual sits.

Of what is left it is told at which joint, velocity, position, load, time and log it sits.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.estimation.torque_errors import (
    change_interval,
    error_over_joints,
    joint_errors,
    relative_error,
)
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.signals import is_constant
from identifiability.workflows.diagnose.rows import Rows

#: Bins in which the residual is averaged.
BINS = 12


@frozen
class Gap:
    """Prediction errors of several models on the same rows.

    Attributes
    ----------
    rows : Rows
        Where they are.
    residual : (N, n, m) [N·m or N]
    """

    rows: Rows
    residual: Array

    def relative_error(self) -> Array:
        """Return ε_RA of each model [Díaz 2010, Eq. 18], (m,)."""
        return relative_error(np.abs(self.residual), self._deviation)

    def interval(
        self, first: int, second: int, rng: np.random.Generator, draws: int = 2000
    ) -> tuple[float, float]:
        """Return the 95 % interval of the change of ε_RA from one model to another."""
        error = np.abs(self.residual[:, :, [first, second]])
        return change_interval(error, self._deviation, rng, draws)

    def error_over_joints(self) -> Array:
        """Return the error of each model over each joint's own scale, (m,)."""
        return error_over_joints(self.residual**2, self.variation)

    def joint_error(self) -> Array:
        """Return the error of each joint over its own scale, (n, m)."""
        return joint_errors(self.residual**2, self.variation)

    def joint_rms(self) -> Array:
        """Return the root mean square of each joint's error, (n, m) [N·m or N]."""
        rms: Array = np.sqrt(np.sum(self.residual**2, axis=0) / self.rows.counts[:, None])
        return rms

    @property
    def variation(self) -> Array:
        """Squared distances of torque from each joint's mean, zero where no data, (N, n)."""
        tau, data = self.rows.measured, self.rows.data
        some = tau.min(0, initial=np.inf, where=data), tau.max(0, initial=-np.inf, where=data)
        own: Array = (tau - tau.sum(0) / self.rows.counts) ** 2 * data * ~is_constant(*some)
        return own

    @property
    def _deviation(self) -> Array:
        tau = self.rows.measured
        distance: Array = np.abs(tau - tau.sum() / self.rows.data.sum()) * self.rows.data
        return distance


@frozen
class Discrepancy:
    """Where the residual of a joint sits.

    Attributes
    ----------
    joint : str
    rms : float [N·m or N]
    share : float
        Of the measured torque's rms.
    explained : mapping
        Share of the residual's variance that its averages over bins of velocity, position,
        acceleration, load, time, log and session explain, beyond what white noise would.
    """

    joint: str
    rms: float
    share: float
    explained: dict[str, float]


def find_discrepancies(
    rows: Rows, residual: Array, joints: Sequence[str]
) -> tuple[Discrepancy, ...]:
    """Return where the residual (N, n) of each joint sits."""
    out = []
    for j, joint in enumerate(joints):
        data = rows.data[:, j]
        r = residual[data, j]
        if not len(r):
            out.append(Discrepancy(joint, 0.0, 0.0, {}))
            continue
        explained = {name: explained_share(x[data], r) for name, x in rows.along(j).items()}
        size, whole = (float(np.sqrt(np.mean(x**2))) for x in (r, rows.measured[data, j]))
        out.append(Discrepancy(joint, size, size / (whole or 1.0), explained))
    return tuple(out)


def explained_share(x: Array, r: Array) -> float:
    """Return the share of the variance of r that its means over bins of x explain, adjusted."""
    values = np.unique(x)
    if len(values) <= BINS:
        index = np.searchsorted(values, x)
    else:
        index = np.empty(len(x), int)
        index[np.argsort(x, kind="stable")] = np.arange(len(x)) * BINS // len(x)
    counts = np.bincount(index).astype(float)
    means = np.bincount(index, r) / np.maximum(counts, 1)
    between = float((counts * (means - r.mean()) ** 2).sum())
    total = float(((r - r.mean()) ** 2).sum())
    k = int((counts > 0).sum())
    if total <= 0 or len(r) <= k or k < 2:
        return 0.0
    adjusted = 1 - (1 - between / total) * (len(r) - 1) / (len(r) - k)
    return float(np.clip(adjusted, 0.0, 1.0))
