"""Instruments of the logs that have a second record of their motion, and the estimator for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from identifiability.estimation.estimate import Kind, Method, find_estimator
from identifiability.estimation.estimator import Estimator
from identifiability.foundation.errors import LogError
from identifiability.logs import Log
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.instruments import add_instrument
from identifiability.logs.repeats import Recording
from identifiability.robot import Robot
from identifiability.workflows.opening import Opening


def add_instruments(
    opening: Opening, logs: Sequence[Recording], method: Method, kind: Kind
) -> tuple[Opening, Estimator]:
    """Return the estimator of a method and a kind, and fitted samples with what it takes.

    Without a second record of any motion, or where a log is too long for memory, all are fitted by
    least squares.

    Parameters
    ----------
    opening : Opening
    logs : sequence of Log or LogFile
        What its fitted samples were prepared from.
    method : str or Estimator
    kind : {"auto", "ls", "iv"}

    Raises
    ------
    LogError
        If instruments are asked for and a log has no second record of its motion.
    """
    plain, robot = find_estimator(method), opening.robot
    if kind == "ls" or opening.silence:
        return opening, plain
    parts = [
        (log, samples)
        for log, samples in zip(logs, opening.samples, strict=True)
        if isinstance(log, Log) and isinstance(samples, Samples)
    ]
    found = _find_instruments(robot, parts, always=kind == "iv")
    if kind == "iv" and (len(parts) < len(logs) or None in found):
        without = [log for log, s in zip(logs, found, strict=False) if s is None]
        raise LogError(
            f"{(without or logs)[0].name} has no second record of its motion in memory, which "
            "instrumental variables need: repeat the motion, or log '<joint>.dq' and '<joint>.ddq' "
            "as measured or the command in '<joint>.q_ref'; else leave out the estimator."
        )
    if len(parts) < len(logs) or not any(found):
        return opening, plain
    samples = [s or _own_motion(x) for s, (_, x) in zip(found, parts, strict=True)]
    return replace(opening, samples=tuple(samples)), replace(plain, instruments=True)


def _find_instruments(
    robot: Robot, parts: Sequence[tuple[Log, Samples]], *, always: bool
) -> list[Samples | None]:
    samples = [s for _, s in parts]
    return [
        add_instrument(robot, log, s, [x for x in samples if x is not s], always=always)
        for log, s in parts
    ]


def _own_motion(samples: Samples) -> Samples:
    """Return a log that is its own instrument, as least squares has it."""
    note = "it has no second record of its motion, and is fitted as by least squares"
    return replace(samples, instrument=samples.motion, notes=(*samples.notes, note))
