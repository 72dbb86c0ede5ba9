"""Choice of the cut-off that best predicts unseen torque, as far as motion spectra allow.

The spectra state the widest cut-off (`identifiability.logs.spectrum`). They cannot tell noise from
motion where a joint shakes, nor how much noise of each joint matters. The torque can. So narrower
cut-offs are tried as well: each is fitted to most of a log, and predicts the torque of the rest as
it was measured. All cut-offs are judged at the same rows, in one band: that of the raw torque. A
joint counts by its share of torque. Held-out logs are not used.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.errors import ClosureError, LogError
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import percent
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare.dataset import Dataset
from identifiability.logs.prepare.preparation import (
    CommonPreparation,
    Plan,
    Preparation,
    choose_cutoff,
    is_filtered,
    joint_log,
    make_plan,
)
from identifiability.logs.rules import RULES
from identifiability.logs.spectrum import BandAdvice, Spectrum, bandwidth_of_windows
from identifiability.regression.information import Information
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, complete_motion
from identifiability.robot.closure import known_torque

from .estimator import Estimator
from .evidence import LEVELS, Folds, HeldOut
from .motion import ROWS, gather_rows

#: A cut-off over the next one on the grid.
STEP: Tolerance = 1.5

#: Blocks of time of all logs together, of which folds consist.
BLOCKS = 40

#: The search ends where so many narrower cut-offs on end do not replace a wider one.
FURTHER = 3


@frozen
class CutoffTrial:
    """Prediction of the measured torque of folds, under one cut-off.

    Attributes
    ----------
    cutoff : float [Hz]
        Of the motion.
    band : float [Hz]
        Up to where torque and columns would be kept.
    error : float
        Root mean square over each joint's own scale. Joints count by the share that their scale has
        of the sum of all.
    clean : float
        The square of the error that a motion without noise would have. Noise of the motion moves a
        prediction, but a narrower band only hides that; it makes no value better.
    """

    cutoff: float
    band: float
    error: float
    clean: float

    @property
    def most(self) -> float:
        """Squared error up to which another cut-off is as good as this one."""
        return self.clean + ((1.0 + LEVELS.rise) ** 2 - 1.0) * self.error**2


@frozen
class Window:
    """Rows of a log at which cut-offs are tried.

    Attributes
    ----------
    robot : Robot
    log : Log
        On the joint side; of a long log one of its windows.
    origin : int
        Row of its first sample in its log.
    plan : Plan
        How its motion is derived.
    at : slice
        Rows that are used.
    data : (m, n) bool
        Whether torque of these rows is data, whichever cut-off is tried.
    noisier : Log
        The log with as much white noise on its motion once more.
    """

    robot: Robot
    log: Log
    origin: int
    plan: Plan
    at: slice
    data: np.ndarray
    noisier: Log

    @staticmethod
    def of(robot: Robot, log: Log, origin: int, plan: Plan, step: int) -> Window:
        """Return every n-th row of a log."""
        joints = joint_log(robot, plan.mend(log, origin))
        at = slice(None, None, step)
        dq = plan.derive(joints, origin)[1]
        data = np.ones(dq.shape, bool) if plan.dwells is None else ~plan.dwells.find(dq)
        if joints.unmeasured is not None:
            data &= ~joints.unmeasured
        noisier = add_white_noise(joints, plan.step)
        return Window(robot, joints, origin, plan, at, data[at], noisier)

    @property
    def again(self) -> Window:
        """The rows of the log with the noise of its motion once more."""
        return replace(self, log=self.noisier)

    def derive(self, cutoff: float, band: float) -> Array:
        """Return position, velocity and acceleration of the rows below a cut-off, (3, m, n).

        Torque and columns are kept up to a band [Hz]. Acceleration is kept up to the same band,
        because it makes most of the noise of columns: frequencies above the band change neither
        fits nor predictions.
        """
        plan = replace(self.plan, cutoff=cutoff)
        q, dq, ddq = plan.derive(self.log, self.origin)
        if band < cutoff:
            ddq = replace(plan, cutoff=band).derive(self.log, self.origin)[2]
        return np.stack([q, dq, ddq])[:, self.at]


def add_white_noise(log: Log, dt: float) -> Log:
    """Return a log with as much white noise once more on positions and velocities.

    White noise has the density of the highest tenth of the frequencies: a joint may shake below.
    """
    rng = np.random.default_rng(0)

    def more(x: Array) -> Array:
        density = Spectrum.of([x], dt).power
        first = int(RULES.nearly_all * len(density))
        highest = density[first:].mean(0)
        return x + np.sqrt(highest * 0.5 / dt) * rng.standard_normal(x.shape)

    dq = None if log.dq is None else more(log.dq)
    return replace(log, q=more(log.q), dq=dq)


def make_samples(windows: Sequence[Window], cutoff: float, band: float) -> list[Dataset]:
    """Return the rows of windows along their motion; parameters as of `try_cutoff`.

    Loops of all windows are closed together, which takes a third of the time.
    """
    robot = windows[0].robot
    q, dq, ddq = np.concatenate([x.derive(cutoff, band) for x in windows], axis=1)
    t = np.concatenate([x.log.t[x.at] for x in windows])
    closed = complete_motion(robot, t, q, dq, ddq)
    samples = list[Dataset]()
    first = 0
    for window in windows:
        last = first + len(window.data)
        motion = closed[(closed.kept >= first) & (closed.kept < last)]
        motion = replace(motion, drives_alone=window.log.drives_alone)
        rows = motion.kept - first
        tau = window.log.tau[window.at][rows] - known_torque(robot, motion)
        weight = window.data[rows].astype(float)
        samples.append(Dataset(window.log.name, motion, tau, None, (), "", weight=weight))
        first = last
    return samples


def tune_cutoff(
    structure: Structure, logs: Sequence[Log], how: Preparation, asked: Preparation | None
) -> Preparation:
    """Return a preparation with the cut-off that predicts unseen torque of the fitted logs best.

    A cut-off that was set by hand stays; the result then advises if another one is better.

    Parameters
    ----------
    structure : Structure
        The robot under the default model.
    logs : sequence of Log
        The fitted ones.
    how : Preparation
        With a cut-off that spectra of the motion allow, or the one that was set.
    asked : Preparation or None
        What the user asked for.
    """
    robot = structure.robot
    by_hand = asked is not None and bool(asked.cutoff or asked.outputs)
    free: Preparation = how
    if asked is not None and by_hand:
        free = choose_cutoff(robot, logs, replace(asked, cutoff=None, outputs=None))
    if not isinstance(how, CommonPreparation) or not isinstance(free, CommonPreparation):
        return how
    try:
        windows = make_windows(robot, [log for log in logs if is_filtered(log, how)], how)
        trials = try_cutoffs(structure, windows, free)
        chosen = choose_trial(trials)
        if by_hand:
            return advise(structure, windows, how, chosen)
    except (ClosureError, LogError):  # a log is refused later, or has too few rows for a choice
        return how
    if chosen is trials[0]:
        return how
    return narrow(robot, logs, how, trials, chosen)


def has_choice(robot: Robot, logs: Sequence[Log], how: Preparation) -> bool:
    """Return whether motion is low-passed, and measured torque exists to choose its cut-off."""
    low_passed = isinstance(how, CommonPreparation) and how.band is not None
    measured = all(log.torque and not log.motion_alone for log in logs)
    return low_passed and measured and robot.base is None


def narrow(
    robot: Robot,
    logs: Sequence[Log],
    how: CommonPreparation,
    trials: Sequence[CutoffTrial],
    chosen: CutoffTrial,
) -> Preparation:
    """Return a preparation with a narrower cut-off, and why it has that."""
    narrower = replace(how, cutoff=chosen.cutoff, outputs=chosen.band)
    tuned = choose_cutoff(robot, logs, narrower)
    assert isinstance(tuned, CommonPreparation)
    assert tuned.band is not None
    reason = (
        f"of {trials[-1].cutoff:.2g} to {trials[0].cutoff:.3g} Hz the widest that predicts torque "
        f"of unseen blocks well, with an error of {percent(chosen.error, 2)} instead of "
        f"{percent(trials[0].error, 2)}"
    )
    band = replace(tuned.band, reason=reason)
    return replace(tuned, band=band)


def advise(
    structure: Structure, windows: Sequence[Window], how: CommonPreparation, chosen: CutoffTrial
) -> Preparation:
    """Return a preparation whose cut-off was set by hand, with a cut-off that is better."""
    assert how.band is not None
    assert how.cutoff is not None
    cutoff = max(how.cutoff, how.outputs or 0.0)
    given = try_cutoff(structure, windows, cutoff, how.outputs or cutoff)
    advice = BandAdvice(chosen.cutoff, chosen.band, chosen.error, given.error)
    band = replace(how.band, advice=advice)
    return replace(how, band=band)


def choose_trial(trials: Sequence[CutoffTrial]) -> CutoffTrial:
    """Return the widest cut-off whose error is not clearly above the least.

    Rows that give no error choose nothing: the widest stays.

    Parameters
    ----------
    trials : sequence of CutoffTrial
        The widest first.
    """
    best = min(trials, key=lambda trial: trial.clean)
    return next((trial for trial in trials if trial.clean <= best.most), trials[0])


def make_windows(robot: Robot, logs: Sequence[Log], how: Preparation) -> list[Window]:
    """Return the rows of logs at which cut-offs are tried, some hundreds of all logs together.

    Raises
    ------
    LogError
        If a log cannot be prepared in this way.
    """
    parts = [(make_plan(robot, log, how), *window) for log in logs for window in log.windows()]
    rows = sum(len(log) for _, _, log in parts)
    step = -(-rows // ROWS)
    return [Window.of(robot, log, origin, plan, step) for plan, origin, log in parts]


def try_cutoffs(
    structure: Structure, windows: Sequence[Window], how: CommonPreparation
) -> list[CutoffTrial]:
    """Return the trials of cut-offs, from the widest downwards until none is better.

    Raises
    ------
    ClosureError
        If loops close nowhere along a motion.
    LogError
        If there are too few rows for folds.
    """
    assert how.outputs is not None
    trials = list[CutoffTrial]()
    for cutoff in list_cutoffs(windows, how):
        trials.append(try_cutoff(structure, windows, cutoff, min(how.outputs, cutoff)))
        if len(trials) - trials.index(choose_trial(trials)) > FURTHER:
            break
    return trials


def list_cutoffs(windows: Sequence[Window], how: CommonPreparation) -> Iterator[float]:
    """Yield cut-offs [Hz] from the widest one down to the band of the slowest joint."""
    assert how.cutoff is not None
    joints = range(windows[0].data.shape[1])
    bands = []
    for j in joints:
        own = [bandwidth_of_windows([x.log.q[:, [j]]], x.plan.step) for x in windows]
        bands.append(max(own))
    lowest = min((band for band in bands if band > 0), default=how.cutoff)
    cutoff = how.cutoff
    yield cutoff
    while (cutoff := cutoff / STEP) >= lowest:
        yield cutoff


def try_cutoff(
    structure: Structure, windows: Sequence[Window], cutoff: float, band: float
) -> CutoffTrial:
    """Return the trial of a cut-off [Hz]: its prediction of the measured torque of each fold.

    Parameters
    ----------
    structure : Structure
    windows : sequence of Window
    cutoff : float [Hz]
        Of the motion.
    band : float [Hz]
        Up to where torque and columns would be kept.
    """
    information = gather_trial(structure, windows, cutoff, band)
    fit = Estimator().fit(information)
    held = HeldOut.of(information, fit.noise, Folds.of(information))
    values = held.refit(fit)
    score = held.score(values)
    scale = np.sqrt(score.variation)
    acts = score.variation > np.finfo(float).tiny  # below that it is rounding
    shares = np.where(acts, 1.0, 0.0) / np.where(acts, scale * scale.sum(), 1.0)
    error = float(score.squares.sum(0) @ shares)
    # As much noise once more adds as much error as the noise of the motion has added.
    noisier = gather_trial(structure, [x.again for x in windows], cutoff, band)
    clean = error
    if np.array_equal(noisier.counts, information.counts):
        again = HeldOut.of(noisier, fit.noise, held.folds).score(values)
        clean -= float(again.squares.sum(0) @ shares) - error
    return CutoffTrial(cutoff, band, float(np.sqrt(error)), clean)


def gather_trial(
    structure: Structure, windows: Sequence[Window], cutoff: float, band: float
) -> Information:
    """Return the information of windows, in blocks of which folds are made."""
    samples = make_samples(windows, cutoff, band)
    size = max(1, sum(len(s.tau) for s in samples) // BLOCKS)
    return gather_rows(structure, samples, size)
