"""`NextMotion`: what to measure next, so that "A or B" becomes A, or B, or what is hidden shows.

The motion makes a name and all its rivals as unlike as it can, beside everything else that the
model has, together with the logs there are. Where nothing is open it shows what these logs cannot
tell from the model itself. Whether it will decide hangs on how large the effect is over the noise:
the chance is that of the very rule by which `find_rivals` calls two names undecided, with the noise
that the logs have.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from identifiability.effects import title_of
from identifiability.foundation.engines.mapping import one_thread
from identifiability.foundation.errors import ClosureError, IdentifiabilityError, listing
from identifiability.foundation.options import Positive, Seed, at_least, checked, counted
from identifiability.foundation.output import write_json
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.findings import Findings
from identifiability.workflows.diagnose.next_question import Asked, ask_hidden, ask_open
from identifiability.workflows.diagnose.noise_of_motion import Told
from identifiability.workflows.excite import Excitation, Limits, find_limits
from identifiability.workflows.excite.criteria import Known
from identifiability.workflows.excite.search import Series
from identifiability.workflows.excite.workflow import find_motion
from identifiability.workflows.opening import Progress

#: A motion is logged for the fewest periods that are likely to decide, up to so many.
PERIODS, LIKELY = 32, 0.95
#: Where these are not likely to, how many times as long a log may be, and how much slower a motion
#: is tried as well: it stays longer near a reversal, where laws of friction differ, and has less
#: inertia to hide them. A faster one crosses it in so few samples that how the sign of a speed is
#: smoothed counts.
LONGER, SLOWER = 4, 2
#: Looks of each search, and samples a second.
EVALUATIONS, RATE = 4000, 100.0
#: Names that a sentence lists.
LISTED = 4


@frozen
class NextMotion:
    """The motion that tells names apart, and how likely it does.

    Attributes
    ----------
    names : tuple of str
        What was named and its rivals, as a model file writes them; or what is hidden.
    excitation : Excitation
        The motion, which begins and ends at rest.
    periods : int
        How often it is gone through.
    chance, before : float
        That the diagnosis of these logs and the new one gives one name, the true one, where the
        effect is as large as it was found; and of these logs anew. Of what is hidden, that an
        effect as large as what is left stands out, on average.
    hidden : bool
        Whether nothing is open, and the motion shows what the model says as well in these logs.
    same : bool
        Whether it is all one torque, however the robot moves.
    """

    names: tuple[str, ...]
    excitation: Excitation
    periods: int
    chance: float
    before: float
    hidden: bool = False
    same: bool = False

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        period, k = self.excitation.trajectory.period, self.periods
        more = f", {k} times ({_time(k * period)} in all)" if k > 1 else ""
        motion = (
            f"log this motion of {period:g} s{more}, which begins and ends at rest, and "
            "diagnose it with the logs there are"
        )
        if self.hidden:
            told = listing([_told(name) for name in self.names], LISTED)
            if self.same:
                return (
                    f"No motion was found that shows {told}: the model says the same, however the "
                    "robot moves."
                )
            return (
                f"To show {told}, which these logs cannot tell from the model, {motion}: what is "
                f"as large as what is left stands out with a chance of {_percent(self.chance)} "
                f"(without it: {_percent(self.before)}). {self.excitation.limits_statement}"
            )
        first, *others = self.names
        place = first.partition("@")[2].partition(":")[0]
        alone = all(name.partition("@")[2].partition(":")[0] == place for name in others)
        title = title_of(first.partition("@")[0]) if alone else _told(first)
        rivals = [title_of(n.partition("@")[0]) if alone else _told(n) for n in others]
        pair = f"{title} from {listing(rivals, LISTED)}" + f" in {place}" * alone
        if self.same:
            return (
                f"No motion was found that tells {pair}: beside the rest of the model they are the "
                "same torque, and either predicts it."
            )
        return (
            f"To tell {pair}, {motion}: it decides with a chance of {_percent(self.chance)}, if "
            f"the effect is as large as it was found (without it: {_percent(self.before)}). "
            f"{self.excitation.limits_statement}"
        )

    def to_json(self, path: str | Path) -> Path:
        """Write a trajectory file: ``identifiability simulate ROBOT FILE.json`` follows it."""
        return write_json(path, self.to_dict())

    def to_dict(self) -> dict[str, Any]:
        """Return a trajectory file with what is known of the motion beside it."""
        told = {"shows" if self.hidden else "separates": list(self.names), "chance": self.chance}
        told |= {"before": self.before, "periods": self.periods}
        content = {**self.excitation.to_dict(), "comment": self.statement, "next": told}
        # Of the shapes that a rival may have the most alike one counts, not all of them together.
        del content["before"], content["after"]
        return content


@checked
def find_next(
    d: Findings,
    *,
    limits: Limits | Mapping[str, Any] | str | Path | None = None,
    duration: Positive = 7.5,
    harmonics: Annotated[int, counted(2, 50)] = 5,
    evaluations: Annotated[int, at_least(1)] = EVALUATIONS,
    seed: Seed = 0,
    progress: Progress | None = None,
) -> NextMotion:
    """Find the motion that decides between a name and its rivals, or shows what is hidden.

    Parameters
    ----------
    d : Diagnosis
        Of several names that are "A or B" the one with the largest torque is asked about; where
        there is none, what these logs cannot tell from the model.
    duration : float [s]
        The period. It is logged up to 32 times; where these are not likely to decide up to 128
        times, or one of twice the period up to 64 times.
    limits, harmonics, evaluations, seed, progress
        As for `excite`.

    Raises
    ------
    IdentifiabilityError
        If nothing is undecided or hidden, or no motion keeps the robot's limits.
    """
    say = progress or (lambda what, share: None)
    with one_thread("blas"):
        bounds = find_limits(d.robot, limits)
        series = Series(bounds, duration, harmonics, at_rest=True)
        asked = ask_open(d, series, seed) or ask_hidden(d, series, seed)
        if asked is None:
            raise IdentifiabilityError(
                "Nothing that was named is undecided, and nothing is hidden by the model that "
                "another motion shows, so no motion is asked for; excite --separate tells any two "
                "effects apart."
            )

        def search(series: Series, lasts: float) -> Excitation:
            return find_motion(
                asked.question,
                Known(asked.known, asked.weights, lasts / step, logs),
                series,
                samples=max(round(RATE * series.period), 4 * harmonics + 1),
                iterations=80,
                evaluations=1 if asked.same else evaluations,
                time_limit=None,
                seed=seed,
                name="next",
                say=say,
            )

        step = float(np.median(np.diff(d.samples[0].output_times())))
        logs, told = tuple(s.name for s in d.samples), Told.of(asked.question, d)
        found, longest = [search(series, duration)], PERIODS * duration
        usual = _judge(d, asked, told, found, longest)
        if usual.chance >= LIKELY or asked.same:
            return usual
        with suppress(ClosureError):  # the first one keeps the workspace
            found.append(search(replace(series, period=SLOWER * duration), longest))
        return _judge(d, asked, told, found, LONGER * longest)


def _judge(
    d: Findings, asked: Asked, told: Told, found: Sequence[Excitation], longest: float
) -> NextMotion:
    """Return the shortest log that is likely to decide, or else the one that is likeliest to.

    Parameters
    ----------
    d : Findings
    asked : Asked
    told : Told
        What the logs say of it.
    found : sequence of Excitation
        Motions of one period each.
    longest : float [s]
        A log may be.
    """
    logs = []
    for motion in found:
        (new, seen), period, k = told.along(d, motion.trajectory), motion.trajectory.period, 1
        while k * period <= longest:
            logs.append((k * period, k, asked.chance(told.known + min(k, seen) * new), motion))
            k *= 2
    logs.sort(key=lambda log: log[0])
    likeliest = max(logs, key=lambda log: log[2])  # of several the shortest
    _, periods, chance, motion = next((log for log in logs if log[2] >= LIKELY), likeliest)
    return NextMotion(
        names=asked.names,
        excitation=motion,
        periods=periods,
        chance=chance,
        before=asked.chance(told.known),
        hidden=asked.hidden,
        same=asked.same,
    )


def _told(text: str) -> str:
    """Return an effect at its place in words."""
    name, _, place = text.partition("@")
    return f"{title_of(name)} in {place.partition(':')[0]}" if place else title_of(name)


def _time(seconds: float) -> str:
    return f"{seconds:g} s" if seconds < 120 else f"{seconds / 60:.3g} min"


def _percent(share: float) -> str:
    return "more than 99 %" if share > 0.99 else f"{100 * share:.0f} %"
