"""Which rung of a path to use: the smallest that predicts unseen motion as well as the best."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from identifiability.estimation.verdict import Thresholds
from identifiability.workflows.prune.elimination import Step
from identifiability.workflows.prune.moves import Kind

#: ``identifiable``: within one standard error of the difference to the least held-out error; then,
#: as long as the error stays within its own standard error, what is not identifiable goes too.
#: ``one-se-of-difference``: the former alone; keeps more.
#: ``one-se`` [Breiman 1984]: within the standard error of the least error; keeps least.
#: ``best``: the least held-out error itself; keeps most.
Criterion = Literal["identifiable", "one-se-of-difference", "one-se", "best"]


def least_error(steps: Sequence[Step]) -> int:
    """Return the step with the least held-out error of those that may be used."""
    first = _first_allowed(steps)
    return first + int(np.argmin([s.errors.total for s in steps[first:]]))


def _first_allowed(steps: Sequence[Step]) -> int:
    """Return the first step after what must go: what the motion or the user leaves out."""
    must = (Kind.UNEXCITED, Kind.FORCED)
    return max((k for k, s in enumerate(steps) if s.move and s.move.kind in must), default=0)


def good_steps(steps: Sequence[Step], criterion: Criterion) -> list[int]:
    """Return the steps that may be used, the preferred one first.

    Preferred is the smallest of those with the fewest forbidden signs. The others follow for the
    case that no real robot can have its values: smaller ones within the standard error of the least
    error, then larger ones that are as good.
    """
    best = least_error(steps)
    slack = steps[best].errors.standard_error
    total = [s.errors.total for s in steps]
    allowed = range(_first_allowed(steps), len(steps))
    within = [k for k in allowed if total[k] <= total[best] + slack]
    equal = [k for k in allowed if k == best or _as_good(steps[k], steps[best])]
    pool = {"one-se": within, "best": [best]}.get(criterion, equal)
    first = min(pool, key=lambda k: (steps[k].violations, len(steps[k].partition)))
    if criterion == "identifiable":
        first = _drop_passengers(steps, first, within)
    smaller = [k for k in within if k > first]
    larger = [k for k in reversed(pool) if k < first]
    return [first, *smaller, *larger]


def choose_step(steps: Sequence[Step], criterion: Criterion) -> int:
    """Return the step to use, the physical certificate aside."""
    return good_steps(steps, criterion)[0]


def _as_good(step: Step, best: Step) -> bool:
    rise, spread = step.errors.above(best.errors)
    return rise <= spread


def _drop_passengers(steps: Sequence[Step], first: int, within: Sequence[int]) -> int:
    """Go on dropping what is not identifiable, as long as the error stays within its SE."""
    limit = Thresholds().sigma_percent
    while first + 1 in within:
        following = steps[first + 1]
        more = following.violations > steps[first].violations
        evidence = following.evidence
        if evidence is None or more or evidence.sigma_percent <= limit:
            break
        first += 1
    return first
