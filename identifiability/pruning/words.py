"""Pruning in words and as a ladder file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from identifiability.errors import listing
from identifiability.pruning.elimination import Step
from identifiability.pruning.moves import Kind
from identifiability.statement import state_physics
from identifiability.verdict import Class

if TYPE_CHECKING:
    from identifiability.pruning.result import Ladder


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


def statement(ladder: Ladder) -> str:
    """Return the answer in plain words."""
    chosen, full = ladder.chosen, ladder.full
    if ladder.nothing:
        return f"Nothing is identifiable, because {ladder.nothing}."
    if len(chosen) == len(full):
        text = (
            f"Nothing was pruned: each of the {len(full)} parameters of the model is needed to "
            "predict motion that the fit has not seen."
        )
    else:
        text = (
            f"Of {len(full)} parameters {len(chosen)} are worth using: "
            f"{listing(chosen.columns, 14)}. "
            f"{_identifiable(ladder)}. They predict unseen motion with an error of "
            f"{_percent(chosen.error_ra_unseen)}, the unpruned model with "
            f"{_percent(full.error_ra_unseen)}."
        )
    if np.isfinite(chosen.error_ra_validation):
        text += (
            f" On the logs held out for validation it is "
            f"{_percent(chosen.error_ra_validation)} against {_percent(full.error_ra_validation)}."
        )
    return f"{text} {state_physics(ladder.robot, ladder.result)}"


def _identifiable(ladder: Ladder) -> str:
    if ladder.result.unjudged:
        return f"None of them is judged. {ladder.result.unjudged.removesuffix('.')}"
    count = ladder.result.count(Class.IDENTIFIABLE)
    total = len(ladder.chosen)
    return "All are identifiable" if count == total else f"{count} of them are identifiable"


def _percent(error: float) -> str:
    return f"{100 * error:.3g} %" if np.isfinite(error) else "unknown size"
