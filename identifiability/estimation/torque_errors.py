"""How far predicted torque is from the measured: one definition; who predicts what is held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.numbers import ENDS
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.regression.regression import choose_windows

# What is known of logs before errors are added up, and who predicts what is held out.
#
# What to use when: `evidence.Folds` for what is left out while the rest is fitted, and `Turns` for
# who predicts it then.


@frozen
class Layout:
    """How long logs are, and what their torque is on average.

    Attributes
    ----------
    counts : (L,) int
        Samples of each log.
    windows : tuple of (w, 2) int
        Samples [start, stop) of each log that are looked at.
    mean : float [N·m or N]
        Of the torque over all joints and logs.
    joint_mean : (n,) [N·m or N]
    log_mean : (L,) [N·m or N]
        Over all joints of a log.
    signal : (n,) bool
        Joints at which there is something to explain (`samples.survey.find_signal`).
    """

    counts: np.ndarray
    windows: tuple[np.ndarray, ...]
    mean: float
    joint_mean: Array
    log_mean: Array
    signal: np.ndarray

    @staticmethod
    def of(
        counts: Sequence[int], torque: Array, signal: np.ndarray, rows: np.ndarray | None = None
    ) -> Layout:
        """Return the layout of logs.

        Parameters
        ----------
        counts : sequence of int
            Samples of each log.
        torque : (L, n) [N·m or N]
            Sum of the torque of each log.
        signal : (n,) bool
            Joints at which there is something to explain.
        rows : (L, n) int, optional
            Samples at which torque of each joint is data; all by default.
        """
        every = np.outer(counts, np.ones(torque.shape[1], int)) if rows is None else rows
        return Layout(
            counts=np.array(counts, int),
            windows=choose_windows(counts),
            mean=float(torque.sum() / max(every.sum(), 1)),
            joint_mean=torque.sum(0) / np.maximum(every.sum(0), 1),
            log_mean=torque.sum(1) / np.maximum(every.sum(1), 1),
            signal=signal,
        )

    def series(self, log: int, start: int) -> int:
        """Return the number of the window, over all logs, in which a sample of a log lies."""
        before = sum(len(w) for w in self.windows[:log])
        return before + int(np.searchsorted(self.windows[log][:, 0], start, "right")) - 1


@frozen
class Turns:
    """Which set of values predicts a sample: runs of consecutive samples take turns.

    Attributes
    ----------
    ends : (B,) int
        Sample, over all logs, at which each run ends.
    fold : (B,) int
    """

    ends: np.ndarray
    fold: np.ndarray

    def of(self, start: int, stop: int) -> np.ndarray:
        """Return the fold of the samples [start, stop), (n,) int."""
        found: np.ndarray = self.fold[np.searchsorted(self.ends, np.arange(start, stop), "right")]
        return found


def take_turns(information: Information, folds: np.ndarray) -> Turns:
    """Return who predicts which sample, from the fold of each block."""
    return Turns(np.cumsum(information.counts), folds)


# How far predicted torque is from the measured: one definition.
#
# What to use when: models are chosen by the error over each joint's own scale
# (`error_over_joints`), which sees small joints as well as large ones; ε_RA (`relative_error`) is
# the paper's, which adds up N and N·m as they are. `change_interval` is for samples that are all
# held; `ErrorSums` for logs of any length, whose errors are added up in one pass. Means that
# variation is measured from are known before (`Layout`), so parts of a log can be worked on
# anywhere.


#: Stretches that are drawn again and again for an interval: more, as each weighs by itself.
DRAWN_STRETCHES = 24


def relative_error(error: Array, deviation: Array) -> Array:
    """Return ε_RA of each model, ``Σ|τ̂ - τ*| / Σ|τ* - mean τ*|`` [Díaz 2010, Eq. 18], (m,).

    NaN where there is nothing to explain.

    Parameters
    ----------
    error : (N, n, m) [N·m or N]
        Absolute errors of each sample and joint, or their sums over stretches of time.
    deviation : (N, n) [N·m or N]
        Distances of the measured torque from its mean over everything, or their sums.
    """
    total = float(deviation.sum())
    ratio: Array = error.sum((0, 1)) / (total if total > 0 else np.nan)
    return ratio


def joint_errors(squares: Array, variation: Array) -> Array:
    """Return the error of each joint over its own scale, (n, m).

    The root mean square of its error over that of its torque about its mean; NaN where the torque
    never varies.

    Parameters
    ----------
    squares : (S, n, m) [(N·m)² or N²]
        Squared errors of m models, or their sums over stretches of time.
    variation : (S, n) [(N·m)² or N²]
        Squared distances of the measured torque from its mean over the joint, or their sums.
    """
    own = variation.sum(0)
    ratio: Array = np.sqrt(squares.sum(0) / np.where(own > 0, own, np.nan)[:, None])
    return ratio


def joint_weights(variation: Array) -> Array:
    """Return what a squared error of each joint weighs, (…, n): all joints alike in all.

    Parameters
    ----------
    variation : (…, n) [(N·m)² or N²]
        As in `joint_errors`, its sum; a joint without any weighs nothing.
    """
    seen = variation > 0
    weights = np.where(seen, 1.0, 0.0) / np.where(seen, variation, 1.0)
    count = seen.sum(-1, keepdims=True)
    return weights / np.where(count > 0, count, np.nan)


def error_over_joints(squares: Array, variation: Array) -> Array:
    """Return the error over each joint's own scale, root mean square over the joints, (m,).

    Zero is perfect, one as good as each joint's mean. Joints whose torque never varies have no say;
    NaN where there is nothing to explain. Parameters are those of `joint_errors`.
    """
    total: Array = np.sqrt(joint_weights(variation.sum(0)) @ squares.sum(0))
    return total


def loaded_joints(rms: Array) -> list[int]:
    """Return the joints whose torque there is something to say of; all where there is none.

    What nothing drives, as a base, has none along most motions.
    """
    loaded = np.flatnonzero(rms > 0)
    return (loaded if len(loaded) else np.arange(len(rms))).tolist()


def split_evenly(x: Array, parts: int) -> list[Array]:
    """Return consecutive parts of about equal length, none empty."""
    return [part for part in np.array_split(x, parts) if len(part)]


def change_interval(
    error: Array, deviation: Array, rng: np.random.Generator, draws: int = 2000
) -> tuple[float, float]:
    """Return the 95 % interval of the change of ε_RA from one model to another.

    Whole stretches of time are drawn again and again [Künsch 1989].

    Parameters
    ----------
    error, deviation : (N, n, 2) and (N, n) [N·m or N]
        As in `relative_error`.
    rng : numpy.random.Generator
    draws : int
    """
    change = (error[:, :, 1] - error[:, :, 0]).sum(1)
    return ratio_interval(change, deviation.sum(1), rng, draws)


def ratio_interval(
    part: Array, whole: Array, rng: np.random.Generator, draws: int = 2000
) -> tuple[float, float]:
    """Return the 95 % interval of the sum of some numbers (N,) over that of others (N,) [1].

    Whole stretches of time are drawn again and again [Künsch 1989].
    """
    parts, wholes = (
        np.array([p.sum() for p in split_evenly(x, DRAWN_STRETCHES)]) for x in (part, whole)
    )
    counts = rng.multinomial(len(parts), np.full(len(parts), 1 / len(parts)), size=draws)
    size = counts @ wholes
    low, high = np.quantile((counts @ parts) / np.where(size > 0, size, 1.0), ENDS)
    return float(low), float(high)


@frozen
class ErrorSums:
    """All that errors of prediction say, summed over each of L logs; parts add up.

    Attributes
    ----------
    counts : (L,) int
        Samples of each log.
    rows : (L, n) int
        Those of them at which torque of each joint is data.
    absolute, squares : (L, n, m) [N·m or N, and squared]
        Of the errors of each joint and model.
    torque_squares : (L, n) [(N·m)² or N²]
        Of the measured torque.
    deviation, own, local : (L, n) [N·m or N]
        Distances of the torque from its mean over everything, over the joint, over the log: the
        denominators of relative errors. Zero where there is nothing to explain.
    variation : (L, n) [(N·m)² or N²]
        Squared distances from the mean over the joint.
    """

    counts: np.ndarray
    rows: np.ndarray
    absolute: Array
    squares: Array
    torque_squares: Array
    deviation: Array
    own: Array
    local: Array
    variation: Array

    @staticmethod
    def of(
        layout: Layout,
        log: int,
        tau: Array,
        predicted: Array,
        data: np.ndarray | None = None,
    ) -> ErrorSums:
        """Return the sums of some samples of a log.

        Measured torque tau (N, n) and predicted torque (N, n, m) are in N·m or N; where they are
        no `data` (N, n), they are not looked at.
        """
        data = np.ones(tau.shape, bool) if data is None else data
        means = (layout.mean, layout.joint_mean, layout.log_mean[log])
        error = np.abs(tau[:, :, None] - predicted) * data[:, :, None]
        deviation, own, local = (np.abs(tau - mean) * data for mean in means)
        signal = layout.signal
        some = signal.any()  # joints without any are still apart from the mean over all
        spread = deviation * some, own * signal, local * some, own**2 * signal
        sums = []
        every = np.ones(len(tau), int), data.astype(int)
        for rows in (*every, error, error**2, tau**2 * data, *spread):
            sums.append(np.zeros((len(layout.counts), *rows.shape[1:]), rows.dtype))
            sums[-1][log] = rows.sum(0)
        return ErrorSums(*sums)

    def __add__(self, other: ErrorSums) -> ErrorSums:
        """Return the sums over the samples of both, in the same layout."""
        return ErrorSums(*map(np.add, vars(self).values(), vars(other).values()))

    def select(self, models: Sequence[int]) -> ErrorSums:
        """Return the sums of some models."""
        at = list(models)
        return replace(self, absolute=self.absolute[:, :, at], squares=self.squares[:, :, at])
