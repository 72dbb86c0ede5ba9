"""Samples with instruments: a second record of their motion, along which the robot's loops close.

Where noise throws passive joints of the measured motion far off, the record stands for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.logs import Log
from identifiability.logs.prepare.closing import OPEN, complete_along, put
from identifiability.logs.prepare.plan import joint_log
from identifiability.logs.prepare.samples import Samples
from identifiability.logs.prepare.second_record import SecondRecord, find_record
from identifiability.robot import Motion, Robot

#: Passive joints of two records are far apart at a sample if they are so many times as far as
#: usual: noise makes them so where it brings a mechanism near a singular configuration.
THROWN = 30.0

#: What a note says of samples at which the record stands for the measured motion.
STANDS = "there the instruments' motion stands for it"


def add_instrument(
    robot: Robot,
    log: Log,
    samples: Samples,
    others: Sequence[Samples] = (),
    *,
    always: bool = False,
    like: SecondRecord | None = None,
) -> Samples | None:
    """Return the samples with a second record of their motion and a note; None if there is none.

    Parameters
    ----------
    robot : Robot
    log : Log
        What the samples were prepared from.
    samples : Samples
    others : sequence of Samples
        Other logs, which may have the same motion.
    always : bool
        Also where noise is negligible, and so is what it does to least squares.
    like : SecondRecord, optional
        Of another log of the same motion, found in the same way where that can be.
    """
    own = joint_log(robot, log)
    record = None if like is None else like.again(own)
    record = record or find_record(own, samples, others, always=always)
    return None if record is None else attach_record(robot, samples, record)


def attach_record(robot: Robot, samples: Samples, record: SecondRecord) -> Samples | None:
    """Return the samples with a second record of their motion; None if too few loops close."""
    motion = complete_along(robot, samples.motion, record.motion)
    if motion is None:
        return None
    notes = (*samples.notes, record.note)
    own = samples.motion
    if record.speed is not None and own.smooth_v is not None:
        other = record.speed[own.kept]
        less = other[:, 1:] < own.smooth_v[:, 1:]  # noise in proportion to speed turns no sign
        own = replace(own, smooth_v=np.where(less, other, own.smooth_v))
    # Both have one sign: what is left of an expected sign depends on neither.
    motion = replace(motion, smooth_v=own.smooth_v)
    samples = replace(samples, motion=own, record=record.kind)
    far = _thrown(robot, samples.motion, motion)
    if not len(far):
        return replace(samples, instrument=motion, notes=notes)
    text = (
        f"at {len(far)} of {len(motion)} samples noise throws the measured motion far off, as it "
        f"does near a singular configuration: {STANDS}"
    )
    mended = put(samples.motion, far, motion[far])
    return replace(samples, motion=mended, instrument=motion, notes=(*notes, text))


def _thrown(robot: Robot, measured: Motion, other: Motion) -> np.ndarray:
    """Return the few samples at which passive joints alone are far apart, (F,) int."""
    passive = np.isin(np.arange(robot.nv), robot.dependent)
    far = np.zeros((2, len(measured)), bool)
    for x, y in ((measured.v, other.v), (measured.a, other.a)):
        apart = np.abs(x - y)
        beyond = apart > THROWN * np.median(apart, axis=0)
        far |= beyond[:, ~passive].any(1), beyond[:, passive].any(1)
    far = far[1] & ~far[0]  # where actuated joints are far too, one of the records is wrong
    return np.flatnonzero(far) if far.mean() < OPEN else np.empty(0, int)
