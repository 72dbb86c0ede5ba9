"""Prediction errors of models: ε_RA in sample, on held-out logs, by blocked cross-validation."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from identifiability.estimation.error_sums import ErrorSums, Layout, Tally
from identifiability.estimation.prediction import STRETCHES, Prediction
from identifiability.foundation.engines.mapping import Engine, Steps
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare.survey import find_signal
from identifiability.regression.information import Information
from identifiability.regression.regression import Part, Regression, map_parts

__all__ = [
    "STRETCHES", "Prediction", "Task", "Turns", "choose_folds", "leave_out", "parameter_error",
    "predict", "predict_all", "take_turns",
]  # fmt: skip

#: Folds of the blocked cross-validation when there is one log.
FOLDS = 5


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


@frozen
class Task:
    """Models to be predicted with: base parameters, one set for each fold.

    Attributes
    ----------
    values : (F, b, m)
    turns : Turns or None
        Which set predicts a sample; the first without.
    excerpt : bool
        Whether samples are held, not only sums.
    """

    values: Array
    turns: Turns | None = None
    excerpt: bool = True


def predict(
    regression: Regression,
    values: Array,
    turns: Turns | None = None,
    *,
    engine: Engine | None = None,
) -> Prediction:
    """Predict torque with base parameter values of m models.

    Parameters
    ----------
    regression : Regression
    values : (b, m) or (F, b, m)
        Base parameters of each model; with `turns`, one set for each fold.
    turns : Turns, optional
        Which set predicts a sample.
    engine : Engine, optional
    """
    values = values if values.ndim == 3 else values[None]
    return predict_all(regression, [Task(values, turns)], engine=engine)[0]


def predict_all(
    regression: Regression,
    tasks: Sequence[Task],
    *,
    engine: Engine | None = None,
    progress: Steps | None = None,
) -> list[Prediction]:
    """Return several predictions of the same logs, going through them once.

    Parameters
    ----------
    regression : Regression
    tasks : sequence of Task
    engine : Engine, optional
        Where stretches of long logs are worked on; here without.
    progress : callable(int, int), optional
    """
    surveys = [s.survey for s in regression.samples]
    counts = [s.outputs for s in surveys]
    torque = np.array([s.torque for s in surveys])
    layout = Layout.of(counts, torque, STRETCHES, find_signal(surveys))
    tallies = [Tally(layout, task.values.shape[2]) for task in tasks]
    held: list[list[Held]] = [[] for _ in tasks]
    work = partial(_predict_part, tasks=tuple(tasks), layout=layout)
    for found in map_parts(work, regression, engine, progress):
        for k, (sums, excerpt) in enumerate(found):
            tallies[k].merge(sums)
            held[k] += excerpt
    return [_assemble(t.sums(), h, len(counts)) for t, h in zip(tallies, held, strict=True)]


#: Log, series, times, torque, prediction and velocity of some samples of an excerpt.
Held = tuple[int, int, Array, Array, Array, Array]


def _predict_part(
    part: Part, tasks: Sequence[Task], layout: Layout
) -> list[tuple[ErrorSums, list[Held]]]:
    out: list[tuple[Tally, list[Held]]] = [(Tally(layout, t.values.shape[2]), []) for t in tasks]
    for chunk in part.chunks():
        start, stop = chunk.start, chunk.start + len(chunk.tau)
        before = layout.offset(chunk.log)
        shown = layout.shown(chunk.log, start, stop)
        for task, (tally, held) in zip(tasks, out, strict=True):
            predicted = np.empty((*chunk.tau.shape, task.values.shape[2]))
            if task.turns is None:
                predicted[:] = chunk.W @ task.values[0]
            else:
                which = task.turns.of(before + start, before + stop)
                for fold in np.unique(which):
                    predicted[which == fold] = chunk.W[which == fold] @ task.values[fold]
            tally.add(chunk.log, start, chunk.tau, predicted)
            if not task.excerpt:
                continue
            for series, rows in shown:
                held.append(
                    (chunk.log, series, chunk.t[rows], chunk.tau[rows], predicted[rows],
                     chunk.velocity[rows])
                )  # fmt: skip
    return [(tally.sums(), held) for tally, held in out]


def _assemble(sums: ErrorSums, held: Sequence[Held], logs: int) -> Prediction:
    n, m = sums.absolute.shape[1:]
    log = np.concatenate([np.full(len(h[2]), h[0]) for h in held] or [np.empty(0, int)])
    series = np.concatenate([np.full(len(h[2]), h[1]) for h in held] or [np.empty(0, int)])
    t = np.concatenate([h[2] for h in held] or [np.empty(0)])
    tau = np.concatenate([h[3] for h in held] or [np.empty((0, n))])
    predicted = np.concatenate([h[4] for h in held] or [np.empty((0, n, m))])
    velocity = np.concatenate([h[5] for h in held] or [np.empty((0, n))])
    times = tuple(t[log == k] for k in range(logs))
    return Prediction(sums, times, tau, predicted, log, series, velocity)


def choose_folds(information: Information) -> np.ndarray:
    """Return the fold of each block: whole logs where there are several, else stretches of one."""
    if information.log.max(initial=0) > 0:
        return information.log
    blocks = len(information.counts)
    return (np.arange(blocks) * min(FOLDS, blocks)) // blocks


def take_turns(information: Information, folds: np.ndarray) -> Turns:
    """Return who predicts which sample, from the fold of each block."""
    return Turns(np.cumsum(information.counts), folds)


def leave_out(information: Information, folds: np.ndarray, fold: int) -> Information:
    """Return the information of all blocks but those of one fold."""
    return information.take(folds != fold)


def parameter_error(value: Array, exact: Array, chosen: Sequence[bool] | np.ndarray) -> float:
    """Return ε_AV over the chosen parameters, ``mean |φ - φ̂|/|φ|`` [Díaz 2010, Eq. 19].

    The paper averages over all parameters; with exact values of zero that cannot be, and its
    numbers fit the mean over the properly identified ones.
    """
    used = np.asarray(chosen, bool) & (np.abs(exact) > 1e-12 * np.abs(exact).max(initial=0.0))
    if not used.any():
        return float("nan")
    return float(np.mean(np.abs((value[used] - exact[used]) / exact[used])))
