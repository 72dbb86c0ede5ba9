"""How much of a pruned model is the robot, and how much the luck of one log.

The whole path, from the unpruned model to the chosen rung, is walked again on resampled blocks
of time. The selection is part of what is resampled, so the answer speaks of it, not of one fixed
model.
"""

from __future__ import annotations

from collections import Counter
from functools import partial

import numpy as np

from identifiability.foundation.engines.local import Serial
from identifiability.foundation.engines.mapping import Engine, Steps
from identifiability.foundation.values import frozen
from identifiability.workflows.prune.elimination import walk
from identifiability.workflows.prune.folds import WhitenedRegression
from identifiability.workflows.prune.moves import Partition
from identifiability.workflows.prune.search import Criterion, Search, choose_step

#: Replicates that one item of an engine walks, some tenths of a second.
BATCH = 10


@frozen
class Stability:
    """What the replicates chose.

    Attributes
    ----------
    columns : tuple of str
        Of the starting model.
    survives : (k,)
        Share of replicates in which a column is not zero.
    sizes : (replicates,) int
        Number of parameters chosen.
    same : float
        Share of replicates that chose exactly the columns that the logs themselves chose.
    models : tuple of (tuple of str, float)
        Sets of columns chosen most often, with their shares.
    """

    columns: tuple[str, ...]
    survives: np.ndarray
    sizes: np.ndarray
    same: float
    models: tuple[tuple[tuple[str, ...], float], ...]

    @property
    def replicates(self) -> int:
        """Number of replicates."""
        return len(self.sizes)

    @property
    def statement(self) -> str:
        """The answer in one sentence."""
        if not self.replicates:
            return "No log was resampled, so nothing is known of the stability of the choice."
        low, high = np.round(np.quantile(self.sizes, [0.05, 0.95]))
        torn = int(((self.survives > 0.1) & (self.survives < 0.9)).sum())
        most = "90 %" if high > low else "at least 90 %"
        span = f"{low:.0f} to {high:.0f}" if high > low else f"{low:.0f}"
        shaky = (
            f"{torn} of {len(self.columns)} parameters survive in some (10 to 90 %) and not in "
            "others"
            if torn
            else "no parameter survives in some and not in others (10 to 90 %)"
        )
        return (
            f"Of {self.replicates} resampled logs {100 * self.same:.0f} % lead to exactly this "
            f"model, and {most} to {span} parameters; {shaky}."
        )


def assess_stability(
    search: Search,
    chosen: Partition,
    criterion: Criterion,
    rng: np.random.Generator,
    *,
    replicates: int,
    length: float,
    progress: Steps | None = None,
    engine: Engine | None = None,
) -> Stability:
    """Walk the path again on resampled logs.

    Parameters
    ----------
    search : Search
    chosen : Partition
        What the logs themselves chose.
    criterion : Criterion
    rng : numpy.random.Generator
    replicates : int
    length : float
        Samples a block must have at least to be nearly independent of the next.
    progress : callable(int, int), optional
    engine : Engine, optional
        Where the replicates are walked; by default here.
    """
    own = search.whitened
    unit = _units(own, max(1, round(length * len(own.folds.test) / max(own.samples, 1))))
    count = int(unit.max()) + 1
    # Drawn here, so that a replicate is the same whoever walks it.
    draws = rng.multinomial(count, np.full(count, 1 / count), size=replicates)
    items = [draws[k : k + BATCH] for k in range(0, replicates, BATCH)]
    parts = (engine or Serial()).map(
        partial(_walk_again, search, unit, criterion), items, progress=progress
    )
    drawn = [partition for part in parts for partition in part]
    sets, most = Counter(_set(p) for p in drawn), max(replicates, 1)
    alive = np.array([p.survivors() for p in drawn]).reshape(-1, len(chosen.columns))
    return Stability(
        columns=chosen.columns,
        survives=alive.mean(0) if drawn else np.full(len(chosen.columns), np.nan),
        sizes=np.array([len(p) for p in drawn], int),
        same=sets[_set(chosen)] / most if drawn else np.nan,
        models=tuple((m, count / most) for m, count in sets.most_common(5)),
    )


def _walk_again(
    search: Search, unit: np.ndarray, criterion: Criterion, draws: np.ndarray
) -> list[Partition]:
    """Return what some replicates choose; `draws` (r, units) says how often they draw a unit."""
    chosen = []
    for row in draws:
        path = walk(search.whitened.fit(row[unit].astype(float)), search.plan)
        steps = search.embed(path).steps
        chosen.append(steps[choose_step(steps, criterion)].partition)
    return chosen


def _units(own: WhitenedRegression, blocks: int) -> np.ndarray:
    """Return the unit of resampling of each block: runs of `blocks` within a fold."""
    test, at = own.folds.test, 0
    unit = np.empty(len(test), int)
    for f in range(own.folds.count):
        rows = np.flatnonzero(test == f)
        runs = max(1, len(rows) // blocks)
        unit[rows] = at + np.arange(len(rows)) * runs // len(rows)
        at += runs
    return unit


def _set(partition: Partition) -> tuple[str, ...]:
    return tuple("=".join(partition.members(g)) for g in partition.leaders)
