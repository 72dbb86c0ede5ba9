"""`Answer`: may the intervals and verdicts of the model to use be trusted? In three lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.shares import REACH
from identifiability.foundation.values import frozen
from identifiability.workflows.calibrate.outcome import Cell, Outcome
from identifiability.workflows.calibrate.world import Cause

#: Least coverage of 95 % intervals, of all parameters together and of a single one.
LEAST, LEAST_SINGLE = 0.90, 0.85

#: Most of the parameters called identifiable that may be off by more than half.
MOST_WRONG = 0.02

#: Most repetitions in which nothing is judged.
MOST_SILENT = 0.5

#: A cause does harm if the gain without it is more than this many of its standard errors.
CLEAR = 2.0

Word = Literal["yes", "no", "not enough trials"]

#: What a cause is called.
WORDS = {
    Cause.NOISE_MEMORY: "noise that remembers",
    Cause.LEFT_OUT: "left-out parameters",
    Cause.MOTION: "errors of the measured motion",
}


def find_remedy(cause: Cause, *, instruments: bool, record: bool, rates: bool) -> str:
    """Return what to do about a cause.

    Parameters
    ----------
    cause : Cause
    instruments : bool
        Whether instrumental variables were used.
    record : bool
        Whether every log has a second record of its motion, of which they could be made.
    rates : bool
        Whether velocities and accelerations were measured.
    """
    if cause is Cause.NOISE_MEMORY:
        return "give longer logs"
    if cause is Cause.LEFT_OUT:
        return "use a model that leaves out less (--model)"
    if instruments:
        return "low-pass the motion more (--cutoff)"
    if record:
        return "use instrumental variables (--estimator auto)"
    if rates:
        return "repeat the motion, for instrumental variables"
    return "log '<joint>.dq' and '<joint>.ddq' as measured, for instrumental variables"


@frozen
class Effect:
    """What switching off one cause does.

    Attributes
    ----------
    cause : Cause
    cell : Cell
        What was counted without it.
    gain, gain_se : float
        By how much the failed share (of intervals, verdicts or judgements) gets better, in the same
        repetitions, and its Monte-Carlo standard error.
    remedy : str
        What to do about it.
    """

    cause: Cause
    cell: Cell
    gain: float
    gain_se: float
    remedy: str

    @property
    def harmful(self) -> bool:
        """Whether the cause does harm beyond Monte-Carlo error."""
        return self.gain > CLEAR * self.gain_se and self.gain > 0


@frozen
class Answer:
    """The answer, and what it rests on.

    Attributes
    ----------
    model : str
    cell : Cell
        Repetitions with all causes.
    effects : tuple of Effect
        What each cause does, where the answer is no.
    nothing : str
        Why the analysis believes no verdict, for after "because"; empty where it does.
    missing : str
        What the model surely misses, in words; repetitions are made by the model and have it not.
    """

    model: str
    cell: Cell
    effects: tuple[Effect, ...] = ()
    nothing: str = ""
    missing: str = ""

    @property
    def word(self) -> Word:
        """Yes, no, or that the trials do not say."""
        return "no" if self.nothing else decide(self.cell)

    @property
    def enough(self) -> int:
        """Trials that would probably tell, as `calibrate` counts them."""
        return _enough(self.cell)

    @property
    def lines(self) -> tuple[str, str, str]:
        """The answer in three lines: intervals, verdicts, and the weakest point or the reason."""
        return self._intervals, self._verdicts, self._weakest

    @property
    def _intervals(self) -> str:
        cell = self.cell
        start = {"yes": "Yes", "no": "No", "not enough trials": "Not enough trials to say"}
        if self.missing:
            start["yes"] = "Only if nothing is missing"
        if not self.nothing and fails(cell) == "single":
            start["no"] = "No, not for every parameter"
        return (
            f"{start[self.word]}: of 95 % intervals of {self.model}, "
            f"{100 * cell.coverage_robust:.1f} ± {100 * cell.coverage_se:.1f} % hold the truth "
            f"in {cell.trials} simulated repetitions."
        )

    @property
    def _verdicts(self) -> str:
        cell = self.cell
        silent = ""
        if cell.not_judged:
            silent = (
                f" In {100 * cell.not_judged:.0f} % of the repetitions nothing is judged, for want "
                "of independent outputs or of blocks to resample."
            )
        if not cell.called:
            return f"Wrong by more than half: none, for none is called identifiable.{silent}"
        return (
            f"Wrong by more than half: {100 * cell.wrong:.1f} % of those called identifiable (at "
            f"most {100 * cell.wrong_high:.1f} %; {cell.called:.1f} of {len(cell.names)} are "
            f"called so).{silent}"
        )

    @property
    def _weakest(self) -> str:
        cell = self.cell
        name, share = cell.names[cell.worst], cell.each[cell.worst]
        least = f"Least sure: {name}, {100 * share.value:.0f} %"
        if self.nothing:
            return f"Why: the analysis believes no verdict, because {self.nothing}."
        if self.word == "yes" and self.missing:
            return f"{least} of its intervals hold the truth. But {self.missing}: diagnose."
        if self.word == "yes":
            # Repetitions are made by the model: what it lacks altogether is in none of them.
            return (
                f"{least} of its intervals hold the truth. This is so if no effect is missing: "
                "diagnose looks for one."
            )
        if self.word == "not enough trials":
            return f"{least}; repeat with more trials (--replicates {self.enough})."
        blamed = sorted((e for e in self.effects if e.harmful), key=lambda e: -e.gain)
        fault = fails(cell)
        if not blamed and fault == "silent":
            return "Why: too little is measured to judge; give longer logs."
        if not blamed:
            return f"{least}; no single cause explains it: give longer or other logs."
        first, others = blamed[0], blamed[1:]
        better = first.cell
        without = {
            "silent": f"{100 * (1 - better.not_judged):.0f} % are judged",
            "verdicts": f"{100 * better.wrong:.1f} % are wrong",
        }.get(fault, f"{100 * better.coverage_robust:.0f} % hold")
        why = WORDS[first.cause] + "".join(f", then {WORDS[e.cause]}" for e in others)
        weak = "" if fault == "silent" else f" ({least[0].lower()}{least[1:]})"
        remedy = f"{first.remedy[:1].upper()}{first.remedy[1:]}"
        return f"Why: {why}; without it {without}{weak}. {remedy}."


def fails(cell: Cell) -> str:
    """Return what surely is not as it should be: nothing, or one of the four that follow."""
    faults = {
        "silent": cell.not_judged > MOST_SILENT,
        "coverage": cell.coverage_robust + REACH * cell.coverage_se < LEAST,
        "verdicts": cell.wrong_low > MOST_WRONG,
        "single": min(s.high for s in cell.each) < LEAST_SINGLE,
    }
    return next((name for name, holds in faults.items() if holds), "")


def decide(cell: Cell) -> Word:
    """Return whether intervals and verdicts can be trusted, if the trials say so."""
    if fails(cell):
        return "no"
    covered = cell.coverage_robust - REACH * cell.coverage_se >= LEAST
    return "yes" if covered and not cell.wrong_high > MOST_WRONG else "not enough trials"


def _enough(cell: Cell) -> int:
    """Return how many trials (a quarter of the first cell's) would probably tell."""
    room = max(abs(cell.coverage_robust - LEAST), 0.01)
    by_coverage = (2 * REACH * cell.coverage_se / room) ** 2
    by_wrong = 2 * cell.wrong_high / MOST_WRONG if cell.wrong_high > MOST_WRONG else 0.0
    more = float(np.nanmax([2.0, by_coverage, by_wrong]))
    return int(np.ceil(cell.trials / 4 * min(more, 40.0) / 10) * 10)


def compare(
    cause: Cause,
    cell: Cell,
    all_: Sequence[tuple[Outcome, Array]],
    without: Sequence[tuple[Outcome, Array]],
    failed: Cell,
    remedy: str = "",
) -> Effect:
    """Return what a cause does, from the same repetitions with and without it.

    Parameters
    ----------
    cause : Cause
    cell : Cell
        Of the repetitions without it.
    all_, without : sequences of (Outcome, truth)
    failed : Cell
        With all causes: what of it is not as it should be is compared.
    remedy : str
        What to do about the cause.
    """
    fault = fails(failed)

    def bad(outcome: Outcome, truth: Array) -> float:
        if fault == "silent":
            return float(not outcome.judged)
        if fault == "verdicts":
            return float((outcome.wrong(truth) & outcome.identifiable).sum())
        missed = ~outcome.holds(truth)
        return float(missed[failed.worst] if fault == "single" else missed.mean())

    pairs = zip(all_, without, strict=True)
    gains = np.array([bad(*one) - bad(*other) for one, other in pairs])
    if fault == "verdicts":
        gains = gains / max(failed.called, 1e-9)
    error = float(gains.std(ddof=1) / np.sqrt(len(gains))) if len(gains) > 1 else float("inf")
    return Effect(cause, cell, float(gains.mean()), error, remedy)
