"""Rows that are given more than once: copies are no new evidence, however often they come.

And the clock of a session: when each of some logs began, where all of them say so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, pairwise

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.foundation.names import Array
from identifiability.logs.log import Log
from identifiability.logs.rules import RULES

# Rows that are given more than once: copies are no new evidence, however often they come.
#
# A measurement that is repeated has noise of its own. Rows whose positions, torques and, where all
# logs have them, measured speeds agree to a ten-thousandth of how much they vary, many rows on end,
# are therefore copies: a log joined to itself, a cut of another log, a log that was written again
# with fewer digits. Torque that saturates or has few steps agrees many rows on end by chance, too,
# where a motion is repeated: only rows in which torque or speed changes are counted, and how often
# these then agree nearby, where the motion does, says how many of them chance explains.


#: Consecutive rows that must agree with consecutive earlier ones; standstills count as one.
RUN = 16

#: Rows on each side of a run that say how often torque agrees by chance.
NEARBY = 64 * RUN


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
                raise LogError(
                    f"The log {s.name} is given twice (as {other.name} before); give each log once."
                )
    for s in held_out:
        for other in train:
            if _same(s, other):
                raise LogError(
                    f"The validation log {s.name} is the log {other.name} that is fitted; its "
                    "error would say nothing about unseen motion: give another log, or none for "
                    "cross-validation."
                )


def _same(one: Log, other: Log) -> bool:
    """Whether two logs are from one record and share some of its time."""
    if one.sha256 != other.sha256:
        return False
    if one.long or other.long or not (len(one) and len(other)):
        return True
    return bool(one.t[0] <= other.t[-1] and other.t[0] <= one.t[-1])


def drop_repeats(
    logs: Sequence[Log], held_out: Sequence[Log] = ()
) -> tuple[list[Log], list[Log], tuple[str, ...]]:
    """Return fitted and held-out logs without rows that came before, and a hint for each such log.

    Motion alone is a plan and no measurement: it may go round as often as it likes.

    Raises
    ------
    LogError
        If nothing is left of a held-out log.
    """
    every = [*logs, *held_out]
    pairs = zip(every, _find_copies(every), strict=True)
    left = [_keep(log, copied & (not log.motion_alone)) for log, copied in pairs]
    hints = tuple(
        f"{log.name} repeats rows that were given before, noise and all ({len(log) - count} of "
        f"{len(log)}): they count once; give each measurement once."
        for log, kept in zip(every, left, strict=True)
        if (count := sum(len(part) for part in kept)) < len(log)
    )
    n = len(logs)
    for log, kept in zip(held_out, left[n:], strict=True):
        if not kept:
            raise LogError(
                f"The validation log {log.name} repeats rows of the logs before it; its error "
                "would say nothing about unseen motion: give another log, or none for "
                "cross-validation."
            )
    return list(chain(*left[:n])), list(chain(*left[n:])), hints


def _keep(log: Log, copied: np.ndarray) -> list[Log]:
    """Return the stretches of a log that are no copies and long enough to be used."""
    if not copied.any():
        return [log]
    if log.long:
        return [] if copied.mean() >= RULES.nearly_all else [log]
    edges = np.flatnonzero(np.diff(np.concatenate([[1], copied.astype(int), [1]])))
    stretches = [(a, b) for a, b in edges.reshape(-1, 2).tolist() if b - a >= RULES.fewest]
    if len(stretches) == 1:
        return [log.rows(*stretches[0])]
    return [log.cut(a, b, f"{log.name}, rows {a + 1}–{b}") for a, b in stretches]


def _find_copies(logs: Sequence[Log]) -> list[np.ndarray]:
    """Return which of the rows that are looked at came before, for each log."""
    parts = [(k, part) for k, log in enumerate(logs) for part in _shown(log)]
    joints = [j for j in logs[0].joints if all(j in log.joints for log in logs)] if logs else []
    owner = np.concatenate([np.full(len(p), k) for k, p in parts]) if parts else np.empty(0, int)
    if not joints or not len(owner):
        return [np.zeros(int((owner == k).sum()), bool) for k in range(len(logs))]
    starts = np.cumsum([0, *(len(p) for _, p in parts)])[:-1]
    kinds = _kinds(logs)
    rows = np.concatenate([_values(p, joints, kinds) for _, p in parts])
    copied = _match(rows, starts, len(joints))
    return [copied[owner == k] for k in range(len(logs))]


def _shown(log: Log) -> list[Log]:
    return [window for _, window in log.windows()] if log.long else [log]


def _kinds(logs: Sequence[Log]) -> tuple[str, ...]:
    """Return the channels in which rows are compared; positions come first."""
    return ("q", "tau", "dq") if all("dq" in log.channels for log in logs) else ("q", "tau")


def _values(log: Log, joints: Sequence[str], kinds: Sequence[str]) -> Array:
    at = [log.joints.index(j) for j in joints]
    return np.concatenate([getattr(log, kind)[:, at] for kind in kinds], axis=1)


def _near(rows: Array, kinds: int) -> Array:
    """Return how close the values of rows (N, kinds · n) are taken as equal."""
    spread = rows.std(0).reshape(kinds, -1)
    # No difference below this share of how much the liveliest joint varies counts: what never
    # moves varies by rounding.
    floor = 1e-7 * spread.max(1, initial=0.0, keepdims=True)
    # Values agree within this share of their standard deviation.
    near: Array = np.maximum(0.0001 * spread, np.maximum(floor, np.finfo(float).tiny)).ravel()
    return near


def _match(rows: Array, starts: np.ndarray, joints: int) -> np.ndarray:
    """Return which rows continue a run of copies of earlier ones, (N,) bool.

    Rows are (N, k · joints), positions first; runs do not reach over `starts`.
    """
    near = _near(rows, rows.shape[1] // joints)
    cells = np.rint((rows - rows.mean(0)) / near).astype(np.int64)
    mix = np.random.default_rng(0).integers(1, 2**63, rows.shape[1], np.uint64) | np.uint64(1)
    keys = (cells.astype(np.uint64) * mix).sum(1, dtype=np.uint64)
    _, at, which, times = np.unique(
        keys, return_index=True, return_inverse=True, return_counts=True
    )
    index = np.arange(len(rows))
    back = index - at[which]
    # Where rows come often by chance, those that come twice say how far back the copied ones are.
    lags, votes = np.unique(back[(back > 0) & (times[which] == 2)], return_counts=True)
    # Distances between rows that come twice that are followed, the most frequent.
    for lag in lags[np.argsort(votes)][-16:].tolist():
        back[lag:][keys[lag:] == keys[:-lag]] = lag
    still = np.concatenate([[False], keys[1:] == keys[:-1]])
    since = np.maximum.accumulate(np.where(still, 0, index))  # first row of a standstill
    behind = back[since]
    begins = np.diff(behind, prepend=-1) != 0
    begins[starts] = True
    told = _noise_changes(rows, near, joints)
    copied = np.zeros(len(rows), bool)
    for a, b in pairwise([*np.flatnonzero(begins).tolist(), len(rows)]):
        lag, count = int(behind[a]), np.count_nonzero(told[a:b] & ~still[a:b])
        if lag > 0 and count >= RUN:
            beside = np.r_[max(lag, a - NEARBY) : a, b : min(len(rows), b + NEARBY)]
            beside = beside[told[beside]]
            same = np.abs(rows[beside] - rows[beside - lag]) <= near
            moved, again = (np.asarray(part.all(1)) for part in np.hsplit(same, [joints]))
            chance = again[moved].mean() if moved.any() else 0.0
            # A run that chance explains comes less often than this in all the rows.
            copied[a:b] = chance >= RULES.nearly_all or len(rows) * chance**count < 0.01
    return copied


def _noise_changes(rows: Array, near: Array, joints: int) -> np.ndarray:
    """Return in which rows a torque or speed is another than in the row before, (N,) bool."""
    changes = np.abs(np.diff(rows[:, joints:], axis=0)) > near[joints:]
    return np.concatenate([[True], np.asarray(changes.any(1))])


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
