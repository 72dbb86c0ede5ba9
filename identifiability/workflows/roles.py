"""Roles of logs: which are fitted and which verify, assigned before any fit.

A minimised error is no evidence, so errors are quoted on motion that is not fitted. Whole logs are
held out where there are enough. Otherwise a log is divided, with an unused pause between the parts.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.estimation.search import LAST, divide
from identifiability.foundation.errors import LogError
from identifiability.foundation.names import PART
from identifiability.foundation.rounding import format_count, join
from identifiability.logs import Log
from identifiability.logs.rules import RULES
from identifiability.quality.recordings import Recordings

#: Samples of a log that is divided: the part that verifies has a hundred or so.
FEWEST = int(100 / LAST)


def assign_roles(recordings: Recordings) -> Recordings:
    """Return recordings of which some are held out.

    Held-out logs that were given keep their role. Without any, the last log is held out, or the
    last quarter of the only one. A log that is too short for this is not divided.
    """
    fitted = recordings.fitted
    held_out = recordings.held_out
    if held_out:
        return replace(recordings, verified_on=join([log.name for log in held_out]))
    if len(fitted) > 1:
        last = fitted[-1]
        words = f"{last.name} (set aside)"
        return replace(
            recordings, fitted=fitted[:-1], held_out=(last,), verified_on=words, set_aside=True
        )
    if len(fitted[0]) < FEWEST:
        return recordings
    fit, verify, words = _divide_log(fitted[0])
    return replace(recordings, fitted=(fit,), held_out=(verify,), verified_on=words, set_aside=True)


def may_divide(logs: Sequence[Log]) -> bool:
    """Return whether a part of logs can verify what another part shows."""
    return len(logs) > 1 or len(logs[0]) >= FEWEST


def require_held_out(recordings: Recordings) -> None:
    """Raise an error if no log is held out.

    Raises
    ------
    LogError
    """
    if recordings.held_out:
        return
    log = recordings.fitted[0]
    if may_divide(recordings.fitted):
        raise LogError(
            "Effects are verified on motion that was not fitted, and nothing is held out: give a "
            "held-out log (validate), or leave validate out, and a part is set aside."
        )
    raise LogError(
        f"{log.name} has {format_count(len(log), 'sample')}, too few to name effects from one "
        f"part and verify them on another; give a log of at least {FEWEST} samples, or a "
        "second one."
    )


def _divide_log(log: Log) -> tuple[Log, Log, str]:
    """Return the fitted part of the only log, the verifying part, and its description."""
    first, last = _find_motion(log)
    end, start = divide(last - first)
    fit = log.rows(0, first + end, f"{log.name}{PART}1")
    verify = log.rows(first + start, len(log), f"{log.name}{PART}2")
    return fit, verify, f"the last {100 * LAST:.0f} % of {log.name} (set aside)"


def _find_motion(log: Log) -> tuple[int, int]:
    """Return the rows [first, last) between the rests at both ends of a log.

    A last quarter in which the robot stands would verify nothing. A long log is not read for this.
    """
    if log.long:
        return 0, len(log)
    q = log.q
    little = RULES.moving * np.ptp(q, axis=0)
    from_start = np.abs(q - q[0])
    to_end = np.abs(q - q[-1])
    left = np.flatnonzero((from_start > little).any(axis=1))
    arrives = np.flatnonzero((to_end > little).any(axis=1))
    rests = len(left) > 0 and arrives[-1] < (1 - LAST / 2) * len(log)
    if not rests or arrives[-1] - left[0] < FEWEST:
        return 0, len(log)
    return int(left[0]), int(arrives[-1]) + 1
