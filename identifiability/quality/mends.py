"""Correct logs when they are read, in the order of the registry, and report it.

The corrections concern stuck torque and repeated rows in motion, wrapped angles, outlying samples,
stale commands, commands without torque, and derivatives of another motion.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from identifiability.foundation.errors import listing
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.linalg import rms_of
from identifiability.foundation.names import Array
from identifiability.foundation.values import Fields
from identifiability.logs import Log
from identifiability.logs.checks import COMMANDS
from identifiability.logs.commands import find_exchanged, of_commands, state_exchanged
from identifiability.logs.contradictions import Contradiction, contradictions
from identifiability.logs.rows import find_range
from identifiability.logs.rules import RULES
from identifiability.logs.signals import cubic, sampling_step
from identifiability.logs.spikes import Spike, Wraps, find_wraps, mend_column
from identifiability.logs.stale import restore_values
from identifiability.robot.floating import BASE_JOINTS

from .registry import Does, Mended, RawLogs, check, mend_each


@mend_each("silent")
def find_silent(log: Log) -> Mended:
    """Report rows in which torque was not measured; the fit omits these equations.

    A joint of which no row was measured, while others were, is a doubt.
    """
    gone = np.zeros(len(log.joints), int) if log.unmeasured is None else log.unmeasured.sum(0)
    counts = zip(log.joints, gone.tolist(), strict=True)
    lost = {j: n for j, n in counts if n}
    found = list[Finding]()
    never = [] if log.motion_alone else [j for j, n in lost.items() if n == len(log)]
    if never:
        where = [phrase("unmeasured", "empty", joint=j) for j in never]
        columns = [f"{j}.tau" for j in never]
        found.append(Finding("unmeasured", log.name, where=where, columns=columns, rows=len(log)))
    partly = {j: n for j, n in lost.items() if j not in never}
    if partly:
        where = [phrase("silent", "one", joint=j, rows=n, all=len(log)) for j, n in partly.items()]
        columns = [f"{j}.tau" for j in partly]
        rows = max(partly.values())
        found.append(Finding("silent", log.name, where=where, rows=rows, columns=columns))
    return log, found


@mend_each("held_base")
def find_held_base(log: Log) -> Mended:
    """Report a base that is stated as fixed, and moves by the columns of its pose."""
    way, turn = log.held_way
    moves = max(way, turn) > RULES.moving
    return log, [Finding("held_base", log.name, way=way, turn=np.degrees(turn))] if moves else []


# Stuck torque and repeated rows: a sensor or a logger hangs while the robot moves.
#
# Torque of a joint that never changes was not measured. If torque stops changing, its sensor hangs,
# unless it is at its largest or smallest value, as for a saturated motor. If rows repeat from the
# middle of a motion on, the logger hangs.


@mend_each("stuck")
def drop_stuck(log: Log) -> Mended:
    """Return a log without stuck rows and stuck torque, and the findings."""
    if log.motion_alone or log.commanded or len(log) < RULES.stuck:
        return log, []
    # Of a long log no row is dropped.
    log, found = (log, []) if log.long else _drop_hung(log)
    least, most = find_range(log.q)
    if (least == most).all():
        return log, found
    low, high = find_range(log.tau)
    never = _find_unmeasured(log, low, high)
    runs = [(k, 0, len(log)) for k in never]
    if never:
        found = [*found, _tell_unmeasured(log, {f"{log.joints[k]}.tau": low[k] for k in never})]
    for k, a, b in () if log.long else _find_stuck(log, low, high):
        runs.append((k, a, b))
        joint = log.joints[k]
        value = float(log.tau[a, k])
        where = [phrase("stuck", "stands", joint=joint, value=value, first=a + 1, last=b)]
        said = Finding("stuck", log.name, where=where, rows=b - a, columns=[f"{joint}.tau"])
        found.append(said)
    return (log.changed(partial(_silence, runs=runs)) if runs else log), found


def _tell_unmeasured(log: Log, always: Mapping[str, float]) -> Finding:
    """Return a note on columns of torque that have one value always."""
    where = [f"'{name}' = {value + 0.0:.4g}" for name, value in always.items()]
    return Finding("unmeasured", log.name, where=where, columns=[*always], rows=len(log))


def _find_unmeasured(log: Log, low: Array, high: Array) -> list[int]:
    """Return the joints whose torque never changes, from its ranges (n,); none if none changes."""
    known = np.zeros(len(low)) if log.unmeasured is None else find_range(log.unmeasured)[0]
    never = (low == high) & ~(known > 0) & ~np.isin(log.joints, BASE_JOINTS)
    if (low < high).any():
        return np.flatnonzero(never).tolist()
    return []


def _find_stuck(log: Log, low: Array, high: Array) -> Iterator[tuple[int, int, int]]:
    """Yield runs of stuck torque, except at a limit or at rest: (joint, first, last).

    If torque then changes by one step of its converter, it was at an extremum. That happens in any
    motion.
    """
    for k in np.flatnonzero(low < high).tolist():
        change = np.abs(np.diff(log.tau[:, k], append=np.inf))
        step = 1.5 * change[change > 0].min()
        for a, b in find_runs(log.tau[:, [k]]):
            path = log.q[a:b, k]
            little = RULES.moving * np.ptp(log.q[:, k])
            # No motor at its limit moves a joint there and back again, beyond both its ends.
            ends = path[[0, -1]]
            above = path.max() - ends.max()
            below = ends.min() - path.min()
            back = min(above, below) > little
            limit = log.tau[a, k] in (low[k], high[k]) and not back
            lost = log.unmeasured is not None and log.unmeasured[a, k]
            turned = change[b - 1] < step
            if not (limit or turned or np.ptp(path) <= little or lost):
                yield k, a, b


def _silence(log: Log, origin: int, runs: Sequence[tuple[int, int, int]]) -> Log:
    """Return rows of a log without torque in runs of the whole, (joint, first, last) each."""
    gone = np.zeros(log.tau.shape, bool) if log.unmeasured is None else log.unmeasured.copy()
    for k, a, b in runs:
        gone[max(a - origin, 0) : max(b - origin, 0), k] = True
    return replace(log, unmeasured=gone)


def _drop_hung(log: Log) -> Mended:
    x = np.hstack([getattr(log, kind) for kind in log.channels])
    step = np.abs(np.diff(log.q, axis=0))
    size = rms_of(step, axis=0)
    # A robot that comes to rest, or leaves it, does so by and by.
    abrupt = (step > RULES.moving * size).any(axis=1)
    runs = [
        (a, b)
        for a, b in find_runs(x)
        if (a > 1 and abrupt[a - 1]) or (a == 0 and b < len(x) and abrupt[b - 1])
    ]
    held = {} if runs else {k: _find_held(step[:, k], size[k]) for k in range(len(size))}
    joints = [k for k, own in held.items() if own]
    runs += [run for own in held.values() for run in own]
    gone = np.zeros(len(log), bool)
    for a, b in runs:
        gone[a + 1 : b] = True
    if not runs or len(log) - gone.sum() < RULES.fewest:
        return log, []
    where = [f"{a + 2}–{b} (from t = {log.t[a]:.6g} s)" for a, b in runs]
    rows = int(gone.sum())
    columns = [f"{log.joints[k]}.q" for k in joints]
    found = Finding(
        "held" if joints else "hung",
        log.name,
        where=where,
        rows=rows,
        all=len(log),
        columns=columns or ("all",),
    )
    return log.each(lambda c: c[~gone], t=log.t[~gone]), [found]


def _find_held(step: Array, size: float) -> list[tuple[int, int]]:
    """Return runs of one held position from its steps (N - 1,), as [first, last).

    The joint moves before. When its position comes again it has moved on: no other step is as long.
    """
    held = [(a, b + 1) for a, b in find_runs(step[:, None]) if a > 0 and step[a] == 0.0]
    ends = [b for a, b in held if b <= len(step) and step[a - 1] > RULES.moving * size]
    longest = np.delete(step, [b - 1 for b in ends]).max(initial=0.0)
    return [(a, b) for a, b in held if b in ends and step[b - 1] > longest]


def find_runs(x: Array) -> list[tuple[int, int]]:
    """Return runs of constant values (N, c) that are unusually long, as [first, last)."""
    moves = (np.diff(x, axis=0) != 0).any(1)
    changes = np.flatnonzero(moves) + 1
    edges = np.concatenate([[0], changes, [len(x)]])
    lengths = np.diff(edges)
    long = lengths >= RULES.stuck * max(1.0, float(np.median(lengths)))
    starts = edges[:-1][long]
    return [(int(a), int(a + n)) for a, n in zip(starts, lengths[long], strict=True)]


# Angles within one turn, and single wrong samples: no check here decides alone which parameters are
# identifiable.


@mend_each("wraps")
def unwrap_log(log: Log) -> Mended:
    """Return a log with unwrapped angles, and the findings."""
    found = [find_wraps(x) for x in log.q.T]
    pairs = zip(log.joints, found, strict=True)
    wraps = {j: w for j, w in pairs if w is not None}
    if not wraps:
        return log, []
    rows = sum(len(w.rows) for w in wraps.values())
    where = [f"'{j}.q' at {len(w.rows)} rows" for j, w in wraps.items()]
    said = Finding(
        "wraps",
        log.name,
        where=where,
        columns=[f"{j}.q" for j in wraps],
        rows=rows,
    )
    return log.changed(partial(_undo, found=found)), [said]


def _undo(log: Log, origin: int, found: Sequence[Wraps | None]) -> Log:
    pairs = zip(found, log.q.T, strict=True)
    columns = [x if w is None else w.undo(x, origin) for w, x in pairs]
    q = np.stack(columns, 1)
    return replace(log, q=q)


@mend_each("spikes")
def mend_log(log: Log) -> Mended:
    """Return a log with wrong samples replaced, and the findings; the log itself without any."""
    wrong = log.spikes
    if not wrong:
        return log, []
    return log.changed(partial(_mend, wrong=wrong)), [_state_wrong(log, wrong)]


def _mend(log: Log, origin: int, wrong: Mapping[str, list[Spike]]) -> Log:
    channels: Fields = {}
    for kind in log.channels:
        columns = zip(log.joints, getattr(log, kind).T, strict=True)
        each = [mend_column(x, wrong.get(f"{joint}.{kind}", ()), origin) for joint, x in columns]
        channels[kind] = np.stack(each, 1)
    return replace(log, **channels)


def _state_wrong(log: Log, wrong: Mapping[str, list[Spike]]) -> Finding:
    found = sorted((s.row, name, s) for name, spikes in wrong.items() for s in spikes)
    where = []
    for row, name, s in found:
        t = float(log.t[row])
        where.append(
            phrase(
                "spikes", "value", row=row + 1, column=name, t=t, value=s.value, instead=s.instead
            )
        )
    key = "spikes" if found[-1][0] else "first_row"
    return Finding(
        key,
        log.name,
        rows=len(found),
        where=listing(where, 3, "; "),
        columns=tuple(wrong),
    )


# Commands in rows of another time, commands without torque, and derivatives of another motion.


@mend_each("stale_commands")
def restore_commands(log: Log) -> tuple[Log, list[Finding]]:
    """Return a log whose commands stand in the rows at whose times they arrive."""
    kinds = [kind for kind in log.channels if kind in COMMANDS]
    if not log.commanded or log.long:
        return log, []
    values, rows = restore_values(np.hstack([getattr(log, kind) for kind in kinds]))
    if not rows:
        return log, []
    columns: Any = zip(kinds, np.hsplit(values, len(kinds)), strict=True)
    restored = replace(log, **dict(columns))
    return restored, [Finding("stale_commands", log.name, rows=rows, all=len(log))]


@check("commands", Does.MENDS)
def compute_torque(logs: RawLogs) -> RawLogs:
    """Compute torque from commands, and name joints that follow no command."""
    if logs.torque is None:
        return logs
    made = logs.torque(logs.every)
    apart = list[str]()
    exchanged = dict[str, str]()
    for log, given in zip(made, logs.every, strict=True):
        left_out = np.array(log.joints)[log.is_unmeasured].tolist() if of_commands(log) else []
        apart += left_out
        if left_out:
            exchanged |= find_exchanged(given)
    joints = [joint for joint in dict.fromkeys(apart) if joint not in exchanged]
    found = [Finding("apart", joints=joints)] if joints else []
    if exchanged:
        found.append(Finding("commands_exchanged", pairs=state_exchanged(exchanged)))
    return logs.having(made, found)


# Derivatives that contradict positions.
#
# A velocity that lags by d adds d times viscous friction to the inertia of its joint. Low-passes of
# drivers lag, and columns that are logged a step later. Moving such a column adds no noise.


@check("contradictions", Does.MENDS)
def drop_contradicting(logs: RawLogs) -> RawLogs:
    """Leave out derivatives that contradict positions, or move those that only lag a little.

    If they were requested, they are reported only.
    Derivatives of another unit or sign stay; `check_units` refuses them.
    """
    asked = logs.how is not None and logs.how.derivatives == "given"
    return logs.each(partial(_drop_contradictions, asked=asked))


#: Channels in words.
_NAMES = {"q": "positions", "dq": "velocities", "ddq": "accelerations"}

#: Channels that may be left out, each the derivative of the one before.
_DERIVATIVES = ("dq", "ddq")


def _drop_contradictions(log: Log, *, asked: bool) -> Mended:
    every = [c for c in contradictions(log.shown) if not c.in_unit]
    if asked:
        return log, _report("derivative", log, every)
    late = [c for c in every if c.movable]
    wrong = [c for c in every if not c.movable]
    # A derivative of a wrong velocity cannot be checked.
    first = min((_DERIVATIVES.index(c.kind) for c in wrong), default=len(_DERIVATIVES))
    gone = _DERIVATIVES[first:]
    words = " and ".join(_NAMES[c] for c in gone if c in log.channels)
    found = _report("contradictions", log, wrong, channels=words, rows=len(log))
    log = log.without(gone)
    late = [c for c in late if c.kind not in gone]
    if late:
        log = log.changed(partial(_advance, log, late))
    return log, [*found, *_report("late", log, late)]


def _report(key: str, log: Log, wrong: Sequence[Contradiction], **others: Any) -> list[Finding]:
    """Return the finding of wrong columns; none if there are none."""
    where = [*(c.text for c in wrong if not c.lag), *_state_lags(wrong)]
    columns = [f"{c.joint}.{c.kind}" for c in wrong]
    return [Finding(key, log.name, where=where, columns=columns, **others)] if wrong else []


def _advance(log: Log, late: Sequence[Contradiction], rows: Log, start: int) -> Log:
    """Return rows of a log from an index on, with columns that lag moved to the right times."""
    longest = max(abs(c.lag) for c in late)
    reach = 4 + round(longest / sampling_step(log.t))  # and the samples of a cubic
    near = log.rows(max(start - reach, 0), start + len(rows) + reach)
    lags = {(c.joint, c.kind): c.lag for c in late}
    behind = np.zeros(len(log.joints))
    moved = Fields()
    for kind in [c for c in _DERIVATIVES if c in log.channels]:
        # An acceleration was compared with the velocity as it was logged.
        behind += [lags.get((joint, kind), 0.0) for joint in log.joints]
        at = np.clip(rows.t[:, None] + behind, near.t[0], near.t[-1])
        columns = zip(at.T, getattr(near, kind).T, strict=True)
        moved[kind] = np.column_stack([cubic(times, near.t, x) for times, x in columns])
    return replace(rows, **moved)


def _state_lags(wrong: Sequence[Contradiction]) -> Iterator[str]:
    """Yield which columns lag by how long, then which are ahead; velocities come first."""
    for of in ("q", "dq"):
        for key, sign in (("lags", 1), ("leads", -1)):
            lags = {f"{c.joint}.{c.kind}": c.lag for c in wrong if c.of == of and sign * c.lag > 0}
            if lags:
                ms = 1e3 * abs(float(np.median([*lags.values()])))
                yield phrase("contradictions", key, columns=[*lags], of=_NAMES[of], ms=ms)
