"""Logs that are given twice, and the clock of a session: when each of some logs began."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding
from identifiability.logs import Log


def check_held_out(train: Sequence[Log], held_out: Sequence[Log]) -> None:
    """Refuse a log that is given twice: its repetition would pass for new evidence.

    Stretches of one log that share no time are no repetition.

    Raises
    ------
    LogError
    """
    for k, s in enumerate(train):
        for other in train[:k]:
            if s.sha256 and _same(s, other):
                raise LogError(Finding("twice.fitted", "", log=s.name, other=other.name))
    for s in held_out:
        for other in train:
            if _same(s, other):
                raise LogError(Finding("twice.held", "", log=s.name, other=other.name))


def _same(one: Log, other: Log) -> bool:
    """Whether two logs are from one record and share some of its time."""
    if one.sha256 != other.sha256:
        return False
    if one.long or other.long or not (len(one) and len(other)):
        return True
    return bool(one.t[0] <= other.t[-1] and other.t[0] <= one.t[-1])


# The clock of a session: when each of some logs began, where all of them say so.


def share_clock(logs: Sequence[Log]) -> list[Log]:
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
