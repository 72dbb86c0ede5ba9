"""`NextMotion`: what to measure next, so that "A or B" becomes A, or B, or what is hidden shows.

The motion makes a name and all its rivals as unlike as it can, beside everything else that the
model has, together with the logs there are. Where nothing is open it shows what these logs cannot
tell from the model itself. Whether it will decide hangs on how large the effect is over the noise:
the chance is that of the very rule by which `find_rivals` calls two names undecided, with the noise
that the logs have.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from identifiability.effects import title_of
from identifiability.foundation.errors import IdentifiabilityError, listing
from identifiability.foundation.options import Positive, Seed, at_least, checked, counted
from identifiability.foundation.output import write_json
from identifiability.foundation.threads import one_thread
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.findings import Findings
from identifiability.workflows.diagnose.next_question import Asked, ask_hidden, ask_open
from identifiability.workflows.diagnose.noise_of_motion import Told
from identifiability.workflows.excite import Excitation, Limits, find_limits
from identifiability.workflows.excite.candidates import Series
from identifiability.workflows.excite.question import Known
from identifiability.workflows.excite.workflow import find_motion
from identifiability.workflows.opening import Progress

#: Periods that a motion may be logged for: the fewest that are likely to decide.
PERIODS, LIKELY = (1, 2, 4, 8, 16, 32), 0.95
#: Looks of the search, and samples a period.
EVALUATIONS, SAMPLES = 4000, 750
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
        path, more = self.excitation.trajectory, f", {self.periods} times" * (self.periods > 1)
        motion = (
            f"log this motion of {path.period:g} s{more}, which begins and ends at rest, and "
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
    limits, duration, harmonics, evaluations, seed, progress
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
        step = float(np.median(np.diff(d.samples[0].output_times())))
        found = find_motion(
            asked.question,
            Known(asked.known, asked.weights, duration / step, tuple(s.name for s in d.samples)),
            series,
            samples=SAMPLES,
            iterations=80,
            evaluations=1 if asked.same else evaluations,
            time_limit=None,
            seed=seed,
            name="next",
            say=say,
        )
        return _judge(d, asked, found)


def _judge(d: Findings, asked: Asked, found: Excitation) -> NextMotion:
    """Return the motion with the fewest periods that are likely to decide."""
    told = Told.of(asked.question, d)
    new = told.along(found.trajectory)
    chances = [asked.chance(told.known + k * new) for k in (0, *PERIODS)]
    likely = [k for k, chance in enumerate(chances) if chance >= LIKELY and k]
    at = likely[0] if likely else int(np.argmax(chances[1:])) + 1
    return NextMotion(
        names=asked.names,
        excitation=found,
        periods=(0, *PERIODS)[at],
        chance=chances[at],
        before=chances[0],
        hidden=asked.hidden,
        same=asked.same,
    )


def _told(text: str) -> str:
    """Return an effect at its place in words."""
    name, _, place = text.partition("@")
    return f"{title_of(name)} in {place.partition(':')[0]}" if place else title_of(name)


def _percent(share: float) -> str:
    return "more than 99 %" if share > 0.99 else f"{100 * share:.0f} %"
