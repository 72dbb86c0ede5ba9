"""Errors on motion that was not fitted: while choosing, and on the motion that verifies."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from identifiability.estimation.torque_errors import (
    DRAWN_STRETCHES,
    change_interval,
    choose_folds,
    relative_error,
    split_evenly,
)
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.real_robot import RealRobot
from identifiability.workflows.diagnose.rows import Candidate, Rows, fit_weighted


@frozen
class Gap:
    """Prediction errors of several models on the same unseen rows.

    Attributes
    ----------
    tau : (N, n)
        Measured torque.
    residual : (N, n, m)
    rows : Rows
        Where they are.
    """

    tau: Array
    residual: Array
    rows: Rows

    def relative_error(self) -> Array:
        """Return ε_RA of each model [Díaz 2010, Eq. 18], (m,)."""
        return relative_error(np.abs(self.residual), self._deviation)

    def interval(
        self, first: int, second: int, rng: np.random.Generator, draws: int = 2000
    ) -> tuple[float, float]:
        """Return the 95 % interval of the change of ε_RA from one model to another."""
        error = np.abs(self.residual[:, :, [first, second]])
        return change_interval(error, self._deviation, rng, draws)

    @property
    def _deviation(self) -> Array:
        distance: Array = np.abs(self.tau - self.tau.mean())
        return distance


@frozen
class HeldOut:
    """Fits on some rows, judges on others, verifies on yet others.

    Attributes
    ----------
    train : Rows
    choosing : Rows or None
        Rows that judge during the search; None to leave out fitted motion in turn.
    verifying : Rows or None
        Rows that take no part in fitting or choosing; None to leave out fitted motion in turn.
    real : RealRobot or None
        Fits that a real robot can have; None where the model has no bodies or is not refitted.
    """

    train: Rows
    choosing: Rows | None
    verifying: Rows | None = None
    real: RealRobot | None = None

    def error(self, chosen: Sequence[Candidate], *, real: bool = False) -> float:
        """Return the mean absolute error while choosing, every joint in units of its own."""
        return float(np.mean(self.errors(chosen, real=real)))

    def errors(self, chosen: Sequence[Candidate], *, real: bool = False) -> Array:
        """Return the absolute error of every row while choosing, averaged over joints, (N,).

        With `real`, fits are those of a real robot, where the model has bodies.
        """
        real = real and self.real is not None
        key = real, tuple(sorted(k for c in chosen for k in c.columns))
        if key not in self._known:
            residual = self._predict(self.choosing, chosen, real=real)
            self._known[key] = np.mean(np.abs(residual) / self._scale, axis=1)
        return self._known[key]

    @cached_property
    def _known(self) -> dict[tuple[bool, tuple[int, ...]], Array]:
        return {}

    @cached_property
    def _scale(self) -> Array:
        scale = np.sqrt(np.mean(self._predict(self.choosing, (), real=False) ** 2, axis=0))
        positive: Array = np.where(scale > 0, scale, 1.0)
        return positive

    def gain(
        self, rest: Sequence[Candidate], whole: Sequence[Candidate], *, real: bool = False
    ) -> Gain:
        """Return what some candidates gain over fewer of them while choosing."""
        before, after = self.errors(rest, real=real), self.errors(whole, real=real)
        parts = [p.mean() for p in split_evenly(before - after, DRAWN_STRETCHES)]
        level = float(before.mean()) or 1.0
        error = float(np.std(parts, ddof=1) / np.sqrt(len(parts))) if len(parts) > 1 else np.inf
        return Gain(float(np.mean(before - after)) / level, error / level)

    def gap(self, models: Sequence[Sequence[Candidate]], *, real: bool = False) -> Gap:
        """Return the errors of several models on the motion that verifies, side by side."""
        parts = [self._predict(self.verifying, m, real=real) for m in models]
        where = self.verifying if self.verifying is not None else self.train
        return Gap(where.measured, np.stack(parts, axis=2), where)

    def _predict(self, where: Rows | None, chosen: Sequence[Candidate], *, real: bool) -> Array:
        if where is not None:
            left: Array = where.tau - where.columns(chosen) @ self._fit(chosen, None, real=real)
            return left
        folds = choose_folds(self.train.log)
        columns = self.train.columns(chosen)
        out = np.array(self.train.tau)
        for fold in np.unique(folds):
            test = folds == fold
            out[test] -= columns[test] @ self._fit(chosen, ~test, real=real)
        return out

    def _fit(self, chosen: Sequence[Candidate], mask: np.ndarray | None, *, real: bool) -> Array:
        # Where the solver finds no real robot, which is rare, the least-squares fit stands in.
        found = self.real.fit(self.train, chosen, mask) if real and self.real else None
        return fit_weighted(self.train, chosen, mask) if found is None else found

    def fitted_residual(self, chosen: Sequence[Candidate]) -> Array:
        """Return the errors on the rows that were fitted, (N, n)."""
        value = fit_weighted(self.train, chosen)
        left: Array = self.train.tau - self.train.columns(chosen) @ value
        return left

    def fitted_gap(self, models: Sequence[Sequence[Candidate]]) -> Gap:
        """Return the errors of several models on the rows they were fitted to."""
        parts = [self.fitted_residual(m) for m in models]
        return Gap(self.train.measured, np.stack(parts, axis=2), self.train)


@frozen
class Gain:
    """Relative fall of the error while choosing.

    Attributes
    ----------
    share, error : float
        With its standard error from means over stretches of time.
    """

    share: float
    error: float
