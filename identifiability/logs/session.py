"""The clock of a session: when each of some logs began, where all of them say so."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from identifiability.logs.repeats import Recording


def share_clock(logs: Sequence[Recording]) -> list[Recording]:
    """Return logs whose starts count from where the first of them begins, or all without a start.

    A robot records one log at a time: logs of which two overlap are not of one clock, and where one
    does not say when it began, nothing is known of the order of all.
    """
    spans = [
        (log.start + log.clock.first, log.start + log.clock.last)
        for log in logs
        if log.start is not None
    ]
    order = sorted(spans)
    if len(spans) < len(logs) or any(last >= first for (_, last), (first, _) in pairwise(order)):
        return [log if log.start is None else replace(log, start=None) for log in logs]
    return [replace(log, start=(log.start or 0.0) - order[0][0]) for log in logs]
