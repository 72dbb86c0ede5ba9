"""Logs without their wrong samples, angles that go on, columns that contradict each other.

Columns may contradict the joints' limits, or derivatives what they are derivatives of.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.checks import COMMANDS
from identifiability.logs.log import Log, join_logs
from identifiability.logs.logfile import LogFile
from identifiability.logs.rules import RULES
from identifiability.logs.signals import spread_windows
from identifiability.logs.spikes import TURN, Spike, WrapFinder, Wraps, find_spikes, mend_column
from identifiability.robot import Robot
from identifiability.robot.floating import BASE_JOINTS

# Logs without their wrong samples: none that stands alone decides what is identified.


#: Wrong values that a hint lists.
LISTED = 3

#: What a hint says of wrong samples.
REPLACED = "replaced by what they say"


def mend_logs(logs: Sequence[Log | LogFile]) -> tuple[list[Log | LogFile], tuple[str, ...]]:
    """Return logs with their wrong samples replaced, and a hint for each log that has any.

    A log without wrong samples is returned as it is.
    """
    mended, hints = [], []
    for log in logs:
        wrong = _find_spikes(log)
        if not wrong:
            mended.append(log)
            continue
        mended.append(replace(log, mended=wrong) if isinstance(log, LogFile) else _mend(log, wrong))
        hints.append(_state(log, wrong))
    return mended, tuple(hints)


def _find_spikes(log: Log | LogFile) -> dict[str, tuple[Spike, ...]]:
    """Return the wrong samples of each column that has any."""
    commands = COMMANDS if isinstance(log, Log) and log.commanded else ()  # which jump as they like
    channels = [c for c in log.channels if c not in commands]
    columns = [(f"{j}.{c}", c, k) for c in channels for k, j in enumerate(log.joints)]
    if isinstance(log, LogFile):
        # Where an angle jumps by a turn, and back, is no wrong sample.
        found = {n: () if n in log.unwrapped else log.spikes.get(n, ()) for n, *_ in columns}
    else:
        found = {name: tuple(find_spikes(getattr(log, c)[:, k])) for name, c, k in columns}
    return {name: spikes for name, spikes in found.items() if spikes}


def _mend(log: Log, wrong: dict[str, tuple[Spike, ...]]) -> Log:
    channels: dict[str, Any] = {}
    for kind in log.channels:
        columns = zip(log.joints, getattr(log, kind).T, strict=True)
        channels[kind] = np.stack(
            [mend_column(x, wrong.get(f"{joint}.{kind}", ())) for joint, x in columns], 1
        )
    return replace(log, **channels)


def _state(log: Log | LogFile, wrong: dict[str, tuple[Spike, ...]]) -> str:
    """Return one sentence that names the wrong samples of a log."""
    found = sorted((s.row, name, s) for name, spikes in wrong.items() for s in spikes)
    shown = [
        f"data row {row + 1} (t = {float(log.rows(row, row + 1).t[0]):.6g} s): {name} = "
        f"{s.value:.4g}, where the rows beside it say {s.instead:.3g}"
        for row, name, s in found[:LISTED]
    ]
    more = f"; and {len(found) - LISTED} more" if len(found) > LISTED else ""
    one = len(found) == 1
    return (
        f"{log.name}: {'one value lies' if one else f'{len(found)} values lie'} far from those "
        f"before and after, as no motion or torque does, and {'was' if one else 'were'} {REPLACED} "
        f"({'; '.join(shown)}{more}): check the log."
    )


# Logs without what stands still while the robot moves: a sensor or a logger hangs there.


def drop_stuck(logs: Sequence[Log | LogFile]) -> tuple[list[Log | LogFile], tuple[str, ...]]:
    """Return logs without rows and torque that stand still in mid-motion, and their hints.

    Torque of a joint that never changes was not measured; where it stops changing its sensor
    hangs, unless it stands at its largest or smallest value, as a motor at its limit does. Rows
    that repeat from the midst of a motion on are the logger's.
    """
    out: list[Log | LogFile] = []
    hints: list[str] = []
    for log in logs:
        found: list[str] = []
        if isinstance(log, LogFile):
            long, found = _never_measured(log)
            out.append(long)
        elif log.motion_alone or log.commanded or len(log) < RULES.stuck:
            out.append(log)
        else:
            left, hung = _drop_hung(log)
            left, silent = _silence_stuck(left)
            out.append(left)
            found = hung + silent
        hints += [f"{log.name}: {text}" for text in found]
    return out, tuple(hints)


def _never_measured(log: LogFile) -> tuple[LogFile, list[str]]:
    tau = np.concatenate([log.rows(a, b).tau for a, b in spread_windows(len(log))])
    never = np.ptp(tau, axis=0) == 0
    if not never.any() or never.all():
        return log, []
    stuck = {j: float(x) for j, x, n in zip(log.joints, tau[0], never, strict=True) if n}
    return replace(log, silent=tuple(stuck)), [_tell_never(stuck)]


def _drop_hung(log: Log) -> tuple[Log, list[str]]:
    x = np.hstack([getattr(log, kind) for kind in log.channels])
    step = np.abs(np.diff(log.q, axis=0))
    size = np.sqrt(np.mean(step**2, axis=0))
    gone = np.zeros(len(log), bool)
    texts = []
    for a, b in _runs(x):
        # A robot that comes to rest does so by and by.
        if a > 1 and (step[a - 1] > RULES.moving * size).any():
            gone[a + 1 : b] = True
            texts.append(f"{a + 2}–{b} (from t = {log.t[a]:.6g} s)")
    if not texts or len(log) - gone.sum() < RULES.fewest:
        return log, []
    return log.each(lambda c: c[~gone], t=log.t[~gone]), [
        f"nothing changes in data rows {listing(texts, LISTED)}, in the midst of a motion: the "
        f"logger hung, and these {gone.sum()} of {len(log)} rows are left out; check the log."
    ]


def _silence_stuck(log: Log) -> tuple[Log, list[str]]:
    low, high = log.tau.min(0), log.tau.max(0)
    never = low == high
    if never.all() or not np.ptp(log.q, axis=0).any():
        return log, []
    gone = np.zeros(log.tau.shape, bool) if log.unmeasured is None else log.unmeasured.copy()
    never &= ~gone.all(0) & ~np.isin(log.joints, BASE_JOINTS)  # which nothing drives
    gone[:, never] = True
    texts, stuck = [], {j: float(x) for j, x, n in zip(log.joints, low, never, strict=True) if n}
    if stuck:
        texts.append(_tell_never(stuck))
    for k in np.flatnonzero(~never & (low < high)):
        for a, b in _runs(log.tau[:, [k]]):
            at_limit = log.tau[a, k] in (low[k], high[k])
            rests = np.ptp(log.q[a:b, k]) <= RULES.moving * np.ptp(log.q[:, k])
            if at_limit or rests or gone[a, k]:
                continue
            gone[a:b, k] = True
            texts.append(
                f"'{log.joints[k]}.tau' stands at {log.tau[a, k]:.4g} in data rows {a + 1}–{b}, "
                "while that joint moves: it is no data there; check the column."
            )
    return (replace(log, unmeasured=gone), texts) if texts else (log, [])


def _tell_never(stuck: dict[str, float]) -> str:
    one = len(stuck) == 1
    columns = listing([f"'{joint}.tau' = {x:.4g}" for joint, x in stuck.items()], 4)
    return (
        f"{columns} in every row, while the robot moves: it was not measured, and the equations of "
        f"{'that joint' if one else 'those joints'} are left out; check the column"
        f"{'' if one else 's'}."
    )


def _runs(x: Array) -> list[tuple[int, int]]:
    """Return where values (N, c) stand still for longer than they usually do, as [first, last)."""
    changes = np.flatnonzero((np.diff(x, axis=0) != 0).any(1)) + 1
    edges = np.concatenate([[0], changes, [len(x)]])
    lengths = np.diff(edges)
    long = lengths >= RULES.stuck * max(1.0, float(np.median(lengths)))
    return [(int(a), int(a + n)) for a, n in zip(edges[:-1][long], lengths[long], strict=True)]


# Logs whose angles go on where they were written within one turn.


def unwrap_logs(logs: Sequence[Log | LogFile]) -> tuple[list[Log | LogFile], tuple[str, ...]]:
    """Return logs with the jumps of wrapped angles undone, and a hint for each that has any."""
    out: list[Log | LogFile] = []
    hints = []
    for log in logs:
        found = _find_wraps(log)
        if not found:
            out.append(log)
            continue
        out.append(_undo(log, found))
        columns = listing([f"'{j}.q' at {len(w.rows)} rows" for j, w in found.items()], 4)
        hints.append(
            f"{log.name}: angles jump by a whole turn ({columns}); they were written within one "
            "turn and are read as going on (unwrapped)."
        )
    return out, tuple(hints)


def _find_wraps(log: Log | LogFile) -> dict[str, Wraps]:
    """Return the jumps of every joint that has any."""
    if isinstance(log, LogFile):
        return {j: log.wraps[f"{j}.q"] for j in log.joints if f"{j}.q" in log.wraps}
    found = {}
    for joint, column in zip(log.joints, log.q.T, strict=True):
        finder = WrapFinder()
        finder.add(column)
        wraps = finder.finish()
        if wraps is not None:
            found[joint] = wraps
    return found


def _undo(log: Log | LogFile, found: dict[str, Wraps]) -> Log | LogFile:
    if isinstance(log, LogFile):
        return replace(log, unwrapped={f"{j}.q": w for j, w in found.items()})
    columns = [
        found[j].undo(x) if j in found else x for j, x in zip(log.joints, log.q.T, strict=True)
    ]
    return replace(log, q=np.stack(columns, 1))


# Columns that can be seen to be wrong: by the joints' limits, and by derivatives that do not fit.
#
# A change of unit or sign is refused; what merely contradicts is remarked on.


#: Units of length that people give instead of SI, and how many make one of SI.
_LENGTHS = {"mm": 1e3, "cm": 1e2}

#: What sentences call derivatives.
WORDS = {"dq": "velocities", "ddq": "accelerations"}


def check_units(robot: Robot, windows: Sequence[Log]) -> None:
    """Refuse degrees given as radians and millimetres given as metres, where they can be seen.

    Parameters
    ----------
    robot : Robot
    windows : sequence of Log
        Stretches of one log, or all of it as one.

    Raises
    ------
    LogError
    """
    log = windows[0]
    if robot.angles is None:
        _check_angles(robot, windows)
    for k, joint in enumerate(log.joints):
        if robot.is_prismatic(int(robot.actuated[k])):
            q = np.concatenate([w.q[:, k] for w in windows])
            low, high = robot.limits[k]
            fits = [u for u, f in _LENGTHS.items() if _fits(q, low, high, f)]
            if fits:
                raise LogError(
                    f"{log.name}: {_span(joint, q)}, which does not fit the joint's limits "
                    f"{low:.4g} … {high:.4g} m; it looks like {fits[0]}: convert it to m."
                )
    for c in contradictions(join_logs(windows)):
        if c.in_unit:
            raise LogError(
                f"{log.name}: '{c.joint}.{c.kind}' is {1 / c.slope:.4g} times the time derivative "
                f"of '{c.joint}.{c.of}'; one of them (or the time) is in another unit or has "
                "another sign: give all in SI units."
            )


def looks_like_degrees(q: Array, low: float, high: float) -> bool:
    """Return whether positions (N,) fit limits [rad] in degrees, and not in rad by whole turns."""
    middle = round((float(np.median(q)) - 0.5 * (low + high)) / (2 * np.pi)) * 2 * np.pi
    if (
        not np.isfinite(middle)
        or np.mean((q - middle < low) | (q - middle > high)) < RULES.positions_odd
    ):
        return False
    return _fits(q, low, high, 180 / np.pi)


def _fits(q: Array, low: float, high: float, factor: float) -> bool:
    """Return whether positions (N,) do not fit limits as they are, but divided by a factor do."""
    if not np.isfinite(high - low) or np.mean((q < low) | (q > high)) <= 0.5:
        return False
    return bool(np.mean((q >= low * factor) & (q <= high * factor)) > 1 - RULES.positions_odd)


def _check_angles(robot: Robot, windows: Sequence[Log]) -> None:
    """Refuse degrees where most joints that turn, and have limits, show them."""
    bounded = [
        k
        for k, dof in enumerate(robot.actuated)
        if not robot.is_prismatic(int(dof)) and np.isfinite(np.ptp(robot.limits[k]))
    ]
    columns = {k: np.concatenate([w.q[:, k] for w in windows]) for k in bounded}
    for is_odd, why in ((looks_like_degrees, _DEGREES), (_beyond, _TICKS)):
        odd = [k for k in bounded if is_odd(columns[k], *robot.limits[k])]
        if 2 * len(odd) > len(bounded):
            joint, (low, high) = windows[0].joints[odd[0]], robot.limits[odd[0]]
            raise LogError(
                f"{windows[0].name}: {_span(joint, columns[odd[0]])}, and the joint's limits are "
                f"{low:.4g} … {high:.4g} rad: it {why} what ticks or normalised units are: "
                f"[columns] {joint} = {{scale = …, offset = …}} in the sidecar (rad = scale × "
                "value + offset)."
            )


#: What positions beyond limits are, and what to say.
_DEGREES = (
    'looks like degrees: say --set angles=deg (or angles = "deg" in the sidecar), or --set '
    "angles=rad if they are rad, or"
)
_TICKS = "spans more than twice the joint's limits; say"


def _beyond(q: Array, low: float, high: float) -> bool:
    """Return whether positions (N,) span more than limits and two turns do, wherever zero is."""
    return float(np.ptp(q)) > 2 * max(high - low, TURN)


def _span(joint: str, q: Array) -> str:
    return f"'{joint}.q' spans {q.min():.4g} … {q.max():.4g}"


@frozen
class Contradiction:
    """A given derivative that does not fit what it is derived from.

    Attributes
    ----------
    joint, kind, of : str
        Whose, which channel, and of which it should be the derivative.
    explained : float
        Share of the variance of what it is derived from that its integral explains.
    slope : float
        With this factor.
    """

    joint: str
    kind: str
    of: str
    explained: float
    slope: float

    @property
    def text(self) -> str:
        """It in half a sentence."""
        return (
            f"'{self.joint}.{self.kind}' contradicts '{self.joint}.{self.of}': integrated, it "
            f"explains {100 * max(self.explained, 0.0):.0f} % of its variance with a factor of "
            f"{self.slope:.2g}"
        )

    @property
    def in_unit(self) -> bool:
        """Whether it is the derivative, but in another unit or of another sign."""
        return self.explained > 1 - RULES.derivative_unexplained and not 0.5 < self.slope < 2


def contradictions(log: Log) -> list[Contradiction]:
    """Return every given derivative that does not fit what it is derived from.

    It finds columns of other joints, of desired motion, delayed or filtered too much. They are
    compared by integration, which forgives noise where differentiation would not.
    """
    found, least = [], 1 - RULES.derivative_unexplained
    for kind, of in (("dq", "q"), ("ddq", "dq")):
        rate, x = getattr(log, kind), getattr(log, of)
        if rate is None or x is None:
            continue
        for k, joint in enumerate(log.joints):
            fit = _compare(log.t, x[:, k], rate[:, k])
            if fit is None:
                continue
            slope, unexplained = fit
            if unexplained > RULES.derivative_unexplained or not least < slope < 1 / least:
                found.append(Contradiction(joint, kind, of, 1 - unexplained, slope))
    return found


def find_contradictions(log: Log) -> list[str]:
    """Return one remark for every given derivative that does not fit what it is derived from."""
    advice = "check the column, or leave it out and it is computed"
    return [f"{c.text}; {advice}" for c in contradictions(log)]


def drop_contradictions(
    logs: Sequence[Log | LogFile],
) -> tuple[list[Log | LogFile], tuple[str, ...]]:
    """Return logs without derivatives that contradict what they are derived from, and hints.

    Those of another unit or sign are left to be refused by `check_units`.
    """
    kept, hints = [], []
    for log in logs:
        windows = [log.rows(a, b) for a, b in spread_windows(len(log))]
        wrong = [c for c in contradictions(join_logs(windows)) if not c.in_unit]
        if not wrong:
            kept.append(log)
            continue
        # What is derived from a wrong velocity cannot be compared with anything.
        gone = ("dq", "ddq") if any(c.kind == "dq" for c in wrong) else ("ddq",)
        words = [WORDS[c] for c in gone if c in log.channels]
        kept.append(log.without(gone))
        hints.append(
            f"The {' and '.join(words)} of {log.name} were not used, but computed: "
            f"{listing([c.text for c in wrong], 2)}. Check the columns; --set derivatives=given "
            "(derivatives='given') uses them as they are."
        )
    return kept, tuple(hints)


def _compare(t: Array, x: Array, rate: Array) -> tuple[float, float] | None:
    """Return by how much the integral of a rate (N,) must be multiplied, and what it leaves.

    None if the motion does not stand out from the noise.
    """
    dt = np.diff(t)
    whole = dt < RULES.gap_kept * np.median(dt)
    given = np.cumsum(np.where(whole, np.diff(x), 0.0))
    integral = np.cumsum(np.where(whole, 0.5 * (rate[1:] + rate[:-1]) * dt, 0.0))
    # An offset of the rate is a drift of its integral, which says nothing of its shape.
    drift = np.column_stack([np.ones(len(dt)), t[1:] - t[0]])
    Q = np.linalg.qr(drift)[0]
    given, integral = given - Q @ (Q.T @ given), integral - Q @ (Q.T @ integral)
    noise = np.sqrt(np.mean(np.diff(x, 2) ** 2) / 6) if len(x) > 2 else 0.0
    size = float(np.sqrt(np.mean(given**2)))
    # Motion must stand out this much from the noise of single samples to be compared.
    if not size > 4.0 * noise or not size > 0:
        return None
    square = float(integral @ integral)
    slope = float(given @ integral) / square if square > 0 else 0.0
    left = given - slope * integral
    return slope, float(left @ left) / float(given @ given)
