"""The low-pass of computed derivatives: do values depend on it, and were logs judged in one band?

The model is fitted again at half and at double the cut-off. Where the band is right, little
changes: a value moves by what the rows that were added or lost knew of it [Hausman 1978]. Where
noise, flexibility or the motion itself lie at the edge of the band, values follow the cut-off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from identifiability.estimation.estimator import Estimate
from identifiability.estimation.verdict import Class
from identifiability.foundation.errors import IdentifiabilityError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.shares import REACH
from identifiability.logs.prepare import Preparation, prepare_samples
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.logs.repeats import Recording
from identifiability.regression.gather import gather_information
from identifiability.regression.regression import Regression
from identifiability.workflows.analyze.assessment import RungResult
from identifiability.workflows.opening import Opening, Recordings

#: Multiples of the cut-off that are tried.
FACTORS = (0.5, 2.0)

#: Rows that are fitted again, over all logs, and windows that they lie in where logs are longer.
ENOUGH, WINDOWS = 16_384, 4

#: A move must also be this many times its own standard deviation: there are many parameters.
SURE = 4.0

#: Cut-offs of logs that differ by more than this factor are said.
APART = 1.5

#: Parameters that a hint names.
NAMED = 3


def check_cutoff(
    opening: Opening, recordings: Recordings, result: RungResult, how: Preparation | None
) -> tuple[str, ...]:
    """Return what to say of the cut-offs: of all logs together, and of what follows them.

    Parameters
    ----------
    opening : Opening
    recordings : Recordings
        What its samples were prepared from.
    result : RungResult
        The model whose values are looked at.
    how
        As in `analyze`.
    """
    bands = compare_bands((*opening.samples, *opening.validation))
    varied = vary_cutoff(opening.regression, recordings.fitted, result, how or Preparation())
    return tuple(filter(None, (bands, varied)))


def compare_bands(samples: Sequence[Prepared]) -> str:
    """Return one sentence on logs whose cut-offs are far apart, or nothing."""
    found = [(s.cutoff, s.name) for s in samples if s.cutoff is not None]
    if not found:
        return ""
    (low, first), (high, last) = min(found), max(found)
    if high <= APART * low:
        return ""
    return (
        f"The logs were judged in different bands, with cut-offs from {low:.3g} Hz ({first}) to "
        f"{high:.3g} Hz ({last}): give one that suits them all (--cutoff)."
    )


def vary_cutoff(
    regression: Regression, logs: Sequence[Recording], result: RungResult, how: Preparation
) -> str:
    """Return one sentence on identifiable values that follow the cut-off, or nothing."""
    known = np.array([v.verdict is Class.IDENTIFIABLE for v in result.verdicts])
    cutoffs = [s.cutoff for s in regression.samples]
    if not known.any() or None in cutoffs:
        return ""
    windows = _windows([len(log) for log in logs])

    def refit(factor: float) -> Estimate | None:
        cut = [replace(how, cutoff=factor * (cutoffs[k] or np.inf)) for k, _, _ in windows]
        try:
            samples = tuple(
                prepare_samples(regression.robot, logs[k].rows(a, b), at)
                for (k, a, b), at in zip(windows, cut, strict=True)
            )
        except IdentifiabilityError:  # nothing is left of one at such a cut-off
            return None
        again = gather_information(replace(regression, samples=samples), 1)
        return result.estimate.estimator.fit(result.rung.reduce(again))

    whole = sum(b - a for _, a, b in windows) == sum(len(log) for log in logs)
    base = result.estimate if whole else refit(1.0)
    if base is None:
        return ""
    found = []
    for factor in FACTORS:
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
    return sizes


def _windows(lengths: Sequence[int]) -> list[tuple[int, int, int]]:
    """Return log, first and last (exclusive) row of what is fitted again: all, or evenly spaced."""
    if sum(lengths) <= ENOUGH:
        return [(k, 0, length) for k, length in enumerate(lengths)]
    pieces = []
    for k, length in enumerate(lengths):
        edges = np.linspace(0, length, -(-length * WINDOWS // ENOUGH) + 1).astype(int).tolist()
        pieces += [(k, a, b) for a, b in pairwise(edges)]
    return pieces[:: -(-sum(lengths) // ENOUGH)]
