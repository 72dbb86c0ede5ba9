"""What a diagnosis answers first: what is missing, what it explains, what is left, what next."""

from __future__ import annotations

import numpy as np

from identifiability.report.blocks import Answer, Answers, Sketch
from identifiability.report.figures.skeleton import Part
from identifiability.report.numbers import format_number, join, percent
from identifiability.report.sections.decision import (
    after_mass,
    answer_next,
    state_error,
    tone_of,
)
from identifiability.report.sections.drawn import moved_pose, sketch_parts
from identifiability.workflows.diagnose.findings import NamedEffect
from identifiability.workflows.diagnose.next_steps import next_commands
from identifiability.workflows.diagnose.result import Diagnosis
from identifiability.workflows.diagnose.words import headline

#: Places of an effect that the first line lists.
PLACES = 3


def answer_missing(d: Diagnosis) -> Answers:
    """Return the first screen of a diagnosis."""
    return Answers(
        (after_mass(_what(d), d.mass_warning), _gap(d), _left(d), answer_next(next_commands(d))),
        _sketch(d),
    )


def _what(d: Diagnosis) -> Answer:
    question = "What is missing?"
    if not d.effects:
        return Answer(question, "Nothing that can be named.", headline(d), "grey")
    named = [f"{_call(e)} in {join(e.joints, PLACES)}" for e in d.effects]
    short = join(named)
    return Answer(question, f"{short[0].upper()}{short[1:]}.", headline(d), "vermilion")


def _call(e: NamedEffect) -> str:
    """Return a name with what the motion cannot tell from it: the first line may not be surer."""
    others = len(e.alternatives)
    return e.names if others < 2 else f"{e.title} or one of {others} that look like it"


def _gap(d: Diagnosis) -> Answer:
    question = "How much of the gap does it explain?"
    if not d.effects:
        short = f"The error on unseen motion stays at {percent(d.held_before)}."
        return Answer(question, short, f"Measured on {d.verified_on}.")
    low, high = (format_number(100 * x, 2) for x in d.interval)
    falls = d.interval[1] < 0
    before, after = percent(d.held_before), percent(d.held_after)
    short = f"The error goes from {before} to {after}."
    if before == after:
        short = f"Hardly any: the error over all joints stays at {after}."
    text = (
        f"All joints together on {d.verified_on}, which took no part in fitting or choosing (95 % "
        f"of the change: {low} … {high} points)."
    )
    return Answer(question, short, text, "green" if falls else "amber")


def _left(d: Diagnosis) -> Answer:
    error = d.held_after if d.effects else d.held_before
    question = "How good is the model then?"
    if not np.isfinite(error):
        return Answer(question, "There is no error to tell.", d.unexplained, "grey")
    judged, short, spread = state_error(error, d.robot.joints, d.error_frame()["after"].to_numpy())
    return Answer(question, short, f"{spread}{d.unexplained}", tone_of(judged))


def _sketch(d: Diagnosis) -> Sketch | None:
    missing: dict[str, list[str]] = {}
    for e in d.effects:
        for p in e.placements:
            missing.setdefault(p.place, []).append(e.title)
    parts = {joint: Part("grey", "nothing was found to be missing") for joint in d.robot.joints}
    parts |= {place: Part("vermilion", f"misses {join(t)}") for place, t in missing.items()}
    robot = d.completed.robot
    return sketch_parts(robot, parts, "decision.missing", moved_pose(robot, d.samples))
