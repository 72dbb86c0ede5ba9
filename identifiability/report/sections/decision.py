"""What every reader asks first: how good it is, and whether to trust it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.foundation.names import Array
from identifiability.report.blocks import Answer, Note
from identifiability.report.numbers import error_text, format_count
from identifiability.report.words import sentence
from identifiability.workflows.analyze.words import grade_of

#: Error from which on a joint by itself is no longer good where all together are.
FEW = 0.15


#: Share of the smallest error of a joint below which that of all joints says little of any.
MUCH = 0.8


def tone_of(error: float) -> str:
    """Return the colour of an error on unseen motion."""
    tones = {"very-good": "green", "good": "green", "fair": "amber"}
    return tones.get(grade_of(error), "vermilion") if np.isfinite(error) else "grey"


def after_mass(answer: Answer, warning: str) -> Answer:
    """Return the first answer of a page behind what is wrong with the total mass, if anything is.

    Parameters
    ----------
    answer : Answer
    warning : str
        What `state_mass` says.
    """
    if not warning:
        return answer
    total, _, why = warning.partition(": ")
    why = f"{why[0].upper()}{why[1:]} {answer.text}"
    return replace(answer, short=f"{total}. {answer.short}", text=why, tone="vermilion")


def answer_next(commands: Sequence[tuple[str, str]]) -> Answer:
    """Return what to do next, with lines for the terminal."""
    one = "this" if len(commands) == 1 else "one of these"
    short = f"Run {one} where robot and logs are."
    return Answer("What next?", short, commands=tuple(commands))


def answer_quality(error: float, joints: Sequence[str], each: Array, kind: str) -> Answer:
    """Return how good the predictions are, in words, and where they are best and worst.

    Parameters
    ----------
    error : float
        On unseen motion, relative to how much torque varies.
    joints : sequence of str
    each : (n,)
        The same of each joint over its own scale.
    kind : str
        What it was measured on.
    """
    if not np.isfinite(error):
        return Answer("How good is it?", "There is no error to tell.", tone="grey")
    judged, short, spread = state_error(error, joints, each)
    use = sentence("decision.uses", grade_of(judged))
    text = sentence("decision.quality", use=use, spread=spread)
    return Answer("How good is it?", short, f"{text} Measured on {kind}.", tone_of(judged))


def state_error(error: float, joints: Sequence[str], each: Array) -> tuple[float, str, str]:
    """Return the error that a model is judged by, that in a word, and what is said of joints.

    Joints whose loads differ make the torque of all together vary more than that of any: then the
    error of all together is smaller than that of each, and joints are judged by their own.

    Parameters
    ----------
    error, joints, each
        As for `answer_quality`.
    """
    known = len(joints) > 1 and bool(np.isfinite(each).all())
    if not known:
        return error, sentence("decision.grades", grade_of(error), error=error_text(error)), ""
    low, high = int(np.argmin(each)), int(np.argmax(each))
    ends = [f"{error_text(float(each[k]))} ({joints[k]})" for k in (low, high)]
    if error >= MUCH * each[low]:
        short = sentence("decision.grades", grade_of(error), error=error_text(error))
        if tone_of(error) == "green" and each[high] > FEW:
            short = short.replace(":", f", but not in {joints[high]}:", 1)
        return error, short, f"From {ends[0]} to {ends[1]}, each joint by itself. "
    judged = float(np.sqrt(np.mean(each**2)))
    short = sentence("decision.grades", grade_of(judged), error=" to ".join(ends))
    return judged, short, sentence("decision.together", error=error_text(error))


def answer_trust(
    notes: Sequence[Note], doubt: str, found: int, size: int, missing: str = ""
) -> Answer:
    """Return whether the result may be trusted: what speaks against it, by its titles.

    Parameters
    ----------
    notes : sequence of Note
    doubt : str
        Why nothing is believed; empty where something is.
    found, size : int
        Parameters that are identifiable, and all.
    missing : str
        What the model surely misses, and how much (`Doubt.statement`).
    """
    question = "May I trust it?"
    if doubt:
        return Answer(question, "No.", f"{doubt[0].upper()}{doubt[1:]}", "vermilion")
    grave = [n.title.rstrip(".") for n in notes if n.level == "warning"]
    held = f"{found} of {format_count(size, 'value')} are identifiable"
    if missing:
        more = "".join(f" Read below: “{g}”." for g in dict.fromkeys(grave))
        text = f"{missing[0].upper()}{missing[1:]}: diagnose. {held}.{more}"
        return Answer(question, "Only if nothing is missing.", text, "amber")
    if not grave:
        return Answer(
            question,
            "Yes, within its intervals.",
            f"{held}; nothing was found that speaks against it.",
            "green",
        )
    seen = "; ".join(f"“{g}”" for g in dict.fromkeys(grave))
    return Answer(question, "With care.", f"{held}. Read below: {seen}.", "amber")
