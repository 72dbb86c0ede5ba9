"""The low-pass of computed derivatives: does it cut the motion, let noise in, do values follow it?

The model is fitted again, as it was, at half and at double the cut-off. Where the band is right,
little changes: a value moves by what the rows that were added or lost knew of it [Hausman 1978].
Where noise, flexibility or the motion itself lie at the edge of the band, values follow the
cut-off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from identifiability.estimation.estimate import settle_noise
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.verdict import Class
from identifiability.foundation.errors import IdentifiabilityError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.logs.prepare import Preparation, prepare_samples
from identifiability.logs.prepare.preparation import SettledPreparation
from identifiability.logs.repeats import Recording
from identifiability.logs.spectrum import NARROW, Band
from identifiability.regression.gather import gather_information
from identifiability.workflows.analyze.assessment import RungResult
from identifiability.workflows.band import enough_samples, settle_band
from identifiability.workflows.instruments import follow
from identifiability.workflows.opening import Opening, Recordings
from identifiability.workflows.session import weigh_rows

#: Multiples of the cut-off that are tried.
FACTORS = (0.5, 2.0)

#: Windows in which samples lie that are fitted again, where logs are longer.
WINDOWS = 4

#: A move must also be this many times its own standard deviation: there are many parameters.
SURE = 4.0

#: A cut-off below so many times the band of the motion cuts into it.
INSIDE = 2.0

#: Noise with a larger share of an acceleration's power is said. On one period of a motion
#: intervals hold up to three tenths (`studies/cutoff.py`).
LOUD = 0.2

#: Parameters that a hint names.
NAMED = 3


def check_cutoff(
    opening: Opening, recordings: Recordings, result: RungResult, how: Preparation
) -> tuple[str, ...]:
    """Return what to say of the cut-off: of what it lets through, and of what follows it.

    Parameters
    ----------
    opening : Opening
    recordings : Recordings
        What its samples were prepared from.
    result : RungResult
        The model whose values are looked at.
    how : Preparation
        With the cut-off for all logs.
    """
    if not isinstance(how, SettledPreparation) or how.band is None:
        return ()
    held = settle_band(opening.structure, recordings.held, how)
    seen = held.band if isinstance(held, SettledPreparation) else None
    names = " and ".join(log.name for log in recordings.held)
    unseen = _say_cut(seen, names) if seen and not _say_cut(how.band, "") else ""
    varied = vary_cutoff(opening, recordings.fitted, result, how)
    return (*say_band(how), *filter(None, (unseen, varied)))


def say_band(how: Preparation | None) -> tuple[str, ...]:
    """Return what to say of the cut-off for all logs: does it cut the motion, let noise in?"""
    band = how.band if isinstance(how, SettledPreparation) else None
    found = () if band is None else (_say_cut(band, "the logs"), _say_noise(band))
    return tuple(filter(None, found))


def _say_cut(band: Band, whose: str) -> str:
    """Return one sentence on a cut-off in the band of the motion, or nothing."""
    if band.cutoff >= INSIDE * band.bandwidth:
        return ""
    return (
        f"The cut-off of {band.cutoff:.3g} Hz cuts into the motion of {whose}, which reaches "
        f"{band.bandwidth:.3g} Hz: accelerations are missing, and values are wrong; set it to "
        f"{NARROW * band.bandwidth:.2g} Hz or more (--cutoff)."
    )


def _say_noise(band: Band) -> str:
    """Return one sentence on noise below the cut-off, or nothing."""
    if band.noise <= LOUD:
        return ""
    remedy = "measure velocities, or let the robot accelerate more"
    if band.limit < 0.9 * band.cutoff:
        remedy = f"set it to {band.limit:.2g} Hz (--cutoff), {remedy}"
    return (
        f"Noise of what is differentiated has {100 * min(band.noise, 1.0):.0f} % of the power of "
        f"an acceleration below the cut-off of {band.cutoff:.3g} Hz, which pulls inertias towards "
        f"zero: {remedy}."
    )


def vary_cutoff(
    opening: Opening, logs: Sequence[Recording], result: RungResult, how: SettledPreparation
) -> str:
    """Return one sentence on identifiable values that follow the cut-off, or nothing.

    Where noise is small up to the cut-off but not up to double of it, values may follow it there:
    then only half of it says something.
    """
    known = np.array([v.verdict is Class.IDENTIFIABLE for v in result.verdicts])
    cutoffs, structure = [s.cutoff for s in opening.samples], opening.structure
    if not known.any() or None in cutoffs:
        return ""
    windows = _windows([len(log) for log in logs], enough_samples(structure.robot))

    def refit(factor: float) -> Estimate | None:
        cut = [replace(how, cutoff=factor * (cutoffs[k] or np.inf)) for k, _, _ in windows]
        try:
            samples = tuple(
                prepare_samples(structure.robot, logs[k].rows(a, b), at)
                for (k, a, b), at in zip(windows, cut, strict=True)
            )
        except IdentifiabilityError:  # nothing is left of one at such a cut-off
            return None
        parts = [(logs[k].rows(a, b), s) for (k, a, b), s in zip(windows, samples, strict=True)]
        own = result.estimate.estimator
        again = gather_information(structure.regression(follow(own, structure.robot, parts)))
        again = weigh_rows(structure.robot.joints, samples, again, own)[0]
        return settle_noise(own, again).fit(result.rung.reduce(again))

    whole = sum(b - a for _, a, b in windows) == sum(len(log) for log in logs)
    base = result.estimate if whole else refit(1.0)
    if base is None:
        return ""
    found = []
    b = how.band
    silent = b is not None and b.cutoff <= b.limit
    for factor in FACTORS:
        if b is not None and silent and factor * b.cutoff > b.limit:
            continue
        other = refit(factor)
        if other is None:
            continue
        moved = _moves(result, base, other)
        at = np.flatnonzero(known & (np.abs(moved) > 0))
        if len(at):
            band = " … ".join(sorted({f"{factor * (c or 0.0):.3g}" for c in cutoffs}, key=float))
            order = at[np.argsort(-moved[at])]
            names = (f"{result.rung.columns[k]} by {moved[k]:.2g} σ" for k in order)
            found.append(f"{listing(names, NAMED)} at {band} Hz")
    if not found:
        return ""
    now = " … ".join(sorted({f"{c:.3g}" for c in cutoffs if c is not None}, key=float))
    return (
        f"Identifiable values follow the cut-off of {now} Hz and leave their intervals: "
        f"{'; '.join(found)}. Set it from the band of the motion (--cutoff) and use what stays."
    )


def _moves(result: RungResult, base: Estimate, other: Estimate) -> Array:
    """Return by how many robust σ values move, (k,); 0 where that is within what it may be."""
    robust = np.asarray(result.uncertainty.robust, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        # White formulas miss what the residual remembers; and of fewer rows less is known.
        wider = np.maximum(robust / result.estimate.sigma, 1.0)
        fewer = np.maximum(base.sigma / result.estimate.sigma, 1.0)
        chance = wider * np.sqrt(np.abs(other.sigma**2 - base.sigma**2))
        move = np.abs(other.value - base.value)
        beyond = (move > REACH * fewer * robust) & (move > SURE * chance)
        sizes: Array = np.where(beyond & base.determined & other.determined, move / robust, 0.0)
    if other.correction is not None:  # there noise was not mended, which says nothing of the band
        sizes[[c in other.correction.touched for c in other.columns]] = 0.0
    return sizes


def _windows(lengths: Sequence[int], enough: int) -> list[tuple[int, int, int]]:
    """Return log, first and last (exclusive) row of what is fitted again: all, or evenly spaced."""
    if sum(lengths) <= enough:
        return [(k, 0, length) for k, length in enumerate(lengths)]
    pieces = []
    for k, length in enumerate(lengths):
        edges = np.linspace(0, length, -(-length * WINDOWS // enough) + 1).astype(int).tolist()
        pieces += [(k, a, b) for a, b in pairwise(edges)]
    return pieces[:: -(-sum(lengths) // enough)]
