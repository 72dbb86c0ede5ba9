"""Columns at rates of their own: merged topics leave cells empty, loggers repeat what they know.

Two messages seldom come at the same time. Merged into one table, each row has what came then; a
logger that is faster than its sources writes the last values again and again. Both are brought to
the times of the slowest of position and torque: positions and their derivatives by cubics through
their own samples, torque on straight lines, which no friction step makes overshoot.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identifiability.foundation.names import Array
from identifiability.logs.checks import FEWEST

#: A column that lacks less than this share of the rows has broken rows, not another rate.
LACKING = 0.2

#: Values repeat in runs of about equal length, at least so long: so many of the runs have the usual
#: length up to one sample. Those that come twice are recognised one by one (`stale`).
LEAST, ALIKE = 3, 0.9

#: Nothing is put between samples of a column that lie farther apart than so many of its steps.
FAR = 2.5

#: Velocities that come slower than positions by this factor are left out, and computed.
SLOWER = 2.0


def unify_rates(values: Mapping[str, Array]) -> tuple[dict[str, Array], str]:
    """Return columns at the same times, and a note on what was done; none if nothing was.

    Parameters
    ----------
    values : mapping of str to (N,)
        ``t`` and columns of channels; NaN where a cell is empty.
    """
    known = {name: np.isfinite(x) for name, x in values.items() if name != "t"}
    if len(values["t"]) < FEWEST or (np.diff(values["t"]) < 0).any():
        return dict(values), ""
    empty = any((~rows).mean() > LACKING for rows in known.values())
    if not empty:
        held = {name: _fresh(rows) for name, rows in _by_channel(values).items()}
        known = {name: held[name.rpartition(".")[2]] for name in known}
        if all(rows.all() for rows in known.values()):
            return dict(values), ""
    t = values["t"]
    counts = {name: int(rows.sum()) for name, rows in known.items()}
    needed = [name for name in counts if name.endswith((".q", ".tau"))]
    slowest = min(needed, key=lambda name: counts[name])
    if counts[slowest] < FEWEST:
        return dict(values), ""
    kept = [n for n in counts if n in needed or SLOWER * counts[n] >= counts[slowest]]
    at = t[known[slowest]]
    out = {name: _resample(t[known[name]], values[name][known[name]], at, name) for name in kept}
    good = np.all([np.isfinite(x) for x in out.values()], axis=0)
    return {"t": at[good], **{name: x[good] for name, x in out.items()}}, _tell(
        t, known, slowest, [n for n in counts if n not in kept], held=not empty
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
    if len(lengths) < FEWEST:
        return every
    usual = int(np.median(lengths))
    if usual < LEAST or np.mean(np.abs(lengths - usual) <= 1) < ALIKE:
        return every
    since = np.arange(len(x)) - np.maximum.accumulate(np.where(new, np.arange(len(x)), 0))
    fresh: np.ndarray = since % usual == 0
    fresh[1:] &= new[1:] | (since[1:] >= 2 * usual)
    return fresh


def _resample(t: Array, x: Array, at: Array, name: str) -> Array:
    """Return a column sampled at t (m,) at other times; NaN beyond its ends and in its gaps."""
    if len(t) < FEWEST:
        return np.full(len(at), np.nan)
    right = np.clip(np.searchsorted(t, at), 1, len(t) - 1)
    inside = (at >= t[0]) & (at <= t[-1])
    near = t[right] - t[right - 1] <= FAR * np.median(np.diff(t))
    if name.endswith(".tau"):
        found = np.interp(at, t, x)
    else:
        start = np.clip(right - 2, 0, len(t) - 4)
        nodes = start[:, None] + np.arange(4)
        found = np.zeros(len(at))
        for k in range(4):
            others = t[np.delete(nodes, k, axis=1)]
            own = t[nodes[:, k]][:, None]
            found += np.prod((at[:, None] - others) / (own - others), axis=1) * x[nodes[:, k]]
    exact = np.isin(at, t)
    return np.where(inside & (near | exact), found, np.nan)


def _tell(
    t: Array, known: Mapping[str, np.ndarray], slowest: str, left: list[str], *, held: bool
) -> str:
    """Return what was done, half a sentence."""
    kinds = {name.rpartition(".")[2]: rows for name, rows in known.items()}
    rates = [f"{kind} {1 / np.median(np.diff(t[rows])):.3g} Hz" for kind, rows in kinds.items()]
    why = "values were written again until new ones came" if held else "cells are empty between"
    rest = f"; {', '.join(left)} came slower and were left out" if left else ""
    return (
        f"columns came at rates of their own ({', '.join(rates)}; {why}) and were brought to the "
        f"times of {slowest}{rest}"
    )
