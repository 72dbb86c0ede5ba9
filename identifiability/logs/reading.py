"""`Reading`: the first reading of a table, piece by piece: what is what, and whether it can be.

Columns may have rates of their own: merged topics leave cells empty, loggers repeat what they
know.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.findings import Finding
from identifiability.foundation.names import Array
from identifiability.logs import signals
from identifiability.logs.base import RawBase, find_base
from identifiability.logs.checks import Clock, Numbers, to_floats
from identifiability.logs.columns import Naming, as_times, name_columns, settle_time, start_of
from identifiability.logs.conventions import Conventions
from identifiability.logs.form import PLAIN, Form
from identifiability.logs.names import INDEX, Column, guess_column
from identifiability.logs.rules import RULES
from identifiability.logs.spikes import SpikeFinder, WrapFinder
from identifiability.robot.floating import BASE_JOINTS

if TYPE_CHECKING:
    import pandas as pd


# Columns at rates of their own: merged topics leave cells empty, loggers repeat what they know.
#
# Two messages seldom come at the same time. Merged into one table, each row has what came then; a
# logger that is faster than its sources writes the last values again and again. Both are brought
# to the times of the slowest of position and torque: positions and their derivatives by cubics
# through their own samples, torque on straight lines, which no friction step makes overshoot.


#: Values repeat in runs at least so long; what comes twice is recognised one by one (`stale`).
LEAST = 3


def unify_rates(values: Mapping[str, Array]) -> tuple[dict[str, Array], str]:
    """Return columns at the same times, and a note on what was done; none if nothing was.

    Parameters
    ----------
    values : mapping of str to (N,)
        ``t`` and columns of channels; NaN where a cell is empty.
    """
    known = {name: np.isfinite(x) for name, x in values.items() if name != "t"}
    if len(values["t"]) < RULES.fewest or (np.diff(values["t"]) < 0).any():
        return dict(values), ""
    empty = any((~rows).mean() > RULES.unexplained for rows in known.values())
    if not empty:
        held = {name: _fresh(rows) for name, rows in _by_channel(values).items()}
        known = {name: held[name.rpartition(".")[2]] for name in known}
        if all(rows.all() for rows in known.values()):
            return dict(values), ""
    t = values["t"]
    counts = {name: int(rows.sum()) for name, rows in known.items()}
    needed = [name for name in counts if name.endswith((".q", ".tau"))]
    slowest = min(needed, key=lambda name: counts[name])
    if counts[slowest] < RULES.fewest:
        return dict(values), ""
    # Velocities that come slower than positions by this factor are left out, and computed.
    kept = [n for n in counts if n in needed or 2.0 * counts[n] >= counts[slowest]]
    at = t[known[slowest]]
    out = {name: _resample(t[known[name]], values[name][known[name]], at, name) for name in kept}
    good = np.all([np.isfinite(x) for x in out.values()], axis=0)
    return {"t": at[good], **{name: x[good] for name, x in out.items()}}, _tell(
        known, slowest, [n for n in counts if n not in kept], held=not empty
    )


def _by_channel(values: Mapping[str, Array]) -> dict[str, Array]:
    """Return what a table has of each channel, (N, n)."""
    kinds = dict.fromkeys(name.rpartition(".")[2] for name in values if name != "t")
    return {
        kind: np.stack([x for name, x in values.items() if name.endswith(f".{kind}")], 1)
        for kind in kinds
    }


def _fresh(x: Array) -> np.ndarray:
    """Return which rows of a channel (N, n) hold new values, (N,) bool; all if they are not held.

    In a standstill of the values every so-manieth counts as new.
    """
    every = np.ones(len(x), bool)
    new = np.concatenate([[True], (np.diff(x, axis=0) != 0).any(1)])
    starts = np.flatnonzero(new)
    lengths = np.diff(starts)
    if len(lengths) < RULES.fewest:
        return every
    usual = int(np.median(lengths))
    if usual < LEAST or np.mean(np.abs(lengths - usual) <= 1) < RULES.nearly_all:
        return every
    since = np.arange(len(x)) - np.maximum.accumulate(np.where(new, np.arange(len(x)), 0))
    fresh: np.ndarray = since % usual == 0
    fresh[1:] &= new[1:] | (since[1:] >= 2 * usual)
    return fresh


def _resample(t: Array, x: Array, at: Array, name: str) -> Array:
    """Return a column sampled at t (m,) at other times; NaN beyond its ends and in its gaps."""
    if len(t) < RULES.fewest:
        return np.full(len(at), np.nan)
    right = np.clip(np.searchsorted(t, at), 1, len(t) - 1)
    inside = (at >= t[0]) & (at <= t[-1])
    # Nothing is put between samples of a column that lie farther apart than so many of its
    # steps.
    near = t[right] - t[right - 1] <= 2.5 * np.median(np.diff(t))
    found = np.interp(at, t, x) if name.endswith(".tau") else signals.cubic(at, t, x)
    exact = np.isin(at, t)
    return np.where(inside & (near | exact), found, np.nan)


def _tell(known: Mapping[str, np.ndarray], slowest: str, left: list[str], *, held: bool) -> str:
    """Return what was done, half a sentence."""
    counts = {name.rpartition(".")[2]: rows.sum() for name, rows in known.items()}
    rows = [f"{kind} in {count}" for kind, count in counts.items()]
    why = "values were written again until new ones came" if held else "cells are empty between"
    rest = f"; {', '.join(left)} came slower and were left out" if left else ""
    return (
        f"columns came at rates of their own ({listing(rows)} of {len(known[slowest])} rows; "
        f"{why}) and were brought to the times of {slowest}{rest}"
    )


def put_on_clock(
    t: Array, raw_t: Array, columns: Mapping[str, Array], discrete: Sequence[str]
) -> dict[str, Array]:
    """Return columns about a base at times t (N,).

    Flags are held until they change. All else is interpolated between its own samples, which are
    fewer than rows where cells are empty or values are written again until new ones come.

    Parameters
    ----------
    t, raw_t : (N,), (M,) [s]
        Times of the log, and of the rows that the columns have.
    columns : mapping of str to (M,)
        By the keys of `find_base`: those of a kind come together.
    discrete : sequence of str
        Those that are flags.
    """
    out: dict[str, Array] = {}
    for key, column in columns.items():
        known = np.isfinite(column)
        if key in discrete and known.any():
            last = np.searchsorted(raw_t[known], t, side="right") - 1
            out[key] = column[known][last.clip(0)]
        elif known.any():
            if known.all():
                known = _fresh(column[:, None])
            out[key] = np.interp(t, raw_t[known], column[known])
    return out


# `Reading`: the first reading of a table, piece by piece: what is what, and whether it can be.


def _gaps(x: Array) -> int:
    """Return the number of stretches in which a column (N,) is missing."""
    gone = np.isnan(x).astype(int)
    return int(gone[:1].sum() + (np.diff(gone) > 0).sum())


def with_index(frame: pd.DataFrame) -> pd.DataFrame:
    """Return a table with its index as a column where it may be the time."""
    index = frame.index
    name = INDEX if index.name is None else str(index.name)
    timed = index.nlevels == 1 and (index.dtype.kind in "fmM" or index.name is not None)
    if not timed or name in frame.columns or guess_column(name, name, ()) is None:
        return frame
    return frame.reset_index(names=name)


class Reading:
    """What the first reading of a table finds, piece by piece.

    Parameters
    ----------
    source : str
        What sentences call the table.
    known : Conventions
        What is known of it before.
    keep : bool
        Keep the values; else look for wrong ones in passing.

    Attributes
    ----------
    numbers : dict of str to Numbers
        The columns that a log is made of; in the end without commands that have gaps.
    finders : dict of str to SpikeFinder
        Of the columns that are not kept.
    turns : dict of str to WrapFinder
        Of the positions that are not kept.
    clock : Clock
    torque : bool
        Whether any torque is not zero.
    absent : list of str
        Columns of torque that a table lacks, of joints whose motion it has.
    beside : RawBase or None
        In the end, what the table says of a base that floats.
    start : float or None [s]
        As of a `Log`: what the times count from, by themselves or as the table says (``attrs``).
    """

    def __init__(self, source: str, known: Conventions, *, keep: bool = True) -> None:
        self.source, self.known, self.keep = source, known, keep
        self._naming, self._form = Naming((), ()), PLAIN
        self.start: float | None = None
        self.numbers: dict[str, Numbers] = {}
        self.finders: dict[str, SpikeFinder] = {}
        self.turns: dict[str, WrapFinder] = {}
        self.clock, self.torque = Clock(source), 0.0
        self._kept: dict[str, list[Array]] = {}
        self.absent: list[str] = []
        self._held: dict[str, tuple[float, float]] = {}
        self._last: pd.Series | None = None
        self._base: Mapping[str, str] = {}
        self._beside: dict[str, list[Array]] = {}
        self.beside: RawBase | None = None

    def add(self, frame: pd.DataFrame, form: Form = PLAIN) -> None:
        """Check the next rows.

        Parameters
        ----------
        frame : DataFrame
        form : Form
            How the table was written.

        Raises
        ------
        LogError
            If a column is missing, there twice, or of another kind altogether.
        """
        start = frame.attrs.get("start")
        frame = with_index(frame.set_axis([str(c) for c in frame.columns], axis=1))
        frame.attrs = {}  # pandas would copy them, deeply, with each column
        self._form = form
        if self.known.joints == BASE_JOINTS[:1]:  # of a body alone no column is about a joint
            frame = frame.assign(**{f"{BASE_JOINTS[0]}.{kind}": 0.0 for kind in ("q", "tau")})
        if not self._naming.columns:
            self._begin(frame)
            found = start_of(self._naming)
            self.start = start if found is None else found
        frame = self._hold_commands(frame)
        for key, column in self._base.items():
            self._beside.setdefault(key, []).append(to_floats(frame[column]))
        for held in self._naming.locked:
            self._follow_locked(held, frame[held.source])
        for own in self._naming.columns:
            self._keep_column(own, frame[own.source])
        for name in (*self.absent, *self.made) if self.keep else ():
            self._kept[name].append(np.full(len(frame), np.nan if name in self.absent else 0.0))

    def _keep_column(self, column: Column, given: pd.Series) -> None:
        """Check the next rows of a column."""
        name, numbers = column.name, self.numbers[column.name]
        if name == "t":
            values = numbers.add(as_times(given, column))
            if not numbers.bad:
                self.clock.add(values)
        else:
            values = column.scale(numbers.add(given))
        if name.endswith(".tau"):
            self.torque = max(self.torque, float(np.nanmax(np.abs(values), initial=0.0)))
        if self.keep or not self._kept[name]:  # else the first rows tell how values come
            self._kept[name].append(values)
        for finders in (self.finders, self.turns):
            if name in finders:
                finders[name].add(values)

    def _hold_commands(self, frame: pd.DataFrame) -> pd.DataFrame:
        """Return a table with the commands that stand for torque held until the next comes.

        Rows before the first command are left out.

        Raises
        ------
        LogError
        """
        sources = [c.source for c in self._naming.columns if c.name in self._naming.commands]
        if not sources:
            return frame
        if not self.keep:
            raise LogError(Finding("long.commands", self.source))
        held = frame[sources].apply(to_floats).ffill()
        held = held if self._last is None else held.fillna(self._last)
        self._last = held.iloc[-1] if len(held) else self._last
        return frame.assign(**{str(c): held[c] for c in held}).dropna(subset=sources)

    @property
    def made(self) -> tuple[str, ...]:
        """Torque for which zeros stand, where motion or commands are all that is read."""
        return self._naming.made

    @property
    def naming(self) -> Naming:
        """Which columns are which; empty before the first rows."""
        return replace(self._naming, notes=(*self._form.notes, *self._naming.notes))

    def _begin(self, frame: pd.DataFrame) -> None:
        """Decide which columns are which, by the first rows."""
        texts = [k for k, dtype in enumerate(frame.dtypes) if dtype.kind not in "biufcmM"]
        first = {frame.columns[k]: str(frame.iat[0, k]) for k in texts if len(frame)}
        columns = list(frame.columns)
        if self.known.base is not None:
            if not self.keep:
                raise LogError(Finding("long.base", self.source))
            self._base = find_base(columns, self.known.base, self.known.columns)
            columns = [c for c in columns if c not in self._base.values()]
        units = dict(zip(columns, self._form.units, strict=False))
        naming = name_columns(columns, self.source, self.known, units, first)
        naming = settle_time(naming, frame, self.source, self.known)
        self._naming = naming
        names = [c.name for c in naming.columns]
        self.numbers = {c: Numbers(c, self.source) for c in names}
        given = (*names, *naming.made)
        self.absent = [c for j in naming.joints if (c := f"{j}.tau") not in given]
        self._kept = {c: [] for c in (*given, *self.absent)}
        self.finders = {} if self.keep else {c: SpikeFinder() for c in names if c != "t"}
        self.turns = {c: WrapFinder() for c in self.finders if c.endswith(".q")}

    def _follow_locked(self, column: Column, given: pd.Series) -> None:
        """Follow where a joint is that is said not to move; single wrong values do not count."""
        values = column.scale(to_floats(given))
        values = values[np.isfinite(values)]
        if len(values):
            low, high = np.quantile(values, [0.01, 0.99])
            least, most = self._held.get(column.name, (np.inf, -np.inf))
            self._held[column.name] = min(least, float(low)), max(most, float(high))

    def _check_locked(self) -> None:
        """Refuse a lock that the positions contradict; say where the joint stands elsewhere.

        Raises
        ------
        LogError
        """
        notes = []
        for name, (low, high) in self._held.items():
            joint, at = name.removesuffix(".q"), 0.5 * (low + high)
            held = self.known.locked[joint]
            if high - low > RULES.small:
                raise LogError(
                    f"{self.source}: the joint '{joint}' is locked, but '{name}' moves by "
                    f"{high - low:.3g} ({low:.4g} … {high:.4g}); take the lock out, or give a "
                    "stretch of the log in which it stands still."
                )
            if abs(at - held) > RULES.small:
                notes.append(
                    f"'{joint}' stands at {at:.4g} and is locked at {held:.4g}: lock it there, "
                    f"--lock {joint}={at:.4g}"
                )
        self._naming = replace(self._naming, notes=(*self._naming.notes, *notes))

    def finish(self) -> dict[str, Array]:
        """Return the columns, each (N,), as far as they were kept.

        Raises
        ------
        LogError
            If a value cannot be, or the times are too few or do not increase.
        """
        self._check_locked()
        times = np.concatenate(self._kept["t"]) if self._beside else np.empty(0)
        if self.keep:
            self._unify()
        elif unify_rates({c: kept[0] for c, kept in self._kept.items() if kept})[1]:
            raise LogError(Finding("long.rates", self.source))
        gaps = [c for c, x in self.numbers.items() if c.endswith(".q_ref") and not x.usable]
        for column in gaps:  # before the first command there is none
            del self.numbers[column], self._kept[column]
        columns = tuple(c for c in self._naming.columns if c.name not in gaps)
        self._naming = replace(self._naming, columns=columns)
        lost = [c for c, x in self.numbers.items() if c.endswith(".tau") and x.lost]
        if len(lost) + len(self.absent) == len(self._naming.joints) and all(
            self.numbers[c].bad == self.numbers[c].rows for c in lost
        ):
            raise LogError(Finding("torque.none", self.source))
        # All torque of a log is not smaller: a hundredth of a milligram at a millimetre.
        if 0 < self.torque < 1e-09:
            raise LogError(Finding("torque.small", self.source, torque=self.torque))
        if not self.keep and (lost or self.absent):
            raise LogError(Finding("long.torque", self.source, columns=[*lost, *self.absent]))
        for column, numbers in self.numbers.items():
            if column not in lost:
                numbers.finish()
        self.clock.finish()
        values = {c: np.concatenate(kept) for c, kept in self._kept.items() if kept}
        if self.known.base is not None:
            raw = {key: np.concatenate(x) for key, x in self._beside.items()}
            flags = [c.flag for c in self.known.base.contacts]
            self.beside = RawBase(values["t"], put_on_clock(values["t"], times, raw, flags))
        return values

    def _unify(self) -> None:
        """Bring columns at rates of their own to the same times, if all that is wrong is that."""
        if self.numbers["t"].bad or not all(x.clean for x in self.numbers.values()):
            return
        values = {c: np.concatenate(kept) for c, kept in self._kept.items()}
        # Torque that is missing for a while, or altogether, comes at no rate of its own.
        gone = {c for c, x in values.items() if c.endswith(".tau") and 2 * _gaps(x) < RULES.fewest}
        gone = {c for c in gone if np.isnan(values[c]).any()}
        kept = {*gone, *self._naming.commands}  # commands are held, whatever comes between
        found, note = unify_rates({c: x for c, x in values.items() if c not in kept})
        if not note:
            return
        near = np.searchsorted(values["t"], found["t"]).clip(0, len(values["t"]) - 1)
        found |= {c: values[c][near] for c in gone}
        last = np.searchsorted(values["t"], found["t"], side="right") - 1
        found |= {c: values[c][last.clip(0)] for c in self._naming.commands}
        self.numbers = {c: Numbers(c, self.source) for c in found}
        self._kept = {c: [x] for c, x in found.items()}
        columns = tuple(c for c in self._naming.columns if c.name in found)
        self._naming = replace(self._naming, columns=columns, notes=(*self._naming.notes, note))
        self.clock = Clock(self.source)
        self.clock.add(found["t"])
