"""`Gap`: prediction errors of several models on the same unseen rows, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.estimation.torque_errors import (
    change_interval,
    change_interval_over_joints,
    error_over_joints,
    joint_errors,
    relative_error,
)
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.signals import is_constant
from identifiability.workflows.diagnose.rows import Rows


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
        return error_over_joints(self.residual**2, self._variation)

    def at(self, joints: Sequence[int]) -> Gap:
        """Return the same at some joints only."""
        some = list(joints)
        measured, data = self.rows.measured[:, some], self.rows.data[:, some]
        rows = replace(self.rows, measured=measured, moves=data)
        return Gap(rows, self.residual[:, some])

    def joint_error(self, *, raw: bool = False) -> Array:
        """Return the error of each joint over its own scale (n, m), `raw` of measured torque."""
        left, own = self.residual, self._variation
        if raw:
            left = left + (self.rows.raw - self.rows.measured)[:, :, None]
            own = self._own(self.rows.raw)
        return joint_errors(left**2, own)

    def joint_rms(self) -> Array:
        """Return the root mean square of each joint's error, (n, m) [N·m or N]."""
        rms: Array = np.sqrt(np.sum(self.residual**2, axis=0) / self.rows.counts[:, None])
        return rms

    def interval_over_joints(
        self, first: int, second: int, rng: np.random.Generator, draws: int = 2000
    ) -> tuple[float, float]:
        """Return the 95 % interval of the change of the error over each joint's own scale."""
        squares = self.residual[:, :, [first, second]] ** 2
        return change_interval_over_joints(squares, self._variation, rng, draws)

    def expected_change(self, first: int, second: int) -> float:
        """Return how the error over joints would change, were what the second model adds there.

        Then the first one misses the torque between them beside what the second one leaves.
        """
        before, after = self.residual[:, :, first], self.residual[:, :, second]
        squares = np.stack([after**2 + (before - after) ** 2, after**2], axis=2)
        without, with_it = error_over_joints(squares, self._variation)
        return float(with_it - without)

    @property
    def _variation(self) -> Array:
        return self._own(self.rows.measured)

    def _own(self, tau: Array) -> Array:
        """Return squared distances of torque (N, n) from each joint's mean, zero where no data."""
        data, low, high = self.rows.data, np.inf, -np.inf
        some = tau.min(0, initial=low, where=data), tau.max(0, initial=high, where=data)
        own: Array = (tau - tau.sum(0) / self.rows.counts) ** 2 * data * ~is_constant(*some)
        return own

    @property
    def _deviation(self) -> Array:
        tau = self.rows.measured
        distance: Array = np.abs(tau - tau.sum() / self.rows.data.sum()) * self.rows.data
        return distance
