"""Errors on motion that was not fitted: while choosing, and on the motion that verifies.

A least-squares fit may buy its agreement with bodies of negative mass, and a wrong effect may
repair on other motion what these spoil there. What such an effect gains goes away as soon as
every fit, without it and with it, is the real robot nearest to the data [Traversaro 2016].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from identifiability.estimation.evidence import choose_folds
from identifiability.estimation.noise import ARNoise
from identifiability.estimation.torque_errors import DRAWN_STRETCHES, split_evenly
from identifiability.foundation.linalg import triangular_factor
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen, remember
from identifiability.workflows.diagnose.folds import REMEMBERED, Folds, Made, name_model
from identifiability.workflows.diagnose.gap import Gap
from identifiability.workflows.diagnose.known_fit import fit_known, solve_in_units
from identifiability.workflows.diagnose.predictive import Predictive
from identifiability.workflows.diagnose.real_fit import RealRobot
from identifiability.workflows.diagnose.rows import Candidate, Rows
from identifiability.workflows.diagnose.smooth import find_straight, fit_straight, with_straight

#: Share by which fits that the noise weighs must predict worse to be given up.
WORSE = 0.02


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


def gain_of(before: Array, after: Array) -> Gain:
    """Return the fall from some errors (N,) to others of the same rows."""
    level = float(before.mean()) or 1.0
    parts = [p.mean() / level for p in split_evenly(before - after, DRAWN_STRETCHES)]
    error = float(np.std(parts, ddof=1) / np.sqrt(len(parts))) if len(parts) > 1 else np.inf
    return Gain(float(np.mean(before - after)) / level, error)


@frozen
class HeldOut:
    """Fits on some rows, judges on others, verifies on yet others.

    Values that are known within errors could take on much of an effect that they cannot explain.
    So where models are compared these values are those that are found beside the largest of them.

    Attributes
    ----------
    train : Rows
    choosing : Rows or None
        Rows that judge during the search; None to leave out fitted motion in turn.
    verifying : Rows or None
        Rows that take no part in fitting or choosing; None to leave out fitted motion in turn.
    real : RealRobot or None
        Fits that a real robot can have; None where the model has no bodies or is not refitted.
    noise : ARNoise or None
        Rows that are fitted are weighed by it and by what a model does not explain; None for
        equal weights. Slow noise would cost a fit of many columns what it gains.
    """

    train: Rows
    choosing: Rows | None
    verifying: Rows | None = None
    real: RealRobot | None = None
    noise: ARNoise | None = None

    @staticmethod
    def weighed(
        train: Rows,
        choosing: Rows | None,
        verifying: Rows | None,
        real: RealRobot | None,
        noise: ARNoise,
    ) -> HeldOut:
        """Return what weighs its fits by the noise, unless equal weights surely predict better.

        Where the motion is noisy or the model is wrong at low frequencies, whitened rows are worse
        than they are.
        """
        white, equal = (HeldOut(train, choosing, verifying, real, n) for n in (noise, None))
        left = [np.abs(h._predict(choosing, (), real=False)) for h in (white, equal)]
        errors = [np.mean(r / equal._scale, axis=1) for r in left]
        loss = gain_of(*errors)
        return equal if loss.share > max(loss.error, WORSE) else white

    @cached_property
    def made(self) -> Made:
        """What was fitted so far."""
        return Made()

    def recall(self, before: HeldOut) -> HeldOut:
        """Return it with what was made before of the same rows with the same noise."""
        self.made.recall(before.made)
        return self

    def error(self, chosen: Sequence[Candidate], *, real: bool = False) -> float:
        """Return the mean absolute error while choosing, every joint in units of its own."""
        return float(np.mean(self.errors(chosen, real=real)))

    def errors(
        self,
        chosen: Sequence[Candidate],
        *,
        real: bool = False,
        beside: Sequence[Candidate] | None = None,
    ) -> Array:
        """Return the absolute error of every row while choosing, averaged over joints, (N,).

        With `real`, fits are those of a real robot, where the model has bodies. With `beside`,
        known values are those found with these candidates.
        """
        real = real and self.real is not None
        beside = None if self.train.root is None else beside
        key = frozenset(name_model(chosen)), real, None if beside is None else name_model(beside)
        if key not in self.made.errors:
            residual = self._predict(self.choosing, chosen, real=real, beside=beside)
            self.made.errors[key] = np.mean(np.abs(residual) / self._scale, axis=1)
        return self.made.errors[key]

    @cached_property
    def _scale(self) -> Array:
        scale = np.sqrt(np.mean(self._predict(self.choosing, (), real=False) ** 2, axis=0))
        positive: Array = np.where(scale > 0, scale, 1.0)
        return positive

    def gain(
        self, rest: Sequence[Candidate], whole: Sequence[Candidate], *, real: bool = False
    ) -> Gain:
        """Return what some candidates gain over fewer of them while choosing."""
        before = self.errors(rest, real=real, beside=whole)
        after = self.errors(whole, real=real, beside=whole)
        return gain_of(before, after)

    def improves(self, before: Sequence[Candidate], after: Sequence[Candidate]) -> bool:
        """Whether the error while choosing, of real robots, is less with other candidates."""
        if self.train.root is None:
            return self.error(after, real=True) < self.error(before, real=True)
        return self.gain(before, after).share > 0

    def gap(self, models: Sequence[Sequence[Candidate]], *, real: bool = False) -> Gap:
        """Return the errors of several models on the motion that verifies, side by side."""
        parts = [self._predict(self.verifying, m, real=real, beside=models[-1]) for m in models]
        where = self.verifying if self.verifying is not None else self.train
        return Gap(where, np.stack(parts, axis=2))

    def predictive(self, chosen: Sequence[Candidate], noise: ARNoise) -> Predictive:
        """Return what unseen motion adds to the fitted one, in units of the noise."""
        fitted = (self if self.noise is noise else replace(self, noise=noise))._weighed(chosen)
        root = np.zeros((0, 0)) if self.train.root is None else self.train.root
        known = np.zeros((len(root), fitted.width))
        known[:, : root.shape[1]] = root

        def told(left_out: int | None) -> Array:
            return with_straight(np.concatenate([fitted.rows(left_out), known]), chosen)

        if self.verifying is None:
            parts = [
                (told(k), fitted.parts[k].reshape(-1, fitted.width))
                for k in range(len(fitted.parts))
            ]
            return Predictive.of(parts, int(self.train.data.sum()))
        before = told(None)
        unseen = _whiten_beside(before, self.verifying, chosen, noise)
        return Predictive.of([(before, unseen)], int(self.verifying.data.sum()))

    def _predict(
        self,
        where: Rows | None,
        chosen: Sequence[Candidate],
        *,
        real: bool,
        beside: Sequence[Candidate] | None = None,
    ) -> Array:
        if where is not None:
            value = self.fit(chosen, real=real, beside=beside)
            left: Array = where.tau - where.columns(chosen) @ value
            return left
        folds = choose_folds(self.train.log)
        columns = self.train.columns(chosen)
        out = np.array(self.train.tau)
        for fold in np.unique(folds).tolist():
            test = folds == fold
            out[test] -= columns[test] @ self.fit(chosen, fold, real=real, beside=beside)
        return out

    def fit(
        self,
        chosen: Sequence[Candidate],
        left_out: int | None = None,
        *,
        real: bool = False,
        beside: Sequence[Candidate] | None = None,
    ) -> Array:
        """Return the values of the model with some candidates from rows outside of a fold, (m,).

        Joints weigh by their own residual. With `real` it is the fit of a real robot; where the
        solver finds none, which is rare, the least-squares fit stands in.
        """
        real = real and self.real is not None
        key = name_model(chosen), left_out, real, None if beside is None else name_model(beside)
        if key not in self.made.values:
            self.made.values[key] = self._fit(chosen, left_out, real, beside)
        return self.made.values[key]

    def _fit(
        self,
        chosen: Sequence[Candidate],
        left_out: int | None,
        real: bool,
        beside: Sequence[Candidate] | None,
    ) -> Array:
        information, free = self._weighed(chosen).fit(left_out)
        straight = find_straight(information, free, chosen)
        if self.train.root is not None:
            b = self.train.X.shape[2]
            kept = None if beside is None else self.fit(beside, left_out)[:b]
            return fit_known(information, free, self.train.root, kept, straight)
        if real and self.real is not None:
            found = self.real.fit(information, free, chosen, straight)
            if found is not None:
                return found
        return free.value if straight is None else fit_straight(information, free, straight)

    def _weighed(self, chosen: Sequence[Candidate]) -> Folds:
        """Return the fitted rows of a model, weighed by the noise and by what it leaves."""
        make = partial(self._weigh, chosen)
        return remember(self.made.folds, name_model(chosen), make, REMEMBERED)

    def _weigh(self, chosen: Sequence[Candidate]) -> Folds:
        fold_of, rows = choose_folds(self.train.log), _model_rows(self.train, chosen)
        plain = Folds.of(rows, fold_of)
        if self.noise is None:
            return plain
        left = _leave(rows, plain.fit()[1].value)
        white = self.noise.whiten(
            rows, self.train.moving, self.noise.misfit(left, self.train.counts)
        )
        return Folds.of(white, fold_of)

    def fitted_residual(self, chosen: Sequence[Candidate]) -> Array:
        """Return the errors on the rows that were fitted, (N, n)."""
        return self._predict(self.train, chosen, real=False)


def _whiten_beside(
    before: Array, unseen: Rows, chosen: Sequence[Candidate], noise: ARNoise
) -> Array:
    """Return unseen rows (·, k + 1) of a model, weighed by the noise and by what it leaves there.

    Beside values of both motions: what the fitted ones are off by is no fault of the model.
    """
    rows = _model_rows(unseen, chosen)
    white = noise.whiten(rows, unseen.moving)
    both = triangular_factor(np.concatenate([before, white.reshape(-1, white.shape[2])]))
    left = _leave(rows, solve_in_units(both[:, :-1], both[:, -1]))
    misfit = noise.misfit(left, unseen.counts)
    if misfit.any():
        white = noise.whiten(rows, unseen.moving, misfit)
    return white.reshape(-1, white.shape[2])


def _model_rows(rows: Rows, chosen: Sequence[Candidate]) -> Array:
    """Return the columns of a model and the torque, (N, n, k + 1)."""
    return np.concatenate([rows.columns(chosen), rows.tau[:, :, None]], axis=2)


def _leave(rows: Array, value: Array) -> Array:
    """Return what values (k,) leave of such rows, (N, n)."""
    left: Array = rows[:, :, -1] - rows[:, :, :-1] @ value
    return left
