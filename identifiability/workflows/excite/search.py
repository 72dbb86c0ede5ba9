"""`search`: many random starts, the best few improved, these to their ends, the best first.

BFGS copes with the kinks that peaks and singular values make [Lewis 2013]; its curvature is thrown
away when it gets stuck at one, and found again from there.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, cast, get_args

import numpy as np
from scipy.optimize import minimize

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.workflows.excite.candidates import OPEN, Objective

End = Literal["converged", "evaluations", "time"]

#: Random candidates that are tried, and how many of them are improved.
DRAWS = 128
STARTS = 3
#: Share of the iterations that each start gets before the best is chosen.
FIRST = 0.25
#: Fall of the cost of a whole round below which the search has converged.
SETTLED = 2e-3
#: Rounds of BFGS on the best start, or the next one where that has converged.
ROUNDS = 4


@frozen
class Step:
    """One iteration: which start, how many iterations before it, and the cost so far."""

    start: int
    iteration: int
    cost: float


@frozen
class Search:
    """What was found.

    Attributes
    ----------
    found : tuple of (cost, x)
        The end of every start, best first; none if no random candidate closes its loops.
    draws : (DRAWS, size)
        Random candidates.
    costs : (DRAWS,)
        Theirs.
    steps : tuple of Step
    evaluations : int
        Candidates whose cost was computed.
    end : {"converged", "evaluations", "time"}
        What ended it; only time makes it depend on the machine.
    """

    found: tuple[tuple[float, Array], ...]
    draws: Array
    costs: Array
    steps: tuple[Step, ...]
    evaluations: int
    end: End


class _StoppedError(Exception):
    """Where a search was ended from outside."""


@dataclass
class _Run:
    """The best candidate of one start so far."""

    objective: Objective
    number: int
    x: Array
    cost: float
    deadline: float
    say: Callable[[float], None]
    allowed: float = 0.0
    iterations: int = 0
    evaluations: int = 0
    steps: list[Step] = field(default_factory=list)

    def improve(self, iterations: int) -> End:
        """Go on for some iterations of BFGS; return what ended them."""
        how = {"jac": True, "method": "BFGS", "options": {"maxiter": iterations, "gtol": 1e-4}}
        try:
            minimize(self._gradient, self.x, callback=self._count, **how)
        except _StoppedError as stop:
            return cast(End, str(stop))
        return "converged"

    def _gradient(self, x: Array) -> tuple[float, Array]:
        if time.monotonic() > self.deadline:
            raise _StoppedError("time")
        if self.evaluations + len(x) + 1 > self.allowed:
            raise _StoppedError("evaluations")
        cost, slope = self.objective.gradient(x)
        self.evaluations += len(x) + 1
        if cost < self.cost:
            self.cost, self.x = cost, x.copy()
        return cost, slope

    def _count(self, _x: Array) -> None:
        self.iterations += 1
        self.steps.append(Step(self.number, self.iterations, self.cost))
        self.say(self.cost)


def search(
    objective: Objective,
    rng: np.random.Generator,
    *,
    iterations: int,
    evaluations: float,
    time_limit: float,
    say: Callable[[float, float], None],
) -> Search:
    """Return the best candidates.

    Parameters
    ----------
    objective : Objective
    rng : numpy.random.Generator
        Draws the starts.
    iterations : int
        Of BFGS a round.
    evaluations : float
        Candidates whose cost may be computed, after the random ones.
    time_limit : float [s]
        After it the search stops wherever it is, and depends on the machine.
    say : callable(cost, share)
        Called after every iteration.
    """
    begin = time.monotonic()
    draws = objective.series.draw(DRAWS, rng)
    costs = objective(draws)
    first = max(5, int(FIRST * iterations))
    total = STARTS * first + ROUNDS * iterations

    def spent() -> int:
        return sum(r.evaluations for r in runs)

    def tell(cost: float) -> None:
        done = sum(r.iterations for r in runs) / total
        say(cost, max(done, spent() / evaluations, (time.monotonic() - begin) / time_limit))

    runs = [
        _Run(objective, k, draws[at], float(costs[at]), begin + time_limit, tell)
        for k, at in enumerate(np.argsort(costs)[:STARTS])
        if costs[at] < OPEN  # where loops do not close there is no slope
    ]
    if not runs:
        return Search((), draws, costs, (), DRAWS, "converged")
    ends: list[End] = []
    for run in runs:  # half of the evaluations for choosing a start
        run.allowed = 0.5 * evaluations / len(runs)
        ends.append(run.improve(first))
    waiting = sorted(runs, key=lambda r: r.cost)
    for _ in range(ROUNDS):
        best = waiting[0]
        best.allowed = best.evaluations + evaluations - spent()
        before = best.cost
        ends.append(best.improve(iterations))
        if before - best.cost < SETTLED:  # stuck at a kink: the next start may get further
            waiting = waiting[1:]
        if ends[-1] != "converged" or not waiting:
            break
    found = tuple(sorted(((r.cost, r.x) for r in runs), key=lambda pair: pair[0]))
    steps = tuple(step for r in runs for step in r.steps)
    end = max(ends, key=get_args(End).index)
    return Search(found, draws, costs, steps, DRAWS + spent(), end)
