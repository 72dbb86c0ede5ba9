"""What is in a log: its clock, its columns joint by joint, and how it would be prepared."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.gaps import Gaps
from identifiability.logs.logfile import LogFile
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.logs.prepare.plan import joint_log
from identifiability.logs.prepare.white_noise import noise_level, resolution
from identifiability.logs.spectrum import Spectrum
from identifiability.logs.stale import StaleRule
from identifiability.robot import Robot
from identifiability.workflows.oddities.evidence import Evidence
from identifiability.workflows.oddities.hung import find_stretches
from identifiability.workflows.oddities.saturation import flat_share
from identifiability.workflows.oddities.torque_scale import measure_factors


@frozen
class JointRecord:
    """What a log holds of a joint.

    Attributes
    ----------
    joint : str
    unit, torque_unit : str
    low, high : float [unit]
        Range of its position.
    room : float
        Share of the range that its limits allow; NaN without limits.
    speed, acceleration : float
        Largest, as the log is prepared; NaN where it cannot be prepared.
    torque_low, torque_high : float [torque_unit]
    step, torque_step : float
        Of which all values are multiples: the encoder's resolution; 0 where none is seen.
    noise, torque_noise : float
        Standard deviation of what changes from sample to sample and is no motion.
    bandwidth : float [Hz]
        Below it lie 99 % of the energy of its velocity.
    saturated : float
        Share of the samples at which the torque stays at an extreme value.
    frozen : int
        Stretches in which position or torque hang.
    scale : float
        Measured torque over that which the file's masses ask for; NaN where it does not show.
    """

    joint: str
    unit: str
    torque_unit: str
    low: float
    high: float
    room: float
    speed: float
    acceleration: float
    torque_low: float
    torque_high: float
    step: float
    torque_step: float
    noise: float
    torque_noise: float
    bandwidth: float
    saturated: float
    frozen: int
    scale: float


@frozen
class Trace:
    """What is drawn of a log: the joints' motion and torque.

    Attributes
    ----------
    t, q, tau : (N,) [s], (N, n), (N, n)
        As they are read.
    motion_t, dq : (M,) [s], (M, n)
        Velocity as it is prepared; none where the log cannot be prepared.
    """

    t: Array
    q: Array
    tau: Array
    motion_t: Array
    dq: Array


@frozen
class Record:
    """What is in a log.

    Attributes
    ----------
    name, sha256 : str
    channels : tuple of str
        What it has of every joint.
    samples : int
    start, duration : float [s]
    rate : float [Hz]
        Median of one over the sampling step.
    jitter : float
        What 95 % of the steps differ from the usual one at most, as a share of it.
    gaps, lost : int
        Steps over which samples are missing, and how many seem to be.
    longest : float [s]
        The longest step of all.
    repeated : float
        Share of the samples at which every joint repeats the one before although it moves.
    cutoff : float or None [Hz]
        Low-pass of derivatives that are computed.
    kept, outputs : int
        Samples that are left with their motion, and after decimation.
    parts : int
        Windows of the log that this was found in; 1 for all of it.
    refused : str
        Why it cannot be prepared; empty if it can.
    notes : tuple of str
        How it is prepared.
    joints : tuple of JointRecord
    trace : Trace
    """

    name: str
    sha256: str
    channels: tuple[str, ...]
    samples: int
    start: float
    duration: float
    rate: float
    jitter: float
    gaps: int
    lost: int
    longest: float
    repeated: float
    cutoff: float | None
    kept: int
    outputs: int
    parts: int
    refused: str
    notes: tuple[str, ...]
    joints: tuple[JointRecord, ...]
    trace: Trace


def describe_log(
    robot: Robot, log: Log | LogFile, evidence: Evidence | None, refused: str = ""
) -> Record:
    """Return what is in a log.

    Parameters
    ----------
    robot : Robot
    log : Log or LogFile
    evidence : Evidence or None
        Of this log alone; None where it cannot be prepared.
    refused : str
        Why.

    Raises
    ------
    LogError
        If it does not have the robot's joints.
    """
    raw = [log.rows(a, b) for a, b in signals.spread_windows(len(log))]
    windows = [joint_log(robot, window) for window in raw]
    prepared = evidence.samples[0] if evidence is not None else None
    clock = log.clock
    times = [w.t for w in windows]
    gaps = Gaps.of(log.name, clock, times)
    stale = StaleRule.of(raw).share
    return Record(
        name=log.name,
        sha256=log.sha256,
        channels=log.channels,
        samples=len(log),
        start=float(clock.first),
        duration=float(clock.last - clock.first),
        rate=1.0 / gaps.step,
        jitter=gaps.usual,
        gaps=len(gaps),
        lost=int(gaps.lost.sum()),
        longest=float(clock.longest.length),
        repeated=max(stale.values(), default=0.0),
        cutoff=prepared.cutoff if prepared is not None else None,
        kept=prepared.survey.kept if prepared is not None else 0,
        outputs=prepared.survey.outputs if prepared is not None else 0,
        parts=len(windows),
        refused=refused,
        notes=prepared.notes if prepared is not None else (),
        joints=_describe_columns(robot, windows, gaps.step, evidence),
        trace=_trace(windows, prepared),
    )


def _describe_columns(
    robot: Robot, windows: Sequence[Log], step: float, evidence: Evidence | None
) -> tuple[JointRecord, ...]:
    """Return what the columns of every actuated joint hold."""
    q, tau = (np.concatenate([getattr(w, c) for w in windows]) for c in ("q", "tau"))
    n = q.shape[1]
    numbers: dict[str, Any] = {
        "low": q.min(0),
        "high": q.max(0),
        "room": np.ptp(q, axis=0) / np.diff(robot.limits, axis=1)[:, 0],
        "torque_low": tau.min(0),
        "torque_high": tau.max(0),
        "step": resolution(q),
        "torque_step": resolution(tau),
        "noise": np.median([noise_level(w.q) for w in windows], axis=0),
        "torque_noise": np.median([noise_level(w.tau) for w in windows], axis=0),
        "bandwidth": Spectrum.of([w.q for w in windows], step).bandwidths(),
        "speed": np.full(n, np.nan),
        "acceleration": np.full(n, np.nan),
        "scale": np.full(n, np.nan),
        "saturated": [max(flat_share(x), flat_share(-x)) for x in tau.T],
    }
    numbers["room"] = np.where(np.isfinite(robot.limits).all(1), numbers["room"], np.nan)
    if evidence is not None:
        survey = evidence.samples[0].survey
        reach = np.maximum(np.abs(survey.low), np.abs(survey.high))
        numbers["speed"], numbers["acceleration"] = reach[1], reach[2]
        if evidence.weighs:
            numbers["scale"] = measure_factors(evidence)
    hung = [joint for w in windows for _, joint, *_ in find_stretches(w)]
    return tuple(
        JointRecord(
            joint=joint,
            unit="m" if robot.is_prismatic(int(robot.actuated[k])) else "rad",
            torque_unit=robot.torque_units[k],
            frozen=hung.count(joint),
            **{name: float(values[k]) for name, values in numbers.items()},
        )
        for k, joint in enumerate(robot.joints)
    )


def _trace(windows: Sequence[Log], prepared: Prepared | None) -> Trace:
    """Return what is drawn of a log."""
    t, q, tau = (np.concatenate([getattr(w, c) for w in windows]) for c in ("t", "q", "tau"))
    if prepared is None:
        return Trace(t, q, tau, np.empty(0), np.empty((0, q.shape[1])))
    motion = prepared.thin(1).motion
    return Trace(t, q, tau, motion.t, motion.actuated_v)
