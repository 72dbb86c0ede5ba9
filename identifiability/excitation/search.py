"""`search`: many random starts, the best few improved, these to their ends, the best first.

BFGS copes with the kinks that peaks and singular values make [Lewis 2013]; its curvature is thrown
away when it gets stuck at one, and found again from there.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import minimize

from identifiability.excitation.objective import OPEN, Objective
from identifiability.names import Array

#: Random candidates that are tried, and how many of them are improved.
DRAWS = 128
STARTS = 3
#: Share of the iterations that each start gets before the best is chosen.
FIRST = 0.25
#: Fall of the cost of a whole round below which the search has converged.
SETTLED = 2e-3
#: Rounds of BFGS on the best start, or the next one where that has converged.
ROUNDS = 4


@dataclass(frozen=True)
class Step:
    """One iteration: which start, how many iterations before it, and the cost so far."""

    start: int
    iteration: int
    cost: float


@dataclass(frozen=True)
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
    complete : bool
        Whether it ended by itself and not by the budget; only then is it reproducible.
    """

    found: tuple[tuple[float, Array], ...]
    draws: Array
    costs: Array
    steps: tuple[Step, ...]
    evaluations: int
    complete: bool


class _OutOfTimeError(Exception):
    pass


@dataclass
class _Run:
    """The best candidate of one start so far."""

    objective: Objective
    number: int
    x: Array
    cost: float
    deadline: float
    say: Callable[[float], None]
    iterations: int = 0
    evaluations: int = 0
    steps: list[Step] = field(default_factory=list)

    def improve(self, iterations: int) -> None:
        """Go on for some iterations of BFGS."""
        minimize(
            self._gradient, self.x, jac=True, method="BFGS", callback=self._count,
            options={"maxiter": iterations, "gtol": 1e-4},
        )  # fmt: skip

    def _gradient(self, x: Array) -> tuple[float, Array]:
        if time.monotonic() > self.deadline:
            raise _OutOfTimeError
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
    budget: float,
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
    budget : float [s]
        Wall-clock time at most.
    say : callable(cost, share)
        Called after every iteration.
    """
    begin = time.monotonic()
    draws = objective.series.draw(DRAWS, rng)
    costs = objective(draws)
    first = max(5, int(FIRST * iterations))
    total = STARTS * first + ROUNDS * iterations

    def tell(cost: float) -> None:
        done = sum(r.iterations for r in runs) / total
        say(cost, max(done, (time.monotonic() - begin) / budget))

    runs = [
        _Run(objective, k, draws[at], float(costs[at]), 0.0, tell)
        for k, at in enumerate(np.argsort(costs)[:STARTS])
        if costs[at] < OPEN  # where loops do not close there is no slope
    ]
    if not runs:
        return Search((), draws, costs, (), DRAWS, True)
    complete = True
    for k, run in enumerate(runs):  # half of the time for choosing a start
        run.deadline = begin + budget * 0.5 * (k + 1) / len(runs)
        complete &= _improve(run, first)
    waiting = sorted(runs, key=lambda r: r.cost)
    for _ in range(ROUNDS):
        best = waiting[0]
        best.deadline = begin + budget
        before = best.cost
        finished = _improve(best, iterations)
        complete &= finished
        if before - best.cost < SETTLED:  # stuck at a kink: the next start may get further
            waiting = waiting[1:]
        if not finished or not waiting:
            break
    found = tuple(sorted(((r.cost, r.x) for r in runs), key=lambda pair: pair[0]))
    steps = tuple(step for r in runs for step in r.steps)
    evaluations = DRAWS + sum(r.evaluations for r in runs)
    return Search(found, draws, costs, steps, evaluations, complete)


def _improve(run: _Run, iterations: int) -> bool:
    """Improve a start; return whether there was time enough."""
    try:
        run.improve(iterations)
    except _OutOfTimeError:
        return False
    return True
