"""Errors of the measured motion, estimated from the log, and the motion with new ones.

Differences of high order leave nothing of a smooth motion and all of white noise: their size is
that of the noise. New noise goes the way of the log: filter, differentiate, close the loops.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.errors import ClosureError
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log, fourier, signals
from identifiability.logs.prepare import Preparation, Samples
from identifiability.logs.prepare.instruments import add_instrument
from identifiability.logs.prepare.plan import Plan, joint_log
from identifiability.logs.prepare.preparation import make_plan
from identifiability.logs.prepare.second_record import SecondRecord, find_record
from identifiability.logs.prepare.white_noise import noise_size
from identifiability.logs.spectrum import HIGHEST, LOWEST_CUTOFF, WIDE, bandwidth_of_windows
from identifiability.robot import Robot, complete_motion


@frozen
class MotionErrors:
    """The motion of one log, to be measured again.

    Attributes
    ----------
    samples : Samples
        The true motion: the second record where there is one, else as prepared, and smoothed where
        noise was drawn anew, or velocities and accelerations were measured.
    log : Log
        The same, as a log at the joints.
    plan : Plan
    sd : (3, N, n)
        Of the noise on measured positions, velocities and accelerations of the actuated joints;
        zero for what is not measured [rad or m, and per s, per s²].
    record : SecondRecord or None
        How a second record of the motion is made, for instrumental variables.
    exact : bool
        Whether the true motion is a second record, without the errors of the log.
    instrumented : bool
        Whether it has a second record, which may be that of another log.
    """

    samples: Samples
    log: Log
    plan: Plan
    sd: Array
    record: SecondRecord | None
    exact: bool
    instrumented: bool

    @staticmethod
    def of(robot: Robot, samples: Samples, raw: Log, how: Preparation) -> MotionErrors:
        """Return the errors of a log that was prepared."""
        if samples.cutoff is not None:
            how = replace(how, cutoff=samples.cutoff)
        plan = make_plan(robot, raw, how)
        log = joint_log(robot, plan.mend(raw))
        none = np.zeros(log.q.shape)
        sd = [none if x is None else noise_size(x) for x in _channels(log)]
        instrumented = samples.beside is not None
        found = samples if instrumented else add_instrument(robot, log, samples, always=True)
        beside = None if found is None else found.beside
        smooth = replace(samples, motion=samples.echoes[0].motion) if samples.echoes else None
        near = beside or smooth or _smoothed(robot, samples, log, plan)
        exactly = replace(near.motion, smooth_v=None)  # its signs are those of its speeds
        true = replace(near, motion=exactly, instrument=None, echoes=())
        exact = beside is not None
        record = find_record(log, samples, always=True) if instrumented else None
        at = _as_log(log, true)
        return MotionErrors(true, at, plan, np.stack(sd), record, exact, instrumented)

    def scaled(self, factor: float) -> MotionErrors:
        """Return the same with errors of another size."""
        return replace(self, sd=factor * self.sd)

    def measure(self, robot: Robot, rng: np.random.Generator) -> tuple[Log, Samples]:
        """Return the log with new errors and its samples, at the same times."""
        e = self.sd * rng.standard_normal(self.sd.shape)
        pairs = zip(_channels(self.log), e, strict=True)
        log = _with(self.log, [x if x is None else x + y for x, y in pairs])
        samples = _moved(robot, self.samples, self._prepared(e))
        smooth, motion = self.plan.smooth_speed(log), samples.motion
        if smooth is not None:
            samples = replace(samples, motion=replace(motion, smooth_v=smooth[motion.kept]))
        return log, samples

    def _prepared(self, e: Array) -> list[Array]:
        """Return errors (3, N, n) of position, velocity and acceleration after the preparation."""
        log, plan = self.log, self.plan
        noise = _with(log, [x if x is None else y for x, y in zip(_channels(log), e, strict=True)])
        if plan.series is not None:
            series = plan.series
            t = log.t - plan.start
            fit = fourier.fit_fourier(t, noise.q, series.period, series.harmonics)
            plan = replace(plan, series=fit)
        return [x[self.samples.motion.kept].copy() for x in plan.derive(noise)]


def measure_anew(
    robot: Robot, motion: Sequence[MotionErrors], rng: np.random.Generator
) -> list[Samples]:
    """Return the samples of all logs with new errors, and instruments as the logs have them."""
    found = [m.measure(robot, rng) for m in motion]
    out = []
    for m, (log, own) in zip(motion, found, strict=True):
        others = [s for _, s in found if s is not own]
        has = None
        if m.instrumented:
            has = add_instrument(robot, log, own, others, always=True, like=m.record)
        out.append(has or own)
    return out


def _channels(log: Log) -> tuple[Array, Array | None, Array | None]:
    return log.q, log.dq, log.ddq


def _as_log(log: Log, samples: Samples) -> Log:
    """Return a log with the motion of samples, where it has such channels and they have rows."""
    motion = samples.motion
    out: list[Array | None] = []
    near = (motion.actuated_q, motion.actuated_v, motion.actuated_a)
    for x, true in zip(_channels(log), near, strict=True):
        if x is not None:
            x = x.copy()  # noqa: PLW2901 - logs are read-only
            x[motion.kept] = true
        out.append(x)
    return _with(log, out)


def _with(log: Log, channels: Sequence[Array | None]) -> Log:
    q, dq, ddq = channels
    assert q is not None
    return replace(log, q=q, dq=dq, ddq=ddq)


def _smoothed(robot: Robot, samples: Samples, log: Log, plan: Plan) -> Samples:
    """Return samples without the errors of velocities and accelerations that were measured."""
    if plan.cutoff is not None or plan.series is not None or signals.has_gap(log.t).any():
        return samples
    dt = signals.sampling_step(log.t)
    cutoff = max(WIDE * bandwidth_of_windows([log.q], dt), LOWEST_CUTOFF)
    cutoff = min(cutoff, HIGHEST / dt)
    given = plan.derive(log)
    errors = [(signals.lowpass(x, dt, cutoff) - x)[samples.motion.kept] for x in given]
    return _moved(robot, samples, errors)


def _moved(robot: Robot, samples: Samples, errors: list[Array]) -> Samples:
    """Return samples with something added to position, velocity and acceleration, each (N, n)."""
    motion = samples.motion
    near = [motion.actuated_q, motion.actuated_v, motion.actuated_a]
    for _ in range(2):
        q, dq, ddq = (x + e for x, e in zip(near, errors, strict=True))
        try:
            found = complete_motion(robot, motion.t, q, dq, ddq)
        except ClosureError:
            break
        if len(found) == len(motion):
            rows = {k: getattr(motion, k) for k in ("kept", "dropped", "near_singular")}
            return replace(samples, motion=replace(found, **rows))
        for e in errors:
            e[found.dropped] = 0.0  # their loops do not close with the error
    return samples
