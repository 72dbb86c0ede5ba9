"""The path of a regression, and which rung of it to use: the smallest as good as the best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from identifiability.estimation.estimate import Method, estimate
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.evidence import Evidence, near_best
from identifiability.estimation.least_squares import MIXED, dependence
from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.workflows.prune.elimination import Path, Plan, Step, walk
from identifiability.workflows.prune.folds import WhitenedRegression, whiten_regression
from identifiability.workflows.prune.moves import ZERO, Kind, Move, Partition

#: ``identifiable``: the smallest within two nats of the best predictive log density, or as good as
#: the best (`evidence.near_best`).
#: ``one-se-of-difference``, ``one-se``: the smallest whose density is within one standard error of
#: the difference to the best; that depends on the scatter between folds, and keeps less.
#: ``best``: the best predictive log density itself; keeps most.
Criterion = Literal["identifiable", "one-se-of-difference", "one-se", "best"]


@frozen
class Search:
    """A path and what it was walked with.

    Attributes
    ----------
    full : Estimate
        Of the starting model.
    whitened : WhitenedRegression
        Of its independent columns.
    plan : Plan
    path : Path
        Its partitions are of all columns of the starting model.
    """

    full: Estimate
    whitened: WhitenedRegression
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
    variation: Array | None = None,
    suggested: Sequence[Move] = (),
    forbid: Sequence[str] = (),
    force: Sequence[str] = (),
    method: Method = "wls",
) -> Search:
    """Walk from all columns of a regression down to none.

    Parameters
    ----------
    information : Information
        About the k columns of the starting model.
    nonnegative : (k,) bool
        Whether physics forbids a value below zero.
    variation : (n,), optional [(N·m)² or N²]
        Of the torque of each joint about its mean, as in `whiten_regression`.
    suggested : sequence of Move
        What knowledge of the robot suggests.
    forbid, force : sequence of str
        Columns that must not be dropped, and that are dropped whatever the data say.
    method : str or Estimator
        Its refits are the fits of the path.
    """
    full = estimate(information, method)
    kept = list(full.kept)
    part = information.select(kept)
    own = full if len(kept) == information.size else estimate(part, method)
    whitened = whiten_regression(part, own, np.asarray(nonnegative)[kept], variation)
    plan = _plan(suggested, forbid, force, part.columns)
    walked = walk(whitened.fit(), plan)
    search = Search(full, whitened, plan, walked)
    return replace(search, path=_with_idle(search, walked, information))


def _plan(
    suggested: Sequence[Move], forbid: Sequence[str], force: Sequence[str], columns: Sequence[str]
) -> Plan:
    """Return the plan over the columns that the motion excites."""
    known = set(columns)
    usable = []
    for move in suggested:
        zero = tuple(c for c in move.zero if c in known and c not in forbid)
        tie = tuple(t for s in move.tie if len(t := tuple(c for c in s if c in known)) > 1)
        if zero or tie:
            usable.append(replace(move, zero=zero, tie=tie))
    pairs = tuple(m for m in usable if m.kind is Kind.MERGE)
    forced = tuple(Move(Kind.FORCED, (c,), why="You asked for it") for c in force if c in known)
    return Plan(tuple(usable), pairs, forced, frozenset(forbid))


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


def best_step(steps: Sequence[Step]) -> int:
    """Return the step with the best predictive log density of those that may be used."""
    first = first_allowed(steps)
    return first + int(np.argmax([s.density for s in steps[first:]]))


def first_allowed(steps: Sequence[Step]) -> int:
    """Return the first step after what must go: what the motion or the user leaves out."""
    must = (Kind.UNEXCITED, Kind.FORCED)
    return max((k for k, s in enumerate(steps) if s.move and s.move.kind in must), default=0)


def good_steps(steps: Sequence[Step], criterion: Criterion) -> list[int]:
    """Return the steps that may be used, the preferred one first.

    Preferred is the smallest of those with the fewest forbidden signs; the others follow for the
    case that no real robot can have its values.
    """
    first, best = first_allowed(steps), best_step(steps)
    if criterion == "best":
        return [best]
    scores = [step.score for step in steps[first:]]
    if criterion == "identifiable":
        near = (first + np.flatnonzero(near_best(scores))).tolist()
    else:
        gains = [Evidence.of(score, steps[best].score).density for score in scores]
        near = [first + k for k, gain in enumerate(gains) if gain.value >= -gain.se]
    return sorted(near, key=lambda k: (steps[k].violations, len(steps[k].partition)))


def choose_step(steps: Sequence[Step], criterion: Criterion) -> int:
    """Return the step to use, the physical certificate aside."""
    return good_steps(steps, criterion)[0]
