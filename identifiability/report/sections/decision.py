"""What every reader asks first: how good it is, and whether to trust it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.names import Array
from identifiability.report.blocks import Answer, Note
from identifiability.report.numbers import error_text, format_count
from identifiability.report.words import sentence

#: Error on unseen motion, of how much torque varies, up to which it is called so; a rule of thumb.
GRADES = ((0.03, "very-good"), (0.08, "good"), (0.15, "fair"), (0.5, "poor"), (np.inf, "useless"))


def grade_of(error: float) -> str:
    """Return the name of the grade of an error on unseen motion."""
    return next(name for limit, name in GRADES if error <= limit)


def tone_of(error: float) -> str:
    """Return the colour of an error on unseen motion."""
    tones = {"very-good": "green", "good": "green", "fair": "amber"}
    return tones.get(grade_of(error), "vermilion") if np.isfinite(error) else "grey"


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
    grade, tone = grade_of(error), tone_of(error)
    spread = ""
    if len(joints) > 1 and np.isfinite(each).all():
        low, high = int(np.argmin(each)), int(np.argmax(each))
        spread = (
            f"From {error_text(float(each[low]))} ({joints[low]}) to "
            f"{error_text(float(each[high]))} ({joints[high]}). "
        )
    short = sentence("decision.grades", grade, error=error_text(error))
    text = sentence("decision.quality", use=sentence("decision.uses", grade), spread=spread)
    return Answer("How good is it?", short, f"{text} Measured on {kind}.", tone)


def answer_trust(notes: Sequence[Note], doubt: str, found: int, size: int) -> Answer:
    """Return whether the result may be trusted: what speaks against it, by its titles."""
    question = "May I trust it?"
    if doubt:
        return Answer(question, "No.", f"{doubt[0].upper()}{doubt[1:]}", "vermilion")
    grave = [n.title.rstrip(".") for n in notes if n.level == "warning"]
    held = f"{found} of {format_count(size, 'value')} are identifiable"
    if not grave:
        return Answer(
            question,
            "Yes, within its intervals.",
            f"{held}; nothing was found that speaks against it.",
            "green",
        )
    seen = "; ".join(f"“{g}”" for g in dict.fromkeys(grave))
    return Answer(question, "With care.", f"{held}. Read below: {seen}.", "amber")
