"""`Gap`: prediction errors of several models on the same unseen rows, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import stats

from identifiability.estimation.noise.ar_noise import ARNoise
from identifiability.estimation.torque_errors import (
    change_interval,
    change_interval_over_joints,
    error_over_joints,
    joint_errors,
    ratio_interval,
    relative_error,
)
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.signals import is_constant
from identifiability.workflows.diagnose.rows import Rows

#: Level at which what a model leaves is more than noise.
SURE = 0.001


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
        rows = replace(self.rows, measured=self.rows.measured[:, some])
        return Gap(rows, self.residual[:, some])

    def joint_error(self, *, raw: bool = False) -> Array:
        """Return the error of each joint over its own scale (n, m), `raw` of measured torque."""
        left, own = self.residual, self._variation
        if raw:
            tau = self.rows.raw
            left = left + (tau - self.rows.measured)[:, :, None]
            own = (tau - tau.mean(0)) ** 2 * ~is_constant(tau.min(0), tau.max(0))
        return joint_errors(left**2, own)

    def joint_rms(self) -> Array:
        """Return the root mean square of each joint's error, (n, m) [N·m or N]."""
        rms: Array = np.sqrt(np.mean(self.residual**2, axis=0))
        return rms

    def interval_over_joints(
        self, first: int, second: int, rng: np.random.Generator, draws: int = 2000
    ) -> tuple[float, float]:
        """Return the 95 % interval of the change of the error over each joint's own scale."""
        squares = self.residual[:, :, [first, second]] ** 2
        return change_interval_over_joints(squares, self._variation, rng, draws)

    def news(
        self, noise: ARNoise, first: int, second: int, rng: np.random.Generator, draws: int = 2000
    ) -> tuple[float, float]:
        """Return the 95 % interval of how much of what the second model adds is there.

        It is one if all is and zero if nothing is; rows are whitened by the noise, which finds a
        torque of known course that slow noise hides in the error itself.
        """
        left = self.residual[:, :, second]
        both = self.residual[:, :, [first, second]]
        white = noise.whiten(both, self.rows.runs, noise.misfit(left))
        before, added = white[:, :, 0], white[:, :, 0] - white[:, :, 1]
        return ratio_interval((before * added).sum(1), (added**2).sum(1), rng, draws)

    def evidence(self, noise: ARNoise, first: int, second: int) -> float:
        """Return the logarithm of the likelihood ratio of the second model over the first.

        Of rows whitened by the noise, and by as much more as the second model leaves there: the
        values that were fitted elsewhere are off here too.
        """
        left = self.residual[:, :, [first, second]]
        white = noise.whiten(left, self.rows.runs, noise.misfit(left[:, :, 1]))
        before, after = (white**2).sum((0, 1)).tolist()
        return float(0.5 * (before - after) / max(1.0, after / white[:, :, 1].size))

    def is_within_noise(self, noise: ARNoise, model: int) -> bool:
        """Whether what a model leaves is no more than noise: only then is a likelihood one of it.

        From few rows fitted values are off on other motion by more than that.
        """
        white = noise.whiten(self.residual[:, :, [model]], self.rows.runs)
        return bool(stats.chi2.sf(np.sum(white**2), white.size) > SURE)

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
        tau = self.rows.measured
        own: Array = (tau - tau.mean(0)) ** 2 * ~is_constant(tau.min(0), tau.max(0))
        return own

    @property
    def _deviation(self) -> Array:
        tau = self.rows.measured
        distance: Array = np.abs(tau - tau.mean())
        return distance
