"""The band of computed derivatives where joints disagree about it: whichever predicts better.

A low-pass for all joints must leave the motion of the fastest alone; but what seems to be fast
motion of one joint may be the steps of a coarse encoder, or a disturbance. Spectra cannot tell
them apart, predictions can: without the joints that alone ask for a wider band there is another
candidate, the robot is fitted in each band, and what counts is the error of the torque as it was
measured, sample by sample the same for all candidates, on blocked folds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.estimation.estimate import find_estimator
from identifiability.estimation.evidence import Folds, Score
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.names import Array
from identifiability.logs.prepare import Preparation, prepare_samples
from identifiability.logs.prepare.preparation import SettledPreparation, settle_cutoff
from identifiability.logs.repeats import Recording
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.regression.gather import gather_information
from identifiability.regression.information import Information
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.rules import RULES

#: Samples of all logs together that are asked: of so many joints at most, of more as many as take
#: as long (rows and columns grow with them), but some.
ENOUGH, OF_JOINTS, SOME = 16_384, 6, 2_048


def enough_samples(robot: Robot) -> int:
    """Return how many samples of all logs together are asked."""
    many = len(robot.actuated) / OF_JOINTS
    return min(ENOUGH, max(SOME, int(ENOUGH / many**2)))


def settle_band(
    structure: Structure, logs: Sequence[Recording], how: Preparation | None
) -> Preparation:
    """Return a preparation with one cut-off for all logs, as `settle_cutoff` does, by prediction.

    Where one is given it stays; whether it cuts into the motion is asked of predictions.

    Parameters
    ----------
    structure : Structure
    logs : sequence of Log or LogFile
        The fitted ones.
    how : Preparation or None
    """
    first = settle_cutoff(structure.robot, logs, how)
    if not isinstance(first, SettledPreparation) or first.band is None:
        return first
    if any(log.motion_alone for log in logs):  # there is nothing to predict
        return first
    found: list[Preparation] = [first]
    given = how is not None and how.cutoff is not None
    for fastest in np.unique(first.band.joints)[-2::-1].tolist():
        other = settle_cutoff(structure.robot, logs, how, fastest)
        if RULES.differs * _least(other) <= _least(found[-1]):
            found.append(other)
    asked = [replace(x, cutoff=_least(x), outputs=_least(x)) for x in found] if given else found
    if len({(x.cutoff, x.outputs) for x in asked}) == 1:
        return first
    try:
        errors = [score.error for score in _score(structure, logs, asked)]
    except IdentifiabilityError:  # the logs are too short to be asked
        return first
    return found[int(np.argmin(errors))]


def _least(how: Preparation) -> float:
    """Return up to where torque is to be kept for what a band says is motion [Hz]."""
    assert isinstance(how, SettledPreparation)
    assert how.band is not None
    return max(
        how.band.outputs, LOG_RULES.cutoff_lowered * LOG_RULES.cutoff_wide * how.band.bandwidth
    )


def _score(
    structure: Structure, logs: Sequence[Recording], asked: Sequence[Preparation]
) -> list[Score]:
    """Return the errors of measured torque on blocked folds, fitted in each band."""
    few = enough_samples(structure.robot) // len(logs)
    parts = [log.rows(0, min(len(log), few)) for log in logs]
    wls, out = find_estimator("wls"), []
    folds: Folds | None = None
    for how in asked:
        wide = replace(how, decimate=1, keep_rest=True)  # the same torque in every band
        whole, fitted = (
            gather_information(
                structure.regression([prepare_samples(structure.robot, p, at) for p in parts])
            )
            for at in (wide, how)
        )
        fit = wls.fit(fitted)
        ratio = whole.samples / fitted.samples
        folds = folds or Folds.of(whole, float(fit.times.max()) * ratio)
        train = np.array([_inside(row, whole, fitted) for row in folds.train], float)
        each = [
            whole.squares_of_blocks(np.append(-value, 1.0)[:, None])
            for value in wls.refit(fitted, fit, train)
        ]
        squares = np.array([x[:, folds.test == f].sum(1) for f, x in enumerate(each)])
        out.append(Score.of_errors(squares, whole.torque, folds.ratio))
    return out


def _inside(train: np.ndarray, whole: Information, fitted: Information) -> np.ndarray:
    """Return which blocks of the fitted samples lie in some of those of all samples, (B,) bool."""
    out = np.zeros(len(fitted.counts), bool)
    for log in np.unique(fitted.log):
        (first, last), (start, stop) = (_spans(x, log) for x in (whole, fitted))
        outside = ~train[whole.log == log]
        near = (first < stop[:, None]) & (last > start[:, None])
        out[fitted.log == log] = ~(near & outside).any(1)
    return out


def _spans(information: Information, log: int) -> tuple[Array, Array]:
    """Return where blocks of a log start and stop, as shares of it, (B,) each."""
    counts = information.counts[information.log == log]
    stop = np.cumsum(counts) / counts.sum()
    return stop - counts / counts.sum(), stop
