"""Instruments of the logs that have a second record of their motion, and the estimator for them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from identifiability.estimation.estimate import Kind, Method, choose_estimator
from identifiability.estimation.estimator import Estimator
from identifiability.estimation.instrumental import InstrumentalVariables, RenoisedLeastSquares
from identifiability.estimation.least_squares import OrdinaryLeastSquares
from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.numbers import percent
from identifiability.logs import Log, signals
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.echo import add_echoes, noise_share
from identifiability.logs.prepare.instruments import add_instrument
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.logs.prepare.samples import Record
from identifiability.logs.repeats import Recording
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.robot import Robot
from identifiability.workflows.opening import Opening

#: Second records, each less to be trusted than the one before.
RECORDS: tuple[Record, ...] = ("measured", "command", "smoothed")

#: What gives instruments to a log that is too long for memory.
SHORTER = "it is too long for memory, in which instruments are made: give a part of it"

#: What gives a log a second record of its motion.
REMEDY = (
    "repeat the motion, or log '<joint>.dq' and '<joint>.ddq' as measured or the command in "
    "'<joint>.q_ref'"
)


def add_instruments(
    opening: Opening, logs: Sequence[Recording], method: Method, kind: Kind
) -> tuple[Opening, Estimator]:
    """Return the estimator of a method and a kind, and fitted samples with what it takes.

    Without a second record of any motion, what noise does to computed derivatives is tried instead
    (`RenoisedLeastSquares`), where it does anything.

    Parameters
    ----------
    opening : Opening
    logs : sequence of Log or LogFile
        What its fitted samples were prepared from.
    method : str or Estimator
    kind : {"auto", "ls", "iv"}

    Raises
    ------
    OptionError
        If method and kind do not go together.
    LogError
        If instruments are asked for and a log has no second record of its motion.
    """
    plain = choose_estimator(method, kind, instruments=False)
    if kind == "ls" or opening.silence or choose_estimator(method, kind, instruments=True) is plain:
        return opening, plain
    records: list[Samples | None] = []
    for log, samples in zip(logs, opening.samples, strict=True):
        record, others = None, [s for s in opening.samples if isinstance(s, Samples)]
        others = [s for s in others if s is not samples]
        if isinstance(log, Log) and isinstance(samples, Samples):
            record = add_instrument(opening.robot, log, samples, others, always=kind == "iv")
        if record is None and kind == "iv":
            raise LogError(
                f"{log.name} has no second record of its motion, which instrumental variables "
                f"need: {_find_remedy([samples])}; else leave out the estimator."
            )
        records.append(record)
    missing = [s for s, r in zip(opening.samples, records, strict=True) if r is None]
    if len(missing) == len(records):
        return _try_noise(opening, logs, plain)
    found = [r or _own_motion(s) for s, r in zip(opening.samples, records, strict=True)]
    whole = [s for s in found if s is not None]
    hints = (*opening.hints, *_tell_apart(missing, alike=len(whole) < len(found)))
    if len(whole) < len(found):
        return replace(opening, hints=hints), plain
    estimator = choose_estimator(method, kind, instruments=True)
    if isinstance(estimator, InstrumentalVariables):
        estimator = replace(estimator, record=max((s.record for s in whole), key=RECORDS.index))
    return replace(opening, samples=tuple(whole), hints=hints), estimator


def follow(
    estimator: Estimator, robot: Robot, parts: Sequence[tuple[Log, Samples]]
) -> list[Samples]:
    """Return logs that were prepared anew with what an estimator takes, as it took it before.

    Parameters
    ----------
    estimator : Estimator
    robot : Robot
    parts : sequence of (Log, Samples)
        Logs, and what was prepared of them.
    """
    samples = [s for _, s in parts]
    if isinstance(estimator, InstrumentalVariables):
        return [
            add_instrument(robot, log, s, [o for o in samples if o is not s], always=True)
            or replace(s, instrument=s.motion)
            for log, s in parts
        ]
    if isinstance(estimator, RenoisedLeastSquares):
        found = [add_echoes(robot, log, s) for log, s in parts]
        return [e or s for e, s in zip(found, samples, strict=True)]
    return samples


def _try_noise(
    opening: Opening, logs: Sequence[Recording], plain: Estimator
) -> tuple[Opening, Estimator]:
    """Return samples with echoes and the estimator for them; a hint where noise stays as it is."""
    robot = opening.robot
    pairs = list(zip(logs, opening.samples, strict=True))
    shares = [_noise_share(robot, log, samples) for log, samples in pairs]
    if max(shares) < LOG_RULES.echo_nothing:
        return opening, plain
    tried = [
        add_echoes(robot, log, samples)
        if isinstance(log, Log) and isinstance(samples, Samples)
        else None
        for log, samples in pairs
    ]
    if isinstance(plain, OrdinaryLeastSquares) and None not in tried:
        whole = tuple(s for s in tried if s is not None)
        return replace(opening, samples=whole), RenoisedLeastSquares(plain)
    loud = [
        s.name
        for (_, s), share in zip(pairs, shares, strict=True)
        if share > LOG_RULES.noise_share**0.5
    ]
    if not loud:
        return opening, plain
    hint = (
        f"{listing(loud, 4)}: noise of the measured motion has up to {percent(max(shares), 2)} of "
        "an acceleration (rms) and is not accounted for: least squares pulls values towards zero "
        f"by it, and intervals do not hold that; {_find_remedy(s for _, s in pairs)}."
    )
    return replace(opening, hints=(*opening.hints, hint)), plain


def _noise_share(robot: Robot, log: Recording, samples: Prepared) -> float:
    """Return the share that noise has of an acceleration (rms), on a window of a long log."""
    part = log if isinstance(log, Log) else log.rows(*signals.spread_windows(len(log))[0])
    return noise_share(robot, part, samples.band)


def _own_motion(samples: Prepared) -> Samples | None:
    """Return a log that is its own instrument, as least squares has it; None if it is too long."""
    if not isinstance(samples, Samples):
        return None
    return replace(samples, instrument=samples.motion, record="smoothed")


def _find_remedy(missing: Iterable[Prepared]) -> str:
    """Return what gives logs without a second record of their motion one."""
    return REMEDY if all(isinstance(s, Samples) for s in missing) else SHORTER


def _tell_apart(missing: Sequence[Prepared], *, alike: bool) -> list[str]:
    if not missing:
        return []
    what = "all logs were fitted by least squares" if alike else "it was fitted by least squares"
    return [
        f"{listing([s.name for s in missing], 4)}: no second record of the motion in memory, so "
        f"{what}, which noise in the motion biases; {_find_remedy(missing)}."
    ]
