"""The path of a regression and what it was walked with, from `Information` alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.estimation.estimate import Method, estimate
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.least_squares import MIXED, dependence
from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.workflows.prune.elimination import Path, Plan, walk
from identifiability.workflows.prune.folds import Folds, gather_folds
from identifiability.workflows.prune.moves import ZERO, Kind, Move, Partition
from identifiability.workflows.prune.selection import Criterion, choose_step


@frozen
class Wishes:
    """What the user wants of the search.

    Attributes
    ----------
    forbid : frozenset of str
        Columns that must not be dropped.
    force : tuple of str
        Columns that are dropped whatever the data say.
    """

    forbid: frozenset[str] = frozenset()
    force: tuple[str, ...] = ()


@frozen
class Search:
    """A path and what it was walked with.

    Attributes
    ----------
    full : Estimate
        Of the starting model.
    folds : Folds
        Of its independent columns.
    plan : Plan
    path : Path
        Its partitions are of all columns of the starting model.
    """

    full: Estimate
    folds: Folds
    plan: Plan
    path: Path

    def embed(self, path: Path) -> Path:
        """Return a path over the independent columns as one over all columns."""
        columns, at = self.full.columns, np.array(self.full.kept, int)
        steps = []
        for step in path.steps:
            inner = step.partition.group
            group = np.full(len(columns), ZERO)
            group[at] = [at[g] if g != ZERO else ZERO for g in inner]
            values = np.zeros((len(step.values), len(columns)))
            values[:, at] = step.values
            steps.append(replace(step, partition=Partition(columns, group), values=values))
        return replace(path, steps=tuple(steps))

    def choose(self, criterion: Criterion) -> int:
        """Return the step to use, physics aside."""
        return choose_step(self.path.steps, criterion)


def find_path(
    information: Information,
    nonnegative: np.ndarray,
    *,
    unseen: Array | None = None,
    suggested: Sequence[Move] = (),
    wishes: Wishes | None = None,
    method: Method = "wls",
) -> Search:
    """Walk from all columns of a regression down to none.

    Parameters
    ----------
    information : Information
        About the k columns of the starting model.
    nonnegative : (k,) bool
        Whether physics forbids a value below zero.
    unseen : (m, n, k), optional
        Regressor at states that are not in the logs.
    suggested : sequence of Move
        What knowledge of the robot suggests.
    wishes : Wishes, optional
    method : str or Estimator
        Its refits are the fits of the path.
    """
    wishes = wishes or Wishes()
    full = estimate(information, method)
    kept = list(full.kept)
    part = information.select(kept)
    folds = gather_folds(
        part, full.weights, np.asarray(nonnegative)[kept],
        None if unseen is None else unseen[:, :, kept], full.estimator,
    )  # fmt: skip
    plan = _plan(suggested, wishes, part.columns)
    walked = walk(folds.fit(), plan)
    search = Search(full, folds, plan, walked)
    return replace(search, path=_with_idle(search, walked, information))


def _plan(suggested: Sequence[Move], wishes: Wishes, columns: Sequence[str]) -> Plan:
    """Return the plan over the columns that the motion excites."""
    known = set(columns)
    usable = []
    for move in suggested:
        zero = tuple(c for c in move.zero if c in known and c not in wishes.forbid)
        tie = tuple(t for s in move.tie if len(t := tuple(c for c in s if c in known)) > 1)
        if zero or tie:
            usable.append(replace(move, zero=zero, tie=tie))
    pairs = tuple(m for m in usable if m.kind is Kind.MERGE)
    forced = tuple(
        Move(Kind.FORCED, (c,), why="You asked for it", declared=True)
        for c in wishes.force
        if c in known
    )
    return Plan(tuple(usable), pairs, forced, wishes.forbid)


def _with_idle(search: Search, walked: Path, information: Information) -> Path:
    """Return the path over all columns, what the motion does not excite being its first move."""
    path, full = search.embed(walked), search.full
    idle = [c for k, c in enumerate(full.columns) if k not in set(full.kept)]
    if not idle:
        return path
    move = Move(Kind.UNEXCITED, tuple(idle), why=_why_idle(information, full, idle))
    whole = replace(path.steps[0], partition=Partition.of(full.columns))
    return replace(path, steps=(whole, replace(path.steps[0], move=move), *path.steps[1:]))


def _why_idle(information: Information, full: Estimate, idle: Sequence[str]) -> str:
    """Return what each idle column cannot be told from."""
    leans = np.abs(dependence(information, full.kept, full.weights))
    alone, either = [], []
    for k, name in enumerate(idle):
        partners = [full.kept[i] for i in np.argsort(-leans[:, k]) if leans[i, k] > MIXED]
        if not partners:
            alone.append(name)
        elif len(partners) == 1:
            other = information.columns[partners[0]]
            either.append(f"either {other} or {name} can stand for both")
        else:
            others = listing([information.columns[p] for p in partners], 3)
            either.append(f"{name} acts only together with {others}")
    parts = [f"the motion never makes {listing(alone, 4)} act"] if alone else []
    text = "; ".join([*parts, *either[:3]])
    if len(either) > 3:
        text += f"; and {len(either) - 3} more act only together with others"
    return text[:1].upper() + text[1:]
