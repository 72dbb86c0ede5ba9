"""Instruments of the logs that have a second record of their motion, and the estimator for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from identifiability.estimation.estimate import Kind, Method, choose_estimator
from identifiability.estimation.estimator import Estimator
from identifiability.foundation.errors import LogError, listing
from identifiability.logs import Log
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.instruments import add_instrument
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.logs.repeats import Recording
from identifiability.workflows.opening import Opening


def add_instruments(
    opening: Opening, logs: Sequence[Recording], method: Method, kind: Kind
) -> tuple[Opening, Estimator]:
    """Return the estimator of a method and a kind, and fitted samples with what it takes.

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
                "need: repeat the motion, or log '<joint>.dq' and '<joint>.ddq' as measured or the "
                "command in '<joint>.q_ref'; else leave out the estimator."
            )
        records.append(record)
    missing = [s for s, r in zip(opening.samples, records, strict=True) if r is None]
    if len(missing) == len(records):
        return opening, plain
    found = [r or _own_motion(s) for s, r in zip(opening.samples, records, strict=True)]
    whole = [s for s in found if s is not None]
    hints = (*opening.hints, *_tell_apart(missing, alike=len(whole) < len(found)))
    if len(whole) < len(found):
        return replace(opening, hints=hints), plain
    estimator = choose_estimator(method, kind, instruments=True)
    return replace(opening, samples=tuple(whole), hints=hints), estimator


def _own_motion(samples: Prepared) -> Samples | None:
    """Return a log that is its own instrument, as least squares has it; None if it is too long."""
    if not isinstance(samples, Samples):
        return None
    return replace(samples, instrument=samples.motion)


def _tell_apart(missing: Sequence[Prepared], *, alike: bool) -> list[str]:
    if not missing:
        return []
    what = "all logs were fitted by least squares" if alike else "it was fitted by least squares"
    return [
        f"{listing([s.name for s in missing], 4)}: no second record of the motion in memory, so "
        f"{what}, which noise in the motion biases; repeat the motion, or log '<joint>.dq' and "
        "'<joint>.ddq' as measured or the command in '<joint>.q_ref'."
    ]
