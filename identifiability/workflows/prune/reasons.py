"""Why a rung was taken, in words."""

from __future__ import annotations

from identifiability.workflows.prune.elimination import Step
from identifiability.workflows.prune.moves import Kind


def explain(step: Step) -> str:
    """Return why a move was made."""
    move, evidence = step.move, step.evidence
    if move is None or evidence is None:
        return f"{move.why}." if move is not None else "Every base parameter of the model."
    rise = evidence.say_rise()
    if move.kind is Kind.FORCED:
        return f"{move.why}; {rise}."
    if move.kind is Kind.DROP:
        text = (
            "Not significant" if evidence.p_value > 0.05 else "The least costly of what is left"
        ) + f" (p = {evidence.p_value:.2g}); {rise}."
        if evidence.either:
            text += (
                f" These logs hardly tell it from {evidence.either}: either of the two can stand "
                "for both."
            )
        return text
    if evidence.p_value > 0.05:
        verdict = "the data do not contradict it"
    elif evidence.rise <= evidence.rise_se:
        verdict = "the difference is significant but does not help on unseen motion"
    else:
        verdict = "the data speak against it, but not clearly enough to refuse it"
    return f"{move.why}; {verdict} (p = {evidence.p_value:.2g}); {rise}."
