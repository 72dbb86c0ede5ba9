"""Which record of the motion is fitted with: as it was measured, or a series through it.

Noise in the motion biases least squares [Fuller 1987]. A series through the measured motion has
less noise (`identifiability.logs.series`), but a wrong one would lack part of the motion. So
planted truth decides, on the user's motion with its measured noise: a robot that is known moves
along the series, noise like the one that was measured is added, and each record is fitted with. The
series is used if it finds the planted values better, and if the measured torque agrees.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from identifiability.foundation.errors import ClosureError
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import Array
from identifiability.foundation.options import Derivatives
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.prepare.dataset import Dataset
from identifiability.logs.prepare.preparation import Plan, Preparation, joint_log, make_plan
from identifiability.logs.rules import RULES
from identifiability.logs.series import (
    Kind,
    MotionSeries,
    SplineFit,
    add_fourier,
    find_spline,
    plant,
    refit,
    with_series,
)
from identifiability.regression.information import Information
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, complete_motion
from identifiability.robot.closure import known_torque

from .estimator import Estimate, Estimator

#: Rows of all logs together along which columns are computed.
ROWS = 600

#: A series is used if the error of the planted torque falls below this share of that as measured.
BETTER: Tolerance = 0.9


@frozen
class MotionTrial:
    """Errors of planted values under one record of the motion.

    Attributes
    ----------
    error : float
        Of the planted torque along the true motion, over its root mean square.
    torque : float
        What the record leaves of the measured torque, over its root mean square.
    """

    error: float
    torque: float


@frozen
class MotionChoice:
    """The record of the motion that is fitted with, and why.

    Attributes
    ----------
    record : {"auto", "fourier", "spline"}
        As `Preparation.derivatives`: ``auto`` is the motion as it was measured.
    trials : tuple of MotionTrial
        As measured first; empty where nothing was to be decided.
    logs : tuple of Log
        The fitted logs with the series as their motion; empty where none is used.
    """

    record: Derivatives = "auto"
    trials: tuple[MotionTrial, ...] = ()
    logs: tuple[Log, ...] = ()

    def tell(self, other: Derivatives) -> Finding:
        """Return why a series is used, and the setting that keeps the measured motion."""
        measured, series = self.trials
        errors = {"series": series.error, "measured": measured.error}
        what = phrase("motion", self.record)
        return Finding("motion", what=what, other=other, **errors)


def read_records(
    robot: Robot, logs: Sequence[Log], how: Preparation, asked: Preparation | None
) -> tuple[Record, ...]:
    """Return the motion of logs and the splines through it; nothing if there is no choice.

    Parameters
    ----------
    robot : Robot
    logs : sequence of Log
        The fitted ones.
    how : Preparation
        As the logs are prepared by default.
    asked : Preparation or None
        What the user asked for: a user who asked for derivatives or a band has chosen.
    """
    chosen = asked is not None and (asked.derivatives != "auto" or asked.cutoff or asked.outputs)
    unfit = any(x.long or x.rollout is not None or x.motion_alone for x in logs)
    if chosen or unfit or robot.base is not None:
        return ()
    return tuple(Record.of(robot, log, how) for log in logs)


def choose_motion(structure: Structure, records: Sequence[Record]) -> MotionChoice:
    """Return the record of the motion that finds planted values best.

    Parameters
    ----------
    structure : Structure
    records : sequence of Record
        Of the fitted logs; as measured where there are none.
    """
    if any(r.spline is None for r in records) or all(r.is_quiet() for r in records):
        return MotionChoice()
    kind = preferred_kind(records)
    # Computed derivatives are low-passed with torque and columns, which takes most of their noise.
    # A series would then lose sharper motion without a gain, unless it averages periods.
    derived = any(r.log.ddq is None for r in records)
    if derived and not (kind == "fourier" and all(r.repeats for r in records)):
        return MotionChoice()
    try:
        trials = try_records(structure, records, kind)
    except ClosureError:
        return MotionChoice()
    measured, series = trials
    better = series.error < BETTER * measured.error
    agrees = series.torque <= measured.torque
    if not (better and agrees):
        return MotionChoice("auto", trials)
    return MotionChoice(kind, trials, tuple(with_series(r.log, r.series[kind]) for r in records))


def preferred_kind(records: Sequence[Record]) -> Kind:
    """Return the kind of series that all logs together prefer by Akaike's criterion."""
    if not all("fourier" in r.series for r in records):
        return "spline"
    scores = {k: sum(r.series[k].score for r in records) for k in ("fourier", "spline")}
    if scores["fourier"] < scores["spline"]:
        return "fourier"
    return "spline"


@frozen
class Record:
    """The motion of one log as it is prepared by default, and the series through it.

    Attributes
    ----------
    robot : Robot
    log : Log
        On the joint side.
    plan : Plan
        How its motion is derived by default.
    spline : SplineFit or None
        None for a log of too few rows.
    """

    robot: Robot
    log: Log
    plan: Plan
    spline: SplineFit | None

    @staticmethod
    def of(robot: Robot, log: Log, how: Preparation) -> Record:
        """Return the record of a log in memory."""
        plan = make_plan(robot, log, how)
        joints = joint_log(robot, plan.mend(log))
        return Record(robot, joints, plan, find_spline(joints))

    @cached_property
    def series(self) -> dict[Kind, MotionSeries]:
        """The best series of each kind."""
        if self.spline is None:
            return {}
        return add_fourier(self.log, self.spline)

    @property
    def repeats(self) -> bool:
        """Whether the log repeats the period of its Fourier series at least twice."""
        period = self.series["fourier"].period
        assert period is not None
        length = self.log.t[-1] - self.log.t[0]
        return bool(2 * period <= length + 2 * self.plan.step)

    def is_quiet(self) -> bool:
        """Return whether the default preparation leaves next to no noise in any channel."""
        assert self.spline is not None
        spline = self.spline.best
        moving = ~signals.never_moves(spline.q.min(0), spline.q.max(0))
        derived = self.plan.derive(self.log)
        shares = [
            np.std(x - own, axis=0)[moving] / own.std(0)[moving]
            for x, own in zip(derived, spline.motion, strict=True)
        ]
        return all(bool(np.all(share <= RULES.small)) for share in shares)

    def samples(self, motion: Sequence[Array], step: int, speeds: Array | None) -> Dataset:
        """Return every n-th row along a motion, closed; standing joints are no data.

        Parameters
        ----------
        motion : sequence of (N, n)
            Position, velocity and acceleration of the actuated joints.
        step : int
        speeds : (N, 2, n) or None
            Smoothed speeds for signs, with their standard deviation; None for the motion's own.
        """
        at = slice(None, None, step)
        q, dq, ddq = (x[at] for x in motion)
        found = complete_motion(self.robot, self.log.t[at], q, dq, ddq)
        found = replace(found, first=self.log.clock.first, drives_alone=self.log.drives_alone)
        if speeds is not None:
            found = replace(found, smooth_v=speeds[at][found.kept])
        tau = self.log.tau[at][found.kept] - known_torque(self.robot, found)
        creep = RULES.creep * np.abs(dq).max(0)
        weight = (np.abs(dq) > creep)[found.kept].astype(float)
        return Dataset(self.log.name, found, tau, None, (), "", weight=weight)

    def measured(self, log: Log, step: int) -> Dataset:
        """Return every n-th row of a log with this motion, as prepared by default."""
        return self.samples(self.plan.derive(log), step, self.plan.smooth_speed(log))


def try_records(
    structure: Structure, records: Sequence[Record], kind: Kind
) -> tuple[MotionTrial, MotionTrial]:
    """Return the errors of planted values by the motion as measured, and by its Fourier series.

    Raises
    ------
    ClosureError
        If loops close nowhere along a record.
    """
    rows = sum(len(r.log) for r in records)
    step = -(-rows // ROWS)
    measured = [r.measured(r.log, step) for r in records]
    true = [r.samples(r.series[kind].motion, step, None) for r in records]
    own = [_fit(structure, samples) for samples in (measured, true)]
    planted = plant_torque(structure, true, own[1].value)
    truth = gather_rows(structure, planted)
    torque = np.asarray(sum((s.weight * s.tau**2).sum(0) for s in measured))
    trials = list[MotionTrial]()
    for samples, fit in zip(_measure_again(records, kind, step), own, strict=True):
        found = _fit(structure, _with_torque(samples, planted))
        error = _share(truth.squares(np.append(-found.value, 1.0)), truth.torque)
        trials.append(MotionTrial(error, _share(fit.rss, torque)))
    return trials[0], trials[1]


def _measure_again(
    records: Sequence[Record], kind: Kind, step: int
) -> tuple[list[Dataset], list[Dataset]]:
    """Return rows along a series that was measured with new noise: as measured, and smoothed.

    The torque is planted without noise: all that is off then comes from noise of the motion.
    """
    rng = np.random.default_rng(0)
    measured = list[Dataset]()
    smoothed = list[Dataset]()
    for record in records:
        log = plant(record.log, record.series[kind], rng)
        series = refit(record.series[kind], log)
        measured.append(record.measured(log, step))
        smoothed.append(record.samples(series.motion, step, None))
    return measured, smoothed


def plant_torque(structure: Structure, samples: Sequence[Dataset], values: Array) -> list[Dataset]:
    """Return samples with the torque of values of the base parameters along their motion."""
    phi = np.linalg.lstsq(structure.G, values, rcond=None)[0]
    return [replace(s, tau=structure.torque_along(s.motion, phi)) for s in samples]


def _with_torque(samples: Sequence[Dataset], planted: Sequence[Dataset]) -> list[Dataset]:
    """Return samples with planted torque, at the rows that both have."""
    found = []
    for own, other in zip(samples, planted, strict=True):
        _, here, there = np.intersect1d(own.motion.kept, other.motion.kept, return_indices=True)
        found.append(replace(own.take(here), tau=other.tau[there]))
    return found


def _fit(structure: Structure, samples: Sequence[Dataset]) -> Estimate:
    return Estimator().fit(gather_rows(structure, samples))


def gather_rows(structure: Structure, samples: Sequence[Dataset], size: int = ROWS) -> Information:
    """Return the information of few rows, which are held in memory, in blocks of a size."""
    regression = structure.regression(samples)
    chunks = [*regression.chunks()]
    log = np.concatenate([np.full(len(c.t), c.log) for c in chunks])
    moves = np.concatenate([s.weight > 0 for s in samples])
    names = [p.name for p in regression.parameters]
    W = np.concatenate([c.W for c in chunks])
    tau = np.concatenate([c.tau for c in chunks])
    return Information.of_rows(names, W, tau, log, size, moves=moves)


def _share(squares: Array, torque: Array) -> float:
    """Return the root mean over actuators of relative squares of their torque."""
    moved = torque > 0
    if moved.any():
        return float(np.sqrt(np.mean(squares[moved] / torque[moved])))
    return 0.0
