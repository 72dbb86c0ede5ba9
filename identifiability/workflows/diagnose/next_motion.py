"""`NextMotion`: what to measure next, so that "A or B" becomes A, or B.

The motion makes the two as unlike as it can, beside everything else that the model has, together
with the logs there are. Whether it will decide hangs on how large the effect is over the noise:
the chance is that of the very rule by which `find_rivals` calls two names undecided.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from identifiability.effects import Part, Placed, find_family, title_of
from identifiability.effects.family import measure_spans
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.names import Array
from identifiability.foundation.options import Positive, Seed, at_least, checked, counted
from identifiability.foundation.output import write_json
from identifiability.foundation.threads import one_thread
from identifiability.foundation.values import frozen
from identifiability.regression.gather import gather_information
from identifiability.regression.model import Model
from identifiability.regression.regression import Regression
from identifiability.robot import complete_motion
from identifiability.workflows.diagnose.decision_chance import aim_at, decision_chance
from identifiability.workflows.diagnose.findings import Findings, NamedEffect, Placement
from identifiability.workflows.diagnose.lookalikes import Rival
from identifiability.workflows.diagnose.rows import list_candidates
from identifiability.workflows.excite import Excitation, Limits, find_limits
from identifiability.workflows.excite.candidates import Series
from identifiability.workflows.excite.question import Known, Question, pose_question
from identifiability.workflows.excite.workflow import find_motion
from identifiability.workflows.opening import Progress

#: Periods that a motion may be logged for: the fewest that are likely to decide.
PERIODS, LIKELY = (1, 2, 4, 8), 0.95
#: Share of its rms speed below which a joint counts for nothing.
SLOW = 0.05
#: Similarity from which on two effects are the same torque, and another motion changes nothing.
SAME = 0.999
#: Looks of the search, and samples a period.
EVALUATIONS, SAMPLES = 4000, 750


@frozen
class NextMotion:
    """The motion that tells two names apart, and how likely it does.

    Attributes
    ----------
    names : (str, str)
        What was named, and its rival, as a model file writes them.
    excitation : Excitation
        The motion, which begins and ends at rest.
    periods : int
        How often it is gone through.
    chance, before : float
        That the diagnosis of these logs and the new one gives one name, the true one, where the
        effect is as large as it was found; and of these logs anew.
    similarity : float
        Of the two with all of this.
    """

    names: tuple[str, str]
    excitation: Excitation
    periods: int
    chance: float
    before: float
    similarity: float

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        titles = [title_of(name.partition("@")[0]) for name in self.names]
        places = [name.partition("@")[2].partition(":")[0] for name in self.names]
        (first, second), place = titles, places[0]
        if places[1] != place:
            first, place = f"{first} in {place}", places[1]
        path, more = self.excitation.trajectory, f", {self.periods} times" * (self.periods > 1)
        if self.same:
            return (
                f"No motion was found that tells {first} from {second} in {place}: beside the rest "
                "of the model they are the same torque, and either predicts it."
            )
        return (
            f"To tell {first} from {second} in {place}, log this motion of {path.period:g} s{more}"
            ", which begins and ends at rest, and diagnose it with the logs there are: it decides "
            f"with a chance of {_percent(self.chance)}, if the effect is as large as it was found "
            f"(without it: {_percent(self.before)}). {self.excitation.limits_statement}"
        )

    @property
    def same(self) -> bool:
        """Whether both are one torque, however the robot moves."""
        return self.similarity > SAME

    def to_json(self, path: str | Path) -> Path:
        """Write a trajectory file: ``identifiability simulate ROBOT FILE.json`` follows it."""
        return write_json(path, self.to_dict())

    def to_dict(self) -> dict[str, Any]:
        """Return a trajectory file with what is known of the motion beside it."""
        told = {"separates": list(self.names), "chance": self.chance, "before": self.before}
        told |= {"periods": self.periods, "similarity": self.similarity}
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
    """Find the motion that decides between a name and the rival that it is most like.

    Parameters
    ----------
    d : Diagnosis
        Of which at least one name is "A or B"; of several the one with the largest torque.
    limits, duration, harmonics, evaluations, seed, progress
        As for `excite`.

    Raises
    ------
    IdentifiabilityError
        If nothing is undecided, or no motion keeps the robot's limits.
    """
    say = progress or (lambda what, share: None)
    with one_thread("blas"):
        effect, placement, rival = _choose_pair(d)
        bounds = find_limits(d.robot, limits)
        (named, shapes), (other, _) = (
            _place_all(d, name, place, bounds)
            for name, place in ((effect.name, placement.place), (rival.family, rival.place))
        )
        left = [text for text in d.model.texts if text != _text(effect.name, placement)]
        question = pose_question(d.robot, "separate", Model.of(*left), None, (named, other))
        weights = _weigh(d)
        known = _gram(question, d, weights)
        at = _find_part(d, placement, named, shapes)
        widths = [
            [len(Placed.part_parameters(d.robot, part)) for part in e.parts] for e in (named, other)
        ]
        aim = aim_at(question, known, widths, at, placement.values)
        question = replace(question, criterion=aim)
        step = float(np.median(np.diff(d.samples[0].output_times())))
        found = find_motion(
            question,
            Known(known, weights, duration / step, tuple(s.name for s in d.samples)),
            Series(bounds, duration, harmonics, at_rest=True),
            samples=SAMPLES,
            iterations=80,
            evaluations=evaluations,
            time_limit=None,
            seed=seed,
            name="next",
            say=say,
        )
        new = _gram_of_motion(question, d, weights, found)
        chances = [
            decision_chance(aim, known + periods * new, d.rules.confusable)
            for periods in (0, *PERIODS)
        ]
        likely = [k for k, chance in enumerate(chances) if chance >= LIKELY and k]
        at = likely[0] if likely else int(np.argmax(chances[1:])) + 1
        return NextMotion(
            names=(_text(effect.name, placement), other.texts[0]),
            excitation=found,
            periods=(0, *PERIODS)[at],
            chance=chances[at],
            before=chances[0],
            similarity=max(
                float(one.angles((known + (0, *PERIODS)[at] * new)[None])[0][0]) for one in aim.each
            ),
        )


def _choose_pair(d: Findings) -> tuple[NamedEffect, Placement, Rival]:
    """Return the undecided name with the largest torque, its place, and its rival.

    Of several rivals it is the most similar, one at the same place before one elsewhere.
    """
    found = [
        (p.rms, r.place == p.place, r.similarity, e, p, r)
        for e in d.effects
        for p in e.placements
        for r in p.rivals
        if r.undecided and r.family != e.name
    ]
    if not found:
        raise IdentifiabilityError(
            "Nothing that was named is undecided, so no motion is asked for; excite --separate "
            "tells any two effects apart."
        )
    *_, effect, placement, rival = max(found, key=lambda one: one[:3])
    return effect, placement, rival


def _text(name: str, placement: Placement) -> str:
    """Return what was named at a place, as a model file writes it."""
    place, shape = placement.place, placement.shape
    return f"{name}@{place}" if np.isnan(shape) else f"{name}@{place}:{float(shape)!r}"


def _place_all(d: Findings, name: str, place: str, limits: Limits) -> tuple[Placed, list[float]]:
    """Return a family at a place with all of its shapes, those of a wider motion too."""
    motions, family = [s.motion for s in d.samples], find_family(name)
    listed, _ = list_candidates(d.robot, [family], d.base, motions, fixed=d.fixed)
    kinds = list(dict.fromkeys(c.kinds for c in listed if c.place == place))
    span = measure_spans(d.robot, motions).get(place)
    shapes: tuple[float, ...] = (float("nan"),)
    if span is not None:
        shapes = family.grid(span)
        if place in limits.joints and family.shapes is not None:
            j = limits.joints.index(place)
            speed = max(float(limits.speed[j]), span.largest_speed)
            wider = replace(
                span,
                position_range=float(limits.high[j] - limits.low[j]),
                rms_speed=max(speed / 2, span.rms_speed),
                largest_speed=speed,
            )
            shapes = tuple(dict.fromkeys((*shapes, *family.grid(wider))))
    every = [(shape, own) for shape in shapes for own in kinds]
    parts = [Part(family.at(shape, place), place, own) for shape, own in every]
    return Placed(parts, [f"{name}@{place}"]), [shape for shape, _ in every]


def _find_part(d: Findings, placement: Placement, effect: Placed, shapes: list[float]) -> int:
    """Return which part of an effect with all of its shapes was found."""
    own = [
        tuple(p.name for p in Placed.part_parameters(d.robot, part)) == placement.parameters
        for part in effect.parts
    ]
    away = np.abs(np.nan_to_num(np.array(shapes) - placement.shape))
    return int(np.argmin(np.where(own, away, np.inf)))


def _weigh(d: Findings) -> Array:
    """Return the information that a sample of each joint has, (n,) [1/(N·m)² or 1/N²]."""
    memory = np.array([found.memory for found in d.discrepancies_after])
    rms = np.maximum(d.remainder.rms, 1e-12 * float(d.remainder.rms.max()) or 1.0)
    weights: Array = 1.0 / (rms**2 * np.maximum(memory, 1.0))
    return weights


def _gram(question: Question, d: Findings, weights: Array) -> Array:
    """Return what the fitted logs say of the columns of a question, (k, k)."""
    regression = Regression(d.robot, question.model, d.samples, question.columns)
    k = len(question.columns)
    R = gather_information(regression).factor(weights)[:k, :k]
    gram: Array = R.T @ R
    return gram


def _gram_of_motion(question: Question, d: Findings, weights: Array, found: Excitation) -> Array:
    """Return what one period of a motion would say of them, logged like the fitted logs."""
    t, q, v, a = found.motion
    motion = complete_motion(d.robot, t, q, v, a)
    W = question.model.regressor(d.robot, motion)[:, :, question.columns]
    step = float(np.median(np.diff(d.samples[0].output_times())))
    rows = found.trajectory.period / step
    W = W * np.sqrt(weights * rows / len(W))[:, None]
    # Near a reversal friction hangs on how its sign is smoothed, and logs leave rest out.
    W[np.abs(v) < SLOW * np.sqrt(np.mean(v**2, axis=0))] = 0.0
    flat = W.reshape(-1, W.shape[2])
    gram: Array = flat.T @ flat
    return gram


def _percent(share: float) -> str:
    return "more than 99 %" if share > 0.99 else f"{100 * share:.0f} %"
