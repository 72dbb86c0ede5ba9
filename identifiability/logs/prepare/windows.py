"""Where decisions about a log are made, and what is decided about the samples that are lost."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.gaps import BRIDGED, Gaps, fill
from identifiability.logs.logfile import LogFile
from identifiability.logs.prepare.plan import Plan
from identifiability.logs.spectrum import LOWEST_CUTOFF
from identifiability.logs.stale import StaleRule

#: Fewest samples between two gaps that are used.
SHORTEST_STRETCH = 4

#: A mean step that differs from the usual one by this share of it is said.
DRIFT = 0.01

#: A log with derivatives of its own is not split at gaps of at most so many steps.
FEW = 4.0


@frozen
class Windows:
    """Where decisions about a log are made.

    Attributes
    ----------
    logs : list of Log
    origins : list of int
        Row at which each begins.
    gaps : Gaps
    stale : StaleRule or None
        By which repeated values were interpolated; None if they were left.
    """

    logs: list[Log]
    origins: list[int]
    gaps: Gaps
    stale: StaleRule | None

    @staticmethod
    def of(log: Log | LogFile, *, mend: bool) -> Windows:
        """Return the windows of a log, with repeated values interpolated or as they are."""
        at = signals.spread_windows(len(log))
        raw = [log.rows(a, b) for a, b in at]
        gaps = Gaps.of(log.name, log.clock, [w.t for w in raw])
        rule = StaleRule.of(raw) if mend else None
        logs = raw if rule is None else [rule.mend(w) for w in raw]
        return Windows(logs, [a for a, _ in at], gaps, rule)

    def even(self, longest: float) -> list[Log]:
        """Return stretches of even steps: short gaps are filled, others split the windows."""
        grid = self.gaps.divide(longest)
        if grid is None:
            return self.logs
        stretches = []
        for log, origin in zip(self.logs, self.origins, strict=True):
            for a, b in grid.stretches(origin, origin + len(log)):
                part, filled = log.rows(a, b), partial(fill, at=grid.places(origin + a, origin + b))
                stretches.append(part.each(filled, t=filled(part.t)))
        return stretches


def plan_gaps(plan: Plan, gaps: Gaps, samples: int) -> Plan:
    """Return a plan that bridges short gaps and splits the log at others, and says so."""
    least = 1
    longest = max(BRIDGED / LOWEST_CUTOFF, FEW * plan.step)  # measured derivatives need no filter
    if plan.cutoff is not None:
        longest = BRIDGED / plan.cutoff
        gaps.check(samples)
        least = max(SHORTEST_STRETCH, int(np.ceil(1.0 / (plan.cutoff * plan.step))))
    grid = gaps.divide(longest, least)
    uneven = []
    if plan.cutoff is not None and abs(gaps.drift) > DRIFT:
        uneven = [
            f"{gaps.name} is sampled unevenly: the mean step is {100 * gaps.drift:.2g} % off the "
            f"usual {gaps.step:.3g} s, and what is differentiated errs by as much: give samples at "
            "even steps, or measured velocities and accelerations."
        ]
    if grid is None:
        return replace(plan, hints=tuple(uneven))
    notes, hints, split = [*plan.notes], uneven, gaps.length > longest
    if len(grid.after) and plan.cutoff is not None:
        notes.append(
            f"lost samples ({int(grid.lost.sum())}, at most {gaps.length[~split].max():.3g} s from "
            "one to the next) were bridged by cubics, which half of the cut-off's period allows"
        )
    if len(grid.breaks):
        hints.append(
            f"{gaps.name} lacks samples for {gaps.tell(split)}: it was taken as "
            f"{len(grid.breaks) + 1} stretches, and nothing was computed from one to the next."
        )
        notes.append(f"the log was split into {len(grid.breaks) + 1} stretches at long gaps")
    return replace(plan, grid=grid, notes=tuple(notes), hints=tuple(hints))
