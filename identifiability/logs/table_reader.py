"""`TableReader`: reads a table piece by piece, and identifies its columns.

Columns may have different rates. Merged topics leave cells empty, and loggers repeat the last
value.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import Polynomial

from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array, ArrayByName
from identifiability.foundation.quoting import option_for_shell
from identifiability.robot.floating import BASE_JOINTS

from . import signals
from .base import HELD, find_base
from .checks import CHANNELS, MOTIONS, MOTOR, Clock, Numbers, to_floats
from .columns import (
    DEGREE,
    Naming,
    as_times,
    is_stamp,
    name_columns,
    rename,
    resolve_codes,
    resolve_time,
    start_of,
)
from .conventions import Conventions
from .form import PLAIN, Form
from .formats.reader import Whole
from .long_tables import unstack
from .names import INDEX, check_names, guess_column
from .rows import WINDOW, divide_rows, gather, is_long
from .rules import RULES

if TYPE_CHECKING:
    import pandas as pd


# Columns with different rates: merged topics leave cells empty, loggers repeat the last value.
#
# Two messages seldom come at the same time. A merged table has in each row the values that arrived
# then. A logger that is faster than its sources repeats the last values. Both are resampled at the
# times of the slowest of position and torque. Positions and their derivatives are interpolated by
# cubics. Torque is interpolated linearly, which does not overshoot at friction steps.


#: Shortest usual run of repeated values; values that come twice are recognised one by one
#: (`stale`).
LEAST = 3


def unify_rates(values: ArrayByName) -> tuple[dict[str, Array], str]:
    """Return columns at the same times, and a note on the changes; empty if there were none.

    Parameters
    ----------
    values : mapping of str to (N,)
        ``t`` and columns of channels; NaN for empty cells.
    """
    known = {name: np.isfinite(x) for name, x in values.items() if name != "t"}
    t = values["t"]
    same = (dict(values), "")
    if len(t) < RULES.fewest or (np.diff(t) < 0).any():
        return same
    why = "cells are empty between"
    if all((~rows).mean() <= RULES.unexplained for rows in known.values()):
        why = "values were written again until new ones came"
        for kind in {name.rpartition(".")[2] for name in known}:
            own = [name for name in known if name.endswith(f".{kind}")]
            columns = [values[name] for name in own]
            known |= dict.fromkeys(own, _fresh(np.stack(columns, 1)))
        if all(rows.all() for rows in known.values()):
            return same
    counts = {name: int(rows.sum()) for name, rows in known.items()}
    needed = [name for name in counts if name.endswith((".q", ".tau"))]
    slowest = min(needed, key=lambda name: counts[name])
    if counts[slowest] < RULES.fewest:
        return same
    # Velocities that are slower than positions by this factor are left out, and computed.
    kept = [n for n in counts if n in needed or 2.0 * counts[n] >= counts[slowest]]
    at = t[known[slowest]]
    out = {name: _resample(t[known[name]], values[name][known[name]], at, name) for name in kept}
    good = np.all([np.isfinite(x) for x in out.values()], axis=0)
    each = {name.rpartition(".")[2]: f"{count}" for name, count in counts.items()}
    rows = listing([f"{kind} in {count}" for kind, count in each.items()])
    left = ", ".join(n for n in counts if n not in kept)
    return {"t": at[good], **{name: x[good] for name, x in out.items()}}, (
        f"columns came at rates of their own ({rows} of {len(t)} rows; {why}) and were brought to "
        f"the times of {slowest}{f'; {left} came slower and were left out' if left else ''}"
    )


def _fresh(x: Array) -> Array:
    """Return a mask of rows of a channel (N, n) with new values, (N,); all if values are not held.

    If values stay constant, one row for each usual interval counts as new.
    """
    every = np.ones(len(x), bool)
    changes = (np.diff(x, axis=0) != 0).any(1)
    new = np.concatenate([[True], changes])
    starts = np.flatnonzero(new)
    lengths = np.diff(starts)
    if len(lengths) < RULES.fewest:
        return every
    usual = int(np.median(lengths))
    if usual < LEAST or np.mean(np.abs(lengths - usual) <= 1) < RULES.nearly_all:
        return every
    rows = np.arange(len(x))
    since = rows - np.maximum.accumulate(
        np.where(
            new,
            np.arange(len(x)),
            0,
        )
    )
    fresh = since % usual == 0
    fresh[1:] &= new[1:] | (since[1:] >= 2 * usual)
    return fresh


def _resample(t: Array, x: Array, at: Array, name: str) -> Array:
    """Return a column sampled at t (m,) at other times; NaN beyond its ends and in its gaps."""
    if len(t) < RULES.fewest:
        return np.full(len(at), np.nan)
    right = np.clip(np.searchsorted(t, at), 1, len(t) - 1)
    inside = (at >= t[0]) & (at <= t[-1])
    # Samples of a column that are farther apart than this many of its steps are not interpolated.
    near = t[right] - t[right - 1] <= 2.5 * np.median(np.diff(t))
    found = np.interp(at, t, x) if name.endswith(".tau") else signals.cubic(at, t, x)
    exact = np.isin(at, t)
    return np.where(inside & (near | exact), found, np.nan)


# `TableReader`: reads a table piece by piece, and identifies its columns.


def with_index(frame: pd.DataFrame) -> pd.DataFrame:
    """Return a table with its index as a column, if that may be the time."""
    index = frame.index
    name = INDEX if index.name is None else str(index.name)
    timed = index.nlevels == 1 and (index.dtype.kind in "fmM" or index.name is not None)
    if not timed or name in frame.columns or guess_column(name, name, ()) is None:
        return frame
    return frame.reset_index(names=name)


def _as_tables(pieces: Iterable[Whole], source: str) -> Iterator[Whole]:
    """Yield tables with texts for names, their index among the columns if it may be the time.

    Raises
    ------
    LogError
        If one has more columns or longer names than a log has.
    """
    for frame, form, digest in pieces:
        names = [str(c) for c in frame.columns]
        check_names(source, names)
        table = with_index(frame.set_axis(names, axis=1))
        table.attrs = {"start": frame.attrs.get("start")}
        yield table, form, digest


class TableReader:
    """Collects the data of a table, piece by piece.

    Parameters
    ----------
    source : str
        Name of the table in messages.
    known : Conventions
        Known facts on its columns.

    Attributes
    ----------
    naming : Naming
        Assignment of the columns; empty before the first rows.
    sha256 : str
        Hash of the whole table.
    beside : mapping of str to (N,)
        At the end, the table's data on a floating base, by the keys of `find_base`. Data at other
        times are interpolated linearly at the times of the log.
    start : float or None [s]
        Origin of the times, as in a `Log`, from the times or from the table's ``attrs``.
    """

    def __init__(self, source: str, known: Conventions) -> None:
        self.source = source
        self.known = known
        self.sha256 = ""
        self.naming = Naming((), ())
        self._form = PLAIN
        self.start: float | None = None
        self._numbers: dict[str, Numbers] = {}
        self._lacks: dict[str, float] = {}
        self._last: pd.Series | None = None
        self._base: Mapping[str, str] = {}
        self.beside: dict[str, Array] = {}

    def read(self, pieces: Iterable[Whole]) -> dict[str, Array]:
        """Return times (N,) and the channels (N, n) that every joint has.

        Raises
        ------
        LogError
            If a column is missing, repeated or of another kind, a value is impossible, or the times
            are too few or do not increase.
        """
        tables = unstack(_as_tables(pieces, self.source), self.known, self.source)
        values = gather(self._take(*piece) for piece in tables)
        locked = {c.joint: values.pop(f"locked {c.joint}") for c in self.naming.locked}
        notes = [*self._form.notes, *self.naming.notes, *self._check_locked(locked)]
        raw = {key: values.pop(key) for key in self._base}
        times = values["t"]
        values, note = self._unify(values)
        if note:
            notes += [note]
        self.naming = replace(self.naming, notes=tuple(notes))
        if any(not x.usable for c, x in self._numbers.items() if c.endswith(".q_ref")):
            values.pop("q_ref", None)  # no command before the first one
        self._check(values)
        if self._base:
            known = {key: np.isfinite(x) for key, x in raw.items()}
            self.beside = {
                key: np.interp(values["t"], times[some], raw[key][some])
                for key, some in known.items()
                if some.any()
            }
        return values

    def _take(self, frame: pd.DataFrame, form: Form, digest: str) -> dict[str, Array]:
        """Return the arrays of the next rows, with checks of each value."""
        start = frame.attrs.get("start")
        frame.attrs = {}  # pandas would copy them, deeply, with each column
        self._form = form
        self.sha256 = digest
        if self.known.joints == BASE_JOINTS[:1]:  # of a body alone no column is about a joint
            frame = frame.assign(**{f"{BASE_JOINTS[0]}.{kind}": 0.0 for kind in ("q", "tau")})
        frame = add_lengths(frame, self.known)
        if not self.naming.columns:
            self._begin(frame)
            found = start_of(self.naming)
            self.start = start if found is None else found
        frame = self._hold_commands(frame)
        out = {key: to_floats(frame[column]) for key, column in self._base.items()}
        out |= {
            f"locked {c.joint}": c.scale(to_floats(frame[c.source])) for c in self.naming.locked
        }
        columns = {c: np.full(len(frame), x) for c, x in self._lacks.items()}
        for c in self.naming.columns:
            given = frame[c.source]
            numbers = self._numbers[c.name]
            columns[c.name] = (
                numbers.add(as_times(given, c)) if c.name == "t" else c.scale(numbers.add(given))
            )
        columns |= move_motors(columns, self.known)
        return out | stack_channels(self.naming.joints, columns)

    def _hold_commands(self, frame: pd.DataFrame) -> pd.DataFrame:
        """Return a table in which commands that replace torque are held until the next one.

        Rows before the first command are left out.
        """
        sources = [c.source for c in self.naming.columns if c.name in self.naming.commands]
        if not sources:
            return frame
        held = frame[sources].apply(to_floats).ffill()
        held = held if self._last is None else held.fillna(self._last)
        self._last = held.iloc[-1] if len(held) else self._last
        commands = {str(c): held[c] for c in held}
        return frame.assign(**commands).dropna(subset=sources)

    def _begin(self, frame: pd.DataFrame) -> None:
        """Assign the columns by the first rows."""
        texts = [k for k, dtype in enumerate(frame.dtypes) if dtype.kind not in "biufcmM"]
        first = {frame.columns[k]: str(frame.iat[0, k]) for k in texts if len(frame)}
        columns = list(frame.columns)
        base = HELD if self.known.is_held else self.known.base
        if base is not None:
            self._base = find_base(columns, base, self.known.columns)
            columns = [c for c in columns if c not in self._base.values()]
        units = dict(zip(columns, self._form.units, strict=False))
        # Stamps that were never set begin with zero.
        unset = [c for c in columns if is_stamp(c) and (to_floats(frame[c][:1]) == 0.0).any()]
        columns = [c for c in columns if c not in unset]
        naming = name_columns(columns, self.source, self.known, units, first)
        if naming.commands and self.known.as_listed != self.known.joints:
            every = [naming]
            for by_file in ((True, False), (False, True)):
                other = replace(self.known, by_file=by_file)
                with suppress(LogError):  # numbers in names of joints may contradict this order
                    every.append(name_columns(columns, self.source, other, units, first))
            naming = min(every, key=partial(_distance_to_commands, frame))
        naming = resolve_codes(naming, frame, self.known)
        commands = [c for c in naming.columns if c.kind == "q_ref" and c.name in naming.commands]
        empty = [c.name for c in commands if np.isnan(to_floats(frame[c.source])).all()]
        naming = naming.without_commands(empty)
        self.naming = resolve_time(naming, frame, self.source, self.known)
        self._numbers = {c.name: Numbers(c.name, self.source) for c in self.naming.columns}
        torque = {f"{j}.tau": np.nan for j in naming.joints} | dict.fromkeys(naming.made, 0.0)
        both = [j for j in naming.joints if self.known.torque.side_of(j) == "both"]
        for kind in MOTOR:
            if both and all(f"{j}.{kind}" in self._numbers for j in both):
                torque |= {f"{j}.{kind}": 0.0 for j in naming.joints}  # of the others it is no data
        self._lacks = {c: x for c, x in torque.items() if c not in self._numbers}

    def _check_locked(self, locked: ArrayByName) -> Iterator[str]:
        """Refuse a lock that contradicts the positions, and report where the joint stands.

        Raises
        ------
        LogError
        """
        for joint, x in locked.items():
            known = x[np.isfinite(x)]
            if not len(known):
                continue
            low, high = np.quantile(known, [0.01, 0.99])  # single wrong values do not count
            at = 0.5 * (low + high)
            held = self.known.locked[joint]
            if high - low > RULES.small:
                raise LogError(
                    f"{self.source}: the joint '{joint}' is locked, but '{joint}.q' moves by "
                    f"{high - low:.3g} ({low:.4g} … {high:.4g}); take the lock out, or give a "
                    "stretch of the log in which it stands still."
                )
            if abs(at - held) > RULES.small:
                lock = option_for_shell("--lock", f"{joint}={at:.4g}")
                yield (
                    f"'{joint}' stands at {at:.4g} and is locked at {held:.4g}: "
                    f"lock it there, {lock}"
                )

    def _check(self, values: ArrayByName) -> None:
        """Refuse impossible values."""
        numbers = self._numbers
        torques = [x for c, x in numbers.items() if c.endswith(".tau")]
        if torques and all(x.lost and x.bad == x.rows for x in torques):
            raise LogError(Finding("torque.none", self.source))
        parts = (values["tau"][a:b] for a, b in divide_rows(len(values["t"])))
        largest = max(float(np.nanmax(np.abs(x), initial=0.0)) for x in parts)
        # All torque of a log is not smaller: a hundredth of a milligram at a millimetre.
        if 0 < largest < 1e-09:
            raise LogError(Finding("torque.small", self.source, torque=largest))
        for column, x in numbers.items():
            if not (column.endswith(".q_ref") or (column.endswith(".tau") and x.lost)):
                x.finish()
        Clock.of(values["t"]).check(self.source)

    def _unify(self, values: dict[str, Array]) -> tuple[dict[str, Array], str]:
        """Bring columns with different rates to the same times, if that alone makes cells empty."""
        if self._numbers["t"].bad or not all(x.clean for x in self._numbers.values()):
            return values, ""
        joints = self.naming.joints
        t = values["t"]
        every = {
            f"{j}.{c}": x[:, k]
            for c, x in values.items()
            if c in CHANNELS
            for k, j in enumerate(joints)
        }
        for few in [WINDOW] * is_long(len(t)) + [len(t)]:  # the first rows of a long log decide
            columns = {c: x[:few] for c, x in every.items()}
            # Torque that is missing for a while, or entirely, has no separate rate.
            lost = {c: np.isnan(x) for c, x in columns.items() if c.endswith(".tau")}
            ends = {c: np.count_nonzero(np.diff(x, prepend=False)) for c, x in lost.items()}
            gone = {c for c, x in lost.items() if x.any() and ends[c] < RULES.fewest}
            kept = {*gone, *self.naming.commands}  # commands are held, whatever comes between
            own = {c: x for c, x in columns.items() if c not in kept}
            found, note = unify_rates({"t": t[:few]} | own)
            if not note:
                return values, ""
        at = found["t"]
        near = np.searchsorted(t, at).clip(0, len(t) - 1)
        last = (np.searchsorted(t, at, side="right") - 1).clip(0)
        found |= {c: every[c][near] for c in gone}
        found |= {c: every[c][last] for c in self.naming.commands}
        self._numbers = {}
        return stack_channels(joints, found), note


def _distance_to_commands(frame: pd.DataFrame, naming: Naming) -> float:
    """Return the mean square of positions about their commands in a table."""
    columns = {c.name: c.scale(to_floats(frame[c.source])) for c in naming.columns if c.name != "t"}
    pairs = [(columns[c], columns.get(c.removesuffix("_ref"), 0.0)) for c in naming.commands]
    apart = np.nan_to_num([command - q for command, q in pairs])
    return float(np.mean(apart**2))


def add_lengths(frame: pd.DataFrame, known: Conventions) -> pd.DataFrame:
    """Return a table with positions of tendons, if it has those of their joints instead."""
    if not known.lengths:
        return frame
    names = _number_positions(frame, known)
    names |= {rename(column.strip(), known): column for column in frame.columns}
    more = {}
    for tendon, along in known.lengths.items():
        sources = {joint: names.get(f"{joint}.q") for joint in along.terms}
        if f"{tendon}.q" in names or None in sources.values():
            continue
        unit = DEGREE if tendon in known.degrees else 1.0
        length = np.full(len(frame), along.constant)
        for joint, powers in along.terms.items():
            length += Polynomial(powers)(unit * to_floats(frame[sources[joint]]))
        more[f"{tendon}.q"] = length / unit
    return frame.assign(**more) if more else frame


def _number_positions(frame: pd.DataFrame, known: Conventions) -> dict[str, str]:
    """Return numbered columns of positions by the joints of the file, if there are as many."""
    guesses = (guess_column(column, column, ()) for column in frame.columns)
    numbered = sorted((g.number, g.source) for g in guesses if g and g.kind == "q")
    pairs = zip(known.listed, numbered, strict=False)
    return {f"{j}.q": c for j, (_, c) in pairs} if len(numbered) == len(known.listed) else {}


def move_motors(columns: ArrayByName, known: Conventions) -> dict[str, Array]:
    """Return the motion of coupled motors by that of the joints, if columns hold only this."""
    gear = known.gear
    found = dict[str, Array]()
    for kind in MOTIONS:
        of_joints = [f"{j}.{kind}" for j in known.joints]
        of_motors = [f"{m}.{kind}" for m in known.motors]
        if gear is None or columns.keys() >= {*of_motors} or not columns.keys() >= {*of_joints}:
            continue
        zero = gear.offset if kind == "q" else 0.0
        moved = gear.motor_rate(np.stack([columns[c] for c in of_joints], axis=1) - zero)
        found |= zip(of_motors, moved.T, strict=True)
    return found


def stack_channels(joints: Sequence[str], columns: ArrayByName) -> dict[str, Array]:
    """Return times, and the channels (N, n) that columns (N,) hold for every joint."""
    kinds = [c for c in CHANNELS if all(f"{j}.{c}" in columns for j in joints)]
    stacked = {c: np.stack([columns[f"{j}.{c}"] for j in joints]).T for c in kinds}
    return {"t": columns["t"], **stacked}
